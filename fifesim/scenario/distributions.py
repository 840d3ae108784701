"""Distributions that a key of a scenario is drawn from, as a table of TOML says them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import stats

from fifesim.base.foreign import in_a_line, shown
from fifesim.base.spelling import nearest

# What each kind is given, in words, and what stands beside it.
_KINDS = {
    "uniform": "[low, high]",
    "log-uniform": "[low, high], both above 0",
    "normal": "[mean, standard deviation] with within = [low, high]",
    "choice": "a list of values, perhaps with weights = [...]",
    "integers": "[first, last], whole numbers",
}
_BESIDE = {"normal": "within", "choice": "weights"}


@dataclass(frozen=True)
class Distribution:
    """What a key of a scenario is drawn from; from `distribution_of`."""

    kind: str
    values: tuple
    within: tuple = ()
    weights: tuple = ()

    def quantile(self, share):
        """
        Value below which a share of all draws lies.

        Parameters
        ----------
        share : array, shape (n,)
            In [0, 1). [1]

        Returns
        -------
        values : list of float, int or object
            Numbers in the unit of the key.

        Notes
        -----
        The inverse of the distribution function, so that evenly spaced shares are evenly spaced draws.

        Examples
        --------
        >>> Distribution("log-uniform", (5.0, 45.0)).quantile(np.array([0.0, 0.5]))
        [5.0, 15.0]
        """
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
        # Rounding stays within.
        return np.clip(found, low, high).tolist()

    @property
    def usual(self):
        """The median, or the first choice."""
        return self.values[0] if self.kind == "choice" else self.quantile([0.5])[0]

    @property
    def extremes(self):
        """What may be refused: both ends, or all that there is to choose, a list."""
        return list(self.values) if self.kind == "choice" else list(self.within or self.values)

    @property
    def in_words(self):
        """Kind and numbers as a table of them has it, a str."""
        listed = ", ".join(map(_plain, self.values))
        if self.kind == "normal":
            return f"normal, mean and deviation {listed}, within {_plain(self.within[0])} to {_plain(self.within[1])}"
        if self.kind == "choice":
            weights = f", weights {', '.join(map(_plain, self.weights))}" if self.weights else ""
            return f"one of {listed}{weights}"
        low, high = map(_plain, self.values)
        return f"{self.kind}, {low} to {high}"

    @property
    def table(self):
        """As TOML has it, a dict."""
        beside = {name: list(found) for name in _BESIDE.values() if (found := getattr(self, name))}
        return {self.kind: list(self.values)} | beside


def distribution_of(table, convert=lambda value: value):
    """
    Distribution of a table.

    Parameters
    ----------
    table : mapping
        One of ``{"uniform": [5, 45]}``, ``{"log-uniform": [5, 45]}``, ``{"normal": [0.2, 0.1], "within": [0, 1]}``,
        ``{"choice": ["TM3", "TM4"], "weights": [1, 2]}`` and ``{"integers": [1, 6]}``, of which 6 is one.
    convert : callable, optional
        Makes a value of the key of what the table says, such as 45.0 of "45 km".

    Returns
    -------
    distribution : Distribution

    Raises
    ------
    ValueError
        If it is no distribution.
    """
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
            raise ValueError(f"{name} = {shown(table[name])} does not go with {kind}, which takes {_KINDS[kind]}")
    values = _listed(kind, table[kind], convert)
    if kind == "choice":
        return Distribution(kind, values, weights=_weights(values, table.get("weights")))
    if kind == "normal":
        if beside not in table:
            raise ValueError(f"normal = {shown(table[kind])} needs within = [low, high] beside it, where it is cut off")
        within = _range(kind, _listed("within", table["within"], convert))
        if not values[1] > 0:
            raise ValueError(
                f"normal = {shown(table[kind])}: the second number, the standard deviation, must be above 0"
            )
        return Distribution(kind, values, within=within)
    return Distribution(kind, _range(kind, values))


def _listed(name, values, convert):
    """Values of a list, of which all but choices are two numbers."""
    if not isinstance(values, list | tuple | np.ndarray) or not len(values):
        raise ValueError(f"{name} = {shown(values)} must be {_KINDS.get(name, '[low, high]')}")
    found = tuple(convert(value) for value in values)
    if name == "choice":
        return found
    if len(found) != 2 or not all(_is_number(value) for value in found):
        raise ValueError(f"{name} = {shown(values)} must be {_KINDS.get(name, '[low, high]')}")
    return found if name == "integers" else tuple(map(float, found))


def _range(kind, values):
    low, high = values
    if not low < high:
        raise ValueError(f"{kind}: the first number must be below the second, got {low:g} and {high:g}")
    if kind == "log-uniform" and low <= 0:
        raise ValueError(f"log-uniform: both numbers must be above 0, got {low:g}: use uniform")
    if kind == "integers" and not all(isinstance(value, int) for value in values):
        raise ValueError(f"integers must be [first, last], whole numbers, got {low:g} and {high:g}")
    return low, high


def _weights(values, weights):
    if weights is None:
        return ()
    fits = isinstance(weights, list | tuple) and all(_is_number(each) and each >= 0 for each in weights)
    if not fits or len(weights) != len(values) or not sum(weights) > 0:
        raise ValueError(f"weights must be {len(values)} numbers, one for each choice, got {shown(weights)}")
    return tuple(map(float, weights))


def _is_number(value):
    return isinstance(value, int | float | np.number) and not isinstance(value, bool) and math.isfinite(value)


def _plain(value):
    return f"{value:g}" if _is_number(value) else str(value)
