"""
Line spread functions: the response of a pixel to a line on the ground, along one axis.

A line spread function (lsf) is any object with ``half_width`` [m], outside of which it is zero, and
``cumulative(x)``, its integral from there up to the distance x [m] from the pixel centre, 0 to 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np

from fifesim.base.annotations import Numbers
from fifesim.base.arguments import Kind


class Transfer:
    """Transfer function of a part of an instrument; subclasses give the formula, ``_mtf(frequency)``."""

    _mtf: Callable

    def mtf(self, frequency: Numbers) -> np.ndarray:
        """Modulation transfer function at spatial frequencies [cycles m-1], negative where contrast is reversed. [1]"""
        return self._mtf(np.asarray(frequency, float))


class LineSpread(Transfer):
    """Line spread function by the distance from the pixel centre."""

    # Subclasses give `half_width`, beyond which it is zero [m], and the formulas `_cumulative(x)` and
    # `_mtf(frequency)`.

    half_width: float
    _cumulative: Callable

    def cumulative(self, x: Numbers) -> np.ndarray:
        """Share of the response before a distance [m] from the pixel centre. [1]"""
        return self._cumulative(np.asarray(x, float))

    @staticmethod
    def _check_width(width):
        if not 0 < width < np.inf:
            raise ValueError(f"the width of a line spread function must be positive metres, got {width}")


# Any object with the two members of a line spread function.
Spread: TypeAlias = Annotated[
    LineSpread,
    Kind(
        "a line spread function, such as fifesim.instrument('TM').line_spread",
        lambda value: hasattr(value, "half_width"),
    ),
]


@dataclass(frozen=True)
class FiniteSpread(LineSpread):
    """
    Line spread function that ends at half of its width on either side.

    Parameters
    ----------
    width : float
        Width W of the support. [m]

    Raises
    ------
    ValueError
        If the width is not positive.
    """

    width: float

    def __post_init__(self):
        self._check_width(self.width)

    @property
    def half_width(self):
        """Half of the width. [m]"""
        return self.width / 2


@dataclass(frozen=True)
class Boxcar(FiniteSpread):
    r"""
    Uniform line spread function of width W, whose footprint mean is the true areal mean.

    .. math:: C(x) = \frac{1}{2} + \frac{x}{W}, \quad |x| \le \frac{W}{2}; \qquad
        M(f) = \mathrm{sinc}(f W), \quad \mathrm{sinc}\,t = \frac{\sin \pi t}{\pi t}

    Examples
    --------
    >>> float(Boxcar(30.0).cumulative(-7.5))
    0.25
    """

    def _cumulative(self, x):
        return np.clip(0.5 + x / self.width, 0.0, 1.0)

    def _mtf(self, frequency):
        return np.sinc(frequency * self.width)
