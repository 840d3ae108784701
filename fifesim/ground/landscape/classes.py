"""Land cover classes with their properties, as objects and as text in files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from numbers import Number
from typing import Annotated

import numpy as np
from scipy import stats

from fifesim.base.arguments import (
    FilePath,
    FrozenDistribution,
    Range,
    check,
    check_fields,
    described,
    kind_of,
)
from fifesim.base.caches import cached
from fifesim.ground.canopy.description import TALLGRASS, Canopy
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.canopy.properties import DRAWN, PROPERTIES
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background, Spectrum
from fifesim.ground.landscape.autoregression import check_streaming_arp
from fifesim.ground.landscape.distribution import lai_distribution, treatments

# Properties between 0 and 1.
SHARES = tuple(name for name, known in DRAWN.items() if (known.lowest, known.highest) == (0, 1))


@dataclass(frozen=True)
class Field:
    """
    A ground property that varies as a random field.

    Parameters
    ----------
    mean : float, optional
        [1]
    sd : float
        Standard deviation. [1]
    arp : float, optional
        Autoregressive parameter of the field, in [0, 0.2498]. [1]

    Raises
    ------
    ValueError
        If a number is out of range.
    TypeError
        If a value is not a number.

    Examples
    --------
    >>> from fifesim.ground import Field
    >>> float(Field(mean=0.2, sd=0.1).distribution("brown").mean())
    0.2
    """

    mean: Annotated[float, Range("1", -1, 1)] = 0.0
    sd: Annotated[float, Range("1", 0, np.inf, note="it is a standard deviation", ends="[)")] = 0.0
    arp: float = 0.15

    def __post_init__(self):
        check_fields(self)
        check_streaming_arp(self.arp)

    def distribution(self, name: str) -> FrozenDistribution:
        """
        Beta distribution of a fraction, from its mean and standard deviation.

        Parameters
        ----------
        name : str
            Name of the property, ``"moisture"``, ``"brown"`` or ``"crown_cover"``.

        Returns
        -------
        distribution : frozen scipy distribution
            [1]

        Raises
        ------
        ValueError
            If no distribution between 0 and 1 has this mean and standard deviation.
        """
        if not 0 < self.mean < 1:
            raise ValueError(
                f"{name} lies between 0 and 1: for it to vary its mean must lie between them, such as 0.2, got "
                f"{self.mean:g}"
            )
        most = (self.mean * (1 - self.mean)) ** 0.5
        if not 0 < self.sd < most:
            raise ValueError(
                f"{name} lies between 0 and 1: with a mean of {self.mean:g} its sd must be above 0 and below "
                f"{most:.3g}, got {self.sd:g}"
            )
        return _beta(float(self.mean), float(self.sd))


# Return the same object each time, because tables are cached by distribution.
@cached(32, "beta distributions")
def _beta(mean, sd):
    weight = mean * (1 - mean) / sd**2 - 1
    return stats.beta(mean * weight, (1 - mean) * weight)


LARGEST_CODE = 2**15 - 1  # largest code of a class in a map. Codes are 16-bit integers, with -1 for no data.


@dataclass(frozen=True, eq=False, repr=False)
class CoverClass:
    """
    A land cover class. Missing fields are taken from the landscape, or from the arguments of `surface_reflectance`.

    Parameters
    ----------
    name : str, optional
        Name of one word; in a mapping of classes it is the key.
    lai : str, path, frozen scipy distribution or float, optional
        Distribution of leaf area index as in `lai_distribution`, or a number for uniform leaf area. [m2 m-2]
    arp : float, optional
        Autoregressive parameter of leaf area, in [0, 0.2498]. [1]
    canopy : Canopy, optional
        Leaves, canopy structure and background, without rasters. Missing fields have the values of the scene.
    code : int, optional
        Code of the class in a map, 0 to 32767; by default classes are numbered from 1.

    Raises
    ------
    ValueError
        If a number is out of range, or the name is not a single word.
    TypeError
        If a value has the wrong type, or varies by cell.

    Examples
    --------
    >>> from fifesim import Canopy, CoverClass
    >>> CoverClass("water", lai=0.0, canopy=Canopy(background=0.03)).canopy
    Canopy(background=0.03)
    """

    name: str = ""
    lai: FilePath | FrozenDistribution | float | None = None
    arp: float | None = None
    canopy: Canopy = TALLGRASS
    code: int | None = None

    def __post_init__(self):
        if not isinstance(self.name, str) or len(self.name.split()) > 1:
            raise ValueError(f"the name of a class is one word, got {described(self.name)}: type burned-grazed")
        try:
            self._check()
        except (ValueError, TypeError) as error:
            if type(error) not in (ValueError, TypeError):
                raise
            raise type(error)(f"class {self.name!r}: {error}" if self.name else f"CoverClass: {error}") from None

    def __repr__(self):
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        shown = [f"{name}={value!r}" for name, value in given.items() if value not in ("", None, TALLGRASS)]
        return f"CoverClass({', '.join(shown)})"

    def _check(self):
        if self.arp is not None:
            if not _is_number(self.arp):
                raise TypeError(f"arp must be a number, got {described(self.arp)}")
            check_streaming_arp(self.arp)
        if self.code is not None:
            check("code", self.code, kind_of(Annotated[int, Range("1", 0, LARGEST_CODE)]))
        if _is_number(self.lai):
            check_map(float(self.lai))
        elif self.lai is not None:
            lai_distribution(self.lai)
        if not isinstance(self.canopy, Canopy):
            raise TypeError(f"canopy must be a fifesim.Canopy, got {described(self.canopy)}")
        for name in self.canopy.given:
            if _has_raster(getattr(self.canopy, name)):
                raise TypeError(
                    f"{name} must be uniform within a class, got one that varies: give it to landscape() or "
                    "surface_reflectance, and leave it out of the class"
                )


def class_table(classes):
    """Classes with names and codes, which count from 1 by default."""
    if isinstance(classes, CoverClass):
        classes = [classes]
    named = list(classes.items()) if isinstance(classes, Mapping) else [(None, each) for each in _listed(classes)]
    if not named:
        raise ValueError("a landscape has one class or more, got none: give for instance classes=fife_classes()")
    table = [_with_name(each, name, number) for number, (name, each) in enumerate(named, 1)]
    coded = [each for each in table if each.code is not None]
    if coded and len(coded) < len(table):
        others = ", ".join(each.name for each in table if each.code is None)
        raise ValueError(f"{len(coded)} of {len(table)} classes have a code, {others} none: give code= to all, or none")
    if not coded:
        table = [replace(each, code=number) for number, each in enumerate(table, 1)]
    for what in ("name", "code"):
        values = [getattr(each, what) for each in table]
        twice = [value for value in values if values.count(value) > 1]
        if twice:
            raise ValueError(f"two classes have the {what} {twice[0]!r}: each class has its own")
    return tuple(table)


def fife_classes() -> dict[str, CoverClass]:
    """
    The three treatments of the FIFE site, as classes 1 to 3.

    As in the paper, they differ only in their distribution of leaf area. Use ``dataclasses.replace`` to change a class.

    Returns
    -------
    classes : dict of str to CoverClass

    References
    ----------
    [Friedl1995]_, Fig. 3

    Examples
    --------
    >>> from fifesim.ground import fife_classes
    >>> list(fife_classes())
    ['burned-grazed', 'burned-ungrazed', 'unburned-ungrazed']
    """
    return {name: CoverClass(name, lai=name) for name in treatments()}


def _listed(classes):
    if isinstance(classes, str) or not np.iterable(classes):
        raise TypeError(f"classes are a list of fifesim.CoverClass, or {{name: CoverClass}}, got {described(classes)}")
    return list(classes)


def _with_name(found, name, number):
    """Class with its name."""
    if not isinstance(found, CoverClass):
        raise TypeError(
            f"class {name or number} must be a fifesim.CoverClass, got {described(found)}: type "
            "fifesim.CoverClass(lai='burned-grazed')"
        )
    if name is None and not found.name:
        raise ValueError(f"class {number} of the list has no name: type CoverClass('grass', ...)")
    if name is None or found.name == name:
        return found
    if found.name:
        raise ValueError(f"class {name!r} has another name, {found.name!r}: leave one of the two out")
    return replace(found, name=name)


def _is_number(value):
    return isinstance(value, Number) and not isinstance(value, bool | complex)


def _has_raster(value):
    """Whether a description contains a raster."""
    if isinstance(value, Leaf):
        return bool(value.varying())
    if isinstance(value, Mapping):
        return any(_has_raster(each) for each in value.values())
    if isinstance(value, tuple | list):
        return any(_has_raster(each) for each in value)
    return getattr(value, "ndim", 0) > 1


_KINDS = {kind.__name__: kind for kind in (Canopy, Leaf, Background, Spectrum)}


def table_text(table):
    """JSON text of a table of classes."""
    # Distributions that cannot be named are omitted. They are not needed once leaf area exists.
    rows = [{each.name: getattr(row, each.name) for each in fields(row)} for row in table]
    rows = [{name: _plain(value) for name, value in row.items() if value is not TALLGRASS} for row in rows]
    return json.dumps([{name: value for name, value in row.items() if value is not None} for row in rows])


@cached(16, "class tables")
def read_table(text):
    """Table of classes from its text."""
    try:
        return tuple(CoverClass(**{name: _made(value) for name, value in row.items()}) for row in json.loads(text))
    except (TypeError, AttributeError, json.JSONDecodeError) as error:
        raise ValueError(f"the class table of the cover is invalid: {error}") from None


def _plain(value):
    """Value of a class as types of JSON."""
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
        frozen = {"name": value.dist.name, "args": _plain(value.args), "kwds": _plain(value.kwds)}
        return {"scipy.stats": frozen} if known else None
    return value if value is None or isinstance(value, str | int | float) else str(value)


def _made(value):
    """Value of a class from types of JSON."""
    if isinstance(value, list):
        return tuple(map(_made, value))
    if not isinstance(value, dict):
        return value
    name = next(iter(value), None)
    if len(value) == 1 and name in _KINDS:
        return _KINDS[name](**{key: _made(each) for key, each in value[name].items()})
    if name == "scipy.stats":
        frozen = value[name]
        return getattr(stats, frozen["name"])(*frozen["args"], **frozen["kwds"])
    return {key: _made(each) for key, each in value.items()}
