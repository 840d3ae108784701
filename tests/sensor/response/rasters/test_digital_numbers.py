"""Digital numbers of detectors and of products."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.rasters import directions
from fifesim.rasters import grid as grids
from fifesim.sensor.response.rasters.digital_numbers import check_scaling, scale

SUN = Geometry(50.0, 120.0, 7.0, 280.0, earth_sun_distance=1.0148)


@pytest.fixture(scope="module")
def toa():
    grid = fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 240.0, 180.0, 10.0)
    values = np.random.default_rng(5).uniform(0.01, 0.9, (2, *grid.shape))
    values[:, 4, 5] = np.nan
    array = xr.DataArray(
        values, dims=("band", "y", "x"), coords={"wavelength": ("band", [0.66, 0.86])}, name="toa_reflectance"
    )
    return directions.with_geometry(grids.place(array, grid), SUN)


SCALES = {
    "OLI": (2e-5, -0.1, SUN.mu_s),
    "OLI2": (2e-5, -0.1, SUN.mu_s),
    "MSI": (1e-4, -0.1, 1.0),
    "MSI-B": (1e-4, -0.1, 1.0),
}


@pytest.mark.parametrize("name", SCALES)
def test_product_numbers_are_those_of_the_agency(toa, name):
    """Read by the formula of the product's handbook they give the reflectance, to within half a count."""
    gain, offset, mu_s = SCALES[name]
    options = {"onto": fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 240.0, 180.0, 30.0)}
    toa = toa.assign_coords(wavelength=("band", [0.66, 0.835 if "MSI" in name else 0.86]))
    image = toa.fifesim.sense(name, scaling="product", **options)
    assert image.dtype == np.uint16
    fine = toa.fifesim.sense(name, quantise=False, **options).fifesim.to_reflectance()
    by_hand = (image.astype(float).where(image > 0) * gain + offset) / mu_s
    assert float(abs(by_hand - fine).max()) <= 0.5 * gain / mu_s * (1 + 1e-9)
    decoded = image.fifesim.to_reflectance()
    np.testing.assert_allclose(decoded, by_hand, rtol=0, atol=1e-12)
    assert "scaling product" in image.attrs["history"] and "16 bits" in image.attrs["history"]


@pytest.mark.parametrize("name", ["OLI", "MSI"])
def test_files_keep_the_scale(toa, name, tmp_path):
    toa = toa.assign_coords(wavelength=("band", [0.66, 0.835 if "MSI" in name else 0.86]))
    image = toa.fifesim.sense(name, scaling="product")
    again = fifesim.open_image(image.fifesim.to_geotiff(tmp_path / "image.tif"))
    np.testing.assert_array_equal(again, image)
    np.testing.assert_array_equal(again.fifesim.to_reflectance(), image.fifesim.to_reflectance())
    np.testing.assert_array_equal(again.fifesim.ndvi(), image.fifesim.ndvi())


def test_the_detector_is_the_default(toa):
    image = toa.fifesim.sense("OLI")
    assert int(image.max()) <= 4095
    xr.testing.assert_identical(image, toa.fifesim.sense("OLI", scaling="detector"))


def test_what_is_no_scaling_is_refused(toa):
    with pytest.raises(ValueError, match="scaling must be 'detector' or 'product', got 'level1'"):
        toa.fifesim.sense("OLI", scaling="level1")
    with pytest.raises(ValueError, match="TM has no product that is scaled by reflectance, as those of OLI"):
        toa.fifesim.sense("TM", scaling="product")
    with pytest.raises(ValueError, match="is one of digital numbers"):
        toa.fifesim.sense("OLI", scaling="product", quantise=False)
    check_scaling("product", fifesim.instrument("MSI"))


def test_msi_wants_one_sun_and_oli_does_not(toa):
    varying = toa.assign_coords(sza=(("y", "x"), np.linspace(40, 41, toa[0].size).reshape(toa.shape[1:])))
    image = varying.fifesim.sense("OLI", scaling="product")
    half = 0.5 * 2e-5 / np.cos(np.radians(41))
    fine = varying.fifesim.sense("OLI", quantise=False).fifesim.to_reflectance()
    assert float(abs(image.fifesim.to_reflectance() - fine).max()) <= half
    with pytest.raises(ValueError, match="scaling='product' of MSI needs one direction of sun"):
        varying.assign_coords(wavelength=("band", [0.66, 0.835])).fifesim.sense("MSI", scaling="product")


def test_detector_counts_span_its_radiances():
    band = fifesim.instrument("TM").select("TM3")
    gain, offset, bits = scale(fifesim.instrument("TM"), band)
    np.testing.assert_allclose([gain[0] * 255 + offset[0], offset[0]], [204.3, -1.2])
    assert bits == 8
