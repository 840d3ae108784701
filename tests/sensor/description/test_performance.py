"""Noise, gain states and scans as files give them."""

import numpy as np
import pytest

from fifesim.sensor.description.performance import EARTH_RADIUS, Gain, Noise, Scan, swath_width


@pytest.mark.parametrize(
    ("replacements", "message"),
    [
        (('name = "TM1"', 'name = "TM1"\nnoise = { radiance = 50.0 }'), "bands.1.noise: give either snr or nedl"),
        (('name = "TM1"', 'name = "TM1"\nnoise = { radiance = 50.0, snr = 100.0 }'), "sources.noise: must be one of"),
        (("max_angle = 7.47", "max_angle = 90.0"), "scan.max_angle = 90.0: .*less than 75"),
        (('kind = "whiskbroom"', 'kind = "frame"'), "scan.kind = 'frame': .*'whiskbroom' or 'pushbroom'"),
    ],
)
def test_mistakes_in_noise_and_scan_name_key_and_remedy(changed, replacements, message):
    with pytest.raises(ValueError, match=f"mine.toml: .*{message}"):
        changed(*replacements)


def test_noise_by_its_ratio_and_by_its_radiance_is_the_same():
    """Half of the variance is shot noise: at a fourth of the light, an eighth and a half of it are left."""
    by_ratio, by_radiance = Noise(radiance=80.0, snr=160.0, shot=0.5), Noise(radiance=80.0, nedl=0.5, shot=0.5)
    assert by_ratio.equivalent_radiance == by_radiance.equivalent_radiance == 0.5
    for noise in (by_ratio, by_radiance):
        model = noise.model(6, "columns")
        assert (model.detectors, model.along) == (6, "columns")
        np.testing.assert_allclose(
            model.noise_equivalent_radiance([80.0, 20.0]), [0.5, 0.5 * np.sqrt(0.625)], rtol=1e-12
        )
    constant = Noise(radiance=80.0, snr=160.0).model(1, "rows")
    assert (constant.shot, constant.thermal) == (0.0, 0.5)


def test_gain_that_falls_is_refused():
    with pytest.raises(ValueError, match="must be above min_radiance, got 1 and 1 W"):
        Gain(1.0, 1.0)


@pytest.mark.parametrize("angle", [0.5, 7.5, 30.0, 55.4])
def test_swath_is_an_arc_whose_chord_closes_the_triangle(angle):
    """Law of sines in the triangle of satellite, ground and earth's centre."""
    half = swath_width(833e3, angle) / 2 / EARTH_RADIUS
    vza = np.radians(angle) + half
    assert (EARTH_RADIUS + 833e3) * np.sin(np.radians(angle)) == pytest.approx(EARTH_RADIUS * np.sin(vza), rel=1e-12)
    assert half > 0


def test_scan_beyond_the_horizon_has_no_width():
    horizon = np.degrees(np.arcsin(EARTH_RADIUS / (EARTH_RADIUS + 705e3)))
    assert np.isinf(swath_width(705e3, horizon + 0.01)) and np.isfinite(swath_width(705e3, horizon - 0.01))
    assert Scan("pushbroom", max_angle=7.5).samples is None
