"""Noise of instruments at a radiance, by their descriptions."""

import dataclasses

import numpy as np
import pytest

from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.instrument_labels import noise_equivalent_radiance, snr


def test_ratio_is_that_of_the_specification_and_follows_the_share_of_shot_noise():
    """MSI4: 142 at 108 W m-2 sr-1 um-1. What is left of the variance at none of the light is not shot noise."""
    (band,) = instrument("MSI").select("MSI4")
    assert float(snr("MSI", "msi4", 108.0)) == pytest.approx(142.0, rel=1e-12)
    full = (108.0 / 142.0) ** 2
    found = noise_equivalent_radiance("MSI", "MSI4", np.array([108.0, 54.0, 0.0])) ** 2
    np.testing.assert_allclose(found, full * (1 - band.noise.shot * np.array([0.0, 0.5, 1.0])), rtol=1e-12)


def test_ratio_is_radiance_over_noise():
    radiance = np.array([5.0, 50.0, 200.0])
    product = snr("MODIS", "MODIS2", radiance) * noise_equivalent_radiance("MODIS", "MODIS2", radiance)
    np.testing.assert_allclose(product, radiance, rtol=1e-14)


def test_what_has_no_noise_is_named():
    tm = instrument("TM")
    silent = dataclasses.replace(tm, bands=tuple(dataclasses.replace(band, noise=None) for band in tm.bands))
    with pytest.raises(ValueError, match="TM has no noise for TM3"):
        snr(silent, "TM3", 50.0)
