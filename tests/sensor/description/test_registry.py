"""Instrument files of the package compared with published values, and their listing."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.base import files
from fifesim.sensor.description.fields import Angles, band_called
from fifesim.sensor.description.instruments import instrument, instrument_names, read_instrument
from fifesim.sensor.description.listing import blur_in_words, instrument_in_words, list_instruments, noise_in_words
from fifesim.sensor.description.plausibility import check_instrument_units
from fifesim.sensor.description.provenance import band_provenance
from fifesim.sensor.response.calibration import gain_offset
from fifesim.sensor.response.scan import EARTH_RADIUS, ground_of_detector, swath_width, view_from_scan

DATA = Path(__file__).parents[2] / "data"
FILES = sorted(files.path("instruments").glob("*.toml"))
FIGURES = pd.read_csv(DATA / "instrument_figures.csv", comment="#")
NAMES = pd.read_csv(DATA / "instrument_names.csv", comment="#", dtype=str)
HYPERSPECTRAL = ("EMIT", "EnMAP", "PRISMA")
EACH = pytest.mark.parametrize("name", instrument_names())


def band(name, which):
    return instrument(name).select(which)[0]


# ------------------------------------------------------------------------------------------- published figures


def mean_wavenumber(response):
    wavenumber, weight = 1e4 / np.array(response.wavelength)[::-1], np.array(response.response)[::-1]
    return np.trapezoid(weight * wavenumber, wavenumber) / np.trapezoid(weight, wavenumber)


def equivalent_width(response):
    return 1000 * np.trapezoid(response.response, response.wavelength) / max(response.response)


def transfer(item, each):
    """Modulation transfer at the Nyquist frequency by a numerical cosine transform of the response."""
    found = []
    for spread, step in zip(item.line_spreads(each), item.ground_intervals(each), strict=True):
        edges = np.linspace(-spread.half_width, spread.half_width, 40001)
        middle, weight = (edges[1:] + edges[:-1]) / 2, np.diff(spread.cumulative(edges))
        found.append(weight @ np.cos(np.pi * middle / step))
    return found


def ends_of(each):
    return each.full_scale_radiance, each.min_radiance


def radiance_of(item, each, count):
    gain, offset = gain_offset(*ends_of(each), item.bits)
    return count * gain + offset


def pixel_size(item, each, scan_angle):
    """Pixel size along track (between the two middle lines) and across track (between sample edges). [m]"""
    pattern = item.scan_pattern(each)
    edges = pattern.scan_angle(np.floor(pattern.position(scan_angle)) + np.array([0, 1]))
    across = np.diff(np.radians(view_from_scan(edges, item.altitude)[1])) * EARTH_RADIUS
    lines = pattern.track_angle()[pattern.lines // 2 - 1 :][:2]
    ahead, aside = ground_of_detector(lines, edges.mean(), item.altitude)
    return float(np.diff(ahead)[0] * np.cos(np.radians(aside[0]))), float(across[0])


MEASURES = {
    "wavelength": lambda item, each, at: 1000 * each.wavelength,
    "wavenumber": lambda item, each, at: mean_wavenumber(each.response),
    "width": lambda item, each, at: equivalent_width(each.response),
    "interval": lambda item, each, at: item.ground_intervals(each),
    "transfer": lambda item, each, at: transfer(item, each),
    "step": lambda item, each, at: gain_offset(*ends_of(each), item.bits)[0],
    "bits": lambda item, each, at: item.bits,
    "snr": lambda item, each, at: item.noise_model(each).snr(at),
    "noise": lambda item, each, at: item.noise_model(each).noise_equivalent_radiance(at),
    "swath": lambda item, each, at: swath_width(item.altitude, item.scan.max_angle) / 1000,
    "reflectance": lambda item, each, at: np.pi * np.array(ends_of(each)) / each.solar_irradiance,
    "albedo": lambda item, each, at: 100 * np.pi * radiance_of(item, each, at) / each.solar_irradiance,
    "pixel": pixel_size,
}


@pytest.mark.parametrize("quantity", MEASURES)
def test_values_agree_with_published_figures(quantity):
    rows = FIGURES[FIGURES["quantity"] == quantity]
    assert len(rows) >= 7
    for row in rows.itertuples():
        found = MEASURES[quantity](instrument(row.instrument), band(row.instrument, row.band), row.at)
        known = row.value if np.isnan(row.across) else (row.value, row.across)
        rtol, atol = np.nan_to_num([row.rtol, row.atol])
        # The numerical cosine transform is accurate to 1e-6.
        atol = max(atol, 1e-6) if quantity == "transfer" else atol
        np.testing.assert_allclose(
            found, known, rtol=rtol, atol=atol, err_msg=f"{row.instrument} {row.band} {row.source}"
        )


def test_assumed_blur_is_marked_and_detector_responses_are_boxcars():
    for row in FIGURES[FIGURES["source"] == "assumed"].itertuples():
        blur = band_provenance(instrument(row.instrument), "blur", band(row.instrument, row.band))
        assert blur.origin == "assumed" and blur.uncertainty >= 0.06 and blur.source.startswith("Assumed"), row
    for name, which in (("OLI", "OLI4"), ("MSI", "MSI10"), ("HRV", "XS1"), ("ETM+", "ETM8")):
        item = instrument(name, "detector")
        np.testing.assert_allclose(transfer(item, item.select(which)[0]), 2 / np.pi, rtol=1e-6)


@pytest.mark.parametrize("row", list(NAMES.fillna("").itertuples(index=False)), ids=lambda row: row.name)
def test_common_names_of_instruments_and_bands_are_recognized(row):
    if row.instrument:
        found = band_called(row.name, instrument(row.instrument))
        assert (found.name if found else "") == row.meaning
    else:
        assert instrument(row.name) is instrument(row.name.upper()) is instrument(row.meaning)


# ------------------------------------------------------------------------------------------- the whole registry


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_file_passes_the_checks_for_user_files_and_can_be_pickled(path):
    item = read_instrument(path)
    assert item == instrument(item.name) and item.name in instrument_names()
    again = pickle.loads(pickle.dumps(item))
    assert again == item and {item: 1}[again] == 1
    assert "left out" in " ".join(path.read_text(encoding="utf-8").replace("\n#", " ").split())


@EACH
def test_every_number_has_a_source_or_a_search_note_and_every_reference_is_used(name):
    item = instrument(name)
    text, names = instrument_in_words(item), sorted(each.name for each in item.bands)
    used = {item.source(number) for number in ("altitude", "gsd", "interval", "bits", "lsf")}
    used |= {item.references[key] for key in item.sources.values()}
    for each in item.bands:
        numbers = ("srf", "full_scale_radiance", "min_radiance", "solar_irradiance", *each.sources)
        used |= {item.source(number, each) for number in numbers}
        # OLI products have reflectances down to -0.1, others less; the smallest radiance of MSS is above 0.
        above = 0.04 * each.full_scale_radiance if name.startswith("MSS") else 0.0
        assert -above <= -each.min_radiance < 0.09 * each.full_scale_radiance < 0.09 * each.solar_irradiance
    assert used == set(item.references.values()) and all(len(each) > 20 and each in text for each in used)
    for row in item.provenance:
        stated = item.origin | {key: value for each in item.select(row.bands) for key, value in each.origin.items()}
        assert len(row.source) > 20 and row.quantity in (stated if row.origin != "unknown" else item.not_found), row
        assert row.origin == "assumed" or not row.source.startswith(("Recalled", "Assumed")), row
    for quantity in ("blur", "noise", "geolocation"):
        assert sorted(each for row in item.provenance if row.quantity == quantity for each in row.bands) == names
    assert text.count("not known: ") == len(item.not_found) and all(who in text for who in item.not_found.values())


def test_band_names_are_unique_to_an_instrument_family():
    """Bands of different instruments are not confused, e.g. MODIS1 (red) and MSI1 (aerosol)."""
    family = {"L4TM": "TM", "OLI2": "OLI", "MSI-B": "MSI", "MSI-C": "MSI", "MODIS-Aqua": "MODIS"}
    owner = {}
    for name in instrument_names():
        kind = family.get(name, "MSS" if name.startswith("MSS") else "AVHRR" if name.startswith("AVHRR") else name)
        assert all(owner.setdefault(each.name, kind) == kind for each in instrument(name).bands), name


# ------------------------------------------------------------------------------------------- solar irradiance


@EACH
def test_stated_irradiance_agrees_with_the_solar_spectrum(name):
    """
    Agencies use other spectra than ASTM G173: 4.5 % up to 2.4 um.

    Exceptions: coastal and cirrus bands of OLI (5.1 and 4.5 %), MODIS 5 and 7 in the short-wave infrared (5.9 %).
    Hyperspectral tables use ASTM G173; two more digits of the responses change the irradiance by 0.1 % near lines.
    """
    apart = {"OLI1": 0.055, "OLI9": 0.05, "MODIS5": 0.06, "MODIS7": 0.06}
    for each in instrument(name).bands:
        narrow = name in HYPERSPECTRAL
        rtol = 2e-4 if narrow else apart.get(each.name, 0.045)
        np.testing.assert_allclose(each.solar_irradiance, each.spectrum_irradiance, rtol=rtol, err_msg=each.name)
        if narrow:
            np.testing.assert_allclose(each.full_scale_radiance * np.pi, each.solar_irradiance, rtol=2e-4)
            assert each.min_radiance == 0


# ------------------------------------------------------------------------------------------- blur, gain and noise


def test_mss5_mtf_is_half_at_the_published_eifov():
    """Markham 1985, abstract: 70-75 m along track and 79-82 m across track."""
    along, across = instrument("MSS5").line_spreads(band("MSS5", "MSS2"))
    np.testing.assert_allclose([along.mtf(0.5 / 72.5), across.mtf(0.5 / 80.5)], 0.5, rtol=1e-3)


def test_gain_states_agree_with_handbooks():
    """ETM+: radiance of digital numbers 1 and 255 after 1 July 2000. HRV: gains increase by a factor of 1.3."""
    item = instrument("ETM+")
    low = item.with_gain("low")
    for state, full, first in ((item, 157.4, -5.1), (low, 241.1, -5.1)):
        (each,) = state.select("ETM4")
        found = [radiance_of(state, each, count) for count in (1, 255)]
        np.testing.assert_allclose(found, [first, full], atol=1e-3)
    assert [each.gain for each in low.bands] == ["low"] * 7
    assert low.with_gain({"ETM4": "high"}).select("ETM4") == item.select("ETM4")
    assert [each.gain for each in item.bands] == ["high"] * 6 + ["low"]
    check_instrument_units(low)
    for each in instrument("HRV").bands:
        full = [each.with_gain(f"m{number}").full_scale_radiance for number in range(3, 9)]
        np.testing.assert_allclose(np.array(full[:-1]) / full[1:], 1.3, rtol=1e-3)
    check_instrument_units(instrument("HRV").with_gain("m3"))


def test_blur_and_noise_have_origin_and_detectors():
    origins = {("MSI", "MSI4"): "pre-launch", ("MSI-B", "MSI4"): "pre-launch", ("MSI-C", "MSI4"): "in-flight"}
    origins |= {("MSI", "MSI11"): "required", ("MODIS", "MODIS1"): "required", ("MODIS-Aqua", "MODIS1"): "in-flight"}
    for key, origin in origins.items():
        assert band_provenance(instrument(key[0]), "noise", band(*key)).origin == origin
    blur = band_provenance(instrument("TM"), "blur", band("TM", "TM4"))
    assert blur.origin == "in-flight" and blur.uncertainty == 0.12 and "San Mateo" in blur.source
    modis, msi = instrument("MODIS"), instrument("MSI")
    assert [modis.noise_model(each).detectors for each in modis.bands] == [40, 40] + [20] * 5
    assert {msi.noise_model(each).along for each in msi.bands} == {"columns"}


def test_tm_noise_with_quantisation_is_one_digital_number():
    item = instrument("TM")
    for each in item.bands:
        step = (each.full_scale_radiance - each.min_radiance) / 255
        noise = item.noise_model(each).noise_equivalent_radiance((each.full_scale_radiance + each.min_radiance) / 2)
        assert np.hypot(noise, step / np.sqrt(12)) == pytest.approx(step, rel=2e-3)


@pytest.mark.parametrize(
    ("name", "numbers"), [("MSS", "4567"), ("MSS2", "4567"), ("MSS3", "4567"), ("MSS4", "1234"), ("MSS5", "1234")]
)
def test_mss_has_three_compressed_bands_and_six_lines_per_sweep(name, numbers):
    item = instrument(name)
    assert [each.compression for each in item.bands] == ["square-root"] * 3 + [None]
    assert [each.compressed_count(item.bits) for each in item.bands] == [63, 63, 63, 0]
    assert (item.detectors, item.scan.lines, item.scan.kind) == (6, 6, "whiskbroom")
    assert [each.name for each in item.bands] == [f"MSS{number}" for number in numbers]
    for each, (low, high) in zip(item.bands, [(0.5, 0.6), (0.6, 0.7), (0.7, 0.8), (0.8, 1.1)], strict=True):
        assert each.limits == (low, high) and low < each.wavelength < high


# ------------------------------------------------------------------------------------------- listing


def test_summary_has_the_values_of_the_instrument():
    """
    Table 1: 43 urad from 705 km; the MTF of the cosine is 0.69 at Nyquist; 205.5 / 255 per count.

    The cosine has a higher MTF than a detector as wide as the field of view. Detectors of 1/2 and 1/4 of the interval
    have sinc(1/4) = 0.90 and sinc(1/8) = 0.97.
    """
    paper, dove, step = instrument("TM", "paper"), instrument("SuperDove"), 42.5e-6
    oli = instrument("OLI", "detector")
    wide = replace(
        oli, interval=Angles(along=4 * step, across=8 * step), ifov=2 * step, bands=instrument("OLI").bands[:1]
    )
    (red,) = [line.split() for line in instrument_in_words(paper).splitlines() if line.startswith("  TM3")]
    assert red[5:8] == ["-1.20", "204.30", "0.8059"]
    for item, lines in (
        (paper, ["altitude 705 km, 8 bits", "own interval 30.315 m at nadir", "of the own interval 0.69\n"]),
        (
            paper,
            ["whiskbroom, 7.47 degrees to either side, swath 185 km", "detector alone has 0.64: images are sharper"],
        ),
        (wide, ["of the own interval 0.90 along x 0.97 across"]),
        (instrument("MODIS"), ["  MODIS3, MODIS4, MODIS5, MODIS6, MODIS7: pixels of 500 m"]),
        (instrument("MSI"), ["  Level-1 product: 0.0001 x DN -0.1 is reflectance, 16 bits"]),
        (instrument("OLI2"), ["is reflectance x cosine of the solar zenith angle, 16 bits"]),
    ):
        assert all(line in instrument_in_words(item) for line in lines), item.name
    assert "the detector alone has" not in instrument_in_words(instrument("MODIS"))
    listed = list_instruments([instrument(name) for name in instrument_names()]).splitlines()
    assert [line.split()[0] for line in listed] == ["name", *instrument_names()]
    assert noise_in_words(instrument("OLI"), ["OLI4"]) == "none"
    assert noise_in_words(dove, ["PS6", "PS8"]).startswith("none; the noise of PS6, PS8 is unknown, a public list")
    assert blur_in_words(dove, ["PS6"]).endswith(f"so the image is too sharp, {dove.not_found['blur']}")
    assert "sharper" not in blur_in_words(instrument("MSI"), ["MSI4"])
    assert blur_in_words(paper, ["TM3"]).endswith("0.69; the detector alone has 0.64: the image of TM3 is sharper")
