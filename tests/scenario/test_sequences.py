"""Sequences fill the space as their names say."""

import numpy as np
import pytest

from fifesim.scenario.distributions import SEQUENCES, points


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_points_are_a_function_of_seed_and_stream(sequence):
    found = points(sequence, 7, 3, 16, 2)
    assert found.shape == (16, 2) and (found >= 0).all() and (found < 1).all()
    np.testing.assert_array_equal(found, points(sequence, 7, 3, 16, 2))
    assert (found != points(sequence, 8, 3, 16, 2)).any() and (found != points(sequence, 7, 4, 16, 2)).any()


@pytest.mark.parametrize("sequence", ["sobol", "random"])
def test_more_points_leave_the_first_as_they_are(sequence):
    np.testing.assert_array_equal(points(sequence, 7, 3, 5, 3), points(sequence, 7, 3, 500, 3)[:5])


def test_every_slice_of_a_dimension_has_one_point():
    """2**k points of a Sobol sequence are a net."""
    slices = np.sort(np.floor(points("sobol", 7, 3, 64, 4) * 64), axis=0)
    np.testing.assert_array_equal(slices, np.arange(64)[:, None] * np.ones(4))


def test_no_point_and_no_dimension_are_empty():
    assert points("sobol", 7, 3, 0, 2).shape == (0, 2)
    assert points("random", 7, 3, 5, 0).shape == (5, 0)
