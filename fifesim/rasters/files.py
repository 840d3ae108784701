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
from rasterio.windows import Window

from fifesim.base.annotations import Chunks, FilePath
from fifesim.base.foreign import in_a_line
from fifesim.base.geometry import ANGLES
from fifesim.base.warned import warn
from fifesim.rasters import cf
from fifesim.rasters import grid as grids
from fifesim.rasters.clients import found_client
from fifesim.rasters.gis import colours, tags_of
from fifesim.rasters.opening import ErrorsOfGdal, raster_file, stored_cells
from fifesim.rasters.packed import no_data_of
from fifesim.rasters.soundness import check_memory, check_raster, horizontal_crs
from fifesim.rasters.tags import TAG, read_tag, tag_of

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
    raster: xr.DataArray | xr.Dataset, path: FilePath, *, overwrite: bool = False, tags: Mapping[str, str] | None = None
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
    warning.

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
    _check_room(array, path)
    varying = [name for name in ANGLES if name in array.coords and array.coords[name].ndim]
    if varying:
        warn(
            f"{path.name} leaves out {', '.join(varying)}, which vary over the cells, and another geometry would be "
            "taken for them: give geometry= when you read it, or write a netCDF with .to_netcdf()"
        )
    with _whole(path) as (streamed, finished), ErrorsOfGdal(f"cannot write {path}"):
        _stream(array, grid, streamed, raster, tags or {})
        rasterio.shutil.copy(streamed, finished, blocksize=_BLOCK, **_COG)
        _check_written(streamed, finished, array)
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
        As it was written. Digital numbers are not masked: 0 is no data. Of other files, values in their physical unit,
        NaN where there are no data; digital numbers only where the file says that they scale to radiance.

    Raises
    ------
    ValueError
        If the file cannot be read as a raster, is of a format that is not opened, has no north-up grid in metres, or
        takes more memory than there is.
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
                description, storage = _gdal_description(source, file.name)
        plain = stored_cells(file, crs, chunks)
    try:
        grid = grids.geobox(plain)
    except ValueError as error:
        raise ValueError(f"cannot place {file.name}: {in_a_line(error, 250)}") from None
    array = xr.DataArray(plain.data, dims=("band", "y", "x"), name=description["name"])
    if not written_here:
        array = _physical(array, **storage)
    array = grids.place(array.assign_coords(description["coords"]), grid)
    array.attrs = dict(description["attrs"])
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
    array.attrs = {"history": histories[0], "long_name": ", ".join(names)}
    return array


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


def _stream(array, grid, path, described, further):
    """A tiled GeoTIFF, block by block, with all metadata."""
    dtype = array.dtype
    profile = {
        "dtype": dtype.name,
        "count": array.sizes["band"],
        "height": grid.shape.y,
        "width": grid.shape.x,
        "crs": rasterio.crs.CRS.from_wkt(grid.crs.to_wkt()),
        "transform": grid.affine,
        "photometric": "minisblack",  # three bytes a pixel would be red, green and blue
        "nodata": no_data_of(array),
    }
    with rasterio.open(path, "w", **_TILED, **profile) as sink:
        _describe(sink, array, described)
        sink.update_tags(**{name: str(text) for name, text in further.items()})
        if not isinstance(array.data, da.Array):
            sink.write(array.values)
    if isinstance(array.data, da.Array):
        # The file is opened for each block, which takes longer than to write a small one.
        together = array.sizes["band"] * _largest_block(array) <= _AT_ONCE
        data = array.data.rechunk({0: -1}) if together else array.data
        da.store(data, _Sink(str(path)), lock=_lock(str(path)), compute=True)


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


def _describe(sink, array, described):
    kept = tag_of(array, described.dims if isinstance(described, xr.DataArray) else array.dims)
    scalars = {name: item["values"] for name, item in kept["coords"].items() if not item["dims"]}
    readable = {key: str(value) for key, value in (kept["attrs"] | scalars).items()}
    tags, imagery = tags_of(array)
    sink.update_tags(**tags | readable, **{TAG: json.dumps(kept)}, AREA_OR_POINT="Area")
    sink.update_tags(ns="IMAGERY", **imagery)
    sink.colorinterp = colours(array)
    names = [str(name) for name in array["band"].values] if "band" in array.coords else [str(array.name)]
    for number, name in enumerate(names, 1):
        sink.set_band_description(number, name)
        _describe_band(sink, number, array.isel(band=number - 1))
    # A GIS has no scale of square roots.
    if "gain" in array.coords and "compression" not in array.coords:
        sink.scales, sink.offsets = array["gain"].values.tolist(), array["offset"].values.tolist()
        sink.units = [cf.QUANTITIES["toa_radiance"].units] * len(names)
    else:
        own = array.attrs.get("units", "")
        sink.units = [cf.QUANTITIES[name].units if name in cf.QUANTITIES else own for name in names]


def _describe_band(sink, number, band):
    per_band = {name: f"{float(band[name]):.9g}" for name in ("wavelength", "solar_irradiance") if name in band.coords}
    sink.update_tags(number, **per_band)
    if "wavelength" in per_band:
        sink.update_tags(number, ns="IMAGERY", CENTRAL_WAVELENGTH_UM=per_band["wavelength"])


def _physical(array, scales, offsets, nodata):
    """Values of another program's file: masked, scaled, shifted; digital numbers of radiance with 0 for no data."""
    missing = xr.zeros_like(array, dtype=bool) if nodata is None else array == nodata
    if scales is None:
        return array.where(~missing, array.dtype.type(0))
    if nodata is None and all(scale == 1 for scale in scales) and not any(offsets):
        return array
    gain, offset = (xr.DataArray(list(values), dims="band") for values in (scales, offsets))
    return array.where(~missing) * gain + offset


def _gdal_description(source, file_name):
    """Names, calibration and wavelengths of a file that fifesim did not write, and how its values are stored."""
    names = [name or f"band{number}" for number, name in enumerate(source.descriptions, 1)]
    values = {"wavelength": _wavelengths(source, file_name)}
    counts = np.dtype(source.dtypes[0]).kind == "u" and set(source.units) == {cf.QUANTITIES["toa_radiance"].units}
    if counts:
        values |= {"gain": list(source.scales), "offset": list(source.offsets)}
    coords = {"band": xr.DataArray(names, dims="band")}
    coords |= {
        name: xr.DataArray(value, dims="band", attrs=cf.attributes(name)) for name, value in values.items() if value
    }
    units = {} if counts or not source.units[0] else {"units": source.units[0]}
    storage = {"scales": None if counts else source.scales, "offsets": source.offsets, "nodata": source.nodata}
    return {"name": "image", "dims": ["band", "y", "x"], "attrs": units, "coords": coords}, storage


def _wavelengths(source, file_name):
    """Of all bands in micrometres, or None."""
    said = [source.tags(number, ns="IMAGERY").get("CENTRAL_WAVELENGTH_UM") for number in source.indexes]
    try:
        return [float(value) for value in said] if all(said) else None
    except ValueError:
        raise ValueError(
            f"{file_name} has wavelengths such as {in_a_line(said[0], 40)!r}, not all numbers: open it with "
            "rioxarray.open_rasterio"
        ) from None
