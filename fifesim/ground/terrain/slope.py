"""The shape of the ground: its gradient, slope and aspect."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable


class Vector(NamedTuple):
    """Components eastward, northward and up; each a number or an array."""

    x: float
    y: float
    z: float


@register_jitable
def rise(low, here, high):
    """
    Rise of the ground over two cells.

    Parameters
    ----------
    low, here, high : float
        Elevations in a line. [m]

    Returns
    -------
    rise : float
        Where an end is missing, of the straight line through the others; 0 where both are. [m]

    Examples
    --------
    >>> rise(0.0, 1.0, 5.0), rise(np.nan, 1.0, 5.0), rise(np.nan, 1.0, np.nan)
    (5.0, 8.0, 0.0)
    """
    before = 2 * here - high if np.isnan(low) else low
    after = 2 * here - low if np.isnan(high) else high
    return 0.0 if np.isnan(after - before) else after - before


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
    dem = np.ascontiguousarray(dem, float)
    rows = np.arange(1, dem.shape[0] - 1) if rows is None else np.asarray(rows)
    columns = np.arange(1, dem.shape[1] - 1) if columns is None else np.asarray(columns)
    out = np.empty((2, rows.size, columns.size))
    _gradient(dem, rows, columns, 2 * cell_y, 2 * cell_x, out)
    return out[0], out[1]


@register_jitable
def slope_cosine(east, north):
    r"""
    Cosine of a slope.

    .. math:: \cos S = (1 + |\nabla z|^2)^{-1/2}

    Parameters
    ----------
    east, north : array
        Rise eastward and northward. [m m-1]

    Returns
    -------
    cosine : array
        [1]

    Examples
    --------
    >>> round(float(slope_cosine(0.0, 1.0) ** 2), 12)
    0.5
    """
    return 1 / np.sqrt(1 + east * east + north * north)


@register_jitable
def along_normal(vector, east, north):
    r"""
    Component of a vector along the normal of a slope.

    .. math:: \mathbf{n} \cdot \mathbf{v}
        = \left( v_z - \frac{\partial z}{\partial x} v_x - \frac{\partial z}{\partial y} v_y \right) \cos S

    Of the unit vector toward the sun or the sensor it is the cosine of the local zenith angle.

    Parameters
    ----------
    vector : Vector
    east, north : array
        Rise eastward and northward. [m m-1]

    Returns
    -------
    component : array
        Negative where the slope faces away. [unit of the vector]

    Examples
    --------
    Ground that rises to the east leans west:

    >>> round(float(along_normal(Vector(-0.5**0.5, 0.0, 0.5**0.5), 1.0, 0.0)), 12)
    1.0
    """
    return (vector.z - east * vector.x - north * vector.y) * slope_cosine(east, north)


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
    # np.hypot foresees overflow, and takes five times as long for the same digits but the last.
    slope = np.degrees(np.arctan(np.sqrt(east * east + north * north)))
    # 0 - x and not -x: level ground must not face -0.
    aspect = np.degrees(np.arctan2(0 - east, 0 - north)) % 360
    return slope, np.where(aspect == 360, 0.0, aspect)


def steepness(dem, cell_y, cell_x):
    """
    Slope of the ground alone, in one pass: aspects take longer.

    Parameters
    ----------
    dem, cell_y, cell_x
        As in `slope_aspect`.

    Returns
    -------
    slope : array, shape (rows, columns)
        To the bit that of `slope_aspect`. [degree]

    Examples
    --------
    >>> steepness(np.array([[60.0] * 3, [30.0] * 3, [0.0] * 3]), 30, 30).round(9).tolist()
    [[45.0]]
    """
    dem = np.ascontiguousarray(dem, float)
    out = np.empty((dem.shape[0] - 2, dem.shape[1] - 2))
    _tangent(dem, 2.0 * cell_y, 2.0 * cell_x, out)
    return np.degrees(np.arctan(out, out=out), out=out)


@njit(nogil=True, cache=True)
def _gradient(dem, rows, columns, over_y, over_x, out):
    for i in range(rows.size):
        for j in range(columns.size):
            row, column = rows[i], columns[j]
            here = dem[row, column]
            if np.isnan(here):
                out[:, i, j] = np.nan
                continue
            out[0, i, j] = rise(dem[row, column - 1], here, dem[row, column + 1]) / over_x
            out[1, i, j] = rise(dem[row + 1, column], here, dem[row - 1, column]) / over_y


# Divided as numpy does: a check of each divisor for 0 would keep a loop from taking several cells at once.
@njit(nogil=True, cache=True, error_model="numpy")
def _tangent(dem, over_y, over_x, out):
    """Tangent of the slope."""
    for i in range(out.shape[0]):
        above, here, below, line = dem[i], dem[i + 1], dem[i + 2], out[i]
        for j in range(line.size):
            east = rise(here[j], here[j + 1], here[j + 2]) / over_x
            north = rise(below[j + 1], here[j + 1], above[j + 1]) / over_y
            line[j] = np.nan if np.isnan(here[j + 1]) else np.sqrt(east * east + north * north)
