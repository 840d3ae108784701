"""Whether an open raster holds real numbers at a place on the Earth."""

from contextlib import contextmanager

import numpy as np
import psutil
import pyproj
import pyproj.exceptions
import rasterio
import rasterio.errors

from fifesim.base.foreign import in_a_line
from fifesim.rasters import projection
from fifesim.rasters.opening import ErrorsOfGdal

# Coordinates beyond are none of the Earth's in any unit. [m or degree]
_FARTHEST = 1e9


@contextmanager
def sound_raster(file):
    """
    A context with an open file that holds numbers at places on the Earth.

    Parameters
    ----------
    file : fifesim.rasters.opening.RasterFile

    Yields
    ------
    source : rasterio.io.DatasetReader
    crs : rasterio.crs.CRS
        Of its places.

    Raises
    ------
    ValueError
        As `check_raster` and `horizontal_crs`.
    OSError
        If it cannot be read.
    """
    with ErrorsOfGdal(f"cannot read {file.name}"), file.opened() as source:
        check_raster(source, file.name)
        yield source, horizontal_crs(source, file.name)


def check_raster(source, name, *, north_up=False):
    """
    Refuse a raster whose cells are no real numbers, or have no place.

    Parameters
    ----------
    source : rasterio.io.DatasetReader
    name : str
        Of the file, for messages.
    north_up : bool
        Whether columns must run eastward and rows southward.

    Raises
    ------
    ValueError
        If there is no band, cells are complex, scales make no numbers of them, or there is no geotransform, or a
        degenerate one.
    """
    if not source.count:
        raise ValueError(f"{name} holds no band: take one of its rasters out of it with gdal_translate")
    if any(dtype.startswith("complex") for dtype in source.dtypes):
        raise ValueError(f"{name} holds complex numbers ({source.dtypes[0]}): write their real part or their modulus")
    for scale, offset in zip(source.scales, source.offsets, strict=True):
        if not np.isfinite([scale, offset]).all() or scale == 0:
            raise ValueError(
                f"{name} has a scale of {scale:g} and an offset of {offset:g}, which make no numbers of its cells: "
                "mend them with gdal_edit.py -a_scale 1 -a_offset 0"
            )
    _check_place(source, name, north_up)


def _check_place(source, name, north_up):
    a = source.transform
    if a.is_identity:
        lacks = "is placed by control points only" if source.gcps[0] else "has no geotransform"
        raise ValueError(f"{name} {lacks}: bring it onto a grid with gdalwarp -t_srs EPSG:26914")
    said = f"its geotransform is {tuple(float(f'{each:.6g}') for each in a[:6])}"
    columns, rows = np.meshgrid([0, source.width], [0, source.height])
    # What overflows is no place.
    with np.errstate(all="ignore"):
        farthest = np.abs(projection.transform_points(a, columns, rows)).max()
        placed = farthest < _FARTHEST and _has_area(a, farthest)
    if not placed:
        raise ValueError(f"the cells of {name} have no place on the Earth, {said}: mend it with gdal_edit.py -a_ullr")
    if north_up and (a.b or a.d or a.a < 0 or a.e > 0):
        raise ValueError(f"{name} is rotated or not north up, {said}: bring it onto a grid with gdalwarp")


def _has_area(a, farthest):
    """Whether cells are no lines, and so large that their coordinates differ."""
    across, down = np.hypot(a.a, a.d), np.hypot(a.b, a.e)
    return min(across, down) > 1e-12 * farthest and abs(a.a * a.e - a.b * a.d) > 1e-6 * across * down


def horizontal_crs(source, name):
    """
    Reference system of a raster's places, without that of its heights.

    Parameters
    ----------
    source : rasterio.io.DatasetReader
    name : str
        Of the file, for messages.

    Returns
    -------
    crs : rasterio.crs.CRS

    Raises
    ------
    ValueError
        If there is none, or it is not one of places on the Earth.
    """
    if source.crs is None:
        raise ValueError(f"{name} has no CRS: give it one, for instance with gdal_edit.py -a_srs EPSG:26914")
    try:
        whole = pyproj.CRS.from_wkt(source.crs.to_wkt())
        crs = (whole.sub_crs_list or [whole])[0]
        crs = crs.to_2d() if len(crs.axis_info) > 2 else crs
        if crs.is_projected or crs.is_geographic:
            return source.crs if crs is whole else rasterio.crs.CRS.from_wkt(crs.to_wkt())
        reason = f"it is a {in_a_line(crs.type_name, 40)}"
    except (pyproj.exceptions.ProjError, rasterio.errors.RasterioError, ValueError) as error:
        reason = in_a_line(error, 150)
    raise ValueError(
        f"the CRS of {name} is no projected nor geographic one ({reason}): "
        "give it one with gdal_edit.py -a_srs EPSG:26914"
    )


def check_memory(cells, itemsize, said, cure):
    """
    Refuse what does not fit into memory, before anything is made.

    Parameters
    ----------
    cells : int
    itemsize : float
        [byte]
    said : str
        What is to be made, such as "all of map.tif".
    cure : str
        What to do instead.

    Raises
    ------
    ValueError
        If there is not as much memory.
    """
    needed, free = cells * itemsize, psutil.virtual_memory().available
    if needed > 0.8 * free:
        raise ValueError(f"{said} takes {needed / 1e9:.3g} GB of memory, {free / 1e9:.2g} GB are free: {cure}")
