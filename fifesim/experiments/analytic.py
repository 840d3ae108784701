"""
Moments of pixels over a Gaussian field mapped to leaf area, without simulation.

Cells have properties f(z) of a standard normal field z with correlation rho. In Hermite polynomials,
f(z) = sum_k a_k He_k(z) / sqrt(k!), so that the covariance of two properties at a lag is sum_k a_k b_k rho^k.
Pixels are weighted means of cells: their covariance is the mean over all lags between cells of both.

NDVI is curved. A pixel is divided into its mean given Z, the weighted mean of z over its footprint, and a remainder.
NDVI is evaluated at the first by quadrature, and along its tangent for the second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy import fft

from fifesim.ground.landscape.autoregression import margin, response

# Orders of the Hermite expansion.
ORDERS = 24

DEVIATES = np.linspace(-8.0, 8.0, 4001)
"""Standard normal deviates of cells at which properties are given."""

# Nodes of the quadrature over pixels.
_PIXEL_NODES = 41

# Nodes and weights of the quadrature over the means of windows.
_WINDOW_NODES, _WINDOW_SHARES = np.polynomial.hermite_e.hermegauss(7)
_WINDOW_SHARES = _WINDOW_SHARES / _WINDOW_SHARES.sum()


# Compared by identity, because pixels share footprints.
@dataclass(frozen=True, eq=False)
class Footprint:
    """Weights of rows and columns of cells in a pixel, each with sum 1, and the numbers of the first ones."""

    rows: np.ndarray
    columns: np.ndarray
    first: tuple[int, int] = (0, 0)


def reach_of(footprints):
    """Largest distance between the rows or the columns of cells of footprints. [cell]"""
    firsts = np.array([each.first for each in footprints])
    lasts = firsts + [(each.rows.size - 1, each.columns.size - 1) for each in footprints]
    return int((lasts.max(axis=0) - firsts.min(axis=0)).max())


class Pixel(NamedTuple):
    """Quantity of a pixel: a function of the means of properties of its cells over their footprints."""

    names: tuple[str, ...]
    footprints: tuple[Footprint, ...]
    function: Callable[[np.ndarray], np.ndarray]
    """Function of an array of means, shape (property, ...)."""
    noise: Callable[[np.ndarray], np.ndarray] | None = None
    """Variances of the noise of the quantity, shape (cause, ...), a function of the same means."""


def mean_of_cells(means):
    """Quantity of a pixel that is the mean of its only property."""
    return means[0]


class PixelLine(NamedTuple):
    """Regression of a truth on an image: scatter 1 - R2, slope, and moments of pixels."""

    scatter: float
    slope: float
    truth_variance: float
    image_variance: float
    covariance: float
    noise: np.ndarray
    """Variances of the noise of the image by cause, which the variance of the image includes."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """Powers of a field's correlation, and Hermite coefficients of properties of its cells."""

    powers: np.ndarray
    """rho^k at lags of rows and columns, shape (order from 1, lags, lags)."""
    properties: dict[str, np.ndarray]
    """Coefficients by name, shape (stratum, order from 0). The covariance at lag d is sum_k a_k b_k rho(d)^k."""
    window: np.ndarray = field(default_factory=lambda: np.zeros(ORDERS))
    """Variance of the mean of fields of correlation rho^k over the window of a regression, shape (order from 1,)."""
    strata: np.ndarray = field(default_factory=lambda: np.ones(1))
    """Shares of the strata, which have properties of their own and are larger than pixels."""
    known: dict = field(default_factory=dict, repr=False)
    """Overlaps of footprints, and variances of truths."""

    @property
    def node_shares(self):
        """Shares of the nodes of all strata."""
        return np.multiply.outer(self.strata, NODE_SHARES).ravel()

    def regressions(self, truths, image):
        """Regressions of truths, which have no noise, on an image, as means over windows."""
        first = image.footprints[0]
        means, values, rest = self.given(first, (*truths, image), local=True)
        shares, found = self._shares_by_window(first), []
        covariance = np.array([moments(values, rest, each)[1] for each in shares])
        noise = np.zeros((1, len(shares))) if image.noise is None else np.atleast_2d(image.noise(means[-1])) @ shares.T
        of_image = covariance[:, -1, -1] + noise.sum(axis=0)
        for number, truth in enumerate(truths):
            of_truth, both = self._variances(truth), covariance[:, number, -1]
            left = of_truth - both**2 / of_image
            numbers = left / of_truth, both / of_image, of_truth, of_image, both
            found.append(PixelLine(*(each @ _WINDOW_SHARES for each in numbers), noise @ _WINDOW_SHARES))
        return found

    def _variances(self, truth):
        """Variance of a truth in each window, given the footprint of the truth, which leaves the smallest remainder."""
        key = truth[:3]
        if key not in self.known:
            _, values, rest = self.given(truth.footprints[0], (truth,), local=True)
            shares = self._shares_by_window(truth.footprints[0])
            self.known[key] = np.array([moments(values, rest, each)[1][0, 0] for each in shares])
        return self.known[key]

    def _held(self, first):
        """Share of the variance of the mean of z over a footprint that the mean of a window has."""
        return self.window[0] / self.overlap(first, first)[0, 0]

    def _shares_by_window(self, first):
        """Shares of the nodes in windows, around the mean of each, shape (window, node of all strata)."""
        held = self._held(first)
        near = np.exp(-((FIELD_NODES - np.sqrt(held) * _WINDOW_NODES[:, None]) ** 2) / (2 * (1 - held)))
        shares = self.strata[:, None] * (near / near.sum(axis=1, keepdims=True))[:, None]
        return shares.reshape(len(near), -1)

    def given(self, first, pixels, local=False):
        """Properties and quantities of pixels given the mean of z over a footprint, and covariances of the rest."""
        # A list of means by pixel, shape (property, node); quantities, shape (pixel, node); and the covariances of the
        # remainders of quantities along their tangents, shape (pixel, pixel, node), with the nodes of all strata.
        # Locally, the variance of the means of windows is lost.
        names = [name for pixel in pixels for name in pixel.names]
        footprints = [each for pixel in pixels for each in pixel.footprints]
        a = np.array([self.properties[name] for name in names])
        given = a[..., 1:] * np.array([self.overlap(first, each)[1] for each in footprints])[:, None]
        overlaps = np.array([[self.overlap(one, other)[0] for other in footprints] for one in footprints])
        kept, lost = (1 - self._held(first) ** np.arange(1, ORDERS + 1), self.window) if local else (1.0, 0.0)
        rest = np.einsum("isk,jsk,ijk->ijs", a[..., 1:], a[..., 1:], overlaps - lost)
        rest = np.repeat(rest - np.einsum("isk,jsk->ijs", given * kept, given), FIELD_NODES.size, axis=-1)
        means = (a[..., :1] + given @ _POLYNOMIALS[1:]).reshape(len(a), -1)
        steps = np.sqrt(np.maximum(np.einsum("iiz->iz", rest), 0.0)) / 3 + 1e-4 * np.abs(means).max(1, keepdims=True)
        ends = np.cumsum([0, *(len(pixel.names) for pixel in pixels)])
        tangents, parts = np.zeros((len(pixels), *means.shape)), []
        for number, pixel in enumerate(pixels):
            own = slice(ends[number], ends[number + 1])
            tangents[number, own] = tangents_of(pixel.function, means[own], steps[own])
            parts.append(means[own])
        values = np.array([pixel.function(part) for pixel, part in zip(pixels, parts, strict=True)])
        return parts, values, np.einsum("piz,qjz,ijz->pqz", tangents, tangents, rest)

    def overlap(self, one, other):
        """Covariances of footprints over fields of correlation rho^k, shape (2, order from 1)."""
        # First the covariance of both means; then, over the cells of the second footprint, the mean of the powers of
        # their correlation with the mean of z over the first.
        if (one, other) not in self.known:
            down, across = self._by_lag(one, other, 0), self._by_lag(one, other, 1)
            powers = self.powers[:, : down.shape[1], : across.shape[1]]
            covariance = (other.rows @ down) @ powers @ (other.columns @ across)
            variance = covariance[0] if one is other else self.overlap(one, one)[0, 0]
            near = down @ powers[0] @ across.T / np.sqrt(variance)
            area, power, given = np.multiply.outer(other.rows, other.columns), 1.0, []
            for _ in range(ORDERS):
                power = power * near
                given.append(np.vdot(area, power))
            self.known[one, other] = np.array([covariance, given])
        return self.known[one, other]

    def _by_lag(self, one, other, axis):
        """Weights of a footprint by distance from each cell of another along an axis, shape (cell, lag)."""
        cells = [each.first[axis] + np.arange((each.rows, each.columns)[axis].size) for each in (one, other)]
        apart = np.abs(cells[0] - cells[1][:, None])
        if apart.max() >= self.powers.shape[1]:
            raise ValueError(
                f"footprints have cells at a distance of {apart.max()}, at most {self.powers.shape[1] - 1} is allowed: "
                "prepare a larger reach"
            )
        found = np.zeros((len(apart), apart.max() + 1))
        np.add.at(found, (np.arange(len(apart))[:, None], apart), (one.rows, one.columns)[axis])
        return found


def prepare(rho, properties, *, strata=(1.0,), window=None, reach=96):
    """Field of a correlation, and properties of its cells by name, each an array of values at the `DEVIATES`."""
    # With strata, values have shape (stratum, deviate).
    # The correlation at lags of rows and columns from 0 is zero beyond them. Regressions are of pixels in a window of
    # rows and columns [cell], whose mean they remove; by default unlimited. Cells of two footprints are at most a
    # reach apart. [cell]
    missing = [(0, max(reach + 1 - size, 0)) for size in rho.shape]
    near = np.pad(rho, missing)[: reach + 1, : reach + 1]
    powers = near ** np.arange(1, ORDERS + 1)[:, None, None]
    lost = np.zeros(ORDERS) if window is None else _of_mean(rho, window)
    return Prepared(powers, {name: coefficients(each) for name, each in properties.items()}, lost, np.array(strata))


def correlation_of(arp):
    """Correlation of the field of an arp at lags of rows and columns from 0."""
    n = fft.next_fast_len(max(192, margin(arp)), real=True)
    u = 2 * np.pi * fft.fftfreq(n)
    rho = fft.irfft2(response(arp, u[:, None], u[: n // 2 + 1]) ** 2, (n, n))
    return rho[: n // 2 + 1, : n // 2 + 1] / rho[0, 0]


def _of_mean(rho, window):
    """Variance of the mean over a window of fields of correlation rho^k, shape (order from 1,)."""
    lags = [np.arange(min(cells, size)) for cells, size in zip(window, rho.shape, strict=True)]
    rows, columns = (np.where(lag, 2, 1) * (1 - lag / cells) / cells for lag, cells in zip(lags, window, strict=True))
    inside = rho[: rows.size, : columns.size]
    power, found = np.ones_like(inside), []
    for _ in range(ORDERS):
        power *= inside
        found.append(rows @ power @ columns)
    return np.array(found)


def coefficients(values):
    """Coefficients for He_k / sqrt(k!) of functions of a deviate, shape (stratum, order), from values at `DEVIATES`."""
    # Trapezoidal rule, because a quantile function may have kinks.
    weights = np.exp(-(DEVIATES**2) / 2) / np.sqrt(2 * np.pi) * (DEVIATES[1] - DEVIATES[0])
    return np.atleast_2d(weights * values) @ polynomials(DEVIATES).T


def polynomials(z, orders=ORDERS):
    """He_k(z) / sqrt(k!), shape (orders + 1, z)."""
    found = [np.ones_like(z), z]
    for k in range(1, orders):
        found.append((z * found[-1] - np.sqrt(k) * found[-2]) / np.sqrt(k + 1))
    return np.array(found)


# Nodes and weights over the mean of a footprint.
FIELD_NODES = np.linspace(-5.0, 5.0, _PIXEL_NODES)
NODE_SHARES = np.exp(-(FIELD_NODES**2) / 2)
NODE_SHARES = NODE_SHARES / NODE_SHARES.sum()
_POLYNOMIALS = polynomials(FIELD_NODES)


def moments(values, rest, shares):
    """Mean and covariance of quantities from their values and the covariances of remainders at the nodes."""
    mean = values @ shares
    apart = values - mean[:, None]
    return mean, (apart * shares) @ apart.T + rest @ shares


def tangents_of(function, means, steps):
    """Derivatives of a function of means over steps of them, shape as the means."""
    found = np.empty_like(means)
    for number, step in enumerate(np.eye(len(steps))[..., None] * steps):
        found[number] = (function(means + step) - function(means - step)) / (2 * steps[number])
    return found
