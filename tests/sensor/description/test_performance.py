"""Noise, gain states and scans as files give them."""

import numpy as np
import pytest

from fifesim.sensor.description.instrument_file import Gain, Noise, Scan


@pytest.mark.parametrize(
    ("replacements", "message"),
    [
        (('name = "TM1"', 'name = "TM1"\nnoise = { radiance = 50.0 }'), "bands.1.noise: give either snr or nedl"),
        (('name = "TM1"', 'name = "TM1"\nnoise = { radiance = 50.0, snr = 100.0 }'), "sources.noise: must be one of"),
        (("max_angle = 7.47", "max_angle = 90.0"), "scan.max_angle = 90.0: must be below 75"),
        (('kind = "whiskbroom"', 'kind = "frame"'), "scan.kind = 'frame': .*'whiskbroom' or 'pushbroom'"),
    ],
)
def test_mistakes_in_noise_and_scan_name_key_and_remedy(changed, replacements, message):
    with pytest.raises(ValueError, match=f"mine.toml: .*{message}"):
        changed(*replacements)


PRODUCT = "[product]\ngain = 2e-5\noffset = -0.1\nbits = 16\nsun_corrected = false\n\n[lsf]"
SOURCE = '\n[sources]\nproduct = "Chander2009"'


def test_the_scale_of_a_product_has_a_source(changed):
    product = changed("[lsf]", PRODUCT, "\n[sources]", SOURCE).product
    assert (product.gain, product.offset, product.bits, product.sun_corrected) == (2e-5, -0.1, 16, False)
    with pytest.raises(ValueError, match=r"mine\.toml: sources\.product: must be one of"):
        changed("[lsf]", PRODUCT)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("2e-5", "-2e-5", r"product\.gain = -2e-05: must be above 0"),
        ("bits = 16\nsun", "bits = 32\nsun", r"product\.bits = 32: must be at most 16"),
        ("false", '"no"', r"product\.sun_corrected = 'no'"),
        ("\noffset = -0.1", "", r"the key product\.offset is missing"),
    ],
)
def test_mistakes_in_a_product_name_the_key(changed, old, new, said):
    with pytest.raises(ValueError, match=said):
        changed("[lsf]", PRODUCT.replace(old, new), "\n[sources]", SOURCE)


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
    constant = Noise(radiance=80.0, snr=160.0, shot=0.0).model(1, "rows")
    assert (constant.shot, constant.thermal) == (0.0, 0.5)


def test_gain_that_falls_is_refused():
    with pytest.raises(ValueError, match="must be above min_radiance, got 1 and 1 W"):
        Gain(1.0, 1.0)


def test_scan_needs_its_kind_and_its_angle_alone():
    scan = Scan("pushbroom", max_angle=7.5)
    assert (scan.samples, scan.lines, scan.period, scan.swath) == (None, None, None, None)
