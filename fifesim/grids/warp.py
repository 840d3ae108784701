"""Resampling of a raster file onto a grid, by an operation of known accuracy between the two CRSs."""

import logging
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from threading import Lock
from typing import NamedTuple

import dask.array as da
import numpy as np
import rasterio
import rasterio.windows
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox
from rasterio.enums import Resampling
from rasterio.warp import reproject

from fifesim.base.arrays import compiled
from fifesim.base.caches import cached
from fifesim.base.lattice import assemble
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids import projection, windows
from fifesim.grids.grid import regular_geobox
from fifesim.grids.opening import sound_raster
from fifesim.grids.projection import lies_in_words

# Cells are made in fixed tiles of this size, so that the warper's rounding is the same under any chunking.
_TILE = 512

# The warper approximates positions as linear along a row, within an eighth of a file cell. For so few cells the error
# is millimetres for cells of 10 m, and a centimetre for 30 m.
_STRIP = 32

# rasterio passes the coordinate operation to the transformer, which applies it, and to the warper, which logs since
# GDAL 3.11 that it has no such option.
logging.getLogger("rasterio._env").addFilter(lambda record: "option COORDINATE_OPERATION" not in record.getMessage())

# rasterio suppresses its own warning around each call in a way that is not thread-safe.
_ONE_AT_A_TIME = Lock()

# Maximum file cells along an axis that are read at once: 100 MB, including memory of the warper. Tiles that need more
# are made in blocks.
_MUCH_FINER = 6
_LONGEST = 2048
_MOST_CELLS = 2**26

# Bilinear interpolation reads one source cell around; an average as many as fit into a target cell.
_SOURCE_MARGIN = 4


# Maximum samples along the side of a cell for its most frequent class.
_MOST_SAMPLES = 64


def file_onto_grid(file, grid, chunks=None, *, classes=False, check=None):
    """Band of a checked raster file on a grid, dims (y, x), NaN for no data."""
    # Bilinear interpolation to cells up to the size of the file cells, averages for larger cells; a file on the same
    # grid is read directly.
    grids.check_grid(grid)
    with sound_raster(file) as (source, crs):
        pipeline, back = _operations(source, crs, grid, file.name)
    # A changed file is a different file for the cache.
    make_tile = partial(_warp_tile, file, file.state, grid, pipeline, back, classes, check)
    row, column = grids.lattice_position(grid)

    def kernel(first_row, first_column, shape):
        return assemble(make_tile, _TILE, row + first_row, column + first_column, shape)

    return windows.tiles(kernel, grid, chunks, tile=_TILE)


def raster_onto_grid(raster, grid, chunks=None, *, classes=False, check=None):
    """Raster on a grid, resampled as in `file_onto_grid`, dims (y, x), NaN for no data."""
    grids.check_grid(grid)
    source, crs = _array_source(raster)
    pipeline, back = _operations(source, crs, grid, source.name)
    row, column = grids.lattice_position(grid)
    reads = _TileReads(source.cells, replace(source, cells=None), crs, grid, back)

    def kernel(rows, columns, cells):
        down, across = reads.window(rows, columns)
        known = replace(reads.source, cells=cells, first=(down.start, across.start))
        make_tile = partial(_tile, known, crs, known, grid, pipeline, back, classes, check)
        shape = rows.stop - rows.start, columns.stop - columns.start
        return assemble(make_tile, _TILE, row + rows.start, column + columns.start, shape)

    lazy = chunks is not None or isinstance(source.cells, da.Array)
    sizes = windows.chunk_sizes(grid, "auto" if chunks is None else chunks, tile=_TILE) if lazy else None
    made = chunking.windows(kernel, [reads], tuple(grid.shape), sizes)
    return grids.place(xr.DataArray(made, dims=("y", "x")), grid)


@dataclass(frozen=True, eq=False)
class _ArraySource:
    """Array with a known window, in the form of an open file for the warper."""

    name: str
    cells: np.ndarray | da.Array | None
    shape: tuple[int, int]
    transform: Affine
    first: tuple[int, int] = (0, 0)

    def read(self, source, window):
        top, left = int(window.row_off - self.first[0]), int(window.col_off - self.first[1])
        return np.array(self.cells[top : top + int(window.height), left : left + int(window.width)], float)


class _TileReads(NamedTuple):
    """Window of an array that the tiles of each chunk read."""

    array: np.ndarray | da.Array
    source: _ArraySource
    crs: object
    grid: GeoBox
    back: str | None

    def window(self, rows, columns):
        row, column = grids.lattice_position(self.grid)
        tops = range((row + rows.start) // _TILE * _TILE - row, rows.stop, _TILE)
        lefts = range((column + columns.start) // _TILE * _TILE - column, columns.stop, _TILE)
        tiles = (_part(self.grid, top, left, _TILE) for top, left in product(tops, lefts))
        found = [_source_window(self.source, self.crs, tile, self.back) for tile in tiles]
        found = [window for window in found if window is not None]
        if not found:
            return slice(0, 0), slice(0, 0)
        # The window of a block may exceed the window of its tile because of map curvature.
        (top, bottom), (left, right) = rasterio.windows.union(*found).toranges()
        (height, width), around = self.source.shape, _SOURCE_MARGIN
        rows = slice(max(int(top) - around, 0), min(int(bottom) + around, height))
        return rows, slice(max(int(left) - around, 0), min(int(right) + around, width))


def _array_source(raster):
    """Array as a source of cells, and its CRS."""
    name = str(raster.name or "the raster")
    found = regular_geobox(raster)
    if found is None or raster.odc.crs is None:
        raise ValueError(f"{name} has no regular grid or no CRS: give it one with .rio.write_crs('EPSG:26914')")
    cells = raster.transpose(*raster.odc.spatial_dims).data
    crs = projection.horizontal(raster.odc.crs.to_wkt())
    return _ArraySource(name, cells, cells.shape, found.affine), rasterio.crs.CRS.from_user_input(crs)


def _operations(source, crs, grid, name):
    """Coordinate operations from a source to a grid and back; a source that does not overlap raises ValueError."""
    area, target = projection.degrees(grid), grid.crs.to_wkt()
    pipeline, back = projection.operation(crs, target, area), projection.operation(target, crs, area)
    if _source_window(source, crs, grid, back) is None:
        lies = lies_in_words(source.transform, source.shape, crs)
        raise ValueError(
            f"{name} does not overlap the grid, which spans {grids.extent(grid)} in "
            f"{projection.name_of(grid.crs.proj)}: it spans {lies}"
        )
    return pipeline, back


def _source_places(source, crs, grid, back):
    """Rows and columns of a file at the outline of a grid, and at its middle."""
    share = np.linspace(0, 1, 17)
    columns, rows = (values.ravel() for values in np.meshgrid(share * grid.shape.x, share * grid.shape.y))
    x, y = projection.transform_points(grid.affine, columns, rows)
    x, y = projection.carry(back, grid.crs.to_wkt(), crs, x, y)
    columns, rows = projection.transform_points(~source.transform, x, y)
    return rows, columns


def _source_window(source, crs, grid, back):
    """Window of the file that a grid reads, None if there is none or the CRS is not valid there."""
    rows, columns = _source_places(source, crs, grid, back)
    if not np.isfinite([rows, columns]).all():
        return None
    around = _SOURCE_MARGIN
    top, bottom = max(int(np.min(rows)) - around, 0), min(int(np.max(rows)) + around + 1, source.shape[0])
    left, right = max(int(np.min(columns)) - around, 0), min(int(np.max(columns)) + around + 1, source.shape[1])
    return rasterio.windows.Window(left, top, right - left, bottom - top) if bottom > top and right > left else None


def _cells_per_cell(source, crs, grid, back):
    """Number of cells of the file in one cell of the grid, down or across, where it is larger."""
    places = _source_places(source, crs, grid, back)
    return max(np.ptp(each) / size for each, size in zip(places, grid.shape, strict=True))


@cached(16, "warped tiles of files")
def _warp_tile(file, state, grid, pipeline, back, classes, check, tile_row, tile_column):
    """One lattice tile of a file, in its physical unit."""
    with sound_raster(file) as (source, crs):
        return _tile(source, crs, file, grid, pipeline, back, classes, check, tile_row, tile_column)


def _tile(source, crs, file, grid, pipeline, back, classes, check, tile_row, tile_column):
    """One lattice tile of a file or array; blocks outside of the grid stay empty."""
    row, column = grids.lattice_position(grid)
    top, left = tile_row * _TILE - row, tile_column * _TILE - column
    out = np.full((_TILE, _TILE), np.nan)
    finer = _cells_per_cell(source, crs, grid, back) > 1.01
    larger = Resampling.average if finer else Resampling.bilinear
    options = {"src_crs": crs, "dst_crs": rasterio.crs.CRS.from_wkt(grid.crs.to_wkt())}
    options |= {"src_nodata": np.nan, "dst_nodata": np.nan, "resampling": Resampling.nearest if classes else larger}
    options |= {"COORDINATE_OPERATION": pipeline} if pipeline else {}
    # Based on the tile, not the grid, so that it is the same in every window.
    cells = _cells_per_cell(source, crs, _part(grid, top, left, _TILE), back)
    size, samples = _block_size(cells), _samples(cells) if classes and finer else 1
    for down, across in product(range(0, _TILE, size), repeat=2):
        first, start = top + down, left + across
        if -size < first < grid.shape.y and -size < start < grid.shape.x:
            block = _part(grid, first, start, size)
            # The part of the block that is on the grid.
            rows = slice(max(first, 0), min(first + size, grid.shape.y))
            columns = slice(max(start, 0), min(start + size, grid.shape.x))
            inside = None if check is None else _source_window(source, crs, grid[rows, columns], back)
            checked = (inside, check) if inside else None
            filled = _warp_block(source, file, block, back, options, samples, checked)
            out[down : down + size, across : across + size] = filled
    return out


def _part(grid, row, column, size):
    """Square of the lattice of a grid, which may exceed the grid."""
    west, north = projection.transform_points(grid.affine, column, row)
    return GeoBox((size, size), Affine(grid.affine.a, 0.0, west, 0.0, grid.affine.e, north), grid.crs)


def _block_size(cells):
    """Number of cells along a block that is read at once, by the number of source cells per cell."""
    if cells <= _MUCH_FINER:
        return _TILE
    size = _STRIP
    while size > 1 and size * cells > _LONGEST:
        size //= 2
    return size


def _samples(cells):
    """Samples along a side of a cell: a multiple of its number of source cells, odd for each of them."""
    # At 1.1 source cells per cell, five samples miss the class with the largest area in 1 % of the cells where it leads
    # by 5 to 10 %. GDAL's mode counts every touched source cell as a whole one and misses 17 % (GDAL 3.12) or 33 %
    # (3.10) of these.
    along = max(round(cells), 1) if np.isfinite(cells) else 1
    return min(along * (5 if along == 1 else 3 if along < 8 else 1), _MOST_SAMPLES)


@compiled
def _most_frequent(values, samples):
    """Most frequent value among samples x samples neighbours, the smallest if tied; NaN is skipped."""
    out = np.full((values.shape[0] // samples, values.shape[1] // samples), np.nan)
    found, counts = np.empty(samples * samples), np.empty(samples * samples, np.int64)
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            kinds, most = 0, 0
            for i in range(row * samples, (row + 1) * samples):
                for j in range(column * samples, (column + 1) * samples):
                    value, kind = values[i, j], 0
                    while kind < kinds and found[kind] != value:
                        kind += 1
                    if kind == kinds and value == value:
                        found[kind], counts[kind], kinds = value, 0, kinds + 1
                    if value == value:
                        counts[kind] += 1
            for kind in range(kinds):
                if counts[kind] > most or (counts[kind] == most and found[kind] < out[row, column]):
                    most, out[row, column] = counts[kind], found[kind]
    return out


def _warp_block(source, file, block, back, options, samples, checked):
    """Block of cells from one window of the file; with several samples, the most frequent value of each cell."""
    # `checked` is a part of the window, and the function that checks it.
    size, a = block.shape.x, block.affine
    out = np.full((size, size), np.nan)
    window = _source_window(source, options["src_crs"], block, back)
    if window is None:
        return out
    if window.width * window.height > _MOST_CELLS:
        raise ValueError(
            f"{file.name} is far finer than the cells, {window.width * window.height:.2g} of its cells lie in {size} x "
            f"{size}: average it first, with gdalwarp -r average -tr and a cell between the two"
        )
    values = file.read(source, window)
    if checked is not None:
        part, check = checked
        top, left = (max(int(at), 0) for at in (part.row_off - window.row_off, part.col_off - window.col_off))
        check(file.name, values[top : top + int(part.height), left : left + int(part.width)])
    for first in range(0, size, _STRIP):
        strip = np.full((size * samples, min(size, _STRIP) * samples), np.nan)
        transform = Affine(a.a / samples, 0.0, a.c + first * a.a, 0.0, a.e / samples, a.f)
        with _ONE_AT_A_TIME:
            origin = rasterio.windows.transform(window, source.transform)
            reproject(values, strip, src_transform=origin, dst_transform=transform, **options)
        out[:, first : first + _STRIP] = strip if samples == 1 else _most_frequent(strip, samples)
    return out
