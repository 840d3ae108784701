"""Spectral vegetation indices."""

import numpy as np


def normalized_difference(nir, red):
    r"""
    Normalized difference vegetation index.

    .. math:: \mathrm{NDVI} = \frac{\rho_\mathrm{nir} - \rho_\mathrm{red}}{\rho_\mathrm{nir} + \rho_\mathrm{red}}

    Parameters
    ----------
    nir, red : array
        Reflectances in the near infrared and in the red. [1]

    Returns
    -------
    ndvi : array, shape of the broadcast inputs
        NaN where the reflectances add up to zero. [1]

    References
    ----------
    [Rouse1974]_; [Friedl1995]_, Eq. 2

    Examples
    --------
    >>> float(normalized_difference(0.75, 0.25))
    0.5
    """
    nir, red = np.asarray(nir, float), np.asarray(red, float)
    total = nir + red
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (nir - red) / total
    return np.where(total == 0, np.nan, ratio)
