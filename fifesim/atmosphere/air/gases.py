"""Absorption by the gases of the air."""

from functools import lru_cache

import numpy as np

from fifesim.atmosphere.air import profiles
from fifesim.base import datasets

# Volume mixing ratios of the uniformly mixed gases, in the years of AFGL's 1982 line list. [1]
MIXING_RATIO = {"co2": 330e-6, "o2": 0.20947, "n2o": 310e-9, "ch4": 1.72e-6}
DRY_GASES = ("o3", *MIXING_RATIO)
GASES = ("h2o", *DRY_GASES)

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
    Amount of a gas above the ground, layer by layer.

    Parameters
    ----------
    levels : profiles.Levels
    gas : str
        One of `GASES`.

    Returns
    -------
    amount : array, shape (level - 1,)
        Water vapour [g cm-2], the others [cm-atm].

    Examples
    --------
    >>> levels = profiles.profile_above("midlatitude-summer", 0.0)
    >>> round(float(absorber_layers(levels, "h2o").sum()), 1)
    2.9
    """
    air = -np.diff(levels.pressure) * 100 / profiles.GRAVITY  # [kg m-2]
    if gas == "h2o":
        return _layer_mean(levels.h2o) * air / 10
    if gas == "o3":
        moles = _layer_mean(levels.o3) * air / profiles.MOLAR_MASS_OZONE
    else:
        moles = MIXING_RATIO[gas] * air / profiles.MOLAR_MASS_AIR
    return 100 * moles * profiles.MOLAR_VOLUME


def effective_amounts(levels, gas, strength_temperature, width_temperature):
    r"""
    Vertical amounts of a gas as its lines see them, weighted by temperature and pressure.

    .. math::

        U = \int e^{c_1 \Delta T + c_2 \Delta T^2} \, \mathrm{d}u, \qquad
        V = \int e^{d_1 \Delta T + d_2 \Delta T^2} \frac{p}{p_0} \, \mathrm{d}u, \qquad \Delta T = T - T_0

    Parameters
    ----------
    levels : profiles.Levels
    gas : str
        One of `GASES`.
    strength_temperature, width_temperature : array, shape (2, n)
        :math:`c_1, c_2` and :math:`d_1, d_2`. [K-1, K-2]

    Returns
    -------
    amount, broadening_amount : array, shape (n,)
        :math:`U` and :math:`V`, in the unit of `absorber_layers`.

    Notes
    -----
    Each layer has the mean temperature and the mean pressure of its two levels. The second power of temperature
    is what one set of parameters needs from tropical to subarctic winter air.

    References
    ----------
    [Rodgers1966]_

    Examples
    --------
    Without temperature the first is the column:

    >>> levels = profiles.profile_above("midlatitude-summer", 0.0)
    >>> round(float(effective_amounts(levels, "o3", np.zeros((2, 1)), np.zeros((2, 1)))[0][0]), 2)
    0.32
    """
    layers = absorber_layers(levels, gas)
    excess = _layer_mean(levels.temperature) - REFERENCE_TEMPERATURE
    powers = np.stack([excess, excess**2])
    amount = np.exp(np.transpose(strength_temperature) @ powers) @ layers
    pressure = _layer_mean(levels.pressure) / STANDARD_PRESSURE
    broadening = np.exp(np.transpose(width_temperature) @ powers) @ (layers * pressure)
    return amount, broadening


def _layer_mean(values):
    return (values[1:] + values[:-1]) / 2


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
def _parameters(gas):
    """Places of the absorbing wavelengths in the table; strength, saturation, two pairs of temperature coefficients."""
    table = datasets.table("gas_absorption.csv").query("gas == @gas")
    index = np.searchsorted(table_wavelengths(), table["wavelength"].to_numpy() - 1e-6)
    of_strength, of_width = (
        table[[name, f"{name}_2"]].to_numpy().T for name in ("strength_temperature", "width_temperature")
    )
    return index, table["strength"].to_numpy(), table["saturation"].to_numpy(), of_strength, of_width


@lru_cache(maxsize=256)
def _vertical(atmosphere, gas):
    """Where a gas absorbs in the table, and its weak-line optical depth and saturation there at air mass 1."""
    index, strength, saturation, of_strength, of_width = _parameters(gas)
    amount, broadening = effective_amounts(atmosphere.levels, gas, of_strength, of_width)
    ratio = np.divide(amount, broadening, out=np.zeros_like(amount), where=broadening > 0)  # no gas: not saturated
    return index, strength * amount, saturation * amount * ratio


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
    The parameters reproduce each gas of 6SV1.1 at each wavelength within 2.5e-3 in the six model atmospheres, with the
    ground at 0 to 4 km and air masses of 1 to 7.7; 95 of 100 wavelengths within 1.1e-3.
    They stand for the mean over 10 cm-1 at each wavelength.

    References
    ----------
    [Tanre1990]_; band models of [Goody1952]_ and [Malkmus1967]_

    Examples
    --------
    >>> from fifesim.atmosphere.air.models import Atmosphere
    >>> atmosphere = Atmosphere()
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
    index = np.clip(np.searchsorted(nodes, wavelength) - 1, 0, nodes.size - 2)
    share = (wavelength - nodes[index]) / (nodes[index + 1] - nodes[index])
    first, last = index.min(), index.max() + 2
    mass = np.asarray(air_mass, float)[..., None]
    depth = np.zeros((*mass.shape[:-1], last - first))
    for gas in gases:
        absorbing, weak, saturation = _vertical(atmosphere, gas)
        used = slice(*np.searchsorted(absorbing, (first, last)))
        depth[..., absorbing[used] - first] += BAND_MODEL[gas](weak[used] * mass, saturation[used] * mass)
    transmittance = np.exp(-depth)
    return transmittance[..., index - first] * (1 - share) + transmittance[..., index - first + 1] * share
