"""Maps for pages and GIS: colour composites, map pictures and QGIS styles."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal, NamedTuple, TypeAlias

import jinja2
import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.colors import LightSource, Normalize, to_rgb
from matplotlib.ticker import MaxNLocator
from PIL import Image

from fifesim.base.arguments import NAMES, FilePath, Kind
from fifesim.base.bands import COMPOSITES, colour_composite
from fifesim.base.files import in_a_line
from fifesim.grids import cf, chunks, swaths
from fifesim.grids import grid as grids
from fifesim.grids.opening import errors_of_gdal, raster_file
from fifesim.grids.reductions import computed
from fifesim.output import colours
from fifesim.output.colours import LAND, colours_of, dark_and_bright, percentile_limits, stops_of, stretched
from fifesim.sensor.labels import to_reflectance

# Maximum pixels along a side for computing the limits of a stretch. [pixel]
_SAMPLE = 1000

Composite: TypeAlias = Annotated[
    Literal["false colour", "natural colour"] | tuple[str, str, str],
    Kind("'false colour', 'natural colour', or the names of three bands", NAMES.fits),
]


def rgb(
    image: xr.DataArray,
    composite: Composite = "false colour",
    *,
    stretch: tuple[float, float] | None = None,
) -> xr.DataArray:
    """
    Colour composite of an image, for ``.plot.imshow()``.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Digital numbers, radiance or reflectance.
    composite : {"false colour", "natural colour"} or (str, str, str), optional
        False colour shows near infrared, red and green as red, green and blue (red twice if there is no green band).
        Natural colour shows red, green and blue. Alternatively, the names of three bands.
    stretch : (float, float), optional
        Percentiles of a band shown as dark and bright, computed from up to a million pixels. The default range is
        slightly wider than the 1st to 99th percentile, which gives moderate colours. [%]

    Returns
    -------
    colours : xarray.DataArray of float32, dims (y, x, rgb)
        From 0 to 1; NaN if any band has no data; lazy if the image is. [1]

    Raises
    ------
    ValueError
        If a band is missing, or the percentiles are invalid.

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> image = lai.fifesim.surface_reflectance("TM", bands=["TM2", "TM3", "TM4"])
    >>> image.fifesim.rgb().shape
    (90, 90, 3)
    """
    names = composite_bands(image, composite)
    limits_of = dark_and_bright if stretch is None else partial(percentile_limits, percentiles=_percentiles(stretch))
    have = [str(name) for name in image["band"].values]
    layers = [valid(image.isel(band=have.index(name))) for name in names]
    limits = map(limits_of, computed(*(thinned(layer, _SAMPLE) for layer in layers)))
    # xarray would put scalar coordinates, such as the distance of the sun, into the title of a picture.
    place = {*swaths.DIMS, "y", "x", "latitude", "longitude", "spatial_ref", "time", "sweep"}
    shares = [
        chunks.pointwise(stretched, layer.drop_vars(set(layer.coords) - place), dtype=np.float32, low=low, high=high)
        for layer, (low, high) in zip(layers, limits, strict=True)
    ]
    out = xr.concat(shares, xr.IndexVariable("rgb", ["red", "green", "blue"])).transpose(..., "rgb")
    # A pixel without data in one band has no meaningful colour.
    out = out.where(out.notnull().all("rgb"))
    kept = {name: image.attrs[name] for name in ("instrument", "history") if name in image.attrs}
    out.attrs = {"long_name": f"{', '.join(names)} as red, green, blue", "units": "1"} | kept
    out.encoding = {"grid_mapping": "spatial_ref"}
    return out.rename("colours")


def check_composite(composite):
    """Raise ValueError if a text names no composite."""
    if isinstance(composite, str) and composite not in COMPOSITES:
        raise ValueError(
            f"composite must be {' or '.join(map(repr, COMPOSITES))}, or the names of three bands, got {composite!r}"
        )


def composite_bands(image, composite="false colour"):
    """Names of the bands shown as red, green and blue."""
    check_composite(composite)
    if "band" not in image.dims:
        raise ValueError(f"colours are of several bands along a dimension band, got {image.dims}: draw it with .plot()")
    have = [str(name) for name in image["band"].values] if "band" in image.coords else []
    if not isinstance(composite, str):
        missing = [str(name) for name in composite if str(name) not in have]
        if missing or len(composite) != 3:
            raise ValueError(f"a composite is of three of the bands {', '.join(have)}, got {tuple(composite)}")
        return [str(name) for name in composite]
    if "wavelength" not in image.coords:
        three = tuple(have[-1:-4:-1]) if len(have) > 2 else ("B5", "B4", "B3")
        raise ValueError(f"the image has no wavelength [um] along band: name three bands, composite={three}")
    numbers = colour_composite(image["wavelength"].values, composite)
    if None in numbers:
        lacks = [window.name for window, number in zip(COMPOSITES[composite], numbers, strict=True) if number is None]
        raise ValueError(f"{composite} needs a {' and a '.join(lacks)} band, the image has {', '.join(have)}")
    return [have[number] for number in numbers]


def false_colour_names(image):
    """Names of the near infrared, red and green band for false colours, empty if one is missing."""
    numbers = colour_composite(image["wavelength"].values)
    return [str(image["band"].values[number]) for number in numbers] if len({*numbers} - {None}) == 3 else []


def valid(layer):
    """Band with NaN for no data, which is 0 in digital numbers, or ``_FillValue``."""
    if layer.dtype.kind == "f":
        return layer
    missing = layer.attrs.get("_FillValue", layer.encoding.get("_FillValue", 0))
    return layer.where(layer != missing)


def thinned(array, size):
    """Every n-th pixel of a raster, from the middle of each n by n pixels, so that it has the given size at most."""
    axes = swaths.DIMS if set(swaths.DIMS) <= set(array.dims) else ("y", "x")
    step = -(-max(array.sizes[axis] for axis in axes) // size)
    starts = {axis: min(step // 2, array.sizes[axis] - 1) for axis in axes}
    return array if step == 1 else array.isel({axis: slice(start, None, step) for axis, start in starts.items()})


def _percentiles(stretch):
    low, high = stretch
    if not 0 <= low < high <= 100:
        raise ValueError(f"stretch must be two percentiles from 0 to 100, such as (2, 98), got {stretch}")
    return low, high


# Smaller pictures are stored without loss, so that pixel edges stay sharp. [pixel]
_FEW = 200

# Quality of lossy pictures, which preserves pixel noise at a third of the size.
_QUALITY = 78

# Compression of lossless pictures; higher levels are slower without being smaller for noisy pixels.
_LEVEL = 2

# Maximum decimals of numbers on a colour bar.
_MOST_DIGITS = 12


class Bar(NamedTuple):
    """Colour bar: stops of a gradient, and numbers with their places along it. [%]"""

    stops: list[str]
    ticks: list[tuple[float, str]]


class Map(NamedTuple):
    """Map as shown on a page."""

    pixels: np.ndarray  # of uint8, shape (rows, columns, 3)
    title: str
    bar: Bar | None
    scale: tuple[float, str]  # a round length along the lower edge, as a share of the width [%] and in words
    frame: tuple[float, float, float, float] | None = None  # left, top, width and height of a marked part [%]

    @property
    def picture(self):
        """Picture file: WebP, or PNG for few pixels."""
        return encoded(self.pixels)

    @property
    def size(self):
        """Number of columns and rows."""
        return self.pixels.shape[1::-1]

    @property
    def has_few_pixels(self):
        """Whether single pixels should be visible."""
        return max(self.size) < _FEW


def value_map(array, title, cmap=None, *, limits=None, middle=None, frame=None):
    """Map of a quantity by a colour map."""
    palette, middle = colours_of(array.name) if cmap is None else (colormaps[cmap], middle)
    low, high = limits or percentile_limits(array, middle=middle)
    known = np.isfinite(array.values)
    # As matplotlib does, in a quarter of the time.
    shares = (np.where(known, array.values, low) - low) / max(high - low, 1e-9)
    shades = np.clip(shares * palette.N, 0, palette.N - 1).astype(np.uint16)
    pixels = palette(np.arange(palette.N), bytes=True)[:, :3][shades]
    return _map(array, pixels, known, title, _bar(palette, low, high), frame)


def relief_map(dem, title):
    """Map of elevation in colours, lit from the north-west."""
    low, high = percentile_limits(dem)
    down, across = grids.cell_size(grids.geobox(dem))
    filled = np.nan_to_num(dem.values, nan=float(dem.mean()) if dem.notnull().any() else 0.0)
    tint = LAND(Normalize(low, max(high, low + 1e-9))(filled))[..., :3]
    source = LightSource(azdeg=315, altdeg=45)
    lit = source.shade_rgb(tint, filled, blend_mode="soft", vert_exag=3, dx=across, dy=down)
    return _map(dem, _bytes(lit), np.isfinite(dem.values), title, _bar(LAND, low, high))


def image_map(dn, title, stretch, frame=None):
    """Map of an image in false colours: near infrared, red and green as red, green and blue."""
    reflectance = _shown_reflectance(dn)
    layers = [stretched(reflectance.sel(band=name).values, low, high) for name, low, high in stretch]
    pixels = _bytes(np.nan_to_num(np.dstack(layers)))
    return _map(dn, pixels, (dn != 0).all("band").values, title, None, frame)


def _shown_reflectance(dn):
    """Reflectance of digital numbers for pictures, where saturated pixels have the largest reflectance. [1]"""
    return to_reflectance(dn.assign_attrs(saturated=0))


def stretch_of(dn):
    """Bands for red, green and blue, with reflectances shown dark and bright; one band in grey if one is missing."""
    names = false_colour_names(dn) or [str(dn["band"].values[-1])] * 3
    reflectance, spans = _shown_reflectance(dn.sel(band=list(dict.fromkeys(names)))), []
    for name in names:
        dark, bright = dark_and_bright(reflectance.sel(band=name))
        spans.append((name, dark, max(bright, dark + 1e-6)))
    return spans


def encoded(pixels, lossless=False):
    """Colour picture as a file: WebP, or PNG if lossless or for few pixels."""
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
        pixels = np.where(valid[..., None], pixels, _bytes(to_rgb(colours.NO_DATA)))
    box = grids.geobox(array).boundingbox
    marked = frame and (
        100 * (frame.left - box.left) / box.span_x,
        100 * (box.top - frame.top) / box.span_y,
        100 * frame.span_x / box.span_x,
        100 * frame.span_y / box.span_y,
    )
    return Map(pixels, title, bar, _scale(box.span_x), marked)


def _scale(width):
    """Round length of about a quarter of a width, its share of the width [%], and its text."""
    power = 10 ** np.floor(np.log10(width / 4))
    length = max(step * power for step in (1, 2, 5) if step * power <= width / 4 * (1 + 1e-9))
    return 100 * length / width, f"{length / 1000:g} km" if length >= 1000 else f"{length:g} m"


def _bar(palette, low, high):
    ticks = [each for each in MaxNLocator(4).tick_values(low, high) if low <= each <= high and high > low]
    # As few decimals as the steps need: two for a step from 0.25 to 0.5.
    step = min(np.diff(ticks), default=1.0) * 10.0 ** np.arange(_MOST_DIGITS)
    digits = int(np.argmax(np.abs(step - step.round()) < 1e-6 * step))
    texts = (f"{each:.{digits}f}".replace("-", "−") for each in ticks)
    places = [(100 * (each - low) / (high - low), text) for each, text in zip(ticks, texts, strict=True)]
    return Bar(stops_of(palette), places)


def _bytes(shares):
    return np.round(255 * np.asarray(shares)).astype(np.uint8)


_TEMPLATE = Path(__file__).with_name("style.qml.j2")


def write_style(path: FilePath, *, overwrite: bool = False) -> Path:
    """
    Write a QGIS style next to a GeoTIFF, which QGIS applies when it opens the file.

    Parameters
    ----------
    path : str or path
        GeoTIFF with names or wavelengths of its bands, as written by `to_geotiff`.
    overwrite : bool, optional
        Replace an existing style.

    Returns
    -------
    style : pathlib.Path
        The same name with the suffix ``.qml``.

    Raises
    ------
    ValueError
        If the file cannot be read as a raster.
    FileExistsError
        If the style exists and ``overwrite`` is False.

    Notes
    -----
    Images are shown in false colour if possible, else in natural colour, stretched as in `fifesim.rgb`. Otherwise the
    first band is shown with the colour map of its quantity, such as ``lai``, ``ndvi`` or ``dem``, or in grey. The
    colours range from the 1st to the 99th percentile in physical units; for LAI, FPAR, slope and most vegetation
    indices they start at 0.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> lai = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 90), (0, 90))), seed=7)
    >>> fifesim.output.write_style(lai.fifesim.to_geotiff(f"{mkdtemp()}/lai.tif")).name
    'lai.qml'
    """
    file, style = raster_file(path), Path(path).with_suffix(".qml")
    if style.exists() and not overwrite:
        raise FileExistsError(f"there is a style {in_a_line(style, 150)}: type overwrite=True to replace it")
    with errors_of_gdal(f"cannot read {file.name}"), file.opened() as source:
        name = source.descriptions[0]
        is_coloured = name in cf.QUANTITIES and cf.QUANTITIES[name].colours != "gray"
        if is_coloured:
            bands, ramp = _ramp(source, name)
        else:
            numbers = _composite(source)
            limits_of = dark_and_bright if len(numbers) == 3 else percentile_limits
            bands, ramp = [_shown(number, limits_of(_values(source, number))) for number in numbers], []
    style.write_text(rendered(_TEMPLATE, bands=bands, ramp=ramp) + "\n", encoding="utf-8")
    return style


def rendered(template, filters=MappingProxyType({}), **values):
    """Text of a template with values; it may include other templates of this folder."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([template.parent, Path(__file__).parent]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= filters
    return environment.get_template(template.name).render(**values)


def _composite(source):
    """Numbers of the bands for red, green and blue, or of the first band if there are none."""
    texts = [source.tags(number, ns="IMAGERY").get("CENTRAL_WAVELENGTH_UM") for number in source.indexes]
    for name in COMPOSITES if all(texts) else ():
        numbers = colour_composite(list(map(float, texts)), name)
        if None not in numbers:
            return [number + 1 for number in numbers]
    return [1]


def _values(source, number):
    """Sample of the values of a band, with scale and offset applied."""
    step = max(1, -(-max(source.shape) // _SAMPLE))
    shape = tuple(-(-size // step) for size in source.shape)
    counts = source.read(number, out_shape=shape, masked=True).compressed()
    return colours.finite(counts) * source.scales[number - 1] + source.offsets[number - 1]


def _shown(number, limits):
    """Band between its limits, widened for a constant band."""
    low, high = (float(f"{each:.6g}") for each in limits)
    return {"number": number, "low": low, "high": high if high > low else low + 1.0}


def _ramp(source, name):
    """First band, and the values and colours of its quantity."""
    palette, middle = colours_of(name)
    found = percentile_limits(_values(source, 1), middle=middle)
    ends = cf.QUANTITIES[name].ends
    band = _shown(1, [own if given is None else given for own, given in zip(found, ends, strict=True)])
    stops = stops_of(palette)
    values = np.linspace(band["low"], band["high"], len(stops))
    return [band], [(f"{value:.6g}", stop) for value, stop in zip(values, stops, strict=True)]
