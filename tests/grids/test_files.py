"""GeoTIFF, netCDF and Zarr files: readable by other programs, read back unchanged, and checked after edits."""

import json
import tomllib
import warnings
from pathlib import Path

import dask.array as da
import numpy as np
import pytest
import rasterio
import xarray as xr
from edits import Copy
from lazy import ODD_CHUNKS, in_chunks, no_compute
from rasterio.enums import ColorInterp

import fifesim
from fifesim.grids import cf, tags
from fifesim.grids import grid as grids

FOREIGN = tomllib.loads((Path(__file__).parents[1] / "data" / "foreign_rasters.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def toa(lai_values):
    return fifesim.surface_reflectance(lai_values, bands=["TM2", "TM3", "TM4", "TM1", "TM7"]).fifesim.to_toa()


@pytest.fixture(scope="module")
def image(lai_values):
    """An image with a hole of missing data."""
    lai = lai_values.copy(deep=True)
    lai[18:27, 27:36] = np.nan
    return fifesim.surface_reflectance(lai, bands=["TM2", "TM3", "TM4"]).fifesim.to_toa().fifesim.sense("TM")


@pytest.fixture(scope="module")
def truth(lai_values):
    return xr.Dataset({"lai": fifesim.aggregate(lai_values), "fpar": fifesim.aggregate(fifesim.fpar(lai_values))})


@pytest.fixture(scope="module")
def composite(toa):
    """Composite of two dates, the second greener in the east; the last row has no data at either date."""
    toa = toa.sel(band=["TM3", "TM4"]).where(toa["y"] > toa["y"].min())
    greener = toa.copy(deep=True)
    greener[1] *= np.where(toa["x"] > toa["x"].mean(), 1.1, 0.9)
    times = np.array(["1987-06-06T16:35:12.123456", "1987-07-06T16:40"], "datetime64[ns]")
    return xr.concat([toa, greener], xr.DataArray(times, dims="time", name="time")).fifesim.composite()


@pytest.fixture
def write(tmp_path):
    """Function that writes a raster and returns the path."""
    return lambda raster, **options: fifesim.to_geotiff(raster, tmp_path / "a.tif", overwrite=True, **options)


def test_large_geotiff_has_overviews(write):
    grid = fifesim.fife_site(10.0, window=((0, 1100), (0, 1100)))
    values = da.ones(tuple(grid.shape), chunks=400, dtype=np.float32)
    with rasterio.open(write(grids.place(xr.DataArray(values, dims=("y", "x"), name="lai"), grid))) as source:
        assert (source.block_shapes, source.overviews(1), source.dtypes) == ([(512, 512)], [2, 4], ("float32",))


def test_gdal_reads_location_bands_and_calibration(image, write):
    bands = fifesim.instrument("TM").select(["TM2", "TM3", "TM4"])
    with rasterio.open(write(image, tags={"PROJECT": "trial"})) as source:
        np.testing.assert_array_equal(source.read(), image)
        assert source.crs.to_epsg() == 26914
        np.testing.assert_allclose(source.transform, grids.geobox(image).affine, rtol=0, atol=1e-6)
        assert source.descriptions == ("TM2", "TM3", "TM4")
        assert (source.units, source.nodatavals) == (("W m-2 sr-1 um-1",) * 3, (0,) * 3)
        for number, band in enumerate(bands, 1):
            gain = (band.full_scale_radiance - band.min_radiance) / 255
            assert source.scales[number - 1] == pytest.approx(gain, rel=1e-15)
            assert source.offsets[number - 1] == band.min_radiance
            wavelength = float(source.tags(number, ns="IMAGERY")["CENTRAL_WAVELENGTH_UM"])
            assert wavelength == pytest.approx(band.wavelength, rel=1e-8)
        found = source.tags()
    assert (found["PROJECT"], found["instrument"], found["AREA_OR_POINT"]) == ("trial", "TM", "Area")


@pytest.mark.parametrize("name", ["image", "reflectance", "lai", "one-band", "single-precision", "odd", "nameless"])
@pytest.mark.parametrize("chunks", [None, {"y": 2, "x": 4}], ids=["eager", "chunked"])
def test_raster_survives_a_round_trip(image, truth, write, name, chunks):
    """Attributes and times are unknown to JSON, and bands without names are restored from their wavelengths."""
    reflectance = fifesim.to_reflectance(image)
    along = [key for key, each in reflectance.coords.items() if each.dims == ("band",) and key != "wavelength"]
    odd = image.assign_coords(time=np.datetime64("1987-06-06T16:35:00", "ns"))
    odd.attrs |= {"text": 'quotes " and\nlines, \N{MICRO SIGN}', "number": np.float32(0.5), "count": np.int64(3)}
    raster = {
        "image": image,
        "reflectance": reflectance,
        "lai": truth["lai"],
        "one-band": image.sel(band=["TM4"]),
        "single-precision": reflectance.astype(np.float32),
        "odd": odd,
        "nameless": reflectance.drop_vars(along),
    }[name]
    path = write(raster if chunks is None else in_chunks(raster, ODD_CHUNKS | {"band": 1}))
    with no_compute():
        again = fifesim.open_image(path, chunks=chunks)
    assert (again.chunks is None) == (chunks is None) and again.dtype == raster.dtype
    xr.testing.assert_identical(again.compute(), raster)
    assert grids.same_grid(grids.geobox(again), grids.geobox(raster))


def test_variables_of_a_dataset_become_bands_and_only_they_need_names(truth, write, tmp_path):
    path = write(truth)
    with rasterio.open(path) as source:
        assert source.descriptions == ("lai", "fpar") and np.isnan(source.nodata)
    again = fifesim.open_image(path)
    for name in truth:
        np.testing.assert_array_equal(again.sel(band=name), truth[name])
    several, one = Copy(path), Copy(write(truth["lai"]))
    several.descriptions, one.descriptions = ["lai", "mine"], ["mine"]
    np.testing.assert_array_equal(fifesim.open_image(one.write(tmp_path / "one.tif")), truth["lai"])
    with pytest.raises(ValueError, match="are lai, mine, and its tag FIFESIM has lai, fpar"):
        fifesim.open_image(several.write(tmp_path / "several.tif"))


def test_failed_write_leaves_the_folder_unchanged(image, tmp_path):
    """Chunks other than the first cannot be computed."""

    def refuse(block, block_info=None):
        if block_info[0]["chunk-location"] != (0, 0, 0):
            raise RuntimeError("disk on fire")
        return block

    path, lazy = tmp_path / "tm.tif", in_chunks(image, {"y": 2})
    lazy = lazy.copy(data=lazy.data.map_blocks(refuse, dtype=image.dtype))
    path.write_text("kept")
    with pytest.raises(RuntimeError, match="disk on fire"):
        fifesim.to_geotiff(lazy, path, overwrite=True)
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [("tm.tif", "kept")]


def test_coordinates_omitted_from_a_geotiff_give_a_warning(image, write):
    angles = (("y", "x"), np.full(image.shape[1:], 20.0))
    with pytest.warns(UserWarning, match="lacks vza, date, which vary by cell.* give geometry="):
        write(image.assign_coords(vza=angles, date=(("y", "x"), np.full(image.shape[1:], "1987", "M8[ns]"))))


def test_calibration_goes_with_digital_numbers_of_all_bands_or_one(image, toa, write):
    """In a dataset of chips, the calibration is a coordinate of all variables, also of reflectance."""
    again = fifesim.open_image(write(toa.assign_coords(gain=("band", [0.5] * 5), offset=("band", [1.0] * 5))))
    np.testing.assert_array_equal(again, toa)
    assert "gain" not in again.coords
    again = fifesim.open_image(write(image.sel(band="TM3")))
    assert again.identical(image.sel(band=["TM3"]))


@pytest.mark.parametrize("kind", ["netcdf", "zarr"])
def test_netcdf_and_zarr_keep_crs_and_names(image, tmp_path, kind):
    path = tmp_path / "image"
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "The data type .* does not have a Zarr V3 spec")
        image.to_dataset().to_zarr(path, consolidated=False) if kind == "zarr" else image.to_netcdf(path)
    options = {"decode_coords": "all"} | ({"engine": "zarr", "consolidated": False} if kind == "zarr" else {})
    # By default xarray masks the fill value and converts the counts to floating point.
    for masked in (True, False):
        with xr.open_dataset(path, mask_and_scale=masked, **options) as opened:
            again = opened["dn"].load()
        np.testing.assert_array_equal(again.fifesim.ndvi(), image.fifesim.ndvi())
    assert again.encoding["grid_mapping"] == "spatial_ref" and again.rio.crs == image.rio.crs
    np.testing.assert_array_equal(again, image)
    assert cf.attributes("dn").items() <= again.attrs.items()
    for name in image.coords:
        np.testing.assert_array_equal(again[name], image[name])
        assert image[name].attrs.items() <= again[name].attrs.items()


def test_nodata_value_is_taken_from_the_raster(write):
    """A mask of zeros and ones has no cell without data; floating-point rasters have NaN by default."""
    grid = fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 120.0, 90.0, 30.0)
    for dtype, attrs, nodata in (
        (np.uint8, {"_FillValue": 220, "scale_factor": 0.1}, 220),
        (np.int16, {"nodata": -3}, -3),
        (np.float32, {"_FillValue": -3.0}, -3),
        (np.float32, {}, "nan"),
        (np.uint8, {"_FillValue": -9999}, None),
        (np.uint8, {}, None),
    ):
        values = np.arange(-3, 9).reshape(3, 4).astype(dtype)
        raster = grids.place(xr.DataArray(values, dims=("y", "x"), name="own", attrs=attrs), grid)
        path = write(raster)
        with rasterio.open(path) as source:
            assert source.nodata == nodata or str(source.nodata) == nodata
        again = fifesim.open_image(path)
        assert again.equals(raster) and again.attrs == attrs


def test_file_and_its_gdal_sidecar_are_replaced_only_with_overwrite(image, tmp_path):
    """A GIS writes statistics and band names to a sidecar file, which would hide the new ones."""
    path = fifesim.to_geotiff(image, tmp_path / "image.tif")
    before, stale = path.read_bytes(), "<PAMRasterBand band='1'><Description>stale</Description></PAMRasterBand>"
    (tmp_path / "image.tif.aux.xml").write_text(f"<PAMDataset>{stale}</PAMDataset>")
    with pytest.raises(FileExistsError, match=r"there is a file .*image.tif: type overwrite=True"):
        fifesim.to_geotiff(image[::-1], path)
    assert path.read_bytes() == before
    fifesim.to_geotiff(image[::-1], path, overwrite=True)
    np.testing.assert_array_equal(fifesim.open_image(path), image[::-1])


@pytest.mark.parametrize("bands", [["TM2", "TM3", "TM4"], ["TM3", "TM2", "TM1"], ["TM4"], ["TM7"], ["TM7", "TM1"]])
def test_colour_interpretation_follows_the_wavelength(toa, write, bands):
    """TM2, TM3 and TM4 are green, red and near infrared, in any order."""
    near = ColorInterp.nir if hasattr(ColorInterp, "nir") else ColorInterp.undefined
    known = {"TM1": ColorInterp.blue, "TM2": ColorInterp.green, "TM3": ColorInterp.red, "TM4": near}
    expected = [known.get(name, ColorInterp.undefined) for name in bands]
    for raster in (toa.sel(band=bands), toa.sel(band=bands).fifesim.sense("TM")):
        with rasterio.open(write(raster)) as source:
            assert list(source.colorinterp) == ([ColorInterp.gray] if bands == ["TM7"] else expected)


def test_time_sun_and_view_are_tags(image, write):
    dated = image.assign_coords(time=np.datetime64("1987-06-06T16:35:00.25", "ns"))
    with rasterio.open(write(dated)) as source:
        found, imagery = source.tags(), source.tags(ns="IMAGERY")
    assert found["TIFFTAG_DATETIME"] == "1987:06:06 16:35:00"
    assert imagery["ACQUISITIONDATETIME"] == "1987-06-06 16:35:00"
    assert float(found["SUN_ELEVATION"]) == pytest.approx(90 - float(image.sza), abs=1e-6)
    assert float(found["SUN_AZIMUTH"]) == pytest.approx(float(image.saa), abs=1e-6)
    assert (found["VIEW_ZENITH"], float(found["sza"])) == ("0", float(image.sza))
    with rasterio.open(write(image)) as source:
        assert "TIFFTAG_DATETIME" not in source.tags()


@pytest.fixture
def copy(image, write):
    return Copy(write(image))


@pytest.fixture
def open_changed(tmp_path):
    """A function that opens a changed copy in memory and lazily."""

    def reopened(copy):
        path = copy.write(tmp_path / "changed.tif")
        found = fifesim.open_image(path)
        with no_compute():
            lazy = fifesim.open_image(path, chunks={"y": 3, "x": 4})
        assert lazy.chunks is not None
        xr.testing.assert_identical(lazy.compute(), found)
        return found

    return reopened


def test_selected_bands_and_digital_numbers_of_another_dtype_are_restored(image, copy, open_changed):
    copy.select([2, 1])
    for dtype in ("uint8", "uint16", "int16", "float32", "float64"):
        copy.convert(dtype)
        xr.testing.assert_identical(open_changed(copy), image.isel(band=[2, 1]))


@pytest.mark.parametrize("chunks", [None, {"y": 3, "x": 4}], ids=["eager", "lazy"])
def test_changed_files_are_rejected(copy, tmp_path, chunks):
    for number, change in enumerate(FOREIGN["edits"]):
        changed = Copy(copy.write(tmp_path / "same.tif"))
        changed.select(change.get("bands", [0, 1, 2]))
        changed.transform = changed.transform @ changed.transform.translation(*[change.get("shift", 0.0)] * 2)
        changed.__dict__ |= {key: value for key, value in change.items() if key in changed.__dict__}
        with pytest.raises(ValueError, match=change["said"]):
            fifesim.open_image(changed.write(tmp_path / f"{number}.tif"), chunks=chunks).compute()


def test_change_in_the_last_digits_is_found(truth, write, open_changed):
    """A single compared cell differs in its last digits; NaN counts as a value."""
    raster = truth["lai"].where(truth["lai"] > truth["lai"].min())
    copy = Copy(write(raster))
    np.testing.assert_array_equal(open_changed(copy), raster)
    kept, missing = copy.values.copy(), np.isnan(copy.values)
    for changed in (kept * (1 + 1e-12), np.where(missing, 0.0, kept)):
        copy.values = changed
        with pytest.raises(ValueError, match="another program changed the values"):
            open_changed(copy)


def test_added_nodata_value_is_kept(truth, write, open_changed):
    copy = Copy(write(truth["lai"].round().astype("int16").drop_attrs(deep=False).rename("cover")))
    assert copy.nodata is None
    copy.nodata = -1
    assert open_changed(copy).attrs["_FillValue"] == -1


@pytest.mark.parametrize(("dtype", "bands"), [("float64", True), ("float32", False)], ids=["bands", "ndvi"])
def test_dates_of_a_composite_survive_a_round_trip(composite, write, open_changed, dtype, bands):
    dates = composite["date"]
    assert np.unique(dates).size == 3 and dates.isnull().any()
    raster = composite.astype(dtype) if bands else composite.astype(dtype).isel(band=1, drop=True)
    for chunked in (raster, raster.chunk({"y": 20, "x": 17})):
        copy = Copy(write(chunked))
        xr.testing.assert_identical(open_changed(copy), raster)
    assert (copy.descriptions[-1], copy.units[-1]) == ("date", "days since 1970-01-01")
    np.testing.assert_allclose(copy.values[-1, -2, -1], dates[-2, -1].values.astype(float) / 86400e9, rtol=1e-14)
    if bands:
        copy.select([1, 0])
        xr.testing.assert_identical(open_changed(copy), raster.isel(band=[1, 0]).drop_vars("date"))
    copy = Copy(write(raster))
    copy.select([-1])
    with pytest.raises(ValueError, match="holds date without the bands that it belongs to"):
        open_changed(copy)


BAD_TEXTS = ["1", "[1]", "null", "[" * 200_000, "x" * 1_000_001, '"\x1b[2J"', '{"name": "lai"}']


def test_foreign_tag_is_rejected_with_the_file_name(truth, write):
    path, (valid, number, changes, coordinates) = write(truth["lai"]), FOREIGN["tags"].values()

    def tagged(text):
        with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="yes") as sink:
            sink.update_tags(**{tags.TAG: text})
        return fifesim.open_image(path)

    assert float(tagged(json.dumps(valid | {"coords": {"sza": number}}))["sza"]) == 1.0
    changes = changes + [{"coords": {"sza": number | each}} for each in coordinates]
    for text in BAD_TEXTS + [json.dumps(valid | each) for each in changes]:
        with pytest.raises(ValueError, match=r"a\.tif has a tag FIFESIM .*rioxarray\.open_rasterio") as said:
            tagged(text)
        assert len(str(said.value)) <= 500 and str(said.value).isprintable(), text[:100]


def test_files_without_a_tag_are_read_by_their_gdal_metadata(image, copy, open_changed):
    del copy.tags["FIFESIM"]
    copy.select([2, 0])
    found, expected = open_changed(copy), image.isel(band=[2, 0])
    radiance = fifesim.sensor.to_radiance(expected)
    np.testing.assert_allclose(fifesim.sensor.to_radiance(found), radiance, rtol=1e-12)
    np.testing.assert_allclose(found["wavelength"], expected["wavelength"], rtol=1e-8)
    assert found["band"].values.tolist() == ["TM4", "TM2"]
    kept = copy.scales, copy.offsets
    copy.scales, copy.offsets = [1.0] * 2, [0.0] * 2
    with pytest.raises(ValueError, match=r"bands of .*changed\.tif have units of radiance and no scale"):
        open_changed(copy)
    # Fractions with a scale are radiance.
    copy.convert("float32")
    np.testing.assert_array_equal(open_changed(copy).fillna(0), copy.values)
    copy.scales, copy.offsets = kept
    found = open_changed(copy)
    assert found.attrs["units"] == "W m-2 sr-1 um-1" and "gain" not in found.coords
    np.testing.assert_allclose(found, radiance, rtol=1e-6)
    # Units are read only if all bands agree.
    for copy.units, units in ((["1", "m"], None), (["m", "m"], "m")):
        assert open_changed(copy).attrs.get("units") == units
