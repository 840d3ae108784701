"""Tests of tabulated canopy reflectance against exact evaluation, and of interpolation in tables."""

import numpy as np
import pytest

from fifesim.ground.canopy.interpolation import (
    LARGEST_FOLIAGE_LAI,
    LARGEST_TABLE_LAI,
    interpolate,
    tabulate,
    tabulate_foliage,
)
from fifesim.ground.canopy.layers import light_budget
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.reflectance_table import (
    Scene,
    canopy_reflectance,
    cell_by_cell,
    directional_reflectance,
    scene_light,
    varied_reflectance,
)
from fifesim.ground.canopy.sail_model import reflectance_factor, sail, with_background

RHO, TAU = np.array([0.07, 0.45, 0.5, 0.0, 0.6, 1.0]), np.array([0.04, 0.42, 0.5, 0.0, 0.4, 0.0])
SKY, GROUND = np.array([0, 0.1, 0.2, 0.5, 1, 0.3]), np.array([0.15, 0.19, 1, 0, 1, 0.5])
SCENES = [
    (28.5, 0, 0, 0, "spherical"),
    (28.5, 28.5, 0, 0.05, "erectophile"),
    (50, 50.1, 0, 0.001, "spherical"),
    (60, 45, 180, 2, "verhoef(-0.35, -0.15)"),
    (89.9, 89.9, 0, 0.01, "planophile"),
    (0, 89.9, 0, 0, "90: 1"),
]


@pytest.mark.parametrize("by_cell", [False, True])
@pytest.mark.parametrize("scene", SCENES)
def test_table_is_within_its_tolerance(scene, by_cell):
    """Over a background by band, and over one by band and cell."""
    rng = np.random.default_rng(8)
    lai = np.concatenate([[0, 1e-9, LARGEST_TABLE_LAI], 10 ** rng.uniform(-4, 2, 1000), rng.uniform(0, 8, 1000)])
    ground = rng.choice([0, 0.2, 0.99, 1], (RHO.size, lai.size)) if by_cell else GROUND
    given = dict(zip(("sza", "vza", "raa", "hotspot", "leaf_angles"), scene, strict=True))
    surface = with_background(sail(lai, RHO[:, None], TAU[:, None], **given), ground.reshape(RHO.size, -1))
    expected = reflectance_factor(surface.rso, surface.rdo, SKY[:, None])
    table = canopy_reflectance(lai, RHO, TAU, ground, diffuse_fraction=SKY, **given)
    np.testing.assert_allclose(table, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("exactly", [False, True])
@pytest.mark.parametrize("ground", [0.15, np.full((2, 3, 4), 0.15), np.full((3, 4), 0.15), [0.15, 0.15]])
def test_reflectance_without_leaves_is_the_background_and_nan_stays_in_its_cell(ground, exactly):
    lai = np.zeros((3, 4))
    lai[1, 2] = np.nan
    result = canopy_reflectance(lai, [0.07, 0.45], [0.04, 0.42], ground, sza=28.5, hotspot=0.1, exact=exactly)
    assert result.shape == (2, 3, 4) and result.dtype == np.float64
    assert np.all(np.isnan(result) == np.isnan(lai))
    assert np.all(result[:, ~np.isnan(lai)] == 0.15)
    one_missing = np.array([[0.1, np.nan], [0.1, 0.1]])
    result = canopy_reflectance(np.ones(2), [0.1, 0.1], [0.1, 0.1], one_missing, sza=30, exact=exactly)
    np.testing.assert_array_equal(np.isnan(result), np.isnan(one_missing))


def test_memory_layout_of_cells_changes_no_bit():
    lai = np.random.default_rng(1).gamma(2, 0.5, (30, 40))
    given = {"leaf_reflectance": [0.07, 0.45], "leaf_transmittance": [0.04, 0.42], "background": 0.2, "sza": 28.5}
    whole = canopy_reflectance(lai, **given)
    np.testing.assert_array_equal(canopy_reflectance(lai[3:17:2, ::-1], **given), whole[:, 3:17:2, ::-1])
    np.testing.assert_array_equal(canopy_reflectance(np.asfortranarray(lai), **given), whole)
    np.testing.assert_array_equal(canopy_reflectance(lai[4, 5], **given), whole[:, 4, 5])


def test_directions_by_cell_equal_scenes_with_these_directions():
    """Also for azimuths above 180 degrees; an angle of NaN gives NaN."""
    rng = np.random.default_rng(3)
    lai, background = rng.gamma(2, 0.5, 12), rng.uniform(0.05, 0.4, (12, 2))
    sza, vza, raa = rng.uniform(0, [[85], [85], [360]], (3, 12))
    vza[5] = np.nan
    leaf, sky = ([0.07, 0.45], [0.04, 0.42]), np.array([0.2, 0.1])
    shape = {"leaf_angles": "planophile", "hotspot": 0.1}
    found = directional_reflectance(lai, leaf, background, sky, (sza, vza, raa), **shape)
    assert np.isnan(found[:, 5]).all()
    for cell in (*range(5), *range(6, 12)):
        here = {"sza": sza[cell], "vza": vza[cell], "raa": raa[cell], "diffuse_fraction": sky, "exact": True}
        alone = canopy_reflectance(lai[cell], *leaf, background[cell], **here, **shape)
        np.testing.assert_allclose(found[:, cell], alone, rtol=1e-13)
    with pytest.raises(ValueError, match=r"sza must be in \[0, 90\) degrees in every cell, got 90"):
        directional_reflectance(lai, leaf, background, sky, (90.0, vza, raa), **shape)


BOTH_LEAVES = {
    "leaf_reflectance": (0.07, 0.45),
    "leaf_transmittance": (0.04, 0.42),
    "brown_reflectance": (0.28, 0.42),
    "brown_transmittance": (0.12, 0.3),
    "sky": (0.2, 1.0),
}


@pytest.fixture(scope="module")
def varied_cells():
    n = 500
    rng = np.random.default_rng(8)
    lai, brown, cover = rng.gamma(1.2, 1.5, n), rng.beta(0.6, 0.8, n), rng.uniform(0.05, 1, n)
    lai[:8], brown[:8], cover[:8] = [0, 1, 1, 8, 8, 1e-9, 15, 20], [0.5, 0, 1, 0, 1, 0.3, 1e-6, 0.999], [1, 1] * 4
    cover = np.maximum(cover, lai / 90)
    cover[8] = 0
    ground = rng.choice([0, 0.2, 0.99, 1], (2, n))
    lai[9] = brown[10] = cover[11] = ground[1, 12] = np.nan
    return lai, brown, cover, ground


def varied_scene(sza, vza, raa, hotspot, leaf_angles, **given):
    return Scene(
        **BOTH_LEAVES, sza=sza, vza=vza, raa=raa, hotspot=hotspot, leaf_angles=leaf_angle_classes(leaf_angles), **given
    )


def check_varied(lai, ground, scene):
    """Also that cells without data are NaN."""
    exact = cell_by_cell(lai, ground, scene)
    np.testing.assert_allclose(varied_reflectance(lai, ground, scene), exact, rtol=0, atol=1e-6)


def test_tables_over_dead_share_and_crowns_are_within_their_tolerance(varied_cells):
    lai, brown, cover, ground = varied_cells
    view, kinds = (40, 38, 5, 0.05, "spherical"), {"brown": brown, "dissociation": 0.7}
    check_varied(lai, ground, varied_scene(*view, **kinds))
    check_varied(lai, ground, varied_scene(*view, **kinds, crown_cover=cover))
    check_varied(lai, ground[:, :1], varied_scene(*view, brown=0.3, crown_cover=cover, crown_shape=0.4))


@pytest.mark.slow
@pytest.mark.parametrize("view", [(85, 80, 0, 0.01, "erectophile"), (0, 0, 0, 0, "90: 1")])
def test_tables_are_within_their_tolerance_at_the_horizon_and_overhead(varied_cells, view):
    lai, brown, cover, ground = varied_cells
    check_varied(lai, ground, varied_scene(*view, brown=brown, dissociation=1.0, crown_cover=cover))
    check_varied(lai, ground[:, :1], varied_scene(*view, brown=brown, dissociation=0.5, crown_cover=0.6))


def test_canopies_outside_the_table_are_evaluated_exactly(varied_cells):
    lai, brown, cover, ground = (each[..., :6].copy() for each in varied_cells)
    lai[2:4], cover[3] = LARGEST_FOLIAGE_LAI + 1, 1
    given = varied_scene(28.5, 0, 0, 0, "spherical", brown=brown, dissociation=0.9, crown_cover=np.maximum(cover, 0.7))
    found, exact = varied_reflectance(lai, ground, given), cell_by_cell(lai, ground, given)
    np.testing.assert_array_equal(found[:, 2:4], exact[:, 2:4])
    given = given._replace(dissociation=cover)
    np.testing.assert_array_equal(varied_reflectance(lai, ground, given), cell_by_cell(lai, ground, given))


@pytest.mark.parametrize(("name", "most"), [("lai", 100), ("brown", 1), ("ground", 1), ("crown_cover", 1)])
@pytest.mark.parametrize("is_low", [True, False])
def test_invalid_values_of_one_cell_are_refused(varied_cells, name, most, is_low):
    given = dict(zip(("lai", "brown", "crown_cover", "ground"), (each.copy() for each in varied_cells), strict=True))
    given[name].reshape(-1)[-10] = -0.005 if is_low else most + 0.005
    lai, ground = given.pop("lai"), given.pop("ground")
    view = (28.5, 0, 0, 0, "spherical")
    with pytest.raises(ValueError, match=r"must (be in \[0, 1\]|not be negative nor above 100), got|at most 100"):
        varied_reflectance(lai, ground, varied_scene(*view, **given))
    if name != "crown_cover":
        with pytest.raises(ValueError, match="must"):
            varied_reflectance(lai, ground, varied_scene(*view, brown=given["brown"]))


@pytest.mark.parametrize("part", ["all", "green", "light"])
@pytest.mark.parametrize("by_cell", [False, True])
def test_absorbed_light_is_the_light_budget_averaged_over_bands(varied_cells, part, by_cell):
    lai, brown, _, ground = (each[..., :40] for each in varied_cells)
    brown, below = (brown, ground) if by_cell else (0.3, np.array([[0.1], [0.25]]))
    scene, weights = varied_scene(35, 0, 0, 0, "spherical", brown=brown, dissociation=0.4), (0.3, 0.7)
    background = below.reshape(2, 5, 8) if by_cell else below[:, 0]
    found = scene_light(lai.reshape(5, 8), background, scene, weights, part)
    optics = zip(*BOTH_LEAVES.values(), below, weights, strict=True)
    total = sum(
        weight * np.array(light_budget(lai, *leaves, soil, brown=brown, dissociation=0.4, sza=35, diffuse_fraction=sky))
        for *leaves, sky, soil, weight in optics
    )
    expected = {"all": total[:1] + total[1:2], "green": total[:1], "light": total}[part]
    np.testing.assert_allclose(found, expected.reshape(-1, 5, 8), rtol=0, atol=1e-6)


def test_tables_meet_their_tolerance_or_raise():
    table = tabulate(lambda lai: np.stack([np.exp(-5 * lai), lai**2 / (1 + lai**2)]), rate=5.0)
    lai = np.random.default_rng(2).uniform(0, LARGEST_TABLE_LAI, 10_000)
    np.testing.assert_allclose(interpolate(table, lai), [np.exp(-5 * lai), lai**2 / (1 + lai**2)], atol=2.5e-7)
    assert np.all(np.isnan(interpolate(table, [np.nan, -1e-9, LARGEST_TABLE_LAI * 1.001, np.inf])))
    with pytest.raises(ValueError, match="exact=True"):
        tabulate(lambda lai: np.floor(lai)[None], rate=1.0)
    with pytest.raises(ValueError, match="exact=True"):
        tabulate_foliage(lambda lai, _: np.floor(lai)[None], rate=1.0, by_brown=False)
