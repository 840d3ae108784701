"""Instruments by name and from files: error messages, units, short files and tables."""

import os
import shutil

import numpy as np
import pytest
from paper_file import paper_text

import fifesim
from fifesim.base import files
from fifesim.base.bands import solar_irradiance
from fifesim.sensor.description.instruments import instrument, read_responses

TM_FILE = files.path("instruments/tm.toml")


def test_names_ignore_case_and_instruments_are_returned_unchanged():
    tm = instrument("tm")
    assert tm is instrument("TM") is instrument(tm)
    with pytest.raises(ValueError, match=r"unknown instrument 'TN': did you mean TM\b.*\? There are .*TM"):
        instrument("TN")
    # A suffix alone is not a file name.
    with pytest.raises(ValueError, match=r"unknown instrument '\.toml'"):
        instrument(".toml")


def test_toml_path_is_read_again_after_a_change(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(TM_FILE.read_text(encoding="utf-8"), encoding="utf-8")
    assert instrument(str(path)) == instrument(path) == instrument("TM")
    assert instrument(str(path)) is instrument(str(path))
    path.write_text(TM_FILE.read_text(encoding="utf-8").replace("bits = 8 ", "bits = 11 "), encoding="utf-8")
    assert instrument(str(path)).bits == 11


FIRST = 'name = "TM1"'
BITS = 'bits = "Friedl1995"'
PYRSR = 'srf = { satellite = "Landsat-5", sensor = "TM", band = "3" }'
LSF = paper_text()[paper_text().index('kind = "cosine"') : paper_text().index("[scan]")]
HEAD = 'name = "Camera"\naltitude = 120.0\ngsd = 0.1\nbits = 12\n'
CAMERA = f"""{HEAD}
bands = [
    {{ name = "red", center = 0.668, width = 0.010, snr = 200.0, snr_radiance = 100.0 }},
    {{ name = "nir", center = 0.840, width = 0.040, shape = "boxcar", full_scale_radiance = 300.0 }},
]
"""
AVHRR, VIIRS = (files.path(f"instruments/{name}.toml").read_text(encoding="utf-8") for name in ("avhrr9", "viirs"))
ZONES = VIIRS[VIIRS.index("[[scan.zones]]") : VIIRS.index("[origin]")]
MTF = 'bits = 12\nmtf_at_nyquist = { along = 0.2, across = 0.3 }\norigin = { blur = { kind = "required" } }'
FLAT = 'scan = {{ kind = "pushbroom", max_angle = {}, samples = 1000 }}'
# Markham and Barker (1986) use mW cm-2 sr-1 um-1, i.e. one tenth of the values here.
RADIANCES = ("152.10", "296.81", "204.3", "206.2", "27.19", "14.38")
TENTHS = [f"full_scale_radiance = {each}" for text in RADIANCES for each in (text, float(text) / 10)]
PRODUCT = "[product]\ngain = 2e-5\noffset = -0.1\nbits = 16\nsun_corrected = false\n\n[lsf]"
SOURCE = ("\n[sources]", '\n[sources]\nproduct = "Chander2009"')


def srf(text):
    """Replacements that give the third band another response and limits it must cover."""
    return PYRSR, f"srf = {{ {text} }}\nlimits = [0.63, 0.69]", BITS, f'{BITS}\nlimits = "NASA2013"'


MISTAKES = [
    # Keys and value types.
    (("bits = 8 ", f'bits = "\\u001b{"a" * 5000}" '), r"bits = '\\x1baaa.*must be a whole number"),
    (("bits = 8 ", "bitz = 8 "), "bits is missing; unknown key bitz, did you mean 'bits'"),
    (("bits = 8 ", "mtf = 0.2\nbits = 8 "), "unknown key mtf, did you mean 'mtf_at_nyquist'"),
    (("bits = 8 ", "bits = 8.5 "), "bits = 8.5: must be a whole number"),
    (("bits = 8 ", "bits = 32 "), "bits = 32: .*16"),
    (("= 705000.0", "= '705 km'"), "altitude = '705 km': .*number"),
    (("= 705000.0", "= -705000.0"), "altitude = -705000.0: must be above 0"),
    (("interval = 43.0e-6", "interval = { along = 43.0e-6 }"), "the key interval.across is missing"),
    (("interval = 43.0e-6", "interval = '43 urad'"), "interval = '43 urad': .*number"),
    (("= -1.5  ", "= 300.0  "), "bands.4: full_scale_radiance must be above min_radiance, got 206.2 and 300"),
    (("= 83.44", "= nan"), "bands.6.solar_irradiance = nan: .*finite"),
    (('altitude = "Friedl1995"', 'altitude = "nobody"'), "sources.altitude: must be one of .* got 'nobody'"),
    (('solar_irradiance = "Chander2009"', ""), "sources.solar_irradiance: must be one of"),
    (('name = "TM2"', FIRST), "each name may occur once"),
    (("gsd = 30.0", "gsd = "), "is not valid TOML"),
    ((FIRST, FIRST + "\ngains.nominal = { full_scale_radiance = 1.0, min_radiance = 0.0 }"), "own gain"),
    ((FIRST, FIRST + "\nnoise = { radiance = 50.0 }"), "bands.1.noise: give either snr or nedl"),
    ((FIRST, FIRST + "\nnoise = { radiance = 50.0, snr = 100.0 }"), "sources.noise: must be one of"),
    (("max_angle = 7.47", "max_angle = 90.0"), "scan.max_angle = 90.0: must be below 75"),
    (('kind = "whiskbroom"', 'kind = "frame"'), "scan.kind = 'frame': .*'whiskbroom' or 'pushbroom'"),
    (("[lsf]", PRODUCT), r"sources\.product: must be one of"),
    (("[lsf]", PRODUCT.replace("2e-5", "-2e-5"), *SOURCE), r"product\.gain = -2e-05: must be above 0"),
    (("[lsf]", PRODUCT.replace("false", '"no"'), *SOURCE), r"product\.sun_corrected = 'no'"),
    (("[lsf]", PRODUCT.replace("\noffset = -0.1", ""), *SOURCE), r"the key product\.offset is missing"),
    # Spatial responses.
    (('"cosine"', '"sinc"'), "lsf.kind = 'sinc': it must be one of 'cosine', 'boxcar'"),
    (('kind = "cosine"', ""), "the key lsf.kind is missing"),
    (("count = 9", "count = 0"), "lsf.count = 0: must be above 0"),
    (('kind = "cosine"', 'kind = "boxcar"'), "unknown key lsf.step; unknown key lsf.count"),
    ((LSF, 'kind = "boxcar"\n'), "bands.1.lsf: kind 'boxcar' needs the instantaneous field of view: add ifov"),
    ((LSF, 'kind = "gaussian"\n'), "lsf: give one of fwhm, mtf_at_nyquist and eifov, got none"),
    ((LSF, 'kind = "gaussian"\nmtf_at_nyquist = 30.0\n'), "lsf.mtf_at_nyquist = 30.0: must be below 1"),
    ((LSF, 'kind = "table"\nangles = [0.0, 1e-5]\nvalues = [1.0]\n'), "lsf.values = .*needs 2 of them or more"),
    (("[lsf] ", "#", LSF, '[lsf.along]\nkind = "boxcar"\n'), "the key lsf.across is missing"),
    # Spectral responses.
    (srf("wavelength = [620, 630, 690, 700], response = [0, 1, 1, 0]"), "wavelengths are in um.*nm: divide by 1000"),
    (srf("wavelength = [0.62, 0.63, 0.69], response = [0, 1, 0.9]"), "does not cover the band: at 0.69 um, where its"),
    (srf("wavelength = [0.64, 0.65, 0.66], response = [0, 1, 0]"), "does not cover the band from 0.63 to 0.69 um"),
    (srf("wavelength = [0.62, 0.61, 0.69], response = [0, 1, 0]"), "bands.3.*wavelengths must increase"),
    (srf("wavelength = [0.62, 0.69], response = [0, -1]"), "bands.3.*must not be negative"),
    (srf("wavelength = [0.62, 0.69]"), "the key bands.3.srf.response is missing"),
    (srf("response = [0, 1]"), "the key bands.3.srf.wavelength is missing"),
    ((srf("")[0], "srf = 0.66"), "bands.3.srf.* = 0.66: must be"),
    (srf('table = "none.csv", satellite = "A", band = "1"'), "srf.table = 'none.csv': no such file beside"),
    (srf('table = "avhrr_response.csv", satellite = "NOAA-9", band = "3"'), "has no NOAA-9 3: it has .*NOAA-11 2"),
    (('sensor = "TM", band = "7"', 'sensor = "TM", band = "9"'), "bands.6.srf: pyrsr has no .* Landsat-5 TM 9"),
    # Numbers in a wrong unit.
    (("altitude = 705000.0", "altitude = 705.0"), "altitude = 705: it is in metres.*multiply by 1000"),
    (("interval = 43.0e-6", "interval = 43.0e-3"), "interval = 0.043: angles are in radians"),
    (("interval = 43.0e-6", "interval = 0.0024637"), "interval = 0.0024637: it is in radians.*degrees, so multiply"),
    (("= 1536.0", "= 153.6"), "bands.3.solar_irradiance = 153.6: it is in W m-2 um-1.*1550.7.*times 10"),
    (("= 1536.0", "= 1.536"), "bands.3.solar_irradiance = 1.536: .*W m-2 nm-1 times 1000"),
    (("= 206.2 ", "= 2000.0 "), "bands.4.full_scale_radiance = 2000: it is in W m-2 sr-1 um-1"),
    (("max_angle = 7.47", "max_angle = 0.13"), "scan: max_angle = 0.13 degrees gives a swath of 3 km.*in degrees"),
    (("swath = 185000.0", "swath = 185.0"), "scan: .*swath = 185 m; .*swath in metres"),
    (("gsd = 30.0", "gsd = 0.03"), "interval = 4.3e-05: .*unless gsd is in kilometres"),
    (("step = 4.778e-6", "step = 4.778e-3"), "bands.1.lsf: its angles are in radians.*milliradians times 1e-3"),
    (("step = 4.778e-6", "step = 4.778e-8"), "bands.1.lsf: its angles are in radians"),
    (
        ("bits = 8 ", "ifov = 2.4351e-3\nbits = 8 ", BITS, f'{BITS}\nifov = "Friedl1995"'),
        "bands.1.ifov = 0.0024351: it is in radians, and 56.6 times the interval; degrees times pi / 180",
    ),
    (
        (FIRST, FIRST + "\nnoise = { radiance = 500.0, snr = 100.0 }", BITS, f'{BITS}\nnoise = "Friedl1995"'),
        "noise.radiance = 500: it is in W m-2 sr-1 um-1 and must lie between",
    ),
    (TENTHS, "bands.full_scale_radiance: .*no band records more than 6%"),
]
# In other files. 2048 samples of 0.95 mrad reach 55.7 degrees to each side; the horizon from 833 km is at 62.2 degrees.
# 6400 samples as wide as at nadir would reach 86 degrees; the zones of VIIRS reach 56 degrees. Half of 1000 pixels of
# 0.1 m from 86.6 m is 50 / 86.6, the tangent of 30 degrees, or 33.08 degrees.
OTHER_MISTAKES = {
    AVHRR: [
        (("= 55.4", "= 0.9669"), "scan: .*2048 x 0.00095 radians, reach 55.7 .*side, and max_angle = 0.9669 degrees"),
        (("= 55.4", "= 60.0"), "scan: .*reach 55.7 degrees to either side, and max_angle = 60 degrees"),
        (("= 55.4", "= 70.0"), "scan.max_angle = 70: .*misses the earth"),
    ],
    VIIRS: [
        ((ZONES, "", "0.00015582", "0.00046746"), r"6400 x 0.00046746 radians, reach 85.7 .*\[\[scan.zones\]\]"),
        (("samples = 736", "samples = 737"), "half of samples = 6400, got 3201"),
        (("deleted = 4", "deleted = 16"), "deleted = 16 at each end leaves none of lines = 32"),
        (("aggregation = 2", "aggregation = 0"), "scan.zones.2.aggregation = 0"),
    ],
    CAMERA: [
        (("width = 0.010", "width = 10.0"), "bands.1.srf: width = 10: it is in um, and too wide"),
        (("width = 0.010, ", ""), "bands.1.srf.width is missing"),
        (('"boxcar"', '"triangle"'), "bands.2.srf.shape = 'triangle'"),
        ((", snr_radiance = 100.0", ""), "bands.1.noise.radiance is missing"),
        (("bits = 12", f'{MTF}\nlsf = {{ kind = "boxcar" }}'), "mtf_at_nyquist and lsf both state the blur"),
        (("bits = 12", MTF.replace("0.3", "1.3")), r"lsf\.across\.mtf_at_nyquist = 1.3: must be below 1"),
        (("bits = 12", MTF.replace("required", "guessed")), r"origin\.blur\.kind = 'guessed': .*'in-flight', 'pre-"),
    ]
    + [
        (
            ("altitude = 120.0", f"altitude = 86.6\n{FLAT.format(angle)}"),
            "samples of red .* 1000 x 0\\.00115473 radians",
        )
        for angle in (27.0, 36.0)
    ],
}
CASES = [(None, *each) for each in MISTAKES] + [(text, *each) for text, rows in OTHER_MISTAKES.items() for each in rows]


@pytest.mark.parametrize(("text", "replacements", "message"), CASES, ids=[message for *_, message in CASES])
def test_errors_in_a_file_name_key_value_and_remedy(changed, text, replacements, message):
    with pytest.raises(ValueError, match=f"mine.toml.*{message}") as caught:
        changed(*replacements, text=text)
    assert len(str(caught.value)) <= 500 and str(caught.value).isprintable()


def test_scans_within_their_limits_are_read(changed):
    assert changed(text=VIIRS).scan.elementary_samples() == 12608
    for angle in (30.0, 33.08):
        flat = changed("altitude = 120.0", f"altitude = 86.6\n{FLAT.format(angle)}", text=CAMERA)
        assert flat.scan.samples == 1000


def test_pipe_or_deeply_nested_file_raises(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "deep.toml").write_text("x = " + "[" * 5000)
    for name, said in (("pipe.toml", "is a pipe: name a file"), ("deep.toml", "nests its tables too deeply")):
        with pytest.raises(ValueError, match=said):
            instrument(tmp_path / name)


def test_table_path_is_relative_to_the_instrument_file(tmp_path, monkeypatch):
    """The working directory changes between reading the file and reading the table."""
    text = files.path("instruments/avhrr9.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text.replace("avhrr_response.csv", "own.csv"), encoding="utf-8")
    shutil.copy(files.path("avhrr_response.csv"), tmp_path / "own.csv")
    monkeypatch.chdir(tmp_path)
    mine = instrument("mine.toml")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    assert [band.response for band in mine.bands] == [band.response for band in instrument("AVHRR9").bands]


@pytest.mark.parametrize("table", ["pipe.csv", "folder.csv", "/dev/zero", "a" * 5000, "loop.csv"])
def test_table_that_is_not_a_regular_file_raises(changed, tmp_path, table):
    """Reading a pipe would block."""
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    table = str(tmp_path / table) if table == "pipe.csv" else table
    with pytest.raises(ValueError, match="srf"):
        changed(PYRSR, f'srf = {{ table = "{table}", satellite = "X", band = "1" }}')


# ------------------------------------------------------------------------------------------- short files


TABLE = """name,center,width,snr,snr_radiance
red,0.668,0.010,200,100
nir,0.840,0.040,,
"""


def test_minimal_file_defines_an_instrument_with_its_sources(changed):
    camera = changed(text=CAMERA)
    red, nir = camera.bands
    assert (red.wavelength, nir.wavelength) == (pytest.approx(0.668, abs=1e-9), pytest.approx(0.840, abs=1e-9))
    assert camera.ground_interval == pytest.approx(0.1, rel=1e-12)
    assert camera.line_spread.width == pytest.approx(0.1, rel=1e-12)
    assert red.noise.equivalent_radiance == 0.5 and nir.noise is None
    assert (nir.full_scale_radiance, nir.min_radiance, red.min_radiance) == (300.0, 0.0, 0.0)
    # The default irradiance and range come from the reference spectrum.
    assert red.solar_irradiance == solar_irradiance(red.response)
    assert red.full_scale_radiance == pytest.approx(red.solar_irradiance / np.pi, rel=1e-15)
    assert camera.source("solar_irradiance", red).startswith("ASTM G173-03")
    assert camera.source("full_scale_radiance", red).startswith("taken for a white surface")
    assert camera.source("full_scale_radiance", nir) == "as mine.toml says"
    assert camera.source("interval").startswith("taken for gsd over altitude")
    assert camera.source("noise", red) == "as mine.toml says"


def test_response_has_the_given_width_at_half_maximum(changed):
    red, nir = (band.response for band in changed(text=CAMERA).bands)
    half = np.interp([0.663, 0.668, 0.673], red.wavelength, red.response)
    np.testing.assert_allclose(half, [0.5, 1.0, 0.5], rtol=0, atol=1e-9)
    assert np.interp([0.8201, 0.8599, 0.8199, 0.8601], nir.wavelength, nir.response).tolist() == [1, 1, 0, 0]
    # Area of a Gaussian: FWHM sqrt(pi / ln 2) / 2, apart from the truncated tails.
    area = np.trapezoid(red.response, red.wavelength)
    assert area == pytest.approx(0.010 * np.sqrt(np.pi / np.log(2)) / 2, rel=1e-3)


def test_band_table_is_read_again_after_a_change(changed, tmp_path):
    (tmp_path / "bands.csv").write_text(TABLE)
    red, nir = changed(text=f'{HEAD}bands = "bands.csv"\n').bands
    assert nir.noise is None and nir.wavelength == pytest.approx(0.840, abs=1e-9)
    path = tmp_path / "mine.toml"
    assert fifesim.instrument(path) is fifesim.instrument(path)
    (tmp_path / "bands.csv").write_text(TABLE.replace("0.668", "0.6500"))
    assert fifesim.instrument(path).bands[0].wavelength == pytest.approx(0.65, abs=1e-9)
    assert red == changed(text=CAMERA).bands[0]


def test_noise_from_shot_share_or_two_ratios(changed):
    red, _ = changed("snr_radiance = 100.0", "snr_radiance = 100.0, snr_shot = 0.75", text=CAMERA).bands
    assert (red.noise.equivalent_radiance, red.noise.shot) == (0.5, 0.75)
    second = "snr_radiance = 100.0, high_snr = 350.0, high_snr_radiance = 250.0"
    camera = changed("snr_radiance = 100.0", second, text=CAMERA)
    model = camera.noise_model(camera.bands[0])
    assert model.snr([100.0, 250.0]).tolist() == pytest.approx([200.0, 350.0], rel=1e-12)


def test_blur_from_mtf_at_nyquist(changed):
    def transfer(camera, number):
        spreads, steps = camera.line_spreads(camera.bands[number]), camera.ground_intervals(camera.bands[number])
        return [float(spread.mtf(0.5 / step)) for spread, step in zip(spreads, steps, strict=True)]

    camera = changed("bits = 12", MTF, 'name = "nir"', 'name = "nir", mtf_at_nyquist = 0.15', text=CAMERA)
    np.testing.assert_allclose(transfer(camera, 0), [0.2, 0.3], rtol=1e-9)
    np.testing.assert_allclose(transfer(camera, 1), 0.15, rtol=1e-9)
    blur, noise, lacking, place = camera.provenance
    assert (blur.quantity, blur.bands, blur.origin) == ("blur", ("red", "nir"), "required")
    assert (noise.bands, noise.origin, lacking.bands, lacking.origin) == (("red",), "assumed", ("nir",), "unknown")
    assert (place.quantity, place.origin) == ("geolocation", "unknown")


@pytest.mark.parametrize(
    ("name", "table", "said"),
    [
        ("../{}/bands.csv", TABLE, "no such file beside it; type a CSV file of bands"),
        ("/dev/null", TABLE, "no such file beside it"),
        ("bands.csv/", TABLE, "no such file beside it"),
        ("other.csv", TABLE, "bands = 'other.csv': no such file beside it"),
        ("bands.csv", "name,center\nred,0.6\n", "lacks the columns width"),
        ("bands.csv", "wavelength,red\n0.6,1\n", "the column red has no response above 0 at two wavelengths"),
        ("bands.csv", "wavelength,red\n0.6,0\n0.7,-1\n", "the column red has no response above 0"),
        ("bands.csv", "wavelength,red\n600,0\n700,1\n", "wavelength 700: it is in um, this looks like nm"),
        ("bands.csv", "wavelength,red\n0.6,low\n0.7,1\n", "the column red must have numbers, got 'low'"),
        ("bands.csv", "wavelength,red,red\n0.6,0,1\n0.7,1,0\n", "the column red occurs twice"),
        ("bands.csv", "wavelength\n0.6\n0.7\n", "no column beside wavelength"),
        ("bands.csv", "wavelength,red\n0.6,0,5\n0.7,1,0\n", "cannot read bands"),
        ("bands.csv", "wavelength,red\n0.6,-0.1\n0.65,1\n0.7,0\n", "the response must not be negative"),
        ("bands.csv", "wavelength,red\n0.6,0\n0.6,1\n0.7,0\n", "wavelengths must increase"),
    ],
)
def test_invalid_band_table_raises(changed, tmp_path, name, table, said):
    (tmp_path / "bands.csv").write_text(table)
    with pytest.raises(ValueError, match=f"mine.toml: .*{said}"):
        changed(text=f'{HEAD}bands = "{name.format(tmp_path.name)}"\n')


MEASURED = """# calibration of the laboratory
wavelength, nir, red
0.72, 0.0, 0.0
0.66, -0.003, 1.0
0.62,, 0.0
0.80, 1.0,
0.88, 0.0,
"""


def test_measured_responses_are_bands(tmp_path):
    """Rows in any order, empty cells, and noise around zero."""
    (tmp_path / "srf.csv").write_text(MEASURED, encoding="utf-8")
    noise = {"red": (120.0, 22.0)}
    made = read_responses(
        tmp_path / "srf.csv", name="Camera", altitude=5e5, gsd=10.0, bits=10, mtf_at_nyquist=0.25, snr=noise
    )
    nir, red = made.bands
    assert (red.name, red.response.wavelength, red.response.response) == ("red", (0.62, 0.66, 0.72), (0.0, 1.0, 0.0))
    assert nir.response.wavelength == (0.66, 0.72, 0.8, 0.88) and min(nir.response.response) == 0
    assert (red.noise.snr, red.noise.radiance, nir.noise, made.bits) == (120.0, 22.0, None, 10)
    assert made.line_spreads(red).along.mtf(0.5 / 10.0) == pytest.approx(0.25)
    assert made.source("srf", red) == "as srf.csv says"
    text = 'name = "Camera"\naltitude = 5e5\ngsd = 10.0\nbits = 10\nmtf_at_nyquist = 0.25\nbands = "srf.csv"\n'
    path = tmp_path / "camera.toml"
    path.write_text(text + "snr = { red = [120, 22] }\n", encoding="utf-8")
    again = instrument(path)
    assert again.bands == made.bands and again.lsf == made.lsf
    path.write_text(text + "snr = 120\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"snr: it must have the names of bands, .* got 120"):
        instrument(path)
    path.write_text(text, encoding="utf-8")
    # The table is read again when it changes.
    (tmp_path / "srf.csv").write_text(MEASURED.replace("0.80", "0.82"), encoding="utf-8")
    assert instrument(path).bands[0].response.wavelength[2] == 0.82


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"snr": {"blue": (1.0, 2.0)}}, "there is no band blue, the table has nir, red"),
        ({"snr": {"red": 100.0}}, "red needs a ratio and the radiance where it holds"),
        ({"altitude": 400.0}, "interval = 0.025: angles are in radians"),
        ({"mtf_at_nyquist": 1.5}, "mtf_at_nyquist = 1.5: must be below 1"),
    ],
)
def test_wrong_numbers_beside_measured_responses_are_refused(tmp_path, keys, words):
    (tmp_path / "srf.csv").write_text(MEASURED, encoding="utf-8")
    given = {"name": "Camera", "altitude": 5e5, "gsd": 10.0} | keys
    with pytest.raises(ValueError, match=words):
        read_responses(tmp_path / "srf.csv", **given)


@pytest.mark.parametrize("name", ["TM", "OLI", "MSI", "MODIS", "VIIRS", "AVHRR", "HRV"])
def test_blur_and_interval_follow_the_pixel_of_a_design(name):
    own = instrument(name)
    wide = own.replace(gsd=2.5 * own.gsd, registration=3.0)
    for band, other in zip(own.bands, wide.bands, strict=True):
        assert wide.pixel(other) == pytest.approx(2.5 * own.pixel(band))
        for one, two in zip(own.line_spreads(band), wide.line_spreads(other), strict=True):
            assert two.mtf(0.3 / own.gsd / 2.5) == pytest.approx(one.mtf(0.3 / own.gsd), abs=1e-9)
        np.testing.assert_allclose(wide.ground_intervals(other), 2.5 * np.array(own.ground_intervals(band)))
    assert (wide.geolocation, wide.interval, wide.max_angle) == (3.0, own.interval, own.max_angle)
    assert wide.source("gsd") == wide.source("geolocation") == "given to Instrument.replace"
    assert wide.name == f"{own.name}, gsd {2.5 * own.gsd:g}, registration 3" and not wide.aliases


def test_a_design_has_the_transfer_and_the_noise_that_are_given():
    own = instrument("MSI")
    made = own.replace(mtf=0.2, snr=50)
    for band, other in zip(own.bands, made.bands, strict=True):
        for spread, interval in zip(made.line_spreads(other), made.ground_intervals(other), strict=True):
            assert spread.mtf(0.5 / interval) == pytest.approx(0.2)
        assert other.noise.radiance / other.noise.equivalent_radiance == pytest.approx(50)
        # The noise at any radiance changes by the factor of the ratio.
        factor = band.noise.radiance / band.noise.equivalent_radiance / 50
        stated = np.array([0.5, 1.0, 3.0]) * band.noise.radiance
        one, two = (model.noise_model(each) for model, each in ((own, band), (made, other)))
        np.testing.assert_allclose(two.thermal**2 + two.shot * stated, factor**2 * (one.thermal**2 + one.shot * stated))
    origins = {row.quantity: row.origin for row in made.provenance}
    assert origins == {row.quantity: row.origin for row in own.provenance} | {"blur": "required", "noise": "required"}
    two_points = instrument("OLI").replace(snr=60.0).bands[3].noise
    stated = instrument("OLI").bands[3].noise
    assert two_points.high_snr / stated.high_snr == pytest.approx(60.0 / stated.snr)


@pytest.mark.parametrize(
    ("name", "keys", "error", "words"),
    [
        ("TM", {"gsd": 0.0}, ValueError, "gsd must be above 0 m, got 0"),
        ("TM", {"mtf": 1.0}, ValueError, r"mtf must be in \(0, 1\), got 1"),
        ("TM", {"snr": np.nan}, ValueError, "snr must be above 0, got nan"),
        ("TM", {"gsd": "30 m"}, TypeError, "gsd must be a number in m"),
        ("TM", {"mft": 0.2}, TypeError, "did you mean 'mtf'"),
        ("MSS", {"snr": 50.0}, ValueError, "the description of MSS states no radiance"),
        ("VIIRS", {"mtf": 0.2}, ValueError, "VIIRS sums samples on board"),
    ],
)
def test_designs_that_are_not_possible_are_refused(name, keys, error, words):
    with pytest.raises(error, match=words):
        instrument(name).replace(**keys)
