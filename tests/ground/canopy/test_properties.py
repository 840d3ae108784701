"""Properties of the canopy: their defaults and ranges, and the places that take them from one table."""

import os
import subprocess
import sys
from pathlib import Path
from shutil import copytree

from fifesim.ground.canopy.properties import DRAWN, NUMERIC_PROPERTIES, PROPERTIES

ROOT = Path(__file__).parents[3]
BY_CELL = [name for name, known in NUMERIC_PROPERTIES.items() if known.by_cell]


def test_numbers_have_these_defaults_and_ranges():
    known = {name: (each.default, each.lowest, each.highest) for name, each in NUMERIC_PROPERTIES.items()}
    assert known == {
        "hotspot": (0.0, 0, 10),
        "brown": (0.0, 0, 1),
        "dissociation": (0.0, 0, 1),
        "crown_cover": (1.0, 0, 1),
        "crown_shape": (1.0, 0, 10),
        "soil": (0.0, -1, 1),
        "moisture": (0.0, 0, 1),
    }
    assert set(PROPERTIES) - set(NUMERIC_PROPERTIES) == {
        "leaf_optics",
        "leaf_angles",
        "model",
        "brown_leaf",
        "background",
    }
    assert set(BY_CELL) == {"brown", "dissociation", "crown_cover", "soil", "moisture"}
    assert {name: each.effect for name, each in DRAWN.items()} == {
        "brown": "dead leaves",
        "crown_cover": "clumping",
        "soil": "soil",
        "moisture": "soil",
    }


# A property that no model uses yet.
ONE_MORE = {
    "properties.py": ('\n    "background"', '\n    "clumping": Property(1.0, "clumping index", "1", 0.2, 1),'),
    "description.py": ("\n    given: frozenset", "\n    clumping: float | None = None"),
}

WITH_ONE_MORE = """
import fifesim
from fifesim.scenario.ground import canopy_of
from fifesim.scenario.scenario import find_key
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.toml import write_scenario


def refused(make, message):
    try:
        make()
    except (TypeError, ValueError) as error:
        assert message in str(error), error
    else:
        raise AssertionError(message)


half = fifesim.Canopy(clumping=0.5)
assert fifesim.Canopy().clumping == 1.0 and repr(half) == "Canopy(clumping=0.5)"
lai = fifesim.lai_scene(fifesim.fife_site(10, window=((0, 12), (0, 12))), seed=1)
lai.fifesim.surface_reflectance("TM", bands=["TM3"], canopy=half)
assert fifesim.CoverClass("wood", canopy=half).canopy.clumping == 0.5
refused(lambda: fifesim.Canopy(clumping=0.1), "clumping must be in [0.2, 1], got 0.1: it is the clumping index")
refused(lambda: lai.fifesim.surface_reflectance("TM", clumping=0.5), "type canopy=fifesim.Canopy(clumping=...)")
refused(lambda: parse_scenario({"ground": {"clumping": 0.1}}), "ground.clumping = 0.1: must be at least 0.2")

classes = {"a": {"clumping": 0.5}, "b": {}}
case = parse_scenario({"ground": {"clumping": 0.7}, "landscape": {"cover": "voronoi"}, "classes": classes})
text = write_scenario(case)
assert "\\nclumping = 0.7 # 1; clumping index\\n" in text.split("[landscape]")[0]
assert "\\nclumping = 0.5 # 1; clumping index\\n" in text.split("[classes.a]")[1]
scene = canopy_of(case)
assert [each.canopy.over(scene).clumping for each in case.class_table().values()] == [0.5, 0.7]
assert find_key("clumping").name == "ground.clumping"
assert find_key("classes.a.clumping").name == "classes.a.clumping"
assert find_key("clumping").attributes == {"long_name": "clumping index", "units": "1"}
small = parse_scenario({"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}})
assert fifesim.sweep(small, {"clumping": [0.5, 1.0]})["clumping"].values.tolist() == [0.5, 1.0]
print(fifesim.__file__)
"""


def test_one_more_property_is_two_lines(tmp_path):
    """It is a field of classes too, a key of the scenario and an axis of sweeps, without other edits."""
    for folder in ("fifesim", "data"):
        copytree(ROOT / folder, tmp_path / folder)
    for name, (place, line) in ONE_MORE.items():
        path = tmp_path / "fifesim/ground/canopy" / name
        text = path.read_text(encoding="utf-8")
        assert text.count(place) == 1
        path.write_text(text.replace(place, line + place), encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "-W", "error::UserWarning", "-c", WITH_ONE_MORE],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr[-2000:]
    assert Path(run.stdout.strip()).parents[1] == tmp_path
