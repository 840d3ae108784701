"""What a run computes, and in which order."""

import dask.array as da
import numpy as np
import pytest
import xarray as xr
import zarr

from fifesim.output.identity import NotThisRun
from fifesim.output.products import (
    chunk_checksum,
    has_blocks,
    make_scene_store,
    products_of,
    save_block,
    saved_array,
    saved_blocks,
    wanted_blocks,
)
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


CELLS = np.random.default_rng(2).random((2, 7, 9))


@pytest.fixture
def array():
    return da.from_array(CELLS, chunks=(2, 4, 5))


def save(folder, array, *indices):
    for index in indices:
        save_block(folder, "image", index, array.blocks[index].compute())


def test_blocks_come_back_in_their_places(tmp_path, array):
    save(tmp_path, array, *np.ndindex(array.numblocks))
    found = saved_array(tmp_path, "image", array)
    assert found.chunks == ((2,), (4, 3), (9,)) and found.dtype == array.dtype
    np.testing.assert_array_equal(found.compute(), CELLS)


def test_blocks_that_are_there_are_known(tmp_path, array):
    save(tmp_path, array, (0, 0, 1), (0, 1, 0))
    assert saved_blocks(tmp_path, "image", array) == {(0, 0, 1), (0, 1, 0)}
    assert saved_blocks(tmp_path, "truth", array) == set()


@pytest.mark.parametrize("kept", [0, 60, -8])
def test_a_cut_block_is_none(tmp_path, array, kept):
    save(tmp_path, array, (0, 0, 0))
    (path,) = (tmp_path / "image").iterdir()
    path.write_bytes(path.read_bytes()[:kept])
    assert saved_blocks(tmp_path, "image", array) == set()


def test_a_changed_block_is_none_and_is_not_read(tmp_path, array):
    save(tmp_path, array, *np.ndindex(array.numblocks))
    path = tmp_path / "image" / "00000-00000-00000.npy"
    content = bytearray(path.read_bytes())
    content[-20] ^= 1
    path.write_bytes(content)
    assert (0, 0, 0) not in saved_blocks(tmp_path, "image", array)
    with pytest.raises(OSError, match="has changed since it was written"):
        saved_array(tmp_path, "image", array).compute()


def test_a_block_of_another_shape_or_type_is_none(tmp_path, array):
    save(tmp_path, array, (0, 0, 0))
    assert saved_blocks(tmp_path, "image", array.astype("float32")) == set()
    assert saved_blocks(tmp_path, "image", array.rechunk((2, 4, 4))) == set()


def test_a_place_that_takes_nothing_is_named(tmp_path, array):
    (tmp_path / "image" / "00000-00000-00000.npy").mkdir(parents=True)
    with pytest.raises(OSError, match=r"00000-00000-00000\.npy"):
        save(tmp_path, array, (0, 0, 0))


def test_a_run_goes_on_where_it_has_blocks_and_can_end_well(tmp_path, array):
    assert not has_blocks(tmp_path, OSError())
    save(tmp_path / "blocks", array, (0, 0, 0))
    assert has_blocks(tmp_path, OSError()) and has_blocks(tmp_path, KeyboardInterrupt())
    assert has_blocks(tmp_path, NotThisRun()) and not has_blocks(tmp_path, ValueError())
