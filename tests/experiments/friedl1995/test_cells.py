"""Cells of the nine scenes as arrays."""

import numpy as np
import pytest

from fifesim.experiments.friedl1995.case import Case
from fifesim.experiments.friedl1995.table import cells_of, ground_of, periodic_scene
from fifesim.ground.landscape.distribution import lai_distribution


@pytest.mark.parametrize("dem", ["flat", "flint-hills"])
def test_cells_are_those_of_the_labelled_ground(dem):
    case = Case(cells=90, dem=dem)
    scene = "burned-ungrazed", 0.15, 4, case.land()
    cells, ground = cells_of(case, *scene), ground_of(case, *scene)
    for name in ("lai", "fpar", "reflectance"):
        np.testing.assert_array_equal(getattr(cells, name), getattr(ground, name))


def test_treatments_of_a_seed_lie_on_one_field():
    scenes = [periodic_scene(name, 0.24, 5, (40, 50)) for name in ("burned-grazed", "unburned-ungrazed")]
    orders = [np.argsort(each, axis=None) for each in scenes]
    np.testing.assert_array_equal(*orders)
    ranks = (np.arange(2000) + 0.5) / 2000
    np.testing.assert_array_equal(np.sort(scenes[1].ravel()), lai_distribution("unburned-ungrazed").ppf(ranks))
    assert (np.argsort(periodic_scene("burned-grazed", 0.24, 6, (40, 50)), axis=None) != orders[0]).any()
