"""What annotations of the public face call by one name, where rasters have a part."""

from typing import Any, TypeAlias, TypeVar

import xarray as xr
from odc.geo.crs import MaybeCRS

from fifesim.base.geometry import Geometry

# The same kind goes in and comes out.
Raster = TypeVar("Raster", xr.DataArray, xr.Dataset)
NumberOrRaster: TypeAlias = float | xr.DataArray
# Of sun and sensor: the same everywhere, or by cell.
Directions: TypeAlias = Geometry | xr.Dataset
# As the attribute crs of a grid may be; a grid without one is refused when it is used.
CRS: TypeAlias = MaybeCRS
# Of bands of several resolutions it is an xarray.DataTree, which a type checker does not ask after.
Image: TypeAlias = xr.DataArray | Any
