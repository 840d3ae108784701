"""Results appear under their names only when all are complete; other files stay untouched."""

import multiprocessing
import os
import signal
from pathlib import Path

import pytest

from fifesim.output.folders import BEGUN, UNFINISHED, check_folder, results

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


def write_old_run(folder):
    (folder / "store").mkdir(parents=True)
    for name in ("store/part", "one.txt", "mark", "stale", "one.txt.aux.xml"):
        (folder / name).write_text("old")
    return all_files(folder)


def all_files(folder):
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: path.read_text() for name, path in found.items() if not name.startswith(UNFINISHED)}


NEW = {"store/part": "new", "one.txt": "new", "mark": "new"}


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
    assert all_files(out) == NEW and not (out / UNFINISHED).exists()


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


@pytest.mark.parametrize("error", [ValueError, OSError, KeyboardInterrupt])
def test_error_leaves_the_folder_unchanged(tmp_path, error):
    write(tmp_path / "there", "old")
    for name in ("there", "new"):
        with pytest.raises(error), results(tmp_path / name, NAMES, overwrite=True) as hidden:
            (hidden / "one.txt").write_text("half")
            raise error("in the middle")
    assert contents(tmp_path / "there") == {"one.txt": "old", "two.txt": "old"}
    assert not (tmp_path / "new").exists()


def interrupt_run(tmp_path, error, **options):
    """Folder of a run that is kept only if an OSError interrupted it."""
    out = tmp_path / "out"
    options |= {"worth_keeping": lambda hidden, error: isinstance(error, OSError)}
    with pytest.raises(error), results(out, NAMES, **options) as hidden:
        (hidden / BEGUN).touch()
        (hidden / "block").write_text("done")
        raise error("in the middle")
    return out


def test_partial_results_worth_keeping_are_resumed(tmp_path):
    out = interrupt_run(tmp_path, OSError)
    assert [path.name for path in out.iterdir()] == [UNFINISHED]
    with results(out, NAMES, resume=True, worth_keeping=lambda hidden, error: True) as hidden:
        assert contents(hidden) == {BEGUN: "", "block": "done"}
        for name in NAMES:
            (hidden / name).write_text("whole")
    assert contents(out) == {"one.txt": "whole", "two.txt": "whole"}


def test_overwriting_discards_partial_results(tmp_path):
    out = interrupt_run(tmp_path, OSError)
    kept = {"overwrite": True, "worth_keeping": lambda hidden, error: True}
    with pytest.raises(OSError), results(out, NAMES, **kept) as hidden:
        assert contents(hidden) == {}
        raise OSError("again")
    assert not interrupt_run(tmp_path / "another", ValueError).exists()


@pytest.mark.parametrize(
    ("held", "options", "said"),
    [
        (["notes.txt"], {"overwrite": False}, "not empty.*--overwrite"),
        (["notes.txt"], {"overwrite": False, "resume": True}, "nothing to resume.*--overwrite"),
        (["notes.txt", f"{UNFINISHED}/block"], {"overwrite": False, "resume": True}, "nothing to resume"),
        ([f"{UNFINISHED}/{BEGUN}"], {"overwrite": False}, "--resume"),
        ([f"{UNFINISHED}/{BEGUN}", "notes.txt"], {"overwrite": False}, "--resume"),
    ],
)
def test_folder_in_use_is_rejected_with_the_option_to_use(tmp_path, held, options, said):
    with pytest.raises(ValueError, match="is a file"):
        check_folder(Path(__file__), overwrite=True)
    for name in held:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("kept")
    with pytest.raises(ValueError, match=said):
        check_folder(tmp_path, **options)
    with pytest.raises(ValueError, match=said), results(tmp_path, NAMES, **options):
        pass
    assert all((tmp_path / name).read_text() == "kept" for name in held)


def hold_folder(folder, ready, end):
    with results(folder, NAMES, overwrite=True) as hidden:
        for name in NAMES:
            (hidden / name).write_text("first")
        ready.set()
        end.wait(60)


@pytest.fixture
def rival(tmp_path):
    """A process that holds the folder until it receives the signal to end."""
    spawn = multiprocessing.get_context("spawn")
    ready, end = spawn.Event(), spawn.Event()
    process = spawn.Process(target=hold_folder, args=(tmp_path / "out", ready, end))
    process.start()
    assert ready.wait(60)
    yield process, end
    process.kill()
    process.join()


def test_second_run_in_a_folder_is_rejected_and_names_the_first(tmp_path, rival):
    process, end = rival
    for options in ({"overwrite": True}, {"overwrite": False}, {"overwrite": False, "resume": True}):
        for attempt in (check_folder, lambda folder, **options: write(folder, "second", **options)):
            with pytest.raises(ValueError, match=f"in use by process {process.pid} on "):
                attempt(tmp_path / "out", **options)
    end.set()
    process.join(60)
    assert contents(tmp_path / "out") == dict.fromkeys(NAMES, "first")


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
    (tmp_path / "out").mkdir()
    (tmp_path / "elsewhere").mkdir()
    os.symlink(tmp_path / "elsewhere", tmp_path / "out" / UNFINISHED)
    with pytest.raises(ValueError, match=r"\.unfinished' is a link: remove it"):
        write(tmp_path / "out", "new", overwrite=True)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_finished_run_needs_all_its_files(tmp_path):
    write(tmp_path, "1")
    assert check_folder(tmp_path, overwrite=False, resume=True, names=NAMES)
    assert not check_folder(tmp_path, overwrite=True, resume=True, names=NAMES)
    with pytest.raises(ValueError, match="is not empty"):
        check_folder(tmp_path, overwrite=False, names=NAMES)
    with pytest.raises(ValueError, match="nothing to resume"):
        check_folder(tmp_path, overwrite=False, resume=True, names=(*NAMES, "three.txt"))
    (tmp_path / UNFINISHED).mkdir()
    (tmp_path / UNFINISHED / "replaced").touch()
    assert check_folder(tmp_path, overwrite=False, resume=True, names=NAMES)
    assert not (tmp_path / UNFINISHED).exists()


def test_killed_run_releases_its_folder(tmp_path, rival):
    process, _ = rival
    os.kill(process.pid, signal.SIGKILL)
    process.join(60)
    write(tmp_path / "out", "second")
    assert contents(tmp_path / "out") == dict.fromkeys(NAMES, "second")
