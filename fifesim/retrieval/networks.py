"""Small feed-forward networks: evaluation, training for quantiles, and ESA's networks for Sentinel-2."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fifesim.base import files
from fifesim.base.caches import cached


class Network(NamedTuple):
    """Weights and biases of a network by layer, shapes (inputs, outputs) and (outputs,)."""

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]


def network(inputs, layers):
    """
    Outputs of a network with hyperbolic tangents in its hidden layers and a linear last layer.

    Parameters
    ----------
    inputs : array, shape (n, inputs)
        Normalised inputs.
    layers : Network

    Returns
    -------
    outputs : array, shape (n, outputs)
    """
    values = inputs
    for weight, bias in zip(layers.weights[:-1], layers.biases[:-1], strict=True):
        values = np.tanh(values @ weight + bias)
    return values @ layers.weights[-1] + layers.biases[-1]


# Pixels of a step of the optimiser, and hidden neurons of both layers.
_BATCH = 256
_HIDDEN = 32

# Exponential memories of the mean and the square of the gradient, as in Kingma and Ba (2015).
_MEAN, _SQUARE, _TINY = 0.9, 0.999, 1e-8


def train_quantiles(inputs, targets, probabilities, seed, epochs=60, rate=5e-3):
    """
    Train a network that gives quantiles of each target.

    The mean pinball loss is minimised with the optimiser Adam and a learning rate that falls to 0 along a cosine.

    Parameters
    ----------
    inputs : array, shape (n, inputs)
        Normalised inputs.
    targets : array, shape (n, targets)
        Normalised targets.
    probabilities : array, shape (p,)
        Probabilities of the quantiles, in (0, 1).
    seed : int
        Seed of the first weights and of the order of the pixels.
    epochs : int, optional
        Passes over the pixels.
    rate : float, optional
        First learning rate.

    Returns
    -------
    layers : Network
        Its outputs are quantiles by target and probability, flattened in this order. They may cross slightly.

    References
    ----------
    [KingmaBa2015]_; quantile regression after [KoenkerBassett1978]_
    """
    rng = np.random.default_rng(seed)
    count, width = targets.shape[1], len(probabilities)
    sizes = (inputs.shape[1], _HIDDEN, _HIDDEN, count * width)
    found = [rng.normal(0, 1 / np.sqrt(a), (a, b)) for a, b in pairwise(sizes)]
    # Quantiles of the targets are a good first guess without any input.
    found[-1] *= 0.1
    first = np.quantile(targets, probabilities, axis=0).T.ravel()
    found += [np.zeros(_HIDDEN), np.zeros(_HIDDEN), first]
    mean, square = [np.zeros_like(each) for each in found], [np.zeros_like(each) for each in found]
    wanted = np.tile(probabilities, count)
    steps = -(-len(inputs) // _BATCH) * epochs
    done = 0
    for _ in range(epochs):
        order = rng.permutation(len(inputs))
        for start in range(0, len(inputs), _BATCH):
            some = order[start : start + _BATCH]
            slopes = _slopes(found, inputs[some], np.repeat(targets[some], width, axis=1), wanted)
            done += 1
            pace = rate * 0.5 * (1 + np.cos(np.pi * done / steps))
            pace *= np.sqrt(1 - _SQUARE**done) / (1 - _MEAN**done)
            for at, slope in enumerate(slopes):
                mean[at] += (1 - _MEAN) * (slope - mean[at])
                square[at] += (1 - _SQUARE) * (slope * slope - square[at])
                found[at] = found[at] - pace * mean[at] / (np.sqrt(square[at]) + _TINY)
    return Network(tuple(found[:3]), tuple(found[3:]))


def _slopes(found, inputs, targets, probabilities):
    """Derivatives of the mean pinball loss with respect to weights and biases."""
    one, two, three, bias_one, bias_two, bias_three = found
    first = np.tanh(inputs @ one + bias_one)
    second = np.tanh(first @ two + bias_two)
    error = targets - (second @ three + bias_three)
    # The loss is p e for positive and (p - 1) e for negative errors.
    back = np.where(error > 0, -probabilities, 1 - probabilities) / len(inputs)
    back_two = (back @ three.T) * (1 - second * second)
    back_one = (back_two @ two.T) * (1 - first * first)
    return [inputs.T @ back_one, first.T @ back_two, second.T @ back, back_one.sum(0), back_two.sum(0), back.sum(0)]


SL2P_BANDS = ("B3", "B4", "B5", "B6", "B7", "B8A", "B11", "B12")
"""Bands of the inputs of SL2P, in order; they are followed by the cosines of view, sun and relative azimuth."""

SL2P_QUANTITIES = ("LAI", "FAPAR", "FCOVER")
"""Quantities of SL2P, as the tables name them."""

_ANGLES = ("cos_vza", "cos_sza", "cos_raa")


class _Sl2p(NamedTuple):
    """Network of a quantity, and ranges for normalisation and domain."""

    layers: Network
    inputs: np.ndarray  # (2, 11)
    output: np.ndarray  # (2,)
    domain: np.ndarray  # (2, 8)
    limits: np.ndarray  # (2,)
    tolerance: float


@cached(1, "networks of SL2P")
def _sl2p_networks():
    weights, ranges = (
        files.table("sl2p/weights.csv"),
        files.table("sl2p/ranges.csv").set_index(["variable", "quantity"]),
    )
    names, found = (*SL2P_BANDS, *_ANGLES), {}
    for variable in SL2P_QUANTITIES:
        own, its = weights[weights.variable == variable], ranges.loc[variable]
        hidden = own[own.layer == "hidden"].pivot(index="input", columns="neuron", values="weight")
        output = own[own.layer == "output"].set_index("input").weight
        neurons = [f"hidden{number}" for number in hidden.columns]
        layers = Network(
            (hidden.loc[list(names)].to_numpy(), output[neurons].to_numpy()[:, None]),
            (hidden.loc["bias"].to_numpy(), output[["bias"]].to_numpy()),
        )
        spans = its.loc[list(names), ["norm_min", "norm_max"]].to_numpy().T
        domain = its.loc[list(SL2P_BANDS), ["domain_min", "domain_max"]].to_numpy().T
        last = its.loc["output"]
        found[variable] = _Sl2p(
            layers,
            spans,
            last[["norm_min", "norm_max"]].to_numpy(float),
            domain,
            last[["domain_min", "domain_max"]].to_numpy(float),
            float(last.tolerance),
        )
    return found


@cached(1, "domain of SL2P")
def _sl2p_cells():
    """Sorted numbers of the cells of the training data of SL2P, whose digits go from 1 to 10."""
    return np.sort(np.array([int(cell, 11) for cell in files.table("sl2p/domain_cells.csv").cell.astype(str)]))


def sl2p(reflectance, cos_vza, cos_sza, cos_raa, quantity):
    """
    LAI, FAPAR or FCOVER from Sentinel-2 surface reflectance, by the networks of ESA's Level-2 prototype processor.

    Parameters
    ----------
    reflectance : array, shape (n, 8)
        Surface reflectance of the bands `SL2P_BANDS`. [1]
    cos_vza, cos_sza, cos_raa : array, shape (n,)
        Cosines of the zenith angles of view and sun, and of the relative azimuth, 1 on the side of the sun.
    quantity : {"LAI", "FAPAR", "FCOVER"}

    Returns
    -------
    value : array, shape (n,)
        Values outside the range of the quantity by less than its tolerance are clipped to it.
    is_outside : array of bool, shape (n,)
        Whether the reflectance is outside of the training data, or the value is outside of its range by more than the
        tolerance.

    References
    ----------
    [WeissBaret2016]_, sections 2 and 3
    """
    own = _sl2p_networks()[quantity]
    inputs = np.column_stack([reflectance, cos_vza, cos_sza, cos_raa])
    low, high = own.inputs
    outputs = network(2 * (inputs - low) / (high - low) - 1, own.layers)[:, 0]
    value = 0.5 * (outputs + 1) * (own.output[1] - own.output[0]) + own.output[0]
    lowest, highest = own.limits
    strays = (value < lowest - own.tolerance) | (value > highest + own.tolerance)
    value = np.where(strays, value, np.clip(value, lowest, highest))
    return value, strays | ~_in_domain(reflectance, own.domain)


def _in_domain(reflectance, domain):
    """Whether the cell of a spectrum is one of the cells of the training data."""
    low, high = domain
    is_inside = ((reflectance >= low) & (reflectance <= high)).all(axis=1)
    share = np.where(is_inside[:, None], (reflectance - low) / (high - low), 0)
    digits = np.minimum(np.floor(10 * share + 1).astype(np.int64), 10)
    cell = digits @ 11 ** np.arange(len(SL2P_BANDS) - 1, -1, -1)
    cells = _sl2p_cells()
    at = np.minimum(np.searchsorted(cells, cell), len(cells) - 1)
    return is_inside & (cells[at] == cell)
