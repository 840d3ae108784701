"""Resampling of a source onto a grid by GDAL: its nearest cells, bilinear interpolation or averages."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from threading import Lock

import numpy as np
import rasterio.windows
from affine import Affine
from odc.geo.geobox import GeoBox
from rasterio.enums import Resampling
from rasterio.warp import reproject

from fifesim.base.arrays import compiled
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.grids.source import OnGrid

# The warper approximates positions as linear along a row, within an eighth of a file cell. For so few cells the error
# is millimetres for cells of 10 m, and a centimetre for 30 m.
_STRIP = 32

# rasterio passes the coordinate operation to the transformer, which applies it, and to the warper, which logs since
# GDAL 3.11 that it has no such option.
logging.getLogger("rasterio._env").addFilter(lambda record: "option COORDINATE_OPERATION" not in record.getMessage())

# rasterio suppresses its own warning around each call in a way that is not thread-safe.
_ONE_AT_A_TIME = Lock()

# Maximum source cells along an axis that are read at once: 100 MB, including memory of the warper. Tiles that need more
# are made in blocks.
_MUCH_FINER = 6
_LONGEST = 2048

# Bilinear interpolation reads one source cell around; an average as many as fit into a target cell.
_SOURCE_MARGIN = 4

# Maximum samples along the side of a cell for its most frequent class.
_MOST_SAMPLES = 64


def onto_grid(source, grid, chunks=None, *, classes=False, check=None):
    """Source on a grid, dims (y, x), NaN for no data; lazy with chunks or of a lazy source."""
    # Bilinear interpolation to cells up to the size of the source cells, averages for larger cells; a source on the
    # same grid is taken as it is.
    grids.check_grid(grid)
    area, target = projection.degrees(grid), grid.crs.to_wkt()
    pipeline, back = projection.operation(source.crs, target, area), projection.operation(target, source.crs, area)
    found = _Resampled(source, grid, back, pipeline, classes, check)
    if found.reads(grid) is None:
        raise ValueError(
            f"{source.name} does not overlap the grid, which spans {grids.extent(grid)} in "
            f"{projection.name_of(grid.crs.proj)}: it spans "
            f"{projection.lies_in_words(source.affine, source.shape, source.crs)}"
        )
    return found.raster(chunks)


@dataclass(frozen=True, eq=False)
class _Resampled(OnGrid):
    pipeline: str | None  # coordinate operation from the source to the grid
    classes: bool
    check: Callable | None  # of the name and the cells of the source on the grid or next to it

    def places(self, part):
        """Rows and columns of the source at the outline of a part of the lattice, and at its middle."""
        share = np.linspace(0, 1, 17)
        columns, rows = (values.ravel() for values in np.meshgrid(share * part.shape.x, share * part.shape.y))
        columns, rows = self.source_places(*projection.transform_points(part.affine, columns, rows))
        return rows, columns

    def reads(self, part):
        """Rows and columns of the source that a part reads, None if there are none or the CRS is not valid there."""
        places = self.places(part)
        if not np.isfinite(places).all():
            return None
        found = [
            slice(max(int(np.min(at)) - _SOURCE_MARGIN, 0), min(int(np.max(at)) + _SOURCE_MARGIN + 1, size))
            for at, size in zip(places, self.source.shape, strict=True)
        ]
        return found if all(each.stop > each.start for each in found) else None

    def tile_window(self, top, left):
        found = self.reads(self.square(top, left, self.TILE))
        # The window of a block may exceed the window of its tile because of map curvature.
        return found and [slice(each.start - _SOURCE_MARGIN, each.stop + _SOURCE_MARGIN) for each in found]

    def square(self, row, column, size):
        """Square of the lattice, which may exceed the grid."""
        a = self.grid.affine
        west, north = projection.transform_points(a, column, row)
        return GeoBox((size, size), Affine(a.a, 0.0, west, 0.0, a.e, north), self.grid.crs)

    def cells_per_cell(self, part):
        """Number of source cells in one cell of the grid, down or across, where it is larger."""
        return max(np.ptp(each) / size for each, size in zip(self.places(part), part.shape, strict=True))

    def make(self, top, left):
        out, grid = np.full((self.TILE, self.TILE), np.nan), self.grid
        finer = self.cells_per_cell(grid) > 1.01
        # Based on the tile, not the grid, so that it is the same in every window.
        cells = self.cells_per_cell(self.square(top, left, self.TILE))
        size, samples = _block_size(cells, self.TILE), _samples(cells) if self.classes and finer else 1
        larger = Resampling.average if finer else Resampling.bilinear
        options = {"resampling": Resampling.nearest if self.classes else larger}
        options |= {"src_nodata": np.nan, "dst_nodata": np.nan}
        options |= {"COORDINATE_OPERATION": self.pipeline} if self.pipeline else {}
        for crs, each in (("src_crs", self.source.crs), ("dst_crs", grid.crs.to_wkt())):
            options[crs] = rasterio.crs.CRS.from_wkt(each)
        with self.source.opened() as read:
            for down, across in product(range(0, self.TILE, size), repeat=2):
                # Blocks outside of the grid stay empty.
                if -size < top + down < grid.shape.y and -size < left + across < grid.shape.x:
                    block = self._block(read, top + down, left + across, size, samples, options)
                    out[down : down + size, across : across + size] = block
        return out

    def _block(self, read, row, column, size, samples, options):
        """Block of cells from one window of the source; with several samples, the most frequent value of each cell."""
        block, out = self.square(row, column, size), np.full((size, size), np.nan)
        window, a = self.reads(block), block.affine
        if window is None:
            return out
        values = read(*window)
        # A slice of a GeoBox may exceed it.
        bottom, right = (min(at + size, end) for at, end in zip((row, column), self.grid.shape, strict=True))
        on_grid = self.grid[max(row, 0) : bottom, max(column, 0) : right]
        if self.check is not None and (inside := self.reads(on_grid)):
            (top, down), (left, across) = (
                (max(part.start - whole.start, 0), part.stop - part.start)
                for part, whole in zip(inside, window, strict=True)
            )
            self.check(self.source.name, values[top : top + down, left : left + across])
        origin = rasterio.windows.transform(rasterio.windows.Window.from_slices(*window), self.source.affine)
        for first in range(0, size, _STRIP):
            strip = np.full((size * samples, min(size, _STRIP) * samples), np.nan)
            transform = Affine(a.a / samples, 0.0, a.c + first * a.a, 0.0, a.e / samples, a.f)
            with _ONE_AT_A_TIME:
                reproject(values, strip, src_transform=origin, dst_transform=transform, **options)
            out[:, first : first + _STRIP] = strip if samples == 1 else _most_frequent(strip, samples)
        return out


def _block_size(cells, tile):
    """Number of cells along a block that is read at once, by the number of source cells per cell."""
    if cells <= _MUCH_FINER:
        return tile
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
