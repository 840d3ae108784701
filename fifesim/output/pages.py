"""HTML pages that hold all that they show, and the pictures in them."""

import base64
import io
from pathlib import Path

import jinja2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg

from fifesim.output.provenance import versions

# What all pages share, page.html.j2, lies here.
_SHARED = Path(__file__).parent


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
    """
    buffer = io.BytesIO()
    figure.set_dpi(dpi)
    # Unlike savefig, this lays the figure out and draws it once.
    FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": None})
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
        Also of positive numbers.

    Returns
    -------
    text : str
        With a true minus; a dash for what is not known.

    Examples
    --------
    >>> fixed(-0.125), fixed(0.5, 1, sign=True), fixed(-1e-9), fixed(None)
    ('−0.12', '+0.5', '0.00', '–')
    """
    if value is None or not np.isfinite(value):
        return "–"
    text = f"{value:{'+' if sign else ''}.{digits}f}"
    if not sign and float(text) == 0:
        text = text.lstrip("-")
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
    """Address of a PNG picture that is the picture itself."""
    return "data:image/png;base64," + base64.b64encode(picture).decode("ascii")
