"""Noise, gain states and scans as files give them."""

import numpy as np
import pytest

from fifesim.sensor.description.performance import Gain, Noise, Scan


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


def test_scan_needs_its_kind_and_its_angle_alone():
    scan = Scan("pushbroom", max_angle=7.5)
    assert (scan.samples, scan.lines, scan.period, scan.swath) == (None, None, None, None)
