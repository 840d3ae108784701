"""Descriptions of instruments: the paper's Table 1, sources, and mistakes in a file."""

import dataclasses
import pickle
import tomllib

import numpy as np
import pytest

from fifesim.base import datasets
from fifesim.base.bands import solar_irradiance
from fifesim.sensor.description.instruments import Instrument, instrument, instrument_names, read_instrument

TM_FILE = datasets.path("instruments/tm.toml")


@pytest.fixture
def changed(tmp_path):
    """Reads the TM file after replacements in its text, each old and new."""

    def read(*replacements):
        text = TM_FILE.read_text(encoding="utf-8")
        for old, new in zip(replacements[::2], replacements[1::2], strict=True):
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return read_instrument(path)

    return read


def test_tm_is_table_1():
    tm = instrument("TM")
    red, near_infrared = tm.select(["TM3", "TM4"])
    assert (red.full_scale_radiance, near_infrared.full_scale_radiance) == (204.3, 206.2)
    assert (red.min_radiance, near_infrared.min_radiance) == (-1.2, -1.5)
    assert tm.bits == 8
    assert tm.altitude == 705_000.0
    assert tm.interval == 0.000043
    assert (tm.lsf.count, tm.lsf.step, tm.lsf.kind) == (9, 0.000004778, "cosine")


def test_footprint_of_tm_on_the_ground():
    """By hand: 9 x 4.778 urad x 705 km and 43 urad x 705 km."""
    tm = instrument("TM")
    np.testing.assert_allclose(tm.line_spread.width, 30.31641, rtol=1e-12)
    np.testing.assert_allclose(tm.line_spread.half_width, 15.158205, rtol=1e-12)
    np.testing.assert_allclose(tm.ground_interval, 30.315, rtol=1e-12)
    assert tm.gsd == 30.0


@pytest.mark.parametrize("name", instrument_names())
def test_every_number_of_every_band_is_present_and_has_a_source(name):
    item = instrument(name)
    for number in ("altitude", "gsd", "interval", "bits", "lsf"):
        assert item.source(number)
    for band in item.bands:
        # The products of OLI reach down to a reflectance of -0.1, those of others less far.
        assert 0 <= -band.min_radiance < 0.09 * band.full_scale_radiance
        assert band.solar_irradiance > band.full_scale_radiance
        for number in ("srf", "full_scale_radiance", "min_radiance", "solar_irradiance"):
            assert len(item.source(number, band)) > 20


def test_bands_of_tm():
    assert [band.name for band in instrument("TM").bands] == ["TM1", "TM2", "TM3", "TM4", "TM5", "TM7"]


def test_a_band_names_its_own_source_first():
    tm = instrument("TM")
    green, red = tm.select(["TM2", "TM3"])
    assert "Friedl" in tm.source("min_radiance", red)
    assert "Markham" in tm.source("min_radiance", green)


# Nominal limits of the reflective TM bands [um].
NOMINAL = {
    "TM1": (0.45, 0.52),
    "TM2": (0.52, 0.60),
    "TM3": (0.63, 0.69),
    "TM4": (0.76, 0.90),
    "TM5": (1.55, 1.75),
    "TM7": (2.08, 2.35),
}


@pytest.mark.parametrize("name", NOMINAL)
def test_response_lies_in_the_nominal_band(name):
    """Half of the maximum is reached within 0.04 um of the nominal limits, as built (TM5 is the furthest off)."""
    (band,) = instrument("TM").select(name)
    low, high = NOMINAL[name]
    assert band.response.name == name
    assert abs(band.wavelength - (low + high) / 2) < 0.15 * (high - low)
    half = [w for w, r in zip(band.response.wavelength, band.response.response, strict=True) if r > 0.5]
    np.testing.assert_allclose([half[0], half[-1]], [low, high], atol=0.04)


@pytest.mark.parametrize("name", NOMINAL)
def test_solar_irradiance_agrees_with_another_spectrum(name):
    """The agency integrates another solar spectrum than ASTM G173; spectra differ by up to 4 % in TM7."""
    (band,) = instrument("TM").select(name)
    np.testing.assert_allclose(band.solar_irradiance, solar_irradiance(band.response), rtol=0.05)


def test_bands_come_in_the_order_asked_for():
    tm = instrument("TM")
    assert [band.name for band in tm.select(["TM4", "tm3"])] == ["TM4", "TM3"]
    assert tm.select("TM3") == (tm.bands[2],)
    assert tm.select() == tm.bands


def test_names_are_found_in_any_case_and_instruments_pass_through():
    tm = instrument("tm")
    assert tm is instrument("TM")
    assert instrument(tm) is tm
    assert "TM" in instrument_names()


def test_unknown_names_list_the_nearest_and_all():
    with pytest.raises(ValueError, match=r"unknown instrument 'TN': did you mean TM\b.*\? There are .*TM"):
        instrument("TN")
    with pytest.raises(ValueError, match=r"unknown band of TM 'TM6': did you mean .* TM1, TM2, TM3, TM4, TM5"):
        instrument("TM").select(["TM3", "TM6"])
    with pytest.raises(TypeError, match="band of TM: the name must be text, got 3"):
        instrument("TM").select([3])


def test_instruments_are_frozen_hashable_and_picklable():
    tm = instrument("TM")
    with pytest.raises(dataclasses.FrozenInstanceError):
        tm.altitude = 1.0
    assert pickle.loads(pickle.dumps(tm)) == tm
    assert {tm: 1}[tm] == 1


def test_a_path_that_ends_in_toml_is_read_and_read_again_when_it_changed(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(TM_FILE.read_text(encoding="utf-8"), encoding="utf-8")
    assert instrument(str(path)) == instrument(path) == instrument("TM")
    assert instrument(str(path)) is instrument(str(path))
    path.write_text(TM_FILE.read_text(encoding="utf-8").replace("bits = 8 ", "bits = 11 "), encoding="utf-8")
    assert instrument(str(path)).bits == 11


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(FileNotFoundError, match=r"there is no instrument file .*nowhere\.toml"):
        instrument("nowhere.toml")


def test_a_file_of_ones_own_is_read(changed):
    mine = changed("altitude = 705000.0", "altitude = 3000", "swath = 185000.0", "")
    assert isinstance(mine, Instrument)
    np.testing.assert_allclose(mine.ground_interval, 0.129, rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("bits = 8 ", "bitz = 8 ", "mine.toml: .*bits is missing; unknown key bitz"),
        ("bits = 8 ", "bits = 8.5 ", "mine.toml: bits = 8.5: .*integer"),
        ("bits = 8 ", "bits = 32 ", "mine.toml: bits = 32: .*16"),
        ("= 705000.0", "= '705 km'", "mine.toml: altitude = '705 km': .*number"),
        ("= 705000.0", "= -705000.0", "mine.toml: altitude = -705000.0: .*greater than 0"),
        ('"cosine"', '"sinc"', "mine.toml: lsf.kind = 'sinc': it must be one of 'cosine', 'boxcar'"),
        ('kind = "cosine"', "", "mine.toml: the key lsf.kind is missing"),
        ("count = 9", "count = 0", "mine.toml: lsf.count = 0: .*greater than 0"),
        ('kind = "cosine"', 'kind = "boxcar"', "mine.toml: unknown key lsf.step; unknown key lsf.count"),
        ("= -1.5  ", "= 300.0  ", "bands.4: full_scale_radiance must be above min_radiance, got 206.2 and 300"),
        ("= 83.44", "= nan", "bands.6.solar_irradiance = nan: .*finite"),
        ('altitude = "Friedl1995"', 'altitude = "nobody"', "sources.altitude: must be one of .* got 'nobody'"),
        ('solar_irradiance = "Chander2009"', "", "sources.solar_irradiance: must be one of"),
        ('name = "TM2"', 'name = "TM1"', "each name may occur once"),
        ("gsd = 30.0", "gsd = ", "mine.toml is not valid TOML"),
    ],
)
def test_mistakes_in_a_file_name_the_key_and_the_value(changed, old, new, message):
    with pytest.raises(ValueError, match=message):
        changed(old, new)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("altitude = 705000.0", "altitude = 705.0", "altitude = 705: it is in metres.*multiply by 1000"),
        ("interval = 43.0e-6", "interval = 43.0", "interval = 43: angles are in radians"),
        ("interval = 43.0e-6", "interval = 0.0024637", "interval = 0.0024637: it is in radians.*degrees, so multiply"),
        ("interval = 43.0e-6", "interval = 43.0e-3", "interval = 0.043: angles are in radians"),
        ("= 1536.0", "= 153.6", "bands.3.solar_irradiance = 153.6: it is in W m-2 um-1.*1550.7.*times 10"),
        ("= 1536.0", "= 1.536", "bands.3.solar_irradiance = 1.536: .*W m-2 nm-1 times 1000"),
        ("= 206.2 ", "= 2000.0 ", "bands.4.full_scale_radiance = 2000: it is in W m-2 sr-1 um-1"),
        ("max_angle = 7.47", "max_angle = 0.13", "scan: max_angle = 0.13 degrees gives a swath of 3 km.*in degrees"),
        ("swath = 185000.0", "swath = 185.0", "scan: .*swath = 185 m; .*swath in metres"),
        ("gsd = 30.0", "gsd = 0.03", "interval = 4.3e-05: .*unless gsd is in kilometres"),
        ("step = 4.778e-6", "step = 2.7376e-4", "bands.1.lsf: its angles are in radians.*degrees times pi / 180"),
        ("step = 4.778e-6", "step = 4.778e-3", "bands.1.lsf: .*milliradians times 1e-3"),
        ("step = 4.778e-6", "step = 4.778e-8", "bands.1.lsf: its angles are in radians"),
        (
            'sensor = "TM", band = "7"',
            'sensor = "TM", band = "9"',
            "bands.6.srf: pyrsr has no response of Landsat-5 TM 9",
        ),
    ],
)
def test_a_number_in_another_unit_is_found_out(changed, old, new, message):
    with pytest.raises(ValueError, match=f"mine.toml: {message}"):
        changed(old, new)


@pytest.mark.parametrize(
    ("ifov", "message"),
    [
        ("2.4351e-3", "0.0024351: it is in radians, and 56.6 times the interval; degrees times pi / 180"),
        ("42.5", "42.5: it is in radians.*microradians times 1e-6"),
    ],
)
def test_a_field_of_view_in_another_unit_is_found_out(changed, ifov, message):
    source = ('bits = "Friedl1995"', 'bits = "Friedl1995"\nifov = "Friedl1995"')
    with pytest.raises(ValueError, match=f"mine.toml: bands.1.ifov = {message}"):
        changed("bits = 8 ", f"ifov = {ifov}\nbits = 8 ", *source)


def test_every_radiance_in_milliwatts_is_found_out(changed):
    """The tables of Markham and Barker (1986) are in mW cm-2 sr-1 um-1: a tenth of the numbers here."""
    tenths = []
    for text in ("152.10", "296.81", "204.3", "206.2", "27.19", "14.38"):
        tenths += [f"full_scale_radiance = {text}", f"full_scale_radiance = {float(text) / 10}"]
    with pytest.raises(ValueError, match=r"mine.toml: bands.full_scale_radiance: .*no band records more than 6%"):
        changed(*tenths)


@pytest.mark.parametrize(
    ("angle", "message"),
    [("0.9669", "0.9669: it is in degrees.*55.7 degrees to either side"), ("70.0", "70: .*misses the earth")],
)
def test_a_scan_without_a_swath_is_compared_with_its_samples_and_the_horizon(tmp_path, angle, message):
    """2048 samples of 0.95 mrad are 55.7 degrees to either side; the horizon from 833 km is at 62.2."""
    text = datasets.path("instruments/avhrr9.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace("max_angle = 55.4", f"max_angle = {angle}"), encoding="utf-8")
    with pytest.raises(ValueError, match=f"mine.toml: scan.max_angle = {message}"):
        read_instrument(path)


LIMITS = ('bits = "Friedl1995"', 'bits = "Friedl1995"\nlimits = "NASA2013"')
PYRSR = '{ satellite = "Landsat-5", sensor = "TM", band = "3" }'


@pytest.mark.parametrize(
    ("srf", "message"),
    [
        ("{ wavelength = [620, 630, 690, 700], response = [0, 1, 1, 0] }", "wavelengths are in um.*nm: divide by 1000"),
        (
            "{ wavelength = [0.62, 0.63, 0.69], response = [0, 1, 0.9] }",
            "does not cover the band: at 0.69 um, where its",
        ),
        ("{ wavelength = [0.64, 0.65, 0.66], response = [0, 1, 0] }", "does not cover the band from 0.63 to 0.69 um"),
        ("{ wavelength = [0.62, 0.61, 0.69], response = [0, 1, 0] }", "wavelengths must increase"),
        ("{ wavelength = [0.62, 0.69], response = [0, -1] }", "must not be negative"),
        ('{ table = "none.csv", satellite = "A", band = "1" }', "srf.table = 'none.csv': no such file beside"),
        ('{ table = "avhrr_response.csv", satellite = "NOAA-9", band = "3" }', "has no NOAA-9 3: it has .*NOAA-11 2"),
    ],
)
def test_a_response_that_does_not_do_is_named_with_its_remedy(changed, srf, message):
    with pytest.raises(ValueError, match=f"mine.toml: bands.3.*{message}"):
        changed(f"srf = {PYRSR}", f"srf = {srf}\nlimits = [0.63, 0.69]", *LIMITS)


@pytest.mark.parametrize("missing", ["wavelength", "response"])
def test_a_missing_key_of_a_response_is_named(changed, missing):
    lists = {"wavelength": "[0.6, 0.65, 0.7]", "response": "[0, 1, 0]"}
    left = ", ".join(f"{key} = {value}" for key, value in lists.items() if key != missing)
    with pytest.raises(ValueError, match=f"mine.toml: the key bands.3.srf.{missing} is missing"):
        changed(f"srf = {PYRSR}", f"srf = {{ {left} }}")


def test_a_response_written_out_or_in_a_table_beside_the_file_is_read(changed, tmp_path):
    rows = "wavelength = [0.60, 0.63, 0.69, 0.72], response = [0.0, 1.0, 1.0, 0.0]"
    mine = changed(f"srf = {PYRSR}", f"srf = {{ {rows} }}")
    # A trapezoid is centred on its middle.
    np.testing.assert_allclose(mine.select("TM3")[0].wavelength, 0.66, rtol=1e-12)
    table = "satellite,band,wavelength,response\nX,1,0.60,0\nX,1,0.63,1\nX,1,0.69,1\nX,1,0.72,0\n"
    (tmp_path / "own.csv").write_text("# columns\n" + table, encoding="utf-8")
    other = changed(f"srf = {PYRSR}", 'srf = { table = "own.csv", satellite = "X", band = "1" }')
    assert other.select("TM3")[0].response == mine.select("TM3")[0].response


TM_TEXT = TM_FILE.read_text(encoding="utf-8")
LSF = TM_TEXT[TM_TEXT.index('kind = "cosine"') : TM_TEXT.index("[scan]")]


def nyquist(item):
    band = item.bands[0]
    spreads, steps = item.line_spreads(band), item.ground_intervals(band)
    return [float(lsf.mtf(0.5 / step)) for lsf, step in zip(spreads, steps, strict=True)]


@pytest.mark.parametrize(
    ("lsf", "expected"),
    [
        # Boxcar as wide as the interval; Gaussians: the transfer itself, exp(-(pi W / d)^2 / (16 ln 2)), 2^-(E / d)^2.
        ('kind = "boxcar"\nwidth = 43.0e-6', 2 / np.pi),
        ('kind = "gaussian"\nmtf_at_nyquist = 0.3', 0.3),
        ('kind = "gaussian"\nfwhm = 43.0e-6', np.exp(-(np.pi**2) / (16 * np.log(2)))),
        ('kind = "gaussian"\neifov = 43.0e-6', 0.5),
        # A triangle twice as wide as the interval.
        ('kind = "table"\nangles = [-43.0e-6, 0.0, 43.0e-6]\nvalues = [0.0, 2.0, 0.0]', (2 / np.pi) ** 2),
    ],
)
def test_each_kind_of_response_has_the_transfer_it_says(changed, lsf, expected):
    np.testing.assert_allclose(nyquist(changed(LSF, lsf + "\n")), expected, rtol=1e-6)


IFOV = ("bits = 8 ", "ifov = 43.0e-6\nbits = 8 ", 'bits = "Friedl1995"', 'bits = "Friedl1995"\nifov = "Friedl1995"')


def test_system_response_is_the_product_of_its_parts(changed):
    """
    At half a cycle per interval: detector and smear sinc(1/2) each, the electronics 1/sqrt(2) at their cutoff, the
    aperture's diffraction at nu = wavelength / (2 interval aperture), that of a circle.
    """
    parts = 'kind = "system"\nsmear = 1.0\nelectronics = 0.5\naperture = 0.4\n'
    mine = changed(LSF, parts, *IFOV)
    nu = 1e-6 * mine.bands[0].wavelength / (2 * 43e-6 * 0.4)
    circle = 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))
    # What is cut off, 1e-3 of the response, is missing.
    np.testing.assert_allclose(nyquist(mine), (2 / np.pi) ** 2 / np.sqrt(2) * circle, atol=2e-3)


def test_responses_may_differ_by_axis_and_by_band(changed):
    axes = '[lsf.along]\nkind = "boxcar"\n[lsf.across]\nkind = "gaussian"\nmtf_at_nyquist = 0.4\n'
    mine = changed("[lsf] ", "#", LSF, axes, *IFOV)
    np.testing.assert_allclose(nyquist(mine), [2 / np.pi, 0.4], rtol=1e-9)
    wider = changed('name = "TM1"', 'name = "TM1"\nlsf = { kind = "boxcar", width = 86.0e-6 }')
    np.testing.assert_allclose(nyquist(wider), np.sinc(1.0), atol=1e-12)
    np.testing.assert_allclose(wider.line_spreads(wider.bands[1]).along.width, 30.31641, rtol=1e-12)


@pytest.mark.parametrize(
    ("replacements", "message"),
    [
        ((LSF, 'kind = "boxcar"\n'), "bands.1.lsf: kind 'boxcar' needs the instantaneous field of view: add ifov"),
        ((LSF, 'kind = "gaussian"\n'), "lsf: give one of fwhm, mtf_at_nyquist and eifov, got none"),
        ((LSF, 'kind = "gaussian"\nmtf_at_nyquist = 30.0\n'), "lsf.mtf_at_nyquist = 30.0: .*less than 1"),
        ((LSF, 'kind = "table"\nangles = [0.0, 1e-5]\nvalues = [1.0]\n'), "lsf.values = .*at least 2"),
        (("[lsf] ", "#", LSF, '[lsf.along]\nkind = "boxcar"\n'), "the key lsf.across is missing"),
        (("interval = 43.0e-6", "interval = { along = 43.0e-6 }"), "the key interval.across is missing"),
        (("interval = 43.0e-6", "interval = '43 urad'"), "interval = '43 urad': .*number"),
        (('name = "TM1"', 'name = "TM1"\nnoise = { radiance = 50.0 }'), "bands.1.noise: give either snr or nedl"),
        (('name = "TM1"', 'name = "TM1"\nnoise = { radiance = 50.0, snr = 100.0 }'), "sources.noise: must be one of"),
        (
            (
                'bits = "Friedl1995"',
                'bits = "Friedl1995"\nnoise = "Friedl1995"',
                'name = "TM1"',
                'name = "TM1"\nnoise = { radiance = 500.0, snr = 100.0 }',
            ),
            "noise.radiance = 500: it is in W m-2 sr-1 um-1 and must lie between",
        ),
        (
            ('name = "TM1"', 'name = "TM1"\ngains.nominal = { full_scale_radiance = 1.0, min_radiance = 0.0 }'),
            "own gain",
        ),
        (("max_angle = 7.47", "max_angle = 90.0"), "scan.max_angle = 90.0: .*less than 75"),
        (('kind = "whiskbroom"', 'kind = "frame"'), "scan.kind = 'frame': .*'whiskbroom' or 'pushbroom'"),
    ],
)
def test_mistakes_in_the_further_keys_name_key_and_remedy(changed, replacements, message):
    with pytest.raises(ValueError, match=f"mine.toml: .*{message}"):
        changed(*replacements)


def test_unknown_gain_states_are_named(changed):
    with pytest.raises(ValueError, match="no band of TM has a gain state 'high'"):
        instrument("TM").with_gain("high")
    with pytest.raises(ValueError, match="TM3 has no gain state 'high': it has nominal"):
        instrument("TM").with_gain({"TM3": "high"})


def test_every_file_is_listed_under_the_name_it_gives():
    for path in TM_FILE.parent.glob("*.toml"):
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        assert content["name"] in instrument_names()
