"""What a run writes, as other programs open it: in the right place, with the right values."""

import json

import numpy as np
import pytest
import rasterio
import rioxarray
import xarray as xr

import fifesim

# Corner and size of the run, as its scenario says them. [m]
WEST, NORTH, PIXEL, ROWS, COLUMNS = 704970.0, 4334220.0, 30.0, 20, 30


def radiance(folder):
    return fifesim.to_radiance(fifesim.open_image(folder / "image.tif"))


def check_place(array):
    """Centres of pixels, to the millimetre."""
    np.testing.assert_allclose(array["x"], WEST + PIXEL * (np.arange(COLUMNS) + 0.5), rtol=0, atol=1e-3)
    np.testing.assert_allclose(array["y"], NORTH - PIXEL * (np.arange(ROWS) + 0.5), rtol=0, atol=1e-3)
    assert array.rio.crs.to_epsg() == 26914


def test_gdal_opens_them_in_the_right_place(travelled):
    for name in ("image.tif", "truth.tif"):
        with rasterio.open(travelled / name) as source:
            assert (source.crs.to_epsg(), tuple(source.bounds)) == (26914, (WEST, NORTH - 600, WEST + 900, NORTH))
    with rasterio.open(travelled / "image.tif") as source:
        gains, offsets = (np.array(each)[:, None, None] for each in (source.scales, source.offsets))
        np.testing.assert_allclose(source.read() * gains + offsets, radiance(travelled), rtol=1e-12)


@pytest.mark.parametrize("name", ["image.tif", "truth.tif"])
def test_rio_cogeo_finds_them_cloud_optimised(travelled, name):
    cogeo = pytest.importorskip("rio_cogeo")
    valid, errors, warnings = cogeo.cog_validate(travelled / name, strict=True)
    assert valid, (errors, warnings)


def test_engine_rasterio_of_xarray_masks_and_scales(travelled):
    with xr.open_dataset(
        travelled / "image.tif", engine="rasterio", band_as_variable=True, mask_and_scale=True
    ) as found:
        check_place(found)
        for number, band in enumerate(("TM2", "TM3", "TM4"), 1):
            expected = radiance(travelled).sel(band=band)
            # rioxarray computes in single precision, where the counts are of 8 bits.
            np.testing.assert_allclose(found[f"band_{number}"], expected, rtol=1e-6)
            assert found[f"band_{number}"].attrs["long_name"] == band


def test_rioxarray_opens_what_the_item_names(travelled):
    found = json.loads((travelled / "item.json").read_text(encoding="utf-8"))
    image = rioxarray.open_rasterio(travelled / found["assets"]["image"]["href"])
    check_place(image)
    bands = found["assets"]["image"]["bands"]
    gain, offset = (np.array([band[key] for band in bands])[:, None, None] for key in ("raster:scale", "raster:offset"))
    np.testing.assert_allclose(image.where(image != bands[0]["nodata"]) * gain + offset, radiance(travelled))


def test_odc_stac_loads_the_item(travelled):
    stac = pytest.importorskip("odc.stac")
    pystac = pytest.importorskip("pystac")
    item = pystac.Item.from_file(str(travelled / "item.json"))
    found = stac.load([item]).isel(time=0)
    check_place(found)
    assert found["time"].values == np.datetime64("1987-06-06T16:35:00")
    image, truth = (fifesim.open_image(travelled / name) for name in ("image.tif", "truth.tif"))
    for name in ("TM2", "TM3", "TM4"):
        np.testing.assert_array_equal(found[name], image.sel(band=name))
        assert (found[name].dtype, found[name].attrs["nodata"]) == ("uint8", 0)
    for name in ("lai", "fpar"):
        np.testing.assert_array_equal(found[name], truth.sel(band=name))
        assert np.isnan(found[name].attrs["nodata"])
    by_number = stac.load([item], bands=["image.2"]).isel(time=0)
    np.testing.assert_array_equal(by_number["image.2"], found["TM3"])


@pytest.mark.parametrize("names", [["TM3"], ["red", "nir"], ["lai"]])
def test_odc_stac_loads_bands_by_name(travelled, names):
    stac = pytest.importorskip("odc.stac")
    pystac = pytest.importorskip("pystac")
    found = stac.load([pystac.Item.from_file(str(travelled / "item.json"))], bands=names).isel(time=0)
    files = {"TM3": ("image", "TM3"), "red": ("image", "TM3"), "nir": ("image", "TM4"), "lai": ("truth", "lai")}
    for name in names:
        file, band = files[name]
        np.testing.assert_array_equal(found[name], fifesim.open_image(travelled / f"{file}.tif").sel(band=band))


def test_gdal_opens_the_cells_with_their_crs(travelled):
    """The wheels of rasterio bring the driver; a cell is a ninth of a pixel."""
    with rasterio.Env() as env:
        if "Zarr" not in env.drivers():
            pytest.skip("this GDAL has no driver for Zarr")
    with xr.open_zarr(travelled / "scene.zarr", decode_coords="all") as cells:
        lai, reflectance = cells["lai"].values, cells["surface_reflectance"].values
    with rasterio.open(f'ZARR:"{travelled}/scene.zarr":/lai') as source:
        assert source.crs.to_epsg() == 26914
        np.testing.assert_allclose(source.bounds, (WEST, NORTH - 600, WEST + 900, NORTH), rtol=0, atol=1e-6)
        np.testing.assert_array_equal(source.read(1), lai)
    with rasterio.open(f'ZARR:"{travelled}/scene.zarr":/surface_reflectance') as source:
        assert source.crs.to_epsg() == 26914 and np.isnan(source.nodata)
        np.testing.assert_array_equal(source.read(), reflectance)
