"""What annotations of the public face call by one name, where rasters have a part."""

from typing import Any, TypeAlias, TypeVar

import xarray as xr

from fifesim.base.geometry import Geometry

# The same kind goes in and comes out.
Raster = TypeVar("Raster", xr.DataArray, xr.Dataset)
NumberOrRaster: TypeAlias = float | xr.DataArray
# Of sun and sensor: the same everywhere, or by cell.
Directions: TypeAlias = Geometry | xr.Dataset
# Of bands of several resolutions it is an xarray.DataTree, which a type checker does not ask after.
Image: TypeAlias = xr.DataArray | Any
