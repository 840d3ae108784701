"""Results appear under their names when all of them are whole, and nothing else is touched."""

import pytest

from fifesim.output.folders import UNFINISHED, check_folder, results

NAMES = ("one.txt", "two.txt")


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


def write(folder, text, names=NAMES):
    with results(folder, names) as hidden:
        for name in names:
            (hidden / name).write_text(text)


def test_files_are_there_when_all_are_written(tmp_path):
    out = tmp_path / "a" / "out"
    with results(out, NAMES) as hidden:
        (hidden / "one.txt").write_text("1")
        assert list(out.iterdir()) == [hidden]
        (hidden / "two.txt").write_text("2")
    assert contents(out) == {"one.txt": "1", "two.txt": "2"}


def test_files_replace_those_of_their_names_and_no_others(tmp_path):
    write(tmp_path, "old")
    (tmp_path / "notes.txt").write_text("mine")
    write(tmp_path, "new")
    assert contents(tmp_path) == {"one.txt": "new", "two.txt": "new", "notes.txt": "mine"}


def test_a_folder_replaces_a_folder(tmp_path):
    for text in ("old", "new"):
        with results(tmp_path, ["store"]) as hidden:
            (hidden / "store").mkdir()
            (hidden / "store" / text).touch()
    assert [path.name for path in (tmp_path / "store").iterdir()] == ["new"]


@pytest.mark.parametrize("error", [ValueError, OSError, KeyboardInterrupt])
def test_an_error_leaves_a_folder_as_it_was(tmp_path, error):
    write(tmp_path / "there", "old")
    for name in ("there", "new"):
        with pytest.raises(error), results(tmp_path / name, NAMES) as hidden:
            (hidden / "one.txt").write_text("half")
            raise error("in the middle")
    assert contents(tmp_path / "there") == {"one.txt": "old", "two.txt": "old"}
    assert not (tmp_path / "new").exists()


def keep_from(tmp_path, error, **options):
    """A run that is worth keeping after an error of the system alone."""
    out = tmp_path / "out"
    options |= {"worth_keeping": lambda hidden, error: isinstance(error, OSError)}
    with pytest.raises(error), results(out, NAMES, **options) as hidden:
        (hidden / "block").write_text("done")
        raise error("in the middle")
    return out


def test_what_is_worth_it_is_kept_and_gone_on_with(tmp_path):
    out = keep_from(tmp_path, OSError)
    assert [path.name for path in out.iterdir()] == [UNFINISHED]
    with results(out, NAMES, resume=True, worth_keeping=lambda hidden, error: True) as hidden:
        assert contents(hidden) == {"block": "done"}
        for name in NAMES:
            (hidden / name).write_text("whole")
    assert contents(out) == {"one.txt": "whole", "two.txt": "whole"}


def test_what_is_not_worth_it_goes(tmp_path):
    assert not keep_from(tmp_path, ValueError).exists()


def test_another_beginning_finds_nothing_of_the_one_before(tmp_path):
    out = keep_from(tmp_path, OSError)
    with pytest.raises(OSError), results(out, NAMES, worth_keeping=lambda hidden, error: True) as hidden:
        assert contents(hidden) == {}
        raise OSError("again")


@pytest.mark.parametrize(
    ("held", "options", "said"),
    [
        (["notes.txt"], {"overwrite": False}, "--overwrite"),
        ([UNFINISHED], {"overwrite": False}, "--resume"),
        ([UNFINISHED, "notes.txt"], {"overwrite": False}, "--resume"),
    ],
)
def test_a_folder_in_use_is_refused_with_what_to_type(tmp_path, held, options, said):
    for name in held:
        (tmp_path / name).mkdir()
    with pytest.raises(ValueError, match=said):
        check_folder(tmp_path, **options)


@pytest.mark.parametrize("options", [{"overwrite": True}, {"overwrite": False, "resume": True}])
def test_a_folder_in_use_is_taken_when_asked_to(tmp_path, options):
    (tmp_path / UNFINISHED).mkdir()
    check_folder(tmp_path, **options)


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "out").touch()
    with pytest.raises(ValueError, match="is a file"):
        check_folder(tmp_path / "out", overwrite=True)
