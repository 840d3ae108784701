"""What functions keep is bounded, named and given back; results do not depend on it."""

import re
from pathlib import Path

import numpy as np
import pytest

import fifesim
from fifesim.base import caches
from fifesim.base.caches import CACHES, Results, cached, clear_caches

# Functions that check arguments or find public names keep no results.
OTHERS = {"accessor.py", "base/arguments.py", "base/caches.py"}


@pytest.fixture
def own(monkeypatch):
    """Caches of this test alone."""
    monkeypatch.setattr(caches, "CACHES", [])
    return caches.CACHES


def test_what_is_kept_is_made_once_and_again_when_it_is_cleared(own):
    calls = []
    add = cached(2, "sums")(lambda a, b: calls.append((a, b)) or a + b)
    assert [add(1, 2), add(1, 2), len(calls)] == [3, 3, 1]
    clear_caches()
    assert [add(1, 2), len(calls), add.cache_info().currsize] == [3, 2, 1]
    assert [each[:2] for each in own] == [("sums", 2)]


def test_no_more_is_kept_than_the_cache_may_hold(own):
    double = cached(3, "doubles")(lambda number: 2 * number)
    assert [double(number) for number in range(9)][-1] == 16
    assert double.cache_info().currsize == own[0].size == 3


def test_results_that_threads_share_are_bounded_and_cleared(own):
    shared = Results(2, "shared results")
    for number in range(4):
        shared[number] = number**2
    assert shared == {2: 4, 3: 9} and [each[:2] for each in own] == [("shared results", 2)]
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


def test_caches_are_bounded_and_have_names_of_their_own():
    for name in fifesim.__all__:
        getattr(fifesim, name)
    assert len(CACHES) > 80
    assert len({each.what for each in CACHES}) == len(CACHES)
    assert [each.what for each in CACHES if each.size is None] == ["instruments of the package"]


def test_results_are_the_same_bits_after_caches_are_cleared():
    def image():
        lai = fifesim.lai_scene(fifesim.fife_site(cell=10.0)[:120, :120], "burned-grazed", seed=3)
        surface = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], canopy=fifesim.Canopy(background=0.1))
        return surface.fifesim.to_toa().fifesim.sense("TM").values

    before = image()
    kept = sum(each.function.cache_info().currsize for each in CACHES)
    fifesim.clear_caches()
    assert kept > 10 and not any(each.function.cache_info().currsize for each in CACHES)
    np.testing.assert_array_equal(image(), before)
