"""Opening of raster files: checks of the path, the format, the sources of a mosaic, the values and the coverage."""

import os
import re
import warnings
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from xml.etree import ElementTree

import dask.array as da
import numpy as np
import psutil
import pyproj
import pyproj.exceptions
import rasterio
import rasterio.errors
import rioxarray
import xarray as xr
from rasterio.windows import Window

from fifesim.base.files import check_regular, in_a_line, shown
from fifesim.base.messages import during
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.grids.projection import lies_in_words

# [byte]
_LARGEST = 64_000_000

# Elements of a plain mosaic. Other elements (warping, processing, raw bytes, Python functions) can refer to any file.
_ELEMENTS = """
    VRTDataset SRS GeoTransform GCPList GCP Metadata MDI BlockXSize BlockYSize VRTRasterBand Description UnitType Offset
    Scale CategoryNames Category ColorInterp ColorTable Entry NoDataValue HideNoDataValue Histograms HistItem HistMin
    HistMax BucketCount IncludeOutOfRange Approximate HistCounts MaskBand OverviewList SimpleSource ComplexSource
    AveragedSource NoDataFromMaskSource SourceFilename SourceBand SourceProperties SrcRect DstRect NODATA ScaleOffset
    ScaleRatio LUT Exponent SrcMin SrcMax DstMin DstMax Clamp ColorTableComponent UseMaskBand
"""
_PLAIN = frozenset(_ELEMENTS.split())


def is_mosaic(path):
    """Whether a file is a mosaic, by its first bytes, as GDAL decides."""
    return b"<vrtdataset" in _head(path).lower()


def is_description(path):
    """Whether a file is XML or JSON, in which many GDAL formats name other files."""
    return _head(path).lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"<", b"{")


def first_line_of_text(path):
    """First line of a plain text file, which can only be a raster as a grid of numbers; empty for other files."""
    if not os.path.isfile(path) or is_description(path):
        return ""
    try:
        lines = _head(path).decode("utf-8").splitlines()
    except UnicodeDecodeError:
        return ""
    return lines[0] if lines and all(line.replace("\t", " ").isprintable() for line in lines) else ""


def mosaic_sources(path):
    """Files that a mosaic names."""
    if os.path.getsize(path) > _LARGEST:
        raise ValueError(f"of more than {_LARGEST // 1_000_000} MB")
    with open(path, "rb") as file:
        text = file.read()
    # GDAL does not expand what a document type declares, and would read another text.
    if b"<!" in text.replace(b"<!--", b""):
        raise ValueError("with a document type")
    try:
        elements = list(ElementTree.fromstring(text).iter())
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ValueError(f"whose XML cannot be read ({str(error)[:60]})") from None
    for each in elements:
        attributes = {key.lower(): value for key, value in each.attrib.items()}
        kind = attributes.get("subclass", each.tag)
        if each.tag not in _PLAIN or kind not in {*_PLAIN, "VRTSourcedRasterBand"}:
            raise ValueError(f"with {ascii(kind)[:60]}")
        # GDAL follows the name of a file of overviews.
        if each.tag == "MDI" and re.search("OVERVIEW_FILE", str(attributes), re.IGNORECASE):
            raise ValueError("with a file of overviews")
    return list(dict.fromkeys(_named(each, path) for each in elements if each.tag == "SourceFilename"))


def _head(path):
    with open(path, "rb") as file:
        return file.read(8192)


def _named(element, path):
    """Path of a source, which must be a plain file path."""
    text = element.text or ""
    relative = [value for key, value in element.attrib.items() if key.lower() == "relativetovrt"] or ["0"]
    if len(element) or text != text.strip() or re.match(r"[\w+.-]{2,}:|/vsi|<", text) or relative not in (["0"], ["1"]):
        raise ValueError(f"of {ascii(text)[:90]}, which is no local file")
    found = os.path.join(os.path.dirname(path), text) if relative == ["1"] else text
    if not os.path.exists(found):
        raise ValueError(f"of {ascii(text)[:90]}, which is missing")
    return found


# Formats of one raster that hold its cells themselves. GDAL has others that describe servers or name other files.
# ENVI and EHdr come last, because they read any file with a .hdr next to it as raw bytes.
FORMATS = (
    "GTiff", "HFA", "AAIGrid", "SRTMHGT", "DTED", "USGSDEM", "JP2OpenJPEG", "PNG", "JPEG", "ENVI", "EHdr",
)  # fmt: skip

# File systems of GDAL that stay on this machine.
_LOCAL_SYSTEMS = {"/vsizip", "/vsigzip", "/vsitar", "/vsimem"}

# Longest path in a message. [character]
_PATH = 150

# Mosaics of mosaics.
_DEEPEST = 8

_CURE = "for trusted files, allow_remote=True (fifesim simulate: --allow-remote) opens all GDAL formats"

_REMOTE = ContextVar("fifesim_remote_rasters", default=False)


def remote_allowed():
    """Context in which rasters may have addresses and any format of GDAL."""
    # It applies to the check of a file in the current thread; later lazy reads keep the decision.
    return during(_REMOTE)


@dataclass(frozen=True)
class RasterFile:
    """Checked raster file, and the format by which any thread or process reads it."""

    path: str
    driver: str
    band: int = 1

    @property
    def name(self):
        """Path for a message: printable, on one line, of moderate length."""
        return in_a_line(self.path, _PATH)

    @property
    def state(self):
        """Time of the last change of the file, None if unknown; it identifies the content."""
        return os.stat(self.path).st_mtime_ns if os.path.exists(self.path) else None

    def opened(self):
        """Open the file."""
        return rasterio.open(self.path, driver=self.driver)

    def read(self, source, rows, columns):
        """Values of a window of the open file in their unit, NaN for no data, shape (rows, columns)."""
        window = Window.from_slices(rows, columns)
        values = source.read(self.band, window=window, masked=True).astype(float).filled(np.nan)
        return values * source.scales[self.band - 1] + source.offsets[self.band - 1]


def raster_file(path, allow_remote=False):
    """Check that a raster file is safe to open."""
    path = os.fspath(path)
    if not (allow_remote or _REMOTE.get()):
        return _first_that_opens(path, _formats(path))
    if os.path.exists(path):
        _check_regular(path, path)
    return _first_that_opens(path, [None])


@contextmanager
def errors_of_gdal(beginning):
    """Context that turns all errors of rasterio, some of which have private classes, into OSError."""
    try:
        yield
    except Exception as error:
        if type(error).__module__.partition(".")[0] != "rasterio" and not isinstance(error, UnicodeDecodeError):
            raise
        raise OSError(f"{beginning}: {in_a_line(error.__cause__ or error, _PATH)}") from error


def _first_that_opens(path, formats):
    reasons = []
    for name in formats:
        file = RasterFile(path, name)
        try:
            with warnings.catch_warnings(), errors_of_gdal(f"cannot read {file.name} as a raster"):
                warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
                with file.opened() as source:
                    return RasterFile(path, source.driver)
        except OSError as error:
            reasons.append(str(error))
    # An error within a format says more than a format that was not recognized.
    reason = min(reasons, key=lambda text: "not recognized" in text)
    if "not recognized" in reason and formats == FORMATS:
        cure = f"convert a local file with gdal_translate FILE map.tif (netCDF also opens with xarray), or, {_CURE}"
        if begins := first_line_of_text(path):
            cure = f"it is text that begins {shown(begins)}: is it another file? gdal_translate makes GeoTIFF of grids"
        reason = f"cannot read {in_a_line(path, _PATH)} as a raster of {', '.join(FORMATS)}; {cure}"
    raise ValueError(reason)


def _formats(path, around=()):
    """Formats by which a file may be opened, after a check of the files that it names."""
    if path.startswith("/vsi"):
        _check_virtual(path)
        return FORMATS
    if re.match(r"[\w+.-]{2,}:", path) or path.lstrip().startswith("<"):
        shown_path = in_a_line(path, _PATH)
        raise ValueError(f"{shown_path} is an address or a description instead of a file, and is not opened: {_CURE}")
    _check_regular(path, path)
    for beside in filter(os.path.exists, (f"{path}.msk", f"{path}.ovr")):
        _check_regular(beside, beside)
        if is_description(beside):
            raise ValueError(f"beside {in_a_line(path, _PATH)} lies a description that GDAL follows: {_CURE}")
    if not is_mosaic(path):
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
    """Archive on disk that holds a virtual file of GDAL, None if there is none, as for ``/vsimem/``."""
    parts = path.rpartition(re.findall(r"/vsi\w*", path)[-1])[2].removeprefix("/").removeprefix("{").split("/")
    for length in range(1, len(parts) + 1):
        # GDAL accepts braces around an archive with any suffix.
        part = "/".join(parts[:length]).removesuffix("}")
        if part and os.path.exists(part) and not os.path.isdir(part):
            return part
    return None


def _check_regular(path, named):
    try:
        check_regular(path)
        open(path, "rb").close()
    except OSError as error:
        reason = "no raster file is there" if isinstance(error, FileNotFoundError) else error.strerror
        raise ValueError(f"cannot read {in_a_line(named, _PATH)} as a raster: {reason}") from None


def _check_mosaic(path, around):
    """Raise ValueError for a mosaic of other than files of known formats; GDAL would open any format."""
    mosaic = f"{in_a_line(path, _PATH)} is a mosaic"
    try:
        names = mosaic_sources(path)
    except ValueError as error:
        raise ValueError(f"{mosaic} {error}, and is not opened: {_CURE}") from None
    for name in names:
        if os.path.realpath(name) in around or len(around) > _DEEPEST:
            raise ValueError(f"{mosaic} that holds itself, or mosaics within mosaics without end")
        try:
            formats = _formats(name, around)
            if formats is FORMATS and is_description(name):
                raise ValueError(f"{in_a_line(name, 80)} is a description that may lead elsewhere: {_CURE}")
            _first_that_opens(name, formats)
        except ValueError as error:
            raise ValueError(f"{mosaic} of a file that is not opened: {in_a_line(error, 280)}") from None


def stored_cells(file, crs, chunks):
    """Stored cells of a file on its grid, dims (band, y, x)."""
    with warnings.catch_warnings():
        # rioxarray has one scale and offset for all bands; here they are coordinates along band.
        warnings.filterwarnings("ignore", "(Scales|Offsets) differ across bands")
        opened = rioxarray.open_rasterio(file.path, driver=file.driver, chunks=chunks, mask_and_scale=False)
    if not isinstance(opened, xr.DataArray):
        raise ValueError(f"{file.name} holds several rasters: take one of them out of it with gdal_translate")
    try:
        grid = grids.geobox(opened.rio.write_crs(crs))
    except ValueError as error:
        raise ValueError(f"cannot place {file.name}: {in_a_line(error, 250)}") from None
    if chunks is None:
        cells = opened.values
    else:
        read = partial(_read_block, file, file.state, opened.dtype)
        cells = da.map_blocks(read, chunks=opened.chunks, meta=np.empty((0, 0, 0), opened.dtype))
    return grids.place(xr.DataArray(cells, {"band": opened["band"]}, ("band", "y", "x")), grid)


def _read_block(file, state, dtype, block_info=None):
    """Chunk of a file; `state` makes a changed file another one."""
    (first, last), (top, bottom), (left, right) = block_info[None]["array-location"]
    with errors_of_gdal(f"cannot read {file.name}"), file.opened() as source:
        window = Window(left, top, right - left, bottom - top)
        return source.read(list(range(first + 1, last + 1)), window=window).astype(dtype, copy=False)


# Larger coordinates are not on the Earth in any unit. [m or degree]
_FARTHEST = 1e9


@contextmanager
def sound_raster(file, *, north_up=False):
    """Context with an open file that holds numbers at places on the Earth."""
    with errors_of_gdal(f"cannot read {file.name}"), file.opened() as source:
        check_raster(source, file.name, north_up=north_up)
        yield source, horizontal_crs(source, file.name)


def check_raster(source, name, *, north_up=False):
    """Raise ValueError for a raster whose cells are not real numbers, or have no position."""
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
    found = f"its geotransform is {tuple(float(f'{number:.6g}') for number in a[:6])}"
    columns, rows = np.meshgrid([0, source.width], [0, source.height])
    # Positions that overflow are refused below.
    with np.errstate(all="ignore"):
        farthest = np.abs(projection.transform_points(a, columns, rows)).max()
        # Cells have an area, and are so large that their coordinates differ.
        across, down = np.hypot(a.a, a.d), np.hypot(a.b, a.e)
        large = min(across, down) > 1e-12 * farthest and abs(a.a * a.e - a.b * a.d) > 1e-6 * across * down
        placed = farthest < _FARTHEST and large
    if not placed:
        raise ValueError(f"the cells of {name} have no place on the Earth, {found}: mend it with gdal_edit.py -a_ullr")
    if north_up and (a.b or a.d or a.a < 0 or a.e > 0):
        raise ValueError(f"{name} is rotated or not north up, {found}: bring it onto a grid with gdalwarp")


def horizontal_crs(source, name):
    """Horizontal CRS of a raster."""
    if source.crs is None:
        raise ValueError(f"{name} has no CRS: give it one, for instance with gdal_edit.py -a_srs EPSG:26914")
    try:
        crs = pyproj.CRS.from_user_input(projection.horizontal(source.crs.to_wkt()))
        if crs.is_projected or crs.is_geographic:
            return crs
        reason = f"it is a {in_a_line(crs.type_name, 40)}"
    except (pyproj.exceptions.ProjError, rasterio.errors.RasterioError, ValueError) as error:
        reason = in_a_line(error, 150)
    raise ValueError(
        f"the CRS of {name} is no projected nor geographic one ({reason}): "
        "give it one with gdal_edit.py -a_srs EPSG:26914"
    )


def check_memory(cells, itemsize, what, cure):
    """Raise ValueError for data that do not fit into memory, before they are made."""
    needed, free = cells * itemsize, psutil.virtual_memory().available
    if needed > 0.8 * free:
        raise ValueError(f"{what} takes {needed / 1e9:.3g} GB of memory, {free / 1e9:.2g} GB are free: {cure}")


def covering_grid(path, cell, pixel, crs=None):
    """Grid that covers a raster file, from and to whole pixels in its CRS or a projected one."""
    file = raster_file(path)
    with sound_raster(file) as (source, own):
        outline = [np.linspace(0, size, 17) for size in (source.width, source.height)]
        columns, rows = (values.ravel() for values in np.meshgrid(*outline))
        x, y = projection.transform_points(source.transform, columns, rows)
        lies = lies_in_words(source.transform, source.shape, own)
    to_degrees = pyproj.Transformer.from_crs(own, 4326, always_xy=True)
    area = to_degrees.transform_bounds(x.min(), y.min(), x.max(), y.max())
    # A map on a sphere, such as MODIS tiles, is sheared, so that its metres are no distances on the ground.
    elsewhere = own.is_geographic or own.ellipsoid.inverse_flattening == 0
    if crs is not None:
        crs = pyproj.CRS.from_user_input(projection.horizontal(crs))
    else:
        middle = to_degrees.transform(x.mean(), y.mean())
        crs = pyproj.CRS(projection.undistorted(*middle, own.datum.name)) if elsewhere else own
    if crs != own:
        x, y = projection.carry(projection.operation(own, crs, area), own, crs, x, y)
        if not np.isfinite([x, y]).all():
            raise ValueError(f"{projection.name_of(crs)} does not reach {file.name}: it spans {lies}")
        projection.check_metres(crs, (x.min(), y.min(), x.max(), y.max()))
    west, north = np.floor(np.min(x) / pixel) * pixel, np.ceil(np.max(y) / pixel) * pixel
    width, height = np.ceil((np.max(x) - west) / pixel) * pixel, np.ceil((north - np.min(y)) / pixel) * pixel
    # The last cells may reach beyond the last pixels.
    width, height = (np.ceil(size / cell - 1e-6) * cell for size in (width, height))
    name = f"EPSG:{crs.to_epsg()}" if crs.to_epsg() else crs.to_wkt()
    return grids.grid_at(name, float(west), float(north), float(width), float(height), cell)
