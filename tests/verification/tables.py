"""Tables of independent results, and deviations from them."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import quad

from fifesim.experiments.verification import Deviation as Deviation

FOLDER = Path(__file__).parents[1] / "data" / "verification"


def table(name):
    """Table of a name in ``tests/data/verification``."""
    return pd.read_csv(FOLDER / name, comment="#")


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
