"""The recipes of ``docs/contributing.md`` work on a copy of the package, in the files that they name."""

import json
import re
import subprocess
import sys
from pathlib import Path
from shutil import copytree, ignore_patterns
from textwrap import dedent
from typing import get_args, get_type_hints

import pytest

import fifesim
from fifesim.analysis.index_labels import INDICES

ROOT = Path(__file__).parents[1]
PACKAGE = "fifesim"

# The author's own file, which the recipe of a public function cannot name.
OWN_FILE = "fifesim/analysis/gpp.py"

# Edits by recipe: a file with its text, or a file with an old and a new passage. Then a check of the copy.
RECIPES = {
    "leaf angle distribution": (
        [("fifesim/ground/canopy/leaf_angles.py", "_CUMULATIVE = {\n", '_CUMULATIVE = {\n    "flat": np.sin,\n')],
        """
        from fifesim.ground.canopy.leaf_angles import leaf_angle_classes

        # Half of the leaf area is flatter than 30 degrees.
        assert abs(sum(leaf_angle_classes("flat").fraction[:30]) - 0.5) < 1e-12
        assert fifesim.Scenario(ground={"leaf_angles": "flat"}).ground.leaf_angles == "flat"
        """,
    ),
    "gas": (
        [
            ("fifesim/atmosphere/gases.py", '"ch4": 1.72e-6}', '"ch4": 1.72e-6, "no2": 1e-6}'),
            ("data/gas_absorption.csv", "\nh2o,0.57,", "\nno2,0.45,0.5,0,0,0,0,0\nh2o,0.57,"),
        ],
        """
        from fifesim.atmosphere.gases import gas_transmittance

        air = fifesim.Atmosphere()
        one, every = gas_transmittance(0.45, air, [1.0], gases=("no2",)), gas_transmittance(0.45, air, [1.0])
        assert every[0, 0] <= one[0, 0] < 0.9
        """,
    ),
    "aerosol": (
        [("fifesim/atmosphere/mixtures.py", "MODELS = {\n", 'MODELS = {\n    "smoke": {"soot": 1.0},\n')],
        """
        assert fifesim.Atmosphere(aerosol="soot:1").aerosol == "smoke"
        assert fifesim.Scenario(atmosphere={"aerosol": "smoke"}).atmosphere.aerosol == "smoke"
        """,
    ),
    "scheme of the atmosphere": (
        [
            (
                "fifesim/atmosphere/bright.py",
                """
                from fifesim.atmosphere.five_s import five_s_scattering


                def bright_scattering(*given):
                    found = five_s_scattering(*given)
                    return found._replace(reflectance=2 * found.reflectance)
                """,
            ),
            (
                "fifesim/atmosphere/engines.py",
                "\nSCATTERING = {\n",
                "\nfrom fifesim.atmosphere.bright import bright_scattering\n\n"
                'SCATTERING = {\n    "bright": bright_scattering,\n',
            ),
            ("fifesim/atmosphere/__init__.py", ', "6S")', ', "bright", "6S")'),
        ],
        """
        from fifesim.atmosphere.engines import scattering

        air = fifesim.Scenario(atmosphere={"engine": "bright"}).model_atmosphere()
        wavelength, angles = np.array([0.55]), (30.0, np.array([0.0]), np.array([0.0]))
        bright, usual = (scattering(each, wavelength, *angles) for each in (air, fifesim.Atmosphere(visibility=45)))
        assert (bright.reflectance == 2 * usual.reflectance).all()
        """,
    ),
    "instrument": (
        [("data/instruments/mine.toml", (ROOT / "data" / "instruments" / "tm.toml").read_text(encoding="utf-8"))],
        """
        assert "MINE" in fifesim.instrument_names() and fifesim.instrument("MINE").bits == 8
        """,
    ),
    "kind of line spread": (
        [
            (
                "fifesim/sensor/response/spatial.py",
                "@dataclass(frozen=True)\nclass GaussianSpread(",
                dedent(
                    """
                    @dataclass(frozen=True)
                    class TriangleSpread(FiniteSpread):
                        def _cumulative(self, x):
                            x = np.clip(x / self.half_width, -1, 1)
                            return 0.5 + x - x * np.abs(x) / 2

                        def _mtf(self, frequency):
                            return np.sinc(frequency * self.half_width) ** 2


                    @dataclass(frozen=True)
                    class GaussianSpread("""
                ).lstrip(),
            ),
            (
                "fifesim/sensor/description/spatial_response.py",
                "\nAxisResponse = Annotated[\n    CosineResponse |",
                dedent(
                    """
                    from fifesim.sensor.response.spatial import TriangleSpread


                    @dataclass(frozen=True, config=CONFIG)
                    class TriangleResponse:
                        kind: Literal["triangle"]
                        width: Positive

                        def spread(self, view):
                            return TriangleSpread(self.width * view.altitude)


                    AxisResponse = Annotated[
                        TriangleResponse | CosineResponse |"""
                ),
            ),
            ("fifesim/sensor/description/fields.py", '"cosine", "boxcar"', '"triangle", "cosine", "boxcar"'),
        ],
        """
        from pathlib import Path

        text = Path("data/instruments/tm.toml").read_text(encoding="utf-8").replace('"cosine"', '"triangle"')
        text = text.replace("[lsf]", "[old]").replace("[paper_lsf]", "[lsf]").replace("paper_lsf =", "# paper_lsf =")
        text = text[: text.index("[old]")] + text[text.index("[lsf]") :]
        file = Path("triangle.toml")
        file.write_text(text.replace("step = 4.778e-6", "width = 43e-6").replace("count = 9", ""), encoding="utf-8")
        transfer = fifesim.mtf(fifesim.read_instrument(file), "TM3", frequency=[0.0, 1 / (43e-6 * 705e3)])
        assert np.allclose(np.squeeze(transfer), [1.0, (2 / np.pi) ** 2]), transfer
        file.write_text(text, encoding="utf-8")
        try:
            fifesim.read_instrument(file)
        except ValueError as error:
            assert "lsf.triangle" not in str(error) and "lsf.width" in str(error), error
        """,
    ),
    "vegetation index": (
        [
            (
                "fifesim/analysis/indices.py",
                "def enhanced(",
                dedent(
                    """
                    def green_difference(nir, green):
                        return _ratio(np.asarray(nir, float) - green, np.asarray(nir, float) + green)


                    def enhanced("""
                ).lstrip(),
            ),
            (
                "fifesim/analysis/index_labels.py",
                "INDICES = {\n",
                'INDICES = {\n    "GNDVI": (indices.green_difference, (NEAR_INFRARED, GREEN)),\n',
            ),
            (
                "fifesim/grids/cf.py",
                "QUANTITIES = {\n",
                'QUANTITIES = {\n    "gndvi": Quantity("1", "", "green NDVI", label="GNDVI", colours="YlGn"),\n',
            ),
            ("fifesim/chain/steps.py", 'Literal["NDVI", ', 'Literal["GNDVI", "NDVI", '),
        ],
        """
        from typing import get_type_hints

        from fifesim.output import colours, colours as words

        rho = reflectance(TM2=0.25, TM4=0.75)
        found = rho.fifesim.index("GNDVI")
        assert float(found[0, 0]) == 0.5 and found.attrs["long_name"] == "green NDVI"
        assert "'GNDVI'" in str(get_type_hints(fifesim.index)["name"])
        assert words.short_name(found) == "GNDVI"
        assert colours.colours_of("gndvi")[0].name == "YlGn"
        """,
    ),
    "key of a scenario": (
        [
            (
                "fifesim/scenario/keys.py",
                '    seed: int = seed(0, "seed of the noise")\n',
                '    seed: int = seed(0, "seed of the noise")\n    polish: float = number(0.5, "1", "of the mirror")\n',
            ),
            (
                "fifesim/scenario/sections.py",
                '    @field_validator("noise")\n',
                '    @field_validator("polish")\n'
                "    @classmethod\n"
                "    def _known_polish(cls, value):\n"
                "        if value > 1:\n"
                '            raise ValueError("must be at most 1")\n'
                "        return value\n\n"
                '    @field_validator("noise")\n',
            ),
            (
                "fifesim/scenario/simulation.py",
                "        seed=own.seed,\n",
                "        seed=own.seed,\n        polish=own.polish,\n",
            ),
            (
                "fifesim/chain/setup.py",
                "    quantise: bool = True\n",
                "    quantise: bool = True\n    polish: float = 0.5\n",
            ),
        ],
        """
        from fifesim.scenario.simulation import setup_of

        assert setup_of(fifesim.Scenario(sensor={"polish": 0.9})).polish == 0.9
        try:
            fifesim.Scenario(sensor={"polish": 1.5})
        except ValueError as error:
            assert "polish" in str(error)
        else:
            raise AssertionError("polish")
        """,
    ),
    "public function": (
        [
            (
                OWN_FILE,
                '''
                from __future__ import annotations

                import xarray as xr

                from fifesim.grids import cf


                def gpp(fpar: xr.DataArray, efficiency: float = 2.0) -> xr.DataArray:
                    """
                    Gross primary production.

                    Examples
                    --------
                    >>> from fifesim import gpp
                    """
                    return cf.label(efficiency * fpar, "gpp", source=fpar, history="gpp")
                ''',
            ),
            (
                "fifesim/__init__.pyi",
                "# Pictures\n",
                "from .analysis.gpp import gpp as gpp  # method\n\n# Pictures\n",
            ),
            (
                "fifesim/grids/cf.py",
                'QUANTITIES = {\n    "',
                'QUANTITIES = {\n    "gpp": Quantity("g m-2 d-1", "", "gross primary production"),\n    "',
            ),
        ],
        """
        fpar = reflectance(TM4=0.5).squeeze("band", drop=True).drop_attrs()
        assert "gpp" in dir(fifesim)
        for found in (fifesim.gpp(fpar, 4.0), fpar.fifesim.gpp(4.0)):
            assert found.name == "gpp" and found.attrs["units"] == "g m-2 d-1" and float(found[0, 0]) == 2.0
        for given in ({"fpar": "10"}, {"fpar": fpar, "efficiency": "10"}):
            try:
                fifesim.gpp(**given)
            except TypeError as error:
                assert "must be" in str(error), error
            else:
                raise AssertionError(given)
        """,
    ),
    "property of the canopy": (
        [
            (
                "fifesim/ground/canopy/properties.py",
                '    "background": ',
                '    "gloss": Property(0.0, "gloss of the leaves", "1"),\n    "background": ',
            ),
            (
                "fifesim/ground/canopy/description.py",
                "    given: frozenset",
                "    gloss: float | None = None\n    given: frozenset",
            ),
        ],
        """
        from fifesim.scenario.simulation import setup_of

        scenario = fifesim.Scenario(ground={"gloss": 0.2})
        assert setup_of(scenario).canopy.gloss == 0.2 and fifesim.Canopy().gloss == 0.0
        """,
    ),
    "quantity of a raster or file": (
        [
            (
                "fifesim/grids/cf.py",
                "QUANTITIES = {\n",
                'QUANTITIES = {\n    "gloss_map": Quantity("1", "", "gloss", label="gloss", colours="bone"),\n',
            ),
        ],
        """
        from fifesim.output import colours
        from fifesim.grids import cf

        found = cf.label(reflectance(TM4=0.5).isel(band=0), "gloss_map", history="made")
        assert found.attrs["long_name"] == "gloss" and colours.colours_of("gloss_map")[0].name == "bone"
        """,
    ),
    "kind of argument": (
        [
            (
                "fifesim/base/annotations.py",
                "from typing import ",
                "from typing import Annotated as _Annotated\n"
                "from fifesim.base.arguments import Kind as _Kind\n"
                'Percent = _Annotated[float, _Kind("a percentage", lambda value: 0 <= value <= 100)]\n'
                "from typing import ",
            ),
        ],
        """
        from fifesim.base.annotations import Percent
        from fifesim.base.arguments import checked


        def half(share: Percent):
            return share / 2


        assert checked(half)(50) == 25
        try:
            checked(half)(150)
        except TypeError as error:
            assert "share must be a percentage, got 150" in str(error)
        else:
            raise AssertionError("share")
        """,
    ),
    "check of an installation": (
        [
            (
                "fifesim/experiments/verification/analysis.py",
                "\nCHECKS = (",
                '\ndef _mine():\n    yield _deviation("mine", 0.5, 1.0, "1", "theory")\n\n\nCHECKS = (_mine, ',
            )
        ],
        """
        from fifesim.experiments.verification import areas

        (found,) = areas.AREAS["analysis"][0]()
        assert found.what == "mine" and found.within
        """,
    ),
    "published benchmark": (
        [
            ("data/verification/theirs.csv", "# Source: theory\nx,y\n1,2\n"),
            (
                "fifesim/experiments/verification/benchmarks.py",
                "\nCHECKS = (",
                '\ndef _theirs():\n    table = files.table("verification/theirs.csv")\n'
                '    yield _deviation("theirs", largest(2 * table["x"], table["y"]), 1e-12, "1", "theory")\n'
                "\n\nCHECKS = (_theirs, ",
            ),
        ],
        """
        from fifesim.experiments.verification import areas, benchmarks

        assert benchmarks._theirs in areas.AREAS["atmosphere"]
        (found,) = benchmarks._theirs()
        assert found.deviation == 0
        """,
    ),
    "product reader": (
        [
            (
                "fifesim/sensor/products/mine_labels.py",
                '''
                """A product of digital numbers with one file for each band."""

                from __future__ import annotations

                import os
                from pathlib import Path

                import xarray as xr

                from fifesim.sensor.products.labels import calibrate, open_layer


                def open_mine(folder: str | os.PathLike) -> xr.DataArray:
                    """
                    Image of my product.

                    Examples
                    --------
                    >>> from fifesim import open_mine
                    """
                    bands = ("TM3", "TM4")
                    layers = [open_layer(Path(folder), f"{name}.tif", None, "unpack the product") for name in bands]
                    counts = xr.concat(layers, xr.Variable("band", list(bands)), combine_attrs="drop")
                    return calibrate(counts, "TM", time="1987-06-06T16:35")
                ''',
            ),
            (
                "fifesim/__init__.pyi",
                "# Pictures\n",
                "from .sensor.products.mine_labels import open_mine as open_mine\n\n# Pictures\n",
            ),
        ],
        """
        import tempfile
        from pathlib import Path

        folder = Path(tempfile.mkdtemp())
        for name, count in (("TM3", 40), ("TM4", 80)):
            counts = reflectance(TM3=count).isel(band=0).astype("uint8").drop_attrs()
            counts.rio.write_crs("EPSG:26914").rio.to_raster(folder / f"{name}.tif")
        image = fifesim.open_mine(folder)
        assert image["band"].values.tolist() == ["TM3", "TM4"] and image.dtype == "uint8"
        assert 0 < float(image.fifesim.ndvi().mean()) < 1
        try:
            fifesim.open_mine(folder / "other")
        except ValueError as error:
            assert "TM3.tif is missing" in str(error) and "unpack the product" in str(error), error
        else:
            raise AssertionError("a missing file")
        """,
    ),
    "panel of the report": (
        [
            (
                "fifesim/output/report.py",
                "        title=headline(scenario),\n",
                '        title=headline(scenario),\n        greenest=float(truth["lai"].max()),\n',
            ),
            (
                "fifesim/output/report.html.j2",
                "{% block content %}\n",
                "{% block content %}\n<section><h2>Greenest pixel</h2>{{ greenest | fixed }}</section>\n",
            ),
        ],
        """
        assert "<h2>Greenest pixel</h2>" in (run_folder() / "report.html").read_text(encoding="utf-8")
        """,
    ),
    "file that a run writes": (
        [
            ("fifesim/output/run/folder.py", 'FILES = (\n    "image.tif"', 'FILES = (\n    "lai.csv", "image.tif"'),
            (
                "fifesim/output/run/folder.py",
                "    terrain = level = None\n",
                '    truth["lai"].drop_vars("spatial_ref").to_dataframe().to_csv(folder / "lai.csv")\n'
                "    terrain = level = None\n",
            ),
            (
                "fifesim/output/stac.py",
                "_ASSETS = {\n",
                '_ASSETS = {\n    "lai.csv": ("lai", "True LAI", "text/csv", ["data"]),\n',
            ),
        ],
        """
        import pandas as pd

        assert len(pd.read_csv(run_folder() / "lai.csv")) == 100
        assert "lai" in json.loads((run_folder() / "item.json").read_text())["assets"]
        """,
    ),
}

# Run all checks in one process, since each would import the package again.
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
    # A small run, whose files several checks read.
    from fifesim.output.run.folder import simulate_to_folder

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
    """Rows of the table by the name of the recipe."""
    page = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8")
    table = page[page.index("| a new | goes into |") :].split("\n\n")[0]
    return dict(re.findall(r"^\| (.+?) \| (.+) \|$", table, re.MULTILINE)[1:])


def named_files(row):
    """Paths that a row names, from the root of the repository."""
    roots = ("data/", "docs/", "tests/", f"{PACKAGE}/")
    names = [name for name in re.findall(r"`([^`]+)`", row) if "/" in name]
    return [name if name.startswith(roots) else f"{PACKAGE}/{name}" for name in names]


def is_named(path, row):
    """Whether a row names a file, or the folder of a new one."""
    return path == OWN_FILE or any(path == each or Path(path).parent == Path(each) for each in named_files(row))


def edit(copy, path, *change):
    file = copy / path
    if len(change) == 1:
        file.write_text(dedent(change[0]).lstrip(), encoding="utf-8")
        return
    old, new = change
    text = file.read_text(encoding="utf-8")
    assert text.count(old) >= 1, f"{path} has no {old!r}"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.fixture(scope="module")
def failed(tmp_path_factory):
    """Errors by recipe, in a copy of the package with all recipes, each in the files that its row names."""
    copy, table = tmp_path_factory.mktemp("copy"), rows()
    for folder in (PACKAGE, "data"):
        copytree(ROOT / folder, copy / folder, ignore=ignore_patterns("make_*.py"))
    for name, (edits, _) in RECIPES.items():
        for path, *change in edits:
            if is_named(path, table[name]):
                edit(copy, path, *change)
    mine = copy / "data" / "instruments" / "mine.toml"
    text = mine.read_text(encoding="utf-8").replace('name = "TM"', 'name = "MINE"')
    mine.write_text(re.sub(r"^aliases = .*$", "", text, flags=re.MULTILINE), encoding="utf-8")
    (copy / "checks.json").write_text(json.dumps({name: dedent(check) for name, (_, check) in RECIPES.items()}))
    done = subprocess.run(
        [sys.executable, "-c", _RUN],
        cwd=copy,
        env={"PYTHONPATH": str(copy), "HOME": str(copy)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert Path(found["package"]).is_relative_to(copy)
    return found["failed"]


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_works_when_it_is_followed(failed, name):
    assert name not in failed, failed[name]


def test_every_recipe_that_changes_code_is_followed():
    """Other tests cover documents, tests and the STAC item."""
    others = {"field of the STAC item", "page of the documentation", "test"}
    assert set(rows()) == set(RECIPES) | others


def test_files_of_the_recipes_are_there():
    missing = [path for row in rows().values() for path in named_files(row) if not (ROOT / path).exists()]
    assert missing == []


def test_annotation_of_index_names_every_index():
    assert list(get_args(get_type_hints(fifesim.index)["name"])) == list(INDICES)
