"""Bring a raster file onto a grid, by an operation between the two CRSs whose accuracy is known."""

from functools import lru_cache, partial
from pathlib import Path
from threading import Lock

import numpy as np
import pyproj
import rasterio
import rasterio.errors
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

# Cells are made in fixed tiles of this size, so that the warper's rounding is the same under any chunking.
_TILE = 512

# The warper takes positions as linear along a row, up to an eighth of a file's cell. Over so few cells that leaves
# millimetres for cells of 10 m, a centimetre for 30 m.
_STRIP = 32

# rasterio silences a warning of its own around each call, in a way that is not safe among threads.
_ONE_AT_A_TIME = Lock()

# Bilinear interpolation reads one source cell around; an average as many as fit into a target cell.
_SOURCE_MARGIN = 4


def file_onto_grid(path, grid, chunks=None):
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

    Returns
    -------
    array : xarray.DataArray, dims (y, x)
        NaN where the file has no data.

    Raises
    ------
    ValueError
        If the file is missing, has no CRS, lies elsewhere, or needs a change of datum of unknown accuracy.
    """
    grids.check_grid(grid)
    with _opened(path) as source:
        area = projection.degrees(grid)
        pipeline, _ = projection.operation(source.crs, grid.crs.to_wkt(), area)
        back, _ = projection.operation(grid.crs.to_wkt(), source.crs, area)
        if _source_window(source, grid, back) is None:
            raise ValueError(f"{path} does not overlap the grid, which spans {grids.extent(grid)}")
    # A file that has changed is another file to the cache.
    state = Path(path).stat().st_mtime_ns
    make_tile = partial(_warp_tile, str(path), state, grid, pipeline, back)
    row, column = grids.lattice_position(grid)

    def kernel(first_row, first_column, shape):
        return assemble(make_tile, _TILE, row + first_row, column + first_column, shape)

    return places.tiles(kernel, grid, chunks, tile=_TILE)


def covering_grid(path, cell, pixel):
    """
    Grid that covers a raster file, from and to whole pixels of its CRS.

    Parameters
    ----------
    path : str or path
    cell : float
        [m]
    pixel : float
        Size that the corners are multiples of. [m]

    Returns
    -------
    grid : odc.geo.geobox.GeoBox
        In the file's CRS where that is projected, else in its UTM zone.

    Raises
    ------
    ValueError
        If the file is missing, has no CRS, or lies in a CRS that is not in metres.
    """
    with _opened(path) as source:
        crs = pyproj.CRS.from_user_input(source.crs)
        outline = [np.linspace(0, size, 17) for size in (source.width, source.height)]
        columns, rows = (values.ravel() for values in np.meshgrid(*outline))
        x, y = projection.transform_points(source.transform, columns, rows)
    if crs.is_geographic:
        target = _utm(crs, x, y)
        pipeline, _ = projection.operation(crs, target, (x.min(), y.min(), x.max(), y.max()))
        x, y = projection.carry(pipeline, crs, target, x, y)
        crs = target
    west, north = np.floor(np.min(x) / pixel) * pixel, np.ceil(np.max(y) / pixel) * pixel
    width, height = np.ceil((np.max(x) - west) / pixel) * pixel, np.ceil((north - np.min(y)) / pixel) * pixel
    name = f"EPSG:{crs.to_epsg()}" if crs.to_epsg() else crs.to_wkt()
    return grids.grid_at(name, float(west), float(north), float(width), float(height), cell)


def _utm(crs, longitude, latitude):
    """UTM zone of the middle of some places, in their own datum where it is NAD83, else in WGS 84."""
    datum = "NAD83" if crs.datum is not None and crs.datum.name == "North American Datum 1983" else "WGS 84"
    middle = AreaOfInterest(*(float(np.mean(values)) for values in (longitude, latitude) * 2))
    return pyproj.CRS.from_epsg(query_utm_crs_info(datum_name=datum, area_of_interest=middle)[0].code)


def _opened(path):
    if not Path(path).exists():
        raise ValueError(f"no raster file at {str(path)!r}")
    try:
        source = rasterio.open(path)
    except rasterio.errors.RasterioIOError as error:
        raise ValueError(f"cannot read {path} as a raster: {error}") from None
    if source.crs is None:
        source.close()
        raise ValueError(f"{path} has no CRS: give it one, for instance with gdal_edit.py -a_srs EPSG:26914")
    return source


def _source_places(source, grid, back):
    """Rows and columns of a file at the outline of a grid, and at its middle."""
    share = np.linspace(0, 1, 17)
    columns, rows = (values.ravel() for values in np.meshgrid(share * grid.shape.x, share * grid.shape.y))
    x, y = projection.transform_points(grid.affine, columns, rows)
    x, y = projection.carry(back, grid.crs.to_wkt(), source.crs, x, y)
    columns, rows = projection.transform_points(~source.transform, x, y)
    return rows, columns


def _source_window(source, grid, back):
    """Window of the file that a grid reads; None where they do not meet."""
    rows, columns = _source_places(source, grid, back)
    around = _SOURCE_MARGIN
    top, bottom = max(int(np.min(rows)) - around, 0), min(int(np.max(rows)) + around + 1, source.height)
    left, right = max(int(np.min(columns)) - around, 0), min(int(np.max(columns)) + around + 1, source.width)
    return rasterio.windows.Window(left, top, right - left, bottom - top) if bottom > top and right > left else None


@lru_cache(maxsize=16)
def _warp_tile(path, state, grid, pipeline, back, tile_row, tile_column):
    """One lattice tile of the file's first band, in its physical unit."""
    row, column = grids.lattice_position(grid)
    a = grid.affine
    west, north = projection.transform_points(a, tile_column * _TILE - column, tile_row * _TILE - row)
    tile = GeoBox((_TILE, _TILE), Affine(a.a, 0.0, west, 0.0, a.e, north), grid.crs)
    out = np.full((_TILE, _TILE), np.nan)
    with rasterio.open(path) as source:
        window = _source_window(source, tile, back)
        if window is None:
            return out
        try:
            values = source.read(1, window=window, masked=True).astype(float).filled(np.nan)
        except rasterio.errors.RasterioIOError as error:
            raise OSError(f"cannot read {path}: {error.__cause__ or error}") from error
        values = values * source.scales[0] + source.offsets[0]
        # Of the file in one of the grid, down and across.
        cells = [
            np.ptp(places) / size for places, size in zip(_source_places(source, grid, back), grid.shape, strict=True)
        ]
        options = {"src_transform": source.window_transform(window), "src_crs": source.crs, "src_nodata": np.nan}
        options |= {"dst_crs": rasterio.crs.CRS.from_wkt(grid.crs.to_wkt()), "dst_nodata": np.nan}
        options |= {"resampling": Resampling.average if max(cells) > 1.01 else Resampling.bilinear}
        options |= {"COORDINATE_OPERATION": pipeline} if pipeline else {}
        for first in range(0, _TILE, _STRIP):
            strip = np.full((_TILE, _STRIP), np.nan)
            transform = Affine(a.a, 0.0, west + first * a.a, 0.0, a.e, north)
            with _ONE_AT_A_TIME:
                reproject(values, strip, dst_transform=transform, **options)
            out[:, first : first + _STRIP] = strip
    return out
