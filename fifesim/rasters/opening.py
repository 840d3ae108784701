"""The one door by which a user's raster file comes in: a file, on this machine, of a format that is known."""

import os
import re
import warnings
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial

import dask.array as da
import numpy as np
import rasterio
import rasterio.errors
import rioxarray
import xarray as xr
from rasterio.windows import Window

from fifesim.base.foreign import check_regular, in_a_line, shown
from fifesim.rasters import mosaics

# Formats of one raster that hold its cells themselves. GDAL has others that describe servers or name other files.
FORMATS = (
    "GTiff", "HFA", "ENVI", "EHdr", "AAIGrid", "SRTMHGT", "DTED", "USGSDEM", "JP2OpenJPEG", "PNG", "JPEG",
)  # fmt: skip

# File systems of GDAL that stay on this machine.
_LOCAL_SYSTEMS = {"/vsizip", "/vsigzip", "/vsitar", "/vsimem"}

# Of a path in a message. [character]
_PATH = 150

# Mosaics of mosaics.
_DEEPEST = 8

_CURE = "where you trust it, allow_remote=True (fifesim simulate: --allow-remote) opens whatever GDAL opens"

_REMOTE = ContextVar("fifesim_remote_rasters", default=False)


@contextmanager
def remote_allowed():
    """
    A context within which rasters may come from addresses, and be of any of GDAL's formats.

    It counts where a file is looked at, in the thread that looks; what is lazy keeps to what was decided there.
    """
    token = _REMOTE.set(True)
    try:
        yield
    finally:
        _REMOTE.reset(token)


@dataclass(frozen=True)
class RasterFile:
    """A raster file that has been looked at, and the format by which it is read, in whichever thread or process."""

    path: str
    driver: str

    @property
    def name(self):
        """The path for a message: printable, on one line, of moderate length."""
        return in_a_line(self.path, _PATH)

    @property
    def state(self):
        """When the file was last changed, and None where that is not known: a changed file is another one."""
        return os.stat(self.path).st_mtime_ns if os.path.exists(self.path) else None

    def opened(self):
        """The open file, a `rasterio.io.DatasetReader`."""
        return rasterio.open(self.path, driver=self.driver)


def raster_file(path, allow_remote=False):
    """
    A raster file that is safe to open.

    Parameters
    ----------
    path : str or path
        Of a file, or within an archive by ``/vsizip/``, ``/vsigzip/`` or ``/vsitar/``.
    allow_remote : bool
        Whether addresses, and formats that lead to other files, are opened as well.

    Returns
    -------
    file : RasterFile

    Raises
    ------
    ValueError
        If it is missing, no file, of a format that is not allowed, a mosaic of anything that is not allowed, or cannot
        be read as a raster.
    """
    path = os.fspath(path)
    if not (allow_remote or _REMOTE.get()):
        return _first_that_opens(path, _formats(path))
    if os.path.exists(path):
        _check_regular(path, path)
    return _first_that_opens(path, [None])


class ErrorsOfGdal:
    """
    A context in which what rasterio raises, of classes that it does not all publish, is an error of the system.

    Parameters
    ----------
    said : str
        What could not be done, such as "cannot read map.tif".
    """

    def __init__(self, said):
        self._said = said

    def __enter__(self):
        return self

    def __exit__(self, kind, error, traceback):
        if kind is not None and (kind.__module__.partition(".")[0] == "rasterio" or kind is UnicodeDecodeError):
            raise OSError(f"{self._said}: {in_a_line(error.__cause__ or error, _PATH)}") from error


def _first_that_opens(path, formats):
    reasons = []
    for name in formats:
        file = RasterFile(path, name)
        try:
            with warnings.catch_warnings(), ErrorsOfGdal(f"cannot read {file.name} as a raster"):
                warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
                with file.opened() as source:
                    return RasterFile(path, source.driver)
        except OSError as error:
            reasons.append(str(error))
    # What is wrong with a format says more than that it is not another.
    reason = min(reasons, key=lambda said: "not recognized" in said)
    if "not recognized" in reason and formats == FORMATS:
        cure = f"convert a local file with gdal_translate FILE map.tif (netCDF also opens with xarray), or, {_CURE}"
        if begins := mosaics.text_of(path):
            cure = f"it is text that begins {shown(begins)}: is it another file? gdal_translate makes GeoTIFF of grids"
        reason = f"cannot read {in_a_line(path, _PATH)} as a raster of {', '.join(FORMATS)}; {cure}"
    raise ValueError(reason)


def _formats(path, around=()):
    """Formats by which a file may be opened, once what it names has been looked at."""
    if path.startswith("/vsi"):
        _check_virtual(path)
        return FORMATS
    if re.match(r"[\w+.-]{2,}:", path) or path.lstrip().startswith("<"):
        said = in_a_line(path, _PATH)
        raise ValueError(f"{said} is an address or a description, no file, and is not opened: {_CURE}")
    _check_regular(path, path)
    for beside in filter(os.path.exists, (f"{path}.msk", f"{path}.ovr")):
        _check_regular(beside, beside)
        if mosaics.is_description(beside):
            raise ValueError(f"beside {in_a_line(path, _PATH)} lies a description that GDAL follows: {_CURE}")
    if not mosaics.is_mosaic(path):
        return FORMATS
    _check_mosaic(path, (*around, os.path.realpath(path)))
    return ["VRT"]


def _check_virtual(path):
    systems = re.findall(r"/vsi\w*", path)
    if refused := [name for name in systems if name not in _LOCAL_SYSTEMS]:
        raise ValueError(f"{in_a_line(path, _PATH)} lies in {in_a_line(refused[0], 40)}, which is not opened: {_CURE}")
    if archive := archive_of(path):
        _check_regular(archive, path)


def archive_of(path):
    """
    File on disk that holds a file of GDAL's virtual file systems.

    Parameters
    ----------
    path : str
        Such as ``/vsizip/maps.zip/lai.tif``.

    Returns
    -------
    archive : str or None
        None if no part of the path is a file on disk, as for ``/vsimem/``.
    """
    parts = path.rpartition(re.findall(r"/vsi\w*", path)[-1])[2].removeprefix("/").removeprefix("{").split("/")
    for length in range(1, len(parts) + 1):
        # GDAL takes braces around an archive of any suffix.
        part = "/".join(parts[:length]).removesuffix("}")
        if part and os.path.exists(part) and not os.path.isdir(part):
            return part
    return None


def _check_regular(path, said):
    try:
        check_regular(path)
        open(path, "rb").close()
    except OSError as error:
        reason = "no raster file is there" if isinstance(error, FileNotFoundError) else error.strerror
        raise ValueError(f"cannot read {in_a_line(said, _PATH)} as a raster: {reason}") from None


def _check_mosaic(path, around):
    """Refuse a mosaic of anything but files of known formats; GDAL would open its sources by any format."""
    said = f"{in_a_line(path, _PATH)} is a mosaic"
    try:
        names = mosaics.named_files(path)
    except ValueError as error:
        raise ValueError(f"{said} {error}, and is not opened: {_CURE}") from None
    for name in names:
        if os.path.realpath(name) in around or len(around) > _DEEPEST:
            raise ValueError(f"{said} that holds itself, or mosaics within mosaics without end")
        try:
            formats = _formats(name, around)
            if formats is FORMATS and mosaics.is_description(name):
                raise ValueError(f"{in_a_line(name, 80)} is a description that may lead elsewhere: {_CURE}")
            _first_that_opens(name, formats)
        except ValueError as error:
            raise ValueError(f"{said} of a file that is not opened: {in_a_line(error, 280)}") from None


def stored_cells(file, crs, chunks):
    """
    Cells of a file as they are stored, with coordinates.

    Parameters
    ----------
    file : RasterFile
    crs : rasterio.crs.CRS
    chunks : mapping or int or None
        Makes the result lazy.

    Returns
    -------
    array : xarray.DataArray, dims (band, y, x)

    Raises
    ------
    ValueError
        If it holds several rasters.
    """
    with warnings.catch_warnings():
        # rioxarray has one scale and offset for all bands; here they are coordinates along band.
        warnings.filterwarnings("ignore", "(Scales|Offsets) differ across bands")
        opened = rioxarray.open_rasterio(file.path, driver=file.driver, chunks=chunks, mask_and_scale=False)
    if not isinstance(opened, xr.DataArray):
        raise ValueError(f"{file.name} holds several rasters: take one of them out of it with gdal_translate")
    opened = opened.rio.write_crs(crs)
    if chunks is None:
        return opened.load()
    read = partial(_read_block, file, file.state, opened.dtype)
    return opened.copy(data=da.map_blocks(read, chunks=opened.chunks, meta=np.empty((0, 0, 0), opened.dtype)))


def _read_block(file, state, dtype, block_info=None):
    """A chunk of a file, which has changed where its state has."""
    (first, last), (top, bottom), (left, right) = block_info[None]["array-location"]
    with ErrorsOfGdal(f"cannot read {file.name}"), file.opened() as source:
        window = Window(left, top, right - left, bottom - top)
        return source.read(list(range(first + 1, last + 1)), window=window).astype(dtype, copy=False)
