"""Short instrument files: what they leave out, and its source."""

import numpy as np
import pytest

import fifesim
from fifesim.base.bands import solar_irradiance
from fifesim.scenario.scenario import parse_scenario

CAMERA = """
name = "Camera"
altitude = 120.0
gsd = 0.1
bits = 12
bands = [
    { name = "red", center = 0.668, width = 0.010, snr = 200.0, snr_radiance = 100.0 },
    { name = "nir", center = 0.840, width = 0.040, shape = "boxcar", full_scale_radiance = 300.0 },
]
"""
TABLE = """name,center,width,snr,snr_radiance
red,0.668,0.010,200,100
nir,0.840,0.040,,
"""


def read(folder, text):
    path = folder / "camera.toml"
    path.write_text(text, encoding="utf-8")
    return fifesim.read_instrument(path)


def test_ten_lines_make_an_instrument(tmp_path):
    camera = read(tmp_path, CAMERA)
    red, nir = camera.bands
    assert len(CAMERA.split()) and len(CAMERA.strip().splitlines()) < 10
    assert (red.wavelength, nir.wavelength) == (pytest.approx(0.668, abs=1e-9), pytest.approx(0.840, abs=1e-9))
    assert camera.ground_interval == pytest.approx(0.1, rel=1e-12)
    assert camera.line_spread.width == pytest.approx(0.1, rel=1e-12)
    assert red.noise.equivalent_radiance == 0.5 and nir.noise is None
    assert (nir.full_scale_radiance, nir.min_radiance, red.min_radiance) == (300.0, 0.0, 0.0)


def test_response_has_its_width_at_half_of_its_maximum(tmp_path):
    red, nir = (band.response for band in read(tmp_path, CAMERA).bands)
    half = np.interp([0.663, 0.668, 0.673], red.wavelength, red.response)
    np.testing.assert_allclose(half, [0.5, 1.0, 0.5], rtol=0, atol=1e-9)
    assert np.interp([0.8201, 0.8599, 0.8199, 0.8601], nir.wavelength, nir.response).tolist() == [1, 1, 0, 0]
    # A Gaussian's area is its width times sqrt(pi / ln 2) / 2, but for its cut ends.
    area = np.trapezoid(red.response, red.wavelength)
    assert area == pytest.approx(0.010 * np.sqrt(np.pi / np.log(2)) / 2, rel=1e-3)


def test_sun_and_range_are_those_of_the_reference_spectrum_and_say_so(tmp_path):
    camera = read(tmp_path, CAMERA)
    red, nir = camera.bands
    assert red.solar_irradiance == solar_irradiance(red.response)
    assert red.full_scale_radiance == pytest.approx(red.solar_irradiance / np.pi, rel=1e-15)
    assert camera.source("solar_irradiance", red).startswith("ASTM G173-03")
    assert camera.source("full_scale_radiance", red).startswith("taken for a white surface")
    assert camera.source("full_scale_radiance", nir) == "as camera.toml says"
    assert camera.source("interval").startswith("taken for gsd over altitude")
    assert camera.source("noise", red) == "as camera.toml says"


def test_bands_may_stand_in_a_table_beside_the_file(tmp_path):
    (tmp_path / "bands.csv").write_text(TABLE)
    camera = read(tmp_path, 'name = "Camera"\naltitude = 120.0\ngsd = 0.1\nbits = 12\nbands = "bands.csv"\n')
    red, nir = camera.bands
    assert red == read(tmp_path, CAMERA).bands[0] and nir.noise is None
    assert nir.wavelength == pytest.approx(0.840, abs=1e-9)


def test_a_table_that_changed_is_read_again(tmp_path):
    (tmp_path / "bands.csv").write_text(TABLE)
    path = tmp_path / "camera.toml"
    path.write_text('name = "Camera"\naltitude = 120.0\ngsd = 0.1\nbits = 12\nbands = "bands.csv"\n')
    assert fifesim.instrument(path) is fifesim.instrument(path)
    (tmp_path / "bands.csv").write_text(TABLE.replace("0.668", "0.6500"))
    assert fifesim.instrument(path).bands[0].wavelength == pytest.approx(0.65, abs=1e-9)


def test_share_of_shot_noise_stands_beside_the_ratio(tmp_path):
    red, _ = read(tmp_path, CAMERA.replace("snr_radiance = 100.0", "snr_radiance = 100.0, snr_shot = 0.75")).bands
    assert (red.noise.equivalent_radiance, red.noise.shot) == (0.5, 0.75)


def test_two_ratios_determine_the_noise_at_every_radiance(tmp_path):
    second = "snr_radiance = 100.0, high_snr = 350.0, high_snr_radiance = 250.0"
    camera = read(tmp_path, CAMERA.replace("snr_radiance = 100.0", second))
    model = camera.noise_model(camera.bands[0])
    assert model.snr([100.0, 250.0]).tolist() == pytest.approx([200.0, 350.0], rel=1e-12)


def test_blur_is_stated_by_the_transfer_at_the_nyquist_frequency(tmp_path):
    def transfer(camera, number):
        spreads, steps = camera.line_spreads(camera.bands[number]), camera.ground_intervals(camera.bands[number])
        return [float(spread.mtf(0.5 / step)) for spread, step in zip(spreads, steps, strict=True)]

    own = 'bits = 12\nmtf_at_nyquist = { along = 0.2, across = 0.3 }\norigin = { blur = { kind = "required" } }'
    text = CAMERA.replace("bits = 12", own)
    camera = read(tmp_path, text.replace('name = "nir"', 'name = "nir", mtf_at_nyquist = 0.15'))
    np.testing.assert_allclose(transfer(camera, 0), [0.2, 0.3], rtol=1e-9)
    np.testing.assert_allclose(transfer(camera, 1), 0.15, rtol=1e-9)
    blur, noise, lacking, place = camera.provenance
    assert (blur.quantity, blur.bands, blur.origin) == ("blur", ("red", "nir"), "required")
    assert (noise.bands, noise.origin, lacking.bands, lacking.origin) == (("red",), "assumed", ("nir",), "unknown")
    assert (place.quantity, place.origin) == ("geolocation", "unknown")
    with pytest.raises(ValueError, match="mtf_at_nyquist and lsf both state the blur"):
        read(tmp_path, text.replace("bits = 12", 'bits = 12\nlsf = { kind = "boxcar" }'))
    with pytest.raises(ValueError, match=r"lsf\.across\.mtf_at_nyquist = 1.3: must be below 1"):
        read(tmp_path, text.replace("0.3", "1.3"))
    with pytest.raises(ValueError, match=r"origin\.blur\.kind = 'guessed': .*'in-flight', 'pre-launch'"):
        read(tmp_path, text.replace("required", "guessed"))


def test_scenario_sees_through_a_short_file(tmp_path):
    path = tmp_path / "camera.toml"
    path.write_text(CAMERA, encoding="utf-8")
    case = parse_scenario(
        {
            "grid": {"width": 2.0, "height": 2.0, "cell": 0.05},
            "terrain": {"dem": "flat"},
            "sensor": {"instrument": str(path)},
        }
    )
    image = fifesim.simulate(case.complete())["image"]
    assert image["dn"]["band"].values.tolist() == ["red", "nir"] and image["dn"].shape == (2, 20, 20)
    assert 0.1 < float(image["ndvi"].mean()) < 0.9


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("center = 0.668", "center = 668.0", "camera.toml: .*center = 668: .*nm: divide by 1000"),
        ("width = 0.010", "width = 10.0", "bands.1.srf: width = 10: it is in um, and too wide"),
        ("width = 0.010, ", "", "bands.1.srf.width is missing"),
        ('"boxcar"', '"triangle"', "bands.2.srf.shape = 'triangle'"),
        (", snr_radiance = 100.0", "", "bands.1.noise.radiance is missing"),
        ("gsd = 0.1", "gzd = 0.1", "gsd is missing"),
        ("altitude = 120.0", "altitude = 0.12", "altitude = 0.12|interval = 0.8"),
    ],
)
def test_mistake_in_a_short_file_is_one_line(tmp_path, old, new, said):
    assert old in CAMERA
    with pytest.raises(ValueError, match=said) as caught:
        read(tmp_path, CAMERA.replace(old, new))
    assert "\n" not in str(caught.value) and len(str(caught.value)) <= 500


@pytest.mark.parametrize("name", ["../bands.csv", "/bands.csv", "bands.csv/"])
def test_table_lies_beside_its_file(tmp_path, name):
    (tmp_path / "bands.csv").write_text(TABLE)
    folder = tmp_path / "own"
    folder.mkdir()
    name = str(tmp_path) + name if name.startswith("/") else name
    with pytest.raises(ValueError, match="no such file beside it; type a CSV file of bands"):
        read(folder, f'name = "Camera"\naltitude = 120.0\ngsd = 0.1\nbits = 12\nbands = "{name}"\n')


@pytest.mark.parametrize(
    ("table", "said"),
    [(None, "bands = 'bands.csv': no such file beside it"), ("name,center\nred,0.6\n", "lacks the columns width")],
)
def test_table_that_is_none_is_told(tmp_path, table, said):
    if table:
        (tmp_path / "bands.csv").write_text(table)
    with pytest.raises(ValueError, match=f"camera.toml: .*{said}"):
        read(tmp_path, 'name = "Camera"\naltitude = 120.0\ngsd = 0.1\nbits = 12\nbands = "bands.csv"\n')
