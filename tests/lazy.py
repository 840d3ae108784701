"""Rules for all raster functions: laziness, chunks, labels and georeferencing."""

from contextlib import contextmanager

import dask
import numpy as np
import xarray as xr
from affine import Affine

from fifesim.grids import cf
from fifesim.grids import grid as grids

# Several chunks, one axis smaller than a pixel, and no common factor with pixels of 9 cells.
ODD_CHUNKS = {"y": 7, "x": 11}
CHUNKS = {"y": 27, "x": 36}


@contextmanager
def no_compute():
    """Fail if a dask graph is computed."""

    def refuse(graph, keys, **options):
        raise AssertionError("computed before it was asked to")

    with dask.config.set(scheduler=refuse):
        yield


def in_chunks(array, chunks):
    """
    Chunk an array along its dimensions that `chunks` names.

    Coordinates stay in memory, unlike in `DataArray.chunk`, since wavelengths are needed to find a band.
    """
    along = {name: size for name, size in chunks.items() if name in array.dims}
    return array.copy(data=array.variable.chunk(along).data)


def check_raster_function(function, *rasters, quantity):
    """
    Check the rules for raster functions and return the result.

    Inputs are not modified. Chunked input gives bitwise equal results, computed lazily. Name and attributes are those
    of the quantity. Coordinates, CRS and transform are consistent.
    """
    before = [raster.copy(deep=True) for raster in rasters]
    result = function(*rasters)
    for chunks in (CHUNKS, ODD_CHUNKS, ODD_CHUNKS | {"band": 1}):
        with no_compute():
            lazy = function(*(in_chunks(raster, chunks) for raster in rasters))
        assert lazy.chunks is not None
        xr.testing.assert_identical(lazy.compute(), result)
    for raster, copy in zip(rasters, before, strict=True):
        xr.testing.assert_identical(raster, copy)
    assert result.name == quantity
    assert cf.attributes(quantity).items() <= result.attrs.items()
    assert all(isinstance(value, str | int | float | np.number) for value in result.attrs.values())
    check_place(result, grids.geobox(rasters[0]).crs)
    return result


def check_place(raster, crs):
    """Check that dimensions, CRS, transform and coordinates of a raster are consistent."""
    assert raster.dims[-2:] == ("y", "x")
    assert raster.rio.crs == crs
    assert raster.encoding["grid_mapping"] == "spatial_ref"
    x, y = raster["x"].values, raster["y"].values
    transform = Affine.from_gdal(*map(float, raster["spatial_ref"].attrs["GeoTransform"].split()))
    columns, rows = np.arange(x.size) + 0.5, np.arange(y.size) + 0.5
    np.testing.assert_allclose(x, transform.c + columns * transform.a, rtol=0, atol=1e-6)
    np.testing.assert_allclose(y, transform.f + rows * transform.e, rtol=0, atol=1e-6)
    assert transform.a > 0 > transform.e
