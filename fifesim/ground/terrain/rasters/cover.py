"""Whether an elevation model covers a grid, what it lacks, and what its numbers are worth."""

import warnings

import numpy as np
from scipy import ndimage

from fifesim.ground.terrain.rasters.model import looked_up
from fifesim.ground.terrain.rasters.source import check_heights
from fifesim.ground.terrain.units import terrace_step
from fifesim.rasters import grid as grids
from fifesim.rasters import projection

# What a model covers is looked at on so many rows and columns of the grid at most, so many rows at a time.
_LOOKS = 2000
_STRIP = 256

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
        If some is unknown, or no height that land has.
    """
    values = model.elevation(make_tile, first_row, first_column, shape)
    unknown = ~np.isfinite(values)
    check_heights(model.source.name, values)
    if unknown.any():
        grid = model.place.grid[first_row : first_row + shape[0], first_column : first_column + shape[1]]
        _raise_for_gaps(model, grid, unknown, np.arange(shape[0]), np.arange(shape[1]))
    return values


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
        rows, columns = model.place.positions(looks[0][first : first + _STRIP], looks[1])
        top, left, height, width = model.window(rows, columns)
        unknown.append(~looked_up(np.isfinite(model.read(top, left, height, width)), rows - top, columns - left))
    unknown = np.concatenate(unknown)
    if unknown.any():
        _raise_for_gaps(model, grid, unknown, *looks)


def _raise_for_gaps(model, grid, unknown, rows, columns):
    """Say which part of a grid a model lacks, from a look at some of its rows and columns."""
    name = model.source.name
    if unknown.all():
        raise ValueError(
            f"{name} holds no elevation on the grid, which spans {grids.extent(grid)}: is it the right place?"
        )
    down, across = grids.cell_size(grid)
    height, width = (np.gradient(cells.astype(float)) * size for cells, size in ((rows, down), (columns, across)))
    leads = {
        "north": unknown,
        "south": unknown[::-1],
        "west": unknown.T,
        "east": unknown.T[::-1],
    }
    sizes = {"north": height, "south": height[::-1], "west": width, "east": width[::-1]}
    short = {side: _lead(leads[side], sizes[side]) for side in leads}
    short = {side: metres for side, metres in short.items() if metres > 0}
    labels, _ = ndimage.label(unknown, structure=np.ones((3, 3)))
    holes = [
        (height[part[0]].sum(), width[part[1]].sum(), part)
        for part in ndimage.find_objects(labels)
        if part[0].start > 0 and part[1].start > 0 and part[0].stop < rows.size and part[1].stop < columns.size
    ]
    words = []
    if short:
        sides = ", ".join(f"{metres:.0f} m in the {side}" for side, metres in short.items())
        # Filling counts from the centre of the last known cell.
        near = int(np.ceil((max(short.values()) + model.resolution + max(_filled(model))) / 10 + 1)) * 10
        words.append(
            f"it lacks up to {sides}: take a smaller grid or a model that reaches farther"
            + (f", or fill={near} carries it on" if near <= _NEAR else "")
        )
    if holes:
        tall, wide, part = max(holes, key=lambda hole: max(hole[:2]))
        middle = [int(cells[(axis.start + axis.stop) // 2]) for cells, axis in zip((rows, columns), part, strict=True)]
        east, north = projection.transform_points(grid.affine, middle[1] + 0.5, middle[0] + 0.5)
        middle_distance = int(np.ceil(max(tall, wide) / 20 + 1)) * 10
        number = "a hole" if len(holes) == 1 else f"{len(holes)} holes, the largest"
        words.append(
            f"it has {number} of {tall:.0f} x {wide:.0f} m at {east:.0f} E {north:.0f} N: fill={middle_distance} "
            "interpolates it"
        )
    raise ValueError(f"{name} does not cover the grid, which spans {grids.extent(grid)}; " + "; ".join(words))


def _filled(model):
    """Distances that gaps are already filled over, down and across [m]."""
    return [cells * size for cells, size in zip(model.fill, model.place.cell_size(), strict=True)]


def _lead(unknown, sizes):
    """Longest run of unknown rows from the first on, of columns that are not unknown altogether, if others are not."""
    partly = unknown[:, ~unknown.all(axis=0)]
    runs = np.cumsum(np.logical_and.accumulate(partly, axis=0) * sizes[:, None], axis=0)[-1]
    return float(runs.max())


def warn_of_terraces(model, grid):
    """
    Warn of elevations in whole numbers that lie in terraces, from a look at the middle of a grid.

    Parameters
    ----------
    model : fifesim.ground.terrain.rasters.model.Model
    grid : odc.geo.geobox.GeoBox
    """
    middle = [np.array([size // 2]) for size in grid.shape]
    top, left, height, width = model.window(*model.place.positions(*middle))
    around = 200
    values = model.source.read(top - around, left - around, height + 2 * around, width + 2 * around)
    step = terrace_step(values / model.source.metres)
    if step is not None:
        warnings.warn(
            f"the elevations of {model.source.name} are whole numbers that lie in terraces, with a vertical resolution "
            f"of {step * model.source.metres:g} m: slope and aspect will show the terraces' edges",
            stacklevel=3,
        )
