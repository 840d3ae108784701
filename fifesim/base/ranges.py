"""Ranges of numbers in descriptions: allowed, usual, and other units in which they are often given."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fifesim.base.messages import warn


class Range(NamedTuple):
    """Unit of a quantity, its allowed and its usual values, and factors from other units to its unit."""

    unit: str
    lowest: float
    highest: float
    usual: tuple[float, float] = (-np.inf, np.inf)
    others: Mapping[str, float] = {}
    note: str = ""  # what else the number may have been meant as


def likely_units(name, value, known):
    """Units in which a value is usual, and the note of a range, as the end of a message."""
    low, high = max(known.usual[0], known.lowest), min(known.usual[1], known.highest)
    found = [
        f"if it is in {unit}, type {name}={value * factor:.4g}"
        for unit, factor in known.others.items()
        if low <= value * factor <= high
    ]
    return "; ".join([*filter(None, [known.note]), *found])


def check_number(what, values, known):
    """Raise ValueError for impossible numbers, and warn if their mean is unusual and not 0; NaN in arrays passes."""
    one, values = np.ndim(values) == 0, np.atleast_1d(np.asarray(values, float))
    wrong = (values < known.lowest) | (values > known.highest) | (one & np.isnan(values))
    unit = "" if known.unit == "1" else f" {known.unit}"
    name = what.rpartition(" ")[2]
    if wrong.any():
        value = values[wrong].flat[0]
        hint = likely_units(name, value, known) or "check its unit"
        raise ValueError(f"{what} must be in [{known.lowest:g}, {known.highest:g}]{unit}, got {value:g}: {hint}")
    values = values[np.isfinite(values)]
    mean = float(values.mean()) if values.size else 0.0
    if mean and not known.usual[0] <= mean <= known.usual[1]:
        low, high = max(known.usual[0], known.lowest), min(known.usual[1], known.highest)
        hint = likely_units(name, mean, known) or "check its unit"
        warn(f"{what} is {mean:g}{unit}, and {low:g} to {high:g} is usual: {hint}")
