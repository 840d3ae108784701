"""Classes of cover as text, which travels with a raster and into files, and back."""

import json
from dataclasses import fields
from functools import lru_cache

import numpy as np
from scipy import stats

from fifesim.ground.canopy.description import TALLGRASS, Canopy
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background
from fifesim.ground.canopy.spectrum import Spectrum
from fifesim.ground.landscape.classes import CoverClass

_KINDS = {kind.__name__: kind for kind in (Canopy, Leaf, Background, Spectrum)}


def table_text(table):
    """
    Text of a table of classes.

    Parameters
    ----------
    table : sequence of CoverClass

    Returns
    -------
    text : str
        JSON, of what the classes say. A distribution that is no name, no file and none of `scipy.stats` is left out: it
        is not needed any more where leaf area is there.

    Examples
    --------
    >>> table_text([CoverClass("water", lai=0, canopy=Canopy(background=0.03), code=1)])
    '[{"name": "water", "lai": 0, "canopy": {"Canopy": {"background": 0.03}}, "code": 1}]'
    """
    rows = [{each.name: getattr(row, each.name) for each in fields(row)} for row in table]
    rows = [{name: _plain(value) for name, value in row.items() if value is not TALLGRASS} for row in rows]
    return json.dumps([{name: value for name, value in row.items() if value is not None} for row in rows])


@lru_cache(maxsize=16)
def read_table(text):
    """
    Table of classes from its text.

    Parameters
    ----------
    text : str
        From `table_text`.

    Returns
    -------
    table : tuple of CoverClass

    Raises
    ------
    ValueError
        If it is no such text.

    Examples
    --------
    >>> read_table(table_text([CoverClass("water", lai=0, code=1)]))[0].name
    'water'
    """
    try:
        return tuple(CoverClass(**{name: _made(value) for name, value in row.items()}) for row in json.loads(text))
    except (TypeError, AttributeError, json.JSONDecodeError) as error:
        raise ValueError(f"the classes of the cover are not as landscape() writes them: {error}") from None


def _plain(value):
    """A value of a class by what JSON has."""
    if isinstance(value, Canopy):
        return {"Canopy": {name: _plain(getattr(value, name)) for name in PROPERTIES if name in value.given}}
    if type(value).__name__ in _KINDS:
        return {type(value).__name__: {each.name: _plain(getattr(value, each.name)) for each in fields(value)}}
    if isinstance(value, dict):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list | np.ndarray):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, "ppf"):
        known = isinstance(getattr(stats, value.dist.name, None), stats.rv_continuous)
        said = {"name": value.dist.name, "args": _plain(value.args), "kwds": _plain(value.kwds)}
        return {"scipy.stats": said} if known else None
    return value if value is None or isinstance(value, str | int | float) else str(value)


def _made(value):
    """The value of what JSON has."""
    if isinstance(value, list):
        return tuple(map(_made, value))
    if not isinstance(value, dict):
        return value
    name = next(iter(value), None)
    if len(value) == 1 and name in _KINDS:
        return _KINDS[name](**{key: _made(each) for key, each in value[name].items()})
    if name == "scipy.stats":
        said = value[name]
        return getattr(stats, said["name"])(*said["args"], **said["kwds"])
    return {key: _made(each) for key, each in value.items()}
