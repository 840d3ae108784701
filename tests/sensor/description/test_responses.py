"""Spatial responses of instrument files, and spectral responses from a list, a table and pyrsr."""

from dataclasses import replace

import numpy as np
import pytest
from paper_file import paper_text
from pyrsr.rsr import RSR_reader

from fifesim.base.bands import Band
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.provenance import band_provenance
from fifesim.sensor.description.spatial_response import knows_blur, with_response
from fifesim.sensor.description.spectral_response import PyrsrResponse, ResponseList, half_peak

TM_TEXT = paper_text()
LSF = TM_TEXT[TM_TEXT.index('kind = "cosine"') : TM_TEXT.index("[scan]")]
IFOV = ("bits = 8 ", "ifov = 43.0e-6\nbits = 8 ", 'bits = "Friedl1995"', 'bits = "Friedl1995"\nifov = "Friedl1995"')


def nyquist(item):
    band = item.bands[0]
    spreads, steps = item.line_spreads(band), item.ground_intervals(band)
    return [float(lsf.mtf(0.5 / step)) for lsf, step in zip(spreads, steps, strict=True)]


NU = 1e-6 * instrument("TM").bands[0].wavelength / (2 * 43e-6 * 0.02)
CIRCLE = 2 / np.pi * (np.arccos(NU) - NU * np.sqrt(1 - NU**2))


@pytest.mark.parametrize(
    ("lsf", "expected", "atol"),
    [
        # Boxcar as wide as the interval; Gaussians: given MTF, exp(-(pi W / d)^2 / (16 ln 2)) and 2^-(E / d)^2.
        ('kind = "boxcar"\nwidth = 43.0e-6', 2 / np.pi, 1e-7),
        ('kind = "gaussian"\nmtf_at_nyquist = 0.3', 0.3, 1e-7),
        ('kind = "gaussian"\nfwhm = 43.0e-6', np.exp(-(np.pi**2) / (16 * np.log(2))), 1e-7),
        ('kind = "gaussian"\neifov = 43.0e-6', 0.5, 1e-7),
        # Triangle twice as wide as the interval.
        ('kind = "table"\nangles = [-43.0e-6, 0.0, 43.0e-6]\nvalues = [0.0, 2.0, 0.0]', (2 / np.pi) ** 2, 1e-7),
        # Detector and smear sinc(1/2) each, electronics 1/sqrt(2) at the cutoff, and diffraction of a circular aperture
        # at nu = wavelength / (2 interval aperture); 3e-4 of the response is truncated.
        (
            'kind = "system"\nsmear = 1.0\nelectronics = 0.5\naperture = 0.02\ntruncation = 3e-4',
            (2 / np.pi) ** 2 / np.sqrt(2) * CIRCLE,
            5e-4,
        ),
        # The MTF of optics with FWHM W is exp(-(pi W f)^2 / (4 ln 2)), of boxcars sinc(W f).
        (
            'kind = "system"\nblur = 0.4\nsmear = 0.5\ndetector = 0.9',
            np.exp(-((np.pi * 0.4 * 0.5) ** 2) / (4 * np.log(2))) * np.sinc(0.45) * np.sinc(0.25),
            2e-3,
        ),
    ],
)
def test_each_kind_of_response_has_the_stated_mtf(changed, lsf, expected, atol):
    np.testing.assert_allclose(nyquist(changed(LSF, lsf + "\n", *IFOV)), expected, rtol=0, atol=atol)


def test_responses_may_differ_by_axis_and_band(changed):
    axes = '[lsf.along]\nkind = "boxcar"\n[lsf.across]\nkind = "gaussian"\nmtf_at_nyquist = 0.4\n'
    mine = changed("[lsf] ", "#", LSF, axes, *IFOV)
    np.testing.assert_allclose(nyquist(mine), [2 / np.pi, 0.4], rtol=1e-9)
    wider = changed('name = "TM1"', 'name = "TM1"\nlsf = { kind = "boxcar", width = 86.0e-6 }')
    np.testing.assert_allclose(nyquist(wider), np.sinc(1.0), atol=1e-12)
    np.testing.assert_allclose(wider.line_spreads(wider.bands[1]).along.width, 30.31641, rtol=1e-12)


def test_named_responses():
    tm, msi, dove = instrument("TM"), instrument("MSI"), instrument("SuperDove")
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
    assert not any(knows_blur(dove, band) for band in dove.bands) and all(knows_blur(msi, band) for band in msi.bands)
    # A band with the detector response keeps only the applicable sources.
    own = replace(tm.bands[0], sources={"lsf": "Markham1985", "bits": "Chander2009"})
    sharp = with_response(replace(tm, bands=(own, *tm.bands[1:])), "detector").bands[0]
    assert sharp.sources == {"bits": "Chander2009", "ifov": tm.sources["interval"]}


@pytest.mark.parametrize("name", ["TM", "OLI", "VIIRS", "MSI"])
def test_sharpest_and_softest_mtf_differ_by_the_uncertainty(name):
    """For VIIRS the uncertainty is stated before aggregation, i.e. for elementary samples."""
    best, ends = instrument(name), [instrument(name, each) for each in ("sharpest", "softest")]
    for number, band in enumerate(best.bands):
        error = band_provenance(best, "blur", band).uncertainty
        steps = best.ground_intervals(band)
        own, high, low = (
            np.array(
                [lsf.mtf(0.5 / step) for lsf, step in zip(each.line_spreads(each.bands[number], 1), steps, strict=True)]
            )
            for each in (best, *ends)
        )
        axes = slice(1) if best.scan.zones else slice(2)
        np.testing.assert_allclose([(high - own)[axes], (own - low)[axes]], error, rtol=1e-6)
        assert high[1] > own[1] > low[1]


@pytest.mark.parametrize(
    ("name", "response", "said"),
    [
        ("SuperDove", "system", "SuperDove has no 'system' response: type response='detector'"),
        ("MSI", "paper", "MSI has no 'paper' response"),
        ("TM", "sharp", "response must be one of system, detector, paper, sharpest, softest, got 'sharp'"),
        (instrument("TM", "paper"), "softest", "states no uncertainty of the blur of TM1"),
    ],
)
def test_unavailable_response_raises(name, response, said):
    with pytest.raises(ValueError, match=said):
        instrument(name, response)


# ------------------------------------------------------------------------------------------- spectral responses


PYRSR = '{ satellite = "Landsat-5", sensor = "TM", band = "3" }'


def test_response_is_read_from_a_list_or_a_table(changed, tmp_path):
    rows = "wavelength = [0.60, 0.63, 0.69, 0.72], response = [0.0, 1.0, 1.0, 0.0]"
    mine = changed(f"srf = {PYRSR}", f"srf = {{ {rows} }}")
    # The centre of a symmetric trapezoid is its midpoint.
    np.testing.assert_allclose(mine.select("TM3")[0].wavelength, 0.66, rtol=1e-12)
    table = "satellite,band,wavelength,response\nX,1,0.60,0\nX,1,0.63,1\nX,1,0.69,1\nX,1,0.72,0\n"
    (tmp_path / "own.csv").write_text("# columns\n" + table, encoding="utf-8")
    other = changed(f"srf = {PYRSR}", 'srf = { table = "own.csv", satellite = "X", band = "1" }')
    assert other.select("TM3")[0].response == mine.select("TM3")[0].response


def test_response_of_pyrsr_is_in_micrometres_and_not_negative():
    """pyrsr has TM in nm or um; negative values are noise."""
    found = PyrsrResponse("Landsat-5", "TM", "3").read("TM3")
    theirs = RSR_reader("Landsat-5", "TM", LayerBandsAssignment=["3"])["3"]
    assert 0.5 < found.wavelength[0] < 0.66 < found.wavelength[-1] < 0.8 and min(found.response) >= 0
    np.testing.assert_allclose(found.response, np.maximum(theirs[:, 1], 0))


def test_limits_lie_at_half_maximum():
    found = ResponseList((0.5, 0.6, 0.7, 0.8, 0.9), (0.0, 1.0, 2.0, 1.0, 0.9)).read("a")
    assert found == Band("a", (0.5, 0.6, 0.7, 0.8, 0.9), (0.0, 1.0, 2.0, 1.0, 0.9))
    assert half_peak(found) == (0.6, 0.8)
