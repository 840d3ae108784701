"""
Moments of pixels over a Gaussian field mapped to leaf area, without simulation.

Cells have properties f(z) of a standard normal field z with correlation rho. In Hermite polynomials,
f(z) = sum_k a_k He_k(z) / sqrt(k!), so that the covariance of two properties at a lag is sum_k a_k b_k rho^k.
Pixels are weighted means of cells. Their covariance is the mean over all frequencies of the spectrum times both
transfer functions.

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


# Compared by identity, because pixels share footprints.
@dataclass(frozen=True, eq=False)
class Footprint:
    """Weights of rows and columns of cells in a pixel, each with sum 1, and the position of the first ones. [cell]"""

    rows: np.ndarray
    columns: np.ndarray
    first: tuple[float, float] = (0.0, 0.0)


class Pixel(NamedTuple):
    """Quantity of a pixel: a function of the means of properties of its cells over their footprints."""

    names: tuple[str, ...]
    footprints: tuple[Footprint, ...]
    function: Callable[[np.ndarray], np.ndarray]
    """Function of an array of means, shape (property, ...)."""
    noise: Callable[[np.ndarray], np.ndarray] | None = None
    """Variance of the noise of the quantity, a function of the same means."""


def mean_of_cells(means):
    """Quantity of a pixel that is the mean of its only property."""
    return means[0]


class PixelLine(NamedTuple):
    """Regression of a truth on an image: scatter 1 - R2, slope, residual standard deviation, and moments of pixels."""

    scatter: float
    slope: float
    rmse: float
    truth_variance: float
    image_variance: float
    covariance: float
    truth_mean: float
    image_mean: float


@dataclass(frozen=True, eq=False)
class Prepared:
    """Spectra of the powers of a field's correlation, and Hermite coefficients of properties of its cells."""

    powers: np.ndarray
    """Spectra of rho^k on a periodic lattice divided by its size, shape (order from 1, n, n // 2 + 1)."""
    properties: dict[str, np.ndarray]
    """Coefficients by name, shape (order from 0,). The covariance at lag d is sum_k a_k b_k rho(d)^k."""
    window: np.ndarray | float = 0.0
    """Variance of the mean of fields of correlation rho^k over the window of a regression, shape (order from 1,)."""
    known: dict = field(default_factory=dict, repr=False)
    """Transfer functions and overlaps of footprints."""

    def regression(self, truth, image):
        """Regression of a truth on an image; the truth has no noise."""
        means, values, rest = self.given(image.footprints[0], (truth, image))
        (truth_mean, image_mean), ((of_truth, both), (_, of_image)) = moments(values, rest)
        if image.noise is not None:
            of_image = of_image + np.sum(image.noise(means[1]) * NODE_SHARES)
        left = of_truth - both**2 / of_image
        return PixelLine(
            left / of_truth, both / of_image, np.sqrt(left), of_truth, of_image, both, truth_mean, image_mean
        )

    def given(self, first, pixels):
        """Properties and quantities of pixels given the mean of z over a footprint, and covariances of the rest."""
        # A list of means by pixel, shape (property, node); quantities, shape (pixel, node); and the covariances of the
        # remainders of quantities along their tangents, shape (pixel, pixel, node).
        names = [name for pixel in pixels for name in pixel.names]
        footprints = [each for pixel in pixels for each in pixel.footprints]
        a = np.array([self.properties[name] for name in names])
        given = a[:, 1:] * [self.overlap(first, each)[1] for each in footprints]
        overlaps = np.array([[self.overlap(one, other)[0] for other in footprints] for one in footprints])
        rest = np.einsum("ik,jk,ijk->ij", a[:, 1:], a[:, 1:], overlaps - self.window) - given @ given.T
        means = a[:, :1] + given @ _POLYNOMIALS[1:]
        steps = np.sqrt(np.maximum(np.diag(rest), 0.0)) / 3 + 1e-4 * np.abs(means).max(axis=1)
        ends = np.cumsum([0, *(len(pixel.names) for pixel in pixels)])
        tangents, parts = np.zeros((len(pixels), *means.shape)), []
        for number, pixel in enumerate(pixels):
            own = slice(ends[number], ends[number + 1])
            tangents[number, own] = tangents_of(pixel.function, means[own], steps[own])
            parts.append(means[own])
        values = np.array([pixel.function(part) for pixel, part in zip(pixels, parts, strict=True)])
        return parts, values, np.einsum("piz,qjz,ij->pqz", tangents, tangents, rest)

    def overlap(self, one, other):
        """Covariances of footprints over fields of correlation rho^k, shape (2, order from 1)."""
        # First the covariance of both means; then, over the cells of the second footprint, the mean of the powers of
        # their correlation with the mean of z over the first.
        if (one, other) not in self.known:
            n = self.powers.shape[1]
            shared = self._transfer(one) * self._transfer(other).conj()
            weighted = shared.real.copy()
            weighted[:, 1 : (n + 1) // 2] *= 2
            covariance = self.powers.reshape(len(self.powers), -1) @ weighted.reshape(-1)
            # Cells of the second footprint at whole positions from its first one.
            seen = self._transfer(one) * self._shift(other.first).conj() * self.powers[0]
            near = fft.irfft2(seen, (n, n))[: len(other.rows), : len(other.columns)] * n**2
            near /= np.sqrt((self._power(one) * self.powers[0]).sum())
            area, powers = np.multiply.outer(other.rows, other.columns), np.ones_like(near)
            given = [(area * (powers := powers * near)).sum() for _ in range(ORDERS)]
            self.known[one, other] = np.array([covariance, given])
        return self.known[one, other]

    def _power(self, footprint):
        n = self.powers.shape[1]
        power = np.abs(self._transfer(footprint)) ** 2
        power[:, 1 : (n + 1) // 2] *= 2
        return power

    def _transfer(self, footprint):
        """Transfer function of a footprint, shape (n, n // 2 + 1)."""
        if footprint not in self.known:
            n = self.powers.shape[1]
            widest = max(footprint.rows.size, footprint.columns.size)
            if widest > n // 2:
                raise ValueError(
                    f"a footprint has {widest} cells, at most {n // 2} are allowed: prepare a wider lattice"
                )
            of_weights = fft.fft(footprint.rows, n)[:, None] * fft.rfft(footprint.columns, n)
            self.known[footprint] = of_weights * self._shift(footprint.first)
        return self.known[footprint]

    def _shift(self, first):
        """Phase of a displacement of rows and columns. [cell]"""
        n = self.powers.shape[1]
        frequencies = fft.fftfreq(n), fft.rfftfreq(n)
        down, across = (np.exp(-2j * np.pi * each * place) for each, place in zip(frequencies, first, strict=True))
        return down[:, None] * across


def prepare(arp, properties, *, window=None, widest=96):
    """Field of an arp, and properties of its cells by name, each an array of values at the `DEVIATES`."""
    # Regressions are of pixels in a window of rows and columns [cell], whose mean they remove; by default unlimited.
    n = fft.next_fast_len(max(192, 2 * widest, margin(arp)), real=True)
    u = 2 * np.pi * fft.fftfreq(n)
    spectrum = response(arp, u[:, None], u[: n // 2 + 1]) ** 2
    rho = fft.irfft2(spectrum, (n, n))
    rho /= rho[0, 0]
    powers, power = np.empty((ORDERS, n, n // 2 + 1)), np.ones_like(rho)
    for k in range(ORDERS):
        power = power * rho
        powers[k] = fft.rfft2(power).real / n**2
    lost = 0.0 if window is None else _of_mean(rho, window)
    return Prepared(powers, {name: coefficients(each) for name, each in properties.items()}, lost)


def _of_mean(rho, window):
    """Variance of the mean over a window of fields of correlation rho^k, shape (order from 1,)."""
    lags = np.abs(fft.fftfreq(len(rho), 1 / len(rho)))
    down, across = (np.maximum(1 - lags / cells, 0) / cells for cells in window)
    return np.array([down @ rho**k @ across for k in range(1, ORDERS + 1)])


def coefficients(values):
    """Coefficients of a function of a deviate for He_k / sqrt(k!) from its values at the `DEVIATES`."""
    # Trapezoidal rule, because a quantile function may have kinks.
    weights = np.exp(-(DEVIATES**2) / 2) / np.sqrt(2 * np.pi) * (DEVIATES[1] - DEVIATES[0])
    return polynomials(DEVIATES) @ (weights * values)


def polynomials(z, orders=ORDERS):
    """He_k(z) / sqrt(k!), shape (orders + 1, z)."""
    found = [np.ones_like(z), z]
    for k in range(1, orders):
        found.append((z * found[-1] - np.sqrt(k) * found[-2]) / np.sqrt(k + 1))
    return np.array(found)


def moments(values, rest):
    """Mean and covariance of quantities from their values and the covariances of remainders at the nodes."""
    mean = values @ NODE_SHARES
    apart = values - mean[:, None]
    return mean, (apart * NODE_SHARES) @ apart.T + rest @ NODE_SHARES


# Nodes and weights over the mean of a footprint.
FIELD_NODES = np.linspace(-5.0, 5.0, _PIXEL_NODES)
NODE_SHARES = np.exp(-(FIELD_NODES**2) / 2)
NODE_SHARES = NODE_SHARES / NODE_SHARES.sum()
_POLYNOMIALS = polynomials(FIELD_NODES)


def tangents_of(function, means, steps):
    """Derivatives of a function of means over steps of them, shape as the means."""
    found = np.empty_like(means)
    for number, step in enumerate(np.diag(steps)[..., None]):
        found[number] = (function(means + step) - function(means - step)) / (2 * steps[number])
    return found
