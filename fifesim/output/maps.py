"""Maps of a page: a picture of the pixels alone; its colour bar, its scale and a frame in it are drawn by the page."""

import io
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import LightSource, Normalize, to_rgb
from matplotlib.ticker import MaxNLocator
from PIL import Image

from fifesim.output.colours import LAND, NO_DATA, colours_of, dark_and_bright, percentile_limits, stops_of
from fifesim.output.composites import false_colour_names
from fifesim.rasters import grid as grids
from fifesim.sensor.raster import to_reflectance

# Pictures with fewer pixels along the longer side keep their values and their edges. [pixel]
_FEW = 200

# Of lossy pictures: noise of pixels stays, at a third of the bytes.
_QUALITY = 78

# Of lossless ones: from 4 up zlib takes longer, and noise of pixels takes more bytes.
_LEVEL = 2

# Decimals of a number beside a colour bar are fewer.
_MOST_DIGITS = 12


class Bar(NamedTuple):
    """A colour bar: stops of a gradient, and numbers with their places along it. [%]"""

    stops: list[str]
    ticks: list[tuple[float, str]]


class Map(NamedTuple):
    """
    A map as a page shows it.

    Parameters
    ----------
    pixels : array of uint8, shape (rows, columns, 3)
    title : str
    bar : Bar or None
    scale : (float, str)
        A round length along the lower edge, as a share of the width, and in words. [%]
    frame : (float, float, float, float) or None
        Left, top, width and height of a part that is marked. [%]
    """

    pixels: np.ndarray
    title: str
    bar: Bar | None
    scale: tuple[float, str]
    frame: tuple[float, float, float, float] | None = None

    @property
    def picture(self):
        """As a file: WebP, or PNG where there are few pixels."""
        return encoded(self.pixels)

    @property
    def size(self):
        """Columns and rows."""
        return self.pixels.shape[1::-1]

    @property
    def has_few_pixels(self):
        """Whether its pixels are to be seen one by one."""
        return max(self.size) < _FEW


def value_map(array, title, cmap=None, *, limits=None, middle=None, frame=None):
    """
    A quantity by a colour map.

    Parameters
    ----------
    array : xarray.DataArray, dims (y, x)
        In memory; NaN is no data.
    title : str
    cmap : str, optional
        Name of a colour map; by default the colours of the quantity, with the value from which they diverge.
    limits : (float, float), optional
        Values of the first and the last colour; by default percentiles.
    middle : float, optional
        Value from which the colours of ``cmap`` diverge to both sides.
    frame : odc.geo.geom.BoundingBox, optional
        A part to mark.

    Returns
    -------
    found : Map
    """
    colours, middle = colours_of(array.name) if cmap is None else (colormaps[cmap], middle)
    low, high = limits or percentile_limits(array, middle=middle)
    known = np.isfinite(array.values)
    # As matplotlib does, in a quarter of the time.
    shares = (np.where(known, array.values, low) - low) / max(high - low, 1e-9)
    shades = np.clip(shares * colours.N, 0, colours.N - 1).astype(np.uint16)
    pixels = colours(np.arange(colours.N), bytes=True)[:, :3][shades]
    return _map(array, pixels, known, title, _bar(colours, low, high), frame)


def relief_map(dem, title):
    """
    Elevation in colours, lit from the north-west as maps are.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    title : str

    Returns
    -------
    found : Map
    """
    low, high = percentile_limits(dem)
    down, across = grids.cell_size(grids.geobox(dem))
    filled = np.nan_to_num(dem.values, nan=float(dem.mean()) if dem.notnull().any() else 0.0)
    tint = LAND(Normalize(low, max(high, low + 1e-9))(filled))[..., :3]
    source = LightSource(azdeg=315, altdeg=45)
    lit = source.shade_rgb(tint, filled, blend_mode="soft", vert_exag=3, dx=across, dy=down)
    return _map(dem, _bytes(lit), np.isfinite(dem.values), title, _bar(LAND, low, high))


def image_map(dn, title, stretch, frame=None):
    """
    An image in false colours: near infrared, red and green as red, green and blue.

    Parameters
    ----------
    dn : xarray.DataArray, dims (band, y, x)
        Digital numbers, in memory; 0 is no data.
    title : str
    stretch : list of (str, float, float)
        From `stretch_of`.
    frame : odc.geo.geom.BoundingBox, optional
        A part to mark.

    Returns
    -------
    found : Map
    """
    reflectance = to_reflectance(dn)
    layers = [(reflectance.sel(band=name).values - low) / (high - low) for name, low, high in stretch]
    pixels = _bytes(np.nan_to_num(np.clip(np.dstack(layers), 0, 1)))
    return _map(dn, pixels, (dn != 0).all("band").values, title, None, frame)


def stretch_of(dn):
    """
    Bands for red, green and blue, with the reflectances that become dark and bright.

    Parameters
    ----------
    dn : xarray.DataArray, dims (band, y, x)
        Digital numbers, in memory.

    Returns
    -------
    stretch : list of (str, float, float)
        One band thrice, a grey picture, where one of near infrared, red and green is missing.
    """
    names = false_colour_names(dn) or [str(dn["band"].values[-1])] * 3
    reflectance, spans = to_reflectance(dn.sel(band=list(dict.fromkeys(names)))), []
    for name in names:
        dark, bright = dark_and_bright(reflectance.sel(band=name))
        spans.append((name, dark, max(bright, dark + 1e-6)))
    return spans


def encoded(pixels, lossless=False):
    """
    A colour picture as a file.

    Parameters
    ----------
    pixels : array of uint8, shape (rows, columns, 3)
    lossless : bool, optional

    Returns
    -------
    picture : bytes
        WebP; PNG where it is lossless, with 256 colours where it has few pixels.
    """
    buffer, picture = io.BytesIO(), Image.fromarray(np.ascontiguousarray(pixels))
    if lossless:
        picture.save(buffer, "png", compress_level=_LEVEL)
    elif max(picture.size) < _FEW:
        picture.quantize(256, dither=Image.Dither.NONE).save(buffer, "png")
    else:
        picture.save(buffer, "webp", quality=_QUALITY, method=2)
    return buffer.getvalue()


def _map(array, pixels, valid, title, bar, frame=None):
    if not valid.all():
        pixels = np.where(valid[..., None], pixels, _bytes(to_rgb(NO_DATA)))
    box = grids.geobox(array).boundingbox
    marked = frame and (
        100 * (frame.left - box.left) / box.span_x,
        100 * (box.top - frame.top) / box.span_y,
        100 * frame.span_x / box.span_x,
        100 * frame.span_y / box.span_y,
    )
    return Map(pixels, title, bar, _scale(box.span_x), marked)


def _scale(width):
    """A round length of about a quarter of a width, its share of it [%], and in words."""
    power = 10 ** np.floor(np.log10(width / 4))
    length = max(step * power for step in (1, 2, 5) if step * power <= width / 4 * (1 + 1e-9))
    return 100 * length / width, f"{length / 1000:g} km" if length >= 1000 else f"{length:g} m"


def _bar(colours, low, high):
    ticks = [each for each in MaxNLocator(4).tick_values(low, high) if low <= each <= high and high > low]
    # As few as the steps need: that from .25 to .5 has two.
    step = min(np.diff(ticks), default=1.0) * 10.0 ** np.arange(_MOST_DIGITS)
    digits = int(np.argmax(np.abs(step - step.round()) < 1e-6 * step))
    texts = (f"{each:.{digits}f}".replace("-", "−") for each in ticks)
    places = [(100 * (each - low) / (high - low), text) for each, text in zip(ticks, texts, strict=True)]
    return Bar(stops_of(colours), places)


def _bytes(shares):
    return np.round(255 * np.asarray(shares)).astype(np.uint8)
