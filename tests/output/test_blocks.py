"""Blocks are saved completely or not at all, and damaged ones are found."""

import dask.array as da
import numpy as np
import pytest

from fifesim.output import blocks
from fifesim.output.identity import NotThisRun

CELLS = np.random.default_rng(2).random((2, 7, 9))
CELLS[:, :4, :5] = 0


@pytest.fixture
def array():
    return da.from_array(CELLS, chunks=(2, 4, 5))


def save(folder, array, *indices):
    saved = blocks.block_store(folder, {"image": array})["image"]
    for index in indices:
        blocks.save_block(saved, index, array.blocks[index].compute())
    return saved


def saved_blocks(folder, array):
    saved = save(folder, array)
    return {index for index in np.ndindex(array.numblocks) if blocks.is_saved(saved, index)}


def test_saved_blocks_form_the_original_array(tmp_path, array):
    """A block of zeros is saved too, which Zarr leaves out by default."""
    save(tmp_path, array, (0, 0, 0), (0, 1, 0))
    assert saved_blocks(tmp_path, array) == {(0, 0, 0), (0, 1, 0)}
    for other in (array.astype("float32"), array.rechunk((2, 4, 4))):
        assert saved_blocks(tmp_path, other) == set()
    saved = save(tmp_path, array, *np.ndindex(array.numblocks))
    found = blocks.saved_array(saved)
    assert found.chunks == (*array.chunks[:-1], (9,)) and found.dtype == array.dtype
    np.testing.assert_array_equal(found.compute(), CELLS)


@pytest.mark.parametrize("kept", [0, 60, -8, None], ids=["empty", "header", "truncated", "changed"])
def test_incomplete_or_changed_block_is_ignored_and_not_read(tmp_path, array, kept):
    saved = save(tmp_path, array, *np.ndindex(array.numblocks))
    path = tmp_path / "image" / "c" / "0" / "0" / "0"
    assert path == blocks.block_file(saved, (0, 0, 0))
    content = bytearray(path.read_bytes()[:kept])
    if kept is None:
        content[-20] ^= 1
    path.write_bytes(content)
    (tmp_path / "image" / "zarr.json").write_bytes(b"{")
    assert saved_blocks(tmp_path, array) == {(0, 0, 1), (0, 1, 0), (0, 1, 1)}
    with pytest.raises(OSError, match="has changed since it was written"):
        blocks.saved_array(saved).compute()
    save(tmp_path, array, (0, 0, 0))
    np.testing.assert_array_equal(blocks.saved_array(saved).compute(), CELLS)
    path.unlink()
    with pytest.raises(OSError, match="has changed since it was written"):
        blocks.saved_array(saved).compute()


def test_error_names_a_block_that_cannot_be_written(tmp_path, array):
    (tmp_path / "image" / "c" / "0" / "0" / "0").mkdir(parents=True)
    with pytest.raises(OSError, match="image/c/0/0/0"):
        save(tmp_path, array, (0, 0, 0))


def test_partial_run_is_kept_if_it_has_blocks_and_can_be_resumed(tmp_path, array):
    save(tmp_path / "blocks", array)
    assert not blocks.has_blocks(tmp_path, OSError())
    save(tmp_path / "blocks", array, (0, 0, 0))
    assert blocks.has_blocks(tmp_path, OSError()) and blocks.has_blocks(tmp_path, KeyboardInterrupt())
    assert blocks.has_blocks(tmp_path, NotThisRun()) and not blocks.has_blocks(tmp_path, ValueError())
