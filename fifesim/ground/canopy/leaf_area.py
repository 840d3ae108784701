"""Checks of leaf area index and of the fractions of a canopy."""

import numpy as np

from fifesim.base.arrays import jitable
from fifesim.base.messages import warn


def within(values, lowest, highest):
    """Whether all values are in a range; NaN is ignored."""
    low = np.fmin.reduce(values, axis=None, initial=lowest)
    high = np.fmax.reduce(values, axis=None, initial=highest)
    return bool(low >= lowest and high <= highest)


@jitable
def outside(values, lowest, highest):
    """Number of values outside a range; NaN is ignored."""
    # A sum without branches is vectorized.
    count = 0
    for i in range(values.size):
        count += (values[i] < lowest) | (values[i] > highest)
    return count


def check_fraction(name, values):
    """Raise ValueError for values outside 0 to 1, and for NaN."""
    values = np.asarray(values, float)
    wrong = ~((values >= 0) & (values <= 1))
    if wrong.any():
        raise ValueError(
            f"{name} must be in [0, 1], got {values[wrong].flat[0]:g}: give a fraction, not percent or digital numbers"
        )


def check_share(name, values):
    """Raise ValueError for a share outside 0 to 1; NaN passes."""
    cells = np.asarray(values, float)
    if not within(cells, 0.0, 1.0):
        check_fraction(name, cells[~np.isnan(cells)])
    return values


LARGEST_LAI = 100.0  # largest accepted leaf area index [m2 m-2]; the densest canopies have about 20

# Largest accepted leaf area index of maps, just above measured canopies; larger values indicate scaling [m2 m-2].
LARGEST_OF_MAPS = 20.0

LARGEST_MEAN = 8.0  # mean leaf area index of the densest scenes; a larger mean is a warning [m2 m-2]

# Hardly a cell of a map has more. [m2 m-2]
_COMMON = 10.0


def check_lai(lai):
    """Raise ValueError if leaf area index is negative or above 100; NaN passes."""
    cells = np.asarray(lai, float)
    if not within(cells, 0.0, LARGEST_LAI):
        wrong = (cells < 0) | (cells > LARGEST_LAI)
        scale = _of_another_scale(cells) if np.nanmax(cells) > LARGEST_LAI else ""
        raise ValueError(
            f"leaf area index must not be negative nor above {LARGEST_LAI:g}, got {cells[wrong].flat[0]:g} in "
            f"{wrong.sum()} of {cells.size} cells: {scale}set cells without data to NaN, such as "
            f"lai.where((lai >= 0) & (lai <= {LARGEST_LAI:g}))"
        )
    return lai


def check_map(lai):
    """Raise ValueError if a map of leaf area index looks scaled; NaN passes."""
    # The largest of some 1000 measured values is 18, once outliers are removed: Asner, Scurlock and Hicke (2003),
    # Global Ecology and Biogeography 12, 191-205.
    cells = np.asarray(lai, float)
    if not within(cells, 0.0, LARGEST_OF_MAPS):
        check_lai(lai)
        raise ValueError(
            f"leaf area index up to {np.nanmax(cells):g}, canopies have at most {LARGEST_OF_MAPS:g}: "
            f"{_of_another_scale(cells)}set cells without data to NaN"
        )
    return lai


def check_source(name, values):
    """Raise ValueError if the cells of a map cannot be leaf area index, before they are interpolated."""
    try:
        check_map(values)
    except ValueError as error:
        raise ValueError(
            f"{name}, on the grid or next to it: {error}, or declare their value (gdal_edit.py -a_nodata, "
            ".rio.write_nodata)"
        ) from None


def warn_of_integers(name):
    """Warn that integers without a scale are used as leaf area index."""
    warn(
        f"{name} holds integers without a scale, which are used as leaf area index: if they are scaled, set their "
        "scale (.assign_attrs(scale_factor=0.1), or gdal_edit.py -a_scale 0.1 for a file), else convert them with "
        ".astype(float)"
    )


def warn_of_large(lai):
    """Warn if the mean leaf area index is implausibly large."""
    total, count = np.nansum(lai), np.count_nonzero(~np.isnan(lai))
    if total > LARGEST_MEAN * count:
        warn(
            f"the mean leaf area index is {total / count:.3g}, dense forests have about {LARGEST_MEAN:g}: if the map "
            "holds scaled values, multiply it by its scale, such as lai * 0.1"
        )
    return lai


def _of_another_scale(cells):
    """Advice for scaled numbers: the power of ten that brings nearly all of them below 10."""
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
