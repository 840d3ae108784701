"""The light that falls on a slope, and what of the light that it sends up is seen (Eqs. 4 and 5)."""

import numpy as np
from numba import njit
from numba.extending import register_jitable


def direction_vector(zenith, azimuth):
    """
    Unit vector toward the sun or the sensor.

    Parameters
    ----------
    zenith, azimuth : float
        Clockwise from north. [degree]

    Returns
    -------
    vector : array, shape (3,)
        Eastward, northward and up. [1]
    """
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return np.array([np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)])


def local_cosine(slope, aspect, zenith, azimuth):
    r"""
    Cosine of the angle between the normal of a slope and a direction.

    .. math:: \mu = \cos S \cos \theta + \sin S \sin \theta \cos(\phi - A)

    Parameters
    ----------
    slope, aspect : array
        Aspect down the slope, clockwise from north. [degree]
    zenith, azimuth : array
        Of the direction toward the sun or the sensor, clockwise from north. [degree]

    Returns
    -------
    cosine : array
        Negative where the slope faces away. [1]

    Examples
    --------
    The sun stands square on a slope that faces it:

    >>> round(float(local_cosine(30.0, 120.0, 30.0, 120.0)), 12)
    1.0
    """
    slope, zenith = np.radians(slope), np.radians(zenith)
    across = np.cos(np.radians(np.subtract(azimuth, aspect)))
    return np.cos(slope) * np.cos(zenith) + np.sin(slope) * np.sin(zenith) * across


def horizon_toward(tangents, directions, azimuth):
    r"""
    Tangent of the elevation of the horizon in one azimuth.

    Between two directions the horizon is a great circle, as that of a straight ridge is.

    Parameters
    ----------
    tangents : array, shape (direction, ...)
        cot H. [1]
    directions : array, shape (direction,)
        Azimuths, evenly spaced and clockwise from the first. [degree]
    azimuth : float
        [degree]

    Returns
    -------
    tangent : array, shape (...)
        [1]

    Examples
    --------
    >>> float(horizon_toward(np.arange(16.0), np.arange(16) * 22.5, 45.0))
    2.0
    """
    count = len(directions)
    step = 360 / count
    position = ((azimuth - directions[0]) % 360) / step
    first = int(position) % count
    part, step = np.radians((position - int(position)) * step), np.radians(step)
    weights = np.sin(step - part) / np.sin(step), np.sin(part) / np.sin(step)
    return weights[0] * tangents[first] + weights[1] * tangents[(first + 1) % count]


@register_jitable
def kt(sky_view, terrain_view, reflectance, mu_s_local, mu_s, direct_transmittance, transmittance_down):
    r"""
    Topographic correction factor: irradiance on a slope over that on level ground.

    .. math::

        K_t = V_d + C_t \, \rho
            + \frac{e^{-\tau / \mu_0}}{T(\theta_s)} \left[ \frac{\mu_s}{\mu_0} - V_d \right]

    Parameters
    ----------
    sky_view, terrain_view : array
        :math:`V_d` and :math:`C_t`. [1]
    reflectance : array
        Of the land around, :math:`\rho`, as it is on level ground. [1]
    mu_s_local : array
        Cosine of the sun's zenith angle on the slope, :math:`\mu_s`; 0 in shadow. [1]
    mu_s : float
        The same on level ground, :math:`\mu_0`. [1]
    direct_transmittance : array
        Of the sunbeam, :math:`e^{-\tau / \mu_0}`. [1]
    transmittance_down : array
        Total, direct and diffuse, :math:`T(\theta_s)`. [1]

    Returns
    -------
    kt : array
        1 on level and open ground. [1]

    Notes
    -----
    The sky is uniform, the land around a slope is as bright as the slope's own cell, and its light comes once.

    References
    ----------
    [Friedl1995]_, Eq. 4; [Dubayah1992]_

    Examples
    --------
    >>> float(kt(1.0, 0.0, 0.3, 0.8, 0.8, 0.6, 0.9))
    1.0
    """
    return (
        sky_view
        + terrain_view * reflectance
        + direct_transmittance / transmittance_down * (mu_s_local / mu_s - sky_view)
    )


def upwelling_factor(mu_v_local, vza):
    r"""
    Cosine correction of the light that leaves a slope toward the sensor.

    .. math:: \max(\mu_v, 0) / \cos \theta_v

    Parameters
    ----------
    mu_v_local : array
        Cosine of the sensor's zenith angle on the slope, :math:`\mu_v`. [1]
    vza : float
        The same angle on level ground. [degree]

    Returns
    -------
    factor : array
        1 on level ground, 0 where the slope faces away. [1]

    References
    ----------
    [Friedl1995]_, Eq. 5

    Examples
    --------
    >>> upwelling_factor([0.5, 1.0, -0.1], 60.0).round(12).tolist()
    [1.0, 2.0, 0.0]
    """
    return np.fmax(mu_v_local, 0.0) / np.cos(np.radians(vza)) + np.multiply(mu_v_local, 0)


def slope_light(dem, sky, rows, columns, cell_y, cell_x, geometry):
    """
    What a cell's slope makes of the sky, the sun and the view.

    Parameters
    ----------
    dem : array, shape (rows + 2, columns + 2)
        Elevation, north up, with a margin of one cell, which may be NaN. [m]
    sky : array, shape (4, coarse rows, coarse columns)
        Sky vector of `terrain.sky_vector`, and tangent of the horizon toward the sun, at places around. [1]
    rows, columns : (array of int, array), shape (rows,) and (columns,)
        Where each cell lies between these places: the one before, and the share of the one after.
    cell_y, cell_x : float
        [m]
    geometry : fifesim.base.geometry.Geometry
        Of sun and sensor.

    Returns
    -------
    light : array, shape (4, rows, columns)
        Cosine of the slope, sky view factor, cosine of the local solar zenith (0 in shadow), and Eq. 5's factor. [1]
    """
    out = np.empty((4, dem.shape[0] - 2, dem.shape[1] - 2))
    _slope_light(*_arguments(dem, sky, rows, columns, cell_y, cell_x, geometry), out)
    return out


def slope_reflectance(
    reflectance,
    dem,
    sky,
    rows,
    columns,
    cell_y,
    cell_x,
    geometry,
    direct_transmittance,
    transmittance_down,
    upwelling=True,
):
    r"""
    Reflectance factor of cells on slopes, as seen against the irradiance of level ground.

    .. math:: \rho \, K_t \, \max(\mu_v, 0) / \cos \theta_v

    Parameters
    ----------
    reflectance : array, shape (band, rows, columns)
        Of level ground. [1]
    dem, sky, rows, columns, cell_y, cell_x, geometry
        As in `slope_light`.
    direct_transmittance, transmittance_down : array, shape (band,)
        As in `kt`. [1]
    upwelling : bool, optional
        Whether with the factor of Eq. 5.

    Returns
    -------
    reflectance : array, shape (band, rows, columns)
        [1]

    References
    ----------
    [Friedl1995]_, Eqs. 4 and 5
    """
    reflectance = np.ascontiguousarray(reflectance, float)
    out = np.empty(reflectance.shape)
    direct, total = (np.asarray(values, float) for values in (direct_transmittance, transmittance_down))
    light = _arguments(dem, sky, rows, columns, cell_y, cell_x, geometry)
    _slope_reflectance(reflectance, *light, direct, total, geometry.mu_s, upwelling, out)
    return out


def _arguments(dem, sky, rows, columns, cell_y, cell_x, geometry):
    sun = direction_vector(geometry.sza, geometry.saa)
    view = direction_vector(geometry.vza, geometry.vaa)
    # The tangent of the sun's elevation; overhead, no horizon reaches it.
    sun_tangent = sun[2] / np.hypot(sun[0], sun[1]) if geometry.sza > 0 else np.inf
    dem, sky = (np.ascontiguousarray(array, float) for array in (dem, sky))
    return dem, sky, *rows, *columns, 0.5 / cell_y, 0.5 / cell_x, sun, sun_tangent, view


@njit(nogil=True, cache=True)
def _slope_light(dem, sky, row, row_share, column, column_share, per_y, per_x, sun, sun_tangent, view, out):
    around = np.empty((4, sky.shape[2]))
    for i in range(out.shape[1]):
        _between(sky, row[i], row_share[i], around)
        _light_of_row(dem[i : i + 3], around, column, column_share, per_y, per_x, sun, sun_tangent, view, out[:, i])


@njit(nogil=True, cache=True)
def _slope_reflectance(
    rho, dem, sky, row, row_share, column, column_share, per_y, per_x, sun, sun_tangent, view, direct, total, mu_s,
    upwelling, out,
):  # fmt: skip
    around, light = np.empty((4, sky.shape[2])), np.empty((4, out.shape[2]))
    for i in range(out.shape[1]):
        _between(sky, row[i], row_share[i], around)
        _light_of_row(dem[i : i + 3], around, column, column_share, per_y, per_x, sun, sun_tangent, view, light)
        for band in range(out.shape[0]):
            for j in range(out.shape[2]):
                sky_view = light[1, j]
                factor = kt(
                    sky_view, (1 + light[0, j]) / 2 - sky_view, rho[band, i, j], light[2, j], mu_s, direct[band],
                    total[band],
                )  # fmt: skip
                out[band, i, j] = rho[band, i, j] * factor * (light[3, j] if upwelling else 1.0)


@njit(nogil=True, cache=True)
def _between(sky, row, share, out):
    """One line of the sky between two rows of places."""
    after = min(row + 1, sky.shape[1] - 1)
    for layer in range(sky.shape[0]):
        for j in range(sky.shape[2]):
            out[layer, j] = (1 - share) * sky[layer, row, j] + share * sky[layer, after, j]


@njit(nogil=True, cache=True)
def _rise(low, here, high):
    """As `terrain.gradient` differences, over two cells."""
    if np.isnan(low):
        low = 2 * here - high
    elif np.isnan(high):
        high = 2 * here - low
    return 0.0 if np.isnan(high - low) else high - low


@njit(nogil=True, cache=True)
def _light_of_row(dem, around, column, share, per_y, per_x, sun, sun_tangent, view, out):
    last = around.shape[1] - 1
    sky = np.empty(4)
    for j in range(out.shape[1]):
        here = dem[1, j + 1]
        if np.isnan(here):
            out[:, j] = np.nan
            continue
        east = _rise(dem[1, j], here, dem[1, j + 2]) * per_x
        north = _rise(dem[2, j + 1], here, dem[0, j + 1]) * per_y
        before = column[j]
        after = min(before + 1, last)
        for layer in range(4):
            sky[layer] = (1 - share[j]) * around[layer, before] + share[j] * around[layer, after]
        cosine = 1 / np.sqrt(1 + east * east + north * north)
        # A plane sees no more of the sky than a wide one of its slope.
        sky_view = min((sky[2] - east * sky[0] - north * sky[1]) * cosine, (1 + cosine) / 2)
        mu_s = (sun[2] - east * sun[0] - north * sun[1]) * cosine
        mu_v = (view[2] - east * view[0] - north * view[1]) * cosine
        out[0, j] = cosine
        out[1, j] = max(sky_view, 0.0)
        out[2, j] = mu_s if mu_s > 0 and sky[3] <= sun_tangent else 0.0
        out[3, j] = max(mu_v, 0.0) / view[2]
