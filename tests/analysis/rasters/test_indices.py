"""Vegetation indices of labelled reflectance."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

from fifesim.analysis import indices
from fifesim.analysis.rasters.indices import ndvi
from fifesim.rasters import grid as grids

CELL = 30 / 9


def reflectance(lai, wavelengths=(0.56, 0.66, 0.83, 1.65)):
    bands = xr.DataArray(np.linspace(0.1, 0.6, len(wavelengths)), dims="band")
    cube = (lai * bands + 0.02).transpose("band", "y", "x")
    cube = grids.place(cube.assign_coords(wavelength=("band", list(wavelengths))), grids.geobox(lai))
    cube.attrs = {"units": "1", "atmosphere": "some", "arp": 0.15}
    return cube.rename("toa_reflectance")


def test_ndvi_keeps_its_word_and_equals_the_kernel(lai_with_hole):
    cube = reflectance(lai_with_hole)
    result = check_raster_function(ndvi, cube, quantity="ndvi")
    np.testing.assert_array_equal(result, indices.normalized_difference(cube.values[2], cube.values[1]))
    np.testing.assert_array_equal(np.isnan(result), np.isnan(lai_with_hole))
    assert result.dims == ("y", "x") and "band" not in result.coords and "wavelength" not in result.coords
    assert result.attrs["arp"] == 0.15


@pytest.mark.parametrize(
    "wavelengths, red, nir",
    [((0.83, 0.66), 1, 0), ((0.61, 0.64, 0.69, 0.76, 0.95, 0.86), 1, 5), ((0.45, 0.665, 0.71, 0.842, 1.6), 1, 3)],
)
def test_bands_are_picked_by_wavelength(lai, wavelengths, red, nir):
    cube = reflectance(lai, wavelengths)
    np.testing.assert_array_equal(ndvi(cube), indices.normalized_difference(cube.values[nir], cube.values[red]))


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda cube: cube.isel(band=[0, 2]), r"no red band between 0\.6 and 0\.7 um: the raster has 0\.560, 0\.830"),
        (lambda cube: cube.isel(band=[1, 3]), "no near infrared band"),
        (lambda cube: cube.drop_vars("wavelength"), "no coordinate 'wavelength'"),
        (lambda cube: cube.isel(band=1), "along band"),
        (lambda cube: cube.assign_attrs(units="K"), "units 'K'"),
    ],
)
def test_raster_without_the_bands_is_refused(lai, change, message):
    with pytest.raises(ValueError, match=message):
        ndvi(change(reflectance(lai)))
