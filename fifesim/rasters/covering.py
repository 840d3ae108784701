"""The grid that covers a raster file."""

import numpy as np
import pyproj
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info

from fifesim.rasters import grid as grids
from fifesim.rasters import projection
from fifesim.rasters.opening import raster_file
from fifesim.rasters.soundness import sound_raster
from fifesim.rasters.whereabouts import lies_in_words


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
    with sound_raster(file) as (source, own):
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
