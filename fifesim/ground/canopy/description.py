"""Description of a canopy: leaves, structure and background."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np

from fifesim.base import arguments
from fifesim.base.arguments import Array, FilePath, NumberOrArray, check_number
from fifesim.base.messages import PARTS, html_table
from fifesim.ground.canopy.crowns import check_crowns
from fifesim.ground.canopy.leaf_angles import LeafAngles, leaf_angle_classes
from fifesim.ground.canopy.optics import check_background
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background

LEAF = arguments.Kind(
    "a fifesim.Leaf, the path of a CSV file or a Dataset of spectra, {band: (reflectance, transmittance)}, or a pair",
    lambda value: (
        isinstance(value, Leaf)
        or arguments.is_a(value, "Dataset")
        or arguments.is_path(value)
        or arguments.MAPPING.fits(value)  # type: ignore[misc]
        or arguments.TWO.fits(value)  # type: ignore[misc]
    ),
)

# A leaf by its contents, a file or Dataset of its spectra, or reflectance and transmittance, by band or for all bands.
LeafOptics: TypeAlias = Annotated[Leaf | FilePath | Mapping | Sequence[NumberOrArray], LEAF]
LeafAngleInput: TypeAlias = Annotated[
    str | Sequence[float] | np.ndarray,
    arguments.Kind(
        "a name such as 'planophile', classes such as '30: 0.5, 60: 0.5', or a list of fractions",
        lambda value: arguments.ROW.fits(value) and not isinstance(value, Mapping),
    ),
]
# A number or raster, by band or spectrum, shares of spectra, or a file or Dataset of a spectrum.
BelowLeaves: TypeAlias = Annotated[float | Array | Background | Mapping | FilePath, arguments.ANYTHING]
# A number, or a raster over (y, x).
NumberByCell: TypeAlias = Annotated[
    float | Array,
    arguments.Kind(
        f"{arguments.NUMBER.words}, or {arguments.RASTER.words}",
        lambda value: (
            arguments.RASTER.fits(value) or (arguments.NUMBER.fits(value) and not isinstance(value, np.complexfloating))
        ),
        arguments.RASTER.dimensions,
    ),
]


# Defaults of fields that are optics, in words.
_TALLGRASS = {
    "leaf_optics": "green tallgrass", "brown_leaf": "dead tallgrass", "background": "soil and litter of tallgrass",
}  # fmt: skip

# A smaller hot spot is narrower than the solar disc. [1]
LEAST_HOTSPOT = 1e-6


class ByValue:
    """Dataclass whose instances are equal if all fields are, rasters included."""

    def __eq__(self, other):
        return _same(self, other) if type(other) is type(self) else NotImplemented

    def __hash__(self):
        return hash(type(self))


def _same(one, other):
    """Whether two values are equal, where rasters may be among them."""
    if one is other or type(one) is not type(other):
        return one is other or bool(np.ndim(one) == np.ndim(other) == 0 and one == other)
    if arguments.is_a(one, "DataArray", "Dataset"):
        return one.identical(other)
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(_same(each, other[name]) for name, each in one.items())
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if is_dataclass(one):
        return all(_same(getattr(one, each.name), getattr(other, each.name)) for each in fields(one))
    return bool(one == other)


@dataclass(frozen=True, eq=False, repr=False)
class Canopy(ByValue):
    """
    A canopy: leaves, structure and background.

    Missing fields have their defaults; in a land cover class they have the values of the scene.

    Parameters
    ----------
    leaf_optics : Leaf, str, path, xarray.Dataset, or mapping of str to (float, float), optional
        A leaf by its contents; the path of a CSV file, or a Dataset, with its spectra ``wavelength`` [um],
        ``reflectance`` and ``transmittance``; or both by band name. By default green tallgrass.
        Each number may be a raster over (y, x): SAIL is evaluated at every cell then. If only one content of the `Leaf`
        is a raster, its optics are interpolated within 1e-8; otherwise each kind of leaf is computed once. [1]
    leaf_angles : str or sequence of float, optional
        A name such as ``"planophile"``, ``"campbell(57)"`` or ``"verhoef(-0.35,-0.15)"``, or class fractions; by
        default ``"spherical"``.
    model : {"sail", "discrete-ordinates"}, optional
        Radiative transfer in the leaves: "sail" (default) with four streams, up to 3 % off in the near infrared at
        nadir, or "discrete-ordinates", exact but for the hot spot. The latter needs one direction of sun and view, and
        green and dead leaves without dissociation.
    hotspot : float, optional
        Leaf size over canopy height, in [0, 10]; the default 0 means no hot spot. [1]
    brown : float or xarray.DataArray, dims (y, x), optional
        Dead fraction of the leaf area, in [0, 1]; by default 0. [1]
    dissociation : float or xarray.DataArray, dims (y, x), optional
        Position of dead leaves: 0 among the green ones (default), 1 below them. If it is a raster, SAIL is evaluated at
        every cell. [1]
    brown_leaf : optional
        Optics of dead leaves, like ``leaf_optics``; by default dead tallgrass.
    crown_cover : float or xarray.DataArray, dims (y, x), optional
        Ground fraction covered by crowns, which contain all leaves; 0 is bare ground, 1 (default) has no gaps. [1]
    crown_shape : float, optional
        Crown diameter over the height of its middle, in [0, 10]; by default 1. [1]
    background : optional
        Reflectance below the canopy: a number, by band name, or a raster over ([band], y, x); a `Background` or
        ``{spectrum: fraction}`` that mixes spectra; the path of a CSV file, or a Dataset, with ``wavelength`` [um] and
        ``reflectance``. Each number by band or spectrum may be a raster over (y, x). By default soil and litter of
        tallgrass. [1]
    soil : float or xarray.DataArray, dims (y, x), optional
        Brightness of the background: change of its reflectance at 0.55 um along the soil line, in [-1, 1]; by default
        0. All bands change, and reflectance is clipped to [0, 1]. [1]
    moisture : float or xarray.DataArray, dims (y, x), optional
        Moisture of the background, 0 dry (default) to 1 saturated (5 and 55 percent of the volume). Films of water
        darken it, most in the shortwave infrared. [1]

    Attributes
    ----------
    given : frozenset of str
        Names of the fields that were given.

    Raises
    ------
    ValueError
        If a number is out of its range, or the leaf angles are unknown.
    TypeError
        If a value has the wrong type.

    Examples
    --------
    >>> from fifesim import Canopy
    >>> grass = Canopy(brown=0.2, leaf_angles="erectophile")
    >>> grass.brown, grass.crown_cover
    (0.2, 1.0)
    >>> grass.replace(brown=0.4)
    Canopy(leaf_angles='erectophile', brown=0.4)
    >>> Canopy(brown=20)
    Traceback (most recent call last):
    ...
    ValueError: brown must be in [0, 1], got 20: it is the share of dead leaf area; if it is in percent, type brown=0.2
    """

    _in_words: ClassVar[str] = "a fifesim.Canopy, such as fifesim.Canopy(brown=0.2)"

    leaf_optics: LeafOptics | None = None
    leaf_angles: LeafAngleInput | None = None
    model: Literal["sail", "discrete-ordinates"] | None = None
    hotspot: float | None = None
    brown: NumberByCell | None = None
    dissociation: NumberByCell | None = None
    brown_leaf: LeafOptics | None = None
    crown_cover: NumberByCell | None = None
    crown_shape: float | None = None
    background: BelowLeaves | None = None
    soil: NumberByCell | None = None
    moisture: NumberByCell | None = None
    given: frozenset = field(default=frozenset(), init=False)

    def __post_init__(self):
        object.__setattr__(self, "given", frozenset(name for name in PROPERTIES if getattr(self, name) is not None))
        if self.given:
            arguments.check_fields(self, *self.given)
        for name, known in PROPERTIES.items():
            if name in self.given:
                _check(name, getattr(self, name), known)
            else:
                object.__setattr__(self, name, known.default)

    def __repr__(self):
        given = (f"{name}={_brief(getattr(self, name))}" for name in PROPERTIES if name in self.given)
        return f"Canopy({', '.join(given) or '<all defaults: green tallgrass above its soil and litter>'})"

    def _repr_html_(self):
        given = [
            (name, _brief(getattr(self, name)), PROPERTIES[name].meaning) for name in PROPERTIES if name in self.given
        ]
        defaults = {name: each for name, each in PROPERTIES.items() if name not in self.given}
        rows = [
            (name, _TALLGRASS.get(name, each.default), f"{each.meaning} (default)") for name, each in defaults.items()
        ]
        return html_table("Canopy", given + rows)

    @cached_property
    def leaf_angle_distribution(self) -> LeafAngles:
        """Leaf angles as shares of the leaf area in classes of inclination."""
        return leaf_angle_classes(self.leaf_angles)

    def replace(self, **changes: Any) -> Self:
        """
        Canopy with new values of some fields. Other missing fields remain missing.

        Parameters
        ----------
        **changes
            New values by name; None removes a field.

        Returns
        -------
        canopy : Canopy
        """
        return type(self)(**{name: getattr(self, name) for name in self.given} | changes)

    def over(self, other: "Canopy") -> "Canopy":
        """
        This canopy, with missing fields taken from another canopy.

        Parameters
        ----------
        other : Canopy

        Returns
        -------
        canopy : Canopy
        """
        return other.replace(**{name: getattr(self, name) for name in self.given})

    def check_lai(self, largest: float) -> None:
        """
        Check that the leaf area within crowns is allowed.

        Parameters
        ----------
        largest : float
            Largest leaf area index of the ground. [m2 m-2]

        Raises
        ------
        ValueError
            If the leaf area index within the crowns exceeds the limit of SAIL.
        """
        if is_raster(self.crown_cover):
            return
        try:
            check_crowns(largest, self.crown_cover)
        except ValueError as error:
            raise ValueError(f"crown_cover = {self.crown_cover:g}: {error}") from None


PARTS["canopy"] = "fifesim.Canopy", tuple(PROPERTIES)

TALLGRASS = Canopy()  # the default canopy: green tallgrass of the FIFE site


def is_raster(value):
    """Whether the value of a field is a raster."""
    return arguments.is_a(value, "DataArray")


def _check(name, value, known):
    """Raise ValueError if a field cannot have a value."""
    if name == "leaf_angles":
        leaf_angle_classes(value)
    elif name == "background":
        numbers = [value] if arguments.NUMBER.fits(value) and not is_raster(value) else []
        check_background(np.array(numbers, float))
    elif known.unit and not is_raster(value):
        check_number(name, value, known)
        if name == "hotspot" and 0 < value < LEAST_HOTSPOT:
            raise ValueError(f"hotspot must be 0, for no hot spot, or at least {LEAST_HOTSPOT:g}, got {value:g}")
    elif known.unit and value.dtype.kind not in "iuf":
        raise TypeError(
            f"{name} must hold real numbers, got {value.dtype}: type .astype(float) if 0 and 1 are its values"
        )
    elif known.unit and set(value.dims) - {"time"} != {"y", "x"}:
        raise ValueError(f"{name} must be a number, or a raster over (y, x), got dimensions {value.dims}")


def _brief(value):
    """Short text of the value of a field."""
    return f"<{arguments.described(value)}>" if arguments.is_a(value, "DataArray", "Dataset") else repr(value)
