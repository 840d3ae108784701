"""How QGIS shows a file: colours in a style file of the same name, which it takes by itself."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import jinja2
import numpy as np
from matplotlib import colormaps
from matplotlib.colors import ListedColormap, to_hex

from fifesim.base.annotations import FilePath
from fifesim.base.bands import BLUE, GREEN, NEAR_INFRARED, RED, nearest
from fifesim.base.foreign import in_a_line
from fifesim.rasters.opening import ErrorsOfGdal, raster_file

_TEMPLATE = Path(__file__).with_name("style.qml.j2")

_GREEN = colormaps["YlGn"]
# Without the blue of the map's seas.
_LAND = ListedColormap(colormaps["gist_earth"](np.linspace(0.3, 0.95, 256)))

# Colours of a quantity, and the values of the first and of the last where they are the same for all files.
_RAMPS = {
    "lai": (_GREEN, 0.0, None),
    **dict.fromkeys(("fpar", "green_fpar", "ndvi", "evi", "evi2", "savi", "msavi", "nirv"), (_GREEN, 0.0, 1.0)),
    **dict.fromkeys(("ndwi", "ndmi"), (colormaps["YlGnBu"], None, None)),
    "dem": (_LAND, None, None),
    "slope": (colormaps["YlOrBr"], 0.0, None),
}
_COLOURS = 9

# Percentiles of a band that become dark and bright, from so many pixels along a side at most. [%], [pixel]
_STRETCH = (2, 98)
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
    blue. A first band that is called ``lai``, ``ndvi``, ``dem`` or the like gets a ramp, and any other is grey. Bands
    are stretched between their percentiles 2 and 98, in the unit that scale and offset lead to, as QGIS counts.

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
        colours, low, high = _RAMPS.get(name, (None, None, None))
        numbers = [1] if colours else _composite(source)
        bands = [_stretched(source, number, low, high) for number in numbers]
    ramp = _ramp(colours, bands[0]) if colours else []
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
    blue, green, red, near = (nearest(wavelengths, window) for window in (BLUE, GREEN, RED, NEAR_INFRARED))
    false_colour = (near, red, red if green is None else green)
    for numbers in (false_colour, (red, green, blue)):
        if None not in numbers:
            return [number + 1 for number in numbers]
    return [1]


def _stretched(source, number, low, high):
    """A band between its percentiles, or between what is given."""
    step = max(1, -(-max(source.shape) // _SAMPLE))
    shape = tuple(-(-size // step) for size in source.shape)
    counts = source.read(number, out_shape=shape, masked=True).compressed()
    values = counts[np.isfinite(counts)] * source.scales[number - 1] + source.offsets[number - 1]
    found = np.percentile(values, _STRETCH) if values.size else (0.0, 1.0)
    low, high = (float(f"{own if given is None else given:.6g}") for own, given in zip(found, (low, high), strict=True))
    # A band of one value still needs two.
    return _Shown(number, low, high if high > low else low + 1.0)


def _ramp(colours, band):
    places = np.linspace(0, 1, _COLOURS)
    return [(f"{band.low + at * (band.high - band.low):.6g}", to_hex(colours(at))) for at in places]
