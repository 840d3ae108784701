"""The one door by which a user's raster file comes in: a file, on this machine, of a format that is known."""

import os
import re
import stat
import warnings
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

import rasterio
import rasterio.errors

from fifesim.rasters import mosaics

# Formats of one raster that hold its cells themselves. GDAL has others that describe servers or name other files.
FORMATS = (
    "GTiff", "HFA", "ENVI", "EHdr", "AAIGrid", "SRTMHGT", "DTED", "USGSDEM", "JP2OpenJPEG", "PNG", "JPEG",
)  # fmt: skip

# File systems of GDAL that stay on this machine.
_LOCAL_SYSTEMS = {"/vsizip", "/vsigzip", "/vsitar", "/vsimem"}

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
        return readable(self.path)

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
            raise OSError(f"{self._said}: {readable(error.__cause__ or error)}") from error


def readable(text, most=150):
    """
    Text of foreign origin for a message: printable, on one line, without its middle if it is long.

    Parameters
    ----------
    text : str or Exception
    most : int
        Characters.

    Returns
    -------
    text : str

    Examples
    --------
    >>> readable("lai\\x1b[2J.tif")
    'lai?[2J.tif'
    """
    text = "".join(each if each.isprintable() else "?" for each in str(text))
    half = (most - 5) // 2
    return text if len(text) <= most else f"{text[:half]} ... {text[-half:]}"


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
        reason = f"cannot read {readable(path)} as a raster of {', '.join(FORMATS)}; {_CURE}"
    raise ValueError(reason)


def _formats(path, around=()):
    """Formats by which a file may be opened, once what it names has been looked at."""
    if path.startswith("/vsi"):
        _check_virtual(path)
        return FORMATS
    if re.match(r"[\w+.-]{2,}:", path) or path.lstrip().startswith("<"):
        raise ValueError(f"{readable(path)} is an address or a description, no file, and is not opened: {_CURE}")
    _check_regular(path, path)
    for beside in filter(os.path.exists, (f"{path}.msk", f"{path}.ovr")):
        _check_regular(beside, beside)
        if mosaics.is_description(beside):
            raise ValueError(f"beside {readable(path)} lies a description that GDAL follows: {_CURE}")
    if not mosaics.is_mosaic(path):
        return FORMATS
    _check_mosaic(path, (*around, os.path.realpath(path)))
    return ["VRT"]


def _check_virtual(path):
    systems = re.findall(r"/vsi\w*", path)
    if refused := [name for name in systems if name not in _LOCAL_SYSTEMS]:
        raise ValueError(f"{readable(path)} lies in {readable(refused[0], 40)}, which is not opened: {_CURE}")
    # The archive is whichever part of the path is there.
    parts = path.rpartition(systems[-1])[2].removeprefix("/").split("/")
    for length in range(1, len(parts) + 1):
        part = "/".join(parts[:length])
        if part and os.path.exists(part) and not os.path.isdir(part):
            _check_regular(part, path)


def _check_regular(path, said):
    """Refuse what is no file, such as a pipe, which would be waited for without end."""
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISREG(mode):
            open(path, "rb").close()
            return
        reason = "it is a folder" if stat.S_ISDIR(mode) else "it is a pipe or a device"
    except FileNotFoundError:
        reason = "no raster file is there"
    except OSError as error:
        reason = error.strerror
    except ValueError:
        reason = "no path holds a null character"
    raise ValueError(f"cannot read {readable(said)} as a raster: {reason}")


def _check_mosaic(path, around):
    """Refuse a mosaic of anything but files of known formats; GDAL would open its sources by any format."""
    said = f"{readable(path)} is a mosaic"
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
                raise ValueError(f"{readable(name, 80)} is a description that may lead elsewhere: {_CURE}")
            _first_that_opens(name, formats)
        except ValueError as error:
            raise ValueError(f"{said} of a file that is not opened: {readable(error, 280)}") from None
