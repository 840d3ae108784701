"""Saved blocks are whole or not there, and come back as they were."""

import dask.array as da
import numpy as np
import pytest

from fifesim.output.run.identity import NotThisRun
from fifesim.output.run.products import has_blocks, save_block, saved_array, saved_blocks

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
