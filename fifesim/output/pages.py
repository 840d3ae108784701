"""HTML pages that hold all that they show, and the pictures in them."""

import base64
import io
from pathlib import Path

import jinja2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from fifesim.output.provenance import versions

# What all pages share, page.html.j2, lies here.
_SHARED = Path(__file__).parent

# Of a picture's palette.
_SHADES = 256


def html(template, **values):
    """
    A self-contained page.

    Parameters
    ----------
    template : pathlib.Path
        Of jinja, which extends ``page.html.j2``.
    **values
        Of the names in the template. ``versions`` are there for all.

    Returns
    -------
    html : str

    Raises
    ------
    jinja2.UndefinedError
        If the template has a name without a value.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([template.parent, _SHARED]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {"fixed": fixed, "plus_minus": plus_minus, "embedded": _embedded}
    return environment.get_template(template.name).render(versions=versions(), **values)


def png(figure, dpi):
    """
    A figure as the bytes of a PNG file, the same for the same figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    dpi : float
        Pixels to an inch.

    Returns
    -------
    picture : bytes
        With a palette: a third of the bytes, for lines, letters and colour maps.
    """
    figure.set_dpi(dpi)
    # Unlike savefig, this lays the figure out and draws it once.
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    drawn, buffer = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]), io.BytesIO()
    drawn.quantize(_SHADES, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(buffer, "png")
    return buffer.getvalue()


def fixed(value, digits=2, sign=False):
    """
    A number as it is printed.

    Parameters
    ----------
    value : float or None
    digits : int, optional
        After the point.
    sign : bool, optional
        Also of positive numbers; what is printed as zero has none.

    Returns
    -------
    text : str
        With a true minus; a dash for what is not known.

    Examples
    --------
    >>> fixed(-0.125), fixed(0.5, 1, sign=True), fixed(-1e-9), fixed(-1e-9, 3, sign=True), fixed(None)
    ('−0.12', '+0.5', '0.00', '0.000', '–')
    """
    if value is None or not np.isfinite(value):
        return "–"
    text = f"{value:{'+' if sign else ''}.{digits}f}"
    if float(text) == 0:
        text = text.lstrip("+-")
    return text.replace("-", "−")


def plus_minus(value, digits=1):
    """
    A standard error to stand behind its number.

    Parameters
    ----------
    value : float
        NaN where it is not known.
    digits : int, optional
        After the point.

    Returns
    -------
    text : str

    Examples
    --------
    >>> plus_minus(0.25, 2), plus_minus(float("nan"))
    (' ± 0.25', '')
    """
    return f" ± {value:.{digits}f}" if np.isfinite(value) else ""


def _embedded(picture):
    """Address of a PNG or WebP picture that is the picture itself."""
    kind = "webp" if picture[8:12] == b"WEBP" else "png"
    return f"data:image/{kind};base64," + base64.b64encode(picture).decode("ascii")
