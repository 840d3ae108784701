"""NDVI and other indices of images of any kind."""

import numpy as np
import pytest
import xarray as xr

import fifesim


def test_ndvi_is_from_planetary_reflectance(whole):
    rho = whole["image"].fifesim.to_reflectance()
    red, nir = rho.sel(band="TM3").values, rho.sel(band="TM4").values
    np.testing.assert_array_equal(whole["image"].fifesim.ndvi(), (nir - red) / (nir + red))
    np.testing.assert_array_equal(whole["image"].fifesim.to_radiance().fifesim.ndvi(), whole["ndvi"])
    np.testing.assert_array_equal(rho.fifesim.ndvi(), whole["ndvi"])


def test_index_is_from_planetary_reflectance(whole):
    rho = whole["image"].fifesim.to_reflectance()
    red, nir = rho.sel(band="TM3").values, rho.sel(band="TM4").values
    np.testing.assert_array_equal(whole["image"].fifesim.index("EVI2"), 2.5 * (nir - red) / (nir + 2.4 * red + 1))
    np.testing.assert_array_equal(whole["image"].fifesim.index("NDVI"), whole["ndvi"])


@pytest.mark.parametrize(
    "step", [lambda image: image.fifesim.aggregate(60), lambda image: image[0].fifesim.regress(image[1])]
)
def test_digital_numbers_are_not_averaged(lai, step):
    """Digital number 0 is no data and would count as dark ground."""
    image = fifesim.sense(fifesim.to_toa(fifesim.surface_reflectance(lai, bands=["TM3", "TM4"])))
    with pytest.raises(ValueError, match="digital numbers"):
        step(image)


def test_band_names_that_contradict_wavelengths_are_rejected():
    """Swapped wavelengths of TM3 and TM4 would change the sign. Bands with other names may have any wavelength."""
    values = np.stack([np.full((4, 4), 0.06), np.full((4, 4), 0.30)])
    rho = xr.DataArray(values, dims=("band", "y", "x"), coords={"wavelength": ("band", [0.83, 0.66])})
    rho = rho.assign_coords(x=705000 + 30.0 * np.arange(4), y=4334000 - 30.0 * np.arange(4)).rio.write_crs(26914)
    with pytest.raises(ValueError, match=r"band TM3 has the wavelength 0.83 um, .*contradict each other"):
        fifesim.ndvi(rho.assign_coords(band=["TM3", "TM4"]))
    with pytest.raises(ValueError, match=r"band TM3 has the wavelength 0.83 um, .*contradict each other"):
        fifesim.index(rho.assign_coords(band=["TM3", "TM4"]), "NDVI")
    assert float(fifesim.ndvi(rho.assign_coords(band=["first", "second"])).mean()) < 0
    right = rho.assign_coords(band=["TM3", "TM4"], wavelength=("band", [0.66, 0.83]))
    assert float(fifesim.ndvi(right).mean()) > 0
