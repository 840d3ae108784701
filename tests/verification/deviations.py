"""Deviations of results from independent ones."""

from itertools import pairwise

import numpy as np
from scipy.integrate import quad

from fifesim.experiments.verification import Deviation as Deviation


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
