"""Landsat-1 MSS: 6-bit counts on a square-root scale."""

import numpy as np
import products
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.calibration import radiance_to_dn

MSS = instrument("MSS")
FULL = np.array([band.full_scale_radiance for band in MSS.bands])


@pytest.fixture(scope="module")
def radiance():
    """Radiance from nearly dark to full scale in every band."""
    grid = fifesim.fife_site(20.0, window=((0, 60), (0, 66)))
    values = np.random.default_rng(4).uniform(0.02, 0.98, (4, *grid.shape)) * FULL[:, None, None]
    return products.radiance(values, grid, [band.name for band in MSS.bands])


@pytest.fixture(scope="module")
def image(radiance):
    return fifesim.sense(radiance, "MSS")


def test_counts_have_six_bits_and_a_compression_coordinate(image):
    assert image.dtype == np.uint8 and int(image.max()) <= 63 and (image[:, 1:-1, 1:-1] > 0).all()
    assert "(dn^2 + 1/4) / compression" in image["compression"].attrs["comment"]
    assert image["compression"].values.tolist() == [63, 63, 63, 0]
    assert "compression" not in fifesim.sense(image.fifesim.to_radiance().isel(band=[3]), "MSS").coords


def test_counts_equal_the_kernel_for_all_chunks(radiance, image):
    check_raster_function(lambda toa: fifesim.sense(toa, "MSS"), radiance, quantity="dn")
    means = fifesim.sense(radiance, "MSS", quantise=False).values
    for i, full in enumerate(FULL):
        counts = np.sqrt(63 * means[i] * 63 / full) if i < 3 else means[i] * 63 / full
        np.testing.assert_array_equal(image.values[i], np.nan_to_num(np.rint(counts)))


def test_radiance_round_trips_within_half_a_count(radiance, image):
    means = fifesim.sense(radiance, "MSS", quantise=False).values
    back = check_raster_function(fifesim.sensor.to_radiance, image, quantity="toa_radiance").values
    assert not {"gain", "offset", "compression"} & set(fifesim.sensor.to_radiance(image).coords)
    step = np.broadcast_to(FULL[:, None, None] / 63, back.shape).copy()
    # The counts n - 1/2 and n + 1/2 are 2 n / 63 linear steps apart.
    step[:3] *= 2 * image.values[:3] / 63
    seen = image.values > 0
    assert (np.abs(back - means) <= 0.5 * step * (1 + 1e-9))[seen].all() and np.isnan(back[~seen]).all()
    again = radiance_to_dn(back, FULL[:, None, None] / 63, 0.0, 6, image["compression"].values[:, None, None])
    np.testing.assert_array_equal(again, image)


def test_geotiff_keeps_the_compression_and_no_linear_scale(image, tmp_path):
    path = fifesim.to_geotiff(image, tmp_path / "mss.tif")
    xr.testing.assert_identical(fifesim.open_image(path), image)
    rasterio = pytest.importorskip("rasterio")
    with rasterio.open(path) as file:
        assert set(file.scales) == {1.0} and set(file.offsets) == {0.0}


def test_mss4_of_landsat_1_is_matched_by_wavelength(image):
    """MSS4 is green on Landsat-1 and near infrared on Landsat-5."""
    seen = fifesim.sense(fifesim.sensor.to_radiance(image), "MSS5")
    assert seen["band"].values.tolist() == ["MSS1", "MSS2", "MSS3", "MSS4"]


def test_user_counts_are_calibrated_on_the_square_root_scale(image):
    counts = image.drop_vars(["gain", "offset", "compression"])
    again = fifesim.calibrate(counts, "MSS")
    np.testing.assert_array_equal(fifesim.sensor.to_radiance(again), fifesim.sensor.to_radiance(image))
    linear = fifesim.calibrate(counts, "MSS", gain=1.0, offset=0.0)
    assert "compression" not in linear.coords
    np.testing.assert_array_equal(fifesim.sensor.to_radiance(linear), counts.where(counts > 0))
