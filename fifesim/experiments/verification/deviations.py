"""Deviations of results from independent ones, and their listing as text."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.integrate import quad


class Deviation(NamedTuple):
    """Largest deviation that one check found, and its bound."""

    area: str  # of the package, one of `areas.AREAS`
    what: str  # was compared
    deviation: float
    bound: float
    unit: str  # of both; "1" for fractions
    source: str  # of the independent result

    @property
    def within(self):
        """Whether the bound holds; NaN does not."""
        return bool(self.deviation <= self.bound)


def largest(found, expected, *, relative=False):
    """Largest absolute difference of two arrays, or relative to `expected`; NaN if either holds NaN."""
    difference = np.abs(np.subtract(found, expected))
    return float(np.max(difference / np.abs(expected) if relative else difference))


def rms_percent(found, expected):
    """Root mean square of the relative difference of two arrays. [%]"""
    return float(100 * np.sqrt(np.mean((np.divide(found, expected) - 1) ** 2)))


def integral(function, kinks):
    """Integral of a function with kinks, which include both ends."""
    return sum(quad(function, low, high, epsabs=1e-10)[0] for low, high in pairwise(kinks))


HEADING = f"{'':13}{'compared':<48}{'largest':>10}{'bound':>10} {'unit':<8}with"

# Stage of Figure 1 of each area, in processing order.
AREA_STAGES = dict.fromkeys(("random field", "canopy", "terrain"), "Ground")
AREA_STAGES |= {"atmosphere": "Atmosphere", "sensor": "Sensor", "analysis": "Analysis"}


def by_stage(deviations):
    """Lines of deviations, below a heading for each stage."""
    stage = None
    for deviation in deviations:
        if AREA_STAGES[deviation.area] != stage:
            stage = AREA_STAGES[deviation.area]
            yield f"\n{stage}"
        yield deviation_line(deviation)


def deviation_line(deviation):
    """Line of text on a deviation."""
    numbers = f"{deviation.deviation:>10.3g}{deviation.bound:>10.3g} {deviation.unit:<8}"
    mark = "" if deviation.within else "  EXCEEDED"
    return f"{deviation.area:<13}{deviation.what:<48}{numbers}{deviation.source}{mark}"


def deviation_summary(deviations):
    """Summary of all deviations, which names those beyond their bounds."""
    exceeded = [f"{each.area}: {each.what}" for each in deviations if not each.within]
    if not exceeded:
        return f"{len(deviations)} checks, all within their bounds"
    return f"{len(deviations)} checks, {len(exceeded)} beyond their bounds: {'; '.join(exceeded)}"
