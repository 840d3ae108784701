"""Elevation on labelled rasters: a model of any resolution and CRS on the fine grid, or around it."""

import dataclasses
import warnings
from functools import partial

import dask.array as da
import numpy as np
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox
from scipy import ndimage

from fifesim.base.lattice import KeptTiles, assemble
from fifesim.ground.terrain import spline as kernels
from fifesim.ground.terrain.rasters.source import check_heights, open_source, placement
from fifesim.rasters import cf
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids

# Elevations are made in fixed tiles of this size. [cell]
TILE = 504

# What a model covers is looked at on so many rows and columns of the grid at most, so many rows at a time.
_LOOKS = 2000
_STRIP = 256

# A model that ends this far inside the grid is better exchanged than carried on. [m]
_NEAR = 150


def fine_dem(path_or_raster, grid, *, fill=None, vertical_units=None, chunks=None):
    """
    Elevation model on a grid, by low-pass interpolation.

    Parameters
    ----------
    path_or_raster : str, path or xarray.DataArray
        Any raster that rioxarray opens, or has opened, in any CRS and orientation; its first band is elevation. It
        should reach past the grid.
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    fill : float, optional
        Distance from known elevation up to which holes are interpolated, and the model is carried on past its edge. [m]
    vertical_units : str, optional
        Of the elevations, where they are not metres: "ft", "us-ft" and others; wins over what the file says.
    chunks : mapping or int or "auto", optional
        Makes the result lazy, as it is without where the raster is.

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        With the mean size of the model's cells, or of the blocks that they are averaged to, as attribute
        ``source_resolution``. [m]

    Raises
    ------
    ValueError
        If the model does not cover the grid, has holes, no CRS, or other units than metres that are not given, or needs
        a change of datum whose accuracy is unknown. For a lazy raster what it covers is known when computed.

    Notes
    -----
    Wavelengths above five cells of the source are recovered within 1e-3 of their amplitude, planes exactly. Cells of
    the source less than two thirds of the grid's are averaged first. Heights keep their vertical datum.

    See Also
    --------
    fifesim.ground.terrain.spline.spline_coefficients, fifesim.ground.terrain.spline.spline_grid
    """
    model = _Model.of(path_or_raster, grid, fill, vertical_units)
    if isinstance(model.source.cells, da.Array):
        out = _from_lazy(model, grid, "auto" if chunks is None else chunks)
    else:
        _check_cover(model, grid)
        _warn_of_terraces(model, grid)
        out = chunking.tiles(partial(_known_cells, model, model.tiles()), grid, chunks, tile=TILE)
    return cf.label(
        out,
        "dem",
        history=f"fine_dem: {model.source.name}, cells of {model.resolution:.4g} m, quintic spline",
        source_resolution=model.resolution,
    )


def source_dem(path_or_raster, grid, margin, *, fill=None, vertical_units=None):
    """
    Elevation model around a grid, at about its own resolution; for horizons.

    Parameters
    ----------
    path_or_raster, grid, fill, vertical_units
        As in `fine_dem`.
    margin : float
        Distance from the grid that is wanted on each side. [m]

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        In memory. Its cells are whole multiples of the grid's, from the grid's corner; it reaches up to the margin and
        as far as the model does. NaN where unknown. [m]
    reach : dict of str to float
        How far the elevation is known without a gap beside all of the ``north``, ``east``, ``south`` and ``west`` side
        of the grid, up to the margin. [m]

    Raises
    ------
    ValueError
        As in `fine_dem`, but not for what the model lacks, unless that is all.
    """
    model = _Model.of(path_or_raster, grid, fill, vertical_units)
    coarse, around = _coarse_grid(grid, model.resolution, margin)
    if isinstance(model.source.cells, da.Array):
        source = dataclasses.replace(model.source, cells=model.source.cells.compute())
        model = dataclasses.replace(model, source=source)
    model = dataclasses.replace(model, place=placement(model.source, coarse))
    values = model.cells(model.tiles(), 0, 0, tuple(coarse.shape))
    if not np.isfinite(values).any():
        raise ValueError(f"{model.source.name} does not reach the grid, which spans {grids.extent(grid)}")
    reach = _reach(np.isfinite(values), around, grids.cell_size(coarse))
    kept = _with_data(np.isfinite(values), around)
    dem = grids.place(xr.DataArray(values[kept], dims=("y", "x")), coarse[kept])
    history = f"source_dem: {model.source.name}, cells of {model.resolution:.4g} m, {margin:g} m around the grid"
    return cf.label(dem, "dem", history=history, source_resolution=model.resolution), reach


@dataclasses.dataclass(frozen=True, eq=False)
class _Model:
    """A source under a grid: where it lies, how many of its cells are averaged, and how far gaps are filled."""

    source: object
    place: object
    blocks: tuple[int, int]
    fill: tuple[float, float]
    resolution: float

    @classmethod
    def of(cls, raster, grid, fill, vertical_units):
        grids.check_grid(grid)
        if fill is not None and (isinstance(fill, bool) or not fill > 0):
            raise ValueError(
                f"fill is a distance from known elevation, above 0 m, got {fill!r}: give for instance fill=60"
            )
        source = open_source(raster, vertical_units)
        place = placement(source, grid)
        sizes = place.cell_size()
        blocks = tuple(max(1, round(float(np.mean(grids.cell_size(grid))) / size)) for size in sizes)
        resolution = round(float(np.mean([count * size for count, size in zip(blocks, sizes, strict=True)])), 6)
        return cls(source, place, blocks, tuple((fill or 0) / size for size in sizes), resolution)

    def tiles(self):
        """The function that makes a tile, which keeps the last ones."""
        return KeptTiles(partial(self._tile, *grids.lattice_position(self.place.grid)))

    def cells(self, make_tile, first_row, first_column, shape):
        """Elevation from a row and column of the grid on; NaN where unknown."""
        row, column = grids.lattice_position(self.place.grid)
        return assemble(make_tile, TILE, row + first_row, column + first_column, shape)

    def window(self, rows, columns):
        """First row and column, and size, of the source cells that positions need, in whole blocks."""
        found = []
        parts = zip((rows, columns), self.blocks, self.fill, self.source.shape, strict=True)
        for positions, count, fill, size in parts:
            low, high = ((edge + 0.5) / count - 0.5 for edge in (positions.min(), positions.max()))
            # A hole, and the cells around it that shape what fills it, must be seen whole.
            around = kernels.MARGIN + int(np.ceil((2 * fill + 6) / count) if fill else 0)
            # Beyond its margin the model says nothing.
            first = max(int(np.floor(low)) - 2, -around) - around
            last = min(int(np.floor(high)) + 4, -(-size // count) + around) + around
            found.append((first * count, max(last - first, 0) * count))
        (top, height), (left, width) = found
        return top, left, height, width

    def read(self, top, left, height, width):
        """Source cells with their gaps filled; NaN where unknown."""
        values = self.source.read(top, left, height, width)
        return kernels.fill_gaps(values, self.fill) if any(self.fill) else values

    def _tile(self, row, column, tile_row, tile_column):
        down, across = self.blocks
        cells = np.arange(TILE)
        rows, columns = self.place.positions(tile_row * TILE - row + cells, tile_column * TILE - column + cells)
        top, left, height, width = self.window(rows, columns)
        values = self.read(top, left, height, width)
        known = np.isfinite(values)
        if not known.any():
            return np.full((TILE, TILE), np.nan)
        found = _looked_up(known, rows - top, columns - left)
        # Places past the window are unknown; they are moved into it to be passed over.
        rows, columns = (
            rows.clip(top + 3 * down, top + height - 4 * down),
            columns.clip(left + 3 * across, left + width - 4 * across),
        )
        if down > 1 or across > 1:
            values = kernels.block_means(kernels.extend(values, 2 * max(self.blocks), rest=False), down, across)
        coefficients = kernels.spline_coefficients(kernels.extend(values, kernels.MARGIN))
        in_blocks = (rows - top + 0.5) / down - 0.5, (columns - left + 0.5) / across - 0.5
        if self.place.parallel:
            out = kernels.spline_grid(coefficients, *(axis.ravel() for axis in in_blocks))
        else:
            out = kernels.spline_points(coefficients, *in_blocks)
        return np.where(found, out, np.nan)


def _known_cells(model, make_tile, first_row, first_column, shape):
    """Cells of a grid that a model has to cover."""
    values = model.cells(make_tile, first_row, first_column, shape)
    unknown = ~np.isfinite(values)
    check_heights(model.source.name, values)
    if unknown.any():
        grid = model.place.grid[first_row : first_row + shape[0], first_column : first_column + shape[1]]
        _raise_for_gaps(model, grid, unknown, np.arange(shape[0]), np.arange(shape[1]))
    return values


def _from_lazy(model, grid, chunks):
    """The elevation of a lazy source: each chunk gets the window of it that its tiles read."""
    layout = chunking.tiles(lambda *place: None, grid, chunks, tile=TILE).chunks
    row, column = grids.lattice_position(grid)
    data = model.source.cells
    lines = []
    for rows in _slices(layout[0]):
        line = []
        for columns in _slices(layout[1]):
            ends = [
                np.array(
                    [(start + part.start) // TILE * TILE - start, -(-(start + part.stop) // TILE) * TILE - start - 1]
                )
                for start, part in ((row, rows), (column, columns))
            ]
            outline = [np.linspace(*pair, 17).round().astype(int) for pair in ends]
            top, left, height, width = model.window(*model.place.positions(*outline))
            # A curved edge may bulge between the points of the outline.
            window = [
                slice(min(max(start - 2, 0), size), max(min(start + length + 2, size), 0))
                for start, length, size in zip((top, left), (height, width), data.shape, strict=True)
            ]
            shape = rows.stop - rows.start, columns.stop - columns.start
            make = partial(_lazy_block, model, tuple(part.start for part in window), rows.start, columns.start, shape)
            block = data[tuple(window)]
            if 0 in block.shape:
                block = da.full((1, 1), np.nan)
            line.append(block.rechunk(-1).map_blocks(make, dtype=float, chunks=tuple((size,) for size in shape)))
        lines.append(line)
    return grids.place(xr.DataArray(da.block(lines), dims=("y", "x")), grid)


def _lazy_block(model, origin, first_row, first_column, shape, cells):
    source = dataclasses.replace(model.source, cells=cells, origin=origin)
    whole = dataclasses.replace(model, source=source, place=dataclasses.replace(model.place, source=source))
    return _known_cells(whole, whole.tiles(), first_row, first_column, shape)


def _slices(sizes):
    ends = np.cumsum(sizes).tolist()
    return [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]


def _check_cover(model, grid):
    """Refuse a model that lacks what the grid needs, before anything is made of it."""
    step = max(0.5 * model.resolution / max(model.blocks) / min(grids.cell_size(grid)), 1.0)
    looks = [
        np.unique(np.linspace(0, size - 1, min(int(size / step) + 2, _LOOKS)).round().astype(int))
        for size in grid.shape
    ]
    unknown = []
    for first in range(0, looks[0].size, _STRIP):
        rows, columns = model.place.positions(looks[0][first : first + _STRIP], looks[1])
        top, left, height, width = model.window(rows, columns)
        unknown.append(~_looked_up(np.isfinite(model.read(top, left, height, width)), rows - top, columns - left))
    unknown = np.concatenate(unknown)
    if unknown.any():
        _raise_for_gaps(model, grid, unknown, *looks)


def _looked_up(known, rows, columns):
    """Whether the cells are known in which places lie; those beyond all are not."""
    if not known.size:
        return np.zeros(np.broadcast_shapes(rows.shape, columns.shape), bool)
    row, column = np.rint(rows).astype(int), np.rint(columns).astype(int)
    inside = (row >= 0) & (row < known.shape[0]) & (column >= 0) & (column < known.shape[1])
    return inside & known[row.clip(0, known.shape[0] - 1), column.clip(0, known.shape[1] - 1)]


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
        east, north = grids.transform_points(grid.affine, middle[1] + 0.5, middle[0] + 0.5)
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


def _warn_of_terraces(model, grid):
    """Warn of elevations in whole numbers that lie in terraces, from the middle of the grid."""
    middle = [np.array([size // 2]) for size in grid.shape]
    top, left, height, width = model.window(*model.place.positions(*middle))
    around = 200
    values = model.source.read(top - around, left - around, height + 2 * around, width + 2 * around)
    step = kernels.terrace_step(values / model.source.metres)
    if step is not None:
        warnings.warn(
            f"the elevations of {model.source.name} are whole numbers that lie in terraces, with a vertical resolution "
            f"of {step * model.source.metres:g} m: slope and aspect will show the terraces' edges",
            stacklevel=3,
        )


def _coarse_grid(grid, resolution, margin):
    """Grid of whole multiples of a grid's cells that covers it and a margin, and the rows and columns of the margin."""
    if not margin >= 0:
        raise ValueError(f"the margin must be 0 m or more, got {margin:g}")
    sizes = grids.cell_size(grid)
    counts = [max(1, round(resolution / size)) for size in sizes]
    down, across = (count * size for count, size in zip(counts, sizes, strict=True))
    rows, columns = int(np.ceil(margin / down)), int(np.ceil(margin / across))
    inner = [-(-size // count) for size, count in zip(grid.shape, counts, strict=True)]
    affine = Affine(across, 0, grid.affine.c - columns * across, 0, -down, grid.affine.f + rows * down)
    return GeoBox((inner[0] + 2 * rows, inner[1] + 2 * columns), affine, grid.crs), (rows, columns)


def _reach(known, around, sizes):
    (rows, columns), (down, across) = around, sizes
    inner = known[rows : known.shape[0] - rows, columns : known.shape[1] - columns]
    sides = {
        "north": (known[:rows, columns : columns + inner.shape[1]][::-1], down),
        "east": (known[rows : rows + inner.shape[0], columns + inner.shape[1] :].T, across),
        "south": (known[rows + inner.shape[0] :, columns : columns + inner.shape[1]], down),
        "west": (known[rows : rows + inner.shape[0], :columns].T[::-1], across),
    }
    return {
        side: float(np.logical_and.accumulate(strip.all(axis=1)).sum() * cell) for side, (strip, cell) in sides.items()
    }


def _with_data(known, around):
    """Slices without the rows and columns of the margin that are empty."""
    parts = []
    for axis, margin in enumerate(around):
        found = np.flatnonzero(known.any(axis=1 - axis))
        size = known.shape[axis]
        parts.append(slice(min(int(found[0]), margin), max(int(found[-1]) + 1, size - margin)))
    return tuple(parts)
