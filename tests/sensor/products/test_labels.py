"""Calibration of user digital numbers, and layers of products."""

import numpy as np
import products
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.sensor.products.labels import open_layer, reflectance
from fifesim.sensor.response.calibration import ProductBand

SUN = Geometry(35.0, 130.0, earth_sun_distance=1.0148)
GRID = fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 240.0, 180.0, 30.0)


def plain(values, bands=("TM3", "TM4"), grid=GRID):
    return products.labelled(values, grid, list(bands), {}).rename("dn")


@pytest.fixture
def dn():
    values = np.random.default_rng(1).integers(10, 250, (2, *GRID.shape)).astype(np.uint8)
    values[:, 2, 3] = 0
    return plain(values)


def test_calibrated_image_has_the_form_of_a_sensed_image(dn):
    image = check_raster_function(lambda raster: fifesim.calibrate(raster, "TM", geometry=SUN), dn, quantity="dn")
    np.testing.assert_array_equal(image, dn)
    assert (image.dtype, image.attrs["instrument"], image.attrs["_FillValue"]) == (np.uint8, "TM", 0)
    # Planetary reflectance by hand, from Table 1's radiances and Chander's solar irradiances.
    gain, offset = np.array([(204.3 + 1.2) / 255, (206.2 + 1.5) / 255]), np.array([-1.2, -1.5])
    radiance = gain[:, None, None] * np.where(dn == 0, np.nan, dn.values) + offset[:, None, None]
    sun = np.array([1536.0, 1031.0])[:, None, None] * np.cos(np.radians(35.0)) / (np.pi * 1.0148**2)
    np.testing.assert_allclose(image.fifesim.to_radiance(), radiance, rtol=1e-12)
    np.testing.assert_allclose(image.fifesim.to_reflectance(), radiance / sun, rtol=1e-12)
    red, nir = radiance / sun
    np.testing.assert_allclose(image.fifesim.ndvi(), (nir - red) / (nir + red), rtol=0, atol=1e-12)
    assert np.isnan(image.fifesim.to_surface()[:, 2, 3]).all()


def test_sun_is_computed_from_time_and_grid(dn):
    image = fifesim.calibrate(dn, "TM", time="1987-06-06T16:35:00Z")
    expected = fifesim.sun_position("1987-06-06T16:35:00Z", 39.1277, -96.6265)
    np.testing.assert_allclose([image["sza"], image["saa"]], [expected.sza, expected.saa], rtol=0, atol=0.01)
    assert float(image["earth_sun_distance"]) == pytest.approx(expected.earth_sun_distance, abs=1e-8)
    assert image["time"].values == np.datetime64("1987-06-06T16:35:00")
    xr.testing.assert_identical(fifesim.calibrate(dn, "TM", time="1987-06-06T11:35:00-05:00"), image)
    carried = fifesim.calibrate(dn.assign_coords(time=np.datetime64("1987-06-06T16:35:00", "ns")), "TM")
    np.testing.assert_array_equal(carried["sza"], image["sza"])


def test_axis_order_and_coordinates_do_not_change_the_result(dn):
    expected = fifesim.calibrate(dn, "TM", geometry=SUN)
    xr.testing.assert_identical(fifesim.calibrate(dn.isel(y=slice(None, None, -1)), "TM", geometry=SUN), expected)
    one = fifesim.calibrate(dn.isel(band=1), "TM", geometry=SUN)
    assert one.dims == ("band", "y", "x") and one["band"].values.tolist() == ["TM4"]
    # A given geometry precedes the sun of the time, and both precede the sun of the raster.
    both = fifesim.calibrate(dn, "TM", geometry=SUN, time="1987-06-06T16:35Z")
    assert (float(both["sza"]), both["time"].values) == (35.0, np.datetime64("1987-06-06T16:35"))
    carried = dn.assign_coords(sza=35.0, saa=130.0, vza=0.0, vaa=0.0, earth_sun_distance=1.0148)
    xr.testing.assert_identical(fifesim.calibrate(carried, "TM"), expected)
    assert float(fifesim.calibrate(carried, "TM", time="1987-06-06T18:00Z")["sza"]) != 35.0


@pytest.mark.parametrize(
    ("gain", "offset"), [([0.5, 0.25], [1.0, -2.0]), ({"TM3": 0.5, "TM4": 0.25}, {"TM4": -2.0, "TM3": 1.0})]
)
def test_gain_and_offset_may_be_given(dn, gain, offset):
    image = fifesim.calibrate(dn, "TM", geometry=SUN, gain=gain, offset=offset)
    known = np.where(dn == 0, np.nan, dn)
    np.testing.assert_allclose(image.fifesim.to_radiance(), [0.5 * known[0] + 1, 0.25 * known[1] - 2], rtol=1e-14)


def test_product_numbers_need_the_product_scale():
    """Landsat 8 products have 16 bits, the instrument 12 bits."""
    values = np.array([[[11000, 0], [20000, 65535]]], np.uint16)
    place = fifesim.grid_at("EPSG:32610", 353700.0, 5374200.0, 60.0, 60.0, 30.0)
    dn = plain(values, ["OLI4"], place)
    with pytest.raises(ValueError, match=r"digital number of 11000 is not a whole number from 0 to 4095: .*gain="):
        fifesim.calibrate(dn, "OLI", geometry=SUN)
    image = fifesim.calibrate(dn, "OLI", geometry=SUN, gain=1.0288e-2, offset=-51.43874)
    expected = 1.0288e-2 * np.array([11000, np.nan, 20000, np.nan]) - 51.43874
    np.testing.assert_allclose(image.fifesim.to_radiance().values.ravel(), expected, rtol=1e-12)


@pytest.mark.parametrize("dtype", [np.int16, np.float32])
def test_other_types_are_converted_and_no_data_becomes_0(dn, dtype):
    raster = dn.astype(dtype)
    raster[:, 0, 0] = -9999
    if dtype == np.float32:
        raster[:, 0, 1] = np.nan
    image = fifesim.calibrate(raster, "TM", geometry=SUN, nodata=-9999)
    assert (image.dtype, int(image[0, 0, 0])) == (np.uint8, 0)
    np.testing.assert_array_equal(image[:, 1:], dn[:, 1:])
    with pytest.raises(ValueError, match=r"digital number of -9999 is .*nodata="):
        fifesim.calibrate(raster, "TM", geometry=SUN)
    lazy = fifesim.calibrate(in_chunks(raster, {"y": 2, "x": 3}), "TM", geometry=SUN)
    with pytest.raises(ValueError, match="digital number of -"):
        lazy.compute()


SATURATED = "saturated must be 'largest', None, or a digital number from 1 to 255, got"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"time": "noon"}, "time must be a date and time such as 1987-06-06T16:35:00Z, got 'noon'"),
        ({"time": "1987-06-06T06:35"}, "the sun is below the horizon"),
        ({"geometry": SUN, "gain": -1.0, "offset": 0.0}, "gain must be above 0"),
        ({"geometry": SUN, "gain": [1.0, 2.0, 3.0], "offset": 0.0}, "gain must be a number, or one for each of 2 b"),
        ({"geometry": SUN, "gain": {"TM3": 1.0}, "offset": 0.0}, "gain has no number for TM4: it has TM3"),
    ]
    + [({"geometry": SUN, "saturated": each}, SATURATED) for each in (0, 256, -1, True, "255", "most")],
)
def test_missing_or_invalid_options_raise(dn, options, said):
    with pytest.raises(ValueError, match=said):
        fifesim.calibrate(dn, "TM", **options)


def test_saturated_numbers_become_no_data(dn):
    """The radiance of 255, the largest number of TM, is a lower limit; in memory and lazily."""
    dn[:, 1, 1] = 255
    dn[:, 1, 2] = 254
    for raster in (dn, in_chunks(dn, {"y": 2, "x": 3})):
        image = fifesim.calibrate(raster, "TM", geometry=SUN)
        np.testing.assert_array_equal(image[:, 1, 1:3], [[0, 254]] * 2)
        reflectance = image.fifesim.to_reflectance()
        assert np.isnan(reflectance[:, 1, 1]).all() and np.isfinite(reflectance[:, 1, 2]).all()
        assert np.isnan(image.fifesim.ndvi()[1, 1])
    kept = fifesim.calibrate(dn, "TM", geometry=SUN, saturated=None)
    np.testing.assert_array_equal(kept, dn)
    low = fifesim.calibrate(dn, "TM", geometry=SUN, saturated=254)
    np.testing.assert_array_equal(low[:, 1, 1:3], [[255, 0]] * 2)


@pytest.mark.parametrize(
    ("name", "bands", "dtype", "scale", "full"),
    [
        ("MSS", ["MSS5", "MSS6"], np.uint8, {}, 63),
        ("MSS", ["MSS5", "MSS6"], np.uint8, {"gain": 0.5, "offset": 0.0}, 255),
        # 8-bit numbers in a wider type, e.g. after arithmetic or from rioxarray.
        ("TM", ["TM3", "TM4"], np.float32, {"gain": 0.5, "offset": 0.0}, 255),
        ("OLI", ["OLI4", "OLI5"], np.uint16, {}, 4095),
        ("OLI", ["OLI4", "OLI5"], np.uint16, {"gain": 0.01, "offset": -51.0}, 65535),
    ],
)
def test_saturation_is_the_largest_number(name, bands, dtype, scale, full):
    values = np.full((2, *GRID.shape), full - 1, dtype)
    values[:, 0, 0] = full
    image = fifesim.calibrate(plain(values, bands), name, geometry=SUN, **scale)
    assert (image[:, 0, 0] == 0).all() and (image[:, 1:] == full - 1).all()


# ------------------------------------------------------------------------------------------- layers of products


def test_file_that_is_no_layer_of_numbers_raises(tmp_path):
    (tmp_path / "a.tif").write_text("<html>")
    products.write(tmp_path / "b.tif", np.zeros((6, 9), np.float32), **products.TM["place"])
    for name, said in (
        ("a.tif", r"cannot read .*a\.tif as a raster"),
        ("b.tif", r"b\.tif has 1 bands of float32, where a product has 1 of whole numbers"),
    ):
        with pytest.raises(ValueError, match=said):
            open_layer(tmp_path, name, None, "")


def test_layers_of_different_grids_raise():
    one, two = (
        products.labelled(np.ones((1, *GRID.shape), np.uint8), grid, ["TM3"], {})[0].rename(name)
        for name, grid in (("a.tif", GRID), ("b.tif", GRID.translate_pix(0.5, 0)))
    )
    bands = [ProductBand(name, "a.tif", 1e-3, 0.0, 255, None) for name in ("TM3", "TM4")]
    assert reflectance([one, one], bands).dims == ("band", "y", "x")
    with pytest.raises(ValueError, match=r"^b\.tif and a\.tif have different grids, .*bands="):
        reflectance([one, two], bands)


def test_declared_fill_value_is_no_data_in_addition(dn):
    whole = dn.astype("uint16").where(dn.x > float(dn.x[0]), np.uint16(65535))
    image = fifesim.calibrate(whole.assign_attrs(_FillValue=65535), "TM", geometry=SUN)
    np.testing.assert_array_equal(image, dn.where(dn.x > float(dn.x[0]), 0))
