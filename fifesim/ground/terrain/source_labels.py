"""Sources of elevation: raster files and arrays read by window, their units and grid, and the spline under a grid."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from uuid import uuid4

import dask.array as da
import numpy as np
import pyproj
import rasterio.windows
import rioxarray  # noqa: F401  registers .rio
import xarray as xr
from affine import Affine
from scipy import ndimage

from fifesim.base.files import in_a_line
from fifesim.base.lattice import KeptTiles, assemble, centres
from fifesim.base.messages import warn
from fifesim.grids import cf, projection
from fifesim.grids import grid as grids
from fifesim.grids.grid import regular_geobox
from fifesim.grids.opening import ErrorsOfGdal, RasterFile
from fifesim.ground.layer_labels import file_of, one_layer, words_of
from fifesim.ground.terrain import spline
from fifesim.ground.terrain.slope import metres_per_unit

# Positions in another CRS are a polynomial through this number of Chebyshev nodes along each axis of a tile.
_NODES = 12

# Elevations of exactly 0 among others that are all farther from it may be voids. [m]
_CLIFF = 50.0

# Larger windows and the arrays derived from them need several GB of memory. [cell]
_MOST_CELLS = 2**27


class ByWindow:
    """Cells of a raster in memory, or of an open file, which is read in windows without a cache."""

    def __init__(self, raster):
        self._cells, self._token = raster.variable, uuid4().hex
        self.shape = raster.shape

    def __getitem__(self, window):
        return np.asarray(self._cells[window])

    def __dask_tokenize__(self):
        # A token of the cells would read all of them.
        return self._token


@dataclass(frozen=True, eq=False)
class Source:
    """Elevation model: its cells, their size and position, and metres per unit."""

    name: str
    cells: RasterFile | ByWindow | np.ndarray | da.Array
    shape: tuple[int, int]
    affine: Affine
    crs: pyproj.CRS
    metres: float
    origin: tuple[int, int] = (0, 0)

    def read(self, top, left, rows, columns):
        """Elevations of a window, which may exceed the model, NaN where unknown, shape (rows, columns). [m]"""
        if rows * columns > _MOST_CELLS:
            raise ValueError(
                f"{self.name} is far finer than the cells, {rows * columns:.2g} of its cells lie in a tile of them: "
                "average it first, with gdalwarp -r average -tr and a cell between the two"
            )
        out = np.full((rows, columns), np.nan)
        (first, last), (west, east) = (
            (min(max(start, 0), size), max(min(start + length, size), 0))
            for start, length, size in ((top, rows, self.shape[0]), (left, columns, self.shape[1]))
        )
        if first < last and west < east:
            window = slice(first, last), slice(west, east)
            read = _file_window if isinstance(self.cells, RasterFile) else self._array_window
            heights = read(self.cells, *window) * self.metres
            out[first - top : last - top, west - left : east - left] = heights
            check_heights(self.name, heights)
        return out

    def _array_window(self, cells, rows, columns):
        top, left = self.origin
        return np.asarray(cells[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left], float)


def open_source(raster, vertical_units=None, allow_remote=False):
    """Elevation model from a file or an array."""
    if isinstance(raster, xr.DataArray):
        return _array_source(raster, vertical_units)
    if not isinstance(raster, str | Path):
        raise TypeError(f"an elevation model is a path or an xarray.DataArray, got {type(raster).__name__}")
    file = file_of("dem", raster, allow_remote)
    name = in_a_line(Path(file.path).name, 150)
    with ErrorsOfGdal(f"cannot read {file.name}"), file.opened() as opened:
        cf.check_words(name, words_of(opened, file.band), "dem")
        source = Source(name, file, opened.shape, opened.transform, None, 1.0)
        return _in_metres(source, opened.crs.to_wkt(), in_a_line(opened.units[file.band - 1] or "", 40), vertical_units)


def _array_source(raster, vertical_units):
    raster, name = one_layer(raster, "dem"), str(raster.name or "the elevation model")
    cf.check_words(name, (raster.name, raster.attrs.get("long_name")), "dem")
    crs = raster.rio.crs
    found = regular_geobox(raster)
    if found is None:
        raise ValueError(f"the x and y of {name} are not the centres of a regular grid")
    raster = raster.transpose(*raster.odc.spatial_dims)
    cells = ByWindow(raster) if raster.chunks is None else raster.data
    source = Source(name, cells, cells.shape, found.affine, None, 1.0)
    return _in_metres(source, crs.to_wkt() if crs else None, raster.attrs.get("units"), vertical_units)


def _in_metres(source, wkt, unit, vertical_units):
    """Source with its horizontal CRS and the metres per unit."""
    if wkt is None:
        raise ValueError(
            f"{source.name} has no CRS: give it one, for instance with gdal_edit.py -a_srs EPSG:26914 or "
            ".rio.write_crs('EPSG:26914')"
        )
    crs = pyproj.CRS.from_wkt(wkt)
    parts = crs.sub_crs_list or [crs]
    vertical = [axis.unit_name for part in (crs, *parts) for axis in part.axis_info if axis.direction in ("up", "down")]
    unit = unit or (vertical[0] if vertical else "metre")
    if vertical_units is None:
        try:
            metres = metres_per_unit(unit)
        except ValueError:
            metres = None
        if metres != 1.0:
            raise ValueError(
                f"{source.name} says that its elevations are in {unit!r}, not in metres: give their units, for "
                f"instance vertical_units='us-ft', and they are converted, or vertical_units='m' if it is wrong"
            )
    horizontal = parts[0].to_2d() if len(parts[0].axis_info) > 2 else parts[0]
    return replace(source, crs=horizontal, metres=metres_per_unit(vertical_units or unit))


def _file_window(file, rows, columns):
    window = rasterio.windows.Window(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
    task = f"cannot read rows {rows.start} to {rows.stop} and columns {columns.start} to {columns.stop} of {file.name}"
    with ErrorsOfGdal(task), file.opened() as opened:
        return file.read(opened, window)


@dataclass(frozen=True, eq=False)
class Placement:
    """Position of the cells of a grid in a source, in source cells from the centre of the first."""

    source: Source
    grid: object
    pipeline: str | None

    @property
    def parallel(self):
        """Whether rows and columns of the grid are parallel to those in the source."""
        return self.pipeline is None and not (self.source.affine.b or self.source.affine.d)

    def positions(self, rows, columns):
        """Positions of cells of the grid in the source, shape (m, 1), (1, n) if parallel, else (m, n). [cell]"""
        a = self.grid.affine
        y, x = centres(a.f, a.e, rows), centres(a.c, a.a, columns)
        if self.parallel:
            inverse = ~self.source.affine
            return (inverse.e * y + inverse.f - 0.5)[:, None], (inverse.a * x + inverse.c - 0.5)[None, :]
        (y_nodes, from_y), (x_nodes, from_x) = _chebyshev(y), _chebyshev(x)
        across, down = self._source_cells(*np.meshgrid(x_nodes, y_nodes))
        return from_y @ (down - 0.5) @ from_x.T, from_y @ (across - 0.5) @ from_x.T

    def cell_size(self):
        """Size of a source cell in the middle of the grid, down and across. [m]"""
        x, y = projection.transform_points(self.grid.affine, self.grid.shape.x / 2, self.grid.shape.y / 2)
        step = 10.0
        columns, rows = self._source_cells(np.array([x, x + step, x]), np.array([y, y, y + step]))
        return tuple(float(step / np.hypot(*(axis[1:] - axis[0]))) for axis in (rows, columns))

    def _source_cells(self, x, y):
        if self.pipeline is not None:
            x, y = projection.carry(self.pipeline, self.grid.crs.to_wkt(), self.source.crs, x, y)
        return projection.transform_points(~self.source.affine, x, y)


def placement(source, grid):
    """Position of a grid in a source, by a coordinate operation of known accuracy."""
    return Placement(source, grid, projection.operation(grid.crs.to_wkt(), source.crs, projection.degrees(grid)))


def _chebyshev(values):
    """Chebyshev nodes over the range of some values, and the interpolation matrix from nodes to values."""
    middle, half = (values.max() + values.min()) / 2, max(np.ptp(values) / 2, 1.0)
    nodes = np.polynomial.chebyshev.chebpts1(_NODES)
    matrix = np.linalg.solve(
        np.polynomial.chebyshev.chebvander(nodes, _NODES - 1).T,
        np.polynomial.chebyshev.chebvander((values - middle) / half, _NODES - 1).T,
    ).T
    return middle + half * nodes, matrix


def check_heights(name, values):
    """Raise ValueError for heights that do not occur on land, and warn of voids of 0."""
    # Whole numbers have no infinity, and unsigned ones no difference.
    values, land = np.asarray(values, float), cf.QUANTITIES["dem"]
    wrong = values[(values < land.lowest) | (values > land.highest)]
    if wrong.size:
        raise ValueError(
            f"{name} holds elevations such as {wrong.flat[0]:.0f} m, land has {land.lowest} to {land.highest} m: if it "
            "marks no data, declare it (gdal_edit.py -a_nodata, .rio.write_nodata); if the unit is another, give "
            "vertical_units="
        )
    void = values == 0
    if void.any() and np.fmin.reduce(np.abs(values[~void]), initial=np.inf) > _CLIFF:
        warn(
            f"{name} holds elevations of exactly 0 m beside others that all differ from it by more than {_CLIFF:g} m: "
            "if 0 marks no data, declare it (gdal_edit.py -a_nodata 0, .rio.write_nodata(0))"
        )


REFERENCE = "Dozier and Frew (1990), doi:10.1109/36.58986"

# Elevations that all differ by more from the altitude of the atmosphere are in another place or unit. [m]
_APART = 500.0
# Nearer ones may still be in another unit: 150 m are 492 feet. [m]
_NOT_FEET = 150.0
# Relief of a scene in kilometres is less, and only the flattest coasts have so little in metres.
_RELIEF_IN_KM = 1.0

_UNITS_IN_WORDS = {"ft": "feet", "dm": "decimetres", "km": "kilometres"}


def likely_unit(low, high, at):
    """Unit in which elevations that are far from an altitude [m] agree with it, or None."""
    if low - _NOT_FEET <= at <= high + _NOT_FEET:
        return None
    for unit in _UNITS_IN_WORDS:
        metres = metres_per_unit(unit)
        agree = metres * low - _APART / 5 < at < metres * high + _APART / 5
        if agree and (unit != "km" or high - low < _RELIEF_IN_KM):
            return unit
    return None


def elevation_grid(dem):
    """Grid of an elevation model."""
    if not isinstance(dem, xr.DataArray):
        raise TypeError(
            f"a dem is an xarray.DataArray, got {type(dem).__name__}: bring it onto the grid with fifesim.fine_dem"
        )
    if dem.ndim != 2:
        raise ValueError(f"a dem has dimensions (y, x), got {dem.dims}: select one layer, such as .isel(band=0)")
    cf.check_quantity(dem, "dem")
    if dem.chunks is None:
        check_heights("the dem", dem.values)
    return grids.geobox(dem)


def beside_altitude(dem, altitude):
    """Elevation model that warns if it disagrees with the altitude of the atmosphere, when it is computed if lazy."""
    if dem.chunks is None:
        look_at_altitude(dem.values, altitude)
        return dem
    warned = []
    data = dem.data.map_blocks(look_at_altitude, altitude, warned, dtype=dem.dtype, meta=np.empty((0, 0), dem.dtype))
    return dem.copy(data=data)


def look_at_altitude(cells, altitude, warned=()):
    """Warn once if elevations disagree with the altitude of the atmosphere, and return them."""
    low, high = (float(end.reduce(cells, axis=None)) for end in (np.fmin, np.fmax))
    at = 1000 * altitude
    unit = likely_unit(low, high, at)
    if not warned and (unit or low > at + _APART or high < at - _APART):
        warned += [True] if isinstance(warned, list) else ()
        other = ""
        if unit:
            words, metres = _UNITS_IN_WORDS[unit], metres_per_unit(unit)
            other = (
                f"where they are {words}, take dem * {metres:g} (vertical_units = '{unit}' of a file); where metres, "
            )
        warn(
            f"the dem has elevations of {low:.4g} to {high:.4g} m beside an altitude of the atmosphere of {altitude:g} "
            f"km: {other}give fifesim.Atmosphere(altitude={np.clip((low + high) / 2000, 0, None):.1f})"
        )
    return cells


def source_resolution(dem, given=None):
    """Resolution of the source of an elevation model: given, from the attribute, or the smaller side of a cell. [m]"""
    known = dem.attrs.get("source_resolution") if given is None else given
    found = min(grids.cell_size(grids.geobox(dem))) if known is None else float(known)
    least = 0.0 if given is None else min(grids.cell_size(grids.geobox(dem))) / 50
    if not (found > 0 and least <= found < np.inf):
        raise ValueError(
            f"the resolution of an elevation's source must be positive metres, and if given at least 1/50 of a cell, "
            f"got {found:g}: give metres, not km"
        )
    return found


# Elevations are made in fixed tiles of this size. [cell]
ELEVATION_TILE = 504

# Filling goes outward ring by ring. [source cell]
_MOST_FILLED = 250


@dataclass(frozen=True, eq=False)
class Model:
    """Position of a source below a grid, number of averaged cells, and distance to which gaps are filled."""

    place: Placement
    blocks: tuple[int, int]  # source cells down and across that are averaged
    fill: tuple[float, float]  # distance from known elevation [source cell]
    resolution: float  # [m]
    linear: bool = False  # interpolate linearly, which does not overshoot

    @property
    def source(self):
        """Source of the elevations."""
        return self.place.source

    def reading(self, cells, origin=(0, 0)):
        """Copy of the model whose source has other cells, a window from `origin` on."""
        source = replace(self.source, cells=cells, origin=origin)
        return replace(self, place=replace(self.place, source=source))

    def elevation(self, make_tile, first_row, first_column, shape):
        """Elevation from a row and column of the grid on, NaN where unknown, shape (rows, columns). [m]"""
        row, column = grids.lattice_position(self.place.grid)
        return assemble(make_tile, ELEVATION_TILE, row + first_row, column + first_column, shape)

    def tiles(self):
        """Function that makes a tile, and caches the last ones."""
        return KeptTiles(partial(self._tile, *grids.lattice_position(self.place.grid)))

    def window(self, rows, columns):
        """First row and column and size of the source cells that positions need, in whole blocks."""
        found = []
        parts = zip((rows, columns), self.blocks, self.fill, self.source.shape, strict=True)
        for positions, count, fill, size in parts:
            low, high = ((edge + 0.5) / count - 0.5 for edge in (positions.min(), positions.max()))
            # A gap must be read completely, with the surrounding cells that determine its values.
            around = spline.SPLINE_MARGIN + int(np.ceil((2 * fill + 6) / count) if fill else 0)
            # The model is unknown beyond its margin.
            first = max(int(np.floor(low)) - 2, -around) - around
            last = min(int(np.floor(high)) + 4, -(-size // count) + around) + around
            found.append((first * count, max(last - first, 0) * count))
        (top, height), (left, width) = found
        return top, left, height, width

    def read(self, top, left, height, width):
        """Source cells with filled gaps, NaN where unknown, shape (height, width). [m]"""
        values = self.source.read(top, left, height, width)
        return spline.fill_gaps(values, self.fill) if any(self.fill) else values

    def tile_window(self, rows, columns):
        """Rows and columns of the source that all tiles of a part of the grid read."""
        outline = []
        for first, part in zip(grids.lattice_position(self.place.grid), (rows, columns), strict=True):
            low = (first + part.start) // ELEVATION_TILE * ELEVATION_TILE
            high = -(-(first + part.stop) // ELEVATION_TILE) * ELEVATION_TILE - 1
            outline.append(np.linspace(low - first, high - first, 17).round().astype(int))
        top, left, height, width = self.window(*self.place.positions(*outline))
        # A curved edge may bulge between the points of the outline.
        return tuple(
            slice(min(max(start - 2, 0), size), max(min(start + length + 2, size), 0))
            for start, length, size in zip((top, left), (height, width), self.source.shape, strict=True)
        )

    def _tile(self, row, column, tile_row, tile_column):
        down, across = self.blocks
        cells = np.arange(ELEVATION_TILE)
        rows, columns = self.place.positions(
            tile_row * ELEVATION_TILE - row + cells, tile_column * ELEVATION_TILE - column + cells
        )
        top, left, height, width = self.window(rows, columns)
        values = self.read(top, left, height, width)
        known = np.isfinite(values)
        if not known.any():
            return np.full((ELEVATION_TILE, ELEVATION_TILE), np.nan)
        found = looked_up(known, rows - top, columns - left)
        # Places past the window are unknown; they are moved into it to be passed over.
        rows = rows.clip(top + 3 * down, top + height - 4 * down)
        columns = columns.clip(left + 3 * across, left + width - 4 * across)
        if down > 1 or across > 1:
            values = spline.block_means(spline.extend(values, 2 * max(self.blocks), rest=False), down, across)
        values = spline.extend(values, spline.SPLINE_MARGIN)
        in_blocks = (rows - top + 0.5) / down - 0.5, (columns - left + 0.5) / across - 0.5
        if self.linear:
            return np.where(found, ndimage.map_coordinates(values, np.broadcast_arrays(*in_blocks), order=1), np.nan)
        coefficients = spline.spline_coefficients(values)
        if self.place.parallel:
            out = spline.spline_grid(coefficients, *(axis.ravel() for axis in in_blocks))
        else:
            out = spline.spline_points(coefficients, *in_blocks)
        return np.where(found, out, np.nan)


def model_under(grid, raster, fill, vertical_units, allow_remote=False):
    """Elevation model below a grid."""
    grids.check_grid(grid)
    if fill is not None and (isinstance(fill, bool) or not fill > 0):
        raise ValueError(f"fill is a distance from known elevation, above 0 m, got {fill!r}: give for instance fill=60")
    place = placement(open_source(raster, vertical_units, allow_remote), grid)
    sizes = place.cell_size()
    most = round(_MOST_FILLED * min(sizes), 6)
    if (fill or 0) > most:
        raise ValueError(
            f"fill={fill:g} is more than {_MOST_FILLED} cells of {place.source.name}, of {min(sizes):.3g} m: give at "
            f"most fill={most:g}"
        )
    blocks = tuple(max(1, round(float(np.mean(grids.cell_size(grid))) / size)) for size in sizes)
    resolution = round(float(np.mean([count * size for count, size in zip(blocks, sizes, strict=True)])), 6)
    return Model(place, blocks, tuple((fill or 0) / size for size in sizes), resolution)


def looked_up(known, rows, columns):
    """Mask of places in known cells, False outside of all cells."""
    if not known.size:
        return np.zeros(np.broadcast_shapes(rows.shape, columns.shape), bool)
    row, column = np.rint(rows).astype(int), np.rint(columns).astype(int)
    inside = (row >= 0) & (row < known.shape[0]) & (column >= 0) & (column < known.shape[1])
    return inside & known[row.clip(0, known.shape[0] - 1), column.clip(0, known.shape[1] - 1)]
