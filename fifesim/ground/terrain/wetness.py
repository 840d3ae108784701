"""Topographic wetness index of an elevation model."""

import numpy as np
from scipy import ndimage

from fifesim.base.arrays import compiled

# Exponent of the slope for the division of water among lower neighbours, Freeman (1991).
EXPONENT = 1.1

# Minimum slope, so that wetness is finite on level ground. [m m-1]
LEAST_SLOPE = 1e-3

# Pits are filled so that each cell lies so much above that which it drains to. [m a node]
_FALL = 1e-4


def wetness_index(elevation, down, across):
    r"""
    Topographic wetness index.

    .. math:: w = \ln \frac{a}{\tan \beta}

    with a the area that drains through a metre of contour, by many ways: to each lower neighbour in the proportion of
    its slope to the power 1.1.

    Parameters
    ----------
    elevation : array, shape (y, x)
        NaN where unknown: water leaves there, as it does at the border. [m]
    down, across : float
        Distance of rows, and of columns. [m]

    Returns
    -------
    wetness : array, shape (y, x)
        NaN where elevation is unknown. [1]

    Notes
    -----
    Pits are filled first. The slope is from central differences, at least 0.001. Land beyond the
    border drains nothing into the raster: along the border the index is too small.

    References
    ----------
    [Beven1979]_; [Freeman1991]_ for the ways, [Planchon2002]_ for the pits
    """
    elevation = np.ascontiguousarray(elevation, float)
    filled = fill_pits(elevation)
    area = drained_area(filled, float(down), float(across))
    # Each cell's contour is about as long as the cell is wide.
    contour = np.sqrt(down * across)
    return np.where(np.isnan(elevation), np.nan, np.log(area / contour / _steepness(filled, down, across)))


def _steepness(ground, down, across):
    """Tangent of the slope, one-sided next to unknown cells."""
    changes = []
    for axis, distance in ((0, down), (1, across)):
        if ground.shape[axis] < 2:
            changes.append(np.zeros(ground.shape))
            continue
        ahead, behind = (np.full(ground.shape, np.nan) for _ in range(2))
        step = np.diff(ground, axis=axis) / distance
        inner = (slice(None),) * axis
        ahead[(*inner, slice(None, -1))] = step
        behind[(*inner, slice(1, None))] = step
        both = np.where(np.isnan(ahead), behind, np.where(np.isnan(behind), ahead, (ahead + behind) / 2))
        changes.append(np.nan_to_num(both))
    return np.maximum(np.hypot(*changes), LEAST_SLOPE)


def fill_pits(elevation):
    """
    Ground in which every cell has a descending path to the border or to unknown cells, nowhere below the elevation. [m]
    [Planchon2002]_
    """
    unknown = np.isnan(np.pad(elevation, 1, constant_values=np.nan))
    next_to_unknown = ndimage.binary_dilation(unknown, np.ones((3, 3)))[1:-1, 1:-1]
    ground = np.where(next_to_unknown, elevation, np.inf)
    _lower(elevation, ground)
    return ground


@compiled
def _lower(elevation, ground):
    """Lower infinitely high ground to the surface of `fill_pits`, by sweeps until convergence."""
    rows, columns = elevation.shape
    changed = True
    while changed:
        changed = False
        for sweep in range(4):
            for i in range(1, rows - 1):
                y = i if sweep < 2 else rows - 1 - i
                for j in range(1, columns - 1):
                    x = j if sweep % 2 == 0 else columns - 1 - j
                    if not ground[y, x] > elevation[y, x]:
                        continue
                    lowest = np.inf
                    for k in range(9):
                        near = ground[y - 1 + k // 3, x - 1 + k % 3]
                        if k != 4 and near < lowest:
                            lowest = near
                    level = max(elevation[y, x], lowest + _FALL)
                    if level < ground[y, x]:
                        ground[y, x] = level
                        changed = True


def drained_area(ground, down, across):
    """
    Area that drains through each cell of ground without pits, including the cell, by multiple flow directions. [m2]
    [Freeman1991]_
    """
    area = np.full(ground.shape, down * across)
    _drain(ground, np.argsort(ground, axis=None, kind="stable"), float(down), float(across), area)
    return area


@compiled
def _drain(ground, order, down, across, area):
    """Pass the areas of cells, from the highest to the lowest, to their lower neighbours."""
    rows, columns = ground.shape
    share = np.empty((3, 3))
    for k in range(order.size - 1, -1, -1):
        y, x = order[k] // columns, order[k] % columns
        total = 0.0
        for a in range(-1, 2):
            for b in range(-1, 2):
                share[a + 1, b + 1] = 0.0
                inside = 0 <= y + a < rows and 0 <= x + b < columns
                if inside and ground[y + a, x + b] < ground[y, x]:
                    distance = np.hypot(a * down, b * across)
                    share[a + 1, b + 1] = ((ground[y, x] - ground[y + a, x + b]) / distance) ** EXPONENT
                    total += share[a + 1, b + 1]
        if total > 0.0:
            for a in range(-1, 2):
                for b in range(-1, 2):
                    if share[a + 1, b + 1] > 0.0:
                        area[y + a, x + b] += area[y, x] * share[a + 1, b + 1] / total
