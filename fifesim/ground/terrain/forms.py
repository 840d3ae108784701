"""Forms of the land at several scales, from windows of an elevation model."""

import numpy as np
from scipy import ndimage

from fifesim.base.arrays import compiled

SCALES = (10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
"""Standard deviations of the Gaussian means of elevation. [m]"""

RADII = (150.0, 400.0)
"""Half sides of the squares in which the lowest and the highest place are found. [m]"""

COARSE = 4
"""Cells along the squares whose means serve the larger scales; windows begin at a multiple of it."""

# Scales of means of single cells; slopes and convergence need no larger ones.
_FINE_SCALES = SCALES[:3]

_TRUNCATE = 3.0

# Gradient of the slope at which a direction of flow is clear, so that level ground has no convergence. [m m-1]
_CLEAR = 0.02

FORMS = {
    "elevation": "m",
    **{f"{kind}_{scale:.0f}": "m m-1" for scale in (10, 40) for kind in ("slope", "northward", "eastward")},
    **{f"position_{scale:.0f}": "m" for scale in SCALES[1:]},
    **{f"convergence_{scale:.0f}": "m-1" for scale in (20, 40)},
    **{f"above_{radius:.0f}": "m" for radius in RADII},
    "below_150": "m",
}
"""Units of the forms; numbers in names are metres of the scale or radius."""


def forms_reach(cell):
    """Number of cells, a multiple of `COARSE`, beyond which elevation matters neither for forms nor between cells."""
    return COARSE * int(np.ceil((_TRUNCATE * SCALES[-1] / cell + 10) / COARSE))


def land_forms(elevation, cell, margin=0):
    r"""
    Forms of the land: slopes, positions, convergence, and heights above and below the places around.

    .. math:: p_s = z - g_s * z, \quad c_s = \nabla \cdot \frac{\nabla (g_s * z)}{|\nabla (g_s * z)| + 0.02}

    Parameters
    ----------
    elevation : array, shape (y, x)
        North up; NaN where unknown. [m]
    cell : float
        Distance of rows and of columns. [m]
    margin : int, optional
        Cells along each border without forms.

    Returns
    -------
    forms : dict of str to array, shape (y - 2 margin, x - 2 margin)
        By the names of `FORMS`; 0 where no elevation is near, except for the elevation.

    Notes
    -----
    g is a Gaussian of the elevation that is known, cut at three standard deviations. From 80 m on, it is computed from
    means of squares of `COARSE` cells and interpolated, with a standard deviation that is smaller by both blurs. Cells
    further than `forms_reach` from the border of a window that begins at a multiple of `COARSE` cells have the same
    bits as in the whole.
    """
    elevation = np.ascontiguousarray(elevation, float)
    sums = square_sums(elevation, COARSE)
    # Variances of a square of cells, and of the triangle of the interpolation.
    blur = (COARSE**2 - 1) / (12 * COARSE**2) + 1 / 6
    # Only the larger scales matter further out.
    near = min(margin, int(np.ceil((RADII[-1] + _TRUNCATE * _FINE_SCALES[-1]) / cell)))
    places = [np.arange(margin - near, size - margin + near) for size in elevation.shape]
    elevation = elevation[np.ix_(*places)]
    known = np.isfinite(elevation)
    height, share = np.where(known, elevation, 0.0), known.astype(float)
    smooth = {scale: _smoothed(height, share, scale / cell) for scale in _FINE_SCALES}
    for scale in SCALES[len(_FINE_SCALES) :]:
        coarse = _smoothed(*sums, np.sqrt((scale / cell / COARSE) ** 2 - blur))
        smooth[scale] = between_squares(coarse, COARSE, *places)
    forms = {f"position_{scale:.0f}": elevation - smooth[scale] for scale in SCALES[1:]}
    for scale in _FINE_SCALES:
        south, east = np.gradient(smooth[scale], cell)
        steepness = np.hypot(south, east)
        slopes = {"slope": steepness, "northward": -south, "eastward": east}
        south, east = south / (steepness + _CLEAR), east / (steepness + _CLEAR)
        slopes["convergence"] = np.gradient(south, cell, axis=0) + np.gradient(east, cell, axis=1)
        forms |= {f"{name}_{scale:.0f}": each for name, each in slopes.items()}
    for radius in RADII:
        lowest = ndimage.minimum_filter(np.where(known, smooth[10.0], np.inf), size=_side(radius / cell))
        forms[f"above_{radius:.0f}"] = smooth[10.0] - lowest
    highest = ndimage.maximum_filter(np.where(known, smooth[10.0], -np.inf), size=_side(RADII[0] / cell))
    forms["below_150"] = highest - smooth[10.0]
    inner = tuple(slice(near, size - near) for size in known.shape)
    forms = {name: forms[name][inner] for name in FORMS if name in forms}
    return {"elevation": elevation[inner]} | {n: np.where(np.isfinite(each), each, 0.0) for n, each in forms.items()}


def _smoothed(height, share, scale):
    """Gaussian mean of the known elevation, from sums and numbers or shares; NaN where none is near."""
    options = {"sigma": scale, "truncate": _TRUNCATE, "mode": "constant"}
    weight = ndimage.gaussian_filter(share, **options)
    return np.divide(
        ndimage.gaussian_filter(height, **options), weight, out=np.full(height.shape, np.nan), where=weight > 1e-6
    )


def square_sums(values, size):
    """Sums and numbers of the known cells in squares of cells, the last ones cut off."""
    total, count = (np.zeros(tuple(-(-n // size) for n in values.shape)) for _ in range(2))
    _add_squares(values, size, total, count)
    return total, count


@compiled
def _add_squares(values, size, total, count):
    """Add known cells to their squares."""
    for a in range(values.shape[0]):
        for j in range(total.shape[1]):
            for b in range(j * size, min((j + 1) * size, values.shape[1])):
                if np.isfinite(values[a, b]):
                    total[a // size, j] += values[a, b]
                    count[a // size, j] += 1


def between_squares(values, size, rows, columns):
    """Bilinear interpolation of values of squares of cells to cells, by their numbers, constant at the border."""
    # Whole numbers, so that the bits do not depend on the first square.
    (i, u), (j, v) = (
        ((2 * at + 1 - size) // (2 * size), (2 * at + 1 - size) % (2 * size) / (2 * size)) for at in (rows, columns)
    )
    out = np.empty((rows.size, columns.size))
    _interpolate(values, i, u, j, v, np.empty(values.shape[1]), out)
    return out


@compiled
def _interpolate(values, i, u, j, v, line, out):
    """Interpolate between nodes; ``line`` is memory."""
    last, end = values.shape[0] - 1, values.shape[1] - 1
    for a in range(i.size):
        one, other = values[max(i[a], 0)], values[min(i[a] + 1, last)]
        for k in range(line.size):
            line[k] = (1 - u[a]) * one[k] + u[a] * other[k]
        for b in range(j.size):
            out[a, b] = (1 - v[b]) * line[max(j[b], 0)] + v[b] * line[min(j[b] + 1, end)]


def _side(reach):
    """Cells along a square with at least one cell on each side of the middle."""
    return 2 * max(1, int(reach)) + 1
