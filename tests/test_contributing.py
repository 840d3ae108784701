"""The recipes of ``docs/developers/recipes.md`` work in a copy of the package with changes only in the named files."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from shutil import copytree, ignore_patterns
from typing import get_args, get_type_hints

import pytest

import fifesim
from fifesim.analysis.index_labels import INDICES

ROOT = Path(__file__).parents[1]
PACKAGE = "fifesim"

# New file of the contributor, which the recipe of a public function cannot name.
OWN_FILE = "fifesim/analysis/npp.py"

RECIPES = tomllib.loads((ROOT / "tests" / "data" / "recipes.toml").read_text(encoding="utf-8"))

# All checks run in one process to import the package only once.
_RUN = """
import json, tempfile, traceback
from functools import cache
from pathlib import Path

import numpy as np
import xarray as xr

import fifesim


def reflectance(**bands):
    grid = fifesim.grid_at("EPSG:26914", west=705000, north=4334000, width=20, height=20, cell=10)
    from odc.geo.xr import wrap_xr

    wavelengths = {"TM2": 0.56, "TM3": 0.66, "TM4": 0.83}
    rasters = [wrap_xr(np.full((2, 2), value), grid) for value in bands.values()]
    found = xr.concat(rasters, xr.DataArray(list(bands), dims="band", name="band"))
    found = found.assign_coords(wavelength=("band", [wavelengths[name] for name in bands]))
    return found.assign_attrs(units="1", standard_name="surface_bidirectional_reflectance")


@cache
def run_folder():
    # A small run, whose files several checks read. No check reads its pictures.
    from fifesim.output import report
    from fifesim.output.run_folder import simulate_to_folder

    report.png = lambda figure, dpi: b""
    scenario = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    folder = Path(tempfile.mkdtemp()) / "run"
    simulate_to_folder(scenario, folder)
    return folder


failed = {}
for name, check in json.load(open("checks.json")).items():
    try:
        exec(check, dict(globals()))
    except Exception:
        failed[name] = traceback.format_exc()
print(json.dumps({"package": fifesim.__file__, "failed": failed}))
"""


def rows():
    """Rows of the table, by recipe."""
    page = (ROOT / "docs" / "developers" / "recipes.md").read_text(encoding="utf-8")
    table = page[page.index("| a new | goes into |") :].split("\n\n")[0]
    return dict(re.findall(r"^\| (.+?) \| (.+) \|$", table, re.MULTILINE)[1:])


def named_files(row):
    """Paths named in a row, relative to the repository root."""
    roots = ("data/", "docs/", "tests/", f"{PACKAGE}/")
    names = [name for name in re.findall(r"`([^`]+)`", row) if "/" in name]
    return [name if name.startswith(roots) else f"{PACKAGE}/{name}" for name in names]


def is_named(path, row):
    """Whether a row names a file, or the folder of a new file."""
    return path == OWN_FILE or any(path == each or Path(path).parent == Path(each) for each in named_files(row))


def edit(copy, file, old="", new="", **whole):
    """Replace a passage of a file, or write the file from `text` or from the file `like`."""
    path = copy / file
    if not whole:
        text = path.read_text(encoding="utf-8")
        assert old in text, f"{file} has no {old!r}"
        whole = {"text": text.replace(old, new, 1)}
    path.write_text(whole.get("text") or (ROOT / whole["like"]).read_text(encoding="utf-8"), encoding="utf-8")


@pytest.fixture(scope="module")
def failed(tmp_path_factory):
    """Errors by recipe, in a copy of the package with all recipes applied to the files named in their rows."""
    copy, table = tmp_path_factory.mktemp("copy"), rows()
    for folder in (PACKAGE, "data", "tests/verification", "tests/data/verification"):
        copytree(ROOT / folder, copy / folder, ignore=ignore_patterns("make_*.py"))
    for name, recipe in RECIPES.items():
        for change in recipe["edits"]:
            if is_named(change["file"], table[name]):
                edit(copy, **change)
    mine = copy / "data" / "instruments" / "mine.toml"
    text = mine.read_text(encoding="utf-8").replace('name = "TM"', 'name = "MINE"')
    mine.write_text(re.sub(r"^aliases = .*$", "", text, flags=re.MULTILINE), encoding="utf-8")
    (copy / "checks.json").write_text(json.dumps({name: recipe["check"] for name, recipe in RECIPES.items()}))
    env = {"PYTHONPATH": f"{copy}:{copy / 'tests'}", "HOME": str(copy)}
    done = subprocess.run([sys.executable, "-c", _RUN], cwd=copy, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert Path(found["package"]).is_relative_to(copy)
    return found["failed"]


@pytest.mark.slow
@pytest.mark.parametrize("name", RECIPES)
def test_recipe_works(failed, name):
    assert name not in failed, failed[name]


def test_every_recipe_that_changes_code_is_tested():
    """Other tests cover documentation, tests and the STAC item."""
    others = {"field of the STAC item", "page of the documentation", "test"}
    assert set(rows()) == set(RECIPES) | others


def test_files_of_the_recipes_exist():
    missing = [path for row in rows().values() for path in named_files(row) if not (ROOT / path).exists()]
    assert missing == []


def test_annotation_of_index_names_every_index():
    assert list(get_args(get_type_hints(fifesim.index)["name"])) == list(INDICES)
