"""Grids as odc GeoBoxes: what a DataArray's grid is, and where cells and pixels lie."""

from __future__ import annotations

from functools import lru_cache
from threading import Lock
from typing import Annotated, TypeAlias

import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc
import rioxarray  # noqa: F401  registers .rio
import xarray as xr
from affine import Affine
from odc.geo.crs import MaybeCRS
from odc.geo.geobox import GeoBox

from fifesim.base.annotations import Pair
from fifesim.base.kinds import Kind
from fifesim.base.lattice import whole_cells
from fifesim.rasters import projection
from fifesim.rasters.axes import check_axes
from fifesim.rasters.carried_grid import as_carried, centres_of, on_lattice
from fifesim.rasters.references import reference_of
from fifesim.rasters.spacing import along_axis, exact_cell

_LONGEST = 2**31 - 1  # cells along a side, as whole numbers of image files count them

CRSLike: TypeAlias = Annotated[
    MaybeCRS,
    Kind("a CRS, such as 'EPSG:26914'", lambda value: isinstance(value, str | int) or hasattr(value, "to_wkt")),
]


def grid_at(crs: CRSLike, west: float, north: float, width: float, height: float, cell: Pair) -> GeoBox:
    """
    North-up grid from its corner, size and cell.

    Parameters
    ----------
    crs : str or int
        A projected coordinate reference system in metres.
    west, north : float
        Upper left corner. [m]
    width, height : float
        Size; as many whole cells as fit. [m]
    cell : float or (float, float)
        Size of a cell, or down and across. [m]

    Returns
    -------
    grid : odc.geo.geobox.GeoBox

    Raises
    ------
    ValueError
        If there is no such CRS, it is not projected or not in metres, or the size holds no cell.

    Warns
    -----
    UserWarning
        If the corner looks like longitude and latitude.

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.grid_at("EPSG:32633", 390000, 5820000, width=300, height=200, cell=5)
    >>> grid.shape, grid.resolution.x
    (Shape2d(x=60, y=40), 5.0)
    """
    down, across = np.broadcast_to(np.asarray(cell, float), 2).tolist()
    size, of = f"a grid of width = {width:g}, height = {height:g} m holds", f"of {down:g} x {across:g} m"
    if not (min(down, across) > 0 and width >= across and height >= down):
        raise ValueError(f"{size} no cell {of}: type a width and height of a cell or more, or a smaller cell")
    if not max(width / across, height / down) < _LONGEST:
        raise ValueError(f"{size} over {_LONGEST} cells {of} along a side: type a smaller size, or a larger cell")
    projection.warn_of_degrees(west, north)
    shape = int(height / down + 1e-6), int(width / across + 1e-6)
    return _checked(shape, (across, 0.0, west, 0.0, -down, north), projection.horizontal(crs))


# A scenario asks for its grid at every step.
@lru_cache(maxsize=64)
def _checked(shape, transform, crs):
    return check_grid(GeoBox(shape, Affine(*transform), crs))


def check_grid(grid):
    """
    Refuse a grid on which distances are not metres.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    grid : odc.geo.geobox.GeoBox
        The same; of a CRS with heights, in the part without.

    Raises
    ------
    ValueError
        If it has no CRS, a geographic one, or one that `projection.check_metres` refuses, or is not north up.
    TypeError
        If it is no GeoBox.
    """
    if not isinstance(grid, GeoBox):
        raise TypeError(f"a grid is an odc.geo.geobox.GeoBox, got {type(grid).__name__}: see fifesim.fife_site")
    if grid.crs is None:
        raise ValueError("the grid has no CRS: make it with one, such as fifesim.grid_at('EPSG:26914', ...)")
    if (flat := projection.horizontal(grid.crs)) is not grid.crs:
        grid = GeoBox(grid.shape, grid.affine, flat)
    if grid.crs.geographic:
        raise ValueError(
            f"the grid is in a geographic CRS ({projection.name_of(grid.crs.proj)}), whose cells are degrees: "
            "reproject it to a projected CRS in metres, for instance with .rio.reproject('EPSG:26914')"
        )
    a = grid.affine
    if a.b or a.d or a.a <= 0 or a.e >= 0:
        raise ValueError(
            f"the grid must be north up and not rotated, got the transform {tuple(a)[:6]}: "
            "sort it with .sortby('y', ascending=False) or reproject it"
        )
    projection.check_metres(grid.crs.proj, tuple(grid.boundingbox))
    return grid


def geobox(array):
    """
    Grid of a DataArray.

    Parameters
    ----------
    array : xarray.DataArray
        With dimensions (..., y, x), coordinates of cell centres, and a CRS.

    Returns
    -------
    grid : odc.geo.geobox.GeoBox
        Its distance from the lattice of cells is rounded to 1e-6 m.

    Raises
    ------
    ValueError
        If there is no CRS, or the grid is not one that `check_grid` passes.
    """
    if (placed := _placed_grid(array)) is not None:
        return placed
    check_axes(array)
    if 0 in array.shape:
        raise ValueError(f"the raster has no cells, shape {array.shape}: look at how it was selected")
    if not ("spatial_ref" in array.coords and array.coords["spatial_ref"].attrs) and array.odc.crs is None:
        raise ValueError(
            "the raster has no CRS: open its file with decode_coords='all', or import rioxarray and give it one with "
            ".rio.write_crs('EPSG:26914'); xr.where drops it, .where of a raster keeps it"
        )
    found = array.odc.geobox
    if found is None:
        cure = ": one row tells no cell, give .rio.write_transform(...)" if 1 in (array.y.size, array.x.size) else ""
        raise ValueError(f"the raster's x and y are not the centres of a regular grid{cure}")
    a = found.affine
    (west, cell_x), (north, cell_y) = along_axis(array, "x", a.c, a.a), along_axis(array, "y", a.f, a.e)
    cell_x, cell_y = exact_cell(array, cell_x, cell_y)
    return check_grid(on_lattice(GeoBox(found.shape, Affine(cell_x, a.b, west, a.d, cell_y, north), found.crs)))


def coordinates(grid):
    """
    Coordinates of a grid: cell centres and the CRS.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    coordinates : dict of str to xarray.DataArray
        ``y``, ``x`` [m] and ``spatial_ref`` with a GeoTransform that fits.
    """
    out = {}
    for axis, values in zip(("y", "x"), centres_of(grid), strict=True):
        attrs = {"standard_name": f"projection_{axis}_coordinate", "long_name": f"{axis} coordinate of projection"}
        attrs |= {"units": "m", "axis": axis.upper()}
        out[axis] = xr.DataArray(values, dims=axis, attrs=attrs)
        # xarray would write a fill value, which CF forbids for coordinate variables (section 2.5.1).
        out[axis].encoding = {"_FillValue": None}
    out["spatial_ref"] = reference_of(on_lattice(grid))
    return out


def place(array, grid, coordinates=None):
    """
    Put an array on a grid: coordinates, CRS and transform afresh.

    Parameters
    ----------
    array : xarray.DataArray
        With dimensions (..., y, x) of the grid's shape.
    grid : odc.geo.geobox.GeoBox
    coordinates : mapping of str to xarray.Variable or xarray.DataArray, optional
        Further coordinates.

    Returns
    -------
    array : xarray.DataArray
        A new object; other coordinates stay.
    """
    own = _whole(grid)
    whole = {name: each.copy(deep=False) for name, each in own.variables.items()}
    others = xr.Coordinates(_plain(coordinates or {}))
    fresh = xr.Coordinates({**others.variables, **whole}, indexes={**others.xindexes, **own.xindexes})
    out = _with(array, fresh)
    out.encoding = {"grid_mapping": "spatial_ref"}
    return out


def with_coordinates(array, coordinates):
    """
    Raster with further coordinates that fit its dimensions, or with others of the same names.

    Parameters
    ----------
    array : xarray.DataArray
    coordinates : mapping of str to xarray.Variable or xarray.DataArray

    Returns
    -------
    array : xarray.DataArray
        A new object. ``assign_coords`` aligns all coordinates, which takes ten times as long.
    """
    out = _with(array, xr.Coordinates(_plain(coordinates)))
    out.encoding = dict(array.encoding)
    return out


def _with(array, fresh):
    """Raster with other coordinates, put together at once: xarray aligns what it assigns."""
    kept = {name: each for name, each in array.coords.variables.items() if name not in fresh.variables}
    indexes = {name: each for name, each in array.xindexes.items() if name in kept}
    known = xr.Coordinates({**kept, **fresh.variables}, indexes={**indexes, **fresh.xindexes})
    return xr.DataArray(array.variable.copy(deep=False), coords=known, name=array.name)


def _plain(coordinates):
    """Variables of coordinates, without coordinates of their own."""
    return {name: getattr(each, "variable", each) for name, each in coordinates.items()}


# Every step of a chain asks for those of its grid.
@lru_cache(maxsize=64)
def _whole(grid):
    found = xr.Coordinates(coordinates(grid))
    with _placing:
        _placed[id(_pandas_index(found, "x"))] = found, as_carried(grid)
        if len(_placed) > 64:
            del _placed[next(iter(_placed))]
    return found


# Coordinates made by `place` and their grid, by the identity of the pandas index of x, which copies of a raster share.
# Reading the grid from the coordinates takes 0.2 ms, several times in each step.
_placed = {}
_placing = Lock()


def _placed_grid(array):
    """Grid of a raster with the very coordinates that `place` gave, or None."""
    if not (isinstance(array, xr.DataArray) and {"y", "x", "spatial_ref"} <= set(array.coords.variables)):
        return None
    known, grid = _placed.get(id(_pandas_index(array, "x")), (None, None))
    if known is None or _pandas_index(array, "y") is not _pandas_index(known, "y"):
        return None
    same = array.coords.variables["spatial_ref"].attrs == known.variables["spatial_ref"].attrs
    return grid if same else None


def on_same_coordinates(arrays):
    """Whether arrays share the very coordinates that `place` gave."""
    first = arrays[0]
    if _placed_grid(first) is None:
        return False
    same = (_pandas_index(each, axis) is _pandas_index(first, axis) for each in arrays[1:] for axis in ("y", "x"))
    return all(same) and all(_placed_grid(each) is not None for each in arrays[1:])


def _pandas_index(array, axis):
    """Index of an axis, which copies of a raster share; None without coordinates."""
    found = array.xindexes.get(axis)
    return None if found is None else found.to_pandas_index()


def same_grid(one, other):
    """
    Whether two grids have the same cells, within a thousandth of one.

    Parameters
    ----------
    one, other : odc.geo.geobox.GeoBox

    Returns
    -------
    same : bool
    """
    if one.shape != other.shape or one.crs != other.crs:
        return False
    corners = [
        [projection.transform_points(grid.affine, *corner) for corner in ((0, 0), grid.shape.xy)]
        for grid in (one, other)
    ]
    return bool(np.allclose(*corners, rtol=0, atol=1e-3 * min(abs(one.affine.a), abs(one.affine.e))))


def aligned(grid, pixel):
    """
    Coarser grid whose upper left corner is that of a fine one.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
    pixel : float or (float, float)
        Pixel size, down and across. [m]

    Returns
    -------
    coarse : odc.geo.geobox.GeoBox
        As many whole pixels as fit.

    Raises
    ------
    ValueError
        If none fits, or pixels are smaller than 1/50 of a cell.
    """
    down, across = np.broadcast_to(np.asarray(pixel, float), 2)
    a = grid.affine
    height, width = -a.e * grid.shape.y, a.a * grid.shape.x
    shape = int(height / down + 1e-6), int(width / across + 1e-6)
    if not (down > 0 and across > 0 and min(shape) > 0):
        raise ValueError(f"no pixel of {down:g} x {across:g} m fits into a scene of {height:g} x {width:g} m")
    # Pixels that are so much smaller than a cell have their size in km.
    if min(-a.e / down, a.a / across) > 50:
        raise ValueError(f"pixels must be at least 1/50 of a cell of {a.a:g} m, got {across:g} m: give metres, not km")
    return GeoBox(shape, Affine(across, 0.0, a.c, 0.0, -down, a.f), grid.crs)


def lattice_position(grid):
    """
    Row and column of a grid's first cell, counted in its own cells from the origin of its CRS, southward and eastward.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    row, column : int
    """
    a = grid.affine
    return whole_cells(a.f, a.e)[0], whole_cells(a.c, a.a)[0]


def lattice_offset(one, other):
    """
    Rows and columns from the first cell of one grid to that of another with the same cells.

    Parameters
    ----------
    one, other : odc.geo.geobox.GeoBox

    Returns
    -------
    rows, columns : int

    Raises
    ------
    ValueError
        If CRS, cell size or the position of the cell edges differ.
    """
    a, b = one.affine, other.affine
    same_cell = np.allclose((a.a, a.e), (b.a, b.e), rtol=1e-6)
    rows, columns = (b.f - a.f) / a.e, (b.c - a.c) / a.a
    if one.crs != other.crs or not same_cell or max(abs(rows - round(rows)), abs(columns - round(columns))) > 1e-3:
        raise ValueError(
            f"the rasters lie on different lattices, {in_words(one)} and {in_words(other)}: "
            "bring one onto the other first"
        )
    return round(rows), round(columns)


def cell_size(grid):
    """
    Cell size of a grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    down, across : float
        [m]
    """
    return -grid.affine.e, grid.affine.a


def extent(grid):
    """
    Where a grid lies, in words.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    text : str
    """
    box = grid.boundingbox
    return f"{box.left:.0f} to {box.right:.0f} E and {box.bottom:.0f} to {box.top:.0f} N"


def in_words(grid):
    """
    A grid in words, for messages.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    text : str
    """
    a = grid.affine
    return (
        f"{grid.shape.y} x {grid.shape.x} cells of {-a.e:g} x {a.a:g} m from {a.c:.3f} E {a.f:.3f} N "
        f"in {projection.name_of(grid.crs.proj)}"
    )
