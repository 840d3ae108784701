"""Optics of the molecules of the air."""

import numpy as np

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

    Examples
    --------
    >>> bool(refractive_index(0.4) > refractive_index(0.8) > 1)
    True
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
        Of light scattered through 90 degrees, :math:`\delta`. [1]

    Returns
    -------
    cross_section : array
        [m2]

    Notes
    -----
    Number density and refractive index are those of 288.15 K and 1013.25 hPa; the cross section depends on neither.

    References
    ----------
    [Young1980]_

    Examples
    --------
    It falls off a little faster than the fourth power of the wavelength, as the index falls too:

    >>> bool(rayleigh_cross_section(0.4) > 16 * rayleigh_cross_section(0.8))
    True
    """
    index_squared = refractive_index(wavelength) ** 2
    polarizability = (index_squared - 1) / (index_squared + 2)
    king_factor = (6 + 3 * depolarization) / (6 - 7 * depolarization)
    metres = np.asarray(wavelength, float) * 1e-6
    return 24 * np.pi**3 * polarizability**2 * king_factor / (metres**4 * LOSCHMIDT**2)


def rayleigh_anisotropy(depolarization=DEPOLARIZATION):
    r"""
    Share of the light that molecules scatter as dipoles do; the rest goes evenly everywhere.

    .. math:: c = \frac{2 (1 - \delta)}{2 + \delta}

    Parameters
    ----------
    depolarization : float, optional
        Of light scattered through 90 degrees, :math:`\delta`. [1]

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
    Phase function of the molecules.

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

    Examples
    --------
    >>> bool(rayleigh_phase(-1.0) == rayleigh_phase(1.0))
    True
    """
    anisotropy = rayleigh_anisotropy(depolarization)
    return 0.75 * anisotropy * (1 + np.asarray(scattering_cosine, float) ** 2) + 1 - anisotropy
