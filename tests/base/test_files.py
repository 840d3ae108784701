"""Input files and package tables: no file blocks a reader, and no value makes a message long or unprintable."""

import os
import socket

import pytest

from fifesim.base import files
from fifesim.base.files import check_regular, in_a_line, read_toml, shown, whole_file


def test_only_regular_files_are_opened(tmp_path, monkeypatch):
    """Opening a pipe without a writer would block for ever."""
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as listening:
        # Use a relative path, because the path of a socket is limited to 107 characters.
        monkeypatch.chdir(tmp_path)
        listening.bind("socket")
        for name, kind in (("pipe", "a pipe"), (".", "a folder"), ("/dev/null", "a device"), ("socket", "a socket")):
            for read in (check_regular, read_toml):
                with pytest.raises(ValueError, match=f"is {kind}: name a file"):
                    read(tmp_path / name)


def test_missing_file_raises_oserror(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_toml(tmp_path / "none.toml")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(OSError):
        check_regular(tmp_path / "loop")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = ", "not valid TOML"),
        ("a = " + "[" * 100_000, "too deeply"),
        ("a." * 100_000 + "a = 1", "too deeply"),
        ("'a' . " * 100_000 + "a = 1", "too deeply"),
        ("x = { " + "a." * 100_000 + "a = 1 }", "too deeply"),
        ("a = " + "9" * 5000, "not valid TOML"),
        ("a = 1\n" * 200_000, "has 1200000 bytes: a file of keys has at most 1000000"),
        ("'\x1b' = 1", "not valid TOML"),
    ],
    ids=["cut", "brackets", "dots", "quoted", "dots inside", "digits", "size", "escape"],
)
def test_text_that_would_break_the_parser_is_rejected(tmp_path, text, said):
    (tmp_path / "a\x1bb.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=said) as caught:
        read_toml(tmp_path / "a\x1bb.toml")
    assert str(caught.value).startswith(r"a\x1bb.toml") and len(str(caught.value)) < 300
    assert str(caught.value).isprintable()


def test_dots_of_a_path_do_not_count_as_nesting(tmp_path):
    (tmp_path / "a.toml").write_text(f"file = '{'../' * 1000}a.b.tif'")
    assert read_toml(tmp_path / "a.toml")["file"].endswith("a.b.tif")


def deep(levels):
    found = {}
    for _ in range(levels):
        found = {"a": found}
    return found


@pytest.mark.parametrize(
    "value",
    ["a" * 1000, "\x1b[31m\n", 16**6000, list(range(1000)), deep(100_000), {"k" * 1000: 1}, b"\0" * 1000, "röd\u202e"],
    ids=["long", "escapes", "digits", "list", "deep", "key", "bytes", "right to left"],
)
def test_any_value_is_shown_in_at_most_60_printable_characters(value):
    assert len(shown(value)) <= 60 and shown(value).isprintable()


def test_end_of_a_long_line_is_kept():
    line = in_a_line("key: " + "a\n" * 1000 + ": type another")
    assert line.startswith("key: a\\n") and line.endswith(": type another") and len(line) <= 400


def test_tables_are_modifiable_copies():
    table = files.table("lai_distributions.csv")
    table["mean"] = -1.0
    assert (files.table("lai_distributions.csv")["mean"] > 0).all()


def test_missing_table_is_named():
    with pytest.raises(FileNotFoundError, match=r"'no_such\.csv'"):
        files.path("no_such.csv")


def test_file_is_on_the_disk_before_it_gets_its_name(tmp_path, monkeypatch):
    """A power cut leaves the old file or the new one."""
    done, flush, replace = [], os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda number: (done.append(os.stat(number).st_ino), flush(number)))
    monkeypatch.setattr(os, "replace", lambda new, path: (done.append("named"), replace(new, path)))
    with whole_file(tmp_path / "a.txt") as new:
        new.write_text("new")
    assert done == [(tmp_path / "a.txt").stat().st_ino, "named", tmp_path.stat().st_ino]


def test_file_is_replaced_by_a_complete_one_only(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), whole_file(path) as new:
        new.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    with whole_file(path) as new:
        assert new.suffix == ".txt" and not any(new.parent.iterdir())
        new.write_text("new")
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]
    for wrong, error in ((tmp_path, IsADirectoryError), (tmp_path / "none" / "a.txt", FileNotFoundError)):
        with pytest.raises(error), whole_file(wrong):
            pass
