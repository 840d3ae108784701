"""GeoTIFF, netCDF and Zarr files are readable by other programs, and rasters are read back unchanged."""

import json
import math
import warnings

import dask.array as da
import numpy as np
import pytest
import rasterio
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute
from rasterio.enums import ColorInterp

import fifesim
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument


@pytest.fixture(scope="module")
def image(lai_values):
    """An image with a hole of missing data."""
    lai = lai_values.copy(deep=True)
    lai[18:27, 27:36] = np.nan
    return fifesim.surface_reflectance(lai, bands=["TM3", "TM4"]).fifesim.to_toa().fifesim.sense("TM")


def test_large_geotiff_has_overviews(tmp_path):
    grid = fifesim.fife_site(10.0, window=((0, 1100), (0, 1100)))
    values = da.ones(tuple(grid.shape), chunks=400, dtype=np.float32)
    raster = grids.place(xr.DataArray(values, dims=("y", "x"), name="lai"), grid)
    with rasterio.open(fifesim.to_geotiff(raster, tmp_path / "lai.tif")) as source:
        assert source.block_shapes == [(512, 512)]
        assert source.overviews(1) == [2, 4]
        assert source.dtypes == ("float32",)


def test_gdal_reads_location_bands_and_calibration(image, tmp_path):
    bands = instrument("TM").select(["TM3", "TM4"])
    with rasterio.open(fifesim.to_geotiff(image, tmp_path / "tm.tif", tags={"PROJECT": "trial"})) as source:
        structure = source.tags(ns="IMAGE_STRUCTURE")
        assert (structure["LAYOUT"], structure["COMPRESSION"]) == ("COG", "DEFLATE")
        np.testing.assert_array_equal(source.read(), image)
        assert source.crs.to_epsg() == 26914
        np.testing.assert_allclose(source.transform, grids.geobox(image).affine, rtol=0, atol=1e-6)
        assert source.descriptions == ("TM3", "TM4")
        assert source.units == ("W m-2 sr-1 um-1",) * 2
        assert source.nodatavals == (0, 0)
        for number, band in enumerate(bands, 1):
            gain = (band.full_scale_radiance - band.min_radiance) / 255
            assert source.scales[number - 1] == pytest.approx(gain, rel=1e-15)
            assert source.offsets[number - 1] == band.min_radiance
            wavelength = float(source.tags(number, ns="IMAGERY")["CENTRAL_WAVELENGTH_UM"])
            assert wavelength == pytest.approx(band.wavelength, rel=1e-8)
        tags = source.tags()
        kept = json.loads(tags["FIFESIM"])
        assert kept["dims"] == ["band", "y", "x"] and tags["PROJECT"] == "trial"
        assert kept["coords"]["solar_irradiance"]["values"] == image["solar_irradiance"].values.tolist()
        assert float(tags["sza"]) == float(image["sza"])
        assert tags["atmosphere"] == image.attrs["atmosphere"] and tags["instrument"] == "TM"
        assert tags["history"].count("\n") == image.attrs["history"].count("\n")
        assert tags["AREA_OR_POINT"] == "Area"


@pytest.mark.parametrize("name", ["image", "radiance", "reflectance", "ndvi", "lai", "one-band", "single-precision"])
@pytest.mark.parametrize("chunks", [None, {"y": 2, "x": 4}], ids=["eager", "chunked"])
def test_raster_survives_a_round_trip(image, lai, tmp_path, name, chunks):
    raster = {
        "image": image,
        "radiance": fifesim.sensor.to_radiance(image),
        "reflectance": fifesim.to_reflectance(image),
        "ndvi": fifesim.ndvi(image),
        "lai": lai,
        "one-band": image.sel(band=["TM4"]),
        "single-precision": fifesim.ndvi(image).astype(np.float32),
    }[name]
    if chunks and name == "lai":
        # The LAI raster has more rows and columns than the image.
        chunks = {"y": 20, "x": 17}
    path = tmp_path / "raster.tif"
    fifesim.to_geotiff(raster if chunks is None else in_chunks(raster, ODD_CHUNKS | {"band": 1}), path)
    with no_compute():
        again = fifesim.open_image(path, chunks=chunks)
    assert (again.chunks is None) == (chunks is None)
    xr.testing.assert_identical(again.compute(), raster)
    assert again.dtype == raster.dtype
    assert grids.same_grid(grids.geobox(again), grids.geobox(raster))


def test_attributes_and_times_unknown_to_json_survive_a_round_trip(image, tmp_path):
    odd = image.assign_coords(time=np.datetime64("1987-06-06T16:35:00", "ns"))
    odd.attrs |= {"text": 'quotes " and\nlines, \N{MICRO SIGN}', "number": np.float32(0.5), "count": np.int64(3)}
    again = fifesim.open_image(fifesim.to_geotiff(odd, tmp_path / "tm.tif", tags={"PROJECT": "trial"}))
    xr.testing.assert_identical(again, odd)


def test_variables_of_a_dataset_become_bands(lai, tmp_path):
    truth = xr.Dataset({"lai": fifesim.aggregate(lai), "fpar": fifesim.aggregate(fifesim.fpar(lai))})
    path = truth.fifesim.to_geotiff(tmp_path / "truth.tif")
    with rasterio.open(path) as source:
        assert source.descriptions == ("lai", "fpar")
        assert math.isnan(source.nodata)
    again = fifesim.open_image(path)
    assert again["band"].values.tolist() == ["lai", "fpar"]
    for name in truth:
        np.testing.assert_array_equal(again.sel(band=name), truth[name])


@pytest.mark.parametrize("before", [None, "kept"])
def test_failed_write_leaves_the_folder_unchanged(image, tmp_path, before):
    """Chunks other than the first cannot be computed."""

    def refuse(block, block_info=None):
        if block_info[0]["chunk-location"] != (0, 0, 0):
            raise RuntimeError("disk on fire")
        return block

    path, lazy = tmp_path / "tm.tif", in_chunks(image, {"y": 2})
    lazy = lazy.copy(data=lazy.data.map_blocks(refuse, dtype=image.dtype))
    if before:
        path.write_text(before)
    with pytest.raises(RuntimeError, match="disk on fire"):
        fifesim.to_geotiff(lazy, path, overwrite=True)
    assert [each.name for each in tmp_path.iterdir()] == (["tm.tif"] if before else [])
    assert not before or path.read_text() == before


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("vza", 20.0, "lacks vza, which vary by cell.* give geometry="),
        ("date", np.datetime64("1987", "ns"), "lacks date"),
    ],
)
def test_coordinates_omitted_from_a_geotiff_give_a_warning(image, tmp_path, name, value, said):
    swath = image.assign_coords({name: (("y", "x"), np.full(image.shape[1:], value))})
    with pytest.warns(UserWarning, match=said):
        fifesim.to_geotiff(swath, tmp_path / "swath.tif")


def test_reflectance_next_to_digital_numbers_is_written_without_their_calibration(whole, tmp_path):
    """As in a dataset of chips, where the calibration is a coordinate of all variables."""
    toa = whole["toa"].assign_coords(gain=("band", [0.5, 0.5]), offset=("band", [1.0, 1.0]))
    again = fifesim.open_image(toa.fifesim.to_geotiff(tmp_path / "toa.tif"))
    np.testing.assert_array_equal(again, toa)
    assert "gain" not in again.coords
    with rasterio.open(tmp_path / "toa.tif") as source:
        assert source.scales == (1.0, 1.0)


def test_objects_that_are_no_raster_are_rejected(image, lai, tmp_path):
    with pytest.raises(ValueError, match="no CRS"):
        fifesim.to_geotiff(lai.drop_vars("spatial_ref"), tmp_path / "lai.tif")
    with pytest.raises(ValueError, match=r"holds dimensions \(band, y, x\), got"):
        fifesim.to_geotiff(image.expand_dims(time=2), tmp_path / "tm.tif")
    for overwrite in (False, True):
        with pytest.raises(IsADirectoryError, match="is a folder: give the name of a file"):
            image.fifesim.to_geotiff(tmp_path, overwrite=overwrite)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["netcdf", "zarr"])
@pytest.mark.parametrize("name", ["image", "lai", "reflectance"])
def test_netcdf_and_zarr_keep_crs_and_names(image, lai, tmp_path, kind, name):
    raster = {"image": image, "lai": lai, "reflectance": fifesim.to_reflectance(image)}[name]
    path = tmp_path / name
    if kind == "netcdf":
        raster.to_netcdf(path)
        opened = xr.open_dataset(path, decode_coords="all", mask_and_scale=False)
    else:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", "The data type .* does not have a Zarr V3 spec")
            raster.to_dataset().to_zarr(path, consolidated=False)
        opened = xr.open_zarr(path, decode_coords="all", mask_and_scale=False, consolidated=False)
    with opened:
        again = opened[raster.name].load()
    assert again.encoding["grid_mapping"] == "spatial_ref" and again.rio.crs == raster.rio.crs
    assert cf.attributes(raster.name).items() <= again.attrs.items()
    assert grids.same_grid(grids.geobox(again), grids.geobox(raster))
    np.testing.assert_array_equal(again, raster)
    for coordinate in raster.coords:
        np.testing.assert_array_equal(again[coordinate], raster[coordinate])
        assert raster[coordinate].attrs.items() <= again[coordinate].attrs.items()
    if name == "image":
        np.testing.assert_array_equal(again.fifesim.ndvi(), image.fifesim.ndvi())
    if (name, kind) == ("image", "netcdf"):
        # By default xarray masks the fill value and converts the counts to floating point.
        with xr.open_dataset(path, decode_coords="all") as masked:
            np.testing.assert_array_equal(masked["dn"].fifesim.ndvi(), image.fifesim.ndvi())


@pytest.mark.parametrize(
    ("dtype", "stored", "nodata", "scale", "value"),
    [("float32", 0.25, -9999, 1.0, 0.25), ("uint16", 2500, 65535, 1e-4, 0.25), ("int16", 2500, None, 1e-4, 0.25)],
)
def test_external_values_are_masked_and_scaled(tmp_path, dtype, stored, nodata, scale, value):
    """Without masking and scaling, stored counts or -9999 would be processed as reflectance."""
    path = tmp_path / "theirs.tif"
    profile = {"driver": "GTiff", "width": 4, "height": 3, "count": 1, "dtype": dtype, "crs": "EPSG:26914"}
    transform = rasterio.transform.from_origin(705000, 4334100, 30, 30)
    values = np.full((3, 4), stored, dtype)
    if nodata is not None:
        values[0, 0] = nodata
    with rasterio.open(path, "w", **profile, nodata=nodata, transform=transform) as sink:
        sink.write(values, 1)
        sink.scales = [scale]
    for chunks in (None, {}):
        found = fifesim.open_image(path, chunks=chunks)
        assert (found.chunks is not None) == (chunks is not None)
        np.testing.assert_allclose(found[0, 1], value, rtol=1e-7)
        assert np.isnan(found[0, 0, 0]) == (nodata is not None)
        assert "gain" not in found.coords


@pytest.mark.parametrize(
    ("dtype", "attrs", "nodata"),
    [
        (np.uint8, {"_FillValue": 220, "scale_factor": 0.1}, 220),
        (np.int16, {"nodata": -3}, -3),
        (np.float32, {"_FillValue": -3.0}, -3),
        (np.float32, {"_FillValue": np.nan}, None),
        (np.uint8, {"_FillValue": -9999}, None),
        (np.uint8, {}, None),
    ],
)
def test_nodata_value_is_taken_from_the_raster(tmp_path, dtype, attrs, nodata):
    """A mask of zeros and ones has no cell without data."""
    grid = fifesim.grid_at("EPSG:32614", 705000.0, 4334000.0, 120.0, 90.0, 30.0)
    values = np.arange(-3, 9).reshape(3, 4).astype(dtype)
    raster = grids.place(xr.DataArray(values, dims=("y", "x"), name="own", attrs=attrs), grid)
    path = fifesim.to_geotiff(raster, tmp_path / "own.tif")
    with rasterio.open(path) as source:
        # Floating-point rasters have NaN by default.
        assert source.nodata == nodata or np.isnan(attrs["_FillValue"])
    again = fifesim.open_image(path)
    assert again.equals(raster)
    assert again.attrs == {key: value for key, value in attrs.items() if value == value}


def test_file_and_its_gdal_sidecar_are_replaced_only_with_overwrite(image, tmp_path):
    """A GIS writes statistics and band names to a sidecar file, which would hide the new ones."""
    path = fifesim.to_geotiff(image, tmp_path / "image.tif")
    before, stale = path.read_bytes(), "<PAMRasterBand band='1'><Description>stale</Description></PAMRasterBand>"
    (tmp_path / "image.tif.aux.xml").write_text(f"<PAMDataset>{stale}</PAMDataset>")
    with pytest.raises(FileExistsError, match=r"there is a file .*image.tif: type overwrite=True"):
        fifesim.to_geotiff(image[::-1], path)
    with rasterio.open(path) as source:
        assert path.read_bytes() == before and source.descriptions[0] == "stale"
    fifesim.to_geotiff(image[::-1], path, overwrite=True)
    with rasterio.open(path) as source:
        assert source.descriptions[0] == str(image["band"].values[1])
    np.testing.assert_array_equal(fifesim.open_image(path), image[::-1])


def test_single_selected_band_keeps_its_calibration(image, tmp_path):
    name = str(image["band"].values[1])
    one = image.sel(band=name)
    again = fifesim.open_image(one.fifesim.to_geotiff(tmp_path / "one.tif"))
    assert again.sizes["band"] == 1 and again["band"].item() == name
    assert again.identical(image.sel(band=[name]))
    assert np.array_equal(again.fifesim.to_radiance()[0], image.fifesim.to_radiance()[1], equal_nan=True)


@pytest.fixture(scope="module")
def toa(lai_values):
    return fifesim.surface_reflectance(lai_values, bands=["TM2", "TM3", "TM4", "TM1", "TM7"]).fifesim.to_toa()


@pytest.mark.parametrize("bands", [["TM2", "TM3", "TM4"], ["TM3", "TM2", "TM1"], ["TM4"], ["TM7"], ["TM7", "TM1"]])
@pytest.mark.parametrize("dtype", ["uint8", "float64"])
def test_colour_interpretation_follows_the_wavelength(toa, tmp_path, bands, dtype):
    """TM2, TM3 and TM4 are green, red and near infrared, in any order."""
    image = toa.sel(band=bands)
    image = image.fifesim.sense("TM") if dtype == "uint8" else image
    near = ColorInterp.nir if hasattr(ColorInterp, "nir") else ColorInterp.undefined
    known = {"TM1": ColorInterp.blue, "TM2": ColorInterp.green, "TM3": ColorInterp.red, "TM4": near}
    expected = [known.get(name, ColorInterp.undefined) for name in bands]
    expected = [ColorInterp.gray] if bands == ["TM7"] else expected
    with rasterio.open(fifesim.to_geotiff(image, tmp_path / "image.tif")) as source:
        assert list(source.colorinterp) == expected


def test_time_sun_and_view_are_tags(toa, tmp_path):
    def tags_of(raster):
        with rasterio.open(fifesim.to_geotiff(raster, tmp_path / "image.tif", overwrite=True)) as source:
            return source.tags(), source.tags(ns="IMAGERY")

    image = toa.fifesim.sense("TM").assign_coords(time=np.datetime64("1987-06-06T16:35:00.25", "ns"))
    (timeless, other), (tags, imagery) = map(tags_of, (toa.isel(band=0), image))
    assert "TIFFTAG_DATETIME" not in timeless and "ACQUISITIONDATETIME" not in other
    assert tags["TIFFTAG_DATETIME"] == "1987:06:06 16:35:00"
    assert imagery["ACQUISITIONDATETIME"] == "1987-06-06 16:35:00"
    assert float(tags["SUN_ELEVATION"]) == pytest.approx(90 - float(image.sza), abs=1e-6)
    assert float(tags["SUN_AZIMUTH"]) == pytest.approx(float(image.saa), abs=1e-6)
    assert (tags["VIEW_ZENITH"], float(tags["sza"])) == ("0", float(image.sza))
