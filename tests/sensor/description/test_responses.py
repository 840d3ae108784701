"""Spatial responses that may be asked for, and what is known of an instrument's own."""

from dataclasses import replace

import pytest

from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.provenance import band_provenance
from fifesim.sensor.description.spatial_response import knows_blur, with_response


def test_responses_that_can_be_asked_for():
    tm, msi = instrument("TM"), instrument("MSI")
    paper = instrument("TM", "paper")
    assert paper.lsf == tm.paper_lsf and "Friedl" in paper.source("lsf") and "blur" not in paper.origin
    assert instrument("MSI", "system") == msi and instrument("TM", "system") == tm
    for description in (tm, msi):
        sharp = with_response(description, "detector")
        for band, own in zip(sharp.bands, description.bands, strict=True):
            fields, intervals = description.ground_fields(own), description.ground_intervals(own)
            widths = fields if fields.along else intervals
            assert [spread.width for spread in sharp.line_spreads(band)] == list(widths)
            assert not knows_blur(sharp, band)
    dove = instrument("SuperDove")
    assert not any(knows_blur(dove, band) for band in dove.bands) and all(knows_blur(msi, band) for band in msi.bands)


@pytest.mark.parametrize("name", ["TM", "OLI", "VIIRS", "MSI"])
def test_ends_of_the_uncertainty_are_that_far_from_the_best_transfer(name):
    """VIIRS by its elementary samples: the uncertainty is stated before aggregation."""
    best, ends = instrument(name), [instrument(name, each) for each in ("sharpest", "softest")]
    for number, band in enumerate(best.bands):
        error = band_provenance(best, "blur", band).uncertainty
        steps = best.ground_intervals(band)
        own, high, low = (
            [
                float(lsf.mtf(0.5 / step))
                for lsf, step in zip(each.line_spreads(each.bands[number], 1), steps, strict=True)
            ]
            for each in (best, *ends)
        )
        if best.scan.zones:
            assert [high[0] - own[0], own[0] - low[0]] == pytest.approx([error] * 2, rel=1e-6)
            assert high[1] > own[1] > low[1]
        else:
            assert [a - b for a, b in zip(high, own, strict=True)] == pytest.approx([error] * 2, rel=1e-6)
            assert [b - a for a, b in zip(low, own, strict=True)] == pytest.approx([error] * 2, rel=1e-6)
    with pytest.raises(ValueError, match="states no uncertainty of the blur of TM1"):
        instrument(instrument("TM", "paper"), "softest")


def test_a_sharp_band_has_the_sources_of_what_it_keeps():
    tm = instrument("TM")
    own = replace(tm.bands[0], sources={"lsf": "Markham1985", "bits": "Chander2009"})
    sharp = with_response(replace(tm, bands=(own, *tm.bands[1:])), "detector").bands[0]
    assert sharp.sources == {"bits": "Chander2009", "ifov": tm.sources["interval"]}


@pytest.mark.parametrize(
    ("name", "response", "said"),
    [
        ("SuperDove", "system", "SuperDove has no 'system' response: type response='detector'"),
        ("MSI", "paper", "MSI has no 'paper' response"),
        ("TM", "sharp", "response must be one of system, detector, paper, sharpest, softest, got 'sharp'"),
    ],
)
def test_responses_that_no_file_has(name, response, said):
    with pytest.raises(ValueError, match=said):
        instrument(name, response)
