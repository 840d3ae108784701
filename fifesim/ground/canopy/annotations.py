"""What annotations of the public face call by one name, where leaves and what lies below them have a part."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from fifesim.base.annotations import Array, FilePath, NumberOrArray
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.spectra import Background

# A leaf by its contents, a file or Dataset of its spectra, or reflectance and transmittance, by band or for all bands.
LeafOptics: TypeAlias = Leaf | FilePath | Mapping | Sequence[NumberOrArray]
LeafAngles: TypeAlias = str | Sequence[float] | np.ndarray
# A number or raster, by band or spectrum, shares of spectra, or a file or Dataset of a spectrum.
BelowLeaves: TypeAlias = float | Array | Background | Mapping | FilePath
