"""Cells that differ in dead leaves and crowns, from tables and one by one."""

import numpy as np
import pytest
from fifesim.ground.canopy.cell_reflectance import varied_reflectance
from fifesim.ground.canopy.scene import Scene, cell_by_cell

from fifesim.ground.canopy.foliage_table import LIMIT
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes

OPTICS = {
    "leaf_reflectance": (0.07, 0.45),
    "leaf_transmittance": (0.04, 0.42),
    "brown_reflectance": (0.28, 0.42),
    "brown_transmittance": (0.12, 0.3),
    "sky": (0.2, 1.0),
}
N = 500


@pytest.fixture(scope="module")
def cells():
    rng = np.random.default_rng(8)
    lai, brown, cover = rng.gamma(1.2, 1.5, N), rng.beta(0.6, 0.8, N), rng.uniform(0.05, 1, N)
    lai[:8], brown[:8], cover[:8] = [0, 1, 1, 8, 8, 1e-9, 15, 20], [0.5, 0, 1, 0, 1, 0.3, 1e-6, 0.999], [1, 1] * 4
    cover = np.maximum(cover, lai / 90)
    return lai, brown, cover, rng.choice([0, 0.2, 0.99, 1], (2, N))


def scene(sza, vza, raa, hotspot, leaf_angles, **given):
    return Scene(
        **OPTICS, sza=sza, vza=vza, raa=raa, hotspot=hotspot, leaf_angles=leaf_angle_classes(leaf_angles), **given
    )


def check(lai, ground, scene):
    exact = cell_by_cell(lai, ground, scene)
    np.testing.assert_allclose(varied_reflectance(lai, ground, scene), exact, rtol=0, atol=1e-6)


def test_tables_are_within_the_bound(cells):
    lai, brown, cover, ground = cells
    view, kinds = (40, 38, 5, 0.05, "spherical"), {"brown": brown, "dissociation": 0.7}
    check(lai, ground, scene(*view, **kinds))
    check(lai, ground, scene(*view, **kinds, crown_cover=cover))
    check(lai, ground, scene(*view, crown_cover=cover, crown_shape=0.4))


@pytest.mark.slow
@pytest.mark.parametrize("view", [(85, 80, 0, 0.01, "erectophile"), (0, 0, 0, 0, "90: 1")])
def test_and_at_the_horizon_and_overhead(cells, view):
    lai, brown, cover, ground = cells
    check(lai, ground, scene(*view, brown=brown, dissociation=1.0, crown_cover=cover))
    check(lai, ground[:, :1], scene(*view, brown=brown, dissociation=0.5, crown_cover=0.6))


def test_canopies_beyond_the_table_are_the_models_themselves(cells):
    lai, brown, cover, ground = (each[..., :6].copy() for each in cells)
    lai[2:4], cover[3] = LIMIT + 1, 1
    given = scene(28.5, 0, 0, 0, "spherical", brown=brown, dissociation=0.9, crown_cover=np.maximum(cover, 0.7))
    found, exact = varied_reflectance(lai, ground, given), cell_by_cell(lai, ground, given)
    np.testing.assert_array_equal(found[:, 2:4], exact[:, 2:4])
    given = given._replace(dissociation=cover)
    np.testing.assert_array_equal(varied_reflectance(lai, ground, given), cell_by_cell(lai, ground, given))
