"""Noise of instruments at a radiance, by their descriptions."""

import dataclasses

import numpy as np
import pytest

from fifesim.sensor.description.instrument_file import Noise
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.instrument_labels import noise_equivalent_radiance, snr


def test_ratio_is_that_of_the_specification_and_follows_the_share_of_shot_noise():
    """MSI4: 223 at 108 W m-2 sr-1 um-1. What is left of the variance at none of the light is not shot noise."""
    (band,) = instrument("MSI").select("MSI4")
    assert float(snr("MSI", "msi4", 108.0)) == pytest.approx(223.0, rel=1e-12)
    full = (108.0 / 223.0) ** 2
    found = noise_equivalent_radiance("MSI", "MSI4", np.array([108.0, 54.0, 0.0])) ** 2
    np.testing.assert_allclose(found, full * (1 - band.noise.shot * np.array([0.0, 0.5, 1.0])), rtol=1e-12)


# Ratios of OLI before launch at its typical and its high radiance [W m-2 sr-1 um-1].
OLI = {"OLI2": ((40, 370), (190, 1130)), "OLI3": ((30, 305), (194, 1200)), "OLI4": ((22, 230), (150, 950))}
OLI |= {"OLI5": ((14, 205), (150, 1000))}


@pytest.mark.parametrize("name", OLI)
def test_oli_passes_through_both_measured_ratios(name):
    radiance, ratios = np.transpose(OLI[name]).astype(float)
    np.testing.assert_allclose(snr("OLI", name, radiance), ratios, rtol=1e-12)
    # Between shot noise alone (square root of the radiance) and constant noise alone (linear).
    between = np.sqrt(radiance.prod())
    root, line = ratios[0] * np.sqrt(between / radiance[0]), ratios[0] * between / radiance[0]
    assert root < float(snr("OLI", name, between)) < line


def test_noise_of_oli_red_separates_into_shot_and_constant_noise():
    """By hand from (22 / 230)^2 and (150 / 950)^2: b = 1.233e-4 and c0 = 0.0802 W m-2 sr-1 um-1."""
    model = instrument("OLI").noise_model(*instrument("OLI").select("OLI4"))
    np.testing.assert_allclose([model.thermal, model.shot], [0.0802, 1.233e-4], rtol=1e-3)
    np.testing.assert_allclose(snr("OLI", "OLI4", [22.0, 60.0, 150.0]), [230, 510.3, 950], rtol=1e-3)


def test_second_point_of_an_instrument_file_is_complete_and_higher():
    for keys, message in (
        ({"high_radiance": 150.0}, "belong together"),
        ({"high_radiance": 20.0, "high_snr": 300.0}, "high_radiance must be above radiance = 22, got 20"),
        ({"high_radiance": 150.0, "high_snr": 950.0, "shot": 0.5}, "shot_share belongs to one"),
        ({"high_radiance": 150.0, "high_snr": 2000.0}, "negative variance of shot"),
    ):
        with pytest.raises(ValueError, match=message):
            Noise(radiance=22.0, snr=230.0, **keys)


def test_ratio_is_radiance_over_noise():
    radiance = np.array([5.0, 50.0, 200.0])
    product = snr("MODIS", "MODIS2", radiance) * noise_equivalent_radiance("MODIS", "MODIS2", radiance)
    np.testing.assert_allclose(product, radiance, rtol=1e-14)


def test_what_has_no_noise_is_named():
    tm = instrument("TM")
    silent = dataclasses.replace(tm, bands=tuple(dataclasses.replace(band, noise=None) for band in tm.bands))
    with pytest.raises(ValueError, match="TM has no noise for TM3"):
        snr(silent, "TM3", 50.0)
