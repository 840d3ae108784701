"""Sources of scatter: images with ideal stages and the shares of the stages."""

import warnings

import numpy as np
import pytest
import rasterio
from elevations import write

import fifesim
from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.report import BUDGET_FILES, budget_to_folder
from fifesim.experiments.scatter.stages import IDEAL_PROPERTIES, STAGES, working_stages
from fifesim.scenario.scenario import parse_scenario


def test_shares_and_curvature_add_up_to_the_scatter(rough):
    found = fifesim.budget(rough, realisations=2)
    assert (found["share"].drop_sel(stage=["coupling", "clouds", "shadows", *IDEAL_PROPERTIES]) != 0).all()
    np.testing.assert_allclose(found["share"].sum("stage") + found["curvature"], found["total"], rtol=1e-12)
    table = scatter.budget_table(found)
    for _, rows in table.set_index("stage").groupby("variable"):
        parts = rows.loc[[*STAGES, scatter.CURVATURE], "share"]
        assert parts.sum() == pytest.approx(rows.loc[scatter.TOTAL, "share"], rel=1e-12)


def test_stages_already_ideal_have_zero_share(scenario):
    case = scenario()
    nothing = ["registration", "noise", "topography", "coupling", "clouds", "shadows", *IDEAL_PROPERTIES]
    assert set(STAGES) - set(working_stages(case)) == set(nothing)
    found = fifesim.budget(case, realisations=2)
    for name in ("share", "alone", "first"):
        assert (found[name].sel(stage=nothing) == 0).all() and (found[name].drop_sel(stage=nothing) != 0).all()


@pytest.mark.parametrize(
    ("sensor", "stage"),
    [
        ({"offset": [0.0, 2 / 9]}, "registration"),
        ({"interval": 31.0}, "registration"),
        ({"instrument": "L4TM", "noise": ["all"]}, "noise"),
    ],
)
def test_added_errors_have_a_significant_share(sensor, stage, scenario):
    share = fifesim.budget(scenario(sensor), realisations=5)["share"].sel(stage=stage)
    assert (share.mean("realisation") > 3 * scatter.standard_error(share)).all()


def test_map_has_one_realisation_per_window_with_data(tmp_path):
    lai = np.exp(np.random.default_rng(2).normal(0, 0.3, (100, 200)))
    lai[:, 150:] = np.nan
    write(tmp_path / "lai.tif", lai, rasterio.transform.from_origin(707970.0, 4331220.0, 10, 10))
    case = parse_scenario({"grid": {"cell": 10.0}, "ground": {"lai_file": str(tmp_path / "lai.tif")}})
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        found = fifesim.budget(case, realisations=9, cells=50)
    assert found.sizes["realisation"] == 6
    assert (found["total"].std("realisation") > 0).all()
    finer = parse_scenario({"grid": {"cell": 5.0}, "ground": {"lai_file": str(tmp_path / "lai.tif")}})
    with pytest.warns(UserWarning, match=r"lai\.tif has pixels of 10 m, and cells of 5 m.*fifesim\.ground\.downscale"):
        fifesim.budget(finer, realisations=1, cells=70)


def test_realisations_are_adjacent_and_have_different_seeds(scenario):
    cases = scatter.budget_cases(fifesim.Scenario(), realisations=4, cells=333, seed=3)
    assert len({(case.grid.west, case.grid.north) for case in cases}) == 4
    assert [case.ground.seed for case in cases] == [3, 4, 5, 6] and len({case.sensor.seed for case in cases}) == 4
    assert all(case.geobox().shape == (333, 333) for case in cases)
    assert len({case.grid.west for case in scatter.budget_cases(scenario(), realisations=3, cells=333)}) == 1


def test_ground_of_an_image_is_learned_for_its_budget(tmp_path):
    """The scenario covers the largest square with known elevation; the results have a copy of the landscape."""
    grid = fifesim.fife_site(10.0, window=((0, 60), (0, 60)))
    dem = fifesim.flint_hills(grid.pad(20), seed=2)
    dem[:, :35] = np.nan
    lai = fifesim.landscape(grid, dem=fifesim.flint_hills(grid.pad(120), seed=2), seed=2)["lai"]
    lai.fifesim.to_geotiff(tmp_path / "lai.tif")
    dem.fifesim.to_geotiff(tmp_path / "dem.tif")
    with pytest.raises(ValueError, match="needs its time"):
        scatter.scenario_like(tmp_path / "lai.tif", file=tmp_path / "land.json", instrument="MSI")
    case = scatter.scenario_like(tmp_path / "lai.tif", tmp_path / "dem.tif", file=tmp_path / "land.json")
    box, whole = case.geobox().boundingbox, grid.boundingbox
    assert whole.left + 150 < box.left < whole.left + 250 and box.right <= whole.right and box.top <= whole.top
    assert case.geobox().shape.y == case.geobox().shape.x and case.terrain.dem == str(tmp_path / "dem.tif")
    files = budget_to_folder(case, tmp_path / "out", realisations=1)
    assert {path.name for path in files} == {*BUDGET_FILES, "landscape.json"}
    again = fifesim.scenario.read_scenario(tmp_path / "out" / "scenario.toml")
    assert again.learned == str(tmp_path / "out" / "landscape.json") and again.geobox() == case.geobox()
