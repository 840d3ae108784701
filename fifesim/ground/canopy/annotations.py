"""Types of arguments for leaves and the ground below them, each with the kind that is checked."""

from collections.abc import Mapping, Sequence
from typing import Annotated, TypeAlias

import numpy as np

from fifesim.base.annotations import Array, FilePath, NumberOrArray
from fifesim.base.kinds import ANYTHING, MAPPING, NUMBER, RASTER, ROW, TWO, Kind, is_a, is_path
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background

LEAF = Kind(
    "a fifesim.Leaf, the path of a CSV file or a Dataset of spectra, {band: (reflectance, transmittance)}, or a pair",
    lambda value: (
        isinstance(value, Leaf) or is_a(value, "Dataset") or is_path(value) or MAPPING.fits(value) or TWO.fits(value)
    ),
)

# A leaf by its contents, a file or Dataset of its spectra, or reflectance and transmittance, by band or for all bands.
LeafOptics: TypeAlias = Annotated[Leaf | FilePath | Mapping | Sequence[NumberOrArray], LEAF]
LeafAngles: TypeAlias = Annotated[
    str | Sequence[float] | np.ndarray,
    Kind(
        "a name such as 'planophile', classes such as '30: 0.5, 60: 0.5', or a list of fractions",
        lambda value: ROW.fits(value) and not isinstance(value, Mapping),
    ),
]
# A number or raster, by band or spectrum, shares of spectra, or a file or Dataset of a spectrum.
BelowLeaves: TypeAlias = Annotated[float | Array | Background | Mapping | FilePath, ANYTHING]
# A number, or a raster over (y, x).
NumberByCell: TypeAlias = Annotated[
    float | Array,
    Kind(
        f"{NUMBER.words}, or {RASTER.words}",
        lambda value: RASTER.fits(value) or (NUMBER.fits(value) and not isinstance(value, np.complexfloating)),
        RASTER.dimensions,
    ),
]
