"""Forms of the land at several scales, from windows of an elevation model."""

import numpy as np
from scipy import ndimage

SCALES = (10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
"""Standard deviations of the Gaussian means of elevation. [m]"""

RADII = (150.0, 400.0)
"""Half sides of the squares in which the lowest and the highest place are found. [m]"""

_TRUNCATE = 3.0

REACH = _TRUNCATE * SCALES[-1] + SCALES[0] * _TRUNCATE
"""Distance beyond which elevation does not matter. [m]"""

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


def land_forms(elevation, cell):
    r"""
    Forms of the land: slopes, positions, convergence, and heights above and below the places around.

    .. math:: p_s = z - g_s * z, \quad c_s = \nabla \cdot \frac{\nabla (g_s * z)}{|\nabla (g_s * z)| + 0.02}

    Parameters
    ----------
    elevation : array, shape (y, x)
        North up; NaN where unknown. [m]
    cell : float
        Distance of rows and of columns. [m]

    Returns
    -------
    forms : dict of str to array, shape (y, x)
        By the names of `FORMS`; 0 where no elevation is near, except for the elevation.

    Notes
    -----
    g is a Gaussian of the elevation that is known, cut at three standard deviations, so that cells further than `REACH`
    from the border of a window have the same bits as in the whole.
    """
    known = np.isfinite(elevation)
    share, height = known.astype(float), np.where(known, elevation, 0.0)
    smooth = {scale: _smoothed(height, share, scale / cell) for scale in SCALES}
    forms = {"elevation": elevation}
    for scale in (10.0, 40.0):
        south, east = np.gradient(smooth[scale], cell)
        slopes = {"slope": np.hypot(south, east), "northward": -south, "eastward": east}
        forms |= {f"{name}_{scale:.0f}": each for name, each in slopes.items()}
    forms |= {f"position_{scale:.0f}": elevation - smooth[scale] for scale in SCALES[1:]}
    for scale in (20.0, 40.0):
        south, east = np.gradient(smooth[scale], cell)
        steepness = np.hypot(south, east) + _CLEAR
        flow = np.gradient(south / steepness, cell, axis=0) + np.gradient(east / steepness, cell, axis=1)
        forms[f"convergence_{scale:.0f}"] = flow
    for radius in RADII:
        lowest = ndimage.minimum_filter(np.where(known, smooth[10.0], np.inf), size=_side(radius / cell))
        forms[f"above_{radius:.0f}"] = smooth[10.0] - lowest
    highest = ndimage.maximum_filter(np.where(known, smooth[10.0], -np.inf), size=_side(RADII[0] / cell))
    forms["below_150"] = highest - smooth[10.0]
    return {
        name: each if name == "elevation" else np.where(np.isfinite(each), each, 0.0) for name, each in forms.items()
    }


def _smoothed(height, share, scale):
    """Gaussian mean of the known elevation; NaN where none is near."""
    options = {"sigma": scale, "truncate": _TRUNCATE, "mode": "constant"}
    weight = ndimage.gaussian_filter(share, **options)
    return np.divide(
        ndimage.gaussian_filter(height, **options), weight, out=np.full(height.shape, np.nan), where=weight > 1e-6
    )


def _side(reach):
    """Cells along a square with at least one cell on each side of the middle."""
    return 2 * max(1, int(reach)) + 1
