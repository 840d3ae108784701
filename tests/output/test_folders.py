"""Results appear under their names when all of them are whole, and nothing else is touched."""

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


def test_files_replace_those_of_their_names_and_no_others(tmp_path):
    write(tmp_path, "old")
    (tmp_path / "notes.txt").write_text("mine")
    write(tmp_path, "new", overwrite=True)
    assert contents(tmp_path) == {"one.txt": "new", "two.txt": "new", "notes.txt": "mine"}


def test_what_gdal_kept_of_a_replaced_raster_goes_with_it(tmp_path):
    for name in ("image.tif", "image.tif.aux.xml", "other.tif.aux.xml"):
        (tmp_path / name).write_text("old")
    with results(tmp_path, ["image.tif"], overwrite=True) as partial:
        (partial / "image.tif").write_text("new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["image.tif", "other.tif.aux.xml"]


class Killed(BaseException):
    """Stands for a signal that ends the process at once."""


def failing_moves(monkeypatch, folder, number, error, forever):
    """Let moves out of a folder or into it fail, from the given one on, or that one alone."""
    moved, replace = [], os.replace

    def move(source, target):
        if folder in (Path(source).parent, Path(target).parent):
            moved.append(target)
            if len(moved) == number or (forever and len(moved) > number):
                raise error
        return replace(source, target)

    monkeypatch.setattr(os, "replace", move)


def replaced_run(folder, **options):
    """New results in the place of old ones, with the last name as the mark of a whole run."""
    with results(folder, ["store", "one.txt", "mark"], stale=["stale"], **options) as hidden:
        (hidden / BEGUN).touch()
        (hidden / "store").mkdir(exist_ok=True)
        (hidden / "store" / "part").write_text("new")
        for name in ("one.txt", "mark"):
            (hidden / name).write_text("new")


def old_run(folder):
    (folder / "store").mkdir(parents=True)
    for name in ("store/part", "one.txt", "mark", "stale", "one.txt.aux.xml"):
        (folder / name).write_text("old")
    return all_files(folder)


def all_files(folder):
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: path.read_text() for name, path in found.items() if not name.startswith(UNFINISHED)}


NEW = {"store/part": "new", "one.txt": "new", "mark": "new"}


@pytest.mark.parametrize("number", range(1, 9))
def test_a_run_killed_between_its_moves_leaves_no_mix_of_two_runs(tmp_path, monkeypatch, number):
    out = tmp_path / "out"
    old_run(out)
    with monkeypatch.context() as patch, pytest.raises(Killed):
        failing_moves(patch, out, number, Killed, forever=True)
        replaced_run(out, overwrite=True, worth_keeping=lambda hidden, error: True)
    found = all_files(out)
    assert len(set(found.values())) <= 1
    # The first move takes the old mark away, and the last one brings the new one.
    assert ("mark" in found) == (number == 1)
    replaced_run(out, resume=True)
    assert all_files(out) == NEW and not (out / UNFINISHED).exists()


@pytest.mark.parametrize(("number", "error"), [(1, OSError), (4, KeyboardInterrupt), (8, OSError)])
def test_an_error_between_the_moves_leaves_the_old_results(tmp_path, monkeypatch, number, error):
    out = tmp_path / "out"
    old = old_run(out)
    with monkeypatch.context() as patch, pytest.raises(error):
        failing_moves(patch, out, number, error, forever=False)
        replaced_run(out, overwrite=True)
    assert all_files(out) == old and not (out / UNFINISHED).exists()


@pytest.mark.parametrize("error", [ValueError, OSError, KeyboardInterrupt])
def test_an_error_leaves_a_folder_as_it_was(tmp_path, error):
    write(tmp_path / "there", "old")
    for name in ("there", "new"):
        with pytest.raises(error), results(tmp_path / name, NAMES, overwrite=True) as hidden:
            (hidden / "one.txt").write_text("half")
            raise error("in the middle")
    assert contents(tmp_path / "there") == {"one.txt": "old", "two.txt": "old"}
    assert not (tmp_path / "new").exists()


def keep_from(tmp_path, error, **options):
    """A run that is worth keeping after an error of the system alone."""
    out = tmp_path / "out"
    options |= {"worth_keeping": lambda hidden, error: isinstance(error, OSError)}
    with pytest.raises(error), results(out, NAMES, **options) as hidden:
        (hidden / BEGUN).touch()
        (hidden / "block").write_text("done")
        raise error("in the middle")
    return out


def test_what_is_worth_it_is_kept_and_gone_on_with(tmp_path):
    out = keep_from(tmp_path, OSError)
    assert [path.name for path in out.iterdir()] == [UNFINISHED]
    with results(out, NAMES, resume=True, worth_keeping=lambda hidden, error: True) as hidden:
        assert contents(hidden) == {BEGUN: "", "block": "done"}
        for name in NAMES:
            (hidden / name).write_text("whole")
    assert contents(out) == {"one.txt": "whole", "two.txt": "whole"}


def test_another_beginning_finds_nothing_of_the_one_before(tmp_path):
    out = keep_from(tmp_path, OSError)
    kept = {"overwrite": True, "worth_keeping": lambda hidden, error: True}
    with pytest.raises(OSError), results(out, NAMES, **kept) as hidden:
        assert contents(hidden) == {}
        raise OSError("again")
    assert not keep_from(tmp_path / "another", ValueError).exists()


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
def test_a_folder_in_use_is_refused_with_what_to_type(tmp_path, held, options, said):
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


def hold(folder, ready, end):
    with results(folder, NAMES, overwrite=True) as hidden:
        for name in NAMES:
            (hidden / name).write_text("first")
        ready.set()
        end.wait(60)


@pytest.fixture
def rival(tmp_path):
    """A process that writes into the folder until it is told to end."""
    spawn = multiprocessing.get_context("spawn")
    ready, end = spawn.Event(), spawn.Event()
    process = spawn.Process(target=hold, args=(tmp_path / "out", ready, end))
    process.start()
    assert ready.wait(60)
    yield process, end
    process.kill()
    process.join()


@pytest.mark.parametrize("options", [{"overwrite": True}, {"overwrite": False}, {"overwrite": False, "resume": True}])
def test_a_second_run_in_a_folder_is_refused_with_the_name_of_the_first(tmp_path, rival, options):
    process, end = rival
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


def test_a_link_in_the_place_of_the_hidden_folder_is_refused(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "elsewhere").mkdir()
    os.symlink(tmp_path / "elsewhere", tmp_path / "out" / UNFINISHED)
    with pytest.raises(ValueError, match=r"\.unfinished' is a link: remove it"):
        write(tmp_path / "out", "new", overwrite=True)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_finished_run_is_recognised_by_all_its_files(tmp_path):
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


def test_a_dead_run_holds_nothing(tmp_path, rival):
    process, _ = rival
    os.kill(process.pid, signal.SIGKILL)
    process.join(60)
    write(tmp_path / "out", "second")
    assert contents(tmp_path / "out") == dict.fromkeys(NAMES, "second")
