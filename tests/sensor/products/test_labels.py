"""Calibration of user digital numbers, layers of products, and safe reading and checks of their metadata."""

import os

import numpy as np
import products
import pytest
import xarray as xr
from lazy import check_raster_function, in_chunks
from mistakes import mistakes

import fifesim
from fifesim.base.geometry import Geometry, earth_sun_distance, sun_positions
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.products import metadata
from fifesim.sensor.products.labels import open_layer
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


def test_sun_is_computed_from_time_and_grid_or_given(dn):
    """A given geometry precedes the sun of the time, and both precede the sun of the raster."""
    time = "1987-06-06T16:35:00Z"
    image, given = fifesim.calibrate(dn, "TM", time=time), fifesim.calibrate(dn, "TM", geometry=SUN)
    expected = fifesim.sun_position(time, 39.1277, -96.6265)
    np.testing.assert_allclose([image["sza"], image["saa"]], [expected.sza, expected.saa], rtol=0, atol=0.01)
    assert float(image["earth_sun_distance"]) == pytest.approx(expected.earth_sun_distance, abs=1e-8)
    assert image["time"].values == np.datetime64("1987-06-06T16:35:00")
    xr.testing.assert_identical(fifesim.calibrate(dn, "TM", time="1987-06-06T11:35:00-05:00"), image)
    carried = fifesim.calibrate(dn.assign_coords(time=np.datetime64("1987-06-06T16:35:00", "ns")), "TM")
    np.testing.assert_array_equal(carried["sza"], image["sza"])
    both = fifesim.calibrate(dn, "TM", geometry=SUN, time=time)
    assert (float(both["sza"]), both["time"].values) == (35.0, np.datetime64("1987-06-06T16:35"))
    carried = dn.assign_coords(sza=35.0, saa=130.0, vza=0.0, vaa=0.0, earth_sun_distance=1.0148)
    xr.testing.assert_identical(fifesim.calibrate(carried, "TM"), given)
    assert float(fifesim.calibrate(carried, "TM", time="1987-06-06T18:00Z")["sza"]) != 35.0
    # Neither the order of rows nor of one band changes the result.
    xr.testing.assert_identical(fifesim.calibrate(dn.isel(y=slice(None, None, -1)), "TM", geometry=SUN), given)
    xr.testing.assert_identical(fifesim.calibrate(dn.isel(band=1), "TM", geometry=SUN), given.isel(band=[1]))


@pytest.mark.parametrize(
    ("gain", "offset"), [([0.5, 0.25], [1.0, -2.0]), ({"TM3": 0.5, "TM4": 0.25}, {"TM4": -2.0, "TM3": 1.0})]
)
def test_gain_and_offset_may_be_given(dn, gain, offset):
    image = fifesim.calibrate(dn, "TM", geometry=SUN, gain=gain, offset=offset)
    known = np.where(dn == 0, np.nan, dn)
    np.testing.assert_allclose(image.fifesim.to_radiance(), [0.5 * known[0] + 1, 0.25 * known[1] - 2], rtol=1e-14)


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
    # A declared fill value is no data in addition.
    whole = dn.astype("uint16").where(dn.x > float(dn.x[0]), np.uint16(65535))
    image = fifesim.calibrate(whole.assign_attrs(_FillValue=65535), "TM", geometry=SUN)
    np.testing.assert_array_equal(image, dn.where(dn.x > float(dn.x[0]), 0))


@pytest.mark.parametrize(
    ("name", "bands", "dtype", "scale", "full"),
    [
        ("TM", ["TM3", "TM4"], np.uint8, {}, 255),
        ("MSS", ["MSS5", "MSS6"], np.uint8, {}, 63),
        ("MSS", ["MSS5", "MSS6"], np.uint8, {"gain": 0.5, "offset": 0.0}, 255),
        # 8-bit numbers in a wider type, e.g. after arithmetic or from rioxarray.
        ("TM", ["TM3", "TM4"], np.float32, {"gain": 0.5, "offset": 0.0}, 255),
        ("OLI", ["OLI4", "OLI5"], np.uint16, {}, 4095),
        ("OLI", ["OLI4", "OLI5"], np.uint16, {"gain": 0.01, "offset": -51.0}, 65535),
    ],
)
def test_largest_number_is_saturated_and_becomes_no_data(name, bands, dtype, scale, full):
    """The radiance of the largest number is a lower limit; in memory and lazily."""
    values = np.full((2, *GRID.shape), full - 1, dtype)
    values[:, 0, 0] = full
    for raster in (plain(values, bands), in_chunks(plain(values, bands), {"y": 2, "x": 3})):
        image = fifesim.calibrate(raster, name, geometry=SUN, **scale)
        assert (image[:, 0, 0] == 0).all() and (image[:, 1:] == full - 1).all()
    kept = fifesim.calibrate(raster, name, geometry=SUN, saturated=None, **scale)
    np.testing.assert_array_equal(kept, raster)
    low = fifesim.calibrate(raster, name, geometry=SUN, saturated=full - 1, **scale)
    assert (low[:, 0, 0] == full).all() and (low[:, 1:] == 0).all()


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


# ------------------------------------------------------------------------------------------- metadata

TIME = np.datetime64("2020-06-06T17:00:00", "ns")
PLACE = (39.0, -96.5)
(SZA,), (SAA,) = sun_positions([str(TIME)], *PLACE)[1:3]
RANGE = "KEY = 1 give values from .* states -0.09998 to 1.2107: .*fetch"
TM = instrument("TM")


def scale(gain, offset):
    metadata.check_product_scale("KEY = 1", gain, offset, (1, 65535), (-0.09998, 1.2107))


def unbounded(offset, largest):
    metadata.check_product_scale("K", 1e-4, offset, (1, largest), brightest=1.0)


def radiance(gain, limits):
    metadata.check_radiance("K", gain, -2.21398, (1, 255), limits)


def sun(turn):
    metadata.check_sun("K", SZA + turn, SAA, TIME, PLACE)


def distance(more):
    metadata.check_distance("K", earth_sun_distance(str(TIME)) + more, TIME)


def irradiance(factor):
    """Check a band; a band without irradiance and an unknown band are ignored."""
    stated = ("TM3", TM.select("TM3")[0].solar_irradiance * factor), ("TM4", None), ("TM9", 1.0)
    metadata.check_irradiance("LT05", [ProductBand(name, "B.TIF", 1e-3, 0.0, 255, each) for name, each in stated], TM)


CHECKS = [
    # Metadata are rounded to better than 0.05 %.
    (scale, [(2e-5, -0.1), (2.0009e-5, -0.1)], [(2.0011e-5, -0.1), (2e-5, -0.0993), (0, -0.1), (np.inf, -0.1)], RANGE),
    (unbounded, [(-0.25, 65534), (0.0999, 65534)], [(-0.26, 65534), (0.11, 65534)], r"must begin in \[-0.25, 0.1\]"),
    (unbounded, [(0.0, 10000), (0.0, 100_000)], [(0.0, 9999), (0.0, 100_001)], r"end in \[1, 10\]"),
    (radiance, [(1.044, (-1.17, 264.0))], [(1.050, (-1.17, 264.0))], "and the same file states -1.17 to 264"),
    (radiance, [], [(1.044, (264.0, -1.17))], "W m-2 sr-1 um-1, and the same file states 264 to -1.17"),
    (sun, [(0.0,), (1.9,), (-1.9,)], [(2.1,), (np.nan,)], "K: at 2020-06-06T17:00 UTC and 39.00 N, -96.50 E, the sun"),
    (irradiance, [(0.81,), (1.24,)], [(0.79,), (1.26,)], r"LT05: the scale of TM3 .* must be in \[1229, 1920\]"),
    (distance, [(9e-4,), (-9e-4,)], [(1.1e-3,), (-1.1e-3,)], "not belong to the date 2020-06-06, which has 1.0148"),
]


@pytest.mark.parametrize(("check", "good", "wrong", "said"), CHECKS)
def test_consistency_checks_have_their_limits(check, good, wrong, said):
    for numbers in good:
        check(*numbers)
    for numbers in wrong:
        with pytest.raises(ValueError, match=said):
            check(*numbers)


SECRET = "not for anybody"
ENTITY = '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'


XML = [each[1:] for each in mistakes("xml", name="sensor_mistakes")]
XML += [
    # A parser sees declarations in UTF-16, but a search for ASCII text does not.
    (f'<?xml version="1.0" encoding="UTF-16"?>{ENTITY}'.encode("utf-16"), "is no text"),
    ("<a>" + " " * 2000 + "</a>", "has 2007 bytes: metadata has at most 2000"),
    (None, "is a pipe"),
]


@pytest.mark.parametrize(("content", "said"), XML)
def test_unsafe_or_invalid_xml_raises_in_one_line(tmp_path, monkeypatch, content, said):
    """Entities are not followed, and large files and pipes not read."""
    monkeypatch.setattr(metadata, "_LARGEST", 2000)
    secret, path = tmp_path / "secret", tmp_path / "a.xml"
    secret.write_text(SECRET)
    if content is None:
        os.mkfifo(path)
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.replace("{file}", secret.as_uri()).encode())
    with pytest.raises(ValueError, match=rf"a\.xml {said}") as error:
        metadata.read_xml(path)
    assert len(str(error.value)) < 450 and "\n" not in str(error.value) and SECRET not in str(error.value)


def test_xml_with_a_byte_order_mark_is_read(tmp_path):
    path = tmp_path / "a.xml"
    path.write_bytes(b'\xef\xbb\xbf<?xml version="1.0" encoding="UTF-8"?>\n<a unit="W/m\xc2\xb2"><b>1</b></a>')
    root = metadata.read_xml(path)
    assert (root.tag, root.get("unit"), root.find("b").text) == ("a", "W/m²", "1")


def test_times_are_utc_between_launch_and_today():
    """numpy accepts "today" as a time, and nanoseconds of the year 9999 overflow to 1815."""
    assert metadata.utc_time("2020-12-04T19:02:11.1944860Z", "t") == np.datetime64("2020-12-04T19:02:11.194486", "ns")
    now = str(np.datetime64("now", "s"))
    assert metadata.utc_time(now, "T", launch=now[:10]).astype("M8[s]") == np.datetime64(now)
    no_times = "today", "NaT", "", "2020-12-04", "2020-13-04T19:02:11Z", "2020-12-04T19:02:11+01:00"
    too_early_or_late = "9999-03-12T19:54:32Z", "2300-01-01T00:00:00Z", "1972-07-22T23:59:59Z"
    for texts, said in (
        (no_times, "T must be a date and time such as 1987-06-06T16:35:00Z, got"),
        (too_early_or_late, "T must lie between the launch .*, 1972-07-23, and today, .*, got "),
    ):
        for text in texts:
            with pytest.raises(ValueError, match=said):
                metadata.utc_time(text, "T")
    with pytest.raises(ValueError, match="launch of the satellite, 2017-03-07"):
        metadata.utc_time("2017-03-06T23:59:59Z", "T", launch="2017-03-07")
