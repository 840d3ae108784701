"""The contact sheet shows what it says."""

import numpy as np
import pytest
import xarray as xr

from fifesim.output.chips.datasheet import contact_sheet
from fifesim.output.colours import dark_and_bright


def dataset_of(bands, wavelengths, names=("lai", "fpar"), chips=7):
    generator = np.random.default_rng(0)
    rasters = {name: (("chip", "y", "x"), generator.random((chips, 5, 4))) for name in (*names, "ndvi")}
    reflectance = ("chip", "band", "y", "x"), generator.random((chips, len(bands), 5, 4))
    split = ["test", "train", "train", "train", "train", "train", "test"][:chips]
    coordinates = {"band": list(bands), "wavelength": ("band", list(wavelengths)), "split": ("chip", split)}
    return xr.Dataset(rasters | {"toa_reflectance": reflectance}, coords=coordinates)


def test_a_few_chips_of_each_part_in_its_order():
    figure = contact_sheet(dataset_of(["TM3", "TM4"], [0.66, 0.84]), ["train", "validation", "test"])
    titles = [axis.get_title() for axis in figure.axes if axis.get_title()]
    assert titles == ["train\nchip 1", "\nchip 2", "\nchip 3", "\nchip 4", "test\nchip 0", "\nchip 6"]
    labels = [axis.get_ylabel() for axis in figure.axes if axis.get_ylabel()]
    assert labels == ["NDVI\nof the image", "LAI", "FPAR"]


def test_a_row_shares_its_colours():
    figure = contact_sheet(dataset_of(["TM3", "TM4"], [0.66, 0.84]), ["train", "test"])
    images = [axis.images[0] for axis in figure.axes if axis.images and axis.images[0].get_array().ndim == 2]
    limits = {image.get_clim() for image in images[:6]}
    assert len(limits) == 1


@pytest.mark.parametrize(
    ("bands", "wavelengths", "said"),
    [
        (["B03", "B04", "B08"], [0.56, 0.66, 0.84], "image: B08,\nB04,\nB03"),
        (["TM3", "TM4"], [0.66, 0.84], "NDVI\nof the image"),
    ],
)
def test_colours_are_those_of_the_report(bands, wavelengths, said):
    assert contact_sheet(dataset_of(bands, wavelengths), ["train"]).axes[0].get_ylabel() == said


def test_one_band_is_grey():
    figure = contact_sheet(dataset_of(["TM5"], [1.65]).drop_vars("ndvi"), ["train"])
    assert figure.axes[0].get_ylabel() == "image: TM5"
    picture = figure.axes[0].images[0].get_array()
    np.testing.assert_array_equal(picture[..., 0], picture[..., 2])


def test_without_a_green_band_the_image_is_its_ndvi():
    dataset = dataset_of(["TM3", "TM4"], [0.66, 0.84])
    picture = contact_sheet(dataset, ["test"]).axes[0].images[0]
    np.testing.assert_array_equal(picture.get_array(), dataset["ndvi"][0])
    assert picture.get_cmap().name == "viridis"


def test_a_band_is_stretched_as_in_a_report():
    dataset = dataset_of(["TM2", "TM3", "TM4"], [0.56, 0.66, 0.84])
    red = dataset["toa_reflectance"].sel(band="TM3").isel(chip=[0, 6])
    dark, bright = dark_and_bright(red.values.ravel())
    picture = contact_sheet(dataset, ["test"]).axes[0].images[0].get_array()
    np.testing.assert_allclose(picture[..., 1], ((red[0] - dark) / (bright - dark)).clip(0, 1), rtol=0, atol=1e-12)


def test_pixels_without_data_are_clear():
    dataset = dataset_of(["TM2", "TM3", "TM4"], [0.56, 0.66, 0.84])
    dataset["toa_reflectance"][1, 0, 2, 3] = np.nan
    picture = contact_sheet(dataset, ["train"]).axes[0].images[0].get_array()
    assert picture[2, 3, 3] == 0 and (np.delete(picture[..., 3].ravel(), 11) == 1).all()


def test_near_infrared_is_red():
    dataset = dataset_of(["TM2", "TM3", "TM4"], [0.56, 0.66, 0.84])
    dataset["toa_reflectance"][1, 2] = 0.0
    dataset["toa_reflectance"][1, 2, 0, 0] = 1.0
    picture = contact_sheet(dataset, ["train"]).axes[0].images[0].get_array()
    assert picture[0, 0, 0] > picture[1:, :, 0].max()
