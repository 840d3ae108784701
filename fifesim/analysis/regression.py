"""Linear regression from sums, and the relative equivalent noise of variables inferred by it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy import stats

from fifesim.base.arguments import Level, Method, Numbers, check, kind_of
from fifesim.base.arrays import compiled
from fifesim.base.messages import html_table


@dataclass(frozen=True)
class Regression:
    """
    Least-squares line y = intercept + slope x, with its errors and intervals.

    Attributes
    ----------
    slope, intercept : float
        Slope and intercept of the line.
    r2 : float
        Fraction of the variance of y explained by the line. [1]
    n : int
        Number of pairs.
    residual_deviation : float
        Standard deviation of y about the line, with n - 2 degrees of freedom.
    x_mean, x_sum_of_squares : float
        Mean of x, and the sum of its squared deviations.
    y_name, x_name : str
        CF standard names of y and x; empty if unknown.

    Examples
    --------
    >>> from fifesim import Regression
    >>> line = {"slope": 4.0, "intercept": -0.7, "r2": 0.9, "n": 100, "residual_deviation": 0.1}
    >>> fit = Regression(**line, x_mean=0.5, x_sum_of_squares=0.8)
    >>> fit.predict(0.5)
    1.3
    >>> low, high = fit.prediction_interval(0.5)
    >>> round(float(low), 2), round(float(high), 2)
    (1.1, 1.5)
    """

    slope: float
    intercept: float
    r2: float
    n: int
    residual_deviation: float
    x_mean: float
    x_sum_of_squares: float
    y_name: str = ""
    x_name: str = ""
    _in_words: ClassVar[str] = "a fifesim.Regression, as fifesim.regress gives it"

    plot = Method("plot_fit")

    def __repr__(self):
        sign = "+" if self.slope >= 0 else "-"
        return (
            f"Regression: y = {self.intercept:.6g} {sign} {abs(self.slope):.6g} x, R2 {self.r2:.4f}, n {self.n}\n"
            f"  standard errors: slope {self.slope_error:.3g}, intercept {self.intercept_error:.3g}; "
            f"y about the line {self.residual_deviation:.4g}"
        )

    def _repr_html_(self):
        rows = [
            ("slope", f"{self.slope:.6g} ± {self.slope_error:.3g}", f"of {self.y_name or 'y'} on {self.x_name or 'x'}"),
            ("intercept", f"{self.intercept:.6g} ± {self.intercept_error:.3g}", "with standard error, as the slope"),
            ("r2", f"{self.r2:.4f}", "fraction of the variance explained by the line"),
            ("n", self.n, "number of pairs"),
            ("residual_deviation", f"{self.residual_deviation:.4g}", "standard deviation about the line"),
        ]
        return html_table("Regression", rows)

    @property
    def slope_error(self) -> float:
        """Standard error of the slope."""
        return self.residual_deviation / math.sqrt(self.x_sum_of_squares)

    @property
    def intercept_error(self) -> float:
        """Standard error of the intercept."""
        return self.residual_deviation * math.sqrt(1.0 / self.n + self.x_mean**2 / self.x_sum_of_squares)

    def predict(self, x: Numbers) -> np.ndarray:
        """
        Value of the line.

        Parameters
        ----------
        x : float, sequence of float or array

        Returns
        -------
        y : float or array, shape of x
            Not limited to the physical range of y.

        Examples
        --------
        >>> line = Regression(2.0, 1.0, 0.9, 10, 0.1, x_mean=0.5, x_sum_of_squares=1.0)
        >>> line.predict([0.25, 0.5]).tolist()
        [1.5, 2.0]
        """
        return self.intercept + self.slope * (np.asarray(x, float) if isinstance(x, list | tuple) else x)  # type: ignore[operator, return-value]

    def extrapolates(self, x: Numbers) -> np.ndarray:
        """
        Whether x lies far from the data that the line was fitted to.

        Parameters
        ----------
        x : array

        Returns
        -------
        far : array of bool, shape of x
            True where x is more than 3 standard deviations of the fitted x from their mean; False where x is NaN.

        Examples
        --------
        >>> line = Regression(2.0, 1.0, 0.9, 11, 0.1, x_mean=0.5, x_sum_of_squares=0.1)
        >>> line.extrapolates([0.75, 0.85]).tolist()
        [False, True]
        """
        return (np.asarray(x, float) - self.x_mean) ** 2 > 9 * self.x_sum_of_squares / (self.n - 1)

    def confidence_interval(self, x: Numbers, level: Level = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """
        Confidence interval of the mean of y at x.

        Parameters
        ----------
        x : array
        level : float, optional
            Confidence. [1]

        Returns
        -------
        low, high : array, shape of x

        Raises
        ------
        ValueError
            If the level is not between 0 and 1.

        References
        ----------
        [Draper1998]_, Section 3.1
        """
        return self._interval(x, level, 0.0)

    def prediction_interval(self, x: Numbers, level: Level = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """
        Prediction interval of a new y at x.

        Parameters
        ----------
        x : array
        level : float, optional
            Confidence. [1]

        Returns
        -------
        low, high : array, shape of x

        Raises
        ------
        ValueError
            If the level is not between 0 and 1.

        References
        ----------
        [Draper1998]_, Section 3.1
        """
        return self._interval(x, level, 1.0)

    def _interval(self, x, level, own_scatter):
        check("level", level, kind_of(Level))
        x = np.asarray(x, float)
        leverage = own_scatter + 1.0 / self.n + (x - self.x_mean) ** 2 / self.x_sum_of_squares
        half = stats.t.ppf(0.5 + level / 2, self.n - 2) * self.residual_deviation * np.sqrt(leverage)
        return self.predict(x) - half, self.predict(x) + half


def row_sums(y, x, y_origin, x_origin):
    """Sums of 1, x, y, xx, xy and yy over the valid pairs of each row, shape (rows, 6)."""
    sums = np.zeros((y.shape[0], 6))
    _add_pairs(y, x, y_origin, x_origin, sums)
    return sums


@compiled
def _add_pairs(y, x, y_origin, x_origin, sums):
    for i in range(y.shape[0]):
        for j in range(y.shape[1]):
            a, b = x[i, j] - x_origin, y[i, j] - y_origin
            if np.isfinite(a) and np.isfinite(b):
                sums[i, 0] += 1.0
                sums[i, 1] += a
                sums[i, 2] += b
                sums[i, 3] += a * a
                sums[i, 4] += a * b
                sums[i, 5] += b * b


def totals(sums):
    """Exact totals of row sums."""
    sums = np.asarray(sums)
    return sums[0].tolist() if len(sums) == 1 else [math.fsum(column) for column in sums.T]


def fit(sums, y_origin=0.0, x_origin=0.0):
    """Least-squares line from the output of `row_sums`."""
    n, x, y, xx, xy, yy = totals(sums)
    if n < 3:
        raise ValueError(f"a regression needs at least 3 pairs of values, got {n:.0f}: do the rasters overlap?")
    sxx, sxy, syy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    # A smaller variance of x is rounding.
    if not sxx > 1e-12 * xx:
        raise ValueError(f"all {n:.0f} values of x are {x_origin + x / n:g}: a regression needs x to vary")
    slope = sxy / sxx
    residual = max(syy - slope * sxy, 0.0)
    x_mean, y_mean = x_origin + x / n, y_origin + y / n
    r2 = 1.0 - residual / syy if syy > 0 else 0.0
    return Regression(slope, y_mean - slope * x_mean, r2, int(n), math.sqrt(residual / (n - 2)), x_mean, sxx)


NOISE_SUMS = 4


def equivalent_noise(deviation, slope, value):
    r"""
    Relative equivalent noise.

    .. math:: \mathrm{REN} = \frac{\sigma_\mathrm{LAI}}{\mathrm{LAI}}
        = \frac{\sigma_\mathrm{NDVI}}{\mathrm{LAI}} \left[ \frac{d\,\mathrm{NDVI}}{d\,\mathrm{LAI}} \right]^{-1}

    Parameters
    ----------
    deviation : array
        Standard deviation of NDVI at this value of the variable. [1]
    slope : array
        Slope of NDVI with respect to the variable.
    value : array
        Value of the variable.

    Returns
    -------
    ren : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Friedl1995]_, Eq. 7; [Baret1991]_
    """
    return deviation / (slope * value)


@compiled
def increment_sums(variable, ndvi, first, width, increments, ndvi_origin):
    """Sums of 1, variable, NDVI and squared NDVI of each row by increment, shape (rows, 4 increments)."""
    sums = np.zeros((variable.shape[0], 4 * increments))
    for i in range(variable.shape[0]):
        for j in range(variable.shape[1]):
            value, index = variable[i, j], ndvi[i, j] - ndvi_origin
            if not (np.isfinite(value) and np.isfinite(index)):
                continue
            k = int(np.floor(value / width)) - first
            if 0 <= k < increments:
                sums[i, 4 * k] += 1.0
                sums[i, 4 * k + 1] += value
                sums[i, 4 * k + 2] += index
                sums[i, 4 * k + 3] += index * index
    return sums


def increment_moments(sums):
    """Count, mean of the variable and standard deviation of NDVI of each increment."""
    count, value, index, square = np.reshape(totals(sums), (-1, NOISE_SUMS)).T
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = (square - index * index / count) / (count - 1)
        mean = np.where(count > 0, value / count, np.nan)
    return count.astype(int), mean, np.sqrt(np.where(count > 1, np.maximum(variance, 0.0), np.nan))
