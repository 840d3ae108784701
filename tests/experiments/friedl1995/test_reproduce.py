"""`fifesim.reproduce`, its scenario files, its page, and the data of Figures 3 to 9."""

import builtins
import json
import re

import numpy as np
import pandas as pd
import pytest
import rasterio
import xarray as xr
from mistakes import mistakes
from typer.testing import CliRunner

import fifesim
from fifesim.chain.driver import Driver
from fifesim.cli import app
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import report, reproduction, table
from fifesim.experiments.friedl1995.case import ALIGNED, NATIVE, Case, case_of
from fifesim.experiments.friedl1995.table import COEFFICIENTS, cells_of, realise_scenes
from fifesim.scenario.scenario import read_scenario
from fifesim.scenario.simulation import simulate


def test_dataset_has_54_numbers_by_realisation_and_the_published_ones(found):
    assert list(found["reading"].values) == ["native", "aligned"]
    assert sum(found[name].isel(reading=0, realisation=0).size for name in ("intercept", "slope", "r2")) == 54
    assert sum(found[f"paper_{name}"].size for name in ("intercept", "slope", "r2")) == 54
    place = {"variable": "fpar", "distribution": "unburned-ungrazed", "arp": 0.24}
    assert float(found["paper_intercept"].sel(place)) == -0.02 and float(found["paper_r2"].sel(place)) == 0.72
    assert float(found["paper_ren"].sel(variable="fpar", arp=0.15)) == 0.11
    assert np.isnan(found["paper_range_kept"].sel(quantity="lai", arp=0.15))
    assert found.attrs["drift"] == pytest.approx(11.025) and "30.315 m" in str(found["text"].values[0])


def slopes(**options):
    """Slopes of one scene in two readings."""
    case = case_of(cells=90, **options)
    return realise_scenes(case, [1995], [NATIVE, ALIGNED], ["unburned-ungrazed"], [0.15])["slope"].values


def test_every_input_changes_the_numbers(small, folders):
    same = small["slope"].sel(distribution=["unburned-ungrazed"], arp=[0.15]).values
    np.testing.assert_array_equal(slopes(), same)
    for options in ({"dem": "flint-hills"}, {"sensor": "OLI"}, *({name: path} for name, path in folders.items())):
        assert (slopes(**options) != same).all(), options
    assert case_of(sensor="OLI").drift < 0.1 < case_of().drift


@pytest.mark.parametrize(("error", "options", "said"), mistakes("ValueError", "TypeError", name="experiment_mistakes"))
def test_mistake_is_named(error, options, said):
    with pytest.raises(getattr(builtins, error), match=said):
        fifesim.reproduce(**options)


def seen(case, *scene):
    """Digital numbers of a scene from plain arrays, as for the tables."""
    cells, driver = cells_of(case, *scene, case.light()), Driver(case.setup)
    return driver.image(driver.toa(cells.reflectance), case.grid)


@pytest.mark.parametrize(
    "options", [{}, {"reading": "aligned", "dem": "flint-hills"}, {"sensor": "OLI"}], ids=["paper", "own", "OLI"]
)
def test_scenarios_reproduce_the_images_to_the_bit(tmp_path, folders, options):
    """All nine scenes of the paper, and one each on hills with user inputs and with another sensor."""
    case, images = case_of(cells=90, **options, **(folders if "dem" in options else {})), []
    reproduction.write_scenarios(case, tmp_path, 11)
    for treatment, arp in friedl1995.scenes()[-1 if options else 0 :]:
        run = simulate(read_scenario(tmp_path / f"{treatment}-{arp:g}" / "scenario.toml"))
        images.append(seen(case, treatment, arp, 11))
        np.testing.assert_array_equal(run["image"]["dn"].values, images[-1])
    assert len({image.tobytes() for image in images}) == (1 if options else 9)


def test_files_of_a_scene_equal_plain_arrays_and_are_a_stac_collection(tmp_path, monkeypatch):
    """The item is stored next to its rasters, image assets list bands, and the collection links to the item."""
    scene, case = ("burned-ungrazed", 0.24), case_of(cells=90)
    monkeypatch.setattr(friedl1995, "scenes", lambda: [scene])
    reproduction.write_scenarios(case, tmp_path, 11, scenes=True)
    folder, expected = tmp_path / "burned-ungrazed-0.24", cells_of(case, *scene, 11)
    with rasterio.open(folder / "image.tif") as image:
        np.testing.assert_array_equal(seen(case, *scene, 11), image.read())
    with xr.open_zarr(folder / "scene.zarr") as cells:
        np.testing.assert_array_equal(cells["lai"], expected.lai)
        np.testing.assert_array_equal(cells["surface_reflectance"], expected.reflectance)
    found = json.loads((tmp_path / "collection.json").read_text(encoding="utf-8"))
    (path,) = [link["href"] for link in found["links"] if link["rel"] == "item"]
    item = json.loads((tmp_path / path).read_text(encoding="utf-8"))
    assert item["collection"] == found["id"] and found["extent"]["spatial"]["bbox"] == [item["bbox"]]
    assert {"image", "image-style", "truth", "truth-style", "scene", "scenario"} <= set(item["assets"])
    assert [band["eo:common_name"] for band in item["assets"]["image"]["bands"]] == ["red", "nir"]


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """The command on scenes of 10 x 10 pixels."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(report, "_DPI", 40)

    def call(*arguments):
        return CliRunner().invoke(app, ["reproduce", "--cells", "90", "--realisations", "1", *map(str, arguments)])

    return call


def test_command_writes_table_data_scenarios_and_page(quick, small, tmp_path):
    result = quick("-o", "out")
    assert result.exit_code == 0, result.output
    assert {path.name for path in (tmp_path / "out").iterdir()} == set(report.REPRODUCED)
    table = pd.read_csv(tmp_path / "out" / "table2.csv")
    wanted = {f"{before}{name}" for before in ("", "paper_", "aligned_") for name in COEFFICIENTS}
    assert len(table) == 18 and wanted <= set(table.columns)
    assert (table["aligned_r2"] > table["r2"]).mean() > 0.5
    with xr.open_dataset(tmp_path / "out" / "reproduction.nc") as stored:
        for name in small.data_vars:
            np.testing.assert_array_equal(stored[name], small[name], err_msg=name)
    scenes = sorted((tmp_path / "out" / "scenarios").iterdir())
    assert len(scenes) == 9 and all([path.name for path in scene.iterdir()] == ["scenario.toml"] for scene in scenes)
    assert read_scenario(scenes[0] / "scenario.toml").ground.seed == 1995
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 1
    assert "nan" not in page.split("base64")[0].lower() and "slope: native</th>" in page and "aligned</th>" in page
    rms = float(np.sqrt(((table["r2"] - table["paper_r2"])[table["variable"] == "lai"] ** 2).mean()))
    assert f"For native pixels, R² of LAI differs from Table 2 of the paper by {rms:.2f}" in page
    assert quick("-o", "out").exit_code == 2
    for name in ("readings.csv", "mine.txt"):
        (tmp_path / "out" / name).write_text("of another version, and of the user")
    assert quick("-o", "out", "--overwrite").exit_code == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*report.REPRODUCED, "mine.txt"}


def test_page_states_the_reading_and_the_inputs(quick, tmp_path, folders):
    given = [word for name, path in folders.items() for word in (f"--{name}", str(path))]
    result = quick("-o", "own", "--reading", "aligned", "--dem", "flint-hills", *given)
    assert result.exit_code == 0, result.output
    page = re.sub(r"\s+", " ", (tmp_path / "own" / "report.html").read_text())
    assert "Table 1 is interpreted as <em>aligned</em>" in page and "also shown for <em>native</em>" in page
    assert "The ground is the synthetic Flint Hills." in page and "fitted to" not in page
    keys = read_scenario(tmp_path / "own" / "scenarios" / "burned-ungrazed-0.05" / "scenario.toml")
    assert keys.ground.distribution == str(folders["densities"] / "burned-ungrazed.csv")
    assert keys.ground.leaf_reflectance == {"TM3": 0.09, "TM4": 0.42}
    assert keys.ground.background == {"TM3": 0.1, "TM4": 0.16} and keys.terrain.dem == "flint-hills"


@pytest.mark.parametrize(("stage", "arguments", "said"), mistakes("reproduce", name="experiment_mistakes"), ids=str)
def test_mistake_prints_one_line_and_writes_nothing(quick, tmp_path, stage, arguments, said):
    result = quick("-o", "out", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_figure_of_table_2_shows_the_values_of_the_table(found):
    tables = {str(name): table.table2(found.sel(reading=name)) for name in found["reading"].values}
    axes = report.table2_figure(tables).axes
    panels = [(variable, name) for variable in ("lai", "fpar") for name in ("intercept", "slope", "r2")]
    for axis, (variable, name) in zip(axes, panels, strict=True):
        assert axis.get_title() == f"{variable.upper()}: {name.replace('r2', 'R²')}"
        (paper,) = [line.get_xdata() for line in axis.lines if line.get_label() == "paper"]
        drawn = [container[0].get_xdata() for container in axis.containers]
        for values, rows in zip(drawn, tables.values(), strict=True):
            own = rows[rows["variable"] == variable]
            assert np.array_equal(values, own[name]) and np.array_equal(paper, own[f"paper_{name}"])
    assert axes[0].yaxis_inverted()


def test_pixels_have_the_relations_of_the_figures(found):
    """
    Fig. 5: R2 at the surface is near 1. Fig. 8: NDVI of the mean reflectance is slightly below the mean NDVI. Fig. 9:
    the effect of the atmosphere alone is linear, the image scatters about the line, and drift causes most of it.
    """

    def pixels(reading, arp, *names):
        scene = found.sel(reading=reading, arp=arp)
        return [scene[f"pixel_{name}"].dropna("pixel").values for name in names]

    def r2(*pair):
        return np.corrcoef(*pair)[0, 1] ** 2

    for arp in found["arp"].values:
        lai, fpar, boa, of_mean = pixels("native", arp, "lai", "fpar", "boa_ndvi", "ndvi_of_mean")
        assert r2(boa, fpar) > 0.99 and r2(boa, lai) > 0.95
        assert -0.01 < (of_mean - boa).mean() < 0
        red = pixels("native", arp, "boa_red", "clear_red", "toa_red")
        assert r2(red[0], red[1]) > 0.9999 and r2(red[0], red[2]) < 0.9
        left = {name: 1 - r2(*pixels(name, arp, "boa_nir", "toa_nir")) for name in ("native", "aligned")}
        assert left["aligned"] < left["native"] / 2
        # Table 2 has the same pixels.
        for name in ("native", "aligned"):
            first = found["r2"].sel(reading=name, arp=arp, distribution="burned-grazed", variable="lai")[0]
            assert r2(*pixels(name, arp, "lai", "ndvi")) == pytest.approx(float(first), rel=1e-9)


def test_densities_integrate_to_one_and_end_at_their_bounds(folders):
    own = reproduction.densities(Case())
    for values in own:
        known = values.dropna("leaf_area")
        assert np.trapezoid(known, known["leaf_area"]) == pytest.approx(1, abs=0.005)
    # The curves of the two others begin at bare ground.
    assert np.isfinite(own.isel(leaf_area=0)).values.tolist() == [True, False, True]
    ungrazed = own.sel(distribution="burned-ungrazed").dropna("leaf_area")
    assert float(ungrazed["leaf_area"][0]) == pytest.approx(0.475, abs=0.003)
    files = {str(name): str(folders["densities"] / f"{name}.csv") for name in own["distribution"].values}
    assert reproduction.densities(Case(densities=files)).sizes == own.sizes
