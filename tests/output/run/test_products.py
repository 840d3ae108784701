"""What a run computes, and in which order."""

import numpy as np
import pytest
import xarray as xr
import zarr

from fifesim.output.run.products import chunk_checksum, make_scene_store, products_of, wanted_blocks
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate


@pytest.fixture(scope="module")
def tree():
    scenario = parse_scenario({"grid": {"width": 900, "height": 600}, "terrain": {"dem": "flat"}})
    return simulate(scenario.complete(), chunks={"y": 90, "x": 135})


def test_every_block_is_wanted_once(tree):
    found, lai = products_of(tree), tree["scene"]["lai"]
    wanted = wanted_blocks(found, lai)
    assert len(wanted) == len(set(wanted)) == sum(array.npartitions for array in found.arrays.values())
    assert {name for name, _ in wanted} == set(found.rasters) == {"image", "lai", "fpar", "detail"}


def test_blocks_are_wanted_by_the_chunk_of_the_scene_below_them(tree):
    """Chunk after chunk of the scene, each found by the coordinates of the middles of blocks and cells."""
    found, lai = products_of(tree), tree["scene"]["lai"]
    places = []
    for name, index in wanted_blocks(found, lai):
        raster, place = found.rasters[name], []
        for axis, cells, north_up in (("y", lai.chunks[0], -1), ("x", lai.chunks[1], 1)):
            sizes = raster.chunksizes[axis]
            start = sum(sizes[: index[raster.dims.index(axis)]])
            block = raster[axis].values[start : start + sizes[index[raster.dims.index(axis)]]]
            before = np.sum(north_up * lai[axis].values < north_up * block.mean())
            place.append(int(np.searchsorted(np.cumsum(cells), before, side="right")))
        places.append(tuple(place))
    assert places == sorted(places)
    assert len(set(places)) == lai.data.npartitions == 4


def test_cells_of_the_detail_are_those_below_pixels_in_the_middle(tree):
    detail, scene = products_of(tree).rasters["detail"], tree["scene"]["lai"]
    assert detail.shape == (144, 144)
    assert abs(float(detail["x"].mean() - scene["x"].mean())) <= 15


def test_scene_products_are_written_as_their_blocks_are_made(tree, tmp_path):
    path = tmp_path / "scene.zarr"
    found = products_of(tree, path)
    assert set(found.scene) == set(tree["scene"].data_vars)
    make_scene_store(path, found.scene)
    (checksum,) = found.arrays["scene-lai"].compute().ravel()
    assert chunk_checksum(path, "lai", (0, 0)) == checksum
    written = xr.open_zarr(path, decode_coords="all")
    assert written["lai"].values.tobytes() == tree["scene"]["lai"].values.tobytes()
    zarr.open_array(str(path), path="lai")[3, 4] = 9.0
    assert chunk_checksum(path, "lai", (0, 0)) != checksum
