"""Absorption by the gases of the air."""

from functools import lru_cache

import numpy as np

from fifesim import datasets
from fifesim.atmosphere import models

# Volume mixing ratios of the uniformly mixed gases, in the years of AFGL's 1982 line list. [1]
MIXING_RATIO = {"co2": 330e-6, "o2": 0.20947, "n2o": 310e-9, "ch4": 1.72e-6}
GASES = ("h2o", "o3", *MIXING_RATIO)

STANDARD_PRESSURE = 1013.25  # [hPa]
REFERENCE_TEMPERATURE = 250.0  # [K]


def goody(weak, saturation):
    r"""
    Absorption optical depth of random lines of exponentially distributed strength.

    .. math:: \tau = \frac{k U}{\sqrt{1 + b U^2 / V}}

    Parameters
    ----------
    weak : array
        Optical depth were the lines weak, :math:`k U`. [1]
    saturation : array
        :math:`b U^2 / V`, with the pressure-weighted amount :math:`V`. [1]

    Returns
    -------
    tau : array
        [1]

    References
    ----------
    [Goody1952]_; [Tanre1990]_ for water vapour

    Examples
    --------
    >>> float(goody(0.5, 0.0))
    0.5
    """
    return weak / np.sqrt(1 + saturation)


def malkmus(weak, saturation):
    r"""
    Absorption optical depth of random lines with an excess of weak ones.

    .. math:: \tau = \frac{V}{2 b' U} \left[\sqrt{1 + 4 b U^2 / V} - 1\right], \qquad b' = b / k

    Parameters
    ----------
    weak, saturation : array
        As in `goody`. [1]

    Returns
    -------
    tau : array
        [1]

    Notes
    -----
    Coded as :math:`2 k U / (1 + \sqrt{1 + 4 b U^2 / V})`, the same where the lines are weak too.

    References
    ----------
    [Malkmus1967]_; [Tanre1990]_ for all gases but water vapour

    Examples
    --------
    >>> float(malkmus(0.5, 0.0))
    0.5
    """
    return 2 * weak / (1 + np.sqrt(1 + 4 * saturation))


BAND_MODEL = {gas: goody if gas == "h2o" else malkmus for gas in GASES}


def absorber_layers(levels, gas):
    """
    Amount of a gas above the ground, level by level.

    Parameters
    ----------
    levels : models.Levels
    gas : str
        One of `GASES`.

    Returns
    -------
    amount : array, shape (level,)
        Water vapour [g cm-2], the others [cm-atm].

    Examples
    --------
    >>> levels = models.profile_above("midlatitude-summer", 0.0)
    >>> round(float(absorber_layers(levels, "h2o").sum()), 1)
    2.9
    """
    if gas == "h2o":
        return models.column(levels, levels.h2o) / 10
    if gas == "o3":
        moles = models.column(levels, levels.o3) / models.MOLAR_MASS_OZONE
    else:
        moles = models.column(levels, MIXING_RATIO[gas]) / models.MOLAR_MASS_AIR
    return 100 * moles * models.MOLAR_VOLUME


def effective_amounts(levels, gas, strength_temperature, width_temperature):
    r"""
    Vertical amounts of a gas as its lines see them, weighted by temperature and pressure.

    .. math::

        U = \int e^{c (T - T_0)} \, \mathrm{d}u, \qquad
        V = \int e^{d (T - T_0)} \frac{p}{p_0} \, \mathrm{d}u

    Parameters
    ----------
    levels : models.Levels
    gas : str
        One of `GASES`.
    strength_temperature, width_temperature : array, shape (n,)
        :math:`c` and :math:`d`. [K-1]

    Returns
    -------
    amount, broadening_amount : array, shape (n,)
        :math:`U` and :math:`V`, in the unit of `absorber_layers`.

    References
    ----------
    [Rodgers1966]_

    Examples
    --------
    Without temperature the first is the column:

    >>> levels = models.profile_above("midlatitude-summer", 0.0)
    >>> round(float(effective_amounts(levels, "o3", 0.0, 0.0)[0]), 2)
    0.32
    """
    layers = absorber_layers(levels, gas)
    excess = levels.temperature - REFERENCE_TEMPERATURE
    amount = np.exp(np.multiply.outer(strength_temperature, excess)) @ layers
    broadening = np.exp(np.multiply.outer(width_temperature, excess)) @ (layers * levels.pressure / STANDARD_PRESSURE)
    return amount, broadening


@lru_cache
def table_wavelengths():
    """
    Wavelengths of the gas table.

    Returns
    -------
    wavelength : array, shape (841,)
        0.4 to 2.5 in steps of 0.0025. [um]
    """
    return np.round(np.linspace(0.4, 2.5, 841), 4)


@lru_cache
def _vertical(profile, altitude, gas):
    """Weak-line optical depth and saturation at air mass 1, at the wavelengths of the table."""
    table = datasets.table("gas_absorption.csv").query("gas == @gas")
    levels = models.profile_above(profile, altitude)
    temperature = (table[name].to_numpy() for name in ("strength_temperature", "width_temperature"))
    amount, broadening = effective_amounts(levels, gas, *temperature)
    index = np.searchsorted(table_wavelengths(), table["wavelength"].to_numpy() - 1e-6)
    weak, saturation = np.zeros((2, table_wavelengths().size))
    weak[index] = table["strength"] * amount
    saturation[index] = table["saturation"] * amount**2 / broadening
    return weak, saturation


def gas_transmittance(wavelength, atmosphere, air_mass, *, gases=GASES):
    r"""
    Transmittance of the absorbing gases along a slant path.

    .. math:: T_g = \prod_i \exp(-\tau_i(m U_i, m V_i))

    Parameters
    ----------
    wavelength : array, shape (n,)
        0.4 to 2.5; linear between steps of 0.0025. [um]
    atmosphere : models.Atmosphere
    air_mass : array, shape (...)
        Length of the path over the vertical one, :math:`m`; for sun and view together
        :math:`1 / \mu_s + 1 / \mu_v`. [1]
    gases : tuple of str, optional
        Of `GASES`; all by default.

    Returns
    -------
    transmittance : array, shape (..., n)
        [1]

    Raises
    ------
    ValueError
        If a wavelength lies outside the table.

    Notes
    -----
    Lines saturate, so the transmittance of the path down and up is not the product of the two: the amounts add.
    The parameters reproduce each gas of 6SV1.1 at each wavelength within 7e-4 at the ground altitudes of their fit
    (0, 1, 2 and 4 km, midlatitude summer, air masses of 1 to 4.9) and within 1.5e-3 between them.
    They stand for the mean over 10 cm-1 at each wavelength.

    References
    ----------
    [Tanre1990]_; band models of [Goody1952]_ and [Malkmus1967]_

    Examples
    --------
    >>> atmosphere = models.Atmosphere()
    >>> once, twice = gas_transmittance(0.94, atmosphere, [1.0, 2.0])[:, 0]
    >>> bool(twice > once**2)
    True
    """
    wavelength = np.atleast_1d(np.asarray(wavelength, float))
    nodes = table_wavelengths()
    if wavelength.min() < nodes[0] or wavelength.max() > nodes[-1]:
        raise ValueError(
            f"wavelength must be from {nodes[0]:g} to {nodes[-1]:g} um, got {wavelength.min():g} to "
            f"{wavelength.max():g}: give it in micrometres, inside the gas table"
        )
    air_mass = np.asarray(air_mass, float)[..., None]
    depth = np.zeros((*air_mass.shape[:-1], nodes.size))
    for gas in gases:
        weak, saturation = _vertical(atmosphere.profile, atmosphere.altitude, gas)
        depth = depth + BAND_MODEL[gas](weak * air_mass, saturation * air_mass)
    return _interpolated(np.exp(-depth), nodes, wavelength)


def _interpolated(values, nodes, wavelength):
    """Linear interpolation along the last axis."""
    index = np.clip(np.searchsorted(nodes, wavelength) - 1, 0, nodes.size - 2)
    share = (wavelength - nodes[index]) / (nodes[index + 1] - nodes[index])
    return values[..., index] * (1 - share) + values[..., index + 1] * share
