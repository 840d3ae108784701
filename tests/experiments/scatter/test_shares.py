"""Where the scatter comes from: images with stages at their ideal, their shares, and the command."""

import numpy as np
import pandas as pd
import pytest
import rasterio
from typer.testing import CliRunner

import fifesim
from fifesim.cli import app
from fifesim.experiments.scatter import folder as scatter_run
from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.stages import STAGES, pixels, working_stages
from fifesim.scenario.scenario import parse_scenario

# 12 x 14 pixels of 30 m.
GRID = {"west": 707970.0, "north": 4331220.0, "width": 420.0, "height": 360.0}
ROUGH = {"instrument": "L4TM", "interval": "native", "offset": [0.1, 0.0], "noise": ["shot", "thermal"]}


def scenario(sensor=None, dem="flat", **ground):
    terrain = {"dem": dem} | ({} if dem == "flat" else {"horizon_reach": 300})
    return parse_scenario({"grid": GRID, "sensor": sensor or {}, "terrain": terrain, "ground": ground})


@pytest.fixture(scope="module")
def rough():
    """A scenario with every stage at work, and its pixels."""
    case = scenario(ROUGH, dem="flint-hills")
    return case, pixels(case)


def of(seen, **at_work):
    """NDVI with the stages named at work, and those without a word ideal."""
    return seen.ndvi[tuple(int(at_work.get(stage.replace(" ", "_"), 0)) for stage in seen.stages)]


def test_all_stages_at_work_are_the_simulation(rough):
    case, seen = rough
    run = fifesim.simulate(case)
    assert seen.stages == tuple(STAGES)
    rows, columns = (min(run[name].sizes[axis] for name in ("truth", "image")) for axis in ("y", "x"))
    ndvi = run["image"]["ndvi"].values[:rows, :columns]
    found = np.isfinite(ndvi)
    # The ideal images have data where the displaced one has.
    np.testing.assert_array_equal(seen.ndvi[(1,) * 8], ndvi[found])
    for name in ("lai", "fpar"):
        np.testing.assert_array_equal(seen.truth[name][1].ravel(), run["truth"][name].values[:rows, :columns][found])
        line = fifesim.regress(run["truth"][name], run["image"]["ndvi"], pair="index")
        assert scatter.unexplained(seen.truth[name][1].ravel(), seen.ndvi[(1,) * 8]) == pytest.approx(
            1 - line.r2, abs=1e-12
        )


def test_ideal_of_ndvi_scaling_is_the_mean_over_the_cells():
    case = scenario()
    lai = fifesim.lai_scene(case.geobox(), "burned-grazed", arp=0.15, seed=7)
    of_cells = fifesim.ndvi(fifesim.surface_reflectance(lai, bands=["TM3", "TM4"]))
    found = of(pixels(case), **{"non-linearity": 1})
    np.testing.assert_allclose(found, fifesim.aggregate(of_cells, 30).values.ravel(), rtol=1e-12)


def test_ideal_of_non_linearity_is_the_reflectance_and_fpar_of_the_mean():
    """Tangents average to the curve's value at the mean; its table is within 1e-6 of SAIL."""
    seen = pixels(scenario())
    lai = fifesim.lai_scene(scenario().geobox(), "burned-grazed", arp=0.15, seed=7).fifesim.aggregate(30)
    of_mean = fifesim.ndvi(fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], exact=True))
    np.testing.assert_allclose(of(seen, NDVI_scaling=1), of_mean.values.ravel(), atol=2e-5)
    np.testing.assert_allclose(seen.truth["fpar"][0].ravel(), fifesim.fpar(lai).values.ravel(), rtol=1e-12)
    np.testing.assert_allclose(seen.truth["lai"][0].ravel(), lai.values.ravel(), rtol=1e-12)


def test_over_uniform_pixels_the_cells_are_the_mean():
    """
    Aligned, the cosine of 30.3 m takes in 0.16 m of each neighbour alone.

    Half a count of TM3 is .001 of reflectance, and that .005 of NDVI.
    """
    seen = pixels(scenario())
    lai = fifesim.lai_scene(scenario().geobox(), "burned-grazed", arp=0.15, seed=7).fifesim.aggregate(30)
    of_mean = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"]).fifesim.to_toa()
    np.testing.assert_allclose(seen.homogeneous_ndvi, fifesim.ndvi(of_mean).values.ravel(), atol=0.01)


def test_shares_and_curvature_add_up_to_the_scatter():
    found = fifesim.budget(scenario(ROUGH, dem="flint-hills"), realisations=2)
    assert (found["share"] != 0).all()
    np.testing.assert_allclose(found["share"].sum("stage") + found["curvature"], found["total"], rtol=1e-12)
    table = scatter.table(found)
    for _, rows in table.set_index("stage").groupby("variable"):
        parts = rows.loc[[*STAGES, scatter.CURVATURE], "share"]
        assert parts.sum() == pytest.approx(rows.loc[scatter.TOTAL, "share"], rel=1e-12)


def test_stage_that_is_ideal_already_has_exactly_nothing():
    case = scenario()
    assert set(STAGES) - set(working_stages(case)) == {"registration", "noise", "topography"}
    found = fifesim.budget(case, realisations=2)
    for name in ("share", "alone", "first"):
        ideal = found[name].sel(stage=["registration", "noise", "topography"])
        assert (ideal == 0).all()
        assert (found[name].drop_sel(stage=ideal["stage"].values) != 0).all()


@pytest.mark.parametrize(
    ("sensor", "stage"),
    [
        ({"offset": [0.0, 2 / 9]}, "registration"),
        ({"interval": 31.0}, "registration"),
        ({"instrument": "L4TM", "noise": ["shot", "thermal"]}, "noise"),
    ],
)
def test_what_is_added_to_a_scenario_has_a_share_beyond_its_error(sensor, stage):
    share = fifesim.budget(scenario(sensor), realisations=5)["share"].sel(stage=stage)
    assert (share.mean("realisation") > 3 * scatter.standard_error(share)).all()


def test_other_seeds_give_the_same_shares_within_their_errors():
    """Differences of two means of eight, in standard errors: beyond 4 once in a thousand, and 20 are looked at."""
    case = scenario({"interval": 30.6})
    one, other = (fifesim.budget(case, realisations=8, seed=seed) for seed in (100, 900))
    for name in ("share", "total", "curvature"):
        error = np.hypot(scatter.standard_error(one[name]), scatter.standard_error(other[name]))
        difference = one[name].mean("realisation") - other[name].mean("realisation")
        assert not (one[name] == other[name]).all()
        assert (np.abs(difference) <= 4 * error).all()


def test_realisations_lie_side_by_side_and_have_seeds_of_their_own():
    cases = scatter.realise(fifesim.Scenario(), realisations=4, cells=333, seed=3)
    corners = {(case.grid.west, case.grid.north) for case in cases}
    assert len(corners) == 4 and [case.ground.seed for case in cases] == [3, 4, 5, 6]
    assert all(case.geobox().shape == (333, 333) for case in cases)
    one_place = scatter.realise(scenario(), realisations=3, cells=333)
    assert {case.grid.west for case in one_place} == {GRID["west"]}


def test_map_has_as_many_realisations_as_it_has_filled_windows(tmp_path):
    rng = np.random.default_rng(2)
    lai = np.exp(rng.normal(0, 0.3, (100, 200))).astype("float32")
    lai[:, 150:] = np.nan
    place = rasterio.transform.from_origin(GRID["west"], GRID["north"], 10, 10)
    profile = {"driver": "GTiff", "width": 200, "height": 100, "count": 1, "dtype": "float32", "crs": "EPSG:26914"}
    with rasterio.open(tmp_path / "lai.tif", "w", **profile, transform=place) as sink:
        sink.write(lai, 1)
    case = parse_scenario({"grid": {"cell": 10.0}, "ground": {"lai_file": str(tmp_path / "lai.tif")}})
    found = fifesim.budget(case, realisations=9, cells=50)
    assert found.sizes["realisation"] == 6
    assert (found["total"].std("realisation") > 0).all()


@pytest.fixture
def command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(scatter_run, "_DPI", 40)
    text = "[grid]\nwidth = 360\nheight = 330\n[terrain]\ndem = 'flat'\n[sensor]\nbands = ['TM2', 'TM3', 'TM4']\n"
    (tmp_path / "mine.toml").write_text(text)

    def call(*arguments):
        return CliRunner().invoke(app, ["budget", *map(str, arguments)])

    return call


def test_command_writes_table_chart_and_page(command, tmp_path):
    result = command("mine.toml", "-o", "out", "--realisations", 2)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(scatter_run.FILES)
    table = pd.read_csv(tmp_path / "out" / "budget.csv")
    assert set(table["stage"]) == {*STAGES, scatter.CURVATURE, scatter.TOTAL, scatter.VARIATION}
    assert {"stage", "variable", "alone", "alone_error", "share", "share_error"} <= set(table.columns)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 1 and "http" not in page
    total = table[(table["stage"] == "total") & (table["variable"] == "lai")].iloc[0]
    assert f"{100 * total['share']:.1f}" in page
    first = {name: (tmp_path / "out" / name).read_bytes() for name in scatter_run.FILES}
    assert command("mine.toml", "-o", "out", "--realisations", 2).exit_code == 2
    again = command("out/scenario.toml", "-o", "again", "--realisations", 2)
    assert again.exit_code == 0, again.output
    assert {name: (tmp_path / "again" / name).read_bytes() for name in scatter_run.FILES} == first


def test_one_realisation_has_no_error(command, tmp_path):
    assert command("mine.toml", "-o", "out", "--realisations", 1).exit_code == 0
    table = pd.read_csv(tmp_path / "out" / "budget.csv")
    assert table["share_error"].isna().all() and table["share"].notna().sum() == 20
    assert "nan" not in (tmp_path / "out" / "report.html").read_text(encoding="utf-8").split("base64")[0]


@pytest.mark.parametrize(
    ("text", "arguments", "said"),
    [
        ("", ("--realisations", 0), "realisations must be at least 1, got 0"),
        ("", ("--cells", 50), "holds 5 x 5 pixels of 30 m"),
        ("", ("--seed", -1), "seed must be"),
        ("[sensor]\nbands = ['TM3']", (), "no near infrared band"),
        ("[sensor]\noffset = 3.0", (), "sensor.offset"),
        ("[sensor]\ninstrument = 'AVHRR'\nbands = ['AVHRR1', 'AVHRR2']", (), "1 x 1 pixels of 1100 m"),
    ],
)
def test_mistake_is_one_line_and_leaves_nothing(command, tmp_path, text, arguments, said):
    (tmp_path / "wrong.toml").write_text(text)
    result = command("wrong.toml", "-o", "out", *arguments)
    assert result.exit_code == 2
    assert said in result.stderr and len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_failure_in_the_middle_leaves_nothing(command, tmp_path, monkeypatch):
    def full(*arguments):
        raise OSError("disk full")

    monkeypatch.setattr(scatter_run.scatter_report, "page", full)
    result = command("mine.toml", "-o", "out", "--realisations", 1)
    assert result.exit_code == 1 and "disk full" in result.stderr
    assert not (tmp_path / "out").exists()
