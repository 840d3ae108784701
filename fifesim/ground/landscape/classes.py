"""What a landscape's classes of cover are: leaf area, leaves, what lies below, and how they stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Number

import numpy as np

from fifesim.base.annotations import Distribution, FilePath
from fifesim.base.kinds import described
from fifesim.ground.canopy.annotations import LEAF, BelowLeaves, LeafAngles, LeafOptics
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.soil import check_brightness
from fifesim.ground.landscape.autoregression import LARGEST_STREAMING_ARP, check_arp
from fifesim.ground.landscape.distribution import lai_distribution, treatments

LARGEST_CODE = 2**15 - 1
"""Of a class in a map: codes are numbers of 16 bits, of which -1 is no data."""

_SHARES = ("brown", "dissociation", "crown_cover", "moisture")
_RATIOS = ("hotspot", "crown_shape")

OPTICS = ("leaf", "brown_leaf", "background", "leaf_angles", *_RATIOS, *_SHARES, "soil")
"""What a class may say of its reflectance, beside its leaf area."""


@dataclass(frozen=True, eq=False)
class CoverClass:
    """
    A class of cover. What it leaves open, the landscape or the call of `surface_reflectance` says.

    Parameters
    ----------
    name : str, optional
        One word; in a mapping of classes it is the key.
    lai : str, path, frozen scipy distribution or float, optional
        Distribution of leaf area index as `lai_distribution` takes it, or one number where it is uniform. [m2 m-2]
    arp : float, optional
        Autoregressive parameter of leaf area, in [0, 0.2498]. [1]
    leaf, brown_leaf : Leaf, mapping or pair, optional
        Optics of green and of dead leaves, as ``leaf_optics`` of `surface_reflectance`, of numbers. [1]
    background : float, mapping, Background or str, optional
        Reflectance below the canopy, as in `surface_reflectance`, of numbers. [1]
    leaf_angles : str or sequence of float, optional
        As in `surface_reflectance`.
    hotspot : float, optional
        Leaf size over canopy height. [1]
    brown : float, optional
        Share of dead leaf area, in [0, 1]. [1]
    dissociation : float, optional
        0 where dead leaves are mixed with green ones, 1 where they lie below. [1]
    crown_cover : float, optional
        Share of the ground below crowns, in [0, 1]. [1]
    crown_shape : float, optional
        Crown diameter over height. [1]
    soil : float, optional
        Brightness of the soil, a change of its reflectance along the soil line. [1]
    moisture : float, optional
        Of the soil, 0 dry to 1 saturated. [1]
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
    >>> from fifesim import CoverClass
    >>> CoverClass("water", lai=0.0, background=0.03).hotspot is None
    True
    """

    name: str = ""
    lai: FilePath | Distribution | float | None = None
    arp: float | None = None
    leaf: LeafOptics | None = None
    brown_leaf: LeafOptics | None = None
    background: BelowLeaves | None = None
    leaf_angles: LeafAngles | None = None
    hotspot: float | None = None
    brown: float | None = None
    dissociation: float | None = None
    crown_cover: float | None = None
    crown_shape: float | None = None
    soil: float | None = None
    moisture: float | None = None
    code: int | None = None

    def __post_init__(self):
        if not isinstance(self.name, str) or len(self.name.split()) > 1:
            raise ValueError(f"the name of a class is one word, got {described(self.name)}: type burned-grazed")
        with _Named(self.name):
            self._check()

    def _check(self):
        for name in ("arp", "soil", *_RATIOS, *_SHARES):
            value = getattr(self, name)
            if value is not None and not _is_number(value):
                raise TypeError(f"{name} must be a number, got {described(value)}: rasters go to landscape()")
        if self.arp is not None:
            check_arp(self.arp)
            if self.arp > LARGEST_STREAMING_ARP:
                raise ValueError(f"arp must be at most {LARGEST_STREAMING_ARP} in a landscape, got {self.arp:g}")
        for name in _SHARES:
            if getattr(self, name) is not None and not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} must be in [0, 1], got {getattr(self, name):g}: it is a share")
        for name in _RATIOS:
            if getattr(self, name) is not None and not 0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be at least 0, got {getattr(self, name):g}: it is a ratio")
        if self.soil is not None:
            check_brightness(self.soil)
        if self.code is not None:
            _check_code(self.code)
        if _is_number(self.lai):
            check_map(float(self.lai))
        elif self.lai is not None:
            lai_distribution(self.lai)
        if self.leaf_angles is not None:
            leaf_angle_classes(self.leaf_angles)
        for name in ("leaf", "brown_leaf"):
            value = getattr(self, name)
            if value is not None and not LEAF.fits(value):
                raise TypeError(f"{name} must be {LEAF.words}, got {described(value)}")
        for name in ("leaf", "brown_leaf", "background"):
            if _has_raster(getattr(self, name)):
                raise TypeError(
                    f"{name} is the same in all of a class, got one that varies: give it to surface_reflectance, and "
                    "leave it out of the class"
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
