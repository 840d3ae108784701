"""Optimal estimation, the lookup table and networks against closed forms, brute force and published cases."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.base import files
from fifesim.retrieval import networks
from fifesim.retrieval.inversion import optimal_estimation, table_posterior

DATA = Path(__file__).parents[1] / "data"
LINEAR = pd.read_csv(DATA / "optimal_estimation_linear.csv", comment="#")
CASES = pd.read_csv(DATA / "sl2p_cases.csv", comment="#")


def forward_of(slope):
    return lambda states, pixels: (states @ slope.T, np.broadcast_to(slope, (len(states), *slope.shape)))


def test_linear_problems_agree_with_the_closed_form():
    for _, rows in LINEAR.groupby("case"):
        parts = rows.groupby("what")
        own = {what: part.pivot(index="row", columns="column", values="value").to_numpy() for what, part in parts}
        prior = own["xa"][:, 0], own["Sa"], own["Se"]
        found = optimal_estimation(own["y"].T, forward_of(own["K"]), *prior, tolerance=1e-9)
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
    given = {"cross_covariance": cross, "tolerance": 1e-9}
    found = optimal_estimation(measured, forward_of(slope), prior, spread, error, **given)
    both = spread @ slope.T + cross
    gain = both @ np.linalg.inv(slope @ spread @ slope.T + slope @ cross + cross.T @ slope.T + error)
    np.testing.assert_allclose(found.state, prior + (measured - slope @ prior) @ gain.T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.covariance, np.broadcast_to(spread - gain @ both.T, (5, 2, 2)), rtol=0, atol=1e-9)


def saturating(states, pixels):
    """Two measurements that saturate with one state, as reflectance saturates with leaf area."""
    decay = np.exp(-states)
    return np.hstack([0.4 - 0.3 * decay, 0.05 + 0.1 * decay]), np.stack([0.3 * decay, -0.1 * decay], axis=1)


def test_estimate_minimises_the_cost_within_its_limits():
    measured = np.array([[0.31, 0.09], [0.2, 0.14]])
    prior, spread, error = np.array([1.0]), np.array([[0.5]]), np.diag([1e-4, 4e-4])
    found = optimal_estimation(measured, saturating, prior, spread, error, tolerance=1e-8)
    states = np.linspace(0, 5, 50_001)[:, None]
    for pixel in range(2):
        rest = measured[pixel] - saturating(states, None)[0]
        cost = np.einsum("ni,ij,nj->n", rest, np.linalg.inv(error), rest) + (states[:, 0] - prior) ** 2 / spread[0, 0]
        assert found.state[pixel, 0] == pytest.approx(states[cost.argmin(), 0], abs=2e-4)
        assert found.chi_square[pixel] == pytest.approx(cost.min(), rel=1e-6)
    measured, limits = np.array([[np.nan, 0.09], [0.5, 0.0]]), (np.array([0.0]), np.array([3.0]))
    found = optimal_estimation(measured, saturating, prior, 20 * spread, 1e-6 * np.eye(2), limits=limits)
    assert np.isnan(found.state[0, 0]) and not found.converged[0]
    assert found.state[1, 0] == 3.0


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


BANDS = list(networks.SL2P_BANDS)


def sl2p_of(cases, quantity):
    angles = (cases[name].to_numpy() for name in ("cos_vza", "cos_sza", "cos_raa"))
    return networks.sl2p(cases[BANDS].to_numpy(), *angles, quantity)


@pytest.mark.parametrize(("quantity", "bound"), [("LAI", 3e-4), ("FAPAR", 2e-5), ("FCOVER", 1e-6)])
def test_sl2p_gives_the_published_values(quantity, bound):
    cases = CASES[(CASES.variable == quantity) & CASES.expected.notna()]
    found, _ = sl2p_of(cases, quantity)
    assert len(cases) >= 25
    assert np.abs(found - cases.expected).max() < bound


def domain_by_the_rule(spectrum, ranges, cells):
    """Whether bands are within their ranges and their decile cell is in the list."""
    text = ""
    for value, low, high in zip(spectrum, *ranges, strict=True):
        if not low <= value <= high:
            return False
        text += "123456789A"[min(int(10 * (value - low) / (high - low)), 9)]
    return text in cells


def test_domain_of_sl2p_follows_its_definition():
    ranges = files.table("sl2p/ranges.csv")
    ranges = ranges[ranges.variable == "LAI"].set_index("quantity")
    domain = ranges.loc[BANDS, ["domain_min", "domain_max"]].to_numpy().T
    cells = set(files.table("sl2p/domain_cells.csv").cell.astype(str))
    inside = CASES[CASES.variable == "LAI"][BANDS].to_numpy()
    rng = np.random.default_rng(3)
    spectra = np.concatenate([inside, inside * rng.uniform(0.6, 1.5, inside.shape), rng.uniform(0, 0.5, (300, 8))])
    expected = np.array([domain_by_the_rule(each, domain, cells) for each in spectra])
    assert 50 < expected.sum() < len(spectra) - 50
    assert np.array_equal(networks._in_domain(spectra, domain), expected)
    _, outside = networks.sl2p(spectra, *np.full((3, len(spectra)), 0.95), "LAI")
    assert (outside >= ~expected).all()


def test_values_beyond_the_range_by_less_than_the_tolerance_are_clipped():
    """One published case of FAPAR is clipped at 0; raw outputs of some spectra are above 0.94."""
    found, _ = sl2p_of(CASES[CASES.variable == "FAPAR"], "FAPAR")
    assert found.min() == 0 and found.max() == 0.94
    spectra = np.random.default_rng(0).uniform(0, 0.6, (5000, 8))
    value, outside = networks.sl2p(spectra, *np.full((3, 5000), 0.95), "LAI")
    beyond = (value < 0) | (value > 8)
    assert beyond.any() and outside[beyond].all()
    assert (np.maximum(-value, value - 8)[beyond] > 0.2).all()


def test_trained_quantiles_agree_with_a_known_distribution():
    """The target is normal with mean 2 x and standard deviation 0.2 + 0.3 |x|."""
    rng = np.random.default_rng(5)
    x = rng.uniform(-1, 1, (20_000, 1))
    y = 2 * x + (0.2 + 0.3 * np.abs(x)) * rng.normal(size=x.shape)
    layers = networks.train_quantiles(x, y, np.array([0.1, 0.5, 0.9]), seed=1, epochs=20)
    at = np.linspace(-0.9, 0.9, 7)[:, None]
    expected = 2 * at + (0.2 + 0.3 * np.abs(at)) * np.array([-1.2816, 0, 1.2816])
    assert np.abs(networks.network(at, layers) - expected).max() < 0.06


def test_gradients_agree_with_finite_differences():
    rng = np.random.default_rng(2)
    found = [rng.normal(size=shape) for shape in ((3, 4), (4, 4), (4, 2), (4,), (4,), (2,))]
    inputs, targets = rng.normal(size=(50, 3)), rng.normal(size=(50, 2))
    wanted = np.array([0.2, 0.7])

    def loss(values):
        outputs = networks.network(inputs, networks.Network(tuple(values[:3]), tuple(values[3:])))
        error = targets - outputs
        return (np.maximum(wanted * error, (wanted - 1) * error).sum(1)).mean()

    slopes = networks._slopes(found, inputs, targets, wanted)
    for at, place in ((0, (1, 2)), (1, (3, 0)), (2, (0, 1)), (3, (2,)), (4, (1,)), (5, (0,))):
        moved = [each.copy() for each in found]
        moved[at][place] += 1e-6
        assert (loss(moved) - loss(found)) / 1e-6 == pytest.approx(slopes[at][place], abs=1e-4)
