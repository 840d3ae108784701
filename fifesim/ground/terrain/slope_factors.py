"""The topographic correction factor of cells in several bands, from the light on their slopes."""

import numpy as np
from numba import njit

from fifesim.ground.terrain.light import topographic_factor
from fifesim.ground.terrain.sky import terrain_view


def slope_factor(light, reflectance, mu_s, direct_transmittance, transmittance_down):
    """
    Topographic correction factor Kt of cells in one pass.

    Parameters
    ----------
    light : fifesim.ground.terrain.light.SlopeLight
        Fields of shape (rows, columns).
    reflectance : array, shape (band, rows, columns)
        Of the land around, as it is on level ground. [1]
    mu_s : float
        Cosine of the sun's zenith angle on level ground. [1]
    direct_transmittance, transmittance_down : array, shape (band,)
        As in `fifesim.ground.terrain.light.topographic_factor`. [1]

    Returns
    -------
    kt : array, shape (band, rows, columns)
        To the bit that of the formula; NaN where elevation or reflectance is. [1]

    See Also
    --------
    fifesim.ground.terrain.light.topographic_factor, fifesim.ground.terrain.sky.terrain_view

    Examples
    --------
    >>> from fifesim.ground.terrain.light import SlopeLight
    >>> level = SlopeLight(*np.array([1.0, 1.0, 0.8, 1.0])[:, None, None])
    >>> slope_factor(level, np.full((2, 1, 1), 0.3), 0.8, [0.6, 0.7], [0.9, 0.9]).tolist()
    [[[1.0]], [[1.0]]]
    """
    reflectance = np.ascontiguousarray(reflectance, float)
    direct, total = np.asarray(direct_transmittance, float), np.asarray(transmittance_down, float)
    out = np.empty(reflectance.shape)
    _factors(light, reflectance, float(mu_s), direct, total, out)
    return out


@njit(nogil=True, cache=True, error_model="numpy")
def _factors(light, reflectance, mu_s, direct, total, out):
    for i in range(out.shape[1]):
        sky, cosine, sun = light.sky_view[i], light.cosine[i], light.mu_s_local[i]
        for band in range(out.shape[0]):
            rho, factor = reflectance[band, i], out[band, i]
            for j in range(factor.size):
                land = terrain_view(sky[j], cosine[j])
                factor[j] = topographic_factor(sky[j], land, rho[j], sun[j], mu_s, direct[band], total[band])
