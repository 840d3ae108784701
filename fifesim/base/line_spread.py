"""
Line spread functions: the response of a pixel to a line on the ground, along one axis.

A line spread function (lsf) is any object with ``half_width`` [m], outside of which it is zero, and
``cumulative(x)``, its integral from there up to the distance x [m] from the pixel centre, 0 to 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np

from fifesim.base.annotations import Numbers
from fifesim.base.kinds import Kind


class Transfer:
    """
    What a part of an instrument leaves of waves on the ground.

    Each kind of part gives the formula, ``_mtf(frequency)``.
    """

    def mtf(self, frequency: Numbers) -> np.ndarray:
        """
        Modulation transfer function, the Fourier transform of the line spread function.

        Parameters
        ----------
        frequency : array
            Spatial frequency. [cycles m-1]

        Returns
        -------
        mtf : array, shape of frequency
            Factor by which a sinusoid's amplitude is reduced, negative where bright and dark change places. [1]
        """
        return self._mtf(np.asarray(frequency, float))


class LineSpread(Transfer):
    """
    Response of a sensor to a line, by the line's distance from the pixel centre.

    Each shape gives ``half_width``, the distance from the pixel centre beyond which it is zero [m], and two formulas:
    ``_cumulative(x)``, and its transform ``_mtf(frequency)``.
    """

    half_width: float

    def cumulative(self, x: Numbers) -> np.ndarray:
        """
        Share of the response that lies before a distance from the pixel centre.

        Parameters
        ----------
        x : array
            Distance from the pixel centre. [m]

        Returns
        -------
        share : array, shape of x
            0 before the support, 1 behind it. [1]
        """
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
    Line spread function that ends at half of its width to either side.

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
        """Half of the width [m]."""
        return self.width / 2


@dataclass(frozen=True)
class Boxcar(FiniteSpread):
    r"""
    Uniform line spread function of a width W: with it a footprint is an area and its mean the true one.

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
