"""Bayesian inversion: likelihood of the members of a lookup table, optimal estimation and its table of reflectance."""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from fifesim.base.arrays import compiled
from fifesim.chain.driver import Driver
from fifesim.ground.canopy.properties import NUMERIC_PROPERTIES
from fifesim.scenario.simulation import setup_of

# Members whose log-likelihood is lower than the best one by more than this have no effect on a quantile.
_NEGLIGIBLE = 20.0


def table_posterior(measured, members, states, probabilities):
    """
    Posterior mean, standard deviation and quantiles from the likelihood of the members of a table.

    The members are draws from the prior. Their weights are exp(-d² / 2), where d is the distance between measurement
    and member in units of the error.

    Parameters
    ----------
    measured : array, shape (n, m)
        Measurements, multiplied by the inverse square root of the covariance of their error.
    members : array, shape (k, m)
        Simulated measurements without error, multiplied in the same way.
    states : array, shape (k, q)
        Quantities of the members.
    probabilities : array, shape (p,)
        Probabilities of the quantiles.

    Returns
    -------
    mean, sd : array, shape (n, q)
    quantiles : array, shape (n, q, p)
    chi_square : array, shape (n,)
        Squared distance to the nearest member.

    References
    ----------
    [BevenBinley1992]_
    """
    orders = np.argsort(states, axis=0, kind="stable").T.copy()
    arrays = (np.ascontiguousarray(each, float) for each in (measured, members.T, states))
    return _table_posterior(*arrays, orders, np.asarray(probabilities, float))


@compiled
def _table_posterior(measured, members, states, orders, probabilities):
    """Body of `table_posterior`, with members of shape (m, k) and their order along each quantity."""
    count, width = measured.shape
    size, kinds = states.shape
    mean, sd = np.empty((count, kinds)), np.empty((count, kinds))
    quantiles, best = np.empty((count, kinds, probabilities.size)), np.empty(count)
    weight = np.empty(size)
    for pixel in range(count):
        # One measurement after the other, so that the loops over the members are vectorised.
        weight[:] = 0.0
        for at in range(width):
            value = measured[pixel, at]
            for member in range(size):
                difference = value - members[at, member]
                weight[member] += difference * difference
        nearest = weight.min()
        best[pixel] = nearest
        if not np.isfinite(nearest):
            best[pixel] = np.nan
            mean[pixel], sd[pixel], quantiles[pixel] = np.nan, np.nan, np.nan
            continue
        total = 0.0
        for member in range(size):
            below = 0.5 * (weight[member] - nearest)
            weight[member] = np.exp(-below) if below < _NEGLIGIBLE else 0.0
            total += weight[member]
        for kind in range(kinds):
            first = second = 0.0
            for member in range(size):
                if weight[member] > 0:
                    first += weight[member] * states[member, kind]
            first /= total
            for member in range(size):
                if weight[member] > 0:
                    second += weight[member] * (states[member, kind] - first) ** 2
            mean[pixel, kind], sd[pixel, kind] = first, np.sqrt(second / total)
            # Each member stands at the middle of its weight; between members the distribution is linear.
            wanted, reached, last, at = 0, 0.0, states[orders[kind, 0], kind], 0.0
            for place in range(size):
                member = orders[kind, place]
                if weight[member] == 0.0:
                    continue
                middle, value = (reached + 0.5 * weight[member]) / total, states[member, kind]
                while wanted < probabilities.size and probabilities[wanted] <= middle:
                    share = (probabilities[wanted] - at) / (middle - at) if reached > 0 else 1.0
                    quantiles[pixel, kind, wanted] = last + share * (value - last)
                    wanted += 1
                reached, last, at = reached + weight[member], value, middle
            while wanted < probabilities.size:
                quantiles[pixel, kind, wanted] = last
                wanted += 1
    return mean, sd, quantiles, best


class Solution(NamedTuple):
    """Result of optimal estimation by pixel."""

    state: np.ndarray
    """Shape (n, k)."""
    covariance: np.ndarray
    """Posterior covariance, shape (n, k, k)."""
    averaging_kernel: np.ndarray
    """Derivative of the estimate with respect to the true state, shape (n, k, k)."""
    chi_square: np.ndarray
    """Misfit to measurement and prior at the estimate, shape (n,)."""
    misfit: np.ndarray
    """Measurement less model at the estimate, shape (n, m)."""
    converged: np.ndarray
    """Shape (n,), bool."""

    @property
    def degrees_of_freedom(self):
        """Degrees of freedom for signal, shape (n,)."""
        return np.trace(self.averaging_kernel, axis1=-2, axis2=-1)


# Relative rounding error of the cost, above which a step counts as worse.
_ROUNDING = 1e-12
# Factors on the damping after a step that lowers the cost, and after one that does not.
_LESS_DAMPING, _MORE_DAMPING = 0.1, 10.0
_FIRST_DAMPING = 1e-2
_LARGEST_DAMPING = 1e8


def optimal_estimation(
    measured: np.ndarray,
    forward: Callable,
    prior: np.ndarray,
    prior_covariance: np.ndarray,
    error_covariance: np.ndarray,
    *,
    cross_covariance: np.ndarray | None = None,
    limits: tuple[np.ndarray, np.ndarray] | None = None,
    first: np.ndarray | None = None,
    iterations: int = 20,
    tolerance: float = 1e-3,
) -> Solution:
    """
    Most probable states by the method of Levenberg and Marquardt, all pixels together.

    Parameters
    ----------
    measured : array, shape (n, m)
    forward : callable
        ``forward(states, pixels)`` returns modelled measurements, shape (n, m), and their derivatives with respect to
        the states, shape (n, m, k), of the pixels with these numbers.
    prior : array, shape (k,)
    prior_covariance : array, shape (k, k)
    error_covariance : array, shape (m, m)
        Covariance of the errors of measurement and model.
    cross_covariance : array, shape (k, m), optional
        Covariance of the states with these errors, by default 0.
    limits : pair of array, shape (k,), optional
        Least and largest state; steps end there.
    first : array, shape (n, k), optional
        First guess, by default the prior.
    iterations : int, optional
        Largest number of steps.
    tolerance : float, optional
        A pixel has converged if its step is shorter than this share of the posterior standard deviation.

    Returns
    -------
    estimate : Solution

    References
    ----------
    [Rodgers2000]_, Eqs. 2.27, 2.78, 2.80, 5.35 and 5.36

    Notes
    -----
    If an error e is correlated with the state x, its linear regression on the state is added to the model F:
    y = F(x) + S_xe' S_a^-1 (x - x_a) + e', with the covariance S_e - S_xe' S_a^-1 S_xe of e'. For a linear model with
    derivative K, this is the estimate of minimum variance with cov(x, y) = S_a K' + S_xe and cov(y) = K S_a K' + K S_xe
    + S_xe' K' + S_e.
    """
    sharpness, size, count = np.linalg.inv(prior_covariance), len(prior), len(measured)
    # The expected error of a state is a part of the model, and the rest does not depend on the state.
    expected = np.zeros((size, measured.shape[1])) if cross_covariance is None else sharpness @ cross_covariance
    weight = np.linalg.inv(error_covariance - expected.T @ prior_covariance @ expected)
    lowest, highest = (np.full(size, -np.inf), np.full(size, np.inf)) if limits is None else limits
    state = np.clip(np.broadcast_to(prior, (count, size)) if first is None else first, lowest, highest).astype(float)
    is_known = np.isfinite(measured).all(axis=1)
    converged, damping = np.zeros(count, bool), np.full(count, _FIRST_DAMPING)

    def model(states, pixels):
        values, slopes = forward(states, pixels)
        return values + (states - prior) @ expected, slopes + expected.T

    def cost_of(states, modelled, at):
        misfit, departure = measured[at] - modelled, states - prior
        return _square(misfit, weight) + _square(departure, sharpness)

    modelled, slope = (np.array(each, float) for each in model(state, np.arange(count)))
    cost = cost_of(state, modelled, np.arange(count))
    active = np.flatnonzero(is_known)
    for _ in range(iterations):
        if not active.size:
            break
        gain = np.swapaxes(slope[active], 1, 2) @ weight
        inverse = gain @ slope[active] + sharpness
        downhill = np.einsum("nkm,nm->nk", gain, measured[active] - modelled[active])
        downhill -= (state[active] - prior) @ sharpness
        # Marquardt's scaling by the diagonal works for weak priors too.
        damped = inverse * (1 + damping[active, None, None] * np.eye(size))
        step = np.linalg.solve(damped, downhill[..., None])[..., 0]
        tried = np.clip(state[active] + step, lowest, highest)
        moved = tried - state[active]
        values, slopes = model(tried, active)
        found = cost_of(tried, values, active)
        length = np.sqrt(np.einsum("ni,nij,nj->n", moved, inverse, moved) / size)
        better = found <= cost[active] * (1 + _ROUNDING)
        at = active[better]
        state[at], modelled[at], slope[at], cost[at] = tried[better], values[better], slopes[better], found[better]
        damping[active] = np.where(better, damping[active] * _LESS_DAMPING, damping[active] * _MORE_DAMPING)
        # If no step lowers the cost, the solution is exact to rounding.
        converged[active] = (length < tolerance) & (better | (damping[active] > 1))
        active = active[~converged[active] & (damping[active] < _LARGEST_DAMPING)]
    inverse = np.swapaxes(slope, 1, 2) @ weight @ slope + sharpness
    covariance = np.linalg.inv(inverse)
    kernel = covariance @ (inverse - sharpness)
    for each in (state, cost, covariance, kernel):
        each[~is_known] = np.nan
    return Solution(state, covariance, kernel, cost, measured - modelled, converged)


def _square(vectors, matrix):
    """Quadratic forms of vectors with one symmetric matrix."""
    return np.einsum("ni,ij,nj->n", vectors, matrix, vectors, optimize=True)


DRAWN_STATES = {
    "soil": ("ground", "soil"),
    "moisture": ("ground", "moisture"),
    "brown": ("ground", "brown"),
    "chlorophyll": ("ground", "leaf", "chlorophyll"),
    "log_aot": ("atmosphere", "aot"),
}
"""Unknowns of optimal estimation besides LAI, where the training varies them, and their keys in a scenario."""

TABLE_ANGLES = ("sza", "vza", "raa")
"""Angles that may be axes of the tables."""

# Nodes along each axis. The interpolation error of reflectance is below 2e-4.
_NODES = {"lai": 12, "soil": 3, "moisture": 4, "brown": 3, "chlorophyll": 4, "log_aot": 4, "sza": 4, "vza": 4, "raa": 5}

# Angles that differ by less are constant. [degree]
_CONSTANT = 0.5


def axes_of(states, names, angles):
    """Lowest and highest value along each axis, by name: unknowns, and angles that vary in the training."""
    found = {}
    for name, values in zip(names, states.T, strict=True):
        low, high = values.min(), values.max()
        margin = 0.1 * (high - low)
        limits = NUMERIC_PROPERTIES.get(name)
        lowest, highest = (limits.lowest, limits.highest) if limits else (-np.inf, np.inf)
        found[name] = max(low - margin, lowest), min(high + margin, highest)
    # LAI may exceed the training, where it is rare.
    found["lai"] = 0.0, 1.25 * states[:, 0].max()
    for name, values in zip(TABLE_ANGLES, angles.T, strict=True):
        if np.ptp(values) > _CONSTANT:
            found[name] = values.min(), values.max()
    return found


def simulated_tables(study, level, bands, quantities, axes, angles):
    """Chebyshev coefficients of reflectance and quantities, shapes (nodes of each axis, bands or quantities)."""
    nodes = {
        name: low + 0.5 * (high - low) * (1 + chebyshev.chebpts1(_NODES[name])) for name, (low, high) in axes.items()
    }
    shape = tuple(map(len, nodes.values()))
    light, values = np.empty((*shape, len(bands))), np.empty((*shape, len(quantities)))
    base = {key.path: drawn.usual for key, drawn in study.drawn.items() if key.path[0] not in ("landscape", "sensor")}
    base |= {("landscape",): {}} | _direction(dict(zip(TABLE_ANGLES, angles, strict=True)))
    lai, *others = nodes.values()
    names, places = list(axes)[1:], product(*map(range, shape[1:]))
    for place, node in zip(places, product(*others), strict=True):
        own = dict(zip(names, map(float, node), strict=True))
        drawn = {DRAWN_STATES[name]: value for name, value in own.items() if name in DRAWN_STATES}
        if "log_aot" in own:
            drawn |= {("atmosphere", "aot"): float(np.exp(own["log_aot"])), ("atmosphere", "visibility"): None}
        if set(own) & set(TABLE_ANGLES):
            drawn |= _direction(dict(zip(TABLE_ANGLES, angles, strict=True)) | own)
        scenario = study.scenario_with(base | drawn)
        driver = Driver(setup_of(scenario))
        reflectance = driver.reflectance(lai[None])
        found = driver.toa(reflectance) if level == "toa" else reflectance
        chosen = [[band.name for band in driver.bands].index(name) for name in bands]
        light[(slice(None), *place)] = found[chosen, 0].T
        kinds = {"fpar": "all", "green_fpar": "green"}
        values[(slice(None), *place)] = np.stack(
            [lai if each == "lai" else driver.fpar(lai, scenario.ground.fpar_inf, kinds[each]) for each in quantities],
            axis=-1,
        )
    return _coefficients(light), _coefficients(values)


def _direction(angles):
    """Keys of the geometry with these zenith angles and this relative azimuth."""
    found = {"sza": angles["sza"], "saa": 0.0, "vza": angles["vza"], "vaa": angles["raa"]}
    return {("geometry", name): float(value) for name, value in found.items()}


def _coefficients(values):
    """Chebyshev coefficients along all axes but the last."""
    for axis in range(values.ndim - 1):
        basis = np.linalg.inv(chebyshev.chebvander(chebyshev.chebpts1(values.shape[axis]), values.shape[axis] - 1))
        values = np.moveaxis(np.tensordot(basis, values, (1, axis)), 0, axis)
    return values


def interpolated(coefficients, axes, states, angles):
    """
    Values of a table and their derivatives with respect to the unknowns.

    Parameters
    ----------
    coefficients : array, shape (nodes of each axis, m)
        Chebyshev coefficients. The first axes are the unknowns, the last axes are angles.
    axes : array, shape (axes, 2)
        Lowest and highest value along each axis.
    states : array, shape (n, k)
    angles : array, shape (n, axes - k)
        Values outside of the axes are moved to their ends.

    Returns
    -------
    values : array, shape (n, m)
    slopes : array, shape (n, m, k)

    Notes
    -----
    Derivatives of the polynomials, which are exact for the table.
    """
    given = np.hstack([states, np.clip(angles, axes[states.shape[1] :, 0], axes[states.shape[1] :, 1])])
    spans = axes[:, 1] - axes[:, 0]
    places = 2 * (given - axes[:, 0]) / spans - 1
    count, unknowns = states.shape
    parts = [coefficients.reshape(1, *coefficients.shape)]
    for axis, (place, nodes) in enumerate(zip(places.T, coefficients.shape[:-1], strict=True)):
        basis = chebyshev.chebvander(place, nodes - 1)
        found = [_contracted(basis, part, nodes) for part in parts]
        if axis < unknowns:
            # The derivative of a basis function is a sum of basis functions of lower degree.
            lower = chebyshev.chebder(np.eye(nodes), axis=0)
            slope = basis[:, :-1] @ lower * (2 / spans[axis])
            found.append(_contracted(slope, parts[0], nodes))
        parts = found
    values, *slopes = (part.reshape(count, -1) for part in parts)
    return values, np.stack(slopes, axis=-1)


def _contracted(basis, part, nodes):
    """Sum over the first axis of a table with weights by pixel, shape (n, rest)."""
    table = part.reshape(len(part), nodes, -1)
    return basis @ table[0] if len(part) == 1 else np.einsum("nk,nkr->nr", basis, table)
