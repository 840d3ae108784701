"""What a landscape's classes of cover are: leaf area, leaves, what lies below, and how they stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Number

import numpy as np

from fifesim.base.annotations import Distribution, FilePath
from fifesim.base.kinds import described
from fifesim.ground.canopy.description import TALLGRASS, Canopy
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP, check_arp
from fifesim.ground.landscape.distribution import lai_distribution, treatments

LARGEST_CODE = 2**15 - 1
"""Of a class in a map: codes are numbers of 16 bits, of which -1 is no data."""


@dataclass(frozen=True, eq=False)
class CoverClass:
    """
    A class of cover. Fields that are not given have the values of the landscape, or of the call of
    `surface_reflectance`.

    Parameters
    ----------
    name : str, optional
        One word; in a mapping of classes it is the key.
    lai : str, path, frozen scipy distribution or float, optional
        Distribution of leaf area index as `lai_distribution` takes it, or one number where it is uniform. [m2 m-2]
    arp : float, optional
        Autoregressive parameter of leaf area, in [0, 0.2498]. [1]
    canopy : Canopy, optional
        Leaves, their arrangement and the ground below them, none of them a raster. Fields that are not given have the
        values of the scene.
    code : int, optional
        Of the class in a map, 0 to 32767; by default classes count from 1.

    Raises
    ------
    ValueError
        If a number is outside its range, or the name is no single word.
    TypeError
        If a value is of another kind, or varies from cell to cell.

    Examples
    --------
    >>> from fifesim import Canopy, CoverClass
    >>> CoverClass("water", lai=0.0, canopy=Canopy(background=0.03)).canopy
    Canopy(background=0.03)
    """

    name: str = ""
    lai: FilePath | Distribution | float | None = None
    arp: float | None = None
    canopy: Canopy = TALLGRASS
    code: int | None = None

    def __post_init__(self):
        if not isinstance(self.name, str) or len(self.name.split()) > 1:
            raise ValueError(f"the name of a class is one word, got {described(self.name)}: type burned-grazed")
        with _Named(self.name):
            self._check()

    def _check(self):
        if self.arp is not None:
            if not _is_number(self.arp):
                raise TypeError(f"arp must be a number, got {described(self.arp)}")
            check_arp(self.arp)
            if self.arp > LARGEST_STREAMING_ARP:
                raise ValueError(f"arp must be at most {LARGEST_STREAMING_ARP} in a landscape, got {self.arp:g}")
        if self.code is not None:
            _check_code(self.code)
        if _is_number(self.lai):
            check_map(float(self.lai))
        elif self.lai is not None:
            lai_distribution(self.lai)
        if not isinstance(self.canopy, Canopy):
            raise TypeError(f"canopy must be a fifesim.Canopy, got {described(self.canopy)}")
        for name in self.canopy.given:
            if _has_raster(getattr(self.canopy, name)):
                raise TypeError(
                    f"{name} is the same in all of a class, got one that varies: give it to landscape() or "
                    "surface_reflectance, and leave it out of the class"
                )


class _Named:
    """A context in which errors say which class they are of."""

    def __init__(self, name):
        self._name = name

    def __enter__(self):
        return self

    def __exit__(self, kind, error, traceback):
        if kind in (ValueError, TypeError):
            raise kind(f"class {self._name!r}: {error}" if self._name else f"CoverClass: {error}") from None


def class_table(classes):
    """
    Classes with their names and codes.

    Parameters
    ----------
    classes : CoverClass, sequence of CoverClass, or mapping of str to CoverClass

    Returns
    -------
    table : tuple of CoverClass
        Each with a name and a code, which counts from 1 where classes say none.

    Raises
    ------
    ValueError
        If there is no class, two have one name or one code, or only some say theirs.
    TypeError
        If it holds something else.

    Examples
    --------
    >>> table = class_table({"grass": CoverClass(lai="burned-grazed"), "water": CoverClass(lai=0)})
    >>> [(each.name, each.code) for each in table]
    [('grass', 1), ('water', 2)]
    """
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

    They differ in the distribution of their leaf area alone, as in the paper; leaves, soil and litter, and the
    structure of the field are those of the landscape. ``dataclasses.replace`` changes one.

    Returns
    -------
    classes : dict of str to CoverClass

    References
    ----------
    [Friedl1995]_, Fig. 3

    Examples
    --------
    >>> from fifesim import fife_classes
    >>> list(fife_classes())
    ['burned-grazed', 'burned-ungrazed', 'unburned-ungrazed']
    """
    return {name: CoverClass(name, lai=name) for name in treatments()}


def _listed(classes):
    if isinstance(classes, str) or not np.iterable(classes):
        raise TypeError(f"classes are a list of fifesim.CoverClass, or {{name: CoverClass}}, got {described(classes)}")
    return list(classes)


def _with_name(found, name, number):
    """A class by its name."""
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


def _check_code(code):
    if isinstance(code, bool) or not isinstance(code, int | np.integer):
        raise TypeError(f"code must be a whole number, got {described(code)}")
    if not 0 <= code <= LARGEST_CODE:
        raise ValueError(f"code must be in 0 to {LARGEST_CODE}, got {code}")


def _is_number(value):
    return isinstance(value, Number) and not isinstance(value, bool | complex)


def _has_raster(value):
    """Whether a description has something in it that varies from cell to cell."""
    if isinstance(value, Leaf):
        return bool(value.varying())
    if isinstance(value, Mapping):
        return any(_has_raster(each) for each in value.values())
    if isinstance(value, tuple | list):
        return any(_has_raster(each) for each in value)
    return getattr(value, "ndim", 0) > 1
