"""Profiles of the air: pressure, temperature, water vapour and ozone by altitude."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fifesim.base import datasets

PROFILES = ("tropical", "midlatitude-summer", "midlatitude-winter", "subarctic-summer", "subarctic-winter", "us-1962")

GRAVITY = 9.80665  # [m s-2]
GAS_CONSTANT = 8.314463  # [J mol-1 K-1]
BOLTZMANN = 1.380649e-23  # [J K-1]
MOLAR_MASS_AIR = 0.028964  # [kg mol-1]
MOLAR_MASS_OZONE = 0.047998  # [kg mol-1]
MOLAR_VOLUME = 0.02241396  # at 273.15 K and 1013.25 hPa [m3 mol-1]


class Levels(NamedTuple):
    """Levels of a profile from the ground up, each of shape (level,); water vapour and ozone are mass mixing ratios."""

    altitude: np.ndarray  # [km]
    pressure: np.ndarray  # [hPa]
    temperature: np.ndarray  # [K]
    h2o: np.ndarray  # [kg kg-1]
    o3: np.ndarray  # [kg kg-1]


@lru_cache
def profile_above(profile, altitude):
    """
    Levels of a profile above the ground.

    Parameters
    ----------
    profile : str
        One of `PROFILES`.
    altitude : float
        Of the ground. [km]

    Returns
    -------
    levels : Levels
        The lowest lies on the ground: temperature and densities linear in altitude there, pressure exponential.

    References
    ----------
    [McClatchey1972]_, Table 1

    Examples
    --------
    >>> round(float(profile_above("midlatitude-summer", 0.0).pressure[0]), 9)
    1013.0
    """
    table = datasets.table("atmosphere_profiles.csv").query("profile == @profile")
    altitudes = table["altitude"].to_numpy(float)
    above = np.concatenate([[altitude], altitudes[altitudes > altitude]])
    pressure = np.exp(np.interp(above, altitudes, np.log(table["pressure"])))
    temperature, h2o, o3 = (np.interp(above, altitudes, table[name]) for name in ("temperature", "h2o", "o3"))
    # The air's density in the table's unit. [g m-3]
    air = 1000 * pressure * 100 * MOLAR_MASS_AIR / (GAS_CONSTANT * temperature)
    return Levels(above, pressure, temperature, h2o / air, o3 / air)


def column(levels, mixing_ratio):
    r"""
    Mass of a gas above the ground, level by level.

    .. math:: u = \int q \, \frac{\mathrm{d}p}{g}

    Parameters
    ----------
    levels : Levels
    mixing_ratio : array, shape (level,)
        Mass of the gas in a mass of air, :math:`q`. [kg kg-1]

    Returns
    -------
    mass : array, shape (level,)
        The sum is the column, by the trapezoidal rule in pressure. [kg m-2]

    Examples
    --------
    The air itself weighs what the pressure says:

    >>> levels = profile_above("midlatitude-summer", 0.0)
    >>> round(float(column(levels, 1.0).sum() * 9.80665 / 100))
    1013
    """
    half = -np.diff(levels.pressure) * 100 / 2
    thickness = np.concatenate([half, [0]]) + np.concatenate([[0], half])
    return mixing_ratio * thickness / GRAVITY
