"""The tag of a file and its values: the right bands after changes by other programs, or an error."""

import json

import numpy as np
import pytest
import rasterio
import xarray as xr
from edits import Copy
from lazy import no_compute
from pydantic import ValidationError

import fifesim
from fifesim.grids import tags
from fifesim.grids.grid import place
from fifesim.grids.tags import Fingerprint, changed_cell, fingerprint_cells, fingerprint_of


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


GOOD = {"name": "lai", "dims": ["y", "x"], "attrs": {}, "coords": {}}


def coordinate(**changed):
    return json.dumps(GOOD | {"coords": {"sza": {"dims": [], "values": 1.0, "dtype": "<f8", "attrs": {}} | changed}})


BAD = {
    "number": "1",
    "list": "[1]",
    "nothing": "null",
    "deep": "[" * 200_000,
    "long": "x" * 1_000_001,
    "escapes": '"\x1b[2J"',
    "dims": json.dumps(GOOD | {"dims": ["z", "x"]}),
    "dims twice": json.dumps(GOOD | {"dims": ["y", "x", "x"]}),
    "attrs": json.dumps(GOOD | {"attrs": [1]}),
    "missing": json.dumps({"name": "lai"}),
    "shape": coordinate(dims=["band"], values=[1.0, 2.0]),
    "nested": coordinate(dims=["band"], values=[[1.0]]),
    "object": coordinate(values={"a": 1}),
    "huge text": coordinate(values="a", dtype="<U500000000"),
    "unknown": coordinate(dtype="zz"),
    "record": coordinate(dtype="f8,f8"),
    "subarray": coordinate(dtype="(100000000,)f8"),
    "void": coordinate(dtype="V1000000000"),
    "no number": coordinate(values="a"),
    "place": json.dumps(GOOD | {"coords": {"y": {"dims": [], "values": 1.0, "dtype": "<f8", "attrs": {}}}}),
}


@pytest.fixture
def path(tmp_path):
    grid = fifesim.fife_site(30.0, window=((0, 4), (0, 5)))
    lai = place(xr.DataArray(np.ones((4, 5)), dims=("y", "x"), name="lai"), grid)
    return fifesim.to_geotiff(lai, tmp_path / "tagged.tif")


@pytest.mark.parametrize("text", BAD.values(), ids=BAD)
def test_a_foreign_tag_is_refused_by_the_name_of_its_file(path, text):
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="yes") as sink:
        sink.update_tags(**{tags.TAG: text})
    with pytest.raises(ValueError, match=r"tagged\.tif has a tag FIFESIM .*rioxarray\.open_rasterio") as said:
        fifesim.open_image(path)
    assert len(str(said.value)) <= 500 and str(said.value).isprintable()


def test_a_tag_that_fits_is_read(path):
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="yes") as sink:
        sink.update_tags(**{tags.TAG: coordinate()})
    assert float(fifesim.open_image(path)["sza"]) == 1.0


@pytest.fixture
def gdal_bands_image(lai_values):
    rho = fifesim.surface_reflectance(lai_values, bands=["TM3", "TM4"])
    return rho.fifesim.to_toa().fifesim.sense("TM")


@pytest.fixture
def gdal_bands_copy(gdal_bands_image, tmp_path):
    found = Copy(fifesim.to_geotiff(gdal_bands_image, tmp_path / "image.tif"))
    del found.tags["FIFESIM"]
    return found


@pytest.mark.parametrize("bands", [[0, 1], [1, 0], [1]])
def test_names_calibration_and_wavelengths_go_with_the_bands(gdal_bands_image, gdal_bands_copy, tmp_path, bands):
    gdal_bands_copy.select(bands)
    found, expected = (
        fifesim.open_image(gdal_bands_copy.write(tmp_path / "plain.tif")),
        gdal_bands_image.isel(band=bands),
    )
    np.testing.assert_allclose(fifesim.to_radiance(found), fifesim.to_radiance(expected), rtol=1e-12)
    np.testing.assert_allclose(found["wavelength"], expected["wavelength"], rtol=1e-8)
    assert found["band"].values.tolist() == expected["band"].values.tolist()


def test_fractions_with_a_scale_are_radiance(gdal_bands_image, gdal_bands_copy, tmp_path):
    gdal_bands_copy.convert("float32")
    found = fifesim.open_image(gdal_bands_copy.write(tmp_path / "plain.tif"))
    assert found.attrs["units"] == "W m-2 sr-1 um-1" and "gain" not in found.coords
    np.testing.assert_allclose(found, fifesim.to_radiance(gdal_bands_image), rtol=1e-6)


def test_digital_numbers_that_lost_their_scale_are_refused(gdal_bands_copy, tmp_path):
    gdal_bands_copy.scales, gdal_bands_copy.offsets = [1.0, 1.0], [0.0, 0.0]
    with pytest.raises(ValueError, match=r"bands of .*plain\.tif have units of radiance and no scale"):
        fifesim.open_image(gdal_bands_copy.write(tmp_path / "plain.tif"))
    gdal_bands_copy.convert("float32")
    found = fifesim.open_image(gdal_bands_copy.write(tmp_path / "fractions.tif"))
    np.testing.assert_array_equal(found.fillna(0), gdal_bands_copy.values)


def test_units_are_those_of_all_bands(gdal_bands_copy, tmp_path):
    gdal_bands_copy.units = ["1", "m"]
    assert "units" not in fifesim.open_image(gdal_bands_copy.write(tmp_path / "plain.tif")).attrs
    gdal_bands_copy.units = ["m", "m"]
    assert fifesim.open_image(gdal_bands_copy.write(tmp_path / "same.tif")).attrs["units"] == "m"


PROFILE = {"driver": "GTiff", "count": 2, "crs": "EPSG:26914"}
TRANSFORM = rasterio.transform.from_origin(705000, 4334100, 30, 30)


@pytest.fixture
def values():
    return np.random.default_rng(1).integers(1, 200, (2, 20, 30)).astype(np.uint8)


def write(path, values, transform=TRANSFORM):
    _, height, width = values.shape
    with rasterio.open(
        path, "w", **PROFILE, height=height, width=width, dtype=values.dtype, transform=transform
    ) as sink:
        sink.write(values)
    return rasterio.open(path)


@pytest.fixture
def fingerprint(tmp_path, values):
    with write(tmp_path / "written.tif", values) as source:
        return Fingerprint.model_validate(fingerprint_of(source))


def test_the_same_cells_are_found(tmp_path, values, fingerprint):
    with write(tmp_path / "same.tif", values) as source:
        cells = fingerprint_cells(fingerprint, [0, 1], source)
    assert cells.values.shape == (2, 8, 8)
    np.testing.assert_array_equal(cells.values, values[:, cells.rows][:, :, cells.columns])
    assert changed_cell(cells, values, (0, 0, 0), []) is None


def test_a_crop_has_some_of_the_cells(tmp_path, values, fingerprint):
    crop = values[:, 5:15, 3:20]
    with write(tmp_path / "crop.tif", crop, TRANSFORM @ rasterio.Affine.translation(3, 5)) as source:
        cells = fingerprint_cells(fingerprint, [0, 1], source)
    assert 0 < cells.values.size < 128
    assert changed_cell(cells, crop, (0, 0, 0), []) is None
    assert changed_cell(cells, crop + 1, (0, 0, 0), []) is not None


@pytest.mark.parametrize(("dx", "cell"), [(15.0, 30.0), (0.5, 30.0), (0.0, 60.0)])
def test_other_cells_are_not_compared(tmp_path, values, fingerprint, dx, cell):
    transform = rasterio.transform.from_origin(705000 + dx, 4334100, cell, cell)
    with write(tmp_path / "other.tif", values, transform) as source:
        assert fingerprint_cells(fingerprint, [0, 1], source) is None


def test_exchanged_bands_are_found_in_every_block(tmp_path, values, fingerprint):
    with write(tmp_path / "exchanged.tif", values[::-1]) as source:
        cells, told = (fingerprint_cells(fingerprint, order, source) for order in ([0, 1], [1, 0]))
    for top in (0, 10):
        block = values[::-1][:, top : top + 10]
        band, found, written = changed_cell(cells, block, (0, top, 0), [])
        assert (band, found == written) == (0, False)
        assert changed_cell(told, block, (0, top, 0), []) is None


def test_a_block_of_one_band_is_compared_with_that_band(tmp_path, values, fingerprint):
    with write(tmp_path / "same.tif", values) as source:
        cells = fingerprint_cells(fingerprint, [0, 1], source)
    assert changed_cell(cells, values[1:], (1, 0, 0), []) is None
    assert changed_cell(cells, values[1:], (0, 0, 0), [])[0] == 0
    assert changed_cell(cells, values[:1], (1, 0, 0), [])[0] == 1


def test_data_may_be_masked_but_not_made(tmp_path, values, fingerprint):
    with write(tmp_path / "same.tif", values) as source:
        cells = fingerprint_cells(fingerprint, [0, 1], source)
    masked = np.full_like(values, 255)
    assert changed_cell(cells, masked, (0, 0, 0), [255]) is None
    assert changed_cell(cells, masked, (0, 0, 0), []) == (0, 255, cells.values[0, 0, 0])


def test_nan_is_kept_as_such(tmp_path, values):
    fractions = np.where(values > 100, np.nan, values / 7)
    with write(tmp_path / "fractions.tif", fractions) as source:
        cells = fingerprint_cells(Fingerprint.model_validate(fingerprint_of(source)), [0, 1], source)
    assert np.isnan(cells.values).any()
    assert changed_cell(cells, fractions, (0, 0, 0), []) is None
    assert changed_cell(cells, fractions.astype(np.float32), (0, 0, 0), []) is None
    assert changed_cell(cells, fractions * (1 + 1e-12), (0, 0, 0), []) is not None
    assert changed_cell(cells, np.nan_to_num(fractions), (0, 0, 0), [])[1] == 0


def test_values_of_other_rows_are_refused(fingerprint):
    changed = fingerprint.model_dump()
    changed["values"][0] = changed["values"][0][1:]
    with pytest.raises(ValidationError, match="values of other rows"):
        Fingerprint.model_validate(changed)


def test_a_raster_smaller_than_the_fingerprint_is_kept_whole(tmp_path):
    with write(tmp_path / "small.tif", np.arange(12, dtype=np.uint8).reshape(2, 2, 3)) as source:
        assert fingerprint_of(source)["values"] == [[[0, 1, 2], [3, 4, 5]], [[6, 7, 8], [9, 10, 11]]]
