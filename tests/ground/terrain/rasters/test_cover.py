"""What is said of an elevation model that does not cover a grid, or lies in terraces."""

import re
import warnings

import numpy as np
import pytest
import rioxarray
from elevations import AMPLITUDE, NORTH, WEST, grid, model, tilted, truth, with_hole, write

import fifesim


def test_model_that_ends_inside_the_grid_is_refused_by_how_much(path):
    beyond = grid(west=WEST + 700, north=NORTH - 900)
    with pytest.raises(ValueError, match="lacks up to") as error:
        fifesim.fine_dem(path, beyond)
    found = dict((side, float(metres)) for metres, side in re.findall(r"(\d+) m in the (\w+)", str(error.value)))
    assert found == {"south": pytest.approx(300, abs=20), "east": pytest.approx(100, abs=20)}
    with pytest.raises(
        ValueError, match=r"hills.tif holds no elevation on the grid.*it spans 707520 to .*latitude 39.1"
    ):
        fifesim.fine_dem(path, grid(west=WEST + 90000))


@pytest.mark.parametrize(("east", "south"), [(700, 900), (-700, -800), (650, 0)])
def test_model_that_ends_inside_the_grid_says_what_it_covers(path, east, south):
    """What it names is covered, and a pixel of 30 m more is not."""
    with pytest.raises(ValueError, match="it covers west=") as error:
        fifesim.fine_dem(path, grid(west=WEST + east, north=NORTH - south))
    found = re.search(r"west=(\S+), north=(\S+), width=(\S+), height=(\S+?)(;|$)", str(error.value)).groups()[:4]
    west, north, width, height = map(float, found)
    dem = fifesim.fine_dem(path, fifesim.grid_at("EPSG:26914", west, north, width, height, 30 / 9))
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=0.1 * AMPLITUDE)
    more = {"east": (west, width + 30), "west": (west - 30, width + 30)}["east" if east > 0 else "west"]
    with pytest.raises(ValueError, match="does not cover"):
        fifesim.fine_dem(path, fifesim.grid_at("EPSG:26914", more[0], north, more[1], height, 30 / 9))


def test_hole_is_refused_by_its_place_and_size(tmp_path):
    where = with_hole(tmp_path)
    with pytest.raises(ValueError, match=r"a hole of (\d+) x (\d+) m at (\d+) E (\d+) N: fill=(\d+)") as error:
        fifesim.fine_dem(where, grid())
    tall, wide, east, north, fill = map(
        float, re.findall(r"a hole of (\d+) x (\d+) m at (\d+) E (\d+) N: fill=(\d+)", str(error.value))[0]
    )
    assert (tall, wide) == (pytest.approx(90, abs=16), pytest.approx(120, abs=16))
    assert east == pytest.approx(WEST - 600 + 30 * 30, abs=20)
    assert north == pytest.approx(NORTH + 600 - 31.5 * 30, abs=20)
    dem = fifesim.fine_dem(where, grid(), fill=fill)
    np.testing.assert_allclose(dem, truth(dem), rtol=0, atol=0.1 * AMPLITUDE)


def test_hole_too_large_to_fill_is_refused(tmp_path):
    with pytest.raises(ValueError, match="a hole of"):
        fifesim.fine_dem(with_hole(tmp_path, 12, 12), grid(), fill=60)


def test_lazy_array_tells_of_its_hole_when_computed(tmp_path):
    raster = rioxarray.open_rasterio(with_hole(tmp_path), masked=True, chunks={"y": 20, "x": 20})
    dem = fifesim.fine_dem(raster, grid())
    with pytest.raises(ValueError, match="a hole of"):
        dem.compute()


def test_terraces_of_whole_numbers_are_warned_of(tmp_path, path):
    def gentle(x, y):
        return np.rint(tilted(x, y) / 10)

    with pytest.warns(UserWarning, match="vertical resolution of 1 m"):
        fifesim.fine_dem(write(tmp_path / "steps.tif", *model(gentle)), grid())
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        fifesim.fine_dem(path, grid())


def test_marks_of_no_data_are_no_heights(tmp_path):
    """An undeclared -9999 is below all land."""
    values, affine = model()
    values[25, 25] = -9999.0
    where = write(tmp_path / "marked.tif", values, affine, nodata=-1.0)
    with pytest.raises(ValueError, match=r"holds elevations such as -\d+ m, land has -500 to 9000 m"):
        fifesim.fine_dem(where, grid())
