"""Molecules of the air: profiles, scattering, and absorption by gases."""

from typing import Literal, NamedTuple, get_args

import numpy as np

from fifesim.base import files
from fifesim.base.arguments import Range, check_number
from fifesim.base.caches import cached

Profile = Literal[
    "tropical", "midlatitude-summer", "midlatitude-winter", "subarctic-summer", "subarctic-winter", "us-1962"
]
PROFILES = get_args(Profile)

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


@cached(128, "levels of a profile above the ground")
def profile_above(profile, altitude):
    """
    Levels of a profile above the ground.

    Parameters
    ----------
    profile : str
        One of `PROFILES`.
    altitude : float
        Altitude of the ground. [km]

    Returns
    -------
    levels : Levels
        The lowest lies on the ground: temperature and densities linear in altitude there, pressure exponential.

    References
    ----------
    [McClatchey1972]_, Table 1
    """
    table = files.table("atmosphere_profiles.csv").query("profile == @profile")
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
    """
    half = -np.diff(levels.pressure) * 100 / 2
    thickness = np.concatenate([half, [0]]) + np.concatenate([[0], half])
    return mixing_ratio * thickness / GRAVITY


LOSCHMIDT = 2.54743e25  # molecules per cubic metre at 288.15 K and 1013.25 hPa [m-3]
DEPOLARIZATION = 0.0279  # of air, Young (1980) [1]


def refractive_index(wavelength):
    r"""
    Refractive index of dry air at 288.15 K and 1013.25 hPa.

    .. math:: (n - 1) 10^8 = 8342.13 + \frac{2406030}{130 - \lambda^{-2}} + \frac{15997}{38.9 - \lambda^{-2}}

    Parameters
    ----------
    wavelength : array
        [um]

    Returns
    -------
    index : array
        [1]

    References
    ----------
    [Edlen1966]_, Eq. 1
    """
    wavenumber_squared = np.asarray(wavelength, float) ** -2
    return 1 + 1e-8 * (8342.13 + 2406030 / (130 - wavenumber_squared) + 15997 / (38.9 - wavenumber_squared))


def rayleigh_cross_section(wavelength, depolarization=DEPOLARIZATION):
    r"""
    Scattering cross section of one molecule of air.

    .. math::

        \sigma = \frac{24 \pi^3}{\lambda^4 N_s^2} \left(\frac{n^2 - 1}{n^2 + 2}\right)^2 \frac{6 + 3\delta}{6 - 7\delta}

    Parameters
    ----------
    wavelength : array
        [um]
    depolarization : float, optional
        Depolarization of light scattered through 90 degrees, :math:`\delta`. [1]

    Returns
    -------
    cross_section : array
        [m2]

    Notes
    -----
    Number density and refractive index are for 288.15 K and 1013.25 hPa; the cross section depends on neither.

    References
    ----------
    [Young1980]_
    """
    index_squared = refractive_index(wavelength) ** 2
    polarizability = (index_squared - 1) / (index_squared + 2)
    king_factor = (6 + 3 * depolarization) / (6 - 7 * depolarization)
    metres = np.asarray(wavelength, float) * 1e-6
    return 24 * np.pi**3 * polarizability**2 * king_factor / (metres**4 * LOSCHMIDT**2)


def rayleigh_anisotropy(depolarization=DEPOLARIZATION):
    r"""
    Share of the light that molecules scatter as dipoles; the rest is scattered isotropically.

    .. math:: c = \frac{2 (1 - \delta)}{2 + \delta}

    Parameters
    ----------
    depolarization : float, optional
        Depolarization of light scattered through 90 degrees, :math:`\delta`. [1]

    Returns
    -------
    anisotropy : float
        [1]

    References
    ----------
    [Young1980]_

    Examples
    --------
    >>> rayleigh_anisotropy(0.0)
    1.0
    """
    return 2 * (1 - depolarization) / (2 + depolarization)


def rayleigh_phase(scattering_cosine, depolarization=DEPOLARIZATION):
    r"""
    Phase function of molecular scattering.

    .. math:: P = \frac{3}{4} (1 + \cos^2 \Theta) \frac{2 (1 - \delta)}{2 + \delta} + \frac{3 \delta}{2 + \delta}

    Parameters
    ----------
    scattering_cosine : array
        Cosine of the scattering angle. [1]
    depolarization : float, optional
        As in `rayleigh_anisotropy`. [1]

    Returns
    -------
    phase : array
        Its mean over the sphere is 1. [1]

    References
    ----------
    [Tanre1990]_; depolarization of [Young1980]_
    """
    anisotropy = rayleigh_anisotropy(depolarization)
    return 0.75 * anisotropy * (1 + np.asarray(scattering_cosine, float) ** 2) + 1 - anisotropy


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
    """
    return 2 * weak / (1 + np.sqrt(1 + 4 * saturation))


BAND_MODEL = {gas: goody if gas == "h2o" else malkmus for gas in GASES}


def absorber_layers(levels, gas):
    """Amount of a gas in each layer, shape (level - 1,), [g cm-2] for water vapour and [cm-atm] for the others."""
    air = -np.diff(levels.pressure) * 100 / GRAVITY  # [kg m-2]
    if gas == "h2o":
        return _layer_mean(levels.h2o) * air / 10
    if gas == "o3":
        moles = _layer_mean(levels.o3) * air / MOLAR_MASS_OZONE
    else:
        moles = MIXING_RATIO[gas] * air / MOLAR_MASS_AIR
    return 100 * moles * MOLAR_VOLUME


def effective_amounts(levels, gas, strength_temperature, width_temperature):
    r"""Effective vertical amounts of a gas, weighted by temperature and pressure.

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
    Without temperature dependence, the first amount is the column:

    >>> levels = profile_above("midlatitude-summer", 0.0)
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


@cached(128, "wavelengths of the gas table")
def table_wavelengths():
    """Wavelengths of the gas table, 0.4 to 2.5 in steps of 0.0025, shape (841,). [um]"""
    return np.round(np.linspace(0.4, 2.5, 841), 4)


@cached(128, "absorption parameters of a gas")
def _parameters(gas):
    """Indices of the absorbing wavelengths, strength, saturation, and two pairs of temperature coefficients."""
    table = files.table("gas_absorption.csv").query("gas == @gas")
    index = np.searchsorted(table_wavelengths(), table["wavelength"].to_numpy() - 1e-6)
    names = ("strength_temperature", "width_temperature")
    of_strength, of_width = (table[[name, f"{name}_2"]].to_numpy().T for name in names)
    return index, table["strength"].to_numpy(), table["saturation"].to_numpy(), of_strength, of_width


@cached(256, "vertical optical depth of a gas")
def _vertical(atmosphere, gas):
    """Indices where a gas absorbs, and its weak-line optical depth and saturation there at air mass 1."""
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
    """
    wavelength = np.atleast_1d(np.asarray(wavelength, float))
    nodes = table_wavelengths()
    note = "give it in micrometres, inside the gas table"
    check_number("wavelength", wavelength, Range("um", nodes[0], nodes[-1], note=note))
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
