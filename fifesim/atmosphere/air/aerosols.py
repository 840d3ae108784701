"""Amount and optics of the aerosol."""

from functools import lru_cache

import numpy as np

from fifesim.atmosphere.air import components
from fifesim.atmosphere.air.mixtures import mixture
from fifesim.atmosphere.air.own_aerosol import REFERENCE_WAVELENGTH, SCALE_HEIGHT, WAVELENGTH_RANGE, Aerosol
from fifesim.base import datasets

# Extinction per particle at 0.55 um with which the number profiles give the visibility at the ground. [km-1 cm3]
_EXTINCTION_PER_PARTICLE = 5.6032e-5


def aerosol_optical_thickness(visibility):
    r"""
    Aerosol optical thickness at 0.55 um of the whole atmosphere.

    .. math::

        \tau = \sigma \sum_i \sqrt{N_i N_{i+1}} \, \Delta z_i, \qquad N(z, V) = \frac{a(z)}{V} + b(z)

    Parameters
    ----------
    visibility : float
        Meteorological range at the ground, :math:`V`. [km]

    Returns
    -------
    aot : float
        [1]

    Notes
    -----
    :math:`a` and :math:`b` make the number profile pass through the two tabulated ones, for 5 and 23 km.
    The column stands on the ground, whatever its altitude.

    References
    ----------
    [McClatchey1972]_, number profiles; [Tanre1990]_

    Examples
    --------
    >>> aerosol_optical_thickness(10.0) > aerosol_optical_thickness(50.0)
    True
    """
    hazy, clear, thickness = _particles()
    slope = (hazy - clear) / (1 / 5 - 1 / 23)
    number = clear + slope * (1 / visibility - 1 / 23)
    layers = np.sqrt(number[1:] * number[:-1]) * thickness
    return float(_EXTINCTION_PER_PARTICLE * layers.sum())


@lru_cache(maxsize=1)
def _particles():
    """Their number at levels of both visibilities, and the layers between these."""
    levels = datasets.table("aerosol_profile.csv")
    hazy, clear = levels["visibility_5km"].to_numpy(), levels["visibility_23km"].to_numpy()
    return hazy, clear, np.diff(levels["altitude"])


def parts(aerosol):
    """
    Components of an aerosol, and how much there is of each.

    Parameters
    ----------
    aerosol : str, mapping or Aerosol
        As in `mixture`, or tables of one's own.

    Returns
    -------
    fractions : dict
        By the name or the tables of a component: the share of its volume, or 1. [1]

    Raises
    ------
    ValueError, TypeError
        As `mixture`.

    Examples
    --------
    >>> parts("soot:1")
    {'soot': 1.0}
    """
    return dict.fromkeys(aerosol.components, 1.0) if isinstance(aerosol, Aerosol) else mixture(aerosol)


def covers(aerosol, low, high):
    """
    Whether the tables of an aerosol hold some wavelengths.

    Parameters
    ----------
    aerosol : str, mapping or Aerosol
    low, high : float
        [um]

    Returns
    -------
    answer : bool

    Examples
    --------
    >>> covers("continental", 0.4, 2.5), covers("continental", 0.4, 10.0)
    (True, False)
    """
    first, last = limits(aerosol)
    return bool(first <= low and high <= last)


def limits(aerosol):
    """
    First and last wavelength of the tables of an aerosol.

    Parameters
    ----------
    aerosol : str, mapping or Aerosol

    Returns
    -------
    low, high : float
        [um]
    """
    own = isinstance(aerosol, Aerosol)
    return (float(aerosol.wavelength[0]), float(aerosol.wavelength[-1])) if own else WAVELENGTH_RANGE


def vertical(aerosol):
    """
    Where an aerosol floats above the ground.

    Parameters
    ----------
    aerosol : str, mapping or Aerosol

    Returns
    -------
    vertical : float or pair of float
        Scale height, or bottom and top of an even layer. [km]
    """
    return aerosol.vertical if isinstance(aerosol, Aerosol) else SCALE_HEIGHT


def aerosol_optics(aerosol, wavelength):
    r"""
    Optical properties of an aerosol.

    .. math::

        \sigma = \sum_j c_j \sigma_j, \qquad \omega = \frac{\sum_j c_j \omega_j \sigma_j}{\sigma}, \qquad
        g = \frac{\sum_j c_j \omega_j \sigma_j g_j}{\sum_j c_j \omega_j \sigma_j}

    Parameters
    ----------
    aerosol : str, mapping or Aerosol
        As in `mixture`; its volume fractions are :math:`c_j`, which are 1 for tables of one's own.
    wavelength : array, shape (n,)
        0.35 to 3.75. [um]

    Returns
    -------
    extinction : array, shape (n,)
        :math:`\sigma` relative to 0.55 um. [1]
    single_scattering_albedo : array, shape (n,)
        :math:`\omega` [1]
    asymmetry : array, shape (n,)
        Mean cosine of the scattering angle, :math:`g`. [1]

    Raises
    ------
    ValueError
        If a wavelength lies outside the tables, or the aerosol is not allowed.

    Notes
    -----
    Cross sections of a component, for a unit of its particles' volume, follow a power law between the tabulated
    wavelengths; its asymmetry is linear in their logarithm.

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory; [Tanre1990]_, mixtures

    Examples
    --------
    >>> [float(values) for values in aerosol_optics("continental", 0.55)][0]
    1.0
    """
    wavelength, fractions = _checked_wavelength(wavelength), parts(aerosol)
    extinction, scattering, directed = _cross_sections(fractions, wavelength)
    reference, _, _ = _cross_sections(fractions, REFERENCE_WAVELENGTH)
    return extinction / reference, scattering / extinction, directed / scattering


def aerosol_phase(aerosol, scattering_cosine, wavelength):
    r"""
    Phase function of an aerosol.

    .. math:: P = \frac{\sum_j c_j \omega_j \sigma_j P_j}{\sum_j c_j \omega_j \sigma_j}

    Parameters
    ----------
    aerosol : str, mapping or Aerosol
        As in `mixture`; its volume fractions are :math:`c_j`, which are 1 for tables of one's own.
    scattering_cosine : array, broadcastable with wavelength
        Cosine of the scattering angle. [1]
    wavelength : array
        0.35 to 3.75. [um]

    Returns
    -------
    phase : array, shape of the broadcast inputs
        Its mean over the sphere is 1. [1]

    Raises
    ------
    ValueError
        If a wavelength lies outside the tables, or the aerosol is not allowed.

    Notes
    -----
    That of a component is linear in the logarithm of the wavelength, which keeps its mean, and its logarithm
    is linear in the angle.

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory; [Tanre1990]_, mixtures

    Examples
    --------
    >>> bool(aerosol_phase("continental", 1.0, 0.55) > aerosol_phase("continental", 0.0, 0.55))
    True
    """
    wavelength, fractions = _checked_wavelength(wavelength), parts(aerosol)
    return _weighted_mean(fractions, wavelength, lambda name: components.phase(name, scattering_cosine, wavelength))


def aerosol_polarization(aerosol, scattering_cosine, wavelength):
    r"""
    Degree of linear polarization of natural light that an aerosol scatters once.

    .. math:: q = -\frac{P_{12}}{P_{11}}

    Parameters
    ----------
    aerosol, scattering_cosine, wavelength
        As in `aerosol_phase`.

    Returns
    -------
    polarization : array, shape of the broadcast inputs
        Positive where the light vibrates across the plane of scattering, as in molecular scattering. [1]

    Raises
    ------
    ValueError
        If a wavelength lies outside the tables, or the aerosol is not allowed.

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    Straight on and straight back no direction is preferred:

    >>> [float(value) for value in aerosol_polarization("urban", [-1.0, 1.0], 0.55)]
    [0.0, 0.0]
    """
    wavelength, fractions = _checked_wavelength(wavelength), parts(aerosol)

    def mean(element):
        return _weighted_mean(fractions, wavelength, lambda name: element(name, scattering_cosine, wavelength))

    return mean(components.polarized_phase) / mean(components.phase)


def phase_moments(aerosol, wavelength, count):
    r"""
    Legendre moments of the phase function.

    .. math:: \chi_l = \frac{1}{2} \int_{-1}^{1} P(\mu) P_l(\mu) \, \mathrm{d}\mu, \qquad
        P(\mu) = \sum_l (2 l + 1) \chi_l P_l(\mu)

    Parameters
    ----------
    aerosol : str, mapping or Aerosol
        As in `mixture`, or tables of one's own.
    wavelength : array, shape (n,)
        0.35 to 3.75. [um]
    count : int
        Number of moments, from :math:`\chi_0 = 1` on; the tables carry a hundred within 1e-3. [1]

    Returns
    -------
    moments : array, shape (n, count)
        Those of `aerosol_phase`. [1]

    Raises
    ------
    ValueError
        If a wavelength lies outside the tables, or the aerosol is not allowed.

    References
    ----------
    [dAlmeida1991]_ micro-physics, by Mie theory

    Examples
    --------
    The second is the asymmetry:

    >>> _, second = phase_moments("continental", 0.55, 2)[0]
    >>> bool(abs(second - aerosol_optics("continental", 0.55)[2]) < 1e-3)
    True
    """
    at, fractions = np.atleast_1d(_checked_wavelength(wavelength)), parts(aerosol)
    return _weighted_mean(fractions, at[:, None], lambda name: components.phase_moments(name, at, count))


def _checked_wavelength(wavelength):
    wavelength = np.asarray(wavelength, float)
    low, high = WAVELENGTH_RANGE
    outside = wavelength[(wavelength < low) | (wavelength > high)]
    if outside.size:
        raise ValueError(
            f"wavelength must be from {low:g} to {high:g} um, got {outside.flat[0]:g}: give it in micrometres, "
            "inside the aerosol tables"
        )
    return wavelength


def _cross_sections(fractions, wavelength):
    """Extinction, scattering, and scattering times asymmetry of a mixture [um-1]."""
    return sum(
        fraction * np.stack(components.cross_sections(component, wavelength))
        for component, fraction in fractions.items()
    )


def _weighted_mean(fractions, wavelength, values):
    """Mean over the components, by their scattering."""
    total = amount = 0.0
    for component, fraction in fractions.items():
        _, scattering, _ = components.cross_sections(component, wavelength)
        total, amount = total + fraction * scattering * values(component), amount + fraction * scattering
    return total / amount
