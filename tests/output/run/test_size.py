"""What cannot fit is refused by arithmetic, with what fits."""

import re
from collections import namedtuple

import pytest

from fifesim.output.run import workers
from fifesim.output.run.workers import check_memory_of_cells, check_size, disk_of
from fifesim.scenario.scenario import parse_scenario

FLAT = {"terrain": {"dem": "flat"}}


def complete(**sections):
    return parse_scenario(FLAT | sections).complete()


@pytest.mark.parametrize(
    "sections", [{"grid": {"cell": 0.01}}, {"grid": {"cell": 0.3}, "ground": {"method": "periodic"}}]
)
def test_what_cannot_fit_is_refused_at_once_with_what_fits(tmp_path, sections):
    """The edge that the message names is accepted, and a fifth more is not."""
    with pytest.raises(ValueError, match=r"memory.*grid\.width = grid\.height") as caught:
        check_size(complete(**sections), tmp_path / "a" / "b")
    edge = float(re.search(r"grid\.height = (\S+) fits", str(caught.value))[1])

    def square(edge):
        return complete(**sections | {"grid": sections["grid"] | {"width": edge, "height": edge}})

    check_size(square(0.9 * edge), tmp_path)
    with pytest.raises(ValueError, match="fits"):
        check_size(square(1.2 * edge), tmp_path)


@pytest.mark.parametrize(("free", "refused"), [(1e6, True), (1e9, False)])
def test_a_disk_that_is_too_small_is_named(tmp_path, monkeypatch, free, refused):
    scenario = complete()
    least, most = disk_of(scenario)
    assert least == pytest.approx(500**2 * (2 + 16), rel=0.01) and most == 3.4 * least
    monkeypatch.setattr(workers.shutil, "disk_usage", lambda path: namedtuple("Usage", "free")(int(free)))
    if refused:
        with pytest.raises(OSError, match=r"space.*fits"):
            check_size(scenario, tmp_path)
    else:
        check_size(scenario, tmp_path)


def test_a_place_without_any_space_is_named(tmp_path, monkeypatch):
    """No scene fits there, however small."""
    monkeypatch.setattr(workers.shutil, "disk_usage", lambda path: namedtuple("Usage", "free")(0))
    with pytest.raises(OSError, match=f"No space left on device in {tmp_path}: name another output folder with -o"):
        check_size(complete(), tmp_path / "out")


def test_the_cells_of_a_scene_are_on_the_disk_too(tmp_path):
    scenario = complete()
    assert disk_of(scenario, scene=True)[1] - disk_of(scenario)[1] > 4 * 8 * 4000**2


def test_scenes_in_memory_are_judged_by_their_edge():
    check_memory_of_cells(333)
    with pytest.raises(ValueError, match=r"cells = 1000000: .* cells = \S+ fits"):
        check_memory_of_cells(1_000_000)
