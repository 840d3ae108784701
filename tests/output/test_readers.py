"""Other programs open the files of a run at the right location and with the right values."""

import json

import numpy as np
import pytest
import rasterio
import rioxarray
import xarray as xr

import fifesim

# Corner and size of the run in the scenario [m].
WEST, NORTH, PIXEL, ROWS, COLUMNS = 704970.0, 4334220.0, 30.0, 20, 30


def run_radiance(folder):
    return fifesim.sensor.to_radiance(fifesim.open_image(folder / "image.tif"))


def check_location(array):
    """Check pixel centres to within a millimetre."""
    np.testing.assert_allclose(array["x"], WEST + PIXEL * (np.arange(COLUMNS) + 0.5), rtol=0, atol=1e-3)
    np.testing.assert_allclose(array["y"], NORTH - PIXEL * (np.arange(ROWS) + 0.5), rtol=0, atol=1e-3)
    assert array.rio.crs.to_epsg() == 26914


def test_gdal_opens_the_files_at_the_right_location(small_run):
    for name in ("image.tif", "truth.tif"):
        with rasterio.open(small_run / name) as source:
            assert (source.crs.to_epsg(), tuple(source.bounds)) == (26914, (WEST, NORTH - 600, WEST + 900, NORTH))
    with rasterio.open(small_run / "image.tif") as source:
        gains, offsets = (np.array(each)[:, None, None] for each in (source.scales, source.offsets))
        np.testing.assert_allclose(source.read() * gains + offsets, run_radiance(small_run), rtol=1e-12)


@pytest.mark.parametrize("name", ["image.tif", "truth.tif"])
def test_files_are_valid_cloud_optimised_geotiffs(small_run, name):
    cogeo = pytest.importorskip("rio_cogeo")
    valid, errors, warnings = cogeo.cog_validate(small_run / name, strict=True)
    assert valid, (errors, warnings)


def test_xarray_engine_rasterio_masks_and_scales(small_run):
    with xr.open_dataset(
        small_run / "image.tif", engine="rasterio", band_as_variable=True, mask_and_scale=True
    ) as found:
        check_location(found)
        for number, band in enumerate(("TM2", "TM3", "TM4"), 1):
            expected = run_radiance(small_run).sel(band=band)
            # rioxarray scales 8-bit counts in single precision.
            np.testing.assert_allclose(found[f"band_{number}"], expected, rtol=1e-6)
            assert found[f"band_{number}"].attrs["long_name"] == band


def test_rioxarray_opens_the_asset_of_the_item(small_run):
    found = json.loads((small_run / "item.json").read_text(encoding="utf-8"))
    image = rioxarray.open_rasterio(small_run / found["assets"]["image"]["href"])
    check_location(image)
    bands = found["assets"]["image"]["bands"]
    gain, offset = (np.array([band[key] for band in bands])[:, None, None] for key in ("raster:scale", "raster:offset"))
    np.testing.assert_allclose(image.where(image != bands[0]["nodata"]) * gain + offset, run_radiance(small_run))


def test_odc_stac_loads_the_item(small_run):
    stac = pytest.importorskip("odc.stac")
    pystac = pytest.importorskip("pystac")
    item = pystac.Item.from_file(str(small_run / "item.json"))
    found = stac.load([item]).isel(time=0)
    check_location(found)
    assert found["time"].values == np.datetime64("1987-06-06T16:35:00")
    image, truth = (fifesim.open_image(small_run / name) for name in ("image.tif", "truth.tif"))
    for name in ("TM2", "TM3", "TM4"):
        np.testing.assert_array_equal(found[name], image.sel(band=name))
        assert (found[name].dtype, found[name].attrs["nodata"]) == ("uint8", 0)
    for name in ("lai", "fpar"):
        np.testing.assert_array_equal(found[name], truth.sel(band=name))
        assert np.isnan(found[name].attrs["nodata"])
    for names in ({"image.2": "TM3"}, {"TM3": "TM3"}, {"red": "TM3", "nir": "TM4"}, {"lai": "lai"}):
        chosen = stac.load([item], bands=list(names)).isel(time=0)
        for name, band in names.items():
            np.testing.assert_array_equal(chosen[name], found[band])


def test_gdal_opens_the_cells_with_their_crs(small_run):
    """The wheels of rasterio include the Zarr driver; a cell is a ninth of a pixel wide."""
    with rasterio.Env() as env:
        if "Zarr" not in env.drivers():
            pytest.skip("this GDAL has no driver for Zarr")
    with xr.open_zarr(small_run / "scene.zarr", decode_coords="all") as cells:
        lai, reflectance = cells["lai"].values, cells["surface_reflectance"].values
    with rasterio.open(f'ZARR:"{small_run}/scene.zarr":/lai') as source:
        assert source.crs.to_epsg() == 26914
        np.testing.assert_allclose(source.bounds, (WEST, NORTH - 600, WEST + 900, NORTH), rtol=0, atol=1e-6)
        np.testing.assert_array_equal(source.read(1), lai)
    with rasterio.open(f'ZARR:"{small_run}/scene.zarr":/surface_reflectance') as source:
        assert source.crs.to_epsg() == 26914 and np.isnan(source.nodata)
        np.testing.assert_array_equal(source.read(), reflectance)
