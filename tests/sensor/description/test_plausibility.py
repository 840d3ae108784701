"""Numbers in another unit than that of their key are found out."""

import pytest

from fifesim.base import files
from fifesim.sensor.description.instruments import read_instrument


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
    [
        ("0.9669", "scan: .*2048 x 0.00095 radians, reach 55.7 degrees to either side, and max_angle = 0.9669 degrees"),
        ("60.0", "scan: .*reach 55.7 degrees to either side, and max_angle = 60 degrees"),
        ("70.0", "scan.max_angle = 70: .*misses the earth"),
    ],
)
def test_a_scan_without_a_swath_is_compared_with_its_samples_and_the_horizon(tmp_path, angle, message):
    """2048 samples of 0.95 mrad are 55.7 degrees to either side; the horizon from 833 km is at 62.2."""
    text = files.path("instruments/avhrr9.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text.replace("max_angle = 55.4", f"max_angle = {angle}"), encoding="utf-8")
    with pytest.raises(ValueError, match=f"mine.toml: {message}"):
        read_instrument(path)


def test_sums_of_samples_are_counted_as_what_they_are_made_of(tmp_path):
    """6400 equal samples as wide as the sums at nadir would reach 86 degrees; the zones of VIIRS reach 56."""
    text = files.path("instruments/viirs.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    assert read_instrument(path).scan.elementary_samples() == 12608
    start, end = text.index("[[scan.zones]]"), text.index("[origin]")
    path.write_text((text[:start] + text[end:]).replace("0.00015582", "0.00046746"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"6400 x 0.00046746 radians, reach 85.7 degrees.*\[\[scan.zones\]\]"):
        read_instrument(path)
    for old, new, message in (
        ("samples = 736", "samples = 737", "half of samples = 6400, got 3201"),
        ("deleted = 4", "deleted = 16", "deleted = 16 at each end leaves none of lines = 32"),
        ("aggregation = 2", "aggregation = 0", "scan.zones.2.aggregation = 0"),
    ):
        path.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(ValueError, match=message):
            read_instrument(path)


@pytest.mark.parametrize(("angle", "fits"), [(30.0, True), (33.08, True), (36.0, False), (27.0, False)])
def test_a_flat_row_of_detectors_has_equal_steps_of_the_tangent(tmp_path, angle, fits):
    """1000 pixels of 0.1 m from 86.6 m: half of the row is 50 / 86.6, the tangent of 30 degrees, or 33.08 degrees."""
    bands = '[{ name = "red", center = 0.668, width = 0.010 }]'
    scan = f'{{ kind = "pushbroom", max_angle = {angle}, samples = 1000 }}'
    path = tmp_path / "camera.toml"
    text = f'name = "Camera"\naltitude = 86.6\ngsd = 0.1\nbits = 12\nscan = {scan}\nbands = {bands}\n'
    path.write_text(text, encoding="utf-8")
    if fits:
        assert read_instrument(path).scan.samples == 1000
        return
    with pytest.raises(ValueError, match="samples of red times interval, 1000 x 0\\.00115473 radians"):
        read_instrument(path)


def test_noise_of_another_radiance_is_found_out(changed):
    source = ('bits = "Friedl1995"', 'bits = "Friedl1995"\nnoise = "Friedl1995"')
    said = "mine.toml: .*noise.radiance = 500: it is in W m-2 sr-1 um-1 and must lie between"
    with pytest.raises(ValueError, match=said):
        changed(*source, 'name = "TM1"', 'name = "TM1"\nnoise = { radiance = 500.0, snr = 100.0 }')
