"""How QGIS shows a file: colours in a style file of the same name, which it takes by itself."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import jinja2
import numpy as np

from fifesim.base.annotations import FilePath
from fifesim.base.bands import COMPOSITES, composite
from fifesim.base.foreign import in_a_line
from fifesim.output.colours import colours_of, dark_and_bright, finite, percentile_limits, stops_of
from fifesim.rasters import cf
from fifesim.rasters.opening import ErrorsOfGdal, raster_file

_TEMPLATE = Path(__file__).with_name("style.qml.j2")

# Values are stretched by so many pixels along a side at most. [pixel]
_SAMPLE = 1000


class _Shown(NamedTuple):
    """A band, and the values between which it is stretched."""

    number: int
    low: float
    high: float


def write_style(path: FilePath, *, overwrite: bool = False) -> Path:
    """
    Write a style beside a GeoTIFF, so that QGIS shows it in fitting colours when it is opened.

    Parameters
    ----------
    path : str or path
        Of a file with names or wavelengths of its bands, as `to_geotiff` writes it.
    overwrite : bool, optional
        Replace a style that is there.

    Returns
    -------
    style : pathlib.Path
        The same name with the suffix ``.qml``.

    Raises
    ------
    ValueError
        If the file cannot be read as a raster.
    FileExistsError
        If there is a style, and ``overwrite`` is not given.

    Notes
    -----
    Near infrared, red and green become red, green and blue, red twice where there is no green; else red, green and
    blue, stretched as in `fifesim.rgb`. A first band that is named after a quantity with a colour map, such as ``lai``,
    ``ndvi`` or ``dem``, gets a ramp, and any other is grey. Both run from the first to the 99th percentile, in the unit
    that scale and offset lead to, as QGIS counts; LAI, FPAR, slope and most vegetation indices begin at 0.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> lai = fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 90), (0, 90))), seed=7)
    >>> fifesim.write_style(lai.fifesim.to_geotiff(f"{mkdtemp()}/lai.tif")).name
    'lai.qml'
    """
    file, style = raster_file(path), Path(path).with_suffix(".qml")
    if style.exists() and not overwrite:
        raise FileExistsError(f"there is a style {in_a_line(style, 150)}: type overwrite=True to replace it")
    with ErrorsOfGdal(f"cannot read {file.name}"), file.opened() as source:
        name = source.descriptions[0]
        is_coloured = name in cf.QUANTITIES and cf.QUANTITIES[name].colours != "gray"
        bands, ramp = _ramp(source, name) if is_coloured else (_shown_bands(source), [])
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    text = environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(bands=bands, ramp=ramp)
    style.write_text(text + "\n", encoding="utf-8")
    return style


def _composite(source):
    """Numbers of the bands that become red, green and blue; the first alone where they show no colours."""
    said = [source.tags(number, ns="IMAGERY").get("CENTRAL_WAVELENGTH_UM") for number in source.indexes]
    if not all(said):
        return [1]
    wavelengths = [float(each) for each in said]
    for name in COMPOSITES:
        numbers = composite(wavelengths, name)
        if None not in numbers:
            return [number + 1 for number in numbers]
    return [1]


def _values(source, number):
    """Some values of a band, in the unit that scale and offset lead to."""
    step = max(1, -(-max(source.shape) // _SAMPLE))
    shape = tuple(-(-size // step) for size in source.shape)
    counts = source.read(number, out_shape=shape, masked=True).compressed()
    return finite(counts) * source.scales[number - 1] + source.offsets[number - 1]


def _shown(number, limits):
    """A band between its limits; a band of one value still needs two."""
    low, high = (float(f"{each:.6g}") for each in limits)
    return _Shown(number, low, high if high > low else low + 1.0)


def _shown_bands(source):
    """Bands of a picture in colours, else the first band in grey."""
    numbers = _composite(source)
    limits_of = dark_and_bright if len(numbers) == 3 else percentile_limits
    return [_shown(number, limits_of(_values(source, number))) for number in numbers]


def _ramp(source, name):
    """The first band, and the values and colours of its quantity."""
    colours, middle = colours_of(name)
    found = percentile_limits(_values(source, 1), middle=middle)
    ends = cf.QUANTITIES[name].ends
    band = _shown(1, [own if given is None else given for own, given in zip(found, ends, strict=True)])
    stops = stops_of(colours)
    values = np.linspace(band.low, band.high, len(stops))
    return [band], [(f"{value:.6g}", stop) for value, stop in zip(values, stops, strict=True)]
