"""Results appear only when all are complete, other files stay untouched, and damaged blocks are found."""

import multiprocessing
import os
import time
from pathlib import Path

import dask.array as da
import numpy as np
import pytest

from fifesim.output import blocks
from fifesim.output.folders import BEGUN, UNFINISHED, check_folder, results
from fifesim.output.identity import NotThisRun

NAMES = ("one.txt", "two.txt")


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir() if path.name not in ("lock", "holder")}


def write(folder, text, names=NAMES, **options):
    with results(folder, names, **options) as hidden:
        for name in names:
            (hidden / name).write_text(text)


def test_only_files_of_the_same_name_and_their_gdal_sidecars_are_replaced(tmp_path):
    write(tmp_path, "old")
    for name in ("notes.txt", "one.txt.aux.xml", "other.tif.aux.xml"):
        (tmp_path / name).write_text("mine")
    write(tmp_path, "new", overwrite=True)
    assert contents(tmp_path) == {"one.txt": "new", "two.txt": "new", "notes.txt": "mine", "other.tif.aux.xml": "mine"}


class Killed(BaseException):
    """Stand-in for a signal that ends the process at once."""


def make_moves_fail(monkeypatch, folder, number, error, forever):
    """Make the move with this number, and optionally all later moves, into or out of a folder fail."""
    moved, replace = [], os.replace

    def move(source, target):
        if folder in (Path(source).parent, Path(target).parent):
            moved.append(target)
            if len(moved) == number or (forever and len(moved) > number):
                raise error
        return replace(source, target)

    monkeypatch.setattr(os, "replace", move)


def write_new_run(folder, **options):
    """Replace the results; the last name marks a complete run."""
    with results(folder, ["store", "one.txt", "mark"], stale=["stale"], **options) as hidden:
        (hidden / BEGUN).touch()
        (hidden / "store").mkdir(exist_ok=True)
        (hidden / "store" / "part").write_text("new")
        for name in ("one.txt", "mark"):
            (hidden / name).write_text("new")


def all_files(folder):
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: path.read_text() for name, path in found.items() if not name.startswith(UNFINISHED)}


def write_old_run(folder):
    (folder / "store").mkdir(parents=True)
    for name in ("store/part", "one.txt", "mark", "stale", "one.txt.aux.xml"):
        (folder / name).write_text("old")
    return all_files(folder)


@pytest.mark.parametrize("number", range(1, 9))
def test_run_killed_between_moves_leaves_no_mix_of_two_runs(tmp_path, monkeypatch, number):
    out = tmp_path / "out"
    write_old_run(out)
    with monkeypatch.context() as patch, pytest.raises(Killed):
        make_moves_fail(patch, out, number, Killed, forever=True)
        write_new_run(out, overwrite=True, worth_keeping=lambda hidden, error: True)
    found = all_files(out)
    assert len(set(found.values())) <= 1
    # The first move removes the old mark; the last one adds the new mark.
    assert ("mark" in found) == (number == 1)
    write_new_run(out, resume=True)
    assert all_files(out) == {"store/part": "new", "one.txt": "new", "mark": "new"}
    assert not (out / UNFINISHED).exists()


def test_results_are_on_the_disk_before_their_mark(tmp_path, monkeypatch):
    done, flush, replace = [], os.fsync, os.replace
    monkeypatch.setattr(
        os, "fsync", lambda number: (done.append(os.readlink(f"/proc/self/fd/{number}")), flush(number))
    )
    monkeypatch.setattr(os, "replace", lambda source, target: (done.append(target.name), replace(source, target)))
    write_new_run(tmp_path / "out")
    hidden = tmp_path / "out" / UNFINISHED
    *before, folder, mark, _ = done
    assert folder == str(tmp_path / "out") and mark == "mark"
    assert {str(hidden / name) for name in ("store", "store/part", "one.txt", "mark")} == set(before[:4])


@pytest.mark.parametrize(("number", "error"), [(1, OSError), (4, KeyboardInterrupt), (8, OSError)])
def test_error_between_moves_restores_the_old_results(tmp_path, monkeypatch, number, error):
    out = tmp_path / "out"
    old = write_old_run(out)
    with monkeypatch.context() as patch, pytest.raises(error):
        make_moves_fail(patch, out, number, error, forever=False)
        write_new_run(out, overwrite=True)
    assert all_files(out) == old and not (out / UNFINISHED).exists()


def interrupt_run(tmp_path, error):
    """Folder of a run that is kept only if an OSError interrupted it."""
    out, kept = tmp_path / "out", lambda hidden, error: isinstance(error, OSError)
    with pytest.raises(error), results(out, NAMES, worth_keeping=kept) as hidden:
        (hidden / BEGUN).touch()
        (hidden / "block").write_text("done")
        raise error("in the middle")
    return out


def test_partial_results_worth_keeping_are_resumed_and_overwriting_discards_them(tmp_path):
    out, kept = interrupt_run(tmp_path, OSError), {"worth_keeping": lambda hidden, error: True}
    assert [path.name for path in out.iterdir()] == [UNFINISHED]
    with pytest.raises(OSError), results(out, NAMES, resume=True, **kept) as hidden:
        assert contents(hidden) == {BEGUN: "", "block": "done"}
        raise OSError("again")
    with pytest.raises(OSError), results(out, NAMES, overwrite=True, **kept) as hidden:
        assert contents(hidden) == {}
        raise OSError("again")
    write(out, "whole", resume=True)
    assert contents(out) == {"one.txt": "whole", "two.txt": "whole"}
    assert not interrupt_run(tmp_path / "another", ValueError).exists()


@pytest.mark.parametrize(
    ("held", "resume", "said"),
    [
        (["notes.txt"], False, "not empty.*--overwrite"),
        (["notes.txt", f"{UNFINISHED}/block"], True, "nothing to resume.*--overwrite"),
        (["notes.txt", f"{UNFINISHED}/{BEGUN}"], False, "--resume"),
    ],
)
def test_folder_in_use_is_rejected_with_the_option_to_use(tmp_path, held, resume, said):
    with pytest.raises(ValueError, match="is a file"):
        check_folder(Path(__file__), overwrite=True)
    for name in held:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("kept")
    for attempt in (check_folder, lambda folder, **options: write(folder, "new", **options)):
        with pytest.raises(ValueError, match=said):
            attempt(tmp_path, overwrite=False, resume=resume)
    assert all((tmp_path / name).read_text() == "kept" for name in held)


def hold_folder(folder, ready):
    with results(folder, NAMES, overwrite=True):
        ready.set()
        time.sleep(60)


@pytest.mark.slow
def test_second_run_in_a_folder_is_rejected_until_the_first_ends_or_is_killed(tmp_path):
    out, spawn = tmp_path / "out", multiprocessing.get_context("spawn")
    ready = spawn.Event()
    process = spawn.Process(target=hold_folder, args=(out, ready))
    process.start()
    try:
        assert ready.wait(60)
        for options in ({"overwrite": True}, {"overwrite": False}, {"overwrite": False, "resume": True}):
            for attempt in (check_folder, lambda folder, **options: write(folder, "second", **options)):
                with pytest.raises(ValueError, match=f"in use by process {process.pid} on "):
                    attempt(out, **options)
    finally:
        process.kill()
        process.join(60)
    write(out, "second")
    assert contents(out) == dict.fromkeys(NAMES, "second")


@pytest.mark.parametrize("name", ["lock", "holder", "block", "blocks/dn"])
@pytest.mark.parametrize("kind", ["link", "pipe"])
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes in its folders")
def test_links_and_pipes_in_an_unfinished_run_are_not_followed(tmp_path, name, kind):
    elsewhere, hidden = tmp_path / "elsewhere", tmp_path / "out" / UNFINISHED
    elsewhere.write_text("mine")
    (hidden / name).parent.mkdir(parents=True)
    (hidden / BEGUN).touch()
    os.symlink(elsewhere, hidden / name) if kind == "link" else os.mkfifo(hidden / name)
    with results(tmp_path / "out", NAMES, resume=True, worth_keeping=lambda hidden, error: True) as again:
        assert name in ("lock", "holder") or not os.path.lexists(again / name)
        for each in NAMES:
            (again / each).write_text("new")
    assert elsewhere.read_text() == "mine"


def test_link_in_place_of_the_hidden_folder_is_rejected(tmp_path):
    for name in ("out", "elsewhere"):
        (tmp_path / name).mkdir()
    os.symlink(tmp_path / "elsewhere", tmp_path / "out" / UNFINISHED)
    with pytest.raises(ValueError, match=r"\.unfinished' is a link: remove it"):
        write(tmp_path / "out", "new", overwrite=True)
    assert not list((tmp_path / "elsewhere").iterdir())


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
