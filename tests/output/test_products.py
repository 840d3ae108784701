"""Products of a run and the order of their computation."""

import dask.array as da
import numpy as np
import pytest
import xarray as xr
import zarr

from fifesim.output import products
from fifesim.output.identity import NotThisRun
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate


@pytest.fixture(scope="module")
def simulated_tree():
    scenario = parse_scenario({"grid": {"width": 900, "height": 600}, "terrain": {"dem": "flat"}})
    return simulate(scenario.complete(), chunks={"y": 90, "x": 135})


def test_each_block_is_listed_once(simulated_tree):
    found, lai = products.products_of(simulated_tree), simulated_tree["scene"]["lai"]
    wanted = products.wanted_blocks(found, lai)
    assert len(wanted) == len(set(wanted)) == sum(array.npartitions for array in found.arrays.values())
    assert {name for name, _ in wanted} == set(found.rasters) == {"image", "lai", "fpar", "detail"}


def test_blocks_are_ordered_by_the_scene_chunk_below_them(simulated_tree):
    """The scene chunk below a block is located by comparing the centres of blocks and cells."""
    found, lai = products.products_of(simulated_tree), simulated_tree["scene"]["lai"]
    places = []
    for name, index in products.wanted_blocks(found, lai):
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


def test_detail_shows_the_cells_in_the_middle_of_the_scene(simulated_tree):
    detail, scene = products.products_of(simulated_tree).rasters["detail"], simulated_tree["scene"]["lai"]
    assert detail.shape == (144, 144)
    assert abs(float(detail["x"].mean() - scene["x"].mean())) <= 15


def test_scene_blocks_are_written_during_the_computation(simulated_tree, tmp_path):
    path = tmp_path / "scene.zarr"
    found = products.products_of(simulated_tree, path)
    assert set(found.scene) == set(simulated_tree["scene"].data_vars)
    products.make_scene_store(path, found.scene)
    (checksum,) = found.arrays["scene-lai"].compute().ravel()
    assert products.chunk_checksum(path, "lai", (0, 0)) == checksum
    written = xr.open_zarr(path, decode_coords="all")
    assert written["lai"].values.tobytes() == simulated_tree["scene"]["lai"].values.tobytes()
    zarr.open_array(str(path), path="lai")[3, 4] = 9.0
    assert products.chunk_checksum(path, "lai", (0, 0)) != checksum


CELLS = np.random.default_rng(2).random((2, 7, 9))


@pytest.fixture
def array():
    return da.from_array(CELLS, chunks=(2, 4, 5))


def save(folder, array, *indices):
    for index in indices:
        products.save_block(folder, "image", index, array.blocks[index].compute())


def test_saved_blocks_form_the_original_array(tmp_path, array):
    save(tmp_path, array, (0, 0, 1), (0, 1, 0))
    assert products.saved_blocks(tmp_path, "image", array) == {(0, 0, 1), (0, 1, 0)}
    for other in (array.astype("float32"), array.rechunk((2, 4, 4))):
        assert (0, 1, 0) not in products.saved_blocks(tmp_path, "image", other)
    assert products.saved_blocks(tmp_path, "truth", array) == set()
    save(tmp_path, array, *np.ndindex(array.numblocks))
    found = products.saved_array(tmp_path, "image", array)
    assert found.chunks == ((2,), (4, 3), (9,)) and found.dtype == array.dtype
    np.testing.assert_array_equal(found.compute(), CELLS)


@pytest.mark.parametrize("kept", [0, 60, -8, None], ids=["empty", "header", "truncated", "changed"])
def test_incomplete_or_changed_block_is_ignored_and_not_read(tmp_path, array, kept):
    save(tmp_path, array, *np.ndindex(array.numblocks))
    path = tmp_path / "image" / "00000-00000-00000.npy"
    content = bytearray(path.read_bytes()[:kept])
    if kept is None:
        content[-20] ^= 1
    path.write_bytes(content)
    assert products.saved_blocks(tmp_path, "image", array) == {(0, 0, 1), (0, 1, 0), (0, 1, 1)}
    if kept is None:
        with pytest.raises(OSError, match="has changed since it was written"):
            products.saved_array(tmp_path, "image", array).compute()


def test_error_names_a_block_that_cannot_be_written(tmp_path, array):
    (tmp_path / "image" / "00000-00000-00000.npy").mkdir(parents=True)
    with pytest.raises(OSError, match=r"00000-00000-00000\.npy"):
        save(tmp_path, array, (0, 0, 0))


def test_partial_run_is_kept_if_it_has_blocks_and_can_be_resumed(tmp_path, array):
    assert not products.has_blocks(tmp_path, OSError())
    save(tmp_path / "blocks", array, (0, 0, 0))
    assert products.has_blocks(tmp_path, OSError()) and products.has_blocks(tmp_path, KeyboardInterrupt())
    assert products.has_blocks(tmp_path, NotThisRun()) and not products.has_blocks(tmp_path, ValueError())
