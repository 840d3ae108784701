"""What cannot fit is refused by arithmetic, with what fits."""

import re
import time
from collections import namedtuple

import pytest

from fifesim.output.run import size
from fifesim.output.run.size import check_cells, check_size, disk_of
from fifesim.scenario.scenario import parse_scenario

FLAT = {"terrain": {"dem": "flat"}}


def complete(**sections):
    return parse_scenario(FLAT | sections).complete()


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ({"grid": {"width": 1e12}}, "of memory.*grid.width = grid.height"),
        ({"grid": {"width": 900, "height": 600, "cell": 1e-9}}, "of memory.*grid.width = grid.height"),
        ({"sensor": {"pixel": 0.001}}, "of memory.*sensor.pixel"),
        ({"grid": {"width": 3e6, "height": 3e6}, "ground": {"method": "periodic"}}, "of memory"),
    ],
)
def test_what_cannot_fit_is_refused_at_once_with_what_fits(tmp_path, sections, said):
    scenario = complete(**sections)
    start = time.process_time()
    with pytest.raises(ValueError, match=said):
        check_size(scenario, tmp_path / "a" / "b")
    assert time.process_time() - start < 1


def test_what_fits_fits(tmp_path, monkeypatch):
    """The edge that the message names is accepted, and a tenth more is not."""
    scenario = complete(grid={"width": 1e12})
    with pytest.raises(ValueError, match="fits") as caught:
        check_size(scenario, tmp_path)
    edge = float(re.search(r"grid.height = (\S+) fits", str(caught.value))[1])
    check_size(complete(grid={"width": 0.9 * edge, "height": 0.9 * edge}), tmp_path)
    with pytest.raises(ValueError, match="fits"):
        check_size(complete(grid={"width": 1.2 * edge, "height": 1.2 * edge}), tmp_path)


@pytest.mark.parametrize(("free", "refused"), [(1e6, True), (1e9, False)])
def test_a_disk_that_is_too_small_is_named(tmp_path, monkeypatch, free, refused):
    scenario = complete()
    assert disk_of(scenario) == pytest.approx(3.4 * 500**2 * (2 + 16), rel=0.01)
    monkeypatch.setattr(size.shutil, "disk_usage", lambda path: namedtuple("Usage", "free")(int(free)))
    if refused:
        with pytest.raises(ValueError, match=r"of disk.*fits"):
            check_size(scenario, tmp_path)
    else:
        check_size(scenario, tmp_path)


def test_the_cells_of_a_scene_are_on_the_disk_too(tmp_path):
    scenario = complete()
    assert disk_of(scenario, scene=True) - disk_of(scenario) > 4 * 8 * 4000**2


def test_scenes_in_memory_are_judged_by_their_edge():
    check_cells(333)
    with pytest.raises(ValueError, match=r"cells = 1000000: .* cells = \S+ fits"):
        check_cells(1_000_000)
