"""Table of the reflectance of uniform ground over its unknown properties, with derivatives."""

from itertools import product

import numpy as np
from numpy.polynomial import chebyshev

from fifesim.chain.driver import Driver
from fifesim.ground.canopy.properties import NUMERIC_PROPERTIES
from fifesim.scenario.simulation import setup_of

DRAWN_STATES = {
    "soil": ("ground", "soil"),
    "moisture": ("ground", "moisture"),
    "brown": ("ground", "brown"),
    "chlorophyll": ("ground", "leaf", "chlorophyll"),
    "log_aot": ("atmosphere", "aot"),
}
"""Unknowns of optimal estimation besides LAI, where the training varies them, and their keys in a scenario."""

DIRECTIONS = ("sza", "vza", "raa")
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
    for name, values in zip(DIRECTIONS, angles.T, strict=True):
        if np.ptp(values) > _CONSTANT:
            found[name] = values.min(), values.max()
    return found


def simulated_tables(study, level, bands, quantities, axes, angles):
    """Chebyshev coefficients of reflectance and quantities, shapes (nodes of each axis, bands or quantities)."""
    nodes = {name: _nodes(_NODES[name], *ends) for name, ends in axes.items()}
    shape = tuple(map(len, nodes.values()))
    light, values = np.empty((*shape, len(bands))), np.empty((*shape, len(quantities)))
    base = {key.path: drawn.usual for key, drawn in study.drawn.items() if key.path[0] not in ("landscape", "sensor")}
    base |= {("landscape",): {}} | _direction(dict(zip(DIRECTIONS, angles, strict=True)))
    lai, *others = nodes.values()
    names, places = list(axes)[1:], product(*map(range, shape[1:]))
    for place, node in zip(places, product(*others), strict=True):
        own = dict(zip(names, map(float, node), strict=True))
        drawn = {DRAWN_STATES[name]: value for name, value in own.items() if name in DRAWN_STATES}
        if "log_aot" in own:
            drawn |= {("atmosphere", "aot"): float(np.exp(own["log_aot"])), ("atmosphere", "visibility"): None}
        if set(own) & set(DIRECTIONS):
            drawn |= _direction(dict(zip(DIRECTIONS, angles, strict=True)) | own)
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


def _nodes(count, low, high):
    """Chebyshev nodes of an interval."""
    return low + 0.5 * (high - low) * (1 + chebyshev.chebpts1(count))


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
        Chebyshev coefficients. The first axes are the unknowns, the others are angles.
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
    Derivatives are those of the polynomials. They are exact for the table.
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
            # The derivative of a basis function is a sum of those of lower degree.
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
