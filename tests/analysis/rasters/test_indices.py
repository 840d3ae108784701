"""Vegetation indices of labelled reflectance."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.analysis import indices
from fifesim.analysis.index_labels import INDICES, reflectance_index, reflectance_ndvi
from fifesim.base.bands import nearest_band
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument

CELL = 30 / 9


def reflectance(lai, wavelengths=(0.56, 0.66, 0.83, 1.65)):
    bands = xr.DataArray(np.linspace(0.1, 0.6, len(wavelengths)), dims="band")
    cube = (lai * bands + 0.02).transpose("band", "y", "x")
    cube = grids.place(cube.assign_coords(wavelength=("band", list(wavelengths))), grids.geobox(lai))
    cube.attrs = {"units": "1", "atmosphere": "some", "arp": 0.15}
    return cube.rename("toa_reflectance")


def test_ndvi_keeps_its_word_and_equals_the_kernel(lai_with_hole):
    cube = reflectance(lai_with_hole)
    result = check_raster_function(reflectance_ndvi, cube, quantity="ndvi")
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
    np.testing.assert_array_equal(
        reflectance_ndvi(cube), indices.normalized_difference(cube.values[nir], cube.values[red])
    )


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
        reflectance_ndvi(change(reflectance(lai)))


@pytest.mark.parametrize("name", INDICES)
def test_index_keeps_its_word(lai_with_hole, name):
    """Bands go to the formula in its order: blue, green, red, near and shortwave infrared are 0 to 4."""
    cube = reflectance(lai_with_hole, (0.48, 0.56, 0.66, 0.83, 1.65))
    result = check_raster_function(lambda array: reflectance_index(array, name), cube, quantity=name.lower())
    blue, green, red, nir, swir = cube.values
    kernel, _ = INDICES[name]
    bands = {"EVI": (nir, red, blue), "NDWI": (green, nir), "NDMI": (nir, swir)}
    np.testing.assert_array_equal(result, kernel(*bands.get(name, (nir, red))))


def test_water_indices_have_the_signs_of_their_authors():
    """Open water is dark in the near infrared, wet leaves in the shortwave infrared."""
    for name, wet in (("NDWI", [0.05, 0.08, 0.04, 0.02, 0.01]), ("NDMI", [0.03, 0.06, 0.04, 0.45, 0.15])):
        cube = xr.DataArray(np.reshape(wet, (5, 1, 1)) * np.ones((5, 2, 2)), dims=("band", "y", "x"))
        cube = grids.place(
            cube.assign_coords(wavelength=("band", [0.48, 0.56, 0.66, 0.83, 1.65])),
            fifesim.grid_at("EPSG:26914", 705000, 4334000, 60, 60, 30),
        )
        assert (reflectance_index(cube, name) > 0.3).all()


@pytest.mark.parametrize("name", ["TM", "ETM+", "OLI", "MSI", "MODIS"])
def test_instruments_have_the_bands_of_every_index(name):
    """The broad bands of their makers: the coastal blue, the red edge and 1.24 um are none of them."""
    bands = instrument(name).bands
    wavelengths = [band.wavelength for band in bands]
    picked = {window.name: bands[nearest_band(wavelengths, window)].name for _, ws in INDICES.values() for window in ws}
    expected = {
        "TM": "TM1 TM2 TM3 TM4 TM5",
        "ETM+": "ETM1 ETM2 ETM3 ETM4 ETM5",
        "OLI": "OLI2 OLI3 OLI4 OLI5 OLI6",
        "MSI": "MSI2 MSI3 MSI4 MSI8 MSI11",
        "MODIS": "MODIS3 MODIS4 MODIS1 MODIS2 MODIS6",
    }
    order = ("blue", "green", "red", "near infrared", "shortwave infrared")
    assert [picked[each] for each in order] == expected[name].split()


def test_index_that_is_none_or_lacks_a_band_is_named(lai):
    with pytest.raises(ValueError, match="there is no index 'GNDVI': type one of NDVI, EVI, EVI2"):
        reflectance_index(reflectance(lai), "GNDVI")
    with pytest.raises(ValueError, match=r"no blue band between 0\.45 and 0\.52 um"):
        reflectance_index(reflectance(lai), "EVI")
    assert reflectance_index(reflectance(lai), "evi2").name == "evi2"
