"""Whether an elevation model covers a grid, what it lacks, and what its numbers are worth."""

import numpy as np
from scipy import ndimage

from fifesim.base.warned import warn
from fifesim.ground.terrain.gaps import block_means
from fifesim.ground.terrain.rasters.model import looked_up
from fifesim.ground.terrain.units import terrace_step
from fifesim.rasters import grid as grids
from fifesim.rasters import projection
from fifesim.rasters.whereabouts import lies_in_words

# What a model covers is looked at on so many rows and columns of the grid at most, so many rows at a time.
_LOOKS = 2000
_STRIP = 256

# Of what is looked at cell by cell, so many rows and columns at a time.
_PART = 512

# Relief with a larger mean slope, of cells of about this size, is rare. [degree], [m]
_STEEP, _SLOPE_SCALE = 20.0, 30.0

# A model that ends this far inside the grid is better exchanged than carried on. [m]
_NEAR = 150


def known_elevation(model, make_tile, first_row, first_column, shape):
    """
    Elevation of a part of a grid, which a model has to cover.

    Parameters
    ----------
    model : fifesim.ground.terrain.rasters.model.Model
    make_tile, first_row, first_column, shape
        As `Model.elevation` takes them.

    Returns
    -------
    elevation : array, shape (rows, columns)
        [m]

    Raises
    ------
    ValueError
        If some is unknown, or the model holds a height that land does not have.
    """
    values = model.elevation(make_tile, first_row, first_column, shape)
    unknown = ~np.isfinite(values)
    if unknown.any():
        grid = model.place.grid[first_row : first_row + shape[0], first_column : first_column + shape[1]]
        _raise_for_gaps(model, grid, unknown, np.arange(shape[0]), np.arange(shape[1]))
    return values


def known_cells(model, shape):
    """
    Whether elevations of a model's grid are known, from a look at its source by parts.

    Parameters
    ----------
    model : fifesim.ground.terrain.rasters.model.Model
    shape : (int, int)
        Of the grid.

    Returns
    -------
    known : array of bool, shape (rows, columns)
    """
    known = np.empty(shape, bool)
    for top in range(0, shape[0], _PART):
        for left in range(0, shape[1], _PART):
            part = known[top : top + _PART, left : left + _PART]
            height, width = part.shape
            part[:] = _looked_at(model, top + np.arange(height), left + np.arange(width))
    return known


def _looked_at(model, rows, columns):
    """Whether some rows and columns of a model's grid are known."""
    rows, columns = model.place.positions(rows, columns)
    top, left, height, width = model.window(rows, columns)
    return looked_up(np.isfinite(model.read(top, left, height, width)), rows - top, columns - left)


def check_cover(model, grid):
    """
    Refuse a model that lacks what a grid needs, before anything is made of it.

    Parameters
    ----------
    model : fifesim.ground.terrain.rasters.model.Model
    grid : odc.geo.geobox.GeoBox

    Raises
    ------
    ValueError
        If it ends inside the grid or has holes there.
    """
    step = max(0.5 * model.resolution / max(model.blocks) / min(grids.cell_size(grid)), 1.0)
    looks = [
        np.unique(np.linspace(0, size - 1, min(int(size / step) + 2, _LOOKS)).round().astype(int))
        for size in grid.shape
    ]
    unknown = []
    for first in range(0, looks[0].size, _STRIP):
        unknown.append(~_looked_at(model, looks[0][first : first + _STRIP], looks[1]))
    unknown = np.concatenate(unknown)
    if unknown.any():
        _raise_for_gaps(model, grid, unknown, *looks)


def _raise_for_gaps(model, grid, unknown, rows, columns):
    """Say which part of a grid a model lacks, from a look at some of its rows and columns."""
    source, name = model.source, model.source.name
    if unknown.all():
        raise ValueError(
            f"{name} holds no elevation on the grid, which spans {grids.extent(grid)} in "
            f"{projection.name_of(grid.crs.proj)}; it spans {lies_in_words(source.affine, source.shape, source.crs)}"
        )
    down, across = grids.cell_size(grid)
    height, width = np.gradient(rows.astype(float)) * down, np.gradient(columns.astype(float)) * across
    words = [
        *_short_sides(model, unknown, height, width),
        *_covered(grid, unknown, rows, columns),
        *_holes(grid, unknown, rows, columns, height, width),
    ]
    raise ValueError(f"{name} does not cover the grid, which spans {grids.extent(grid)}; " + "; ".join(words))


def _short_sides(model, unknown, height, width):
    """By how much a model ends inside a grid, in words."""
    leads = {
        "north": _lead(unknown, height),
        "south": _lead(unknown[::-1], height[::-1]),
        "west": _lead(unknown.T, width),
        "east": _lead(unknown.T[::-1], width[::-1]),
    }
    if not any(leads.values()):
        return
    sides = ", ".join(f"{metres:.0f} m in the {side}" for side, metres in leads.items() if metres > 0)
    filled = max(cells * size for cells, size in zip(model.fill, model.place.cell_size(), strict=True))
    # Filling counts from the centre of the last known cell.
    near = int(np.ceil((max(leads.values()) + model.resolution + filled) / 10 + 1)) * 10
    carried = f", or fill={near} carries it on" if near <= _NEAR else ""
    yield f"it lacks up to {sides}: take a smaller grid or a model that reaches farther{carried}"


def _covered(grid, unknown, rows, columns):
    """The part of a grid that remains without the edges that a model lacks, in words."""
    edges = unknown[0].any(), unknown[-1].any(), unknown[:, 0].any(), unknown[:, -1].any()
    first, last, start, stop = 0, rows.size, 0, columns.size
    # Edge by edge, the one that lacks the larger share goes first, until the rest is known.
    while any(edges) and last - first > 2 and stop - start > 2:
        part = unknown[first:last, start:stop]
        shares = [part[0].mean(), part[-1].mean(), part[:, 0].mean(), part[:, -1].mean()]
        worst = int(np.argmax(shares))
        if not shares[worst]:
            break
        first, last = first + (worst == 0), last - (worst == 1)
        start, stop = start + (worst == 2), stop - (worst == 3)
    if (first, last, start, stop) == (0, rows.size, 0, columns.size) or unknown[first:last, start:stop].any():
        return
    down, across = grids.cell_size(grid)
    top, bottom = rows[first], rows[last - 1] + 1
    left, right = columns[start], columns[stop - 1] + 1
    west, north = projection.transform_points(grid.affine, left, top)
    yield (
        f"it covers west={west:.10g}, north={north:.10g}, width={(right - left) * across:.6g}, "
        f"height={(bottom - top) * down:.6g}"
    )


def _lead(unknown, sizes):
    """Longest run of unknown rows from the first on, of columns that are not unknown altogether, if others are not."""
    partly = unknown[:, ~unknown.all(axis=0)]
    runs = np.cumsum(np.logical_and.accumulate(partly, axis=0) * sizes[:, None], axis=0)[-1]
    return float(runs.max())


def _holes(grid, unknown, rows, columns, height, width):
    """Where the largest of the holes lies that are seen, in words."""
    labels, _ = ndimage.label(unknown, structure=np.ones((3, 3)))
    holes = [
        (height[down].sum(), width[across].sum(), down, across)
        for down, across in ndimage.find_objects(labels)
        if down.start > 0 and across.start > 0 and down.stop < rows.size and across.stop < columns.size
    ]
    if not holes:
        return
    tall, wide, down, across = max(holes, key=lambda hole: max(hole[:2]))
    row, column = rows[(down.start + down.stop) // 2], columns[(across.start + across.stop) // 2]
    east, north = projection.transform_points(grid.affine, column + 0.5, row + 0.5)
    fill = int(np.ceil(max(tall, wide) / 20 + 1)) * 10
    number = "a hole" if len(holes) == 1 else f"{len(holes)} holes, the largest"
    yield f"it has {number} of {tall:.0f} x {wide:.0f} m at {east:.0f} E {north:.0f} N: fill={fill} interpolates it"


def warn_of_relief(model, grid, unit_is_given):
    """
    Warn of terraces of whole numbers, and of implausibly steep relief, in the middle of a grid.

    Parameters
    ----------
    model : fifesim.ground.terrain.rasters.model.Model
    grid : odc.geo.geobox.GeoBox
    unit_is_given : bool
        Whether the user gave the unit of the elevations, which may be steep then.

    Warns
    -----
    UserWarning
        If elevations are whole numbers in terraces, or if the mean slope at 30 m exceeds 20 degrees.
    """
    middle = [np.array([size // 2]) for size in grid.shape]
    top, left, height, width = model.window(*model.place.positions(*middle))
    around = 200
    values = model.source.read(top - around, left - around, height + 2 * around, width + 2 * around)
    step = terrace_step(values / model.source.metres)
    if step is not None:
        warn(
            f"the elevations of {model.source.name} are whole numbers that lie in terraces, with a vertical resolution "
            f"of {step * model.source.metres:g} m: slope and aspect will show the terraces' edges"
        )
    slope = _mean_slope(values, model.place.cell_size())
    if slope > _STEEP and not unit_is_given:
        warn(
            f"the mean slope of {model.source.name} is {slope:.1f} degrees at {_SLOPE_SCALE:g} m, which only high "
            "mountains have: if its elevations are feet or decimetres, give vertical_units='ft' or 'dm'; if they are "
            "metres, give vertical_units='m'"
        )


def _mean_slope(values, sizes):
    """Mean slope of elevations averaged to cells of about 30 m, NaN if there are too few. [degree]"""
    counts = [max(1, round(_SLOPE_SCALE / size)) for size in sizes]
    rows, columns = (size // count * count for size, count in zip(values.shape, counts, strict=True))
    means = block_means(values[:rows, :columns], *counts)
    if min(means.shape) < 2:
        return np.nan
    down, across = np.gradient(means, *(count * size for count, size in zip(counts, sizes, strict=True)))
    slopes = np.degrees(np.arctan(np.hypot(down, across)))
    known = np.isfinite(slopes)
    return float(slopes[known].mean()) if known.any() else np.nan
