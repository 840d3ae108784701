"""The fifesim tag and the values of a file: the right bands after changes by other programs, or an error."""

import json

import numpy as np
import pytest
import rasterio
import xarray as xr
from edits import Copy
from lazy import no_compute

import fifesim
from fifesim.grids import tags
from fifesim.grids.grid import place

EAGER_OR_LAZY = pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])


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


@pytest.fixture
def open_changed(tmp_path):
    """A function that writes a changed copy and opens it lazily."""

    def reopened(copy, chunks=None):
        path = copy.write(tmp_path / "changed.tif")
        with no_compute():
            found = fifesim.open_image(path, chunks=chunks)
        assert (found.chunks is None) == (chunks is None)
        return found.compute()

    return reopened


@EAGER_OR_LAZY
@pytest.mark.parametrize("bands", [[2, 1, 0], [1, 2, 0], [2, 1], [0]])
def test_selected_bands_keep_their_names_and_calibration(image, copy, open_changed, bands, chunks):
    copy.select(bands)
    xr.testing.assert_identical(open_changed(copy, chunks), image.isel(band=bands))


def test_bands_without_names_are_restored_from_their_wavelengths(image, tmp_path):
    nameless = fifesim.to_reflectance(image)
    along = [name for name, value in nameless.coords.items() if value.dims == ("band",) and name != "wavelength"]
    nameless = nameless.drop_vars(along)
    xr.testing.assert_identical(fifesim.open_image(nameless.fifesim.to_geotiff(tmp_path / "plain.tif")), nameless)


def test_bands_of_a_file_have_a_name_only_if_it_is_theirs(truth, tmp_path):
    lai = truth["lai"]
    for raster, names in ((lai, ("lai",)), (lai.rename(None), (None,)), (xr.concat([lai, lai], "band"), (None, None))):
        with rasterio.open(raster.fifesim.to_geotiff(tmp_path / "a.tif", overwrite=True)) as file:
            assert file.descriptions == names


def test_only_several_variables_need_names(truth, tmp_path, open_changed):
    several, one = (
        Copy(truth[name].fifesim.to_geotiff(tmp_path / "a.tif", overwrite=True)) for name in (["lai", "fpar"], "lai")
    )
    several.descriptions, one.descriptions = ["lai", "mine"], ["mine"]
    np.testing.assert_array_equal(open_changed(one), truth["lai"])
    with pytest.raises(ValueError, match="are lai, mine, and its tag FIFESIM has lai, fpar"):
        open_changed(several)


def changed(bands=(0, 1, 2), shift=0.0, factor=1, **metadata):
    """Function that selects bands of a copy and changes its cells, values and metadata."""

    def change(copy):
        copy.select(list(bands))
        copy.transform = copy.transform @ copy.transform.translation(shift, shift)
        copy.values = copy.values * factor
        copy.__dict__ |= metadata

    return change


NAMES = "the descriptions .* are {}, and its tag FIFESIM has TM2, TM3, TM4: giv"
VALUES = r"another program changed the values or .* rioxarray\.open_rasterio"
NONE = [None] * 3


@EAGER_OR_LAZY
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (changed(descriptions=["TM2", "TM2", "TM4"]), NAMES.format("TM2, TM2, TM4")),
        (changed(descriptions=["TM2", "red", "TM4"]), NAMES.format("TM2, red, TM4")),
        (changed(descriptions=["TM2", None, "TM4"]), NAMES.format("TM2, none, TM4")),
        (changed([2, 2]), NAMES.format("TM4, TM4")),
        (changed([1, 2], descriptions=[None] * 2), NAMES.format("none, none")),
        (changed(scales=[2.0] * 3), VALUES),
        (changed(offsets=[0.0] * 3), VALUES),
        (changed(factor=0.5), VALUES),
        # Resampled cells cannot be compared.
        (changed(shift=0.5, units=NONE), r"other cells than fifesim wrote and lacks the units .* gdalwarp"),
        (changed(shift=0.5, descriptions=NONE), "have no descriptions that tell them apart"),
    ],
)
def test_changed_files_are_rejected(copy, open_changed, change, said, chunks):
    change(copy)
    with pytest.raises(ValueError, match=said):
        open_changed(copy, chunks)


@EAGER_OR_LAZY
def test_bands_without_valid_descriptions_are_checked_by_their_values(image, copy, open_changed, chunks):
    """rioxarray can reorder values while descriptions and scales stay."""
    names, copy.descriptions = copy.descriptions, [None] * 3
    xr.testing.assert_identical(open_changed(copy, chunks), image)
    copy.values = copy.values[::-1]
    for copy.descriptions in ([None] * 3, names):
        with pytest.raises(ValueError, match=r"in a cell of TM2 where fifesim wrote .* order of the bands\. Open the"):
            open_changed(copy, chunks)


def test_change_in_the_last_digits_is_found(truth, tmp_path, open_changed):
    """A single compared cell differs in its last digits; NaN counts as a value."""
    raster = truth["lai"].where(truth["lai"] > truth["lai"].min())
    copy = Copy(raster.fifesim.to_geotiff(tmp_path / "lai.tif"))
    np.testing.assert_array_equal(open_changed(copy), raster)
    kept, missing = copy.values.copy(), np.isnan(copy.values)
    for changed in (kept * (1 + 1e-12), np.where(missing, 0.0, kept)):
        copy.values = changed
        with pytest.raises(ValueError, match="another program changed the values"):
            open_changed(copy)


@EAGER_OR_LAZY
@pytest.mark.parametrize("dtype", ["uint16", "int16", "int32", "float32", "float64"])
def test_digital_numbers_of_another_dtype_are_restored(image, copy, open_changed, dtype, chunks):
    copy.convert(dtype)
    found = open_changed(copy, chunks)
    assert found.dtype == np.uint8
    xr.testing.assert_identical(found, image)


@EAGER_OR_LAZY
@pytest.mark.parametrize("value", [30.5, -1.0, 256.0])
def test_resampled_values_that_are_no_digital_numbers_are_rejected(copy, open_changed, value, chunks):
    changed(shift=0.02, factor=np.float32(1))(copy)
    open_changed(copy, chunks)
    copy.values[1, -1, -1] = value
    with pytest.raises(ValueError, match=rf"digital number of {value:g} is not .* 255: it is in .*changed\.tif"):
        open_changed(copy, chunks)


@EAGER_OR_LAZY
def test_changed_nodata_value_becomes_the_value_of_the_raster(image, truth, copy, tmp_path, open_changed, chunks):
    copy.values[:, 0, 0] = copy.nodata = 255
    found = open_changed(copy, chunks)
    assert (found[:, 0, 0] == 0).all() and found.attrs["_FillValue"] == 0
    np.testing.assert_array_equal(found[:, 1:], image[:, 1:])
    own = Copy(truth["lai"].fifesim.to_geotiff(tmp_path / "lai.tif"))
    own.values[:, 0, 0] = own.nodata = -9999
    found = open_changed(own, chunks)
    assert np.isnan(found[0, 0])
    np.testing.assert_array_equal(found[1:], truth["lai"][1:])
    # Cells may become missing, but missing cells may not become valid.
    copy.nodata = 0
    with pytest.raises(ValueError, match="another program changed the values"):
        open_changed(copy, chunks)


def test_added_nodata_value_is_kept(truth, tmp_path, open_changed):
    classes = truth["lai"].round().astype("int16").drop_attrs().rename("cover").rio.write_crs(truth.rio.crs)
    copy = Copy(classes.fifesim.to_geotiff(tmp_path / "classes.tif"))
    assert copy.nodata is None
    copy.nodata = -1
    assert open_changed(copy).attrs["_FillValue"] == -1


def test_fractions_rounded_to_integers_are_rejected(truth, tmp_path, open_changed):
    path = truth.fifesim.to_geotiff(tmp_path / "truth.tif")
    copy = Copy(path)
    copy.convert("uint8")
    with pytest.raises(ValueError, match=r"holds values of type uint8, and fifesim wrote float64: .* rounded"):
        open_changed(copy)
    copy = Copy(path)
    copy.convert("float32")
    found = open_changed(copy)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found.sel(band="fpar"), truth["fpar"], rtol=1e-7)


@pytest.fixture(scope="module")
def composite(lai_values):
    """Composite of two dates, the second greener in the east; the last row has no data at either date."""
    toa = fifesim.surface_reflectance(lai_values, bands=["TM3", "TM4"]).fifesim.to_toa()
    toa = toa.where(toa["y"] > toa["y"].min())
    greener = toa.copy(deep=True)
    greener[1] *= np.where(toa["x"] > toa["x"].mean(), 1.1, 0.9)
    times = np.array(["1987-06-06T16:35:12.123456", "1987-07-06T16:40"], "datetime64[ns]")
    return xr.concat([toa, greener], xr.DataArray(times, dims="time", name="time")).fifesim.composite()


@EAGER_OR_LAZY
@pytest.mark.parametrize(("dtype", "bands"), [("float64", True), ("float32", False)], ids=["bands", "ndvi"])
def test_dates_of_a_composite_survive_a_round_trip(composite, tmp_path, dtype, chunks, bands):
    dates = composite["date"]
    assert np.unique(dates).size == 3 and dates.isnull().any()
    raster = composite.astype(dtype)
    raster = raster if bands else raster.isel(band=1, drop=True)
    path = (raster if chunks is None else raster.chunk({"y": 20, "x": 17})).fifesim.to_geotiff(tmp_path / "dates.tif")
    with no_compute():
        found = fifesim.open_image(path, chunks=chunks)
    xr.testing.assert_identical(found.compute(), raster)
    copy = Copy(path)
    assert (copy.descriptions[-1], copy.units[-1]) == ("date", "days since 1970-01-01")
    np.testing.assert_allclose(copy.values[-1, -2, -1], dates[-2, -1].values.astype(float) / 86400e9, rtol=1e-14)


def test_composite_opens_without_its_date_band(composite, tmp_path, open_changed):
    copy = Copy(composite.fifesim.to_geotiff(tmp_path / "composite.tif"))
    copy.select([1, 0])
    xr.testing.assert_identical(open_changed(copy), composite.isel(band=[1, 0]).drop_vars("date"))
    copy = Copy(tmp_path / "composite.tif")
    copy.select([2])
    with pytest.raises(ValueError, match="holds date without the bands that it belongs to"):
        open_changed(copy)


GOOD = {"name": "lai", "dims": ["y", "x"], "attrs": {}, "coords": {}}
NUMBER = {"dims": [], "values": 1.0, "dtype": "<f8", "attrs": {}}

# Foreign tags: changes of the tag and of its coordinate sza.
BAD_TAGS = [{"dims": ["z", "x"]}, {"dims": ["y", "x", "x"]}, {"attrs": [1]}, {"coords": {"y": NUMBER}}]
BAD_COORDINATES = [
    {"dims": ["band"], "values": [1.0, 2.0]}, {"dims": ["band"], "values": [[1.0]]}, {"values": {"a": 1}},
    {"values": "a", "dtype": "<U500000000"}, {"dtype": "zz"}, {"dtype": "f8,f8"}, {"dtype": "(100000000,)f8"},
    {"dtype": "V1000000000"}, {"values": "a"},
]  # fmt: skip
BAD_TEXTS = ["1", "[1]", "null", "[" * 200_000, "x" * 1_000_001, '"\x1b[2J"', '{"name": "lai"}']


def test_foreign_tag_is_rejected_with_the_file_name(tmp_path):
    grid = fifesim.fife_site(30.0, window=((0, 4), (0, 5)))
    lai = place(xr.DataArray(np.ones((4, 5)), dims=("y", "x"), name="lai"), grid)
    path = fifesim.to_geotiff(lai, tmp_path / "tagged.tif")

    def tagged(text):
        with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="yes") as sink:
            sink.update_tags(**{tags.TAG: text})
        return fifesim.open_image(path)

    assert float(tagged(json.dumps(GOOD | {"coords": {"sza": NUMBER}}))["sza"]) == 1.0
    bad = BAD_TAGS + [{"coords": {"sza": NUMBER | each}} for each in BAD_COORDINATES]
    for text in BAD_TEXTS + [json.dumps(GOOD | each) for each in bad]:
        with pytest.raises(ValueError, match=r"tagged\.tif has a tag FIFESIM .*rioxarray\.open_rasterio") as said:
            tagged(text)
        assert len(str(said.value)) <= 500 and str(said.value).isprintable(), text[:100]


@pytest.fixture
def untagged_copy(copy):
    del copy.tags["FIFESIM"]
    return copy


@pytest.mark.parametrize("bands", [[0, 1, 2], [2, 1, 0], [1]])
def test_gdal_names_calibration_and_wavelengths_follow_the_bands(image, untagged_copy, open_changed, bands):
    untagged_copy.select(bands)
    found, expected = open_changed(untagged_copy), image.isel(band=bands)
    np.testing.assert_allclose(fifesim.sensor.to_radiance(found), fifesim.sensor.to_radiance(expected), rtol=1e-12)
    np.testing.assert_allclose(found["wavelength"], expected["wavelength"], rtol=1e-8)
    assert found["band"].values.tolist() == expected["band"].values.tolist()


def test_untagged_fractions_with_a_scale_are_radiance(image, untagged_copy, open_changed):
    untagged_copy.convert("float32")
    found = open_changed(untagged_copy)
    assert found.attrs["units"] == "W m-2 sr-1 um-1" and "gain" not in found.coords
    np.testing.assert_allclose(found, fifesim.sensor.to_radiance(image), rtol=1e-6)


def test_digital_numbers_without_scale_are_rejected(untagged_copy, open_changed):
    untagged_copy.scales, untagged_copy.offsets = [1.0] * 3, [0.0] * 3
    with pytest.raises(ValueError, match=r"bands of .*changed\.tif have units of radiance and no scale"):
        open_changed(untagged_copy)
    untagged_copy.convert("float32")
    np.testing.assert_array_equal(open_changed(untagged_copy).fillna(0), untagged_copy.values)


def test_units_are_read_only_if_all_bands_agree(untagged_copy, open_changed):
    untagged_copy.units = ["1", "m", "m"]
    assert "units" not in open_changed(untagged_copy).attrs
    untagged_copy.units = ["m"] * 3
    assert open_changed(untagged_copy).attrs["units"] == "m"
