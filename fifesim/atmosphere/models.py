"""The state of the atmosphere: profile of the air, aerosol and visibility."""

import re
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fifesim import datasets
from fifesim.atmosphere import aerosols, molecules

PROFILES = ("midlatitude-summer",)

GRAVITY = 9.80665  # [m s-2]
GAS_CONSTANT = 8.314463  # [J mol-1 K-1]
BOLTZMANN = 1.380649e-23  # [J K-1]
MOLAR_MASS_AIR = 0.028964  # [kg mol-1]
MOLAR_MASS_OZONE = 0.047998  # [kg mol-1]
MOLAR_VOLUME = 0.02241396  # at 273.15 K and 1013.25 hPa [m3 mol-1]

_NUMBER = r"([-+.\deE]+)"
_TEXT = re.compile(rf"profile=(\S+) aerosol=(\S+) visibility={_NUMBER} km altitude={_NUMBER} km")


class Levels(NamedTuple):
    """Levels of a profile from the ground up, each of shape (level,); water vapour and ozone are mass mixing ratios."""

    altitude: np.ndarray  # [km]
    pressure: np.ndarray  # [hPa]
    temperature: np.ndarray  # [K]
    h2o: np.ndarray  # [kg kg-1]
    o3: np.ndarray  # [kg kg-1]


@dataclass(frozen=True)
class Atmosphere:
    """
    A plane-parallel atmosphere.

    Parameters
    ----------
    profile : str, optional
        Pressure, temperature, water vapour and ozone by altitude, one of `PROFILES`.
    aerosol : str, optional
        Optical properties of the aerosol, one of `aerosols.MODELS`.
    visibility : float, optional
        Meteorological range at the ground, 5 to 100. [km]
    altitude : float, optional
        Of the ground, 0 to 4. [km]

    Raises
    ------
    ValueError
        If a name is unknown, or a number out of its range.

    Notes
    -----
    Raising the ground cuts the profile of the air off below; the aerosol stands on the ground and keeps its amount.

    References
    ----------
    [McClatchey1972]_, profiles; [Tanre1990]_

    Examples
    --------
    The text that travels with the data says all:

    >>> Atmosphere.parse(str(Atmosphere(visibility=23))) == Atmosphere(visibility=23)
    True
    """

    profile: str = "midlatitude-summer"
    aerosol: str = "continental"
    visibility: float = 45.0
    altitude: float = 0.4

    def __post_init__(self):
        _check_name("profile", self.profile, PROFILES)
        _check_name("aerosol", self.aerosol, aerosols.MODELS)
        object.__setattr__(self, "visibility", _checked("visibility", self.visibility, 5, 100))
        object.__setattr__(self, "altitude", _checked("altitude", self.altitude, 0, 4))

    def __str__(self):
        visibility, altitude = (
            np.format_float_positional(value, trim="-") for value in (self.visibility, self.altitude)
        )
        return f"profile={self.profile} aerosol={self.aerosol} visibility={visibility} km altitude={altitude} km"

    @classmethod
    def parse(cls, text):
        """
        Atmosphere that a text describes.

        Parameters
        ----------
        text : str
            As ``str(atmosphere)`` writes it.

        Returns
        -------
        atmosphere : Atmosphere

        Raises
        ------
        ValueError
            If the text has another form, or names an atmosphere that is not allowed.
        """
        match = _TEXT.fullmatch(text.strip())
        if match is None:
            raise ValueError(f"atmosphere must read like {str(cls())!r}, got {text!r}")
        profile, aerosol, visibility, altitude = match.groups()
        return cls(profile, aerosol, float(visibility), float(altitude))

    @property
    def levels(self):
        """Profile above the ground, as `Levels`."""
        return profile_above(self.profile, self.altitude)

    @property
    def pressure(self):
        """Pressure at the ground [hPa]."""
        return float(self.levels.pressure[0])

    @property
    def h2o(self):
        """Column of water vapour [g cm-2]."""
        return float(column(self.levels, self.levels.h2o).sum() / 10)

    @property
    def o3(self):
        """Column of ozone [cm-atm]."""
        moles = column(self.levels, self.levels.o3).sum() / MOLAR_MASS_OZONE
        return float(100 * moles * MOLAR_VOLUME)

    @property
    def aot(self):
        """Aerosol optical thickness at 0.55 um [1]."""
        return aerosols.aerosol_optical_thickness(self.visibility)

    def rayleigh_optical_depth(self, wavelength):
        """
        Optical depth of the molecules.

        Parameters
        ----------
        wavelength : array
            [um]

        Returns
        -------
        tau : array
            [1]
        """
        number = self.levels.pressure * 100 / (BOLTZMANN * self.levels.temperature)
        return molecules.rayleigh_cross_section(wavelength) * np.trapezoid(number, self.levels.altitude * 1000)

    def aerosol_optical_depth(self, wavelength):
        """
        Extinction optical depth of the aerosol.

        Parameters
        ----------
        wavelength : array
            0.35 to 3.75. [um]

        Returns
        -------
        tau : array
            [1]
        """
        extinction, _, _ = aerosols.aerosol_optics(self.aerosol, wavelength)
        return self.aot * extinction


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


def _check_name(what, value, allowed):
    if value in allowed:
        return
    nearest = get_close_matches(str(value), allowed, n=1, cutoff=0.0)[0]
    raise ValueError(f"{what} must be one of {', '.join(allowed)}, got {value!r}: type {what}={nearest!r}")


def _checked(what, value, low, high):
    if not isinstance(value, (int, float, np.number)) or isinstance(value, bool):
        raise TypeError(f"{what} must be a number of km from {low} to {high}, got {value!r}: leave the unit out")
    if not low <= value <= high:
        nearest = low if value < low else high
        raise ValueError(
            f"{what} must be from {low} to {high} km, got {value:g}: type {what}={nearest}, the nearest allowed"
        )
    return float(value)
