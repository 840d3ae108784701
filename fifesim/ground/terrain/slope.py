"""The shape of the ground: slope, aspect, and how much of the sky and of the land around a slope sees."""

import numpy as np
from numba import njit

from fifesim.ground.terrain.horizon import tangent


def gradient(dem, cell_y, cell_x, rows=None, columns=None):
    r"""
    Rise of the ground eastward and northward.

    .. math::

        \frac{\partial z}{\partial x} = \frac{z_{j+1} - z_{j-1}}{2 \Delta x}, \qquad
        \frac{\partial z}{\partial y} = \frac{z_{i-1} - z_{i+1}}{2 \Delta y}

    Parameters
    ----------
    dem : array, shape (rows + 2, columns + 2)
        Elevation, north up, with a margin of one cell. [m]
    cell_y, cell_x : float
        [m]
    rows, columns : array of int, optional
        Where it is wanted, counted with the margin; at all cells inside of it by default.

    Returns
    -------
    east, north : array, shape (rows, columns)
        [m m-1]

    Notes
    -----
    Where a neighbour is NaN the difference is one-sided, as if the ground went on straight; a NaN cell gives NaN.
    """
    dem = np.asarray(dem, float)
    i = np.arange(1, dem.shape[0] - 1) if rows is None else rows
    j = np.arange(1, dem.shape[1] - 1) if columns is None else columns
    here = dem[np.ix_(i, j)]
    return (
        _difference(dem[np.ix_(i, j - 1)], here, dem[np.ix_(i, j + 1)]) / (2 * cell_x),
        _difference(dem[np.ix_(i + 1, j)], here, dem[np.ix_(i - 1, j)]) / (2 * cell_y),
    )


def slope_aspect(dem, cell_y, cell_x):
    r"""
    Slope and aspect of the ground.

    .. math::

        \tan S = |\nabla z|, \qquad
        \tan A = \frac{-\partial z / \partial x}{-\partial z / \partial y}

    with x to the east and y to the north.

    Parameters
    ----------
    dem : array, shape (rows + 2, columns + 2)
        Elevation, north up, with a margin of one cell, which may be NaN. [m]
    cell_y, cell_x : float
        [m]

    Returns
    -------
    slope : array, shape (rows, columns)
        0 is level. [degree]
    aspect : array, shape (rows, columns)
        Azimuth of the direction down the slope, clockwise from north; 0 on level ground. [degree]

    Notes
    -----
    Central differences, exact on a plane and on a paraboloid.

    References
    ----------
    [DozierFrew1990]_, Eqs. 11 and 12, whose azimuths run from south through east

    Examples
    --------
    Ground that rises by its cell to the north faces south:

    >>> slope, aspect = slope_aspect(np.array([[60.0] * 3, [30.0] * 3, [0.0] * 3]), 30, 30)
    >>> round(float(slope[0, 0]), 9), float(aspect[0, 0])
    (45.0, 180.0)
    """
    return angles(*gradient(dem, cell_y, cell_x))


def angles(east, north):
    """
    Slope and aspect of a gradient.

    Parameters
    ----------
    east, north : array
        Rise eastward and northward. [m m-1]

    Returns
    -------
    slope, aspect : array
        As of `slope_aspect`. [degree]
    """
    slope = np.degrees(np.arctan(np.hypot(east, north)))
    # 0 - x and not -x: level ground must not face -0.
    aspect = np.degrees(np.arctan2(0 - east, 0 - north)) % 360
    return slope, np.where(aspect == 360, 0.0, aspect)


def sky_vector(tangents, directions, east, north):
    r"""
    The part of the sky that a slope sees, as a vector.

    .. math::

        \mathbf{F} = \frac{1}{\pi} \int_{\text{sky}} \boldsymbol\omega \, d\omega
            = \frac{1}{2\pi} \oint \boldsymbol\Gamma \, d\Theta

    The sky factor of a surface with the unit normal n is :math:`V_d = \mathbf{n} \cdot \mathbf{F}`, which is
    Eq. 7b of Dozier and Frew. The sky is bounded by the horizon, taken as great circles between the directions, and by
    the plane of the slope; Lambert's integral along great circles is exact.

    Parameters
    ----------
    tangents : array, shape (direction, ...)
        cot H of the horizon of the land around. [1]
    directions : array, shape (direction,)
        Evenly spaced azimuths, clockwise from north. [degree]
    east, north : array, shape (...)
        Gradient of the slope itself, which gives its own horizon. NaN is level. [m m-1]

    Returns
    -------
    vector : array, shape (3, ...)
        Eastward, northward and up. [1]

    References
    ----------
    [Lambert1760]_; [DozierFrew1990]_, Eqs. 7b and 10
    """
    tangents = np.ascontiguousarray(tangents, float)
    azimuth = np.radians(np.asarray(directions, float))
    shape = tangents.shape[1:]
    own = [np.nan_to_num(np.broadcast_to(each, shape), nan=0.0).ravel() for each in (east, north)]
    out = np.zeros((3, own[0].size))
    _sky_vector(tangents.reshape(azimuth.size, -1), np.sin(azimuth), np.cos(azimuth), *own, out)
    return out.reshape(3, *shape)


def sky_view(slope, aspect, horizon, directions=None):
    r"""
    Sky view factor: diffuse light from a uniform sky on a slope over that on an open plain.

    .. math::

        V_d = \frac{1}{2\pi} \int_0^{2\pi} \left[ \cos S \sin^2 H
            + \sin S \cos(\phi - A) \, (H - \sin H \cos H) \right] d\phi

    with H the lower of the zenith angles of the horizon of the land around, of the slope's own, and 90 degrees.

    Parameters
    ----------
    slope, aspect : array
        [degree]
    horizon : array, shape (direction, ...)
        Zenith angle H of the horizon of the land around. [degree]
    directions : array, shape (direction,), optional
        Its azimuths, clockwise from north and evenly spaced; by default from north on. [degree]

    Returns
    -------
    sky_view : array
        1 on an open plain. [1]

    Notes
    -----
    The integral is exact for a horizon of great circles between the directions, such as that of any plane.

    References
    ----------
    [DozierFrew1990]_, Eq. 7b

    Examples
    --------
    A wide plane of 60 degrees sees (1 + cos 60) / 2:

    >>> round(float(sky_view(60.0, 10.0, np.full(16, 90.0))), 12)
    0.75
    """
    horizon = np.asarray(horizon, float)
    count = horizon.shape[0]
    directions = np.arange(count) * (360 / count) if directions is None else directions
    shape = np.broadcast_shapes(np.shape(slope), np.shape(aspect), horizon.shape[1:])
    steep, azimuth = np.tan(np.radians(slope)), np.radians(aspect)
    east, north = (np.broadcast_to(-steep * each(azimuth), shape) for each in (np.sin, np.cos))
    missing = len(shape) + 1 - horizon.ndim
    tangents = tangent(horizon).reshape(count, *(1,) * missing, *horizon.shape[1:])
    x, y, z = sky_vector(np.broadcast_to(tangents, (count, *shape)), directions, east, north)
    return (z - east * x - north * y) / np.sqrt(1 + east**2 + north**2)


def terrain_view(slope, sky_view):
    r"""
    Terrain configuration factor: the share of a slope's view that land takes, so far as the plane of the slope is open.

    .. math:: C_t = \frac{1 + \cos S}{2} - V_d

    Parameters
    ----------
    slope : array
        [degree]
    sky_view : array
        [1]

    Returns
    -------
    terrain_view : array
        0 on any wide plane. [1]

    References
    ----------
    [DozierFrew1990]_, Eq. 9b

    Examples
    --------
    >>> float(terrain_view(0.0, 0.75))
    0.25
    """
    return (1 + np.cos(np.radians(slope))) / 2 - sky_view


def _difference(low, here, high):
    """High less low, over two cells; a missing one is where a straight line through the others leads."""
    low, high = np.where(np.isnan(low), 2 * here - high, low), np.where(np.isnan(high), 2 * here - low, high)
    # here - here is 0, or NaN where the cell itself is missing.
    return np.where(np.isnan(high - low), 0.0, high - low) + (here - here)


@njit(nogil=True, cache=True)
def _sky_vector(tangents, sin, cos, east, north, out):
    count = tangents.shape[0]
    for cell in range(out.shape[1]):
        for k in range(count):
            n = (k + 1) % count
            land, next_land = tangents[k, cell], tangents[n, cell]
            own = east[cell] * sin[k] + north[cell] * cos[k]
            next_own = east[cell] * sin[n] + north[cell] * cos[n]
            above, next_above = land - own, next_land - next_own
            a, b = (sin[k], cos[k], max(land, own)), (sin[n], cos[n], max(next_land, next_own))
            if above * next_above < 0:
                # The slope's plane and the land's horizon cross between the two directions.
                w, v = abs(next_above), abs(above)
                c = (
                    w * sin[k] + v * sin[n],
                    w * cos[k] + v * cos[n],
                    w * land + v * next_land,
                )
                _add_arc(a, c, cell, out)
                _add_arc(c, b, cell, out)
            else:
                _add_arc(a, b, cell, out)


@njit(nogil=True, cache=True)
def _add_arc(a, b, cell, out):
    """Lambert's term of the great circle from a to b, clockwise seen from above: its angle times its normal."""
    x, y, z = b[1] * a[2] - b[2] * a[1], b[2] * a[0] - b[0] * a[2], b[0] * a[1] - b[1] * a[0]
    sine = np.sqrt(x * x + y * y + z * z)
    if sine > 0:
        factor = np.arctan2(sine, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / (2 * np.pi * sine)
        out[0, cell] += factor * x
        out[1, cell] += factor * y
        out[2, cell] += factor * z
