"""What annotations of the public face call by one name, where leaves and what lies below them have a part."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from fifesim.base.annotations import Array, FilePath, NumberOrArray
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background

# Reflectance and transmittance, for all bands or by band, or a leaf by what it is made of.
LeafOptics: TypeAlias = Leaf | Mapping[str, Sequence[NumberOrArray]] | Sequence[NumberOrArray]
LeafAngles: TypeAlias = str | Sequence[float] | np.ndarray
# A number or raster, by band or spectrum, shares of spectra, or a file or Dataset of a spectrum.
BelowLeaves: TypeAlias = float | Array | Background | Mapping | FilePath
