"""GeoTIFF files with metadata for GIS, which are read back unchanged."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import dask.array as da
import numpy as np
import rasterio
import rasterio.errors
import rasterio.shutil
import xarray as xr
from dask.utils import SerializableLock
from rasterio.enums import ColorInterp
from rioxarray.raster_writer import RasterioWriter

from fifesim.base.arguments import Chunks, FilePath
from fifesim.base.bands import BLUE, GREEN, NEAR_INFRARED, RED, nearest_band
from fifesim.base.files import check_suffix, check_target, in_a_line, whole_file
from fifesim.base.geometry import ANGLES
from fifesim.base.messages import warn
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.grids.chunks import found_client
from fifesim.grids.inputs import RASTER_OR_DATASET, STORAGE, no_data_of, opened, scale_and_offset, storage, unpacked
from fifesim.grids.opening import check_memory, errors_of_gdal, raster_file, sound_raster, stored_cells
from fifesim.grids.tags import (
    DAYS,
    TAG,
    band_names,
    band_units,
    fingerprint_of,
    read_tag,
    restored,
    tag_of,
    with_layers,
)


def _gdal_description(source, file_name):
    """Names, calibration and wavelengths of a file that fifesim did not write."""
    names = [name or f"band{number}" for number, name in enumerate(source.descriptions, 1)]
    values = {"wavelength": _wavelengths(source, file_name)}
    counts = np.dtype(source.dtypes[0]).kind == "u" and set(source.units) == {cf.QUANTITIES["toa_radiance"].units}
    if counts and set(zip(source.scales, source.offsets, strict=True)) == {(1.0, 0.0)}:
        raise ValueError(
            f"the bands of {file_name} have units of radiance and no scale, so that their digital numbers have no "
            "calibration: give them one (rasterio: scales, offsets), or convert radiance to fractions with "
            "gdal_translate -ot Float32"
        )
    if counts:
        values |= {"gain": list(source.scales), "offset": list(source.offsets)}
    coords = {"band": xr.DataArray(names, dims="band")}
    coords |= {
        name: xr.DataArray(value, dims="band", attrs=cf.attributes(name)) for name, value in values.items() if value
    }
    shared = source.units[0] if len(set(source.units)) == 1 else None
    units = {} if counts or not shared else {"units": shared}
    return {"name": "image", "dims": ["band", "y", "x"], "attrs": units, "coords": coords}


def _wavelengths(source, file_name):
    """Wavelengths of all bands [um], or None."""
    texts = [source.tags(number, ns="IMAGERY").get("CENTRAL_WAVELENGTH_UM") for number in source.indexes]
    try:
        return [float(text) for text in texts] if all(texts) else None
    except ValueError:
        raise ValueError(
            f"{file_name} has wavelengths such as {in_a_line(texts[0], 40)!r}, not all numbers: open it with "
            "rioxarray.open_rasterio"
        ) from None


# Names in rasterio; GDAL has one for the near infrared since 3.10.
_COLOURS = {
    ColorInterp.red: RED,
    ColorInterp.green: GREEN,
    ColorInterp.blue: BLUE,
    getattr(ColorInterp, "nir", ColorInterp.undefined): NEAR_INFRARED,
}

# Tags as in Landsat metadata. SUN_ELEVATION is the angle above the horizon.
_TAGS = {"saa": "SUN_AZIMUTH", "vza": "VIEW_ZENITH", "vaa": "VIEW_AZIMUTH", "earth_sun_distance": "EARTH_SUN_DISTANCE"}


def colours(array):
    """Colour interpretation of bands by their wavelengths; red, green, blue and near infrared go to one band each."""
    found = [ColorInterp.undefined] * array.sizes["band"]
    if "wavelength" in array.coords:
        wavelengths = np.atleast_1d(array["wavelength"].values)
        for colour, window in _COLOURS.items():
            if (number := nearest_band(wavelengths, window)) is not None:
                found[number] = colour
    return [ColorInterp.gray] if found == [ColorInterp.undefined] else found


def tags_of(array):
    """Tags of sun, view and time that readers of satellite images expect, of the file and of the domain ``IMAGERY``."""
    scalars = {name: value.values[()] for name, value in array.coords.items() if not value.dims}
    tags = {tag: f"{float(scalars[name]):.9g}" for name, tag in _TAGS.items() if name in scalars}
    if "sza" in scalars:
        tags["SUN_ELEVATION"] = f"{90 - float(scalars['sza']):.9g}"
    imagery = {}
    time = scalars.get("time")
    if isinstance(time, np.datetime64) and not np.isnat(time):
        date, clock = np.datetime_as_string(time, unit="s").split("T")
        tags["TIFFTAG_DATETIME"] = f"{date.replace('-', ':')} {clock}"
        imagery["ACQUISITIONDATETIME"] = f"{date} {clock}"
    return tags, imagery


# GDAL's own block size for cloud-optimised files.
_BLOCK = 512

# Blocks of several bands are written together up to this size. [byte]
_AT_ONCE = 16 * 2**20

# Coordinates that each band of an image has.
_OF_A_BAND = ("wavelength", "gain", "offset", "compression", "solar_irradiance", "adjustment_error", "contrast_left")

_TILED = {"driver": "GTiff", "tiled": True, "blockxsize": _BLOCK, "blockysize": _BLOCK, "bigtiff": "if_safer"}
# Noisy data compress little. The lowest level of zlib takes 60 % of the time, and files are 2 % (floats) or 5 %
# (digital numbers) larger.
_COG = {"driver": "COG", "compress": "deflate", "level": 1, "predictor": "yes", "overview_resampling": "average"}
# Without this, GDAL drops the IMAGERY metadata of the file.
_COG |= {"copy_src_mdd": "yes"}


def to_geotiff(
    raster: Annotated[xr.DataArray | xr.Dataset, RASTER_OR_DATASET._replace(stored=True)],
    path: FilePath,
    *,
    overwrite: bool = False,
    tags: Mapping[str, str] | None = None,
) -> Path:
    """
    Write a raster as a cloud-optimised GeoTIFF.

    The file is moved into place when it is complete. Lazy data are computed and written chunk by chunk.

    Parameters
    ----------
    raster : xarray.DataArray, dims ([band], y, x), or xarray.Dataset of variables over (y, x)
        One selected band of an image is written with a dimension ``band``. The variables of a dataset become bands;
        intervals by ``level`` become one band for each level, such as ``lai_low_95``.
    path : str or path
    overwrite : bool, optional
        Replace an existing file.
    tags : mapping of str to str, optional
        Additional tags of the file, which `open_image` ignores.

    Returns
    -------
    path : pathlib.Path

    Raises
    ------
    ValueError
        If the raster has no projected grid, or other dimensions, or the name does not end in .tif or .tiff.
    FileExistsError
        If the file exists and ``overwrite`` is False.
    OSError
        If the path is a folder, or the file cannot be written.

    Notes
    -----
    Bands have names, units, scale and offset, and ``CENTRAL_WAVELENGTH_UM`` in the ``IMAGERY`` domain if the wavelength
    is known. Attributes and sun angles are written as tags, also in Landsat's spelling (``SUN_ELEVATION``); a
    coordinate ``time`` as ``TIFFTAG_DATETIME`` and ``ACQUISITIONDATETIME``. Colour interpretation follows the
    wavelengths, not the band order. Angles that vary by cell are not written, with a warning. Dates by cell, for
    example of a composite, become a band in days since 1970-01-01. The tag ``FIFESIM`` has values of up to 64 cells per
    band, which `open_image` uses to verify the file.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> path = lai.fifesim.to_geotiff(f"{mkdtemp()}/lai.tif")
    >>> fifesim.open_image(path).shape
    (90, 90)
    """
    path = Path(path)
    check_target(path)
    check_suffix(path, "GeoTIFF", ".tif", ".tiff")
    if path.exists() and not overwrite:
        raise FileExistsError(
            f"there is a file {in_a_line(path, 150)}: type overwrite=True to replace it, or another name"
        )
    if isinstance(raster, xr.DataArray) and "band" in raster.coords and "band" not in raster.dims:
        # One band of an image keeps its calibration and wavelength along the dimension.
        raster = raster.expand_dims("band")
        own = [name for name in _OF_A_BAND if name in raster.coords]
        raster = raster.assign_coords({name: raster.coords[name].expand_dims("band") for name in own})
    array = _stacked(opened(raster)) if isinstance(raster, xr.Dataset) else raster
    if not cf.is_counts(array):
        # Reflectance of a dataset carries the calibration of the digital numbers next to it.
        array = array.drop_vars(["gain", "offset", "compression"], errors="ignore")
        # A scale of fractions raises an error; a scale from the encoding is kept in the tag.
        unpacked(array)
        array = array.assign_attrs({key: value for key, value in storage(array).items() if key in STORAGE})
    if "line" in array.dims:
        raise ValueError("a GeoTIFF needs a map, got dimensions line and sample: map the scan with .grid_swath(grid)")
    if not set(array.dims) <= {"band", "y", "x"}:
        raise ValueError(f"a GeoTIFF holds dimensions (band, y, x), got {array.dims}: select or rename")
    array = array if "band" in array.dims else array.expand_dims("band")
    array = array.transpose("band", "y", "x")
    grid = grids.geobox(array)
    dates = [name for name, value in array.coords.items() if value.dtype.kind == "M" and {"y", "x"} <= set(value.dims)]
    layers = dates if array.dtype.kind == "f" else []
    varying: list = [name for name in ANGLES if name in array.coords and array.coords[name].ndim]
    varying += [name for name in dates if name not in layers]
    cells = with_layers(array, layers)
    _check_room(cells, path)
    if varying:
        warn(
            f"{path.name} lacks {', '.join(varying)}, which vary by cell, so another geometry would be "
            "used after reading it: give geometry= when you read it, or write a netCDF with .to_netcdf()"
        )
    with whole_file(path) as finished, errors_of_gdal(f"cannot write {path}"):
        streamed = finished.with_name("streamed.tif")
        _stream(array, cells, layers, grid, streamed, raster, tags or {})
        rasterio.shutil.copy(streamed, finished, blocksize=_BLOCK, **_COG)
        _check_written(streamed, finished, cells)
    # Remove statistics of the replaced file, which GDAL or a GIS would use for the new file.
    path.with_name(f"{path.name}.aux.xml").unlink(missing_ok=True)
    return path


def open_image(path: FilePath, chunks: Chunks | None = None, *, allow_remote: bool = False) -> xr.DataArray:
    """
    Open a GeoTIFF image with its bands, wavelengths, sun angles and calibration.

    Parameters
    ----------
    path : str or path
        File written by `to_geotiff`, or another file, whose band metadata are read by GDAL.
    chunks : mapping or int, optional
        Chunks of a lazy result; in memory by default.
    allow_remote : bool, optional
        Also open remote files and formats that refer to other files. Use this only for trusted files.

    Returns
    -------
    raster : xarray.DataArray, dims ([band], y, x)
        The raster as it was written. If bands were removed or reordered, each keeps its name and calibration. Digital
        numbers are not masked; 0 is no data. For other files, values in physical units with NaN for no data, or digital
        numbers if the file has a scale to radiance.

    Raises
    ------
    ValueError
        If the file is not a raster, has an unsupported format, has no north-up grid in metres, or does not fit into
        memory; if another program changed its values, or the bands cannot be identified. Values of a lazy result are
        checked when they are computed.
    OSError
        If the cells cannot be read.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> path = image.fifesim.to_geotiff(f"{mkdtemp()}/tm.tif")
    >>> fifesim.open_image(path).identical(image)
    True
    """
    file = raster_file(path, allow_remote)
    with sound_raster(file, north_up=True) as (source, crs):
        if chunks is None:
            cells, size = source.count * source.height * source.width, np.dtype(source.dtypes[0]).itemsize
            check_memory(cells, size, f"all of {file.name}", "give chunks='auto', which reads it by parts")
        description = read_tag(source, file.name)
        cells, nodata = stored_cells(file, crs, chunks), source.nodata
        packing = {"scales": source.scales, "offsets": source.offsets, "_FillValue": nodata}
        written_here = description is not None
        description = description or _gdal_description(source, file.name)
    if written_here:
        array = restored(cells.drop_vars(cells.coords), description)
    elif "gain" in description["coords"]:
        array = cells if nodata is None else cells.where(cells != nodata, cells.dtype.type(0))
    else:
        # Fractions of a file have no scale applied, and become double precision with a value for no data.
        array = unpacked(cells if nodata is None else cells.astype(float), packing)
    array = grids.place(array.rename(description["name"]).assign_coords(description["coords"]), grids.geobox(cells))
    array.attrs = dict(description["attrs"]) | array.attrs
    if "gain" in array.coords:
        array.attrs["_FillValue"] = array.dtype.type(0)
    return array if "band" in description["dims"] else array.isel(band=0, drop=True)


def _stacked(dataset):
    """Variables of a dataset as bands."""
    names, bands = [], []
    for name, each in dataset.data_vars.items():
        each = each.drop_vars(["band"], errors="ignore")
        levels = each["level"].values.tolist() if "level" in each.dims else [None]
        names += [str(name) if level is None else f"{name}_{100 * level:g}" for level in levels]
        bands += [each if level is None else each.sel(level=level, drop=True) for level in levels]
    dim = xr.DataArray(names, dims="band", name="band")
    array = xr.concat(bands, dim, combine_attrs="drop", coords="minimal", compat="override")
    array.attrs = {"history": bands[0].attrs.get("history", "")}
    return array.rename(None)


def _streamed_bytes(array):
    """Size of the cells of a tiled file, all of whose tiles are complete. [byte]"""
    rows, columns = (-(-size // _BLOCK) * _BLOCK for size in array.shape[-2:])
    return array.sizes["band"] * rows * columns * array.dtype.itemsize


def _check_room(array, path):
    """Raise OSError if the disk is too full, for which GDAL prints many lines."""
    # The stream, and at worst as much again with overviews.
    needed, free = _streamed_bytes(array) + 1.4 * array.nbytes, shutil.disk_usage(path.parent).free
    if free < needed:
        message = f"{os.strerror(errno.ENOSPC)}: {needed / 1e6:.1f} MB are needed, {free / 1e6:.1f} MB are free"
        raise OSError(errno.ENOSPC, message, str(path))


def _check_written(streamed, finished, array):
    """Compare a finished file with its stream: GDAL does not report a disk that is full when files are closed."""
    with rasterio.open(streamed) as one, rasterio.open(finished) as other:
        if os.path.getsize(streamed) < _streamed_bytes(array):
            raise rasterio.errors.RasterioIOError("the disk did not take all of it")
        for _, window in other.block_windows(1):
            blocks = one.read(window=window), other.read(window=window)
            if not np.array_equal(*blocks, equal_nan=array.dtype.kind == "f"):
                raise rasterio.errors.RasterioIOError("what was written is not what is read")


def _stream(array, cells, layers, grid, path, described, further):
    """Write a tiled GeoTIFF block by block, with all metadata of an array."""
    rows, columns, crs = grid.shape.y, grid.shape.x, rasterio.crs.CRS.from_wkt(grid.crs.to_wkt())
    # Without `photometric`, three 8-bit bands would be interpreted as red, green and blue.
    with rasterio.open(
        path, "w", dtype=cells.dtype.name, count=cells.sizes["band"], height=rows, width=columns, crs=crs,
        transform=grid.affine, photometric="minisblack", nodata=no_data_of(array), **_TILED,
    ) as sink:  # fmt: skip
        kept = tag_of(array, described.dims if isinstance(described, xr.DataArray) else array.dims, layers)
        _describe(sink, array, kept)
        sink.update_tags(**{name: str(text) for name, text in further.items()})
        if not isinstance(cells.data, da.Array):
            sink.write(cells.values)
    if isinstance(cells.data, da.Array):
        # The file is opened for each block, which takes longer than writing a small block.
        largest = cells.dtype.itemsize * max(cells.chunks[-2]) * max(cells.chunks[-1])
        together = cells.sizes["band"] * largest <= _AT_ONCE
        data = cells.data.rechunk({0: -1}) if together else cells.data
        da.store(data, RasterioWriter(str(path)), lock=_lock(str(path)), compute=True)
    with rasterio.open(path, "r+") as sink:
        sink.update_tags(**{TAG: json.dumps(kept | {"cells": fingerprint_of(sink)})})


def _lock(name):
    """Lock for one writer at a time, among the workers of a cluster or among threads."""
    if found_client() is None:
        return SerializableLock()
    from distributed import Lock

    return Lock(name)


def _describe(sink, array, kept):
    scalars = {name: item["values"] for name, item in kept["coords"].items() if not item["dims"]}
    readable = {key: str(value) for key, value in (kept["attrs"] | scalars).items()}
    tags, imagery = tags_of(array)
    sink.update_tags(**tags | readable, AREA_OR_POINT="Area")
    sink.update_tags(ns="IMAGERY", **imagery)
    names, count, further = band_names(array), array.sizes["band"], list(kept["layers"])
    sink.colorinterp = colours(array) + [ColorInterp.undefined] * len(further)
    for number, name in enumerate([*names, *further], 1):
        sink.set_band_description(number, name)
    for number in range(1, count + 1):
        band = array.isel(band=number - 1)
        tags = {name: f"{float(band[name]):.9g}" for name in ("wavelength", "solar_irradiance") if name in band.coords}
        sink.update_tags(number, **tags)
        if "wavelength" in tags:
            sink.update_tags(number, ns="IMAGERY", CENTRAL_WAVELENGTH_UM=tags["wavelength"])
    sink.units = band_units(names, array.coords, array.attrs) + [DAYS] * len(further)
    scales, offsets = (np.broadcast_to(each, count).tolist() for each in scale_and_offset(array))
    sink.scales, sink.offsets = scales + [1.0] * len(further), offsets + [0.0] * len(further)
