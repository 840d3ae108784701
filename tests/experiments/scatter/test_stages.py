"""Images with ideal stages, ground with ideal (uniform) properties, and the shares of the stages."""

import warnings
from functools import cache

import numpy as np
import pytest
import rasterio
import xarray as xr
from elevations import write

import fifesim
from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.report import BUDGET_FILES, budget_to_folder
from fifesim.experiments.scatter.stages import (
    IDEAL_PROPERTIES,
    STAGES,
    STEP,
    along_tangent,
    displaced_pixels,
    ground_with,
    middle_cells,
    pixels,
    spread_out,
    varying_ground,
    working_stages,
)
from fifesim.grids import grid as grids
from fifesim.scenario.ground import ground_scene
from fifesim.scenario.scenario import Scenario, parse_scenario


def of(seen, **at_work):
    """NDVI with the named stages active and all others ideal."""
    return seen.ndvi[tuple(int(at_work.get(stage.replace(" ", "_"), 0)) for stage in seen.stages)]


@pytest.mark.parametrize("clumped", [False, True])
def test_all_stages_active_equal_the_simulation(rough, scenario, clumped):
    """Pixels have data where the displaced image has data; only the truth of rough ground has axes of length 1 or 2."""
    case = scenario(crown_cover=0.6) if clumped else rough
    seen, run = pixels(case), fifesim.simulate(case)
    at_work = (1,) * len(seen.stages)
    rows, columns = (min(run[name].sizes[axis] for name in ("truth", "image")) for axis in ("y", "x"))
    ndvi = run["image"]["ndvi"].values[:rows, :columns]
    found = np.isfinite(ndvi)
    np.testing.assert_array_equal(seen.ndvi[at_work], ndvi[found])
    for name in ("lai", "fpar"):
        truth = np.broadcast_to(seen.truth[name], seen.ndvi.shape)[at_work]
        np.testing.assert_array_equal(truth, run["truth"][name].values[:rows, :columns][found])
        line = fifesim.regress(run["truth"][name], run["image"]["ndvi"], pair="index")
        assert scatter.unexplained(truth, seen.ndvi[at_work]) == pytest.approx(1 - line.r2, abs=1e-12)


def test_ideal_stages_have_the_values_of_mean_cells(scenario):
    """
    NDVI scaling has the mean NDVI of the cells; non-linearity and uniform ground have the values of the mean LAI.

    Tangents average to the value of the curve at the mean; its table is within 1e-6 of SAIL. Pixels are aligned, so the
    cosine of 30.3 m includes only 0.16 m of each neighbour. Half a count of TM3 is 0.001 in reflectance, which is 0.005
    in NDVI.
    """
    case, bands = scenario(), {"bands": ["TM3", "TM4"]}
    seen, cells = pixels(case), fifesim.lai_scene(case.geobox(), "burned-grazed", arp=0.15, seed=7)
    lai = cells.fifesim.aggregate(30)

    def ndvi(reflectance):
        return fifesim.ndvi(reflectance).values.ravel()

    of_cells = fifesim.aggregate(fifesim.ndvi(fifesim.surface_reflectance(cells, **bands)), 30)
    np.testing.assert_allclose(of(seen, **{"non-linearity": 1}), of_cells.values.ravel(), rtol=1e-12)
    of_mean = fifesim.surface_reflectance(lai, exact=True, **bands)
    np.testing.assert_allclose(of(seen, NDVI_scaling=1), ndvi(of_mean), atol=2e-5)
    np.testing.assert_allclose(seen.homogeneous_ndvi, ndvi(of_mean.fifesim.to_toa()), atol=0.01)
    np.testing.assert_allclose(seen.truth["fpar"][0].ravel(), fifesim.fpar(lai).values.ravel(), rtol=1e-12)
    np.testing.assert_allclose(seen.truth["lai"][0].ravel(), lai.values.ravel(), rtol=1e-12)


def test_displaced_pixels_equal_separate_runs(rough):
    """Stages, images, truth and uniform ground are identical to the bit."""
    offsets = [(0.0, 0.0), (0.1, 0.0), (0.0, 0.5)]
    for offset, seen in zip(offsets, displaced_pixels(rough, offsets), strict=True):
        sensor = rough.sensor.model_copy(update={"offset": list(offset)})
        alone = pixels(rough.model_copy(update={"sensor": sensor}))
        assert seen.stages == alone.stages
        np.testing.assert_array_equal(seen.ndvi, alone.ndvi)
        np.testing.assert_array_equal(seen.homogeneous_ndvi, alone.homogeneous_ndvi)
        np.testing.assert_array_equal(seen.truth["fpar"], alone.truth["fpar"])


def test_adjacency_equals_the_labelled_chain(scenario):
    case = scenario()
    hazy = case.model_copy(update={"atmosphere": case.atmosphere.model_copy(update={"adjacency": True})})
    reflectance = fifesim.simulate(hazy)["scene"]["surface_reflectance"]
    expected, without = (
        fifesim.aggregate(fifesim.ndvi(fifesim.to_toa(reflectance, adjacency=adjacency)), 30).values.ravel()
        for adjacency in (True, False)
    )
    found = of(pixels(hazy), atmosphere=1, **{"non-linearity": 1})
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert np.abs(found - without).max() > 1e-3


@pytest.mark.parametrize("dem", ["flat", "flint-hills"])
def test_coupling_stage_equals_the_change_of_the_simulation(scenario, dem):
    case = scenario(dem=dem)
    keys = {"coupling": "directional", "visibility": 10.0}
    case = case.model_copy(update={"atmosphere": case.atmosphere.model_copy(update=keys)})
    seen = pixels(case)
    at = seen.stages.index("coupling")
    both = seen.ndvi[(1,) * at][:, *(1,) * (len(seen.stages) - at - 1)]
    for found, coupling in zip(both, ("lambert", "directional"), strict=True):
        run = fifesim.simulate(case.replace(coupling=coupling))
        # The fused pass has a separate table, within 1e-5, so that counts may differ by one.
        np.testing.assert_allclose(found, run["image"]["ndvi"].values.ravel(), atol=0.01)
    assert 1e-3 < abs(both[1] - both[0]).mean() < 0.03


def test_tangent_has_the_value_and_slope_of_the_curve_at_the_middle():
    """Beer's law, whose derivative is known; the error of a central difference is of the order of the squared step."""
    lai, extinction = np.linspace(0.2, 2.5, 40).reshape(5, 8), 0.7
    found = along_tangent(lambda area: 1 - np.exp(-extinction * area), lai, np.full(lai.shape, 1.2))
    left = np.exp(-extinction * 1.2)
    np.testing.assert_allclose(found, 1 - left + extinction * left * (lai - 1.2), rtol=0, atol=STEP**2 / 10)
    assert np.ptp(np.diff(found.ravel()) / np.diff(lai.ravel())) < 1e-10


def test_ideal_block_has_its_mean_or_the_class_of_its_middle_cell():
    """Seven cells along each axis: two blocks of three cells, and one cell outside. Cells without data stay missing."""
    grid = fifesim.grid_at("EPSG:26914", 707970.0, 4331220.0, 70.0, 70.0, 10.0)
    blocks, land = grids.aligned_grid(grid, 30.0), fifesim.lai_scene(grid, "burned-grazed", arp=0.15, seed=7)
    land = land.copy(data=np.arange(49.0).reshape(7, 7))
    found = spread_out(land, blocks, 0.98).values
    np.testing.assert_array_equal(found[:6, :6], np.kron([[8.0, 11.0], [29.0, 32.0]], np.ones((3, 3))))
    np.testing.assert_array_equal(found[[6, 0], [0, 6]], land.values[[6, 0], [0, 6]])
    codes = xr.where(land == 0, -1, land, keep_attrs=True).astype(np.int16)
    found = middle_cells(land.copy(data=codes.values), blocks).values
    assert found[0, 0] == -1 and set(found[:3, :3].ravel()) == {-1, 8}
    np.testing.assert_array_equal(found[3:6, 3:6], 32)
    np.testing.assert_array_equal(found[6], land.values[6])
    land[0, 0] = np.nan
    np.testing.assert_array_equal(spread_out(land, blocks, 0.98).values[:3, :3], land.values[:3, :3])
    found = spread_out(land, blocks, 0.5).values
    assert np.isnan(found[0, 0]) and found[1, 1] == pytest.approx(9)


def test_clouds_thinner_than_the_mask_are_stages():
    """Without clouds the stages are ideal; a loose mask keeps thin clouds, which then have a share, and more pixels."""
    sky = {"cloud_cover": 0.5, "thickness": 1.0, "length": 300.0, "base": 300.0, "top": 300.0}
    base = {"grid": {"width": 600, "height": 600, "cell": 10}, "ground": {"arp": 0.15}, "terrain": {"dem": "flat"}}
    clear = Scenario(**base)
    assert not {"clouds", "shadows"} & set(working_stages(clear))
    tight, loose = (Scenario(**base, clouds=sky | {"mask": mask}) for mask in (0.05, 100.0))
    assert {"clouds", "shadows"} <= set(working_stages(tight))
    few, all_, none = (pixels(each) for each in (tight, loose, clear))
    assert few.ndvi.shape[-1] < all_.ndvi.shape[-1] == none.ndvi.shape[-1]
    active = {stage.replace(" ", "_"): 1 for stage in none.stages}
    np.testing.assert_array_equal(of(all_, **active), of(none, **active))
    assert (of(all_, **active, clouds=1, shadows=1) < of(all_, **active) - 0.05).any()
    assert (of(all_, **active, shadows=1) != of(all_, **active)).any()


@pytest.mark.parametrize("ideal", [True, False])
def test_shares_and_curvature_add_up_to_the_scatter(rough, scenario, ideal):
    """Stages that are ideal already have no share, and all others have one."""
    case, nothing = scenario() if ideal else rough, ["coupling", "clouds", "shadows", *IDEAL_PROPERTIES]
    nothing += ["registration", "noise", "topography"] if ideal else []
    assert set(STAGES) - set(working_stages(case)) == set(nothing)
    found = fifesim.budget(case, realisations=2)
    for name in ("share", "alone", "first"):
        assert (found[name].sel(stage=nothing) == 0).all() and (found[name].drop_sel(stage=nothing) != 0).all()
    np.testing.assert_allclose(found["share"].sum("stage") + found["curvature"], found["total"], rtol=1e-12)
    for _, rows in scatter.budget_table(found).set_index("stage").groupby("variable"):
        parts = rows.loc[[*STAGES, scatter.CURVATURE], "share"]
        assert parts.sum() == pytest.approx(rows.loc[scatter.TOTAL, "share"], rel=1e-12)


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


def test_realisations_are_adjacent_and_have_different_seeds(scenario):
    cases = scatter.budget_cases(fifesim.Scenario(), realisations=4, cells=333, seed=3)
    assert len({(case.grid.west, case.grid.north) for case in cases}) == 4
    assert [case.ground.seed for case in cases] == [3, 4, 5, 6] and len({case.sensor.seed for case in cases}) == 4
    assert all(case.geobox().shape == (333, 333) for case in cases)
    assert len({case.grid.west for case in scatter.budget_cases(scenario(), realisations=3, cells=333)}) == 1


@pytest.mark.slow
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


# 10 x 10 pixels of 30 m.
GRID = {"west": 707970.0, "north": 4331220.0, "width": 300.0, "height": 300.0}
FLAT = {"grid": GRID, "terrain": {"dem": "flat"}, "sensor": {"response": "paper"}}
ALL = {
    "ground": {"brown": 0.2, "crown_cover": 0.8, "moisture": 0.2},
    "landscape": {
        "cover": "voronoi",
        "size": 60.0,
        "deviations": {"soil": 0.04, "moisture": 0.1, "brown": 0.1, "crown_cover": 0.1},
    },
    "classes": {
        "grass": {"background_spectra": {"soil_dry": 0.5, "shade": 0.5}},
        "litter": {"background_spectra": {"dead_grass": 0.6, "shade": 0.4}, "distribution": "unburned-ungrazed"},
    },
}
ALL["classes"]["litter"]["leaf_angles"] = "planophile"


def case_of(**sections):
    return parse_scenario(FLAT | sections | {"ground": {"arp": 0.15} | sections.get("ground", {})})


@pytest.fixture(scope="module")
def everything():
    return case_of(**ALL)


@pytest.mark.parametrize(
    ("sections", "found"),
    [
        ({"ground": {"brown": 0.2, "hotspot": 0.1, "soil": 0.1, "moisture": 0.2}}, ()),
        ({"landscape": {"deviations": {"soil": 0.02}}}, ("soil",)),
        ({"landscape": {"deviations": {"soil": 0.0}}}, ()),
        ({"ground": {"moisture": 0.2}, "landscape": {"deviations": {"moisture": 0.1}}}, ("soil",)),
        ({"ground": {"brown": 0.2}, "landscape": {"deviations": {"brown": 0.1}}}, ("dead leaves",)),
        ({"ground": {"crown_cover": 0.8}}, ("clumping",)),
        ({"landscape": {"cover": "voronoi"}, "classes": {"a": {"hotspot": 0.1}}}, ()),
        ({"landscape": {"cover": "voronoi"}, "classes": {"a": {"hotspot": 0.1}, "b": {}}}, ("cover",)),
        ({"landscape": {"cover": "voronoi"}, "classes": {"a": {"arp": 0.1}, "b": {}}}, ()),
        ({"landscape": {"cover": "voronoi"}, "classes": {"a": {"crown_cover": 0.9}}}, ("clumping",)),
        (ALL, tuple(IDEAL_PROPERTIES)),
    ],
    ids=str,
)
def test_varying_properties_are_found(sections, found):
    case = case_of(**sections)
    assert varying_ground(case) == found
    assert tuple(name for name in working_stages(case) if name in IDEAL_PROPERTIES) == found


def test_ideal_property_is_uniform_and_the_rest_unchanged(everything):
    """All other variables are identical to the bit, because random numbers are the same."""
    box = everything.geobox()
    whole = ground_scene(everything, box)
    ideal = cache(lambda *left_out: ground_with(everything, box, set(IDEAL_PROPERTIES) - set(left_out)))
    changed = {"soil": {"soil", "moisture"}, "dead leaves": {"brown"}, "cover": {"cover"}, "clumping": {"crown_cover"}}
    for name, variables in changed.items():
        found = ideal(name)
        for other in set(whole) - variables:
            np.testing.assert_array_equal(found[other], whole[other], err_msg=f"{name}: {other}")
    assert ideal("soil")["soil"].item() == 0.0 and ideal("soil")["moisture"].item() == 0.2
    assert ideal("dead leaves")["brown"].item() == 0.2
    assert ideal("clumping")["crown_cover"].item() == 1.0
    first = ideal("cover")["cover"]
    assert (first == 1).all() and first.dtype == whole["cover"].dtype
    assert first.attrs["flag_meanings"] == whole["cover"].attrs["flag_meanings"] and (whole["cover"] == 2).any()


def test_missing_cover_stays_missing(tmp_path, everything):
    """A cell of unknown class does not get the first class."""
    codes = np.where(ground_scene(everything, everything.geobox())["cover"] == 1, 3, 0)
    codes[:20, :9] = -1
    path = write(tmp_path / "cover.tif", codes, everything.geobox().affine, nodata=-1)
    classes = {name: keys | {"code": code} for (name, keys), code in zip(ALL["classes"].items(), (3, 0), strict=True)}
    land = ALL["landscape"] | {"cover": str(path)}
    case = case_of(**ALL | {"landscape": land, "classes": classes})
    found = ground_with(case, case.geobox(), ["soil"])["cover"]
    assert (codes == 0).any()
    np.testing.assert_array_equal(found, np.where(codes < 0, -1, 3))


def test_pixels_with_an_ideal_property_equal_a_scenario_without_it():
    """With the same random numbers, the image equals the image of a scenario that omits the property."""
    land = {"deviations": {"soil": 0.04}}
    seen = pixels(case_of(landscape=land))
    for soil, own in {1: land, 0: {}}.items():
        run = fifesim.simulate(case_of(landscape=own))
        at = tuple({"soil": soil}.get(stage, 1) for stage in seen.stages)
        ndvi, fpar = seen.ndvi[at], np.broadcast_to(seen.truth["fpar"], seen.ndvi.shape)[at]
        np.testing.assert_array_equal(ndvi, run["image"]["ndvi"].values.ravel(), err_msg=str(own))
        np.testing.assert_array_equal(fpar, run["truth"]["fpar"].values.ravel(), err_msg=str(own))
