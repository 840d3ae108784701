"""The datasheet describes the contents of a dataset."""

import html
import re

import numpy as np
import pytest
import xarray as xr

from fifesim.output.chips import datasheet
from fifesim.output.chips.datasheet import contact_sheet
from fifesim.output.colours import dark_and_bright

COUNT = 11


@pytest.fixture(scope="module")
def chips(chips_on):
    return chips_on(COUNT, draws={"distribution": {"choice": ["burned-grazed", "burned-ungrazed"]}})


@pytest.fixture(scope="module")
def dataset(chips):
    generator = np.random.default_rng(0)
    lai = generator.random((COUNT, 6, 6)).astype(np.float32)
    lai[:, 0, 0] = np.nan
    found = xr.Dataset({"lai": (("chip", "y", "x"), lai, {"long_name": "leaf area index", "units": "1"})})
    found = found.assign_coords(band=["TM3", "TM4"], split=("chip", chips.split))
    return found.assign_attrs(title="11 simulated chips")


def test_ranges_cover_all_chips(dataset, chips):
    (found,) = datasheet.ranges_of(dataset, 4).values()
    values = dataset["lai"].values.astype(float)
    assert (found["least"], found["greatest"]) == (np.nanmin(values), np.nanmax(values))
    assert found["mean"] == pytest.approx(np.nanmean(values), rel=1e-12)
    assert found["without"] == pytest.approx(1 / 36, rel=1e-12)
    for part in ("train", "validation", "test"):
        assert found["means"][part] == pytest.approx(np.nanmean(values[chips.split == part]), rel=1e-12)


@pytest.fixture(scope="module")
def page(dataset, chips):
    return datasheet.datasheet_page(dataset, chips, datasheet.ranges_of(dataset, 4), b"picture")


def test_page_lists_the_distributions_of_drawn_parameters(page, chips):
    for name in ("atmosphere.visibility", "ground.distribution", "ground.seed"):
        assert f"<code>{name}</code>" in page
    row = re.search(r"<code>atmosphere\.visibility</code>.*?</tr>", page, re.S)[0]
    column = chips.table()["atmosphere.visibility"].values
    assert "uniform, 10 to 60" in row and "km" in row
    assert all(f"{value:.4g}" in row for value in (column.min(), column.mean(), column.max()))
    assert "one of burned-grazed, burned-ungrazed" in page and "a scrambled Sobol sequence, seed 0" in page


def test_page_counts_chips_and_landscapes(page, chips):
    for part in ("train", "validation", "test"):
        row = re.search(rf"<tr><td>{part}</td>.*?</tr>", page, re.S)[0]
        numbers = [int(number) for number in re.findall(r'class="n">(\d+)<', row)]
        own = chips.split == part
        assert numbers == [len(set(chips.landscape[own].tolist())), int(own.sum())]


@pytest.mark.parametrize(("count", "said"), [(1, "<b>{} have none</b>"), (2, "<b>{} has none</b>"), (3, None)])
def test_page_explains_a_part_without_chips(count, said, dataset, chips_on):
    chips = chips_on(count)
    part = dataset.isel(chip=range(count))
    page = datasheet.datasheet_page(part, chips, datasheet.ranges_of(part, 4), b"")
    empty = [name for name in ("train", "validation", "test") if name not in chips.split]
    assert ("fewer chips than landscapes" in page) is bool(said)
    assert "none</b>" not in page if said is None else said.format(" and ".join(empty)) in page


def test_page_is_self_contained_and_has_the_study(page, chips):
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert chips.study.to_toml() in html.unescape(page)


def make_dataset(bands, wavelengths, names=("lai", "fpar"), chips=7):
    generator = np.random.default_rng(0)
    rasters = {name: (("chip", "y", "x"), generator.random((chips, 5, 4))) for name in (*names, "ndvi")}
    reflectance = ("chip", "band", "y", "x"), generator.random((chips, len(bands), 5, 4))
    split = ["test", "train", "train", "train", "train", "train", "test"][:chips]
    coordinates = {"band": list(bands), "wavelength": ("band", list(wavelengths)), "split": ("chip", split)}
    return xr.Dataset(rasters | {"toa_reflectance": reflectance}, coords=coordinates)


def test_contact_sheet_shows_a_few_chips_of_each_part_in_order():
    figure = contact_sheet(make_dataset(["TM3", "TM4"], [0.66, 0.84]), ["train", "validation", "test"])
    titles = [axis.get_title() for axis in figure.axes if axis.get_title()]
    assert titles == ["train\nchip 1", "\nchip 2", "\nchip 3", "\nchip 4", "test\nchip 0", "\nchip 6"]
    labels = [axis.get_ylabel() for axis in figure.axes if axis.get_ylabel()]
    assert labels == ["NDVI\nof the image", "LAI", "FPAR"]


def test_pixels_without_data_are_transparent():
    dataset = make_dataset(["TM2", "TM3", "TM4"], [0.56, 0.66, 0.84])
    dataset["toa_reflectance"][1, 0, 2, 3] = np.nan
    picture = contact_sheet(dataset, ["train"]).axes[0].images[0].get_array()
    assert picture[2, 3, 3] == 0 and (np.delete(picture[..., 3].ravel(), 11) == 1).all()


def test_false_colour_is_stretched_over_all_chips_as_in_a_report():
    dataset = make_dataset(["B03", "B04", "B08"], [0.56, 0.66, 0.84])
    near = dataset["toa_reflectance"].sel(band="B08").isel(chip=[0, 6])
    dark, bright = dark_and_bright(near.values.ravel())
    axis = contact_sheet(dataset, ["test"]).axes[0]
    assert axis.get_ylabel() == "image: B08,\nB04,\nB03"
    expected = ((near[0] - dark) / (bright - dark)).clip(0, 1)
    np.testing.assert_allclose(axis.images[0].get_array()[..., 0], expected, rtol=0, atol=1e-12)


def test_ndvi_is_shown_without_a_green_band_with_common_colours():
    dataset = make_dataset(["TM3", "TM4"], [0.66, 0.84])
    figure = contact_sheet(dataset, ["train", "test"])
    pictures = [axis.images[0] for axis in figure.axes[:6]]
    np.testing.assert_array_equal(pictures[4].get_array(), dataset["ndvi"][0])
    assert pictures[0].get_cmap().name == "viridis" and len({picture.get_clim() for picture in pictures}) == 1
