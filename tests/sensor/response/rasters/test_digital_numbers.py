"""Digital numbers of detectors and of products."""

import numpy as np
import pytest
import xarray as xr
from lazy import in_chunks, no_compute

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.sensor.labels import check_scaling, scale

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
    with pytest.raises(ValueError, match="TM has no product scaled to reflectance, unlike OLI"):
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


@pytest.fixture(scope="module")
def image(toa):
    dn = np.random.default_rng(8).integers(1, 256, (2, *toa.shape[1:])).astype(np.uint8)
    dn[:, 1, 1] = 0
    raster = grids.place(xr.DataArray(dn, dims=("band", "y", "x"), coords={"band": ["TM3", "TM4"]}), grids.geobox(toa))
    return fifesim.calibrate(raster, "TM", geometry=SUN)


CHANGES = {
    "radiance": lambda image: image * image.gain + image.offset,
    "half": lambda image: image * 0.5,
    "doubled": lambda image: image.astype(np.int32) * 2,
    "negative": lambda image: image.astype(np.int16) - 100,
    "wider": lambda image: image.astype(np.uint16) * np.uint16(2),
}
VERBS = {
    "radiance": fifesim.to_radiance,
    "reflectance": fifesim.to_reflectance,
    "ndvi": fifesim.ndvi,
    "index": lambda image: fifesim.index(image, "EVI2"),
    "surface": lambda image: fifesim.to_surface(image, fifesim.Atmosphere()),
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("change", CHANGES)
def test_values_that_are_no_digital_numbers_are_refused(image, change, verb):
    with xr.set_options(keep_attrs=True):
        changed = CHANGES[change](image).assign_attrs(units="1")
    with pytest.raises(ValueError, match=r"is not a whole number from 0 to (255|65535): calibrate with .*drop_vars"):
        VERBS[verb](changed)
    with no_compute():
        lazy = VERBS[verb](in_chunks(changed, {"y": 5, "x": 7}))
    with pytest.raises(ValueError, match="is not a whole number"):
        lazy.compute()


def test_the_block_that_is_computed_is_checked(image):
    changed = image.astype(np.float32)
    changed[0, 0, 0] = 7.5
    lazy = fifesim.to_radiance(in_chunks(changed, {"y": 5, "x": 7}))
    np.testing.assert_array_equal(lazy[:, -1, -1], fifesim.to_radiance(image)[:, -1, -1])
    with pytest.raises(ValueError, match=r"digital number of 7\.5 is not"):
        lazy[:, 0, 0].compute()


@pytest.mark.parametrize("change", ["kept", "dropped"])
def test_radiance_computed_by_hand_is_not_calibrated_again(image, change):
    """Arithmetic keeps attributes since xarray 2025.11; before, it dropped them."""
    with xr.set_options(keep_attrs=change == "kept"):
        radiance = image * image.gain + image.offset
    radiance = radiance.assign_attrs(units="W m-2 sr-1 um-1") if change == "kept" else radiance
    with pytest.raises(ValueError, match=r"type \.drop_vars\(\['gain', 'offset'\]\)\.assign_attrs"):
        fifesim.ndvi(radiance.rio.write_crs(image.rio.crs))
    remedied = radiance.where(image > 0).drop_vars(["gain", "offset"]).assign_attrs(units="W m-2 sr-1 um-1")
    found = fifesim.ndvi(remedied.rio.write_crs(image.rio.crs))
    np.testing.assert_allclose(found, fifesim.ndvi(image), rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.uint16, np.int16, np.float32, np.float64])
def test_digital_numbers_of_another_type_are_calibrated(image, dtype):
    np.testing.assert_array_equal(fifesim.to_radiance(image.astype(dtype)), fifesim.to_radiance(image))
    masked = image.astype(np.float32).where(image > 0)
    np.testing.assert_array_equal(fifesim.to_radiance(masked), fifesim.to_radiance(image))


def test_units_of_something_else_are_refused(image):
    with pytest.raises(ValueError, match="units 'm', dn needs '1'"):
        fifesim.to_radiance(image.assign_attrs(units="m"))
