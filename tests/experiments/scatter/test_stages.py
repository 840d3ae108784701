"""Images with ideal stages."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.stages import (
    IDEAL_PROPERTIES,
    STAGES,
    STEP,
    _Scene,
    along_tangent,
    displaced_pixels,
    images_of,
    middle_cells,
    pixels,
    scene_of,
    spread_out,
    working_stages,
)
from fifesim.grids import grid as grids
from fifesim.scenario.scenario import Scenario


def of(seen, **at_work):
    """NDVI with the named stages active and all others ideal."""
    return seen.ndvi[tuple(int(at_work.get(stage.replace(" ", "_"), 0)) for stage in seen.stages)]


def test_physics_page_lists_the_stages_and_their_ideals():
    page = (Path(__file__).parents[3] / "docs" / "physics.md").read_text(encoding="utf-8")
    _, _, table = page.partition("| stage | ideal |\n|---|---|\n")
    rows = dict(re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", table.partition("\n\n")[0], re.MULTILINE))
    assert list(rows) == list(STAGES)
    assert {name: rows[name] for name in IDEAL_PROPERTIES} == IDEAL_PROPERTIES


@pytest.mark.parametrize("clumped", [False, True])
def test_all_stages_active_equal_the_simulation(rough, scenario, clumped):
    """Pixels have data where the displaced image has data; only the truth of rough ground has axes of length 1 or 2."""
    case = scenario(crown_cover=0.6) if clumped else rough
    seen, run = pixels(case), fifesim.simulate(case)
    assert set(STAGES) - set(seen.stages) == (
        set(IDEAL_PROPERTIES) - {"clumping"} | {"registration", "noise", "topography", "coupling", "clouds", "shadows"}
        if clumped
        else {"coupling", "clouds", "shadows", *IDEAL_PROPERTIES}
    )
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


def test_ideal_ndvi_scaling_is_the_mean_ndvi_of_the_cells(scenario):
    case = scenario()
    lai = fifesim.lai_scene(case.geobox(), "burned-grazed", arp=0.15, seed=7)
    of_cells = fifesim.ndvi(fifesim.surface_reflectance(lai, bands=["TM3", "TM4"]))
    found = of(pixels(case), **{"non-linearity": 1})
    np.testing.assert_allclose(found, fifesim.aggregate(of_cells, 30).values.ravel(), rtol=1e-12)


def test_ideal_non_linearity_is_the_reflectance_and_fpar_of_the_mean_lai(scenario):
    """Tangents average to the value of the curve at the mean; its table is within 1e-6 of SAIL."""
    seen = pixels(scenario())
    lai = fifesim.lai_scene(scenario().geobox(), "burned-grazed", arp=0.15, seed=7).fifesim.aggregate(30)
    of_mean = fifesim.ndvi(fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], exact=True))
    np.testing.assert_allclose(of(seen, NDVI_scaling=1), of_mean.values.ravel(), atol=2e-5)
    np.testing.assert_allclose(seen.truth["fpar"][0].ravel(), fifesim.fpar(lai).values.ravel(), rtol=1e-12)
    np.testing.assert_allclose(seen.truth["lai"][0].ravel(), lai.values.ravel(), rtol=1e-12)


def test_homogeneous_ndvi_is_the_ndvi_of_the_mean_lai(scenario):
    """
    NDVI of ground that is uniform within pixels.

    Pixels are aligned, so the cosine of 30.3 m includes only 0.16 m of each neighbour. Half a count of TM3 is 0.001 in
    reflectance, which is 0.005 in NDVI.
    """
    seen = pixels(scenario())
    lai = fifesim.lai_scene(scenario().geobox(), "burned-grazed", arp=0.15, seed=7).fifesim.aggregate(30)
    of_mean = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"]).fifesim.to_toa()
    np.testing.assert_allclose(seen.homogeneous_ndvi, fifesim.ndvi(of_mean).values.ravel(), atol=0.01)


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


@pytest.mark.parametrize("hills", [False, True])
def test_plain_arrays_and_labelled_functions_give_the_same_pixels(scenario, monkeypatch, hills):
    case = scenario(dem="flint-hills" if hills else "flat")
    plain = pixels(case)
    monkeypatch.setattr(_Scene, "is_stand", lambda scene, ground: False)
    labelled = pixels(case)
    np.testing.assert_array_equal(plain.ndvi, labelled.ndvi)
    np.testing.assert_array_equal(plain.truth["fpar"], labelled.truth["fpar"])


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
    no_air = [slice(None)] * seen.ndvi.ndim
    no_air[seen.stages.index("atmosphere")] = 0
    without = np.moveaxis(seen.ndvi[tuple(no_air)], at - (at > seen.stages.index("atmosphere")), 0)
    np.testing.assert_array_equal(*without)


def test_tangent_has_the_value_and_slope_of_the_curve_at_the_middle():
    """Beer's law, whose derivative is known; the error of a central difference is of the order of the squared step."""
    lai, extinction = np.linspace(0.2, 2.5, 40).reshape(5, 8), 0.7
    found = along_tangent(lambda area: 1 - np.exp(-extinction * area), lai, np.full(lai.shape, 1.2))
    left = np.exp(-extinction * 1.2)
    np.testing.assert_allclose(found, 1 - left + extinction * left * (lai - 1.2), rtol=0, atol=STEP**2 / 10)
    assert np.ptp(np.diff(found.ravel()) / np.diff(lai.ravel())) < 1e-10


def test_quantisation_changes_ndvi_of_cells_and_of_means_alike():
    """The quantisation error is the same for NDVI of cells and of means, and at most one or two counts."""
    sections = {"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}, "sensor": {"offset": [0.0, 1.0]}}
    scene = scene_of(Scenario(ground={"arp": 0.15}, **sections))
    red, nir = np.random.default_rng(2).uniform([[[0.04]], [[0.2]]], [[[0.1]], [[0.4]]], (2, 90, 90))
    cells = np.stack([red, nir, (nir - red) / (nir + red)])
    found = images_of(scene, cells, ((False, True), (False,), (False,), (False, True), (False,)))[:, 0, 0, :, 0]
    steps = found[:, 1] - found[:, 0]
    np.testing.assert_allclose(steps[0], steps[1], atol=1e-12)
    assert 1e-4 < np.abs(steps).max() < 0.03


# Seven cells of 10 m along each axis: two blocks of 30 m and one cell outside the blocks.
GRID = fifesim.grid_at("EPSG:26914", 707970.0, 4331220.0, 70.0, 70.0, 10.0)
BLOCKS = grids.aligned_grid(GRID, 30.0)


@pytest.fixture
def land():
    lai = fifesim.lai_scene(GRID, "burned-grazed", arp=0.15, seed=7)
    return lai.copy(data=np.arange(49.0).reshape(7, 7))


def test_cells_of_a_block_have_the_block_mean_and_blocks_without_a_mean_keep_their_cells(land):
    """Cells without data stay missing."""
    found = spread_out(land, BLOCKS, 0.98).values
    expected = [[8.0, 11.0], [29.0, 32.0]]
    np.testing.assert_array_equal(found[:6, :6], np.kron(expected, np.ones((3, 3))))
    np.testing.assert_array_equal(found[6], land.values[6])
    np.testing.assert_array_equal(found[:, 6], land.values[:, 6])
    land[0, 0] = np.nan
    found = spread_out(land, BLOCKS, 0.98).values
    np.testing.assert_array_equal(found[:3, :3], land.values[:3, :3])
    found = spread_out(land, BLOCKS, 0.5).values
    assert np.isnan(found[0, 0]) and found[1, 1] == pytest.approx((9 * 8 - 0) / 8)


def test_block_takes_the_value_of_its_middle_cell(land):
    codes = xr.where(land == 0, -1, land, keep_attrs=True).astype(np.int16)
    found = middle_cells(land.copy(data=codes.values), BLOCKS).values
    assert found[0, 0] == -1 and set(found[:3, :3].ravel()) == {-1, 8}
    np.testing.assert_array_equal(found[3:6, 3:6], 32)
    np.testing.assert_array_equal(found[6], land.values[6])


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
