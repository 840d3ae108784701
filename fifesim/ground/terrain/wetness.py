"""Topographic wetness index of an elevation model."""

import numpy as np

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

    Examples
    --------
    On an even slope of 10 percent the third row from the top has an area of 3 cells of 10 m:

    >>> plane = np.repeat(10.0 - np.arange(6.0)[:, None], 5, axis=1)
    >>> bool(abs(wetness_index(plane, 10.0, 10.0)[2, 2] - np.log(30 / 0.1)) < 0.2)
    True
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
    Ground without pits: every cell has a descending path to the border, or to unknown cells.

    Parameters
    ----------
    elevation : array, shape (y, x)
        NaN where unknown. [m]

    Returns
    -------
    ground : array, shape (y, x)
        Nowhere below the elevation. [m]

    References
    ----------
    [Planchon2002]_

    Examples
    --------
    >>> bowl = np.ones((5, 5)); bowl[2, 2] = 0.0
    >>> fill_pits(bowl)[2, 2].round(3).item()
    1.0
    """
    ground = np.full(elevation.shape, np.inf)
    _lower(elevation, ground)
    return ground


@compiled
def _lower(elevation, ground):
    """Lower infinitely high ground to the surface of `fill_pits`, by sweeps until convergence."""
    rows, columns = elevation.shape
    for y in range(rows):
        for x in range(columns):
            open_here = y == 0 or x == 0 or y == rows - 1 or x == columns - 1
            if not open_here:
                for a in range(-1, 2):
                    for b in range(-1, 2):
                        open_here = open_here or np.isnan(elevation[y + a, x + b])
            if open_here:
                ground[y, x] = elevation[y, x]
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
                    for a in range(-1, 2):
                        for b in range(-1, 2):
                            if (a != 0 or b != 0) and ground[y + a, x + b] < lowest:
                                lowest = ground[y + a, x + b]
                    level = max(elevation[y, x], lowest + _FALL)
                    if level < ground[y, x]:
                        ground[y, x] = level
                        changed = True


def drained_area(ground, down, across):
    """
    Area that drains through each cell, including the cell, by multiple flow directions.

    Parameters
    ----------
    ground : array, shape (y, x)
        Without pits. [m]
    down, across : float
        Distance of rows, and of columns. [m]

    Returns
    -------
    area : array, shape (y, x)
        [m2]

    References
    ----------
    [Freeman1991]_

    Examples
    --------
    On a plane that falls southward all of a column's area comes to its last cell:

    >>> plane = np.repeat(np.arange(4.0)[::-1, None], 3, axis=1)
    >>> drained_area(plane, 10.0, 10.0)[-1].sum().round(6).item()
    1200.0
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
