"""GeoTIFF files that a GIS opens in the right place, and that come back as they were."""

from __future__ import annotations

import errno
import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import contextmanager
from pathlib import Path

import dask.array as da
import numpy as np
import rasterio
import rasterio.errors
import rasterio.shutil
import xarray as xr
from dask.utils import SerializableLock
from rasterio.enums import ColorInterp
from rasterio.windows import Window

from fifesim.base.annotations import Chunks, FilePath
from fifesim.base.foreign import in_a_line
from fifesim.base.geometry import ANGLES
from fifesim.base.warned import warn
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import RasterOrDataset
from fifesim.rasters.clients import found_client
from fifesim.rasters.fingerprint import fingerprint_of
from fifesim.rasters.gdal_bands import gdal_description, physical
from fifesim.rasters.gis import colours, tags_of
from fifesim.rasters.opening import ErrorsOfGdal, raster_file, stored_cells
from fifesim.rasters.packed import no_data_of
from fifesim.rasters.soundness import check_memory, check_raster, horizontal_crs
from fifesim.rasters.stored_bands import DAYS, restored, with_layers
from fifesim.rasters.tags import TAG, band_names, band_units, read_tag, tag_of

# GDAL's own block size for cloud-optimised files.
_BLOCK = 512

# Blocks of single bands are written together where they are no more than that. [byte]
_AT_ONCE = 16 * 2**20

_TILED = {"driver": "GTiff", "tiled": True, "blockxsize": _BLOCK, "blockysize": _BLOCK, "bigtiff": "if_safer"}
# Of numbers that vary from cell to cell zlib finds little: its least effort takes three fifths of the time, for 2 %
# more bytes of floats and 5 % of digital numbers.
_COG = {"driver": "COG", "compress": "deflate", "level": 1, "predictor": "yes", "overview_resampling": "average"}
# Without it GDAL leaves behind what the whole file has in IMAGERY.
_COG |= {"copy_src_mdd": "yes"}


def to_geotiff(
    raster: RasterOrDataset, path: FilePath, *, overwrite: bool = False, tags: Mapping[str, str] | None = None
) -> Path:
    """
    Write a raster as a cloud-optimised GeoTIFF.

    The file appears under its name only when it is whole. Lazy data are computed and written chunk by chunk.

    Parameters
    ----------
    raster : xarray.DataArray, dims ([band], y, x), or xarray.Dataset of variables over (y, x)
        The variables of a dataset become bands.
    path : str or path
    overwrite : bool, optional
        Replace a file of that name.
    tags : mapping of str to str, optional
        Further tags of the file, which `open_image` leaves there.

    Returns
    -------
    path : pathlib.Path

    Raises
    ------
    ValueError
        If the raster has no projected grid or other dimensions.
    FileExistsError
        If there is such a file, and ``overwrite`` is not given.
    OSError
        If the file cannot be written.

    Notes
    -----
    Bands have names, units, scale and offset, and ``CENTRAL_WAVELENGTH_UM`` in the ``IMAGERY`` domain where there is a
    wavelength; attributes and the sun are tags, the latter also as Landsat's metadata spell them (``SUN_ELEVATION``), a
    coordinate ``time`` is ``TIFFTAG_DATETIME`` and ``ACQUISITIONDATETIME``. Red, green, blue and near infrared are
    what the wavelengths say, not the order of the bands. Angles that vary over the cells are not written, which is a
    warning. Dates of cells, as of a composite, become a band in days since 1970-01-01. The tag ``FIFESIM`` has the
    values of up to 64 cells per band, with which `open_image` compares the file.

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
    if path.exists() and not overwrite:
        raise FileExistsError(
            f"there is a file {in_a_line(path, 150)}: type overwrite=True to replace it, or another name"
        )
    array = _stacked(raster) if isinstance(raster, xr.Dataset) else raster
    if "line" in array.dims:
        raise ValueError(
            "a GeoTIFF holds a map, and this is by line and sample: put it onto one with .grid_swath(grid)"
        )
    if not set(array.dims) <= {"band", "y", "x"}:
        raise ValueError(f"a GeoTIFF holds dimensions (band, y, x), got {array.dims}: select or rename")
    array = array if "band" in array.dims else array.expand_dims("band")
    array = array.transpose("band", "y", "x")
    grid = grids.geobox(array)
    dates = [name for name, value in array.coords.items() if value.dtype.kind == "M" and {"y", "x"} <= set(value.dims)]
    layers = dates if array.dtype.kind == "f" else []
    varying = [name for name in ANGLES if name in array.coords and array.coords[name].ndim]
    varying += [name for name in dates if name not in layers]
    cells = with_layers(array, layers)
    _check_room(cells, path)
    if varying:
        warn(
            f"{path.name} leaves out {', '.join(varying)}, which vary over the cells, and another geometry would be "
            "taken for them: give geometry= when you read it, or write a netCDF with .to_netcdf()"
        )
    with _whole(path) as (streamed, finished), ErrorsOfGdal(f"cannot write {path}"):
        _stream(array, cells, layers, grid, streamed, raster, tags or {})
        rasterio.shutil.copy(streamed, finished, blocksize=_BLOCK, **_COG)
        _check_written(streamed, finished, cells)
    return path


def open_image(path: FilePath, chunks: Chunks | None = None, *, allow_remote: bool = False) -> xr.DataArray:
    """
    Open a GeoTIFF with its bands, wavelengths, sun and calibration.

    Parameters
    ----------
    path : str or path
        Written by `to_geotiff`; of other files, what GDAL knows of the bands is read.
    chunks : mapping or int, optional
        Makes the result lazy.
    allow_remote : bool, optional
        Take addresses, and formats that lead to other files: only for what you trust.

    Returns
    -------
    raster : xarray.DataArray, dims ([band], y, x)
        As it was written, with the bands that the file has, in its order: each keeps its name and calibration. Digital
        numbers are not masked: 0 is no data. For other files, values in their physical unit, NaN where there are no
        data; digital numbers only where the file says that they scale to radiance.

    Raises
    ------
    ValueError
        If the file cannot be read as a raster, is of a format that is not opened, has no north-up grid in metres, or
        takes more memory than there is; if another program changed its values, or it is not certain which band is
        which. Values of a lazy result are checked when they are computed.
    OSError
        If its cells cannot be read.

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
    with ErrorsOfGdal(f"cannot read {file.name}"):
        with file.opened() as source:
            check_raster(source, file.name, north_up=True)
            crs = horizontal_crs(source, file.name)
            if chunks is None:
                cells = source.count * source.height * source.width
                size = np.dtype(source.dtypes[0]).itemsize
                check_memory(cells, size, f"all of {file.name}", "give chunks='auto', which reads it by parts")
            description = read_tag(source, file.name)
            written_here = description is not None
            if not written_here:
                description, storage = gdal_description(source, file.name)
        plain = stored_cells(file, crs, chunks)
    try:
        grid = grids.geobox(plain)
    except ValueError as error:
        raise ValueError(f"cannot place {file.name}: {in_a_line(error, 250)}") from None
    array = xr.DataArray(plain.data, dims=("band", "y", "x"), name=description["name"])
    array = restored(array, description) if written_here else physical(array, storage)
    array = grids.place(array.assign_coords(description["coords"]), grid)
    array.attrs = dict(description["attrs"]) | array.attrs
    if "gain" in array.coords:
        array.attrs["_FillValue"] = array.dtype.type(0)
    return array if "band" in description["dims"] else array.isel(band=0, drop=True)


def _stacked(dataset):
    """A dataset's variables as bands."""
    names = [str(name) for name in dataset.data_vars]
    bands = [dataset[name].drop_vars(["band"], errors="ignore") for name in names]
    dim = xr.DataArray(names, dims="band", name="band")
    array = xr.concat(bands, dim, combine_attrs="drop", coords="minimal", compat="override")
    histories = [dataset[name].attrs.get("history", "") for name in names]
    array.attrs = {"history": histories[0]}
    return array.rename(None)


def _streamed_bytes(array):
    """Size of the cells of a tiled file, whose tiles are all whole."""
    rows, columns = (-(-size // _BLOCK) * _BLOCK for size in array.shape[-2:])
    return array.sizes["band"] * rows * columns * array.dtype.itemsize


def _check_room(array, path):
    """Refuse a disk that is full before GDAL, which says so in many lines, comes to it."""
    if not path.parent.is_dir():
        return
    # The stream, and at worst as much again with overviews.
    needed, free = _streamed_bytes(array) + 1.4 * array.nbytes, shutil.disk_usage(path.parent).free
    if free < needed:
        said = f"{os.strerror(errno.ENOSPC)}: {needed / 1e6:.1f} MB are needed, {free / 1e6:.1f} MB are free"
        raise OSError(errno.ENOSPC, said, str(path))


def _check_written(streamed, finished, array):
    """A full disk may come to light when files are closed, when GDAL tells nobody."""
    with rasterio.open(streamed) as one, rasterio.open(finished) as other:
        if os.path.getsize(streamed) < _streamed_bytes(array):
            raise rasterio.errors.RasterioIOError("the disk did not take all of it")
        for _, window in other.block_windows(1):
            blocks = one.read(window=window), other.read(window=window)
            if not np.array_equal(*blocks, equal_nan=array.dtype.kind == "f"):
                raise rasterio.errors.RasterioIOError("what was written is not what is read")


@contextmanager
def _whole(path):
    """Temporary names beside a file; the second becomes the file when all has gone well."""
    if not path.parent.is_dir():
        raise FileNotFoundError(f"there is no folder {str(path.parent)!r} to write {path.name} into")
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        streamed, finished = Path(folder) / "streamed.tif", Path(folder) / "finished.tif"
        yield streamed, finished
        os.replace(finished, path)
        # What GDAL, or a GIS, kept of the file that was there before: it would be taken for that of this one.
        path.with_name(f"{path.name}.aux.xml").unlink(missing_ok=True)


def _stream(array, cells, layers, grid, path, described, further):
    """Write a tiled GeoTIFF, block by block, with all metadata of an array: its values and layers are the cells."""
    profile = {
        "dtype": cells.dtype.name,
        "count": cells.sizes["band"],
        "height": grid.shape.y,
        "width": grid.shape.x,
        "crs": rasterio.crs.CRS.from_wkt(grid.crs.to_wkt()),
        "transform": grid.affine,
        "photometric": "minisblack",  # three bytes a pixel would be red, green and blue
        "nodata": no_data_of(array),
    }
    with rasterio.open(path, "w", **_TILED, **profile) as sink:
        kept = tag_of(array, described.dims if isinstance(described, xr.DataArray) else array.dims, layers)
        _describe(sink, array, kept)
        sink.update_tags(**{name: str(text) for name, text in further.items()})
        if not isinstance(cells.data, da.Array):
            sink.write(cells.values)
    if isinstance(cells.data, da.Array):
        # The file is opened for each block, which takes longer than to write a small one.
        together = cells.sizes["band"] * _largest_block(cells) <= _AT_ONCE
        data = cells.data.rechunk({0: -1}) if together else cells.data
        da.store(data, _Sink(str(path)), lock=_lock(str(path)), compute=True)
    with rasterio.open(path, "r+") as sink:
        sink.update_tags(**{TAG: json.dumps(kept | {"cells": fingerprint_of(sink)})})


def _largest_block(array):
    """Of one band. [byte]"""
    return array.dtype.itemsize * max(array.chunks[-2]) * max(array.chunks[-1])


class _Sink:
    """A raster file that takes assignments to slices, as dask stores them, in whichever process that happens."""

    def __init__(self, path):
        self._path = path

    def __setitem__(self, index, block):
        bands, rows, columns = index
        window = Window(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
        with rasterio.open(self._path, "r+") as sink:
            sink.write(block, indexes=list(range(bands.start + 1, bands.stop + 1)), window=window)


def _lock(name):
    """One writer at a time: among the workers of a cluster where there is one, else among threads."""
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
    names, count = band_names(array), array.sizes["band"]
    further = list(kept["layers"])
    sink.colorinterp = colours(array) + [ColorInterp.undefined] * len(further)
    for number, name in enumerate([*names, *further], 1):
        sink.set_band_description(number, name)
    for number in range(count):
        _describe_band(sink, number + 1, array.isel(band=number))
    sink.units = band_units(names, array.coords, array.attrs) + [DAYS] * len(further)
    # A GIS has no scale of square roots.
    if "gain" in array.coords and "compression" not in array.coords:
        one, none = [1.0] * len(further), [0.0] * len(further)
        sink.scales, sink.offsets = array["gain"].values.tolist() + one, array["offset"].values.tolist() + none


def _describe_band(sink, number, band):
    per_band = {name: f"{float(band[name]):.9g}" for name in ("wavelength", "solar_irradiance") if name in band.coords}
    sink.update_tags(number, **per_band)
    if "wavelength" in per_band:
        sink.update_tags(number, ns="IMAGERY", CENTRAL_WAVELENGTH_UM=per_band["wavelength"])
