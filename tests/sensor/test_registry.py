"""Each instrument that is shipped reproduces its published figures from its file."""

import pickle
import tomllib

import numpy as np
import pandas as pd
import pytest

from fifesim.base import files
from fifesim.sensor.description.fields import band_called
from fifesim.sensor.description.instruments import instrument, instrument_names, read_instrument
from fifesim.sensor.description.listing import instrument_in_words
from fifesim.sensor.description.plausibility import check_instrument_units
from fifesim.sensor.description.provenance import band_provenance
from fifesim.sensor.response.calibration import gain_offset, radiance_to_reflectance, reflectance_to_radiance
from fifesim.sensor.response.scan import swath_width

FILES = sorted(files.path("instruments").glob("*.toml"))
LANDSAT = ("TM", "L4TM", "ETM+", "OLI", "OLI2")
MSI, MODIS = ("MSI", "MSI-B", "MSI-C"), ("MODIS", "MODIS-Aqua")


def bands_of(*names):
    return [pytest.param(name, band, id=f"{name}-{band.name}") for name in names for band in instrument(name).bands]


def band(name, which):
    return instrument(name).select(which)[0]


# -------------------------------------------------------------------------------------------- the whole registry


def test_registry_has_every_instrument_that_is_compared():
    expected = {"TM", "L4TM", "ETM+", "OLI", "OLI2", "MSI", "MSI-B", "HRV"}
    expected |= {"MODIS", "MODIS-Aqua", "AVHRR", "AVHRR10", "AVHRR11"}
    expected |= {
        "MSS",
        "MSS2",
        "MSS3",
        "MSS4",
        "MSS5",
        "MSI-C",
        "VIIRS",
        "OLCI",
        "EMIT",
        "EnMAP",
        "PRISMA",
        "SuperDove",
    }
    assert expected <= set(instrument_names())


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_file_passes_the_check_that_users_files_get(path):
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    assert read_instrument(path) == instrument(content["name"])


@pytest.mark.parametrize(
    ("alias", "name"),
    [
        ("Landsat-5 TM", "TM"),
        ("landsat-4 tm", "L4TM"),
        ("Landsat-7 ETM+", "ETM+"),
        ("Landsat-8 OLI", "OLI"),
        ("Landsat-9 OLI", "OLI2"),
        ("Sentinel-2A MSI", "MSI"),
        ("Sentinel-2B MSI", "MSI-B"),
        ("SPOT HRV", "HRV"),
        ("Terra MODIS", "MODIS"),
        ("Aqua MODIS", "MODIS-Aqua"),
        ("NOAA-9 AVHRR", "AVHRR"),
        ("NOAA-11", "AVHRR11"),
        ("Landsat 1", "MSS"),
        ("Landsat-2", "MSS2"),
        ("Landsat 3 MSS", "MSS3"),
        ("Landsat-4 MSS", "MSS4"),
        ("Landsat 5 MSS", "MSS5"),
        ("Sentinel-2C", "MSI-C"),
        ("Suomi NPP", "VIIRS"),
        ("Sentinel-3 OLCI", "OLCI"),
        ("PlanetScope", "SuperDove"),
    ],
)
def test_aliases_are_found_in_any_case(alias, name):
    assert instrument(alias) is instrument(name)
    assert instrument(alias.upper()) is instrument(name)


@pytest.mark.parametrize("name", instrument_names())
def test_every_number_has_a_source_and_every_reference_is_used(name):
    item = instrument(name)
    used = {item.source(number) for number in ("altitude", "gsd", "interval", "bits", "lsf")}
    used |= {item.references[key] for key in item.sources.values()}
    for each in item.bands:
        used |= {
            item.source(number, each)
            for number in ("srf", "full_scale_radiance", "min_radiance", "solar_irradiance", *each.sources)
        }
    assert used == set(item.references.values())


@pytest.mark.parametrize("name", instrument_names())
def test_instrument_travels_to_workers_and_is_a_key(name):
    item = instrument(name)
    again = pickle.loads(pickle.dumps(item))
    assert again == item
    assert {item: 1}[again] == 1


@pytest.mark.parametrize("name", instrument_names())
def test_description_has_a_line_for_every_band_and_every_source(name):
    item = instrument(name)
    text = instrument_in_words(item)
    assert all(any(line.split()[:1] == [each.name] for line in text.splitlines()) for each in item.bands)
    assert all(reference in text for reference in item.references.values())


@pytest.mark.parametrize("name", instrument_names())
def test_bands_have_names_of_their_own_instrument(name):
    """A raster of one instrument's bands is never taken for another's, MODIS1 (red) for MSI1 (aerosol) say."""
    family = {"L4TM": "TM", "OLI2": "OLI", "MSI-B": "MSI", "MODIS-Aqua": "MODIS"}
    family |= {"AVHRR10": "AVHRR", "AVHRR11": "AVHRR", "MSI-C": "MSI"}
    family |= {f"MSS{number}": "MSS" for number in range(2, 6)}
    own = {each.name for each in instrument(name).bands}
    for other in instrument_names():
        if family.get(other, other) != family.get(name, name):
            assert not own & {each.name for each in instrument(other).bands}, other


# -------------------------------------------------------------------------------------------- effective wavelength

# Weighted wavelengths [nm] that ESA publishes (COPE-GSEG-EOPG-TN-15-0007, sheet "Equivalent wavelengths").
ESA = {
    "MSI": [442.695, 492.715, 559.849, 664.622, 704.115, 740.492, 782.753, 832.790, 864.711, 945.054, 1373.456]
    + [1613.681, 2202.368],
    "MSI-B": [442.246, 492.339, 558.949, 664.948, 703.824, 739.128, 779.706, 832.948, 863.972, 943.165, 1376.878]
    + [1610.414, 2185.707],
}


@pytest.mark.parametrize("name", ESA)
def test_wavelengths_of_msi_are_those_that_esa_publishes(name):
    found = [1000 * each.wavelength for each in instrument(name).bands]
    np.testing.assert_allclose(found, ESA[name], rtol=1e-3)


# Mean wavenumbers [cm-1] of the same responses in the coefficient files of EUMETSAT's RTTOV, which reads them from the
# agencies by itself (NOAA STAR's AVHRR1_SRF_only.xls, L7_ETM_RSR.xls, Ball_BA_RSR).
RTTOV = {
    ("AVHRR10", "AVHRR1"): 16004.736,
    ("AVHRR10", "AVHRR2"): 12088.745,
    ("ETM+", "ETM1"): 21013.599,
    ("ETM+", "ETM2"): 17924.629,
    ("ETM+", "ETM3"): 15152.702,
    ("ETM+", "ETM4"): 12054.332,
    ("ETM+", "ETM5"): 6083.658,
    ("OLI", "OLI1"): 22582.527,
    ("OLI", "OLI2"): 20804.752,
    ("OLI", "OLI3"): 17862.873,
    ("OLI2", "OLI1"): 22593.443,
    ("OLI2", "OLI2"): 20816.761,
    ("OLI2", "OLI3"): 17874.793,
}


def mean_wavenumber(response):
    wavenumber = 1e4 / np.array(response.wavelength)[::-1]
    weight = np.array(response.response)[::-1]
    return np.trapezoid(weight * wavenumber, wavenumber) / np.trapezoid(weight, wavenumber)


@pytest.mark.parametrize("key", RTTOV, ids=lambda key: "-".join(key))
def test_mean_wavenumber_is_that_of_another_program(key):
    """Within 0.1 %: RTTOV tabulates the same measurements on other steps."""
    np.testing.assert_allclose(mean_wavenumber(band(*key).response), RTTOV[key], rtol=1e-3)


@pytest.mark.parametrize(("name", "each"), bands_of("L4TM", "TM", "OLI", "OLI2", "MODIS", "MODIS-Aqua"))
def test_wavelength_is_near_the_middle_of_the_nominal_band(name, each):
    """
    Filters as built are not centred on the nominal band: by a tenth of the width of TM's, and those of MODIS by up to
    0.8 % of the wavelength.
    """
    nominal = {"TM1": (0.45, 0.52), "TM2": (0.52, 0.60), "TM3": (0.63, 0.69), "TM4": (0.76, 0.90)}
    nominal |= {"TM5": (1.55, 1.75), "TM7": (2.08, 2.35)}
    low, high = each.limits or nominal[each.name]
    assert abs(each.wavelength - (low + high) / 2) < max(0.15 * (high - low), 0.008 * low)


@pytest.mark.parametrize("number", [1, 2, 4, 5])
def test_wavelengths_of_modis_are_within_half_a_percent_of_the_nominal_ones(number):
    nominal = {1: 0.645, 2: 0.8585, 4: 0.555, 5: 1.240}
    np.testing.assert_allclose(band("MODIS", f"MODIS{number}").wavelength, nominal[number], rtol=5e-3)


# Equivalent widths W [um] that NOAA gives for the channels: area below the response over its maximum.
WIDTH = {
    ("AVHRR", "AVHRR1"): 0.117,
    ("AVHRR", "AVHRR2"): 0.239,
    ("AVHRR10", "AVHRR1"): 0.108,
    ("AVHRR10", "AVHRR2"): 0.222,
    ("AVHRR11", "AVHRR1"): 0.113,
    ("AVHRR11", "AVHRR2"): 0.229,
}


@pytest.mark.parametrize("key", WIDTH, ids=lambda key: "-".join(key))
def test_area_below_the_response_of_avhrr_is_the_equivalent_width(key):
    """NOAA integrated other tables of the same measurements; channel 2 of NOAA-9 differs most, by 3.7 %."""
    response = band(*key).response
    area = np.trapezoid(response.response, response.wavelength)
    np.testing.assert_allclose(area / max(response.response), WIDTH[key], rtol=0.04)


def test_responses_of_avhrr_rise_from_nothing_and_fall_to_it():
    table = pd.read_csv(files.path("avhrr_response.csv"), comment="#")
    for (satellite, channel), rows in table.groupby(["satellite", "band"]):
        ends = rows["response"].iloc[[0, -1]]
        assert ends.max() <= 0.002, (satellite, channel)
        assert 0.995 < rows["response"].max() <= 1.0, (satellite, channel)


# -------------------------------------------------------------------------------------------- solar irradiance


HYPERSPECTRAL = ("EMIT", "EnMAP", "PRISMA")
MULTISPECTRAL = [name for name in instrument_names() if name not in HYPERSPECTRAL]


@pytest.mark.parametrize(("name", "each"), bands_of(*MULTISPECTRAL))
def test_agencys_irradiance_agrees_with_the_integral_of_a_solar_spectrum(name, each):
    """
    The agencies use other spectra than ASTM G173: within 4.5 % up to 2.4 um, but for the coastal and cirrus bands of
    OLI (5.1 and 4.5 %) and, in the short-wave infrared, MODIS 5 and 7 (5.9 %).
    """
    apart = {"OLI1": 0.055, "OLI9": 0.05, "MODIS5": 0.06, "MODIS7": 0.06}
    np.testing.assert_allclose(each.solar_irradiance, each.spectrum_irradiance, rtol=apart.get(each.name, 0.045))


@pytest.mark.parametrize("name", HYPERSPECTRAL)
def test_irradiance_of_many_narrow_bands_is_that_of_the_spectrum_which_their_table_names(name):
    """Two more digits of the responses move it by some 0.1 % where the spectrum has lines."""
    for each in instrument(name).bands:
        np.testing.assert_allclose(each.solar_irradiance, each.spectrum_irradiance, rtol=2e-4, err_msg=each.name)
        np.testing.assert_allclose(each.full_scale_radiance * np.pi, each.solar_irradiance, rtol=2e-4)
        assert each.min_radiance == 0


@pytest.mark.parametrize("name", ["OLI", "OLI2"])
def test_oli_has_the_scale_of_reflectance_of_its_products(name):
    """REFLECTANCE_MAXIMUM and REFLECTANCE_MINIMUM of Level 1: 1.2107 and -0.09998 in every band, overhead sun."""
    for each in instrument(name).bands:
        ends = radiance_to_reflectance([each.full_scale_radiance, each.min_radiance], each.solar_irradiance, 1.0)
        np.testing.assert_allclose(ends, [1.2107, -0.09998], rtol=5e-4)


def test_oli_reproduces_the_radiance_scale_of_another_product():
    """RADIANCE_MULT of a scene at another distance of the sun stands to that of 2 May 2024 as the distances squared."""
    other = [1.2866e-2, 1.3175e-2, 1.2140e-2, 1.0237e-2, 6.2648e-3, 1.5580e-3, 5.2513e-4, 1.1586e-2, 2.4484e-3]
    steps = [(each.full_scale_radiance - each.min_radiance) / 65534 for each in instrument("OLI").bands]
    ratio = np.array(other) / steps
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=2e-4)
    assert 1 / 1.0168**2 < ratio.mean() < 1 / 0.9832**2


@pytest.mark.parametrize("name", instrument_names())
def test_radiance_and_reflectance_are_tied_by_the_agencys_irradiance_both_ways(name):
    for each in instrument(name).bands:
        radiance = reflectance_to_radiance(0.25, each.solar_irradiance, 0.5, 1.01)
        np.testing.assert_allclose(radiance, 0.125 * each.solar_irradiance / (np.pi * 1.01**2), rtol=1e-12)
        back = radiance_to_reflectance(radiance, each.solar_irradiance, 0.5, 1.01)
        np.testing.assert_allclose(back, 0.25, rtol=1e-12)


def test_avhrr_count_of_the_dark_is_no_albedo_and_full_scale_is_the_slope():
    """PATMOS-x: albedo [%] = slope (count - dark)."""
    known = {"AVHRR": [(0.107, 38.0), (0.121, 40.0)], "AVHRR10": [(0.111, 39.44), (0.137, 39.4)]}
    for name, channels in known.items():
        item = instrument(name)
        for each, (slope, dark) in zip(item.bands, channels, strict=True):
            gain, offset = gain_offset(each.full_scale_radiance, each.min_radiance, item.bits)
            albedo = 100 * np.pi * (np.array([dark, 1023]) * gain + offset) / each.solar_irradiance
            np.testing.assert_allclose(albedo, [0, slope * (1023 - dark)], atol=0.01)


# -------------------------------------------------------------------------------------------- sampling


@pytest.mark.parametrize(
    ("name", "which", "along", "across"),
    [
        ("TM", "TM3", 30.315, 30.315),
        ("L4TM", "TM3", 30.315, 30.315),
        ("ETM+", "ETM3", 30.0, 30.0),
        ("ETM+", "ETM8", 15.0, 15.0),
        ("OLI", "OLI4", 30.0, 30.0),
        ("OLI", "OLI8", 15.0, 15.0),
        ("MSI", "MSI4", 10.0, 10.0),
        ("MSI", "MSI8A", 20.0, 20.0),
        ("MSI-B", "MSI9", 60.0, 60.0),
        ("HRV", "XS2", 20.0, 20.0),
        ("MODIS", "MODIS1", 250.0, 250.0),
        ("MODIS-Aqua", "MODIS3", 500.0, 500.0),
        ("AVHRR", "AVHRR1", 1090.0 * 860 / 833, 791.0 * 860 / 833),
        ("MSS", "MSS5", 79.0, 57.0),
        ("MSS2", "MSS4", 79.0, 57.0),
        ("MSS3", "MSS7", 79.0, 57.0),
        ("MSS5", "MSS2", 82.0, 57.0),
        ("MSI-C", "MSI8A", 20.0, 20.0),
        ("VIIRS", "I1", 371.0, 385.2),
        ("VIIRS", "M5", 742.0, 770.4),
        ("OLCI", "Oa08", 300.0, 300.0),
        ("EMIT", "EMIT36", 60.0, 60.0),
        ("EnMAP", "EnMAP48", 30.0, 30.0),
        ("PRISMA", "PRISMA33", 30.0, 30.0),
        ("SuperDove", "PS6", 3.7, 3.7),
    ],
)
def test_ground_interval_is_the_published_one(name, which, along, across):
    intervals = instrument(name).ground_intervals(band(name, which))
    np.testing.assert_allclose(intervals, (along, across), rtol=1e-3)


def test_avhrr_oversamples_by_the_published_1_362_and_its_field_is_1_09_km():
    """KLM guide, J.1: 1.362 samples an instantaneous field of view; its 0.95 mrad are rounded (to 0.5 %)."""
    item = instrument("AVHRR")
    field, interval = item.ground_fields(item.bands[0]), item.ground_intervals(item.bands[0])
    np.testing.assert_allclose(field.across / interval.across, 1.362, rtol=6e-3)
    np.testing.assert_allclose(field.across, np.radians(0.07449) * item.altitude, rtol=1e-3)


@pytest.mark.parametrize(
    ("name", "bits"), [("TM", 8), ("ETM+", 8), ("HRV", 8), ("AVHRR", 10), ("MODIS", 12), ("MSS", 6), ("MSS5", 6)]
)
def test_bits(name, bits):
    assert instrument(name).bits == bits
    assert instrument("OLI").bits == instrument("MSI").bits == 12


@pytest.mark.parametrize("name", [name for name in instrument_names() if not name.startswith("AVHRR")])
def test_scan_covers_the_published_swath(name):
    item = instrument(name)
    np.testing.assert_allclose(swath_width(item.altitude, item.scan.max_angle), item.scan.swath, rtol=3e-3)


def test_scan_of_avhrr_covers_more_than_the_plane_of_noaas_guide():
    """2399 km in the guide is 2 h tan(55.4 degrees), within 1 %; stations that receive it say more than 2600 km."""
    item = instrument("AVHRR")
    np.testing.assert_allclose(2 * 833e3 * np.tan(np.radians(item.scan.max_angle)), 2399e3, rtol=0.01)
    assert swath_width(item.altitude, item.scan.max_angle) > 2600e3


# -------------------------------------------------------------------------------------------- spatial response


def nyquist(name, which):
    item = instrument(name)
    each = band(name, which)
    steps = item.ground_intervals(each)
    return [float(lsf.mtf(0.5 / step)) for lsf, step in zip(item.line_spreads(each), steps, strict=True)]


def test_tm_of_landsat_4_passes_half_at_the_measured_effective_field_of_view():
    """Schowengerdt et al. 1985: 40.8 m. Of a Gaussian, the Nyquist frequency of 30 m keeps 2^-(40.8/30)^2."""
    lsf = instrument("L4TM").line_spread
    np.testing.assert_allclose(lsf.mtf(0.5 / 40.8), 0.5, rtol=1e-4)
    np.testing.assert_allclose(lsf.mtf(0.5 / 30.0), 2.0 ** -((40.8 / 30) ** 2), rtol=1e-3)
    assert lsf.fwhm > 30.0


def test_tm_of_the_paper_keeps_its_cosine():
    """By hand, Eq. of the cosine at half a cycle per interval: 0.69."""
    tm = instrument("TM", "paper")
    np.testing.assert_allclose(tm.line_spread.width, 30.31641, rtol=1e-12)
    np.testing.assert_allclose(tm.line_spread.mtf(0.5 / 30.315), 0.6928, atol=1e-3)


def test_tm_blurs_as_its_twin_was_measured_in_flight():
    """40.8 m passes half of the modulation: 2^-(40.8 / 30.315)^2 at half a cycle per interval."""
    np.testing.assert_allclose(nyquist("TM", "TM4"), 2.0 ** -((40.8 / 30.315) ** 2), rtol=1e-3)
    np.testing.assert_allclose(nyquist("TM", "TM4"), nyquist("L4TM", "TM4"), rtol=1e-12)
    row = band_provenance(instrument("TM"), "blur", band("TM", "TM4"))
    assert row.origin == "in-flight" and row.uncertainty == 0.12 and "San Mateo" in row.source


@pytest.mark.parametrize(("name", "which"), [("OLI", "OLI4"), ("MSI", "MSI10"), ("HRV", "XS1"), ("ETM+", "ETM8")])
def test_a_detector_alone_keeps_two_over_pi_at_the_nyquist_frequency(name, which):
    item = instrument(name, "detector")
    (each,) = item.select(which)
    steps = item.ground_intervals(each)
    found = [float(lsf.mtf(0.5 / step)) for lsf, step in zip(item.line_spreads(each), steps, strict=True)]
    np.testing.assert_allclose(found, 2 / np.pi, rtol=1e-9)


# Transfer at the Nyquist frequency along and across the track, assumed.
ASSUMED = {("OLI", "OLI4"): (0.32, 0.38), ("OLI2", "OLI8"): (0.30, 0.35), ("ETM+", "ETM4"): (0.40, 0.28)}
ASSUMED |= {("ETM+", "ETM8"): (0.30, 0.18), ("MODIS", "MODIS1"): (0.45, 0.33), ("MODIS-Aqua", "MODIS7"): (0.50, 0.37)}
ASSUMED |= {("OLCI", "Oa08"): (0.28, 0.38), ("EMIT", "EMIT36"): (0.30, 0.40), ("PRISMA", "PRISMA33"): (0.24, 0.30)}
ASSUMED |= {("HRV", "XS2"): (0.28, 0.38), ("AVHRR", "AVHRR1"): (0.40, 0.18), ("MSI", "MSI10"): (0.30, 0.30)}


@pytest.mark.parametrize(("name", "which"), ASSUMED)
def test_blur_that_was_not_measured_is_assumed_and_not_the_detector(name, which):
    np.testing.assert_allclose(nyquist(name, which), ASSUMED[name, which], rtol=1e-9)
    row = band_provenance(instrument(name), "blur", band(name, which))
    assert row.origin == "assumed" and row.uncertainty >= 0.06 and row.source.startswith("Assumed")


def test_avhrr_passes_the_same_at_half_a_cycle_of_its_field_along_and_across():
    """Its fields are 1.3 mrad, its samples 1.308 and 0.95 mrad apart: 0.40, within the two digits of the file."""
    item = instrument("AVHRR")
    spreads, fields = item.line_spreads(item.bands[0]), item.ground_fields(item.bands[0])
    for spread, width in zip(spreads, fields, strict=True):
        assert float(spread.mtf(0.5 / width)) == pytest.approx(0.40, abs=0.005)


# -------------------------------------------------------------------------------------------- radiometry and noise


@pytest.mark.parametrize(
    ("name", "which", "step"),
    [
        # TM: (204.3 + 1.2) / 255. ETM+ handbook: (152.9 + 5.0) / 254 in high gain. MSI: 1 / PHYSICAL_GAINS.
        # HRV: 1 / A, Schroeder et al. 2000.
        ("TM", "TM3", 0.80588),
        ("L4TM", "TM3", 0.80588),
        ("ETM+", "ETM3", 0.62165),
        ("MSI", "MSI4", 1 / 4.50915),
        ("HRV", "XS1", 1 / 1.505),
        ("HRV", "XS2", 1 / 1.073),
        ("HRV", "XS3", 1 / 1.451),
    ],
)
def test_quantisation_step_is_the_published_one(name, which, step):
    each = band(name, which)
    gain, _ = gain_offset(each.full_scale_radiance, each.min_radiance, instrument(name).bits)
    np.testing.assert_allclose(gain, step, rtol=1e-3)


def test_gain_states_of_etm_are_those_of_the_handbook():
    """Radiances of digital numbers 1 and 255 after 1 July 2000."""
    item = instrument("ETM+")
    low = item.with_gain("low")
    for state, full, first in ((item, 157.4, -5.1), (low, 241.1, -5.1)):
        (each,) = state.select("ETM4")
        gain, offset = gain_offset(each.full_scale_radiance, each.min_radiance, 8)
        np.testing.assert_allclose([gain + offset, 255 * gain + offset], [first, full], atol=1e-3)
    assert [each.gain for each in low.bands] == ["low"] * 7
    assert low.with_gain({"ETM4": "high"}).select("ETM4") == item.select("ETM4")
    assert [each.gain for each in item.bands] == ["high"] * 6 + ["low"]


@pytest.mark.parametrize("which", ["XS1", "XS2", "XS3"])
def test_each_gain_of_hrv_is_1_3_times_the_one_before(which):
    each = band("HRV", which)
    full = [each.with_gain(f"m{number}").full_scale_radiance for number in range(3, 9)]
    np.testing.assert_allclose(np.array(full[:-1]) / full[1:], 1.3, rtol=1e-3)


MODIS_SNR = {1: (21.8, 128), 2: (24.7, 201), 3: (35.3, 243), 4: (29.0, 228), 5: (5.4, 74), 6: (7.3, 275), 7: (1.0, 110)}


@pytest.mark.parametrize("number", MODIS_SNR)
def test_noise_of_modis_is_that_of_its_specification(number):
    item, (radiance, snr) = instrument("MODIS"), MODIS_SNR[number]
    model = item.noise_model(band("MODIS", f"MODIS{number}"))
    np.testing.assert_allclose(model.snr(radiance), snr, rtol=1e-9)
    assert model.detectors == (40 if number < 3 else 20)


# Noise of Aqua MODIS in flight, c0 + c1 L [W m-2 sr-1 um-1], from NASA's l2gen; band 6 has broken detectors.
AQUA = {1: (0.104069, 8.533e-05), 2: (0.040559, 1.9755e-04), 3: (0.119315, 8.195e-05), 4: (0.0876954, 7e-05)}
AQUA |= {5: (0.0787773, 4.994e-04), 7: (0.00628912, 2.116e-04)}


@pytest.mark.parametrize("number", AQUA)
def test_noise_of_aqua_modis_is_that_in_flight_from_half_to_twice_its_radiance(number):
    each, (c0, c1) = band("MODIS-Aqua", f"MODIS{number}"), AQUA[number]
    radiance = each.noise.radiance * np.array([0.5, 1.0, 2.0])
    found = instrument("MODIS-Aqua").noise_model(each).noise_equivalent_radiance(radiance)
    np.testing.assert_allclose(found, c0 + c1 * radiance, rtol=6e-3)
    assert radiance[1] == MODIS_SNR[number][0]


# Coefficients a, b and A of ESA's noise model sigma^2 = a^2 + b A L, and the reference radiance [W m-2 sr-1 um-1].
ESA_NOISE = {"MSI2": (0.191, 7.14e-4, 3.816, 128), "MSI4": (0.134, 4.85e-4, 4.536, 108)}
ESA_NOISE |= {"MSI8A": (0.133, 3.61e-4, 5.162, 52.39), "MSI1": (0.0484, 3.13e-5, 4.074, 129.11)}
ESA_NOISE |= {"MSI9": (0.0472, 1.50e-5, 8.581, 8.77)}


@pytest.mark.parametrize("which", ESA_NOISE)
@pytest.mark.parametrize("name", ["MSI", "MSI-B"])
def test_noise_of_msi_is_that_of_esas_model(name, which):
    """Within 15 %, as the ratios that ESA measured are those of its model within 12 %, and shares have two digits."""
    a, b, scale, reference = ESA_NOISE[which]
    model, radiance = instrument(name).noise_model(band(name, which)), reference * np.array([0.25, 1.0, 2.0])
    np.testing.assert_allclose(
        model.noise_equivalent_radiance(radiance), np.sqrt(a**2 + b * scale * radiance), rtol=0.15
    )
    assert model.along == "columns"


def test_noise_of_every_satellite_of_sentinel_2_states_its_origin():
    origins = {name: band_provenance(instrument(name), "noise", band(name, "MSI4")).origin for name in MSI}
    assert origins == {"MSI": "pre-launch", "MSI-B": "pre-launch", "MSI-C": "in-flight"}
    assert band_provenance(instrument("MSI"), "noise", band("MSI", "MSI11")).origin == "required"
    twins = {name: band_provenance(instrument(name), "noise", band(name, "MODIS1")).origin for name in MODIS}
    assert twins == {"MODIS": "required", "MODIS-Aqua": "in-flight"}


def test_every_instrument_states_blur_noise_and_geolocation_or_the_search_for_it():
    for name in instrument_names():
        item = instrument(name)
        rows = item.provenance
        for quantity in ("blur", "noise", "geolocation"):
            own = [row for row in rows if row.quantity == quantity]
            assert sorted(each for row in own for each in row.bands) == sorted(each.name for each in item.bands)
            for row in own:
                assert len(row.source) > 20, (name, row)
                stated = item.origin | {
                    key: value for each in item.select(row.bands) for key, value in each.origin.items()
                }
                assert row.origin == "unknown" or quantity in stated, (name, row)
                recalled = row.source.startswith(("Recalled", "Assumed"))
                assert not recalled or row.origin == "assumed", (name, row)


def test_tm_has_one_digital_number_of_noise_with_its_rounding():
    item = instrument("TM")
    for each in item.bands:
        step = (each.full_scale_radiance - each.min_radiance) / 255
        noise = item.noise_model(each).noise_equivalent_radiance((each.full_scale_radiance + each.min_radiance) / 2)
        assert np.hypot(noise, step / np.sqrt(12)) == pytest.approx(step, rel=2e-3)


def test_what_was_not_found_is_left_out_and_said_so():
    with pytest.raises(ValueError, match="SuperDove has no noise for PS6: leave noise out"):
        instrument("SuperDove").noise_model(band("SuperDove", "PS6"))
    for path in FILES:
        text = " ".join(path.read_text(encoding="utf-8").replace("\n#", " ").split())
        assert "left out" in text, path.name


# -------------------------------------------------------------------------------------------- Landsat's first scanners


@pytest.mark.parametrize("name", ["MSS", "MSS2", "MSS3", "MSS4", "MSS5"])
def test_mss_compresses_its_photomultipliers_and_takes_six_lines_at_once(name):
    item = instrument(name)
    assert [each.compression for each in item.bands] == ["square-root"] * 3 + [None]
    assert [each.compressed_count(item.bits) for each in item.bands] == [63, 63, 63, 0]
    assert (item.detectors, item.scan.lines, item.scan.kind) == (6, 6, "whiskbroom")
    assert instrument_in_words(item).count("square-root scale") == 3


def test_mss_has_the_bands_of_its_time_in_the_count_of_its_products():
    for name, numbers in (("MSS", "4567"), ("MSS3", "4567"), ("MSS4", "1234"), ("MSS5", "1234")):
        item = instrument(name)
        assert [each.name for each in item.bands] == [f"MSS{number}" for number in numbers]
        for each, (low, high) in zip(item.bands, [(0.5, 0.6), (0.6, 0.7), (0.7, 0.8), (0.8, 1.1)], strict=True):
            assert each.limits == (low, high) and low < each.wavelength < high


def test_mss_of_landsat_5_passes_half_at_its_effective_field_of_view():
    """Markham 1985, abstract: 70-75 m along and 79-82 m across the track."""
    along, across = instrument("MSS5").line_spreads(band("MSS5", "MSS2"))
    np.testing.assert_allclose([along.mtf(0.5 / 72.5), across.mtf(0.5 / 80.5)], 0.5, rtol=1e-3)


# Revolutions a day of two-line elements; mean altitude above the equatorial radius by Kepler's third law [km].
ORBITS = {"AVHRR": (14.1136, 852), "AVHRR10": (14.2248, 814), "AVHRR11": (14.1280, 847)}


@pytest.mark.parametrize("name", ORBITS)
def test_avhrr_flies_as_its_two_line_elements_say(name):
    """At 39 degrees north the ellipsoid lies 8 km below the equatorial radius; the orbit varies by 10 km."""
    revolutions, above_equator = ORBITS[name]
    axis = (398600.4418 * (86400 / revolutions / (2 * np.pi)) ** 2) ** (1 / 3)
    # The oblateness of the earth lowers the mean orbit by 3 km.
    assert axis - 6378.137 - 3.0 == pytest.approx(above_equator, abs=1.0)
    assert instrument(name).altitude / 1000 == pytest.approx(axis - 6370.0, abs=10.0)


# -------------------------------------------------------------------------------------------- later instruments

# Centroid and equivalent width [nm] of Sentinel-2C's responses at 1 nm, issue 4.0.
S2C = {"MSI1": (444.2, 19.1), "MSI2": (489.0, 59.0), "MSI3": (560.6, 34.2), "MSI4": (666.5, 29.8)}
S2C |= {"MSI5": (707.1, 15.2), "MSI6": (741.1, 15.3), "MSI7": (784.7, 19.9), "MSI8": (834.6, 79.4)}
S2C |= {"MSI8A": (865.6, 19.6), "MSI9": (947.2, 19.0), "MSI10": (1372.2, 32.9), "MSI11": (1612.0, 89.4)}
S2C |= {"MSI12": (2191.3, 173.9)}


@pytest.mark.parametrize("which", S2C)
def test_sentinel_2c_has_its_own_responses(which):
    """To three digits and without tails, within 0.15 nm."""
    response = band("MSI-C", which).response
    wavelength, values = 1000 * np.array(response.wavelength), np.array(response.response)
    area = np.trapezoid(values, wavelength)
    found = np.trapezoid(values * wavelength, wavelength) / area, area
    np.testing.assert_allclose(found, S2C[which], rtol=0, atol=0.15)


# Transfer at the Nyquist frequency along and across the track, measured in flight in 2024.
SENTINEL_2C = {"MSI2": (0.31, 0.35), "MSI4": (0.21, 0.31), "MSI8": (0.18, 0.26), "MSI8A": (0.26, 0.43)}
SENTINEL_2C |= {"MSI1": (0.39, 0.25), "MSI12": (0.22, 0.28)}


@pytest.mark.parametrize("which", SENTINEL_2C)
def test_sentinel_2c_blurs_as_it_was_measured(which):
    np.testing.assert_allclose(nyquist("MSI-C", which), SENTINEL_2C[which], rtol=1e-9)


def test_enmap_passes_what_its_specification_asks():
    np.testing.assert_allclose(nyquist("EnMAP", "EnMAP48"), (0.16, 0.25), rtol=1e-9)


# Noise of EMIT at radiances [W m-2 sr-1 um-1]: c0 sqrt(c1 + L), from isofit's table at its own wavelengths.
EMIT = {0.4923: (0.0160903, 22.9974), 0.6115: (0.0144721, 18.6044), 0.8651: (0.0126073, 14.1187)}


@pytest.mark.parametrize("wavelength", EMIT)
def test_noise_of_emit_is_that_of_isofit_at_every_radiance(wavelength):
    item = instrument("EMIT")
    each = min(item.bands, key=lambda one: abs(one.wavelength - wavelength))
    (c0, c1), radiance = EMIT[wavelength], np.array([5.0, 40.0, 150.0])
    found = item.noise_model(each).noise_equivalent_radiance(radiance)
    np.testing.assert_allclose(found, c0 * np.sqrt(c1 + radiance), rtol=2e-3)


def test_bands_of_spectrometers_lie_beside_each_other():
    emit, enmap, prisma = (instrument(name) for name in HYPERSPECTRAL)
    assert (len(emit.bands), len(enmap.bands), len(prisma.bands)) == (285, 224, 238)
    np.testing.assert_allclose(np.diff([each.wavelength for each in emit.bands]), 7.43e-3, atol=5e-5)
    for item, first in ((enmap, 91), (prisma, 66)):
        for part in (item.bands[:first], item.bands[first:]):
            assert np.all(np.diff([each.wavelength for each in part]) > 0)
    widths = np.array([each.srf.width for each in emit.bands])
    assert widths[0] == 0.008415 and widths[-1] == 0.008809


def test_a_number_alone_means_no_band_of_viirs():
    viirs = instrument("VIIRS")
    assert [band_called(name, viirs).name for name in ("M03", "i3", "red", "M11")] == ["M3", "I3", "M5", "M11"]
    assert band_called("B3", viirs) is None and band_called(11, viirs).name == "M11"


def test_check_of_units_passes_every_gain_state():
    check_instrument_units(instrument("ETM+").with_gain("low"))
    check_instrument_units(instrument("HRV").with_gain("m3"))
