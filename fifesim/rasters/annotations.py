"""Types of arguments that hold rasters, each with the kind that is checked; imports nothing slow."""

from typing import Annotated, Any, TypeAlias, TypeVar

import xarray as xr

from fifesim.base.annotations import FilePath
from fifesim.base.kinds import RASTER, Kind

RASTER_OR_DATASET = Kind("an xarray.DataArray or an xarray.Dataset", dimensions=2)
MASKS_TOO = RASTER_OR_DATASET._replace(numbers="iufb")

# The same kind goes in and comes out.
Raster = TypeVar("Raster", xr.DataArray, xr.Dataset)
RasterOrDataset: TypeAlias = Annotated[xr.DataArray | xr.Dataset, RASTER_OR_DATASET]
# A raster along any dimensions.
AnyDimensions: TypeAlias = Annotated[xr.DataArray, RASTER._replace(dimensions=0)]
NumberOrRaster: TypeAlias = float | xr.DataArray
FileOrRaster: TypeAlias = Annotated[
    FilePath | xr.DataArray, Kind("the path of a file, or an xarray.DataArray", dimensions=2)
]
# Elevation of the horizon, as `fifesim.horizon` gives it.
Horizon: TypeAlias = Annotated[
    xr.DataArray,
    Kind(
        "an xarray.DataArray over (direction, y, x), as fifesim.horizon gives it",
        lambda value: isinstance(value, xr.DataArray) and "direction" in value.dims,
    ),
]
# An image with several resolutions is an xarray.DataTree; Any keeps type checkers from requiring a test for it.
Image: TypeAlias = xr.DataArray | Any
