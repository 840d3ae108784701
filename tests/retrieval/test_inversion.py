"""Optimal estimation against closed-form solutions, and the lookup table against the normal posterior."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from fifesim.retrieval.inversion import optimal_estimation, table_posterior

LINEAR = pd.read_csv(Path(__file__).parents[1] / "data" / "optimal_estimation_linear.csv", comment="#")
PROBLEMS = {
    case: {
        what: part.pivot(index="row", columns="column", values="value").to_numpy()
        for what, part in rows.groupby("what")
    }
    for case, rows in LINEAR.groupby("case")
}


def forward_of(slope):
    return lambda states, pixels: (states @ slope.T, np.broadcast_to(slope, (len(states), *slope.shape)))


def test_linear_problems_agree_with_the_closed_form():
    for own in PROBLEMS.values():
        found = optimal_estimation(
            own["y"].T, forward_of(own["K"]), own["xa"][:, 0], own["Sa"], own["Se"], tolerance=1e-9
        )
        assert found.converged.all()
        assert found.state[0] == pytest.approx(own["x_hat"][:, 0], abs=1e-9)
        assert found.covariance[0] == pytest.approx(own["S_hat"], abs=1e-9)
        assert found.averaging_kernel[0] == pytest.approx(own["A"], abs=1e-9)
        assert found.degrees_of_freedom[0] == pytest.approx(own["dof"][0, 0], abs=1e-9)
        assert found.chi_square[0] == pytest.approx(own["cost"][0, 0], abs=1e-9)


def test_error_that_depends_on_the_state_agrees_with_the_estimate_of_minimum_variance():
    """Covariances of state and measurement, which blur makes weaker than the derivative of the model alone."""
    rng = np.random.default_rng(3)
    slope, prior = rng.normal(size=(4, 2)), np.array([1.0, -0.5])
    states, noise = rng.normal(size=(2, 2)), rng.normal(0, 0.3, (4, 4))
    spread = states @ states.T + np.eye(2)
    cross = -0.4 * spread @ slope.T
    error = 0.16 * slope @ spread @ slope.T + noise @ noise.T + 0.01 * np.eye(4)
    measured = rng.normal(size=(5, 4))
    found = optimal_estimation(
        measured, forward_of(slope), prior, spread, error, cross_covariance=cross, tolerance=1e-9
    )
    both = spread @ slope.T + cross
    gain = both @ np.linalg.inv(slope @ spread @ slope.T + slope @ cross + cross.T @ slope.T + error)
    np.testing.assert_allclose(found.state, prior + (measured - slope @ prior) @ gain.T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.covariance, np.broadcast_to(spread - gain @ both.T, (5, 2, 2)), rtol=0, atol=1e-9)


def saturating(states, pixels):
    """Two measurements that saturate with one state, as reflectance saturates with leaf area."""
    decay = np.exp(-states)
    return np.hstack([0.4 - 0.3 * decay, 0.05 + 0.1 * decay]), np.stack([0.3 * decay, -0.1 * decay], axis=1)


def test_estimate_minimises_the_cost():
    measured = np.array([[0.31, 0.09], [0.2, 0.14]])
    prior, spread, error = np.array([1.0]), np.array([[0.5]]), np.diag([1e-4, 4e-4])
    found = optimal_estimation(measured, saturating, prior, spread, error, tolerance=1e-8)
    states = np.linspace(0, 5, 50_001)[:, None]
    for pixel in range(2):
        rest = measured[pixel] - saturating(states, None)[0]
        cost = np.einsum("ni,ij,nj->n", rest, np.linalg.inv(error), rest) + (states[:, 0] - prior) ** 2 / spread[0, 0]
        assert found.state[pixel, 0] == pytest.approx(states[cost.argmin(), 0], abs=2e-4)
        assert found.chi_square[pixel] == pytest.approx(cost.min(), rel=1e-6)


def test_missing_measurements_and_limits():
    measured = np.array([[np.nan, 0.09], [0.5, 0.0]])
    found = optimal_estimation(
        measured, saturating, np.array([1.0]), np.array([[10.0]]), 1e-6 * np.eye(2),
        limits=(np.array([0.0]), np.array([3.0])),
    )  # fmt: skip
    assert np.isnan(found.state[0, 0]) and not found.converged[0]
    assert found.state[1, 0] == 3.0


def test_lookup_converges_to_the_normal_posterior():
    """Mean of 40 tables of 3600 members; the error of a mean from one table is about 0.02."""
    rng, slope, measured = np.random.default_rng(9), np.array([[1.0], [0.5]]), np.array([[0.8, -0.2]])
    whole = 1 / (1 + (slope**2).sum())
    posterior, found = stats.norm(whole * (measured @ slope)[0, 0], np.sqrt(whole)), []
    for _ in range(40):
        states = rng.normal(0, 1, (3600, 1))
        mean, sd, quantiles, _ = table_posterior(measured, states @ slope.T, states, np.array([0.1, 0.5, 0.9]))
        found.append([mean[0, 0], sd[0, 0], *quantiles[0, 0]])
    expected = [posterior.mean(), posterior.std(), *posterior.ppf([0.1, 0.5, 0.9])]
    np.testing.assert_allclose(np.mean(found, axis=0), expected, rtol=0, atol=0.006)


def test_lookup_agrees_with_brute_force():
    """Weights and quantiles of a small table, computed pixel by pixel; a missing measurement has no estimate."""
    rng = np.random.default_rng(4)
    members, states, measured = rng.normal(size=(30, 2)), rng.normal(size=(30, 2)), rng.normal(size=(5, 2))
    wanted = np.array([0.05, 0.4, 0.5, 0.95])
    mean, sd, quantiles, chi_square = table_posterior(measured, members, states, wanted)
    assert all(np.isnan(each).all() for each in table_posterior(measured[:1] * [[np.nan, 1]], members, states, wanted))
    for pixel in range(5):
        distance = ((measured[pixel] - members) ** 2).sum(1)
        weight = np.exp(-0.5 * distance)
        weight /= weight.sum()
        assert chi_square[pixel] == pytest.approx(distance.min())
        assert mean[pixel] == pytest.approx(weight @ states, rel=1e-6)
        assert sd[pixel] == pytest.approx(np.sqrt(weight @ (states - weight @ states) ** 2), rel=1e-6)
        for kind in range(2):
            order = np.argsort(states[:, kind])
            middle = np.cumsum(weight[order]) - 0.5 * weight[order]
            expected = np.interp(wanted, middle, states[order, kind])
            assert quantiles[pixel, kind] == pytest.approx(expected, abs=1e-6)
