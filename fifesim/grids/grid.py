"""Grids as odc GeoBoxes: axes, cell spacing and CRS of a DataArray, and the positions of its cells and pixels."""

from __future__ import annotations

from types import MappingProxyType
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc
import pyproj
import rioxarray  # noqa: F401  registers .rio
import xarray as xr
from affine import Affine
from odc.geo.crs import CRS, MaybeCRS
from odc.geo.geobox import GeoBox
from odc.geo.xr import xr_coords
from xarray.indexes import PandasIndex

from fifesim.base.arguments import Kind, Pair
from fifesim.base.caches import Results, cached
from fifesim.base.lattice import centres, whole_cells
from fifesim.base.messages import warn
from fifesim.grids import projection

# Other names of y and x.
_OTHERS = (("latitude", "longitude"), ("lat", "lon"), ("northing", "easting"), ("Y", "X"), ("row", "column"))


def north_up(array):
    """Raster with rows from north to south; a scan is unchanged."""
    if is_scan(array) or _placed_grid(array) is not None:
        return array
    check_axes(array)
    northing = array.coords.variables.get("y")
    if northing is not None and northing.size > 1 and northing.values[1] > northing.values[0]:
        return array.isel(y=slice(None, None, -1))
    return array


def is_scan(array):
    """Whether an array has the dimensions line and sample of a scan."""
    return {"line", "sample"} <= set(getattr(array, "dims", ()))


def check_axes(array):
    """Raise an error for a raster without dimensions y and x."""
    if not isinstance(array, xr.DataArray):
        raise TypeError(f"a raster is an xarray.DataArray, got {type(array).__name__}: open it with rioxarray")
    if {"y", "x"} <= set(array.dims):
        return _placed_grid(array) is not None or _check_first(array)
    if is_scan(array):
        raise ValueError(
            f"a raster needs dimensions y and x, got {array.dims} of a scan: map it with .fifesim.grid_swath(grid)"
        )
    for down, across in _OTHERS:
        if {down, across} <= set(array.dims):
            cure = f".rename({down}='y', {across}='x')"
            if down.startswith("lat"):
                cure += ".rio.write_crs(4326).rio.reproject('EPSG:32614'), with the UTM zone of its place"
            raise ValueError(f"a raster has dimensions y and x, in metres, got {array.dims}: type {cure}")
    raise ValueError(f"a raster has dimensions y and x, got {array.dims}: rename or select with .rename, .isel")


# Tolerance of coordinates as a fraction of a cell, sufficient for single-precision northings with cells of 30 m. [1]
_TOLERANCE = 1 / 60
# Limit for smaller cells, where the coordinates are in single precision.
_TOLERANCE_SINGLE = 1 / 10


def regular_geobox(array):
    """Grid of a raster in any CRS and orientation whose coordinates are evenly spaced, None if odc-geo finds none."""
    # odc-geo reads the first and the last coordinates only.
    _check_first(array)
    found = array.odc.geobox
    if found is not None:
        for name in array.odc.spatial_dims:
            along_axis(array, name, 0.0, 0.0)
    return found


def _check_first(array):
    """Raise ValueError if the first two coordinates of an axis are equal, where the accessor of odc-geo fails."""
    for name in {"y", "x"} & set(array.dims) or array.dims[-2:]:
        given = array.coords.variables.get(name)
        if given is not None and given.size > 1 and given.values[0] == given.values[1]:
            along_axis(array, name, 0.0, 0.0)


def along_axis(array, name, edge, cell):
    """Outer edge and cell size along an axis, from all coordinates. [unit of the CRS]"""
    if name not in array.coords:
        return edge, cell
    given = array.coords[name].values
    if array.sizes[name] == 1:
        # A subset keeps the GeoTransform of the whole raster, with correct cell size but wrong corner.
        return float(given[0] - cell / 2), cell
    centres = given.astype(float)
    even, cell = np.linspace(centres[0], centres[-1], centres.size, retstep=True)
    tolerance = _TOLERANCE * abs(cell)
    if given.dtype == np.float32:
        tolerance = np.clip(np.spacing(np.abs(given).max()), tolerance, _TOLERANCE_SINGLE * abs(cell))
    if not (cell and np.allclose(centres, even, rtol=0, atol=tolerance)):
        steps = np.diff(centres)
        found = f"{np.nanmin(steps):.6g} to {np.nanmax(steps):.6g}"
        raise ValueError(
            f"the raster's {name} is not evenly spaced, its steps are {found}: "
            f"drop repeated ones with .drop_duplicates({name!r}), sort it with .sortby({name!r}), put tiles together "
            "on one grid with .reindex, or interpolate it onto a regular grid with .interp"
        )
    return float(centres[0] - cell / 2), float(cell)


def exact_cell(array, cell_x, cell_y):
    """Cell size from the GeoTransform, which has all digits, if the coordinates agree with it. [m]"""
    transform = array.coords["spatial_ref"].attrs.get("GeoTransform") if "spatial_ref" in array.coords else None
    if transform:
        numbers = [float(number) for number in transform.split()]
        if np.allclose((numbers[1], numbers[5]), (cell_x, cell_y), rtol=1e-6):
            return numbers[1], numbers[5]
    return cell_x, cell_y


# Cached, because every grid needs it, and making it takes a millisecond.
@cached(16, "coordinates of CRSs", str)
def _reference(crs):
    """Coordinate ``spatial_ref`` of a CRS, without a transform."""
    found = xr_coords(GeoBox((1, 1), Affine.identity(), crs))["spatial_ref"].variable
    del found.attrs["GeoTransform"]
    return found


def centres_of(grid):
    """Northings and eastings of cell centres, shape (rows,), (columns,). [m]"""
    a = grid.affine
    return centres(a.f, a.e, np.arange(grid.shape.y)), centres(a.c, a.a, np.arange(grid.shape.x))


def on_lattice(grid):
    """Grid with its origin rounded to the lattice, and its CRS by authority where equivalent."""
    a = grid.affine
    (column, x_offset), (row, y_offset) = whole_cells(a.c, a.a), whole_cells(a.f, a.e)
    west, north = column * a.a + x_offset, row * a.e + y_offset
    return GeoBox(grid.shape, Affine(a.a, a.b, west, a.d, a.e, north), _by_authority(grid.crs))


@cached(16, "CRSs by authority", str)
def _by_authority(crs):
    return CRS(f"EPSG:{crs.epsg}") if crs and crs.epsg else crs


# All steps of a scene use the same grid.
@cached(64, "grids as rasters carry them", projection.key_of)
def as_carried(grid):
    """Grid as `geobox` finds it on an array after `place`, whose origin differs in the last digits."""
    a = grid.affine
    west, north = _edge(a.c, a.a, grid.shape.x), _edge(a.f, a.e, grid.shape.y)
    found = on_lattice(GeoBox(grid.shape, Affine(a.a, a.b, west, a.d, a.e, north), grid.crs))
    return grid if found == grid else found


def _edge(origin, cell, size):
    """Outer edge of an axis, from the centres of its first cell and its last."""
    first, last = centres(origin, cell, np.array([0, size - 1])).tolist()
    step = (last - first) / (size - 1) if size > 1 else cell
    return first - step / 2


_LONGEST = 2**31 - 1  # cells along a side, as whole numbers of image files count them
# Smaller cells [m], and smaller grids [m] so close to the origin of their CRS [m], are probably in km.
_FINEST, _NARROWEST, _FARTHEST_KM = 0.1, 30.0, 1e4

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
        Size, rounded down to whole cells. [m]
    cell : float or (float, float)
        Cell size, or sizes down and across. [m]

    Returns
    -------
    grid : odc.geo.geobox.GeoBox

    Raises
    ------
    ValueError
        If the CRS is unknown, not projected or not in metres, or the size is smaller than a cell.

    Warns
    -----
    UserWarning
        If the corner looks like longitude and latitude, numbers look like km, or cells do not fill the size.

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
        raise ValueError(f"{size} no cell {of}: use a larger width and height, or a smaller cell")
    if not max(width / across, height / down) < _LONGEST:
        raise ValueError(f"{size} over {_LONGEST} cells {of} along a side: use a smaller size, or a larger cell")
    projection.warn_of_degrees(west, north)
    if min(down, across) < _FINEST or (max(width, height) < _NARROWEST and max(abs(west), abs(north)) < _FARTHEST_KM):
        warn(
            f"west={west:g}, north={north:g}, width={width:g}, height={height:g} and cell={across:g} are used as "
            "metres but look like km: if they are, multiply them by 1000"
        )
    shape = whole_shape((height, width), (down, across), "type these, or a cell that divides the size")
    return check_grid(GeoBox(shape, Affine(across, 0.0, west, 0.0, -down, north), projection.horizontal(crs)))


def whole_shape(sizes, cells, cure):
    """Numbers of whole cells in a height and a width [m]; a rest, which is left out, causes a warning with a cure."""
    shape = tuple(int(size / cell + 1e-6) for size, cell in zip(sizes, cells, strict=True))
    used = np.multiply(shape, cells)
    if np.any(sizes - used > 1e-3 * np.asarray(cells)):
        given, whole = ("height={:.10g} and width={:.10g} m".format(*each) for each in (sizes, used))
        unit = "{:.6g} x {:.6g} m".format(*cells)
        warn(f"whole cells of {unit} do not fill {given}: {whole} are used; {cure}")
    return shape


def check_grid(grid):
    """Raise an error for a grid whose distances are not metres; return it without a vertical CRS."""
    if not isinstance(grid, GeoBox):
        raise TypeError(f"a grid is an odc.geo.geobox.GeoBox, got {type(grid).__name__}: see fifesim.fife_site")
    if grid.crs is None:
        raise ValueError("the grid has no CRS: make it with one, such as fifesim.grid_at('EPSG:26914', ...)")
    return _checked(grid)


# Cached, because every step checks its grid.
@cached(64, "checked grids", projection.key_of)
def _checked(grid):
    if (flat := projection.horizontal(grid.crs)) is not grid.crs:
        grid = GeoBox(grid.shape, grid.affine, flat)
    if grid.crs.geographic:
        raise ValueError(
            f"the grid is in a geographic CRS ({projection.name_of(grid.crs.proj)}), whose cells are degrees: "
            "reproject it to a projected CRS in metres, for instance with .rio.reproject('EPSG:26914')"
        )
    a = grid.affine
    if a.b or a.d or a.a <= 0 or a.e >= 0:
        sorts = ".sortby('x')" * (a.a < 0) + ".sortby('y', ascending=False)" * (a.e > 0)
        cure = "reproject it" if a.b or a.d else f"sort it with {sorts}"
        raise ValueError(f"the grid must be north up and not rotated, got the transform {tuple(a)[:6]}: {cure}")
    projection.check_metres(grid.crs.proj, tuple(grid.boundingbox))
    return grid


def geobox(array):
    """Grid of a DataArray, with its offset from the lattice of cells rounded to 1e-6 m."""
    if (placed := _placed_grid(array)) is not None:
        return placed
    check_axes(array)
    if 0 in array.shape:
        raise ValueError(f"the raster has no cells, shape {array.shape}: check how it was selected")
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
    found = check_grid(on_lattice(GeoBox(found.shape, Affine(cell_x, a.b, west, a.d, cell_y, north), found.crs)))
    _remember(array.coords.variables, array.xindexes, found)
    return found


def coordinates(grid):
    """Coordinates of a grid: ``y``, ``x`` [m], and ``spatial_ref`` with a matching GeoTransform."""
    # Copied, because a user may change the attributes of coordinates.
    return {name: each.copy(deep=False) for name, each in _place_on(grid).variables.items()}


def place(array, grid, others=None):
    """Place an array on a grid, with new coordinates, CRS and transform; other coordinates stay."""
    out = with_coordinates(array, {**(others or {}), **coordinates(grid)}, _place_on(grid).indexes)
    out.encoding = {"grid_mapping": "spatial_ref"}
    return out


def without(array, names):
    """Raster without some coordinates."""
    kept = {name: each for name, each in array.coords.variables.items() if name not in names}
    return raster_of(array.variable, kept, array.xindexes, array.name)


def with_coordinates(array, coordinates, indexes=MappingProxyType({})):
    """Raster with additional or replaced coordinates, assembled at once, because xarray aligns assigned ones."""
    variables, known = dict(array.coords.variables), dict(array.xindexes)
    given = {name: each for name, each in variables.items() if each.dtype.kind == "U"} | dict(coordinates)
    for name, each in given.items():
        variables.pop(name, None)
        known.pop(name, None)
        variable = getattr(each, "variable", each)
        # Zarr has no specification of text of fixed width, and warns of it.
        variable = variable.astype(object) if variable.dtype.kind == "U" else variable
        if variable.dims == (name,) and name not in indexes:
            variable = variable.to_index_variable()
            known[name] = PandasIndex(variable.to_index(), name)
        variables[name] = variable
    return raster_of(array.variable, variables, {**known, **indexes}, array.name)


def with_values(array, data):
    """Raster with other values, in a tenth of the time of a copy."""
    variable = xr.Variable(array.dims, data, array.attrs, array.encoding)
    return raster_of(variable, array.coords.variables, array.xindexes, array.name)


def raster_of(variable, coordinates, indexes, name=None):
    """Raster of the values of a variable, with those coordinates, and their indexes, that lie along its dimensions."""
    # By internal parameters of xarray's constructor, which takes 15 us for 300 of the public way. Coordinates are
    # shared, as by methods of xarray.
    own = {key: each for key, each in coordinates.items() if set(each.dims) <= set(variable.dims)}
    kept = {key: index for key, index in indexes.items() if key in own}
    return xr.DataArray(variable.copy(deep=False), own, name=name, indexes=kept, fastpath=True)


class _Place(NamedTuple):
    """Coordinates of a grid, and the grid as `geobox` would read it from them."""

    variables: dict
    indexes: dict
    grid: GeoBox


# Cached, because every step of a chain needs them.
@cached(64, "coordinates of grids", projection.key_of)
def _place_on(grid):
    variables, indexes = {}, {}
    for axis, values in zip(("y", "x"), centres_of(grid), strict=True):
        attrs = {"standard_name": f"projection_{axis}_coordinate", "long_name": f"{axis} coordinate of projection"}
        attrs |= {"units": "m", "axis": axis.upper()}
        # xarray would write a fill value, which CF forbids for coordinate variables (section 2.5.1).
        variables[axis] = xr.IndexVariable(axis, values, attrs, {"_FillValue": None})
        indexes[axis] = PandasIndex(variables[axis].to_index(), axis)
    lattice = on_lattice(grid)
    transform = " ".join(f"{number:.24f}".rstrip("0").rstrip(".") for number in lattice.affine.to_gdal())
    variables["spatial_ref"] = reference = _reference(lattice.crs).copy(deep=False)
    reference.attrs["GeoTransform"] = transform
    _remember(variables, indexes, as_carried(grid))
    return _Place(variables, indexes, as_carried(grid))


# Coordinates and their grid, by the identity of the pandas index of x, which copies of a raster share. Reading the grid
# from the coordinates takes 0.5 ms, several times in each step.
_placed = Results(512, "grids of coordinates")


def _remember(variables, indexes, grid):
    """Remember the grid of coordinates, for rasters that share them."""
    if {"y", "x"} <= set(indexes) and "spatial_ref" in variables:
        # Attributes of the coordinate of a raster may be changed in place.
        reference = {"spatial_ref": variables["spatial_ref"].copy(deep=False)}
        _placed[id(indexes["x"].to_pandas_index())] = _Place(reference, dict(indexes), grid)


def _placed_grid(array):
    """Grid of a raster with coordinate objects whose grid is known, or None."""
    if not isinstance(array, xr.DataArray):
        return None
    reference, indexes = array.coords.variables.get("spatial_ref"), array.xindexes
    if reference is None or "x" not in indexes or "y" not in indexes:
        return None
    known = _placed.get(id(indexes["x"].to_pandas_index()))
    if known is None or indexes["y"].to_pandas_index() is not known.indexes["y"].to_pandas_index():
        return None
    return known.grid if reference.attrs == known.variables["spatial_ref"].attrs else None


def on_same_coordinates(arrays):
    """Whether arrays are known to be on one grid."""
    first = _placed_grid(arrays[0])
    return first is not None and all(_placed_grid(each) is first for each in arrays[1:])


def same_grid(one, other):
    """Whether two grids have the same cells, within a thousandth of a cell."""
    if one.shape != other.shape or one.crs != other.crs:
        return False
    corners = [
        [projection.transform_points(grid.affine, *corner) for corner in ((0, 0), grid.shape.xy)]
        for grid in (one, other)
    ]
    return bool(np.allclose(*corners, rtol=0, atol=1e-3 * min(abs(one.affine.a), abs(one.affine.e))))


def aligned_grid(grid, pixel):
    """Coarser grid with the same upper left corner, of as many whole pixels as fit."""
    down, across = np.broadcast_to(np.asarray(pixel, float), 2)
    a = grid.affine
    height, width = -a.e * grid.shape.y, a.a * grid.shape.x
    if not (min(down, across) > 0 and min(shape := (int(height / down + 1e-6), int(width / across + 1e-6))) > 0):
        raise ValueError(f"no pixel of {down:g} x {across:g} m fits into a scene of {height:g} x {width:g} m")
    # Much smaller pixels are probably given in km.
    if min(-a.e / down, a.a / across) > 50:
        raise ValueError(f"pixels must be at least 1/50 of a cell of {a.a:g} m, got {across:g} m: give metres, not km")
    return GeoBox(shape, Affine(across, 0.0, a.c, 0.0, -down, a.f), grid.crs)


def lattice_position(grid):
    """Row and column of the first cell of a grid, in its cells from the origin of its CRS, southward and eastward."""
    a = grid.affine
    return whole_cells(a.f, a.e)[0], whole_cells(a.c, a.a)[0]


def lattice_offset(one, other):
    """Rows and columns from the first cell of one grid to the first of another with the same cells."""
    a, b = one.affine, other.affine
    same_cell = np.allclose((a.a, a.e), (b.a, b.e), rtol=1e-6)
    rows, columns = (b.f - a.f) / a.e, (b.c - a.c) / a.a
    if one.crs != other.crs or not same_cell or max(abs(rows - round(rows)), abs(columns - round(columns))) > 1e-3:
        raise ValueError(
            f"the rasters have different lattices, {in_words(one)} and {in_words(other)}: {onto_words(one, other)}"
        )
    return round(rows), round(columns)


def onto_words(one, other):
    """Text of the call that brings a raster of one of two grids onto the other."""
    cells = sorted([one.affine.a, other.affine.a])
    coarser = one.crs == other.crs and cells[1] > 1.01 * cells[0]
    finer = f"the finer one with .fifesim.aggregate({cells[1]:g}), or " if coarser else ""
    return f"bring {finer}one onto the other with .rio.reproject_match(other)"


def cell_size(grid):
    """Cell size of a grid, down and across. [m]"""
    return -grid.affine.e, grid.affine.a


def extent(grid):
    """Text of the bounds of a grid."""
    box = grid.boundingbox
    return f"{box.left:.0f} to {box.right:.0f} E and {box.bottom:.0f} to {box.top:.0f} N"


def in_words(grid):
    """Text of a grid, for messages."""
    a = grid.affine
    return (
        f"{grid.shape.y} x {grid.shape.x} cells of {-a.e:g} x {a.a:g} m from {a.c:.3f} E {a.f:.3f} N "
        f"in {projection.name_of(grid.crs.proj)}"
    )


def with_crs_of(array, main):
    """Raster that lost its CRS, as by ``xr.where``, with the CRS of another on the same cells; others stay."""
    if (
        _placed_grid(array) is not None
        or {"y", "x"} - set(array.dims)
        or array.odc.crs is not None
        or main.odc.crs is None
    ):
        return array
    grid = geobox(main)
    for axis, size in zip(("y", "x"), cell_size(grid), strict=True):
        known, own = (raster.coords.get(axis) for raster in (main, array))
        if known is None or own is None or known.shape != own.shape:
            return array
        if not np.allclose(own.values.astype(float), known.values, rtol=0, atol=1e-3 * size):
            return array
    return place(array, grid)


# By their identifiers: CRS of a group's arrays, and the affine transform of their rows and columns, as of version 0.1,
# https://github.com/zarr-conventions/proj and https://github.com/zarr-conventions/spatial.
_CONVENTIONS = {
    "proj": ("f17cb550-5864-4468-aeb7-f3180cfb622f", "Coordinate reference system information for geospatial data"),
    "spatial": ("689b58e2-cf7b-45e0-9fff-9cfc0883d6b4", "Spatial coordinate information"),
}


def geozarr_attributes(grid):
    """Attributes of a Zarr group on a grid, by the conventions ``proj`` and ``spatial``, in addition to CF."""
    box = grid.boundingbox
    return {
        "zarr_conventions": [
            {
                "uuid": uuid,
                "name": name,
                "schema_url": f"https://raw.githubusercontent.com/zarr-conventions/{name}/refs/tags/v0.1/schema.json",
                "spec_url": f"https://github.com/zarr-conventions/{name}/blob/v0.1/README.md",
                "description": description,
            }
            for name, (uuid, description) in _CONVENTIONS.items()
        ],
        **crs_fields(grid.crs.proj),
        "spatial:dimensions": ["y", "x"],
        "spatial:transform": list(grid.affine)[:6],
        "spatial:shape": list(grid.shape),
        "spatial:bbox": [box.left, box.bottom, box.right, box.top],
        "spatial:registration": "pixel",
    }


def crs_fields(crs):
    """CRS by its code, or in full if it has none, as ``proj:code`` or ``proj:wkt2``."""
    crs = pyproj.CRS.from_user_input(crs)
    authority = crs.to_authority(min_confidence=100)
    return {"proj:code": ":".join(authority)} if authority else {"proj:wkt2": crs.to_wkt()}
