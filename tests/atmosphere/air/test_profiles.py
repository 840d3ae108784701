from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.atmosphere.gases import PROFILES, profile_above
from fifesim.atmosphere.models import Atmosphere

# Runs of 6SV1.1; the columns are integrals over its levels, not the labels that it prints.
DATA = Path(__file__).parents[2] / "data"
COLUMNS = pd.read_csv(DATA / "sixs_columns.csv", comment="#")
RAYLEIGH = pd.read_csv(DATA / "sixs_rayleigh.csv", comment="#")


@pytest.mark.parametrize("profile", PROFILES)
def test_columns_agree_with_6s(profile):
    """0.2 %, for its other constants of nature; the state at the ground to the last digit of single precision."""
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
    """0.3 % less: 6S closes its profile by a layer from 100 to 99999 km that holds 0.26 % of the molecules."""
    rows = RAYLEIGH[RAYLEIGH["profile"] == profile]
    assert len(rows) >= 6
    for row in rows.itertuples():
        tau = Atmosphere(profile, altitude=row.altitude).rayleigh_optical_depth(row.wavelength)
        assert tau == pytest.approx(row.rayleigh_optical_depth, rel=3.2e-3)


@pytest.mark.parametrize("profile", PROFILES)
def test_air_is_in_hydrostatic_balance(profile):
    """Up to 50 km, 4 % in a layer: pressures printed to 1 hPa make a layer of 1 km uncertain by that much at 15 km."""
    levels = profile_above(profile, 0.0)
    low = levels.altitude <= 50
    altitude, pressure, temperature = levels.altitude[low], levels.pressure[low], levels.temperature[low]
    gravity = 9.80665 * (6371 / (6371 + (altitude[1:] + altitude[:-1]) / 2)) ** 2
    scale_height = 8.314463 * (temperature[1:] + temperature[:-1]) / 2 / (0.028964 * gravity) / 1000
    thickness = scale_height * np.log(pressure[:-1] / pressure[1:])
    np.testing.assert_allclose(thickness, np.diff(altitude), rtol=0.04)


@pytest.mark.parametrize("profile", PROFILES)
def test_air_is_not_supersaturated(profile):
    """Against the saturation density over water (Magnus), below 8 km; the tables round to two digits."""
    levels = profile_above(profile, 0.0)
    low = levels.altitude <= 8
    celsius = levels.temperature[low] - 273.15
    saturation = 100 * 6.112 * np.exp(17.62 * celsius / (243.12 + celsius)) / (461.5 * levels.temperature[low])
    air = levels.pressure[low] * 100 * 0.028964 / (8.314463 * levels.temperature[low])
    assert np.all(levels.h2o[low] * air < 1.05 * saturation)
