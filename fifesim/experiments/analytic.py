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

# Orders of the Hermite expansion, nodes of the quadratures over cells and over pixels.
ORDERS, _NODES, _PIXEL_NODES = 24, 4001, 41


class Footprint(NamedTuple):
    """Weights of rows and columns of cells in a pixel, each with sum 1, and the position of the first ones. [cell]"""

    rows: np.ndarray
    columns: np.ndarray
    first: tuple[float, float] = (0.0, 0.0)


class Pixel(NamedTuple):
    """Quantity of a pixel: a function of the means of properties of its cells over their footprints."""

    names: tuple[str, ...]
    footprints: tuple[Footprint, ...]
    function: Callable[..., np.ndarray]
    """Of an array of means, shape (property, ...)."""
    noise: Callable[..., np.ndarray | float] = lambda means: 0.0
    """Variance of the noise of the quantity, a function of the same means."""


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
        """Line of the pixels of a truth on those of an image, without noise in the truth."""
        means, rest = self.split(truth.names + image.names, (*image.footprints, *truth.footprints, *image.footprints))
        split = len(truth.names)
        steps = np.sqrt(np.maximum(np.diag(rest), 0.0)) / 3 + 1e-4 * np.abs(means).max(axis=1)
        values, tangents = [], np.zeros((2, len(means), FIELD_NODES.size))
        for number, (pixel, own) in enumerate(((truth, slice(0, split)), (image, slice(split, None)))):
            values.append(pixel.function(means[own]))
            tangents[number, own] = tangents_of(pixel.function, means[own], steps[own])
        mean = np.array(values) @ NODE_SHARES
        apart = np.array(values) - mean[:, None]
        moments = (apart * NODE_SHARES) @ apart.T + np.einsum("piz,qjz,ij,z->pq", tangents, tangents, rest, NODE_SHARES)
        (of_truth, both), (_, of_image) = moments
        of_image = of_image + np.sum(image.noise(means[split:]) * NODE_SHARES)
        left = of_truth - both**2 / of_image
        return PixelLine(left / of_truth, both / of_image, np.sqrt(left), of_truth, of_image, both, *mean)

    def split(self, names, footprints):
        """Means of properties given the mean of z over the first footprint, and the covariance of their remainders."""
        # Shape (property, node). The last footprints are those of the properties.
        first, footprints = footprints[0], footprints[-len(names) :]
        a = np.array([self.properties[name] for name in names])
        given = a[:, 1:] * [self.overlap(first, each)[1] for each in footprints]
        overlaps = np.array([[self.overlap(one, other)[0] for other in footprints] for one in footprints])
        rest = np.einsum("ik,jk,ijk->ij", a[:, 1:], a[:, 1:], overlaps - self.window) - given @ given.T
        return a[:, :1] + given @ _POLYNOMIALS[1:], rest

    def overlap(self, one, other):
        """Covariances of footprints over fields of correlation rho^k, shape (2, order from 1)."""
        # Of the means of both, and the mean of the powers of the correlation of the cells of the second with the mean
        # of z in the first.
        key = id(one), id(other)
        if key not in self.known:
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
            # Footprints are kept too, so that their ids stay theirs.
            self.known[key] = np.array([covariance, given]), one, other
        return self.known[key][0]

    def _power(self, footprint):
        n = self.powers.shape[1]
        power = np.abs(self._transfer(footprint)) ** 2
        power[:, 1 : (n + 1) // 2] *= 2
        return power

    def _transfer(self, footprint):
        """Transfer function of a footprint, shape (n, n // 2 + 1)."""
        if id(footprint) not in self.known:
            n = self.powers.shape[1]
            widest = max(map(len, footprint[:2]))
            if widest > n // 2:
                raise ValueError(
                    f"a footprint has {widest} cells, at most {n // 2} are allowed: prepare a wider lattice"
                )
            of_weights = fft.fft(footprint.rows, n)[:, None] * fft.rfft(footprint.columns, n)
            self.known[id(footprint)] = of_weights * self._shift(footprint.first), footprint
        return self.known[id(footprint)][0]

    def _shift(self, first):
        """Phase of a displacement of rows and columns. [cell]"""
        n = self.powers.shape[1]
        frequencies = fft.fftfreq(n), fft.rfftfreq(n)
        down, across = (np.exp(-2j * np.pi * each * place) for each, place in zip(frequencies, first, strict=True))
        return down[:, None] * across


def prepare(arp, functions, *, window=None, widest=96):
    """Field of an arp, with functions by name that return properties of cells from its deviates."""
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
    return Prepared(powers, {name: coefficients(each) for name, each in functions.items()}, lost)


def _of_mean(rho, window):
    """Variance of the mean over a window of fields of correlation rho^k, shape (order from 1,)."""
    lags = np.abs(fft.fftfreq(len(rho), 1 / len(rho)))
    down, across = (np.maximum(1 - lags / cells, 0) / cells for cells in window)
    return np.array([down @ rho**k @ across for k in range(1, ORDERS + 1)])


def coefficients(function):
    """Coefficients of a function of a standard normal deviate for He_k / sqrt(k!), shape (ORDERS + 1,)."""
    # Trapezoidal rule, because a quantile function may have kinks.
    z = np.linspace(-8.0, 8.0, _NODES)
    weights = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) * (z[1] - z[0])
    return polynomials(z) @ (weights * function(z))


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


def tangents_of(function, means, steps):
    """Derivatives of a function of means over steps of them, shape as the means."""
    found = np.empty_like(means)
    for number, step in enumerate(np.diag(steps)[..., None]):
        found[number] = (function(means + step) - function(means - step)) / (2 * steps[number])
    return found


def noise_of_ndvi(variance):
    """Noise of NDVI of means of red and near infrared with a variance of each, a function of their means."""

    def noise(means):
        red, nir = means
        of_red, of_nir = np.broadcast_to(variance, 2)
        return 4 * (nir**2 * of_red + red**2 * of_nir) / (nir + red) ** 4

    return noise
