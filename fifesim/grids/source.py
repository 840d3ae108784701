"""Rasters of users, files and arrays alike, read by window, and cells of a grid that are made from them in tiles."""

from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import product, starmap
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4
from weakref import ref

import dask.array as da
import numpy as np
import pyproj
import xarray as xr
from affine import Affine
from odc.geo.geobox import GeoBox
from rasterio.enums import ColorInterp

from fifesim.base.caches import cached
from fifesim.base.files import in_a_line
from fifesim.base.lattice import assemble
from fifesim.grids import cf, projection, windows
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.inputs import storage_of, unpacked, with_band_names
from fifesim.grids.opening import RasterFile, errors_of_gdal, raster_file, sound_raster

# Larger windows and the arrays derived from them need several GB of memory. [cell]
_MOST_CELLS = 2**27


@dataclass(frozen=True, eq=False)
class Source:
    """Raster of a user with one layer: its cells, their position, and its description."""

    name: str
    cells: object  # RasterFile, or an array of any kind from the cell `origin` on
    shape: tuple[int, int]
    affine: Affine
    crs: str  # horizontal, as WKT
    token: object  # identifies the cells
    words: tuple = ()  # texts that describe the layer
    units: str = ""
    height_units: str | None = None  # of the vertical axis of the CRS
    counts: bool = False  # whether cells are whole numbers without a scale
    factor: float = 1.0  # from units of the cells to units of results
    origin: tuple[int, int] = (0, 0)

    def __dask_tokenize__(self):
        # A token of the cells would read all of them.
        return self.name, self.token, self.affine, self.crs, self.factor, self.origin

    @contextmanager
    def opened(self):
        """Context with a function that reads a window, which may exceed the source: numbers, NaN where unknown."""
        if not isinstance(self.cells, RasterFile):
            yield partial(self._read, self._array_window)
            return
        with errors_of_gdal(f"cannot read {self.cells.name}"), self.cells.opened() as file:
            yield partial(self._read, partial(self.cells.read, file))

    def _read(self, cells, rows, columns):
        size = rows.stop - rows.start, columns.stop - columns.start
        if size[0] * size[1] > _MOST_CELLS:
            raise ValueError(
                f"{self.name} is far finer than the cells, {size[0] * size[1]:.2g} of its cells lie in a tile of them: "
                "average it first, with gdalwarp -r average -tr and a cell between the two"
            )
        out = np.full(size, np.nan)
        inside = [
            slice(min(max(part.start, 0), length), max(min(part.stop, length), 0))
            for part, length in zip((rows, columns), self.shape, strict=True)
        ]
        if all(part.start < part.stop for part in inside):
            (top, left), (down, across) = (rows.start, columns.start), inside
            out[down.start - top : down.stop - top, across.start - left : across.stop - left] = (
                cells(down, across) * self.factor
            )
        return out

    def _array_window(self, rows, columns):
        top, left = self.origin
        cells = self.cells[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
        return np.asarray(cells, float)


def open_source(raster, quantity, allow_remote=False):
    """Source of a quantity of the ground: a layer of an array, or a band of a file."""
    if isinstance(raster, xr.DataArray):
        layer = one_layer(raster, quantity)
        return _array_source(layer if cf.is_counts(layer) else unpacked(layer))
    file = raster_file(raster, allow_remote)
    with sound_raster(file) as (source, crs):
        numbers = [each for each in source.indexes if source.colorinterp[each - 1] != ColorInterp.alpha]
        words = [_words_of(source, each) for each in numbers]
        index = _band_of(file.name, words, quantity)
        file, band = replace(file, band=numbers[index]), numbers[index] - 1
        if quantity != "cover" and source.colorinterp[band] == ColorInterp.palette:
            raise ValueError(
                f"{file.name} has a colour table, so that its numbers are classes, where "
                f"{cf.QUANTITIES[quantity].long_name} is needed: take a map of that quantity, or remove the table with "
                "gdal_translate -colorinterp gray"
            )
        counts = np.dtype(source.dtypes[band]).kind in "iu" and (source.scales[band], source.offsets[band]) == (1, 0)
        return Source(
            in_a_line(Path(file.path).name, 150), file, source.shape, source.transform, crs.to_wkt(),
            (file, file.state), words[index], in_a_line(source.units[band] or "", 40),
            _height_units(source.crs.to_wkt()), counts,
        )  # fmt: skip


def _array_source(raster):
    name, grid = str(raster.name or "the raster"), grids.regular_geobox(raster)
    if grid is None:
        raise ValueError(f"the x and y of {name} are not the centres of a regular grid")
    if grid.crs is None:
        raise ValueError(f"{name} has no CRS: give it one, for instance with .rio.write_crs('EPSG:26914')")
    cells = raster.transpose(*raster.odc.spatial_dims)
    lazy = cells.chunks is not None
    words = raster.name, raster.attrs.get("long_name"), raster.attrs.get("standard_name")
    wkt = grid.crs.to_wkt()
    return Source(
        in_a_line(name, 150), cells.data if lazy else cells.variable, cells.shape, grid.affine,
        pyproj.CRS.from_user_input(projection.horizontal(wkt)).to_wkt(), cells.data.name if lazy else uuid4().hex,
        words, str(raster.attrs.get("units") or ""), _height_units(wkt), not storage_of(raster)[1],
    )  # fmt: skip


def _height_units(wkt):
    crs = pyproj.CRS.from_wkt(wkt)
    axes = [axis for part in (crs, *crs.sub_crs_list) for axis in part.axis_info]
    return next((axis.unit_name for axis in axes if axis.direction in ("up", "down")), None)


def _words_of(source, band):
    """Texts that describe a band of an open file."""
    tags = source.tags(band)
    return source.descriptions[band - 1], *(tags.get(key) for key in ("NETCDF_VARNAME", "long_name", "standard_name"))


def one_layer(raster, quantity):
    """Layer of an array that holds a quantity, with the dimensions y and x only."""
    name = str(raster.name or "the raster")
    if "band" in raster.dims:
        names = with_band_names(raster)["band"].values
        raster = raster.isel(band=_band_of(name, names[:, None], quantity), drop=True)
    if raster.ndim != 2:
        raise ValueError(
            f"{name} has dimensions {raster.dims}, where {cf.QUANTITIES[quantity].long_name} has y and x: select one "
            "layer, such as .isel(time=0)"
        )
    return raster


def _band_of(raster, bands, name):
    """Index of the band whose texts name a quantity; a single band needs none."""
    texts = [[text for text in texts if isinstance(text, str)] for texts in bands]
    exactly = [index for index, each in enumerate(texts) if name in map(str.lower, each)]
    in_words = [index for index, each in enumerate(texts) if set().union(*map(cf.named, each)) == {name}]
    for found in (range(len(texts)), exactly, in_words):
        if len(found) == 1:
            return found[0]
    raise ValueError(
        f"{raster} has {len(texts)} bands, and not exactly one is described as {cf.QUANTITIES[name].long_name}: select "
        "the band, for instance with rioxarray.open_rasterio(path).sel(band=2), or gdal_translate -b 2 of a file"
    )


@dataclass(frozen=True, eq=False)
class OnGrid:
    """Cells of a grid, made in fixed tiles of the lattice from windows of a source; equal in any window and chunks."""

    source: Source
    grid: GeoBox
    back: str | None  # coordinate operation from the grid to the source

    TILE = 512  # cells along a side of a tile

    def make(self, top, left):
        """Tile from a row and column of the grid on, shape (TILE, TILE)."""
        raise NotImplementedError

    def tile_window(self, top, left):
        """Rows and columns of the source that a tile reads, None if there are none."""
        raise NotImplementedError

    def __call__(self, row, column, shape):
        """Cells from a row and column of the grid on, shape (rows, columns)."""
        first = grids.lattice_position(self.grid)
        return assemble(partial(_kept_tile, ref(self)), self.TILE, first[0] + row, first[1] + column, shape)

    def raster(self, chunks=None, *, held=False):
        """Raster of all cells, dims (y, x), lazy with chunks or of a lazy source; if held, windows of it wait."""
        lazy = isinstance(self.source.cells, da.Array)
        if not (lazy or held):
            return windows.tiles(self, self.grid, chunks, tile=self.TILE)
        of = self.reading(None) if lazy else self
        sizes = windows.chunk_sizes(self.grid, "auto" if chunks is None else chunks, tile=self.TILE)
        reads = [_TileReads(self.source.cells, of)] if lazy else []
        out = chunking.windows(of.part, reads, tuple(self.grid.shape), sizes)
        return grids.place(xr.DataArray(out, dims=("y", "x")), self.grid)

    def part(self, rows, columns, *cells):
        """Cells of some rows and columns, from the window of a lazy source that their tiles read."""
        shape, known = (rows.stop - rows.start, columns.stop - columns.start), self
        if cells:
            down, across = self.window(rows, columns)
            known = self.reading(*cells, (down.start, across.start))
        return known(rows.start, columns.start, shape)

    def window(self, rows, columns):
        """Rows and columns of the source that the tiles of a part of the grid read."""
        starts = [
            range((first + part.start) // self.TILE * self.TILE - first, part.stop, self.TILE)
            for first, part in zip(grids.lattice_position(self.grid), (rows, columns), strict=True)
        ]
        found = [each for each in starmap(self.tile_window, product(*starts)) if each]
        if not found:
            return slice(0, 0), slice(0, 0)
        return tuple(
            slice(max(min(part.start for part in parts), 0), max(min(max(part.stop for part in parts), size), 0))
            for parts, size in zip(zip(*found, strict=True), self.source.shape, strict=True)
        )

    def reading(self, cells, origin=(0, 0)):
        """Copy whose source has other cells, a window from `origin` on."""
        return replace(self, source=replace(self.source, cells=cells, origin=origin))

    def source_places(self, x, y):
        """Columns and rows of the source, from its corner, at places of the grid."""
        x, y = projection.carry(self.back, self.grid.crs.to_wkt(), self.source.crs, x, y)
        return projection.transform_points(~self.source.affine, x, y)


class _TileReads(NamedTuple):
    """Window of a lazy source that the tiles of each chunk read."""

    array: da.Array
    of: OnGrid

    def window(self, rows, columns):
        return self.of.window(rows, columns)


@cached(16, "tiles of maps and elevation models")
def _kept_tile(of, tile_row, tile_column):
    # By a weak reference, so that the source is not kept.
    found = of()
    row, column = grids.lattice_position(found.grid)
    return found.make(tile_row * found.TILE - row, tile_column * found.TILE - column)
