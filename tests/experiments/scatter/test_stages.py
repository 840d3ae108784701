"""Images with stages at their ideal."""

import re
from pathlib import Path

import numpy as np
import pytest

import fifesim
from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.stages import (
    IDEAL_PROPERTIES,
    STAGES,
    STEP,
    _Scene,
    along_tangent,
    displaced_pixels,
    pixels,
)


def of(seen, **at_work):
    """NDVI with the stages named at work, and those without a word ideal."""
    return seen.ndvi[tuple(int(at_work.get(stage.replace(" ", "_"), 0)) for stage in seen.stages)]


def test_physics_page_lists_the_stages_and_the_ideal_ground():
    page = (Path(__file__).parents[3] / "docs" / "physics.md").read_text(encoding="utf-8")
    _, _, table = page.partition("| stage | ideal |\n|---|---|\n")
    rows = dict(re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", table.partition("\n\n")[0], re.MULTILINE))
    assert list(rows) == list(STAGES)
    assert {name: rows[name] for name in IDEAL_PROPERTIES} == IDEAL_PROPERTIES


def test_all_stages_at_work_are_the_simulation(rough):
    seen = pixels(rough)
    run = fifesim.simulate(rough)
    assert seen.stages == tuple(name for name in STAGES if name not in IDEAL_PROPERTIES)
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


def test_ideal_of_ndvi_scaling_is_the_mean_over_the_cells(scenario):
    case = scenario()
    lai = fifesim.lai_scene(case.geobox(), "burned-grazed", arp=0.15, seed=7)
    of_cells = fifesim.ndvi(fifesim.surface_reflectance(lai, bands=["TM3", "TM4"]))
    found = of(pixels(case), **{"non-linearity": 1})
    np.testing.assert_allclose(found, fifesim.aggregate(of_cells, 30).values.ravel(), rtol=1e-12)


def test_ideal_of_non_linearity_is_the_reflectance_and_fpar_of_the_mean(scenario):
    """Tangents average to the curve's value at the mean; its table is within 1e-6 of SAIL."""
    seen = pixels(scenario())
    lai = fifesim.lai_scene(scenario().geobox(), "burned-grazed", arp=0.15, seed=7).fifesim.aggregate(30)
    of_mean = fifesim.ndvi(fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], exact=True))
    np.testing.assert_allclose(of(seen, NDVI_scaling=1), of_mean.values.ravel(), atol=2e-5)
    np.testing.assert_allclose(seen.truth["fpar"][0].ravel(), fifesim.fpar(lai).values.ravel(), rtol=1e-12)
    np.testing.assert_allclose(seen.truth["lai"][0].ravel(), lai.values.ravel(), rtol=1e-12)


def test_over_uniform_pixels_the_cells_are_the_mean(scenario):
    """
    Aligned, the cosine of 30.3 m takes in 0.16 m of each neighbour alone.

    Half a count of TM3 is .001 of reflectance, and that .005 of NDVI.
    """
    seen = pixels(scenario())
    lai = fifesim.lai_scene(scenario().geobox(), "burned-grazed", arp=0.15, seed=7).fifesim.aggregate(30)
    of_mean = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"]).fifesim.to_toa()
    np.testing.assert_allclose(seen.homogeneous_ndvi, fifesim.ndvi(of_mean).values.ravel(), atol=0.01)


def test_pixels_at_several_displacements_are_those_of_each(rough):
    """The whole of it, to the bit: stages, images, truth, and the ground that is uniform within pixels."""
    offsets = [(0.0, 0.0), (0.1, 0.0), (0.0, 0.5)]
    for offset, seen in zip(offsets, displaced_pixels(rough, offsets), strict=True):
        sensor = rough.sensor.model_copy(update={"offset": list(offset)})
        alone = pixels(rough.model_copy(update={"sensor": sensor}))
        assert seen.stages == alone.stages
        np.testing.assert_array_equal(seen.ndvi, alone.ndvi)
        np.testing.assert_array_equal(seen.homogeneous_ndvi, alone.homogeneous_ndvi)
        np.testing.assert_array_equal(seen.truth["fpar"], alone.truth["fpar"])


def test_without_displacement_registration_is_ideal(scenario):
    still, moved = displaced_pixels(scenario(), [(0.0, 0.0), (0.0, 0.5)])
    assert "registration" not in still.stages and "registration" in moved.stages


@pytest.mark.parametrize("hills", [False, True])
def test_plain_arrays_and_labelled_functions_give_the_same_pixels(scenario, monkeypatch, hills):
    case = scenario(dem="flint-hills" if hills else "flat")
    plain = pixels(case)
    monkeypatch.setattr(_Scene, "is_stand", lambda scene, ground: False)
    labelled = pixels(case)
    np.testing.assert_array_equal(plain.ndvi, labelled.ndvi)
    np.testing.assert_array_equal(plain.truth["fpar"], labelled.truth["fpar"])


def test_adjacency_is_that_of_the_labelled_chain(scenario):
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


def test_a_tangent_has_the_value_and_slope_of_the_curve_at_the_middle():
    """Beer's law, whose derivative is known; a central difference is as near as its step squared."""
    lai, extinction = np.linspace(0.2, 2.5, 40).reshape(5, 8), 0.7
    found = along_tangent(lambda area: 1 - np.exp(-extinction * area), lai, np.full(lai.shape, 1.2))
    left = np.exp(-extinction * 1.2)
    np.testing.assert_allclose(found, 1 - left + extinction * left * (lai - 1.2), rtol=0, atol=STEP**2 / 10)
    assert np.ptp(np.diff(found.ravel()) / np.diff(lai.ravel())) < 1e-10
