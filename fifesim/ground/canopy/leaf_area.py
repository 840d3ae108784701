"""Range of leaf area index: what no canopy has is refused, and what is implausible is a warning."""

import numpy as np

from fifesim.base.warned import warn
from fifesim.ground.canopy.ranges import within

LARGEST_LAI = 100.0
"""Largest leaf area index that is taken for one [m2 m-2]; the densest canopies have about 20."""

LARGEST_OF_MAPS = 20.0
"""Of measured canopies, and a little more: a map beyond is in another scale [m2 m-2]."""

LARGEST_MEAN = 8.0
"""Mean leaf area index of the densest scenes; a larger mean is a warning [m2 m-2]."""

# Hardly a cell of a map has more. [m2 m-2]
_COMMON = 10.0


def check_lai(lai):
    """
    Refuse a leaf area index that is negative or above 100; NaN passes.

    Parameters
    ----------
    lai : array
        [m2 m-2]

    Returns
    -------
    lai : array
        What was given.

    Raises
    ------
    ValueError
        If one is negative or above 100, which no canopy has: it is a fill value, or needs a scale.

    Examples
    --------
    >>> check_lai(2.5)
    2.5
    """
    cells = np.asarray(lai, float)
    if not within(cells, 0.0, LARGEST_LAI):
        wrong = (cells < 0) | (cells > LARGEST_LAI)
        scale = _of_another_scale(cells) if np.nanmax(cells) > LARGEST_LAI else ""
        raise ValueError(
            f"leaf area index must not be negative nor above {LARGEST_LAI:g}, got {cells[wrong].flat[0]:g} in "
            f"{wrong.sum()} of {cells.size} cells: {scale}set cells without data to NaN, such as "
            "lai.where(lai >= 0)"
        )
    return lai


def check_map(lai):
    """
    Refuse a map of leaf area index whose numbers look like those of another scale; NaN passes.

    Parameters
    ----------
    lai : array
        [m2 m-2]

    Returns
    -------
    lai : array
        What was given.

    Raises
    ------
    ValueError
        As `check_lai`, or if one is above 20.

    Notes
    -----
    The largest of some 1000 measured values is 18, once outliers are removed.

    References
    ----------
    Asner, G.P., Scurlock, J.M.O., Hicke, J.A. (2003), Global synthesis of leaf area index observations. Global Ecology
    and Biogeography 12, 191-205

    Examples
    --------
    >>> check_map(2.5)
    2.5
    """
    cells = np.asarray(lai, float)
    if not within(cells, 0.0, LARGEST_OF_MAPS):
        check_lai(lai)
        raise ValueError(
            f"leaf area index up to {np.nanmax(cells):g}, canopies have at most {LARGEST_OF_MAPS:g}: "
            f"{_of_another_scale(cells)}set cells without data to NaN"
        )
    return lai


def check_source(name, values):
    """
    Raise ValueError if the cells of a map cannot be leaf area index, before they are interpolated.

    Parameters
    ----------
    name : str
        Name of the map.
    values : array
        NaN passes. [m2 m-2]

    Raises
    ------
    ValueError
        As `check_map`. A mark of missing data next to the grid would enter cells at its edge as a plausible value.
    """
    try:
        check_map(values)
    except ValueError as error:
        raise ValueError(
            f"{name}, on the grid or next to it: {error}, or declare their value (gdal_edit.py -a_nodata, "
            ".rio.write_nodata)"
        ) from None


def warn_of_large(lai):
    """
    Warn if leaf area index is implausibly large on average.

    Parameters
    ----------
    lai : array
        NaN is left out. [m2 m-2]

    Returns
    -------
    lai : array
        The same array.

    Warns
    -----
    UserWarning
        If the mean exceeds 8, more than dense forest has over a scene.
    """
    total, count = np.nansum(lai), np.count_nonzero(~np.isnan(lai))
    if total > LARGEST_MEAN * count:
        warn(
            f"the mean leaf area index is {total / count:.3g}, dense forests have about {LARGEST_MEAN:g}: if the map "
            "holds scaled values, multiply it by its scale, such as lai * 0.1"
        )
    return lai


def _of_another_scale(cells):
    """What to type where numbers are scaled: by the power of ten that brings nearly all of them below 10."""
    positive = cells[(cells > 0) & np.isfinite(cells)]
    most = np.quantile(positive, 0.98) if positive.size else 0.0
    if most <= _COMMON:
        return ""
    scale = f"{10.0 ** -np.ceil(np.log10(most / _COMMON)):g}"
    if 50 < most <= 100 and np.max(positive) <= 100:
        return (
            "numbers up to 100 may be percent of cover or of FPAR, which are not leaf area index; where they are "
            f"scaled leaf area index, type lai * {scale}; "
        )
    return f"where the numbers are scaled, type lai * {scale}, or gdal_edit.py -a_scale {scale} for a file; "
