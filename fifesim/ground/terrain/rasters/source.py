"""Where elevations come from: a raster file or array, read by the window, in metres, and its place under a grid."""

from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import dask.array as da
import numpy as np
import pyproj
import rasterio.windows
import rioxarray  # noqa: F401  registers .rio
import xarray as xr
from affine import Affine

from fifesim.base.foreign import in_a_line
from fifesim.base.lattice import centres
from fifesim.base.warned import warn
from fifesim.ground.terrain.units import metres_per_unit
from fifesim.rasters import projection
from fifesim.rasters.opening import ErrorsOfGdal, RasterFile, raster_file
from fifesim.rasters.soundness import check_raster, horizontal_crs
from fifesim.rasters.spacing import regular_geobox

# Positions in another CRS are a polynomial through those at so many Chebyshev nodes along each axis of a tile.
_NODES = 12

# Heights that land has, with room to spare. [m]
LAND = (-500, 9000)

# Elevations of exactly 0 among others that are all farther from it may be voids. [m]
_CLIFF = 50.0

# A window of more cells takes several GB with what is made of it.
_MOST_CELLS = 2**27


class ByWindow:
    """
    Cells of a raster in memory, or opened and not read: then windows are read alone, and none is kept.

    Parameters
    ----------
    raster : xarray.DataArray, dims (y, x)
    """

    def __init__(self, raster):
        self._cells, self._token = raster.variable, uuid4().hex
        self.shape = raster.shape

    def __getitem__(self, window):
        return np.asarray(self._cells[window])

    def __dask_tokenize__(self):
        # A token of its cells would read them all.
        return self._token


@dataclass(frozen=True, eq=False)
class Source:
    """An elevation model: what holds its cells, their size and place, and metres in one unit of theirs."""

    name: str
    cells: RasterFile | ByWindow | np.ndarray | da.Array
    shape: tuple[int, int]
    affine: Affine
    crs: pyproj.CRS
    metres: float
    nodata: float | None = None
    origin: tuple[int, int] = (0, 0)

    def read(self, top, left, rows, columns):
        """
        Elevations of a window, which may reach beyond the model.

        Parameters
        ----------
        top, left : int
            Row and column of its first cell.
        rows, columns : int
            Its size.

        Returns
        -------
        values : array, shape (rows, columns)
            NaN where unknown. [m]

        Raises
        ------
        ValueError
            If the window is larger than what is read at once, or holds heights that land does not have.
        """
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
            found = (
                _file_window(self.cells, *window) if isinstance(self.cells, RasterFile) else self._array_window(*window)
            )
            out[first - top : last - top, west - left : east - left] = found * self.metres
            check_heights(self.name, found * self.metres)
        return out

    def _array_window(self, rows, columns):
        top, left = self.origin
        window = slice(rows.start - top, rows.stop - top), slice(columns.start - left, columns.stop - left)
        values = np.asarray(self.cells[window], float)
        return values if self.nodata is None else np.where(values == self.nodata, np.nan, values)


def open_source(raster, vertical_units=None, allow_remote=False):
    """
    Elevation model of a file or an array.

    Parameters
    ----------
    raster : str, path or xarray.DataArray
    vertical_units : str, optional
        Wins over what the file says.
    allow_remote : bool, optional
        As of `fifesim.rasters.opening.raster_file`.

    Returns
    -------
    source : Source

    Raises
    ------
    ValueError
        If there is no such file or it is not to be opened, holds no numbers, has no CRS or more than one band, or
        elevations are said to be in other units than metres.
    TypeError
        If it is neither.
    """
    if isinstance(raster, xr.DataArray):
        return _array_source(raster, vertical_units)
    if not isinstance(raster, str | Path):
        raise TypeError(f"an elevation model is a path or an xarray.DataArray, got {type(raster).__name__}")
    file = raster_file(raster, allow_remote)
    name = in_a_line(Path(file.path).name, 150)
    with ErrorsOfGdal(f"cannot read {file.name}"), file.opened() as opened:
        check_raster(opened, file.name)
        horizontal_crs(opened, file.name)
        source = Source(name, file, opened.shape, opened.transform, None, 1.0)
        return _in_metres(source, opened.crs.to_wkt(), in_a_line(opened.units[0] or "", 40), vertical_units)


def _array_source(raster, vertical_units):
    raster = raster.squeeze([name for name in raster.dims if raster.sizes[name] == 1 and name == "band"], drop=True)
    name = str(raster.name or "the elevation model")
    if raster.ndim != 2:
        raise ValueError(f"an elevation model has one band of rows and columns, got dimensions {raster.dims}")
    crs = raster.rio.crs
    found = regular_geobox(raster)
    if found is None:
        raise ValueError(f"the x and y of {name} are not the centres of a regular grid")
    scale, offset = raster.attrs.get("scale_factor", 1.0), raster.attrs.get("add_offset", 0.0)
    if (scale, offset) != (1.0, 0.0):
        raise ValueError(
            f"{name} holds packed values, scale {scale:g}, offset {offset:g}: open it with mask_and_scale=True"
        )
    raster = raster.transpose(*raster.odc.spatial_dims)
    cells = ByWindow(raster) if raster.chunks is None else raster.data
    nodata = raster.rio.nodata
    nodata = None if nodata is None or np.isnan(nodata) else float(nodata)
    source = Source(name, cells, cells.shape, found.affine, None, 1.0, nodata)
    return _in_metres(source, crs.to_wkt() if crs else None, raster.attrs.get("units"), vertical_units)


def _in_metres(source, wkt, unit, vertical_units):
    """The source with its horizontal CRS and the metres in its unit."""
    if wkt is None:
        raise ValueError(
            f"{source.name} has no CRS: give it one, for instance with gdal_edit.py -a_srs EPSG:26914 or "
            ".rio.write_crs('EPSG:26914')"
        )
    crs = pyproj.CRS.from_wkt(wkt)
    parts = crs.sub_crs_list or [crs]
    vertical = [axis.unit_name for part in (crs, *parts) for axis in part.axis_info if axis.direction in ("up", "down")]
    said = unit or (vertical[0] if vertical else "metre")
    if vertical_units is None:
        try:
            metres = metres_per_unit(said)
        except ValueError:
            metres = None
        if metres != 1.0:
            raise ValueError(
                f"{source.name} says that its elevations are in {said!r}, not in metres: give their units, for "
                f"instance vertical_units='us-ft', and they are converted, or vertical_units='m' if it is wrong"
            )
    horizontal = parts[0].to_2d() if len(parts[0].axis_info) > 2 else parts[0]
    metres = metres_per_unit(vertical_units or said)
    return Source(source.name, source.cells, source.shape, source.affine, horizontal, metres, source.nodata)


def _file_window(file, rows, columns):
    window = rasterio.windows.Window(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
    said = f"cannot read rows {rows.start} to {rows.stop} and columns {columns.start} to {columns.stop} of {file.name}"
    with ErrorsOfGdal(said), file.opened() as opened:
        values = opened.read(1, window=window, masked=True).astype(float).filled(np.nan)
        return values * opened.scales[0] + opened.offsets[0]


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the cells of a grid lie in a source, counted in its cells from the centre of the first."""

    source: Source
    grid: object
    pipeline: str | None

    @property
    def parallel(self):
        """Whether rows and columns of the grid are those of the source."""
        return self.pipeline is None and not (self.source.affine.b or self.source.affine.d)

    def positions(self, rows, columns):
        """
        Positions of cells of the grid in the source.

        Parameters
        ----------
        rows, columns : array of int, shape (m,), (n,)
            Of the grid; they may lie outside it.

        Returns
        -------
        rows, columns : array, shape (m, 1), (1, n) where the two are parallel, else (m, n)
            [source cell]
        """
        a = self.grid.affine
        y, x = centres(a.f, a.e, rows), centres(a.c, a.a, columns)
        if self.parallel:
            inverse = ~self.source.affine
            return (inverse.e * y + inverse.f - 0.5)[:, None], (inverse.a * x + inverse.c - 0.5)[None, :]
        (y_nodes, from_y), (x_nodes, from_x) = _chebyshev(y), _chebyshev(x)
        across, down = self._source_cells(*np.meshgrid(x_nodes, y_nodes))
        return from_y @ (down - 0.5) @ from_x.T, from_y @ (across - 0.5) @ from_x.T

    def cell_size(self):
        """
        Size of a source cell in the middle of the grid.

        Returns
        -------
        down, across : float
            Distance of its rows and of its columns. [m]
        """
        x, y = projection.transform_points(self.grid.affine, self.grid.shape.x / 2, self.grid.shape.y / 2)
        step = 10.0
        columns, rows = self._source_cells(np.array([x, x + step, x]), np.array([y, y, y + step]))
        return tuple(float(step / np.hypot(*(axis[1:] - axis[0]))) for axis in (rows, columns))

    def _source_cells(self, x, y):
        if self.pipeline is not None:
            x, y = projection.carry(self.pipeline, self.grid.crs.to_wkt(), self.source.crs, x, y)
        return projection.transform_points(~self.source.affine, x, y)


def placement(source, grid):
    """
    Place of a grid in a source, by a coordinate operation of known accuracy.

    Parameters
    ----------
    source : Source
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    placement : Placement

    Raises
    ------
    ValueError
        If a change of datum has no known accuracy.
    """
    return Placement(source, grid, projection.operation(grid.crs.to_wkt(), source.crs, projection.degrees(grid))[0])


def _chebyshev(values):
    """Nodes over the range of some values, and the matrix that interpolates from nodes to values."""
    middle, half = (values.max() + values.min()) / 2, max(np.ptp(values) / 2, 1.0)
    nodes = np.polynomial.chebyshev.chebpts1(_NODES)
    matrix = np.linalg.solve(
        np.polynomial.chebyshev.chebvander(nodes, _NODES - 1).T,
        np.polynomial.chebyshev.chebvander((values - middle) / half, _NODES - 1).T,
    ).T
    return middle + half * nodes, matrix


def check_heights(name, values):
    """
    Raise ValueError for heights that land does not have, and warn of voids of 0.

    Parameters
    ----------
    name : str
        Of the elevation model.
    values : array
        NaN passes. [m]

    Raises
    ------
    ValueError
        If one is below the Dead Sea or above Mount Everest: a mark for no data, or another unit.

    Warns
    -----
    UserWarning
        If some are exactly 0 and all others are above 50 m, or below -50 m.
    """
    low, high = LAND
    wrong = values[(values < low) | (values > high)]
    if wrong.size:
        raise ValueError(
            f"{name} holds elevations such as {wrong.flat[0]:.0f} m, land has {low} to {high} m: if it marks no data, "
            "declare it (gdal_edit.py -a_nodata, .rio.write_nodata); if the unit is another, give vertical_units="
        )
    void = values == 0
    if void.any() and np.fmin.reduce(np.abs(values[~void]), initial=np.inf) > _CLIFF:
        warn(
            f"{name} holds elevations of exactly 0 m beside others that all differ from it by more than {_CLIFF:g} m: "
            "if 0 marks no data, declare it (gdal_edit.py -a_nodata 0, .rio.write_nodata(0))"
        )
