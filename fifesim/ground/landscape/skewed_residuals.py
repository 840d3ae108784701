r"""
What means of a bent function of a field say of its residuals from block kriging.

A field of pixel means y is K y + r, and its residuals r are independent of y. Where the means m of a function g(x) are
known, and g is no straight line, m says something of r too: the density of r is that without m times a weight w. Here
residuals that were drawn without m are shifted so that they have this density, to second order in the bend of g.
"""

from typing import NamedTuple

import numpy as np
from scipy import fft

from fifesim.ground.landscape.block_kriging import (
    block_means,
    by_pixel,
    densities,
    densities_of_means,
    kriged,
    kriging_filter,
    weighed,
)

# Of the shift before, where the gradient is asked again: (1 - H)^(-1/2) = 1 + H / 2 + 3 / 8 H^2 for a quadratic ln w.
_AGAIN = 0.75

# What the levels of pixels vary about is their mean by weights of this standard deviation, a quarter of the pixels that
# are read around a tile; by narrower weights, the process itself would count as its mean. [pixel]
_SURROUNDINGS = 3.0


class Kriging(NamedTuple):
    """Filters of a window of pixels, for a process of unit variance."""

    response: np.ndarray  # from pixels to cells, of `kriging_filter`
    process: np.ndarray  # spectral density of the cells, on the half plane of a real transform
    precision: np.ndarray  # inverse spectral density of the pixels without their local mean, on such a half plane
    shares: np.ndarray  # shape (down, across): weight that a cell has in its own estimate from the means over pixels

    @classmethod
    def of(cls, arp, trend, ratio, shape):
        """
        Filters of a process on a trend.

        Parameters
        ----------
        arp, trend, ratio, shape
            As in `fifesim.ground.landscape.block_kriging.kriging_filter`.

        Returns
        -------
        kriging : Kriging
        """
        response = kriging_filter(arp, trend, ratio, shape)
        precision = np.zeros(shape)
        if np.isfinite(trend):
            process, slow = densities_of_means(arp, ratio, shape)
            squared = [(2.0 * np.pi * fft.fftfreq(size) * _SURROUNDINGS) ** 2 for size in shape]
            around = np.exp(-0.5 * (squared[0][:, None] + squared[1]))
            precision = (1.0 - around) / (process + trend**2 * slow)
        single = np.zeros(shape)
        single[0, 0] = 1.0 / (ratio[0] * ratio[1])
        return cls(
            response,
            densities(arp, ratio, shape)[0][:, : response.shape[1]].astype(np.float32),
            precision[:, : shape[1] // 2 + 1].astype(np.float32),
            kriged(single, response, ratio)[: ratio[0], : ratio[1]],
        )


def residual_shift(own, known, shift, kriging, transform, deviation):
    r"""
    Shift that gives residuals the density that is left to them by known means of a function of the field.

    .. math::

        \ln w = -\tfrac12 y^\mathsf{T} P y - \ln \left| \frac{\partial m}{\partial y} \right|, \qquad
        r' = r + C \, \nabla_r \ln w

    with y the means of the field that go with r and m, P the inverse of their covariance, and C that of the cells.

    Parameters
    ----------
    own : array, shape (rows * down, columns * across)
        Field of the process.
    known : array, shape (rows, columns)
        y, for this field and the shift so far.
    shift : array, shape of own, or 0.0
        So far: the gradient is taken where the residuals are half of those of own and three quarters of this.
    kriging : Kriging
    transform : object
        Gives the ``slopes(field)`` of the function: its first and second derivatives.
    deviation : float or array, shape of own
        Standard deviation of own.

    Returns
    -------
    shift : array of float32, shape of own
        To be added to own; at most one standard deviation.

    Notes
    -----
    Of a quadratic ln w, half of the gradient makes variances right and of a linear one all of it: both is the gradient
    at half of the residuals. A second shift, which knows the first, is right in the square of ln w as well. The
    derivative of m is inverted as if it were diagonal.

    The weight is that of a change of variables, from y to m, in the normal density of r and y.

    References
    ----------
    [KyriakidisYoo2005]_ for residuals of straight functions, which need none of this
    """
    variance = float(np.mean(np.square(deviation)))
    if not variance:
        return np.zeros_like(own)
    ratio = kriging.shares.shape
    half = own / 2 + np.float32(_AGAIN) * shift
    steep, bent = transform.slopes(kriged(known - block_means(half, ratio), kriging.response, ratio) + half)
    mean = block_means(steep, ratio)
    inverse = by_pixel(np.divide(1.0, mean, out=np.zeros_like(mean), where=mean > 0), ratio)
    steep = (steep * inverse).astype(np.float32)
    bent = (bent * inverse).astype(np.float32) * np.tile(kriging.shares, mean.shape)
    spectrum = fft.rfft2(known) * kriging.precision
    # Where cells hardly vary, residuals have nowhere to go.
    if np.ndim(deviation):
        variance = np.maximum(block_means(np.square(deviation), ratio), variance / 4)
    pixels = fft.irfft2(spectrum, s=known.shape) / variance + weighed(bent, kriging.response, ratio)
    gradient = by_pixel((pixels / bent[: ratio[0], : ratio[1]].size).astype(np.float32), ratio) * steep - bent
    # What all cells of a pixel share is no residual.
    gradient -= by_pixel(block_means(gradient, ratio), ratio)
    spectrum = fft.rfft2(deviation * gradient)
    spectrum *= kriging.process
    return np.clip(deviation * fft.irfft2(spectrum, s=own.shape, overwrite_x=True), -deviation, deviation)
