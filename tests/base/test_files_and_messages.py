"""Files, messages, caches and compiled kernels: nothing blocks, changes or stops a run, and no message is long."""

import importlib.util
import os
import warnings

import numba
import numpy as np
import pytest
from numba.core.caching import CacheImpl

import fifesim
from fifesim.accessor import PUBLIC, find
from fifesim.base import arrays, caches, files
from fifesim.base.caches import CACHES, Results, cached, clear_caches
from fifesim.base.files import check_regular, in_a_line, read_toml, shown, whole_file
from fifesim.base.messages import is_quiet, nearest, quiet, warn


def test_only_regular_files_are_opened(tmp_path):
    """Opening a pipe without a writer would block for ever."""
    os.mkfifo(tmp_path / "pipe")
    for name, kind in (("pipe", "a pipe"), ("", "a folder"), ("/dev/null", "a device")):
        for read in (check_regular, read_toml):
            with pytest.raises(ValueError, match=f"is {kind}: name a file"):
                read(tmp_path / name)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(OSError, match="loop"):
        check_regular(tmp_path / "loop")


BREAKING = [
    ("a = ", "not valid TOML"),
    ("a = " + "[" * 100_000, "too deeply"),
    ("'a' . " * 100_000 + "a = 1", "too deeply"),
    ("x = { " + "a." * 100_000 + "a = 1 }", "too deeply"),
    ("a = " + "9" * 5000, "not valid TOML"),
    ("a = 1\n" * 200_000, "has 1200000 bytes: a file of keys has at most 1000000"),
    ("'\x1b' = 1", "not valid TOML"),
]


def test_text_that_would_break_the_parser_is_rejected(tmp_path):
    """Dots of a path do not count as nesting."""
    for text, said in BREAKING:
        (tmp_path / "a\x1bb.toml").write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=said) as caught:
            read_toml(tmp_path / "a\x1bb.toml")
        assert str(caught.value).startswith(r"a\x1bb.toml") and len(str(caught.value)) < 300
        assert str(caught.value).isprintable()
    (tmp_path / "a.toml").write_text(f"file = '{'../' * 1000}a.b.tif'")
    assert read_toml(tmp_path / "a.toml")["file"].endswith("a.b.tif")


def test_any_value_is_shown_in_at_most_60_printable_characters():
    """The end of a long line is kept."""
    deep = {}
    for _ in range(100_000):
        deep = {"a": deep}
    odd = ["a" * 1000, "\x1b[31m\n", 16**6000, list(range(1000)), {"k" * 1000: 1}, b"\0" * 1000, "röd\u202e", deep]
    assert all(len(shown(value)) <= 60 and shown(value).isprintable() for value in odd)
    line = in_a_line("key: " + "a\n" * 1000 + ": type another")
    assert line.startswith("key: a\\n") and line.endswith(": type another") and len(line) <= 400


def test_tables_are_modifiable_copies():
    table = files.table("lai_distributions.csv")
    table["mean"] = -1.0
    assert (files.table("lai_distributions.csv")["mean"] > 0).all()
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


def test_warning_points_outside_the_package_and_quiet_ends_with_its_context():
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warn("careful")
    assert [(str(each.message), each.filename) for each in said] == [("careful", __file__)]
    with quiet():
        with quiet(False):
            assert not is_quiet()
        assert is_quiet()
    assert not is_quiet()
    assert nearest("sens", ["sense", "slope"]) == "did you mean 'sense'? " and nearest("zzz", ["sense", "slope"]) == ""


@pytest.fixture
def empty_registry(monkeypatch):
    """Registry of caches that holds only the caches of this test."""
    monkeypatch.setattr(caches, "CACHES", [])
    return caches.CACHES


def test_cached_results_are_bounded_and_recomputed_after_clearing(empty_registry):
    calls = []
    add = cached(2, "sums")(lambda a, b: calls.append((a, b)) or a + b)
    assert [add(1, 2), add(1, 2), len(calls)] == [3, 3, 1]
    clear_caches()
    assert [add(1, 2), len(calls), add.cache_info().currsize] == [3, 2, 1]
    assert [add(number, 1) for number in range(9)][-1] == 9 and add.cache_info().currsize == 2
    shared = Results(2, "shared results")
    for number in range(4):
        shared[number] = number**2
    assert shared == {2: 4, 3: 9} and shared.cache_info().currsize == 2
    assert [each[:2] for each in empty_registry] == [("sums", 2), ("shared results", 2)]
    clear_caches()
    assert not shared


def test_caches_are_bounded_and_have_distinct_names():
    for name in PUBLIC:
        find(name)
    assert len({each.what for each in CACHES}) == len(CACHES) > 80
    assert [each.what for each in CACHES if each.size is None] == ["instruments of the package"]


def test_clearing_caches_does_not_change_results():
    def image():
        lai = fifesim.lai_scene(fifesim.fife_site(cell=10.0)[:60, :60], "burned-grazed", seed=3)
        surface = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], canopy=fifesim.Canopy(background=0.1))
        return surface.fifesim.to_toa().fifesim.sense("TM").values

    before = image()
    kept = sum(each.function.cache_info().currsize for each in CACHES)
    fifesim.clear_caches()
    assert kept > 10 and not any(each.function.cache_info().currsize for each in CACHES)
    np.testing.assert_array_equal(image(), before)


SOURCE = """
from fifesim.base.arrays import compiled

@compiled
def double(value):
    return 2.0 * value
"""


@pytest.fixture
def double(tmp_path, monkeypatch):
    """Function that imports a kernel anew, as another process would."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "kernels.py").write_text(SOURCE)

    def imported():
        arrays._warned.clear()
        spec = importlib.util.spec_from_file_location("kernels", tmp_path / "kernels.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.double

    yield imported
    arrays._warned.clear()


def test_damaged_files_of_kernels_are_replaced_with_a_warning(double, tmp_path):
    """Without a check, numba stops at short files and runs machine code with changed bits."""
    assert double()(2.0) == 4.0
    for path in (*tmp_path.rglob("*.nbi"), *tmp_path.rglob("*.nbc")):
        whole = path.read_bytes()
        middle = len(whole) // 2
        for content in (b"", whole[:middle], whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]):
            path.write_bytes(content)
            kernel = double()
            with pytest.warns(UserWarning, match=r"compiled kernels in .*cache.*damaged files are removed"):
                assert kernel(2.0) == 4.0
            again = double()
            assert again(2.0) == 4.0 and sum(again.stats.cache_hits.values()) == 1


def test_kernels_run_where_no_cache_can_be_read_or_written(double, tmp_path, monkeypatch):
    assert double()(2.0) == 4.0
    (path,) = tmp_path.rglob("*.nbi")
    path.unlink()
    path.mkdir()
    kernel = double()
    with pytest.warns(UserWarning, match=r"cannot be used \(Is a directory\)") as told:
        assert kernel(2.0) == 4.0
    assert len(told) == 1
    monkeypatch.setattr(CacheImpl, "_locator_classes", [])
    with pytest.warns(UserWarning, match="no folder can be written"):
        assert double()(2.0) == 4.0
