"""Properties of a canopy: default, unit, range and meaning of each."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from fifesim.base.arguments import Range

_PERCENT = {"percent": 0.01}


class Property(NamedTuple):
    """Property of the canopy, with the fields of a `Range`."""

    default: Any
    meaning: str
    unit: str = ""  # empty for a property that is not a number
    lowest: float = 0.0
    highest: float = 1.0
    by_cell: bool = False  # whether it may be a raster over (y, x)
    effect: str = ""  # name of its variation in a budget; a property with an effect may be a random field
    usual: tuple[float, float] = (-math.inf, math.inf)
    others: Mapping[str, float] = _PERCENT  # factors from other units
    instead: str = ""  # other property for which the number may have been meant

    ends, of, __str__ = "[]", Range.of, Range.__str__  # type: ignore[misc]

    @property
    def note(self):
        """Meaning, as the end of a message."""
        return f"it is the {self.meaning}{self.instead}"


# Properties by the names of the fields of `fifesim.Canopy`. The module imports no physics, for scenarios as text.
PROPERTIES = {
    "leaf_optics": Property(None, "optics of green leaves"),
    "leaf_angles": Property("spherical", "leaf angle distribution"),
    "model": Property("sail", "radiative transfer in the leaves: sail or discrete-ordinates"),
    "hotspot": Property(0.0, "leaf size over canopy height", "1", 0, 10, usual=(0, 1)),
    "brown": Property(0.0, "share of dead leaf area", "1", by_cell=True, effect="dead leaves"),
    "dissociation": Property(0.0, "position of dead leaves: 0 among the green ones, 1 below them", "1", by_cell=True),
    "brown_leaf": Property(None, "optics of dead leaves"),
    "crown_cover": Property(1.0, "share of the ground below crowns", "1", by_cell=True, effect="clumping"),
    "crown_shape": Property(1.0, "crown diameter over the height of its middle", "1", 0, 10, usual=(0, 5), others={}),
    "background": Property(None, "reflectance below the canopy"),
    "soil": Property(
        0.0,
        "change of soil reflectance at 0.55 um along the soil line",
        "1",
        -1,
        1,
        True,
        "soil",
        (-0.15, 0.15),
        {},
        instead="; to give its reflectance, type background=",
    ),
    "moisture": Property(0.0, "moisture of the soil, 0 dry to 1 saturated", "1", by_cell=True, effect="soil"),
}

NUMERIC_PROPERTIES = {name: each for name, each in PROPERTIES.items() if each.unit}  # properties that are numbers

# Properties that may be random fields of a landscape.
DRAWN = {name: each for name, each in PROPERTIES.items() if each.effect}
