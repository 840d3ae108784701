"""The grid that covers a file, in its own reference system or another."""

import numpy as np
import pyproj
import pytest
import rasterio
from affine import Affine

from fifesim.grids.opening import covering_grid

IN_DEGREES = Affine(0.0002, 0, -96.6, 0, -0.0002, 39.12)
IN_METRES = Affine(10, 0, 709003, 0, -10, 4332001)


def file(path, affine, crs):
    profile = {"driver": "GTiff", "height": 77, "width": 91, "count": 1, "dtype": "uint8"}
    with rasterio.open(path, "w", **profile, crs=crs, transform=affine):
        pass
    return path


@pytest.mark.parametrize(
    ("affine", "own", "asked", "epsg"),
    [
        (IN_DEGREES, 4326, None, 32614),
        (IN_METRES, 26914, None, 26914),
        (IN_METRES, 26914, "EPSG:26914", 26914),
        (IN_METRES, 26914, "EPSG:5070", 5070),
        (IN_DEGREES, 4326, "EPSG:32615", 32615),
    ],
)
def test_covering_grid_covers_the_file_in_whole_pixels(tmp_path, affine, own, asked, epsg):
    grid = covering_grid(file(tmp_path / "lai.tif", affine, own), 10 / 3, 30.0, asked)
    a, box = grid.affine, grid.boundingbox
    assert grid.crs.epsg == epsg
    assert a.c % 30 == 0 and a.f % 30 == 0 and grid.shape.x % 9 == 0 and grid.shape.y % 9 == 0
    corners = np.array([affine * corner for corner in [(0, 0), (91, 0), (0, 77), (91, 77)]])
    x, y = pyproj.Transformer.from_crs(own, epsg, always_xy=True).transform(*corners.T)
    assert box.left <= x.min() < box.left + 31 and box.right - 31 < x.max() <= box.right
    assert box.bottom <= y.min() < box.bottom + 31 and box.top - 31 < y.max() <= box.top


@pytest.mark.parametrize(
    ("crs", "said"), [("EPSG:4326", "must be projected"), ("EPSG:2193", "EPSG:2193"), ("EPSG:3857", "the scale of")]
)
def test_a_reference_system_in_which_no_map_is_made_is_refused(tmp_path, crs, said):
    with pytest.raises(ValueError, match=said) as caught:
        covering_grid(file(tmp_path / "lai.tif", IN_METRES, 26914), 10.0, 30.0, crs)
    assert len(str(caught.value)) < 500 and "\n" not in str(caught.value)
