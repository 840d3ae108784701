"""The compiled slab against sums of divided differences, which hold for all rates."""

import numpy as np
import pytest
from scipy.optimize import brentq

from fifesim.ground.canopy import sail_model
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.sail_model import leaf_scattering, sail

FIELDS = ("rso", "rdo", "rsd", "rdd", "tss", "too", "tsd", "tdo", "tdd")


def by_chains(monkeypatch, *args, **options):
    with monkeypatch.context() as patch:
        patch.setattr(sail_model, "_slabs", lambda *given: given[-1].fill(True))
        return sail(*args, **options)


@pytest.mark.parametrize("leaf_angles", ["spherical", "planophile", "campbell(80)", "0: 1", "90: 1"])
@pytest.mark.parametrize("angles", [(28.5, 10, 40), (0, 0, 0), (60, 60, 0), (75, 50, 180)])
def test_slab_is_the_sum_of_its_chains(leaf_angles, angles, monkeypatch):
    """From almost no leaves to LAI 60, from black to conservative ones."""
    random = np.random.default_rng(7)
    lai = np.concatenate([random.uniform(0, 8, 200), 10 ** random.uniform(-8, 1.8, 200), [0.0]])
    absorbed = 10 ** random.uniform(-9, 0, lai.size)
    absorbed[:40], absorbed[40:80] = 0, 1
    rho = (1 - absorbed) * random.uniform(0, 1, lai.size)
    tau = np.maximum(1 - absorbed - rho, 0)
    given = dict(zip(("sza", "vza", "raa"), angles, strict=True), leaf_angles=leaf_angles)
    found, expected = sail(lai, rho, tau, **given), by_chains(monkeypatch, lai, rho, tau, **given)
    for name in FIELDS:
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-14, err_msg=name)


def test_rates_that_are_nearly_equal_are_not_singular(monkeypatch):
    """Sun, view and diffuse light that fade at the same rate, to 1e-14 of it and to a hundredth."""
    classes = leaf_angle_classes("spherical")
    angles = 40.0, 40.0, 30.0
    rate = float(leaf_scattering(0.1, 0.1, *angles, classes).ks)
    leaf = brentq(lambda each: float(leaf_scattering(each, each, *angles, classes).m) - rate, 0, 0.49)
    random = np.random.default_rng(8)
    rho = leaf + 10 ** random.uniform(-14, -2, 2000) * random.choice([-1, 1], 2000)
    lai = 10 ** random.uniform(-4, 1.5, 2000)
    given = {"sza": 40.0, "vza": 40.0 + 10 ** random.uniform(-12, -1, 2000), "raa": 30.0}
    found, expected = sail(lai, rho, rho, **given), by_chains(monkeypatch, lai, rho, rho, **given)
    for name in FIELDS:
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-14, err_msg=name)


def test_only_leaves_that_hardly_intercept_light_take_the_slow_way(monkeypatch):
    asked = []
    chains = sail_model._by_chains
    monkeypatch.setattr(sail_model, "_by_chains", lambda *given: asked.append(len(given[0])) or chains(*given))
    sail(np.array([1.0, 2.0]), 0.45, 0.42, sza=np.array([30.0, 0.0]), leaf_angles="90: 1")
    assert asked == [1]
    sail(np.array([1.0, 2.0]), 0.45, 0.42, sza=30.0)
    assert asked == [1]


def test_directions_of_cells_that_are_equal_are_summed_once_and_stay_in_their_place():
    sza = np.array([[30.0, 50.0], [50.0, np.nan]])
    found = sail(1.0, 0.07, 0.04, sza=sza, vza=20.0, raa=200.0, hotspot=0.1)
    for place in np.ndindex(2, 2):
        one = sail(1.0, 0.07, 0.04, sza=sza[place], vza=20.0, raa=160.0, hotspot=0.1)
        np.testing.assert_array_equal(found.rso[place], one.rso)
