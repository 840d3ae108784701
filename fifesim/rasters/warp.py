"""Bring a raster file onto a grid, by an operation between the two CRSs whose accuracy is known."""

from contextlib import contextmanager
from functools import lru_cache, partial
from itertools import product
from threading import Lock

import numpy as np
import pyproj
import rasterio
import rasterio.windows
from affine import Affine
from odc.geo.geobox import GeoBox
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info
from rasterio.enums import Resampling
from rasterio.warp import reproject

from fifesim.base.lattice import assemble
from fifesim.rasters import grid as grids
from fifesim.rasters import places, projection
from fifesim.rasters.opening import ErrorsOfGdal, raster_file
from fifesim.rasters.soundness import check_raster, horizontal_crs
from fifesim.rasters.whereabouts import lies_in_words

# Cells are made in fixed tiles of this size, so that the warper's rounding is the same under any chunking.
_TILE = 512

# The warper takes positions as linear along a row, up to an eighth of a file's cell. Over so few cells that leaves
# millimetres for cells of 10 m, a centimetre for 30 m.
_STRIP = 32

# rasterio silences a warning of its own around each call, in a way that is not safe among threads.
_ONE_AT_A_TIME = Lock()

# Where a cell holds more cells of the file than so many along an axis, a tile is made by blocks, each of which reads at
# most so many of them along an axis: 100 MB with the warper's own. Of one cell that holds more, so many are the limit.
_MUCH_FINER = 6
_LONGEST = 2048
_MOST_CELLS = 2**26

# Bilinear interpolation reads one source cell around; an average as many as fit into a target cell.
_SOURCE_MARGIN = 4


def file_onto_grid(path, grid, chunks=None, allow_remote=False):
    """
    One band of a raster file on a grid.

    Cells no larger than the file's are interpolated bilinearly, larger ones hold means. A file whose cells are those of
    the grid is read as it is.

    Parameters
    ----------
    path : str or path
    grid : odc.geo.geobox.GeoBox
    chunks : mapping or int, optional
        Makes the result lazy.
    allow_remote : bool, optional
        As of `fifesim.rasters.opening.raster_file`.

    Returns
    -------
    array : xarray.DataArray, dims (y, x)
        NaN where the file has no data.

    Raises
    ------
    ValueError
        If the file is missing or not to be opened, has no CRS, lies elsewhere, or needs a change of datum of unknown
        accuracy.
    """
    grids.check_grid(grid)
    file = raster_file(path, allow_remote)
    with _checked(file) as (source, crs):
        area = projection.degrees(grid)
        pipeline, _ = projection.operation(crs, grid.crs.to_wkt(), area)
        back, _ = projection.operation(grid.crs.to_wkt(), crs, area)
        if _source_window(source, crs, grid, back) is None:
            lies = lies_in_words(source.transform, source.shape, crs)
            raise ValueError(
                f"{file.name} does not overlap the grid, which spans {grids.extent(grid)} in "
                f"{projection.name_of(grid.crs.proj)}: the file spans {lies}"
            )
    # A file that has changed is another file to the cache.
    make_tile = partial(_warp_tile, file, file.state, grid, pipeline, back)
    row, column = grids.lattice_position(grid)

    def kernel(first_row, first_column, shape):
        return assemble(make_tile, _TILE, row + first_row, column + first_column, shape)

    return places.tiles(kernel, grid, chunks, tile=_TILE)


def covering_grid(path, cell, pixel, crs=None):
    """
    Grid that covers a raster file, from and to whole pixels of its CRS.

    Parameters
    ----------
    path : str or path
    cell : float
        [m]
    pixel : float
        Size that the corners are multiples of. [m]
    crs : str, optional
        Of the grid; by default the file's where that is projected, else its UTM zone.

    Returns
    -------
    grid : odc.geo.geobox.GeoBox

    Raises
    ------
    ValueError
        If the file is missing, has no CRS, or the grid's CRS is not in metres or not known to reach it.
    """
    file = raster_file(path)
    with _checked(file) as (source, own):
        own = pyproj.CRS.from_user_input(own)
        outline = [np.linspace(0, size, 17) for size in (source.width, source.height)]
        columns, rows = (values.ravel() for values in np.meshgrid(*outline))
        x, y = projection.transform_points(source.transform, columns, rows)
        lies = lies_in_words(source.transform, source.shape, own)
    to_degrees = pyproj.Transformer.from_crs(own, 4326, always_xy=True)
    area = to_degrees.transform_bounds(x.min(), y.min(), x.max(), y.max()) if crs or own.is_geographic else None
    if crs is not None:
        crs = pyproj.CRS.from_user_input(projection.horizontal(crs))
    else:
        crs = _utm(own, x, y) if own.is_geographic else own
    if crs != own:
        pipeline, _ = projection.operation(own, crs, area)
        x, y = projection.carry(pipeline, own, crs, x, y)
        if not np.isfinite([x, y]).all():
            raise ValueError(f"{projection.name_of(crs)} does not reach {file.name}: it spans {lies}")
        projection.check_metres(crs, (x.min(), y.min(), x.max(), y.max()))
    west, north = np.floor(np.min(x) / pixel) * pixel, np.ceil(np.max(y) / pixel) * pixel
    width, height = np.ceil((np.max(x) - west) / pixel) * pixel, np.ceil((north - np.min(y)) / pixel) * pixel
    name = f"EPSG:{crs.to_epsg()}" if crs.to_epsg() else crs.to_wkt()
    return grids.grid_at(name, float(west), float(north), float(width), float(height), cell)


def _utm(crs, longitude, latitude):
    """UTM zone of the middle of some places, in their own datum where it is NAD83, else in WGS 84."""
    datum = "NAD83" if crs.datum is not None and crs.datum.name == "North American Datum 1983" else "WGS 84"
    middle = AreaOfInterest(*(float(np.mean(values)) for values in (longitude, latitude) * 2))
    return pyproj.CRS.from_epsg(query_utm_crs_info(datum_name=datum, area_of_interest=middle)[0].code)


@contextmanager
def _checked(file):
    """The open file, which holds numbers at places on the Earth, and the reference system of these."""
    with ErrorsOfGdal(f"cannot read {file.name}"), file.opened() as source:
        check_raster(source, file.name)
        yield source, horizontal_crs(source, file.name)


def _source_places(source, crs, grid, back):
    """Rows and columns of a file at the outline of a grid, and at its middle."""
    share = np.linspace(0, 1, 17)
    columns, rows = (values.ravel() for values in np.meshgrid(share * grid.shape.x, share * grid.shape.y))
    x, y = projection.transform_points(grid.affine, columns, rows)
    x, y = projection.carry(back, grid.crs.to_wkt(), crs, x, y)
    columns, rows = projection.transform_points(~source.transform, x, y)
    return rows, columns


def _source_window(source, crs, grid, back):
    """Window of the file that a grid reads; None where they do not meet, or its CRS does not reach the grid."""
    rows, columns = _source_places(source, crs, grid, back)
    if not np.isfinite([rows, columns]).all():
        return None
    around = _SOURCE_MARGIN
    top, bottom = max(int(np.min(rows)) - around, 0), min(int(np.max(rows)) + around + 1, source.height)
    left, right = max(int(np.min(columns)) - around, 0), min(int(np.max(columns)) + around + 1, source.width)
    return rasterio.windows.Window(left, top, right - left, bottom - top) if bottom > top and right > left else None


def _cells_per_cell(source, crs, grid, back):
    """Cells of the file, down and across, in one of the grid."""
    places = _source_places(source, crs, grid, back)
    return [np.ptp(each) / size for each, size in zip(places, grid.shape, strict=True)]


@lru_cache(maxsize=16)
def _warp_tile(file, state, grid, pipeline, back, tile_row, tile_column):
    """One lattice tile of the file's first band, in its physical unit; blocks that do not meet the grid stay empty."""
    row, column = grids.lattice_position(grid)
    top, left = tile_row * _TILE - row, tile_column * _TILE - column
    out = np.full((_TILE, _TILE), np.nan)
    with _checked(file) as (source, crs):
        options = {"src_crs": crs, "src_nodata": np.nan}
        options |= {"dst_crs": rasterio.crs.CRS.from_wkt(grid.crs.to_wkt()), "dst_nodata": np.nan}
        finer = max(_cells_per_cell(source, crs, grid, back)) > 1.01
        options |= {"resampling": Resampling.average if finer else Resampling.bilinear}
        options |= {"COORDINATE_OPERATION": pipeline} if pipeline else {}
        # Of the tile, not of the grid, so that it is the same in every window.
        size = _block_size(max(_cells_per_cell(source, crs, _part(grid, top, left, _TILE), back)))
        for down, across in product(range(0, _TILE, size), repeat=2):
            first, start = top + down, left + across
            if -size < first < grid.shape.y and -size < start < grid.shape.x:
                block = _part(grid, first, start, size)
                out[down : down + size, across : across + size] = _warp_block(source, file.name, block, back, options)
    return out


def _part(grid, row, column, size):
    """A square of a grid's lattice, which may reach beyond it."""
    west, north = projection.transform_points(grid.affine, column, row)
    return GeoBox((size, size), Affine(grid.affine.a, 0.0, west, 0.0, grid.affine.e, north), grid.crs)


def _block_size(cells):
    """Cells along a block that is read at once, of which each holds so many of the file's along an axis."""
    if cells <= _MUCH_FINER:
        return _TILE
    size = _STRIP
    while size > 1 and size * cells > _LONGEST:
        size //= 2
    return size


def _warp_block(source, name, block, back, options):
    """A block of cells, from one window of the file."""
    size, a = block.shape.x, block.affine
    out = np.full((size, size), np.nan)
    window = _source_window(source, options["src_crs"], block, back)
    if window is None:
        return out
    if window.width * window.height > _MOST_CELLS:
        raise ValueError(
            f"{name} is far finer than the cells, {window.width * window.height:.2g} of its cells lie in {size} x "
            f"{size}: average it first, with gdalwarp -r average -tr and a cell between the two"
        )
    values = source.read(1, window=window, masked=True).astype(float).filled(np.nan)
    values = values * source.scales[0] + source.offsets[0]
    for first in range(0, size, _STRIP):
        strip = np.full((size, min(size, _STRIP)), np.nan)
        transform = Affine(a.a, 0.0, a.c + first * a.a, 0.0, a.e, a.f)
        with _ONE_AT_A_TIME:
            reproject(values, strip, src_transform=source.window_transform(window), dst_transform=transform, **options)
        out[:, first : first + _STRIP] = strip
    return out
