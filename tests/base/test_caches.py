"""Caches are bounded, named and clearable; results do not depend on them."""

import re
from pathlib import Path

import numpy as np
import pytest

import fifesim
from fifesim.accessor import PUBLIC, find
from fifesim.base import caches
from fifesim.base.caches import CACHES, Results, cached, clear_caches

# These modules cache the results of argument checks and name look-ups only, or define the caches.
OTHERS = {"accessor.py", "base/arguments.py", "base/caches.py"}


@pytest.fixture
def empty_registry(monkeypatch):
    """Registry of caches that holds only the caches of this test."""
    monkeypatch.setattr(caches, "CACHES", [])
    return caches.CACHES


def test_cached_results_are_recomputed_after_clearing(empty_registry):
    calls = []
    add = cached(2, "sums")(lambda a, b: calls.append((a, b)) or a + b)
    assert [add(1, 2), add(1, 2), len(calls)] == [3, 3, 1]
    clear_caches()
    assert [add(1, 2), len(calls), add.cache_info().currsize] == [3, 2, 1]
    assert [add(number, 1) for number in range(9)][-1] == 9 and add.cache_info().currsize == 2
    assert [each[:2] for each in empty_registry] == [("sums", 2)]


def test_results_shared_by_threads_are_bounded_and_cleared(empty_registry):
    shared = Results(2, "shared results")
    for number in range(4):
        shared[number] = number**2
    assert shared == {2: 4, 3: 9} and [each[:2] for each in empty_registry] == [("shared results", 2)]
    assert shared.cache_info().currsize == 2
    clear_caches()
    assert not shared


def test_every_cache_of_the_package_is_listed():
    package = Path(fifesim.__file__).parent
    found = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if re.search(r"^from functools import .*\b(lru_cache|cache)\b", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert found == OTHERS


def test_caches_are_bounded_and_have_distinct_names():
    for name in PUBLIC:
        find(name)
    assert len(CACHES) > 80
    assert len({each.what for each in CACHES}) == len(CACHES)
    assert [each.what for each in CACHES if each.size is None] == ["instruments of the package"]


def test_clearing_caches_does_not_change_results():
    def image():
        lai = fifesim.lai_scene(fifesim.fife_site(cell=10.0)[:120, :120], "burned-grazed", seed=3)
        surface = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], canopy=fifesim.Canopy(background=0.1))
        return surface.fifesim.to_toa().fifesim.sense("TM").values

    before = image()
    kept = sum(each.function.cache_info().currsize for each in CACHES)
    fifesim.clear_caches()
    assert kept > 10 and not any(each.function.cache_info().currsize for each in CACHES)
    np.testing.assert_array_equal(image(), before)
