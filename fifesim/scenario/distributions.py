"""Distributions and space-filling sequences for drawing scenario keys."""

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.stats import qmc

from fifesim.base.files import in_a_line, shown
from fifesim.base.messages import nearest


def points(sequence, seed, stream, count, dimensions):
    """Points in the unit cube, shape (count, dimensions), the first of which do not depend on their number."""
    # [Sobol1967] with the scrambling of [Matousek1998], or independent random numbers.
    if not count or not dimensions:
        return np.empty((count, dimensions))
    random = np.random.default_rng((seed, stream))
    if sequence == "random":
        return random.random((count, dimensions))
    with warnings.catch_warnings():
        # The number of chips is chosen by the user, and is rarely a power of two.
        warnings.filterwarnings("ignore", "The balance properties of Sobol")
        return qmc.Sobol(dimensions, scramble=True, seed=random).random(count)


# Description of the values of each distribution, and the second key of its table.
_KINDS = {
    "uniform": "[low, high]",
    "log-uniform": "[low, high], both above 0",
    "normal": "[mean, standard deviation] with within = [low, high]",
    "choice": "a list of values, optionally with weights = [...]",
    "integers": "[first, last], both integers",
}
_BESIDE = {"normal": "within", "choice": "weights"}


@dataclass(frozen=True)
class Distribution:
    """Distribution from which a scenario key is drawn; see `distribution_of`."""

    kind: str
    values: tuple
    within: tuple = ()
    weights: tuple = ()

    def quantile(self, share):
        """Quantiles of the distribution, in the unit of the key, shape (n,)."""
        # Inverse cumulative distribution function, so that evenly spread probabilities give evenly spread draws.
        share = np.asarray(share, float)
        if self.kind == "choice":
            edges = np.cumsum(self.weights or np.ones(len(self.values)))
            at = np.searchsorted(edges[:-1] / edges[-1], share, side="right")
            return [self.values[number] for number in at]
        low, high = self.within or self.values
        if self.kind == "integers":
            return [low + int(step) for step in np.floor(share * (high + 1 - low))]
        if self.kind == "uniform":
            found = low + (high - low) * share
        elif self.kind == "log-uniform":
            found = low * (high / low) ** share
        else:
            mean, deviation = self.values
            found = stats.truncnorm.ppf(share, (low - mean) / deviation, (high - mean) / deviation, mean, deviation)
        # Rounding errors must not exceed the limits.
        return np.clip(found, low, high).tolist()

    @property
    def usual(self):
        """Median, or the first choice."""
        return self.values[0] if self.kind == "choice" else self.quantile([0.5])[0]

    @property
    def extremes(self):
        """Extreme values for checks: both ends, or all choices."""
        return list(self.values) if self.kind == "choice" else list(self.within or self.values)

    @property
    def table(self):
        """TOML table of the distribution."""
        beside = {name: list(found) for name in _BESIDE.values() if (found := getattr(self, name))}
        return {self.kind: list(self.values)} | beside


def distribution_of(table, convert=None):
    """Distribution described by a TOML table."""
    if not isinstance(table, Mapping):
        raise ValueError(f"a distribution is a table such as {{ uniform = [5, 45] }}, got {shown(table)}")
    kinds = [name for name in table if name in _KINDS]
    if len(kinds) != 1:
        given = ", ".join(map(str, table)) or "nothing"
        hint = nearest(given, list(_KINDS)) if len(table) == 1 else ""
        raise ValueError(
            in_a_line(f"needs one of {', '.join(_KINDS)}, got {given}: {hint}such as {{ uniform = [5, 45] }}")
        )
    (kind,) = kinds
    beside = _BESIDE.get(kind)
    for name in table:
        if name not in (kind, beside):
            raise ValueError(f"{name} = {shown(table[name])} is not a parameter of {kind}, which takes {_KINDS[kind]}")
    values = _listed(kind, table[kind], convert)
    if kind == "choice":
        return Distribution(kind, values, weights=_weights(values, table.get("weights")))
    if kind == "normal":
        if beside not in table:
            raise ValueError(f"normal = {shown(table[kind])} needs its limits: add within = [low, high]")
        within = _range(kind, _listed("within", table["within"], convert))
        if not values[1] > 0:
            raise ValueError(
                f"normal = {shown(table[kind])}: the second number, the standard deviation, must be above 0"
            )
        return Distribution(kind, values, within=within)
    return Distribution(kind, _range(kind, values))


def _listed(name, values, convert):
    """Values of a list: two numbers, or any number of choices."""
    is_list = isinstance(values, list | tuple | np.ndarray) and len(values) > 0
    found = tuple(map(convert, values) if convert else values) if is_list else ()
    if not found or (name != "choice" and not (len(found) == 2 and all(map(_is_number, found)))):
        raise ValueError(f"{name} = {shown(values)} must be {_KINDS.get(name, '[low, high]')}")
    return found if name in ("choice", "integers") else tuple(map(float, found))


def _range(kind, values):
    low, high = values
    if not low < high:
        raise ValueError(f"{kind}: the first number must be below the second, got {low:g} and {high:g}")
    if kind == "log-uniform" and low <= 0:
        raise ValueError(f"log-uniform: both numbers must be above 0, got {low:g}: use uniform")
    if kind == "integers" and not all(isinstance(value, int) for value in values):
        raise ValueError(f"integers must be [first, last], both integers, got {low:g} and {high:g}")
    return low, high


def _weights(values, weights):
    if weights is None:
        return ()
    fits = isinstance(weights, list | tuple) and all(_is_number(each) and each >= 0 for each in weights)
    if not fits or len(weights) != len(values) or not sum(weights) > 0:
        raise ValueError(f"weights must be {len(values)} numbers, one per choice, got {shown(weights)}")
    return tuple(map(float, weights))


def _is_number(value):
    return isinstance(value, int | float | np.number) and not isinstance(value, bool) and math.isfinite(value)
