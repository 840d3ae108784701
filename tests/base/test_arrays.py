"""Compiled kernels: damaged or unwritable files of a cache never change or stop a run."""

import importlib.util
import warnings

import numba
import numpy as np
import pytest
from numba.core.caching import CacheImpl

from fifesim.base import arrays

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


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_damaged_files_of_kernels_are_replaced_with_a_warning(double, tmp_path, suffix):
    """Without a check, numba stops at short files and runs machine code with changed bits."""
    assert double()(2.0) == 4.0
    (path,) = tmp_path.rglob(f"*.{suffix}")
    whole = path.read_bytes()
    middle = len(whole) // 2
    flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    for content in (b"", np.random.default_rng(1).bytes(len(whole)), whole[:middle], flipped):
        path.write_bytes(content)
        kernel = double()
        with pytest.warns(UserWarning, match=r"compiled kernels in .*cache.*damaged files are removed"):
            assert kernel(2.0) == 4.0
        with warnings.catch_warnings():
            warnings.simplefilter("error")
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
