"""Horizons: how far up from the horizontal the terrain around a cell reaches, in every direction."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

# A ray is sampled where it crosses each line of cells up to this many of them, and from there on at steps of one part
# in so many of the distance. On Kings Creek at 10 m that moves sky factors by 1e-5 rms.
_FINENESS = 32


class _Rays(NamedTuple):
    """Samples along rays, one ray after the other."""

    ends: np.ndarray  # of each ray among all samples, an even number of which it has, beginning with 0
    first: np.ndarray  # rows and columns from a cell to that before a sample
    second: np.ndarray  # and of that after it
    share: np.ndarray  # of the second [1]
    per_metre: np.ndarray  # inverse distance [m-1]


def azimuths(count):
    """
    Evenly spaced directions.

    Parameters
    ----------
    count : int
        At least 16.

    Returns
    -------
    azimuths : array, shape (count,)
        From north, clockwise. [degree]

    Raises
    ------
    ValueError
        If they are too few: between them the horizon is interpolated.

    Examples
    --------
    >>> azimuths(16)[:3].tolist()
    [0.0, 22.5, 45.0]
    """
    if not (count >= 16 and count == int(count)):
        raise ValueError(f"directions must be a whole number from 16 up, got {count}: the horizon is interpolated")
    return np.arange(int(count)) * (360 / int(count))


def horizon_margin(cell_y, cell_x, reach):
    """
    Cells around that a horizon depends on.

    Parameters
    ----------
    cell_y, cell_x : float
        [m]
    reach : float
        Greatest distance of terrain that is looked at. [m]

    Returns
    -------
    rows, columns : int

    Raises
    ------
    ValueError
        If the reach is not a cell.

    Examples
    --------
    >>> horizon_margin(30, 60, 300)
    (11, 6)
    """
    if not max(cell_y, cell_x) <= reach < np.inf:
        raise ValueError(f"reach must be at least one cell of {cell_y:g} x {cell_x:g} m, got {reach:g} m")
    return int(reach / cell_y) + 1, int(reach / cell_x) + 1


def horizon_zenith(dem, cell_y, cell_x, directions, reach):
    r"""
    Zenith angle of the horizon.

    .. math::

        H(\phi) = \operatorname{arccot} \max\left(0, \max_{0 < r \le R}
            \frac{z(\mathbf{x} + r \mathbf{e}_\phi) - z(\mathbf{x})}{r}\right)

    Parameters
    ----------
    dem : array, shape (rows + 2 m, columns + 2 n)
        Elevation with the margin m, n of `horizon_margin`; north up. NaN is open. [m]
    cell_y, cell_x : float
        [m]
    directions : array, shape (direction,)
        Azimuths, clockwise from north. [degree]
    reach : float
        R. [m]

    Returns
    -------
    horizon : array, shape (direction, rows, columns)
        90 is level and open. [degree]

    Notes
    -----
    A ray is sampled where it crosses the lines of cells of the axis that it follows more closely, between two cells by
    linear interpolation, so that a plane is exact. Beyond 32 cells the samples lie 1/32 of the distance apart. The
    curvature of the Earth, 8 m at 10 km, is left out.

    References
    ----------
    [DozierFrew1990]_

    Examples
    --------
    The top of a wall that stands as far away as it is high, to the east, and nothing to the north:

    >>> land = np.zeros((5, 5))
    >>> land[:, 3:] = 10
    >>> horizon_zenith(land, 10, 10, [0, 90], 10)[:, 0, 0].tolist()
    [90.0, 45.0]
    """
    return zenith(horizon_tangent(dem, cell_y, cell_x, directions, reach))


def horizon_tangent(dem, cell_y, cell_x, directions, reach):
    """
    Tangent of the elevation of the horizon, cot H.

    Parameters
    ----------
    dem, cell_y, cell_x, directions, reach
        As in `horizon_zenith`.

    Returns
    -------
    tangent : array, shape (direction, rows, columns)
        0 is level and open. [1]
    """
    dem = np.ascontiguousarray(dem, float)
    rows, columns = horizon_margin(cell_y, cell_x, reach)
    rays = _rays(tuple(np.asarray(directions, float).tolist()), float(cell_y), float(cell_x), float(reach))
    out = np.zeros((rays.ends.size - 1, dem.shape[0] - 2 * rows, dem.shape[1] - 2 * columns))
    _march(dem, rays, rows, columns, out)
    return out


def zenith(tangent):
    """
    Zenith angle of a horizon from its tangent.

    Parameters
    ----------
    tangent : array
        Of its elevation. [1]

    Returns
    -------
    zenith : array
        [degree]
    """
    return 90 - np.degrees(np.arctan(tangent))


def tangent(zenith):
    """
    Tangent of the elevation of a horizon.

    Parameters
    ----------
    zenith : array
        Zenith angle H; NaN is open. [degree]

    Returns
    -------
    tangent : array
        cot H, 0 where the horizon lies below the horizontal. [1]

    Examples
    --------
    >>> tangent([45.0, np.nan, 90.0]).round(12).tolist()
    [1.0, 0.0, 0.0]
    """
    return np.tan(np.radians(np.fmax(90 - np.asarray(zenith, float), 0.0)))


# The chunks of a raster have the same.
@lru_cache(maxsize=16)
def _rays(directions, cell_y, cell_x, reach):
    rays = [_samples(azimuth, cell_y, cell_x, reach) for azimuth in np.radians(directions)]
    ends = np.cumsum([0, *(len(ray[0]) for ray in rays)])
    return _Rays(ends, *(np.concatenate(each) for each in zip(*rays, strict=True)))


def _samples(azimuth, cell_y, cell_x, reach):
    """Where a ray is sampled: two cells (rows, columns away), the share of the second, and 1 / distance [1/m]."""
    down, right = -np.cos(azimuth) / cell_y, np.sin(azimuth) / cell_x
    along_columns = abs(right) >= abs(down)
    major = max(abs(right), abs(down))
    steps = [1]
    while steps[-1] + max(1, steps[-1] // _FINENESS) <= reach * major + 1e-9:
        steps.append(steps[-1] + max(1, steps[-1] // _FINENESS))
    # They are taken by twos; the last one twice changes nothing.
    steps += steps[-1:] * (len(steps) % 2)
    k = np.array(steps, float)
    # Rounded, so that a ray along an axis or a diagonal meets cells and not their neighbours by 1e-17.
    minor = np.round(k * ((down if along_columns else right) / major), 9)
    main = k * np.sign(right if along_columns else down)
    first, second = (
        np.stack([beside, main] if along_columns else [main, beside], axis=1).astype(int)
        for beside in (np.floor(minor), np.ceil(minor))
    )
    return first, second, minor - np.floor(minor), major / k


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
    before, after = np.sin(step - part) / np.sin(step), np.sin(part) / np.sin(step)
    return before * tangents[first] + after * tangents[(first + 1) % count]


@njit(nogil=True, cache=True)
def _march(dem, rays, top, left, out):
    cells, columns, width = dem.ravel(), out.shape[2], dem.shape[1]
    # How far the cells of a sample lie from that of the ray, row after row.
    first = rays.first[:, 0] * width + rays.first[:, 1]
    second = rays.second[:, 0] * width + rays.second[:, 1]
    for direction in range(out.shape[0]):
        for i in range(out.shape[1]):
            start = (top + i) * width + left
            here = cells[start : start + columns]
            for n in range(rays.ends[direction], rays.ends[direction + 1], 2):
                a, b = start + first[n], start + second[n]
                c, d = start + first[n + 1], start + second[n + 1]
                _raise_horizon(
                    (cells[a : a + columns], cells[b : b + columns], rays.share[n], rays.per_metre[n]),
                    (cells[c : c + columns], cells[d : d + columns], rays.share[n + 1], rays.per_metre[n + 1]),
                    here, out[direction, i],
                )  # fmt: skip


@njit(nogil=True, cache=True)
def _raise_horizon(near, far, here, line):
    """Horizon of a row of cells with two more samples of their rays: elevations beside, share, 1 / distance."""
    first, second, share, per_metre = near
    far_first, far_second, far_share, far_per_metre = far
    for j in range(line.size):
        rise = (first[j] + share * (second[j] - first[j]) - here[j]) * per_metre
        # False for NaN: what is not known is open.
        horizon = rise if rise > line[j] else line[j]
        rise = (far_first[j] + far_share * (far_second[j] - far_first[j]) - here[j]) * far_per_metre
        line[j] = rise if rise > horizon else horizon
