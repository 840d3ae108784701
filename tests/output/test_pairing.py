"""What a run of the paper's ground says of the paper's Table 2."""

import re

import pytest

from fifesim.output.report import pairing_rows
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate

GRID = {"width": 1110, "height": 1110}


class Fit:
    """A line."""

    r2 = 0.931


def rows(fits=None, **sections):
    values = {"grid": GRID, "ground": {"distribution": "burned-grazed", "arp": 0.15}}
    values |= {"sensor": {"response": "paper"}} | sections
    return pairing_rows(parse_scenario(values).complete(), {"lai": Fit} if fits is None else fits)


def test_run_of_the_papers_ground_says_why_its_r2_is_another():
    (_, why), (_, typed) = rows()
    assert why.startswith("0.61, and 0.93 here") and "30.315 m apart" in why
    assert 'interval = "native" in [sensor]' in typed and "fifesim reproduce" in typed
    # What it says is what a run with that key gives, on level ground.
    native = parse_scenario(
        {
            "grid": GRID,
            "ground": {"distribution": "burned-grazed", "arp": 0.15},
            "terrain": {"dem": "flat"},
            "sensor": {"interval": "native", "response": "paper"},
        }
    )
    run = simulate(native, chunks=None)
    truth, ndvi = run["truth"]["lai"].values, run["image"]["ndvi"].values
    n = min(len(truth), len(ndvi))
    pairs = [(a, b) for a, b in zip(truth[:n, :n].ravel(), ndvi[:n, :n].ravel(), strict=True) if a == a and b == b]
    x, y = zip(*pairs, strict=True)
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    xy = sum((a - mean_x) * (b - mean_y) for a, b in pairs)
    r2 = xy**2 / sum((a - mean_x) ** 2 for a in x) / sum((b - mean_y) ** 2 for b in y)
    assert float(re.search(r"R² (0\.\d\d) for 333 x 333 cells", typed)[1]) == pytest.approx(r2, abs=0.0051)
    assert 0.45 < r2 < 0.7


@pytest.mark.parametrize(
    "sections",
    [
        {"sensor": {"interval": "native", "response": "paper"}},
        {"sensor": {"instrument": "OLI"}},
        {"sensor": {}},
        {"ground": {"arp": 0.2, "distribution": "burned-grazed"}},
        {"fits": {}},
    ],
    ids=str,
)
def test_other_runs_are_not_compared(sections):
    assert rows(**sections) == []


def test_small_scene_says_what_to_type_alone():
    (_, why), (_, typed) = rows(grid={"width": 120, "height": 120})
    assert why.startswith("0.61") and typed.startswith("use interval")
