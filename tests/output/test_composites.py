"""Colours of an image."""

import dask
import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, in_chunks

import fifesim
from fifesim.grids import grid as grids
from fifesim.output.maps import composite_bands, rgb, thinned, valid

GRID = fifesim.grid_at("EPSG:26914", 705000.0, 4334000.0, 1200.0, 900.0, 30.0)
WAVELENGTHS = {"B2": 0.48, "B3": 0.56, "B4": 0.66, "B8": 0.84}


def image(bands=tuple(WAVELENGTHS), dtype=float):
    values = np.random.default_rng(4).uniform(1, 200, (len(bands), 30, 40)).astype(dtype)
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"band": list(bands)})
    array = array.assign_coords(wavelength=("band", [WAVELENGTHS[name] for name in bands]), sza=30.0)
    return grids.place(array, GRID).assign_attrs(instrument="MSI")


def test_colours_are_percentiles_of_the_bands():
    array = image()
    found = rgb(array, stretch=(10, 80))
    assert found.dims == ("y", "x", "rgb") and found["rgb"].values.tolist() == ["red", "green", "blue"]
    for colour, name in zip(("red", "green", "blue"), ("B8", "B4", "B3"), strict=True):
        band = array.sel(band=name).values
        low, high = np.percentile(band, (10, 80))
        expected = np.clip((band - low) / (high - low), 0, 1)
        np.testing.assert_allclose(found.sel(rgb=colour), expected, rtol=0, atol=1e-7)
    assert found.attrs["long_name"] == "B8, B4, B3 as red, green, blue"
    assert found.rio.crs.to_epsg() == 26914
    # xarray makes its titles of scalars.
    assert not {"sza", "band", "wavelength"} & set(found.coords)


def test_composites_name_their_bands():
    assert composite_bands(image(), "natural colour") == ["B4", "B3", "B2"]
    assert composite_bands(image(), ("B2", "B8", "B8")) == ["B2", "B8", "B8"]
    assert composite_bands(image(("B4", "B8"))) == ["B8", "B4", "B4"]


@pytest.mark.parametrize(
    ("bands", "composite", "message"),
    [
        (("B4", "B8"), "natural colour", "natural colour needs a green and a blue band, the image has B4, B8"),
        (("B3", "B4"), "false colour", "false colour needs a near infrared band"),
        (("B3", "B4"), "colour", "composite must be 'false colour' or 'natural colour', or the names of three bands"),
        (("B3", "B4"), ("B3", "B4", "B9"), "a composite is of three of the bands B3, B4"),
        (("B3", "B4"), ("B3", "B4"), "a composite is of three of the bands B3, B4"),
    ],
)
def test_bands_that_are_missing_are_named(bands, composite, message):
    with pytest.raises(ValueError, match=message):
        rgb(image(bands), composite)


def test_bands_that_are_numbers_are_named_by_them():
    numbered = image().assign_coords(band=[2, 3, 4, 8])
    found = rgb(numbered, (8, 4, 3))
    np.testing.assert_array_equal(found, rgb(image(), ("B8", "B4", "B3")))
    assert found.attrs["long_name"] == "8, 4, 3 as red, green, blue"
    np.testing.assert_array_equal(rgb(numbered), found)


def test_other_mistakes_are_named():
    with pytest.raises(ValueError, match="stretch must be two percentiles"):
        rgb(image(), stretch=(98, 2))
    with pytest.raises(ValueError, match="along a dimension band"):
        rgb(image().isel(band=0))
    with pytest.raises(ValueError, match=r"has no wavelength .*composite=\('\w+', '\w+', '\w+'\)"):
        rgb(image().drop_vars("wavelength"))


def test_no_data_have_no_colour():
    array = image(dtype=np.uint8)
    array[2, 3, 4] = 0
    found = rgb(array)
    assert found[3, 4].isnull().all() and int(found.isnull().sum()) == 3
    assert np.isnan(valid(array.isel(band=2)).values[3, 4])
    other = array.isel(band=0).assign_attrs(_FillValue=array.values[0, 1, 1])
    assert np.isnan(valid(other).values[1, 1])


def test_a_band_without_contrast_is_grey():
    array = image()
    array[3] = 7.0
    assert (rgb(array).sel(rgb="red") == 0.5).all()


def test_colours_of_a_lazy_image_are_lazy_and_the_same():
    array = image()
    read = []
    lazy = in_chunks(array, CHUNKS)
    lazy = lazy.copy(data=lazy.data.map_blocks(lambda block: read.append(1) or block, meta=np.empty((0, 0, 0))))
    found = rgb(lazy)
    assert found.chunks is not None
    # Colours are stretched between limits of the whole image, which is read once for them; no pixel is kept.
    limits = len(read)
    assert limits == lazy.data.npartitions
    with dask.config.set(scheduler="synchronous"):
        xr.testing.assert_identical(found.compute(), rgb(array))


def test_a_large_raster_is_thinned_from_the_middle_of_its_blocks():
    array = xr.DataArray(np.arange(12.0)[:, None] * np.ones(7), dims=("y", "x"))
    assert thinned(array, 12) is array
    few = thinned(array, 4)
    assert few.shape == (4, 2) and few[:, 0].values.tolist() == [1, 4, 7, 10]
    assert thinned(array.rename(y="line", x="sample"), 4).sizes == {"line": 4, "sample": 2}
