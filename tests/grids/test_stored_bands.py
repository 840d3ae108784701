"""Files that other programs changed: the right bands and values, or a refusal."""

import numpy as np
import pytest
import xarray as xr
from edits import Copy
from lazy import no_compute

import fifesim


@pytest.fixture(scope="module")
def image(lai_values):
    rho = fifesim.surface_reflectance(lai_values, bands=["TM2", "TM3", "TM4"])
    return rho.fifesim.to_toa().fifesim.sense("TM")


@pytest.fixture(scope="module")
def truth(lai_values):
    return xr.Dataset({"lai": fifesim.aggregate(lai_values), "fpar": fifesim.aggregate(fifesim.fpar(lai_values))})


@pytest.fixture
def copy(image, tmp_path):
    return Copy(fifesim.to_geotiff(image, tmp_path / "image.tif"))


@pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])
@pytest.mark.parametrize("bands", [[2, 1, 0], [1, 2, 0], [2, 1], [0]])
def test_selected_bands_keep_their_names_and_calibration(image, copy, tmp_path, bands, chunks):
    copy.select(bands)
    with no_compute():
        found = fifesim.open_image(copy.write(tmp_path / "selected.tif"), chunks=chunks)
    xr.testing.assert_identical(found.compute(), image.isel(band=bands))


def test_selected_variables_keep_their_names(truth, tmp_path):
    copy = Copy(truth.fifesim.to_geotiff(tmp_path / "truth.tif"))
    copy.select([1, 0])
    found = fifesim.open_image(copy.write(tmp_path / "exchanged.tif"))
    assert found["band"].values.tolist() == ["fpar", "lai"]
    np.testing.assert_array_equal(found.sel(band="lai"), truth["lai"])
    copy.select([0])
    found = fifesim.open_image(copy.write(tmp_path / "fpar.tif"))
    np.testing.assert_array_equal(found.sel(band="fpar"), truth["fpar"])


@pytest.mark.parametrize(
    "descriptions", [["TM2", "TM2", "TM4"], ["TM2", "red", "TM4"], ["TM2", None, "TM4"]], ids=["twice", "other", "none"]
)
def test_descriptions_that_tell_no_bands_are_refused(copy, tmp_path, descriptions):
    copy.descriptions = descriptions
    with pytest.raises(ValueError, match=r"the descriptions .* are .*, and its tag FIFESIM has TM2, TM3, TM4: give"):
        fifesim.open_image(copy.write(tmp_path / "named.tif"))


def test_a_band_twice_is_refused(copy, tmp_path):
    copy.select([2, 2])
    with pytest.raises(ValueError, match=r"are TM4, TM4, and its tag"):
        fifesim.open_image(copy.write(tmp_path / "twice.tif"))


@pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])
def test_bands_without_descriptions_are_told_by_their_values(image, copy, tmp_path, chunks):
    copy.descriptions = [None] * 3
    found = fifesim.open_image(copy.write(tmp_path / "nameless.tif"), chunks=chunks)
    xr.testing.assert_identical(found.compute(), image)
    copy.values = copy.values[::-1]
    with pytest.raises(ValueError, match=r"in a cell of TM2 where fifesim wrote"):
        fifesim.open_image(copy.write(tmp_path / "nameless.tif"), chunks=chunks).compute()


def test_fewer_bands_without_descriptions_are_refused(copy, tmp_path):
    copy.select([1, 2])
    copy.descriptions = [None] * 2
    with pytest.raises(ValueError, match="are none, none, and its tag FIFESIM has TM2, TM3, TM4"):
        fifesim.open_image(copy.write(tmp_path / "nameless.tif"))


@pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])
def test_bands_whose_descriptions_stayed_behind_are_refused(copy, tmp_path, chunks):
    """rioxarray reorders values, and neither descriptions nor scales."""
    copy.values = copy.values[::-1]
    path = copy.write(tmp_path / "reordered.tif")
    with pytest.raises(ValueError, match=r"in a cell of TM2 where fifesim wrote .* order of the bands\. Open the file"):
        fifesim.open_image(path, chunks=chunks).compute()


def radiance(copy):
    scale, offset = (np.array(each)[:, None, None] for each in (copy.scales, copy.offsets))
    return copy.values * scale + offset


def unscale(copy):
    """``gdal_translate -unscale -ot Float32``"""
    copy.values = radiance(copy).astype(np.float32)
    copy.scales, copy.offsets, copy.units = [1.0] * 3, [0.0] * 3, [None] * 3


def unscale_and_keep_scales(copy):
    """rioxarray with ``mask_and_scale``, which writes scales again."""
    copy.values = np.rint(radiance(copy)).astype(np.uint8)
    copy.units = [None] * 3


def rescale_to_one(copy):
    """``gdal_translate -scale 0 255 0 1 -ot Float32``, which keeps the scales."""
    copy.values = (copy.values / 255).astype(np.float32)
    copy.units = [None] * 3


def rescale_to_bytes(copy):
    """``gdal_translate -scale 0 255 0 100``"""
    copy.values = np.rint(copy.values * (100 / 255)).astype(np.uint8)
    copy.units = [None] * 3


def other_scale(copy):
    copy.scales = [2.0] * 3


def other_offset(copy):
    copy.offsets = [0.0] * 3


def half(copy):
    copy.values = copy.values * 0.5


@pytest.mark.parametrize(
    "change",
    [unscale, unscale_and_keep_scales, rescale_to_one, rescale_to_bytes, other_scale, other_offset, half],
    ids=lambda change: change.__name__,
)
@pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])
def test_values_that_are_not_those_written_are_refused(copy, tmp_path, change, chunks):
    change(copy)
    path = copy.write(tmp_path / "changed.tif")
    with pytest.raises(ValueError, match=r"another program changed the values or .* rioxarray\.open_rasterio"):
        fifesim.open_image(path, chunks=chunks).compute()


@pytest.mark.parametrize("dtype", ["uint16", "int16", "int32", "float32", "float64"])
@pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])
def test_digital_numbers_of_another_type_come_back(image, copy, tmp_path, dtype, chunks):
    copy.convert(dtype)
    with no_compute():
        found = fifesim.open_image(copy.write(tmp_path / "converted.tif"), chunks=chunks)
    assert found.dtype == np.uint8
    xr.testing.assert_identical(found.compute(), image)


def resample(copy):
    """Move the cells by half of one, so that no cell can be compared."""
    copy.transform = copy.transform @ copy.transform.translation(0.5, 0.5)


@pytest.mark.parametrize("value", [30.5, -1.0, 256.0])
@pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])
def test_resampled_values_that_are_no_digital_numbers_are_refused(copy, tmp_path, value, chunks):
    resample(copy)
    copy.values = copy.values.astype(np.float32)
    fifesim.open_image(copy.write(tmp_path / "whole.tif"), chunks=chunks).compute()
    copy.values[1, -1, -1] = value
    path = copy.write(tmp_path / "fractions.tif")
    with pytest.raises(ValueError, match=rf"digital number of {value:g} is not .* 255: it is in .*fractions\.tif"):
        fifesim.open_image(path, chunks=chunks).compute()


def test_resampled_bands_need_descriptions_and_units(copy, tmp_path):
    resample(copy)
    assert fifesim.open_image(copy.write(tmp_path / "moved.tif"))["band"].values.tolist() == ["TM2", "TM3", "TM4"]
    kept, copy.units = copy.units, [None] * 3
    with pytest.raises(ValueError, match=r"other cells than fifesim wrote and lacks the units .* gdalwarp"):
        fifesim.open_image(copy.write(tmp_path / "unitless.tif"))
    copy.units, copy.descriptions = kept, [None] * 3
    with pytest.raises(ValueError, match="have no descriptions that tell them apart"):
        fifesim.open_image(copy.write(tmp_path / "nameless.tif"))


@pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])
def test_another_value_for_no_data_becomes_that_of_the_raster(image, truth, copy, tmp_path, chunks):
    copy.values[:, 0, 0] = copy.nodata = 255
    found = fifesim.open_image(copy.write(tmp_path / "image.tif"), chunks=chunks).compute()
    assert (found[:, 0, 0] == 0).all() and found.attrs["_FillValue"] == 0
    np.testing.assert_array_equal(found[:, 1:], image[:, 1:])
    own = Copy(truth["lai"].fifesim.to_geotiff(tmp_path / "lai.tif"))
    own.values[:, 0, 0] = own.nodata = -9999
    found = fifesim.open_image(own.write(tmp_path / "masked.tif"), chunks=chunks).compute()
    assert np.isnan(found[0, 0])
    np.testing.assert_array_equal(found[1:], truth["lai"][1:])


def test_a_value_for_no_data_that_was_added_is_said(truth, tmp_path):
    classes = truth["lai"].round().astype("int16").drop_attrs().rename("cover")
    classes = classes.rio.write_crs(truth.rio.crs)
    copy = Copy(classes.fifesim.to_geotiff(tmp_path / "classes.tif"))
    assert copy.nodata is None
    copy.nodata = -1
    assert fifesim.open_image(copy.write(tmp_path / "masked.tif")).attrs["_FillValue"] == -1


def test_fractions_that_became_whole_numbers_are_refused(truth, tmp_path):
    copy = Copy(truth.fifesim.to_geotiff(tmp_path / "truth.tif"))
    copy.convert("uint8")
    with pytest.raises(ValueError, match=r"holds values of type uint8, and fifesim wrote float64: .* rounded"):
        fifesim.open_image(copy.write(tmp_path / "rounded.tif"))
    copy = Copy(tmp_path / "truth.tif")
    copy.convert("float32")
    found = fifesim.open_image(copy.write(tmp_path / "single.tif"))
    assert found.dtype == np.float32
    np.testing.assert_allclose(found.sel(band="fpar"), truth["fpar"], rtol=1e-7)


@pytest.fixture(scope="module")
def composite(lai_values):
    """The second date is greener in the east; no date has data in the last row."""
    toa = fifesim.surface_reflectance(lai_values, bands=["TM3", "TM4"]).fifesim.to_toa()
    toa = toa.where(toa["y"] > toa["y"].min())
    greener = toa.copy(deep=True)
    greener[1] *= np.where(toa["x"] > toa["x"].mean(), 1.1, 0.9)
    times = np.array(["1987-06-06T16:35:12.123456", "1987-07-06T16:40"], "datetime64[ns]")
    return xr.concat([toa, greener], xr.DataArray(times, dims="time", name="time")).fifesim.composite()


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("chunks", [None, {"y": 20, "x": 17}], ids=["eager", "lazy"])
@pytest.mark.parametrize("bands", [True, False], ids=["bands", "ndvi"])
def test_dates_of_a_composite_come_back(composite, tmp_path, dtype, chunks, bands):
    dates = composite["date"]
    assert np.unique(dates).size == 3 and dates.isnull().any()
    raster = composite.astype(dtype)
    raster = raster if bands else raster.isel(band=1, drop=True)
    path = raster.fifesim.to_geotiff(tmp_path / "composite.tif")
    with no_compute():
        found = fifesim.open_image(path, chunks=chunks)
    xr.testing.assert_identical(found.compute(), raster)
    copy = Copy(path)
    assert (copy.descriptions[-1], copy.units[-1]) == ("date", "days since 1970-01-01")
    np.testing.assert_allclose(copy.values[-1, -2, -1], dates[-2, -1].values.astype(float) / 86400e9, rtol=1e-14)


def test_a_lazy_composite_is_written_as_an_eager_one(composite, tmp_path):
    eager = composite.fifesim.to_geotiff(tmp_path / "eager.tif")
    lazy = composite.chunk({"y": 20, "x": 17}).fifesim.to_geotiff(tmp_path / "lazy.tif")
    xr.testing.assert_identical(fifesim.open_image(lazy), fifesim.open_image(eager))


def test_a_composite_without_its_band_of_dates_opens(composite, tmp_path):
    copy = Copy(composite.fifesim.to_geotiff(tmp_path / "composite.tif"))
    copy.select([1, 0])
    found = fifesim.open_image(copy.write(tmp_path / "selected.tif"))
    xr.testing.assert_identical(found, composite.isel(band=[1, 0]).drop_vars("date"))
    copy = Copy(tmp_path / "composite.tif")
    copy.select([2])
    with pytest.raises(ValueError, match="holds date without the bands that it belongs to"):
        fifesim.open_image(copy.write(tmp_path / "dates.tif"))


def test_dates_that_digital_numbers_cannot_hold_are_left_out_with_a_warning(image, tmp_path):
    dates = np.full(image.shape[1:], np.datetime64("1987-06-06", "ns"))
    with pytest.warns(UserWarning, match="lacks date"):
        image.assign_coords(date=(("y", "x"), dates)).fifesim.to_geotiff(tmp_path / "image.tif")
