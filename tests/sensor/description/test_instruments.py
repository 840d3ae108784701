"""Instruments by name, from files and in Python: values, spatial and spectral responses, designs and mistakes."""

import dataclasses
import os
import shutil

import numpy as np
import pytest
from mistakes import mistakes
from paper_file import paper_text
from pyrsr.rsr import RSR_reader

from fifesim.base import files
from fifesim.base.bands import GREEN, Band, solar_irradiance
from fifesim.sensor.description.fields import band_called, false_colour_bands
from fifesim.sensor.description.instrument_file import Noise
from fifesim.sensor.description.instruments import instrument, instrument_names, read_instrument, read_responses
from fifesim.sensor.description.provenance import band_provenance
from fifesim.sensor.description.spatial_response import knows_blur, with_response
from fifesim.sensor.description.spectral_response import PyrsrResponse, ResponseList, half_peak

TM = instrument("TM")
BITS = 'bits = "Friedl1995"'
IFOV = ("bits = 8 ", "ifov = 43.0e-6\nbits = 8 ", BITS, f'{BITS}\nifov = "Friedl1995"')
HEAD = 'name = "Camera"\naltitude = 120.0\ngsd = 0.1\nbits = 12\n'
CAMERA = f"""{HEAD}
bands = [
    {{ name = "red", center = 0.668, width = 0.010, snr = 200.0, snr_radiance = 100.0 }},
    {{ name = "nir", center = 0.840, width = 0.040, shape = "boxcar", full_scale_radiance = 300.0 }},
]
"""
AVHRR, VIIRS = (files.path(f"instruments/{name}.toml").read_text(encoding="utf-8") for name in ("avhrr9", "viirs"))
TEXTS = {"TM": paper_text(), "AVHRR": AVHRR, "VIIRS": VIIRS, "CAMERA": CAMERA}
# Long parts of the files that rows of sensor_mistakes.jsonl name.
PARTS = {
    "LSF": TEXTS["TM"][TEXTS["TM"].index('kind = "cosine"') : TEXTS["TM"].index("[scan]")],
    "SRF": 'srf = { satellite = "Landsat-5", sensor = "TM", band = "3" }',
    "ZONES": VIIRS[VIIRS.index("[[scan.zones]]") : VIIRS.index("[origin]")],
}


@pytest.fixture
def changed(tmp_path):
    """Function that reads the TM file, or another text, after replacements, given as old, new, old, new, ..."""

    def read(*replacements, text="TM"):
        text = TEXTS.get(text, text)
        for old, new in zip(replacements[::2], replacements[1::2], strict=True):
            assert PARTS.get(old, old) in text
            text = text.replace(PARTS.get(old, old), new, 1)
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return read_instrument(path)

    return read


def nyquist(item, number=0):
    """Modulation transfer of a band at its Nyquist frequency, along and across the track."""
    band = item.bands[number]
    spreads, steps = item.line_spreads(band), item.ground_intervals(band)
    return [float(lsf.mtf(0.5 / step)) for lsf, step in zip(spreads, steps, strict=True)]


# ------------------------------------------------------------------------------------------- descriptions


def test_tm_agrees_with_table_1():
    """Modulation transfer of the cosine at 0.5 cycles per interval by hand."""
    paper = instrument("TM", "paper")
    red, near_infrared = TM.select(["TM3", "TM4"])
    assert (red.full_scale_radiance, near_infrared.full_scale_radiance) == (204.3, 206.2)
    assert (red.min_radiance, near_infrared.min_radiance) == (-1.2, -1.5)
    assert (TM.bits, TM.altitude, TM.interval, TM.gsd) == (8, 705_000.0, 0.000043, 30.0)
    assert (paper.lsf.count, paper.lsf.step, paper.lsf.kind) == (9, 0.000004778, "cosine")
    np.testing.assert_allclose(paper.line_spread.mtf(0.5 / 30.315), 0.6928, atol=1e-3)


def test_bands_are_selected_in_order():
    assert [band.name for band in TM.select(["TM4", "tm3"])] == ["TM4", "TM3"]
    assert [band.name for band in TM.select(["red", "nir", "B5"])] == ["TM3", "TM4", "TM5"]
    assert TM.select("TM3") == (TM.bands[2],) and TM.select() == TM.bands
    assert band_called(11, instrument("VIIRS")).name == "M11" and band_called("", TM) is None


def test_band_values_override_instrument_values():
    """By hand: 86 urad and 60 urad from 705 km are 60.63 m and 42.3 m."""
    green, red = TM.select(["TM2", "TM3"])
    assert "Friedl" in TM.source("min_radiance", red) and "Markham" in TM.source("min_radiance", green)
    sources = TM.sources | {"ifov": "Friedl1995", "detectors": "Friedl1995"}
    own = dataclasses.replace(TM.bands[5], gsd=120.0, interval=86e-6, ifov=60e-6, detectors=4)
    mixed = dataclasses.replace(TM, bands=(*TM.bands[:5], own), sources=sources)
    assert mixed.pixel(own) == 120.0 and mixed.pixel(TM.bands[0]) == 30.0
    assert mixed.ground_intervals(own) == pytest.approx((60.63, 60.63), rel=1e-12)
    assert mixed.ground_fields(own) == pytest.approx((42.3, 42.3), rel=1e-12)
    assert tuple(mixed.ground_fields(TM.bands[0])) == (None, None)


def test_intervals_along_and_across_and_product_scale_are_read(changed):
    interval = "interval = 43.0e-6", "interval = { along = 40.0e-6, across = 44.0e-6 }"
    product = "[product]\ngain = 2e-5\noffset = -0.1\nbits = 16\nsun_corrected = false\n\n[lsf]"
    mine = changed(*interval, "[lsf]", product, "\n[sources]", '\n[sources]\nproduct = "Chander2009"')
    along, across = mine.ground_intervals(mine.bands[0])
    assert (along, across) == pytest.approx((28.2, 31.02), rel=1e-12)
    assert mine.ground_interval == across
    assert dataclasses.astuple(mine.product) == (2e-5, -0.1, 16, False)


def test_noise_from_snr_equals_noise_from_nedl():
    """Half of the variance is shot noise: at 1/4 of the radiance, 1/8 + 1/2 of the variance remains."""
    for noise in (Noise(radiance=80.0, snr=160.0, shot=0.5), Noise(radiance=80.0, nedl=0.5, shot=0.5)):
        assert noise.equivalent_radiance == 0.5
        model = noise.model(6, "columns")
        assert (model.detectors, model.along) == (6, "columns")
        found = model.noise_equivalent_radiance([80.0, 20.0])
        np.testing.assert_allclose(found, [0.5, 0.5 * np.sqrt(0.625)], rtol=1e-12)


@pytest.mark.parametrize("name", instrument_names())
def test_false_colour_bands_share_a_grid(name):
    own = instrument(name)
    *green, red, near_infrared = false_colour_bands(own)
    assert (red, near_infrared) == tuple(own.red_and_near_infrared())
    for band in green:
        assert GREEN.low <= band.wavelength <= GREEN.high
        assert own.pixel(band) == own.pixel(red) == own.pixel(near_infrared)
    known = {"TM": "TM2", "OLI": "OLI3", "MSI": "MSI3"}
    assert name not in known or green[0].name == known[name]


# ------------------------------------------------------------------------------------------- files


@pytest.mark.parametrize(("stage", "changes", "said"), mistakes("instrument", name="sensor_mistakes"), ids=str)
def test_errors_in_a_file_name_key_value_and_remedy(changed, stage, changes, said):
    text, *replacements = changes
    with pytest.raises(ValueError, match=f"mine.toml.*{said}") as caught:
        changed(*replacements, text=text)
    assert len(str(caught.value)) <= 500 and str(caught.value).isprintable()


def test_scans_within_their_limits_are_read(changed):
    """Half of 1000 pixels of 0.1 m from 86.6 m is 50 / 86.6, the tangent of 30 degrees, or 33.08 degrees."""
    assert changed(text="VIIRS").scan.elementary_samples() == 12608
    for angle in (30.0, 33.08):
        flat = f'altitude = 86.6\nscan = {{ kind = "pushbroom", max_angle = {angle}, samples = 1000 }}'
        assert changed("altitude = 120.0", flat, text="CAMERA").scan.samples == 1000


def test_file_is_read_again_after_a_change(tmp_path):
    path, text = tmp_path / "mine.toml", files.path("instruments/tm.toml").read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    assert instrument(str(path)) == instrument(path) == TM == instrument(TM)
    assert instrument(str(path)) is instrument(str(path))
    path.write_text(text.replace("bits = 8 ", "bits = 11 "), encoding="utf-8")
    assert instrument(str(path)).bits == 11


def test_pipe_or_deeply_nested_file_raises(changed, tmp_path):
    """Reading a pipe would block."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "deep.toml").write_text("x = " + "[" * 5000)
    for name, said in (("pipe.toml", "is a pipe: name a file"), ("deep.toml", "nests its tables too deeply")):
        with pytest.raises(ValueError, match=said):
            instrument(tmp_path / name)
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    for table in (tmp_path / "pipe.toml", "loop.csv"):
        with pytest.raises(ValueError, match="srf"):
            changed("SRF", f'srf = {{ table = "{table}", satellite = "X", band = "1" }}')


def test_table_path_is_relative_to_the_instrument_file(tmp_path, monkeypatch):
    """The working directory changes between reading the file and reading the table."""
    (tmp_path / "mine.toml").write_text(AVHRR.replace("avhrr_response.csv", "own.csv"), encoding="utf-8")
    shutil.copy(files.path("avhrr_response.csv"), tmp_path / "own.csv")
    monkeypatch.chdir(tmp_path)
    mine = instrument("mine.toml")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    assert [band.response for band in mine.bands] == [band.response for band in instrument("AVHRR9").bands]


def test_minimal_file_defines_an_instrument_with_its_sources(changed, tmp_path):
    camera = changed(text="CAMERA")
    red, nir = camera.bands
    assert (red.wavelength, nir.wavelength) == (pytest.approx(0.668, abs=1e-9), pytest.approx(0.840, abs=1e-9))
    assert camera.ground_interval == pytest.approx(0.1, rel=1e-12) == camera.line_spread.width
    assert red.noise.equivalent_radiance == 0.5 and nir.noise is None
    assert (nir.full_scale_radiance, nir.min_radiance, red.min_radiance) == (300.0, 0.0, 0.0)
    # The default irradiance and range come from the reference spectrum.
    assert red.solar_irradiance == solar_irradiance(red.response)
    assert red.full_scale_radiance == pytest.approx(red.solar_irradiance / np.pi, rel=1e-15)
    assert camera.source("solar_irradiance", red).startswith("ASTM G173-03")
    assert camera.source("full_scale_radiance", red).startswith("taken for a white surface")
    assert camera.source("interval").startswith("taken for gsd over altitude")
    assert camera.source("noise", red) == camera.source("full_scale_radiance", nir) == "as mine.toml says"
    # The bands may be in a table, with empty cells.
    table = "name,center,width,snr,snr_radiance\nred,0.668,0.010,200,100\nnir,0.840,0.040,,\n"
    (tmp_path / "bands.csv").write_text(table)
    first, second = changed(text=f'{HEAD}bands = "bands.csv"\n').bands
    assert first == red and second.noise is None and second.wavelength == pytest.approx(0.840, abs=1e-9)


def test_response_has_the_given_width_at_half_maximum(changed):
    red, nir = (band.response for band in changed(text="CAMERA").bands)
    half = np.interp([0.663, 0.668, 0.673], red.wavelength, red.response)
    np.testing.assert_allclose(half, [0.5, 1.0, 0.5], rtol=0, atol=1e-9)
    assert np.interp([0.8201, 0.8599, 0.8199, 0.8601], nir.wavelength, nir.response).tolist() == [1, 1, 0, 0]
    # Area of a Gaussian: FWHM sqrt(pi / ln 2) / 2, apart from the truncated tails.
    area = np.trapezoid(red.response, red.wavelength)
    assert area == pytest.approx(0.010 * np.sqrt(np.pi / np.log(2)) / 2, rel=1e-3)


@pytest.mark.parametrize(("stage", "table", "said"), mistakes("band table", name="sensor_mistakes"), ids=str)
def test_invalid_band_table_raises(changed, tmp_path, stage, table, said):
    (tmp_path / "bands.csv").write_text(table[1])
    with pytest.raises(ValueError, match=f"mine.toml: .*{said}"):
        changed(text=f'{HEAD}bands = "{table[0].replace("FOLDER", tmp_path.name)}"\n')


def test_noise_from_shot_share_or_two_ratios(changed):
    red, _ = changed("snr_radiance = 100.0", "snr_radiance = 100.0, snr_shot = 0.75", text="CAMERA").bands
    assert (red.noise.equivalent_radiance, red.noise.shot) == (0.5, 0.75)
    second = "snr_radiance = 100.0, high_snr = 350.0, high_snr_radiance = 250.0"
    camera = changed("snr_radiance = 100.0", second, text="CAMERA")
    found = camera.noise_model(camera.bands[0]).snr([100.0, 250.0])
    assert found.tolist() == pytest.approx([200.0, 350.0], rel=1e-12)


def test_blur_from_mtf_at_nyquist(changed):
    mtf = 'bits = 12\nmtf_at_nyquist = { along = 0.2, across = 0.3 }\norigin = { blur = { kind = "required" } }'
    camera = changed("bits = 12", mtf, 'name = "nir"', 'name = "nir", mtf_at_nyquist = 0.15', text="CAMERA")
    np.testing.assert_allclose([nyquist(camera), nyquist(camera, 1)], [[0.2, 0.3], [0.15, 0.15]], rtol=1e-9)
    found = [(row.quantity, row.bands, row.origin) for row in camera.provenance]
    both = ("red", "nir")
    assert found[:2] == [("blur", both, "required"), ("noise", ("red",), "assumed")]
    assert found[2:] == [("noise", ("nir",), "unknown"), ("geolocation", both, "unknown")]


MEASURED = """# calibration of the laboratory
wavelength, nir, red
0.72, 0.0, 0.0
0.66, -0.003, 1.0
0.62,, 0.0
0.80, 1.0,
0.88, 0.0,
"""


def test_measured_responses_are_bands(tmp_path):
    """Rows in any order, empty cells, and noise around zero; a table is read again when it changes."""
    path, table = tmp_path / "camera.toml", tmp_path / "srf.csv"
    table.write_text(MEASURED, encoding="utf-8")
    noise = {"red": (120.0, 22.0)}
    made = read_responses(table, name="Camera", altitude=5e5, gsd=10.0, bits=10, mtf_at_nyquist=0.25, snr=noise)
    nir, red = made.bands
    assert (red.name, red.response.wavelength, red.response.response) == ("red", (0.62, 0.66, 0.72), (0.0, 1.0, 0.0))
    assert nir.response.wavelength == (0.66, 0.72, 0.8, 0.88) and min(nir.response.response) == 0
    assert (red.noise.snr, red.noise.radiance, nir.noise, made.bits) == (120.0, 22.0, None, 10)
    assert nyquist(made) == pytest.approx([0.25, 0.25]) and made.source("srf", red) == "as srf.csv says"
    text = 'name = "Camera"\naltitude = 5e5\ngsd = 10.0\nbits = 10\nmtf_at_nyquist = 0.25\nbands = "srf.csv"\n'
    path.write_text(text + "snr = { red = [120, 22] }\n", encoding="utf-8")
    again = instrument(path)
    assert again.bands == made.bands and again.lsf == made.lsf
    path.write_text(text + "snr = 120\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"snr: it must have the names of bands, .* got 120"):
        instrument(path)
    path.write_text(text, encoding="utf-8")
    table.write_text(MEASURED.replace("0.80", "0.82"), encoding="utf-8")
    assert instrument(path).bands[0].response.wavelength[2] == 0.82


@pytest.mark.parametrize(("stage", "keys", "said"), mistakes("responses", name="sensor_mistakes"), ids=str)
def test_wrong_numbers_with_measured_responses_raise(tmp_path, stage, keys, said):
    (tmp_path / "srf.csv").write_text(MEASURED, encoding="utf-8")
    with pytest.raises(ValueError, match=said):
        read_responses(tmp_path / "srf.csv", **({"name": "Camera", "altitude": 5e5, "gsd": 10.0} | keys))


# ------------------------------------------------------------------------------------------- designs


@pytest.mark.parametrize("name", ["TM", "MSI", "VIIRS", "HRV"])
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


def test_design_has_the_given_transfer_and_noise():
    """The noise at any radiance changes by the factor of the ratio."""
    own = instrument("MSI")
    made = own.replace(mtf=0.2, snr=50)
    for number, (band, other) in enumerate(zip(own.bands, made.bands, strict=True)):
        assert nyquist(made, number) == pytest.approx([0.2, 0.2])
        assert other.noise.radiance / other.noise.equivalent_radiance == pytest.approx(50)
        factor = band.noise.radiance / band.noise.equivalent_radiance / 50
        stated = np.array([0.5, 1.0, 3.0]) * band.noise.radiance
        one, two = (model.noise_model(each) for model, each in ((own, band), (made, other)))
        np.testing.assert_allclose(two.thermal**2 + two.shot * stated, factor**2 * (one.thermal**2 + one.shot * stated))
    origins = {row.quantity: row.origin for row in made.provenance}
    assert origins == {row.quantity: row.origin for row in own.provenance} | {"blur": "required", "noise": "required"}
    two_points, stated = (item.bands[3].noise for item in (instrument("OLI").replace(snr=60.0), instrument("OLI")))
    assert two_points.high_snr / stated.high_snr == pytest.approx(60.0 / stated.snr)


# ------------------------------------------------------------------------------------------- responses

NU = 1e-6 * TM.bands[0].wavelength / (2 * 43e-6 * 0.02)
CIRCLE = 2 / np.pi * (np.arccos(NU) - NU * np.sqrt(1 - NU**2))
SCANNER = (2 / np.pi) ** 2 / np.sqrt(2) * CIRCLE
OPTICS = np.exp(-((np.pi * 0.4 * 0.5) ** 2) / (4 * np.log(2)))
RESPONSES = [
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
        "electronics = 0.5\naperture = 0.02\ntruncation = 3e-4\nsmear = 1.0",
        (2 / np.pi) ** 2 / np.sqrt(2) * CIRCLE,
        5e-4,
    ),
    # The MTF of optics with FWHM W is exp(-(pi W f)^2 / (4 ln 2)), of boxcars sinc(W f).
    ("blur = 0.4\nsmear = 0.5\ndetector = 0.9", OPTICS * np.sinc(0.45) * np.sinc(0.25), 2e-3),
    ('[lsf.along]\nkind = "boxcar"\n[lsf.across]\nkind = "gaussian"\nmtf_at_nyquist = 0.4', [2 / np.pi, 0.4], 1e-9),
]


@pytest.mark.parametrize(("lsf", "expected", "atol"), RESPONSES)
def test_each_kind_of_response_has_the_stated_mtf(changed, lsf, expected, atol):
    lsf = lsf if "kind" in lsf else f'kind = "system"\n{lsf}'
    header = ("[lsf] ", "#") if lsf.startswith("[lsf.along]") else ()
    np.testing.assert_allclose(nyquist(changed(*header, "LSF", lsf + "\n", *IFOV)), expected, rtol=0, atol=atol)


def test_responses_may_differ_by_band(changed):
    wider = changed('name = "TM1"', 'name = "TM1"\nlsf = { kind = "boxcar", width = 86.0e-6 }')
    np.testing.assert_allclose(nyquist(wider), np.sinc(1.0), atol=1e-12)
    np.testing.assert_allclose(wider.line_spreads(wider.bands[1]).along.width, 30.31641, rtol=1e-12)


def test_named_responses():
    """A band with the detector response keeps only the applicable sources."""
    paper, msi = instrument("TM", "paper"), instrument("MSI")
    assert paper.lsf == TM.paper_lsf and "Friedl" in paper.source("lsf") and "blur" not in paper.origin
    assert instrument("MSI", "system") == msi and instrument("TM", "system") == TM
    for description in (TM, msi):
        sharp = with_response(description, "detector")
        for band, own in zip(sharp.bands, description.bands, strict=True):
            fields, intervals = description.ground_fields(own), description.ground_intervals(own)
            assert [spread.width for spread in sharp.line_spreads(band)] == list(fields if fields.along else intervals)
            assert not knows_blur(sharp, band) and knows_blur(description, own)
    own = dataclasses.replace(TM.bands[0], sources={"lsf": "Markham1985", "bits": "Chander2009"})
    sharp = with_response(dataclasses.replace(TM, bands=(own, *TM.bands[1:])), "detector").bands[0]
    assert sharp.sources == {"bits": "Chander2009", "ifov": TM.sources["interval"]}


@pytest.mark.parametrize("name", ["TM", "OLI", "VIIRS", "MSI"])
def test_sharpest_and_softest_mtf_differ_by_the_uncertainty(name):
    """For VIIRS the uncertainty is stated before aggregation, i.e. for elementary samples."""
    items = [instrument(name, each) for each in (None, "sharpest", "softest")]
    for number, band in enumerate(items[0].bands):
        error, steps = band_provenance(items[0], "blur", band).uncertainty, items[0].ground_intervals(band)
        spreads = [item.line_spreads(item.bands[number], 1) for item in items]
        own, high, low = (
            np.array([lsf.mtf(0.5 / step) for lsf, step in zip(pair, steps, strict=True)]) for pair in spreads
        )
        axes = slice(1) if items[0].scan.zones else slice(2)
        np.testing.assert_allclose([(high - own)[axes], (own - low)[axes]], error, rtol=1e-6)
        assert high[1] > own[1] > low[1]


def test_spectral_response_is_read_from_a_list_a_table_or_pyrsr(changed, tmp_path):
    """pyrsr has TM in nm or um; negative values are noise."""
    rows = "wavelength = [0.60, 0.63, 0.69, 0.72], response = [0.0, 1.0, 1.0, 0.0]"
    mine = changed("SRF", f"srf = {{ {rows} }}")
    # The centre of a symmetric trapezoid is its midpoint.
    np.testing.assert_allclose(mine.select("TM3")[0].wavelength, 0.66, rtol=1e-12)
    table = "satellite,band,wavelength,response\nX,1,0.60,0\nX,1,0.63,1\nX,1,0.69,1\nX,1,0.72,0\n"
    (tmp_path / "own.csv").write_text("# columns\n" + table, encoding="utf-8")
    other = changed("SRF", 'srf = { table = "own.csv", satellite = "X", band = "1" }')
    assert other.select("TM3")[0].response == mine.select("TM3")[0].response
    found = PyrsrResponse("Landsat-5", "TM", "3").read("TM3")
    theirs = RSR_reader("Landsat-5", "TM", LayerBandsAssignment=["3"])["3"]
    assert 0.5 < found.wavelength[0] < 0.66 < found.wavelength[-1] < 0.8
    np.testing.assert_allclose(found.response, np.maximum(theirs[:, 1], 0))


def test_limits_lie_at_half_maximum():
    found = ResponseList((0.5, 0.6, 0.7, 0.8, 0.9), (0.0, 1.0, 2.0, 1.0, 0.9)).read("a")
    assert found == Band("a", (0.5, 0.6, 0.7, 0.8, 0.9), (0.0, 1.0, 2.0, 1.0, 0.9))
    assert half_peak(found) == (0.6, 0.8)
