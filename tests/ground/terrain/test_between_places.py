"""Values between places: those of scipy's linear interpolation, and the last place's past it."""

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from fifesim.ground.terrain.slope import bilinear


def test_values_are_those_of_a_linear_interpolation():
    rng = np.random.default_rng(1)
    layer = rng.standard_normal((6, 9))
    rows, columns = np.sort(rng.uniform(0, 5, 40)), np.sort(rng.uniform(0, 8, 30))
    found = bilinear(layer, *((at.astype(int), at - at.astype(int)) for at in (rows, columns)))
    known = RegularGridInterpolator((np.arange(6), np.arange(9)), layer)
    expected = known(np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_past_the_last_place_there_is_its_value():
    layer = np.array([[1.0, 2.0], [3.0, 5.0]])
    found = bilinear(layer, (np.array([1]), np.array([0.5])), (np.array([1]), np.array([0.7])))
    assert found.item() == 5.0


def test_unknown_places_make_cells_beside_them_unknown():
    layer = np.array([[1.0, np.nan, 2.0, 2.0]])
    at = np.array([0, 0, 2]), np.array([0.0, 0.5, 0.5])
    np.testing.assert_array_equal(
        np.isnan(bilinear(layer, (np.array([0]), np.array([0.0])), at))[0], [True, True, False]
    )
