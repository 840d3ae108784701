"""Smooth noise: its variance, its independence and its windows."""

import numpy as np
import pytest

from fifesim.ground.terrain.spline import noise_square, smooth_noise


def test_noise_has_unit_variance_between_nodes_too():
    """Every sixth of a lattice step; four standard errors of so many nodes, whose weights tie neighbours."""
    at = np.arange(1500) * 5.0
    noise = smooth_noise(3, 1, 30.0, at, at)
    assert np.mean(noise**2) == pytest.approx(1, abs=4 * np.sqrt(2 * 2.2 / 250**2))
    assert noise.mean() == pytest.approx(0, abs=4 / (250 * 0.39))
    fine, coarse = (np.sqrt(np.mean(np.diff(noise[:, ::step], 2) ** 2)) for step in (1, 2))
    assert coarse / fine == pytest.approx(4, rel=0.1)


def test_window_is_a_slice_and_streams_and_seeds_are_unrelated():
    south, east = -700.0 + 7.0 * np.arange(200), 96.0 + 9.0 * np.arange(150)
    whole = smooth_noise(7, 2, 16.0, south, east)
    np.testing.assert_array_equal(smooth_noise(7, 2, 16.0, south[50:60], east[9:11]), whole[50:60, 9:11])
    others = [smooth_noise(seed, stream, 16.0, south, east) for seed, stream in ((7, 3), (8, 2))]
    assert np.abs(np.corrcoef([each.ravel() for each in (whole, *others)]) - np.eye(3)).max() < 0.1


def test_square_of_nodes_is_noise_of_the_same_kind():
    drawn = np.random.default_rng(1)
    squares = [noise_square(drawn, 0.3, 181) for _ in range(20)]
    assert np.shape(squares) == (20, 181, 181)
    assert np.mean(np.square(squares)) == pytest.approx(1, abs=0.06)
