"""Maps of a page show the values at their places, in the colours that their bars say."""

import io

import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

import fifesim
from fifesim.output.maps import encoded, false_colour_names, image_map, relief_map, stretch_of, value_map


@pytest.fixture(scope="module")
def lai():
    grid = fifesim.fife_site(cell=10.0, window=((0, 30), (0, 60)))
    return fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=1)


@pytest.fixture(scope="module")
def dn(lai):
    rho = lai.fifesim.surface_reflectance("TM", bands=["TM2", "TM3", "TM4"])
    return rho.fifesim.to_toa().fifesim.sense(fifesim.instrument("TM", response="paper")).compute()


@pytest.mark.parametrize(
    ("low", "high", "texts"),
    [
        (0.2, 1.1, ["0.25", "0.50", "0.75", "1.00"]),
        (0.1, 0.9, ["0.2", "0.4", "0.6", "0.8"]),
        (-0.05, 0.05, ["−0.050", "−0.025", "0.000", "0.025", "0.050"]),
        (340.0, 440.0, ["350", "375", "400", "425"]),
    ],
)
def test_numbers_of_a_bar_have_the_digits_that_they_need(lai, low, high, texts):
    bar = value_map(lai, "leaves", limits=(low, high)).bar
    assert [text for _, text in bar.ticks] == texts
    for place, text in bar.ticks:
        assert place == pytest.approx(100 * (float(text.replace("−", "-")) - low) / (high - low))


def test_colours_are_those_of_the_bar(lai):
    """A value at the low end has the first stop, one beyond the high end the last, and no data is grey."""
    values = lai.copy(data=np.linspace(0.0, 4.0, lai.size).reshape(lai.shape))
    values[5, 5] = np.nan
    found = value_map(values, "leaves", limits=(0.0, 2.0))
    first, last = (
        tuple(int(stop[at : at + 2], 16) for at in (1, 3, 5)) for stop in (found.bar.stops[0], found.bar.stops[-1])
    )
    assert tuple(found.pixels[0, 0]) == first and tuple(found.pixels[-1, -1]) == last
    assert len(set(found.pixels[5, 5])) == 1
    middle = np.array(colormaps["YlGn"](0.5, bytes=True)[:3], int)
    row, column = divmod(int(np.argmin(np.abs(np.nan_to_num(values.values, nan=9) - 1.0))), lai.shape[1])
    assert np.abs(found.pixels[row, column] - middle).max() <= 2
    assert dict((text, place) for place, text in found.bar.ticks)["1.0"] == pytest.approx(50.0)


def test_colours_diverge_from_their_middle(lai):
    found = value_map(lai - 10.0, "less", "RdBu", middle=0.0)
    assert dict((text, place) for place, text in found.bar.ticks)["0"] == pytest.approx(50.0)


def test_a_frame_lies_where_its_ground_is(lai):
    """The ground is 600 m wide and 300 m high; the right half of its lowest 90 m is marked."""
    part = fifesim.grids.grid.geobox(lai[21:, 30:]).boundingbox
    assert value_map(lai, "", frame=part).frame == pytest.approx((50.0, 70.0, 50.0, 30.0))
    assert value_map(lai, "").scale == (pytest.approx(100 / 6), "100 m")


def test_leaves_are_red_and_soil_is_not(dn):
    """The picture has near infrared as red: the pixel with the highest NDVI is the reddest by its share of red."""
    found = image_map(dn, "", stretch_of(dn)).pixels.astype(float)
    ndvi = dn.fifesim.ndvi().values
    red = found[..., 0] - found[..., 1:].mean(axis=-1)
    assert np.corrcoef(red.ravel(), ndvi.ravel())[0, 1] > 0.9
    assert false_colour_names(dn) == ["TM4", "TM3", "TM2"]


def test_an_image_without_green_is_grey(dn):
    two = dn.sel(band=["TM3", "TM4"])
    assert false_colour_names(two) == []
    pixels = image_map(two, "", stretch_of(two)).pixels
    assert (pixels[..., 0] == pixels[..., 2]).all()


def test_no_data_is_grey_in_an_image(dn):
    holed = dn.copy()
    holed[1, 2, 3] = 0
    pixels = image_map(holed, "", stretch_of(dn)).pixels
    assert (pixels[2, 3] == 217).all() and (pixels != 217).any()


def test_relief_is_lit_from_the_north_west(lai):
    """The side of a ridge that looks to the north-west is brighter than the other."""
    rows, columns = np.indices(lai.shape)
    ridge = lai.copy(data=-2.0 * np.abs(rows + columns - 44.0))
    shown = relief_map(ridge, "").pixels.astype(float).sum(axis=-1)
    assert shown[10, 20] > shown[15, 43]


@pytest.mark.parametrize(("size", "kind"), [(40, "PNG"), (400, "WEBP")])
def test_few_pixels_keep_their_edges(size, kind):
    pixels = np.zeros((size, size, 3), np.uint8)
    pixels[: size // 2] = 200
    picture = Image.open(io.BytesIO(encoded(pixels)))
    assert picture.format == kind and picture.size == (size, size)
    np.testing.assert_allclose(np.asarray(picture.convert("RGB"), int)[[2, -2]], pixels[[2, -2]], atol=4)
    assert Image.open(io.BytesIO(encoded(pixels, lossless=True))).format == "PNG"
