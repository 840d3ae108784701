"""
Downscaling of maps of leaf area: cells within pixels by block kriging of the autoregressive process.

A field x of cells is a trend plus the process. Its means over pixels, :math:`B x`, are known to be m. The best linear
estimate of the cells is :math:`K m` with :math:`K = C B^T (B C B^T)^{-1}`, and any field z with the same covariance is
conditioned on these means as :math:`z + K (m - B z)`. Pixels are whole numbers of cells, so that K is a filter, which a
Fourier transform applies exactly.

A field of pixel means y is K y + r, and its residuals r are independent of y. Where the means m of a function g(x) are
known, and g is not linear, m also contains information on r: the density of r is the density without m times a weight
w. Here residuals that were drawn without m are shifted so that they have this density, to second order in the curvature
of g.

The field of cells is conditioned on levels of the pixels by block kriging, and mapped to leaf area. Levels are solved
so that means over pixels are those in the map. Pixels with a remaining deviation are shifted separately, and a last
factor, usually 0.999 to 1.001, makes the means exact.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import fft, ndimage

from fifesim.base.caches import cached
from fifesim.ground.landscape.autoregression import field_variance, pair_correlations, periodic_field, response
from fifesim.ground.landscape.distribution import quantile_map, quantile_table
from fifesim.ground.landscape.learned import spline_correlation

# Offset of the squared frequency, so that the spectral density of the trend is finite at zero. [radian2 per pixel2]
_SLOWEST = 1e-5


class SplineFields(NamedTuple):
    """Fields of the cells of a learned landscape: sums of cubic splines with random coefficients on lattices."""

    spacings: tuple[float, ...]  # [cell]
    shares: tuple[float, ...]  # of the variance [1]

    def density(self, u, v):
        """Spectral density at angular frequencies of rows and columns, shape (u, v), for a variance of one. [1]"""
        total = np.zeros((u.size, v.size))
        for spacing, share in zip(self.spacings, self.shares, strict=True):
            lags = np.arange(1, int(np.ceil(4 * spacing)))
            weights = 2.0 * spline_correlation(lags / spacing)
            down, across = (1.0 + np.cos(each[:, None] * lags) @ weights for each in (u, v))
            total += share * down[:, None] * across
        return total


def kriging_block_means(cells, ratio):
    """Means of cells over pixels of whole cells, shape (rows, columns)."""
    down, across = ratio
    # Strides are several times faster than a mean over two axes of a few cells each.
    rows = sum(cells[i::down] for i in range(1, down)) + cells[::down]
    return (sum(rows[:, j::across] for j in range(1, across)) + rows[:, ::across]) / (down * across)


def by_pixel(pixels, ratio):
    """Values of pixels repeated on their cells."""
    return np.repeat(np.repeat(pixels, ratio[0], axis=0), ratio[1], axis=1)


def kriging_filter(arp, trend, ratio, shape):
    r"""
    Frequency response of block kriging, from pixels to cells.

    .. math::

        K(f) = \frac{S(f) \, \overline{b(f)}}{\frac{1}{n} \sum_{f'} S(f') |b(f')|^2}, \quad
        S(f) = \frac{H^2(f)}{\sigma^2} + n \frac{\tau^2}{|\omega|^4}

    with H the response of the process, :math:`\sigma^2` its variance, b the response of the mean over the n cells of a
    pixel, and the sum over the frequencies of cells that are one of pixels. The trend's density, where :math:`\omega`
    is the frequency per pixel, makes K reproduce what changes linearly.

    Parameters
    ----------
    arp : float or SplineFields
        Autoregressive parameter of the cells [1], or the fields that they have instead.
    trend : float
        Root of the trend's density at one radian a pixel, over the deviation of the process, :math:`\tau`: from
        `fifesim.ground.landscape.downscaling.map_trend`. Infinite where the trend alone is interpolated. [1]
    ratio : (int, int)
        Cells in a pixel, down and across.
    shape : (int, int)
        Pixels, down and across, of a periodic lattice.

    Returns
    -------
    response : array of complex64, shape (rows * ratio[0], columns * ratio[1] // 2 + 1)
        Half plane of a real transform of the cells.

    References
    ----------
    [Kyriakidis2004]_ for estimates of points from areas; [KyriakidisYoo2005]_ for the simulation
    """
    process, slow, mean = spectral_densities(arp, ratio, shape)
    density = slow if np.isinf(trend) else process + trend**2 * slow
    seen = of_means(density, mean, ratio)
    half = mean.shape[1] // 2 + 1
    columns = np.arange(half) % shape[1]
    estimated = density[:, :half] * np.conj(mean[:, :half]) / np.tile(seen, (ratio[0], 1))[:, columns]
    return estimated.astype(np.complex64)


def spectral_densities(arp, ratio, shape):
    """Spectral densities of process and trend on the cells, and the complex response of means over pixels. [1]"""
    u, v = (2.0 * np.pi * fft.fftfreq(size * number) for size, number in zip(shape, ratio, strict=True))
    return _densities(arp, ratio, u, v)


def _densities(arp, ratio, u, v):
    """Spectral densities and response of `spectral_densities` at angular frequencies of rows and columns."""
    squared = 2.0 * (1.0 - np.cos(u[:, None])) * ratio[0] ** 2 + 2.0 * (1.0 - np.cos(v)) * ratio[1] ** 2
    trend = ratio[0] * ratio[1] / (squared + _SLOWEST) ** 2
    if isinstance(arp, SplineFields):
        process = arp.density(u, v)
    else:
        process = response(arp, u[:, None], v) ** 2 / field_variance(arp)
    return process, trend, _mean_response(u, ratio[0])[:, None] * _mean_response(v, ratio[1])


def densities_of_means(arp, ratio, shape):
    """Spectral densities of means over pixels of the process and of a trend, shape (rows, columns). [1]"""
    u, v = (2.0 * np.pi * fft.fftfreq(size * number) for size, number in zip(shape, ratio, strict=True))
    process, trend = np.zeros(shape), np.zeros(shape)
    # One group of row frequencies at a time, because an array of all frequencies of the cells would be large.
    for some in u.reshape(ratio[0], shape[0]):
        *both, mean = _densities(arp, ratio, some, v)
        for total, each in zip((process, trend), both, strict=True):
            total += of_means(each, mean, (1, ratio[1])) / ratio[0]
    return process, trend


def of_means(density, mean, ratio):
    """Spectral density of means over pixels, whose mean is their variance, shape (rows, columns). [1]"""
    rows, columns = (size // number for size, number in zip(density.shape, ratio, strict=True))
    seen = (density * np.abs(mean) ** 2).reshape(ratio[0], rows, ratio[1], columns).sum((0, 2))
    return seen / (ratio[0] * ratio[1])


def _mean_response(frequency, number):
    """Response of the mean over some successive cells."""
    return np.exp(1j * frequency[:, None] * np.arange(number)).mean(axis=1)


def kriged(pixels, response, ratio):
    """Cells estimated from pixels by block kriging, in single precision."""
    spectrum = fft.fft2(pixels.astype(np.float32))
    spectrum = spectrum[:, np.arange(response.shape[1]) % pixels.shape[1]]
    # Frequencies of cells that are one of pixels have its value.
    repeated = (response.reshape(ratio[0], *spectrum.shape) * spectrum).reshape(response.shape)
    size = pixels.shape[0] * ratio[0], pixels.shape[1] * ratio[1]
    return fft.irfft2(repeated, s=size, overwrite_x=True)


def weighed(cells, response, ratio):
    """Sums of cells weighted as in the estimate from pixels, the transpose of `kriged`, shape (rows, columns)."""
    spectrum = fft.rfft2(cells)
    spectrum *= np.conj(response)
    # The spectrum of every ratio-th row is the mean over the frequencies that alias to one pixel frequency.
    folded = spectrum.reshape(ratio[0], -1, spectrum.shape[1]).mean(axis=0)
    return fft.irfft2(folded, s=(len(folded), cells.shape[1]))[:, :: ratio[1]]


# Over so many pixels second differences are taken; and the pixels along an axis whose frequencies they are summed over.
_LAGS, _PIXELS = (1, 2, 4, 8), 128

# Median of the square of a standard normal number.
_MEDIAN = 0.454936423119572

# Range of tabulated powers of two; beyond them, only the process or only the trend remains.
_LEAST, _MOST = -4, 6


def map_trend(levels, known, deviation, arp, ratio):
    r"""
    Ratio of the trend of a map to the process, from its second differences.

    .. math:: \tau^2 = \frac{D^2 / s^2 - v_p}{v_t}

    with :math:`D^2` the variance of the second differences of pixels, the mean of those along rows and columns, s the
    deviation of the process, and :math:`v_p` and :math:`v_t` the variances that second differences of means over pixels
    for a process and a trend of one. Among differences over 1, 2, 4 and 8 pixels those are used that show most of a
    trend: a gentle one is known by the wide ones.

    Parameters
    ----------
    levels : array, shape (rows, columns)
        Levels of the pixels.
    known : array of bool, shape (rows, columns)
        Where they are.
    deviation : float or array, shape (rows, columns)
        Standard deviation of the process, in units of levels.
    arp : float or SplineFields
        [1]
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    trend : float
        What `fifesim.ground.landscape.downscaling.kriging_filter` takes, as a power of two; 0 where pixels vary no
        more than the process, infinite where there is none. [1]

    Notes
    -----
    The variance is from the median of the squares of normal numbers, which is robust against fences and shores. A trend
    that is a factor of 1.4 off changes semivariances by less than 1 %.
    """
    variance = float(np.mean(np.square(np.broadcast_to(deviation, levels.shape)[known])))
    if not variance:
        return np.inf
    found = [0.0]
    for lag, axes in _second_differences(arp, ratio).items():
        squares = [_bends(levels, known, lag, axis) for axis in (0, 1)]
        if all(each.size for each in squares):
            excess = [
                (np.median(each) / _MEDIAN / variance - process) / slow
                for each, (process, slow) in zip(squares, axes, strict=True)
            ]
            found.append(float(np.mean(excess)))
    strength = max(found)
    if strength <= 4.0**_LEAST:
        return 0.0
    power = round(float(np.log2(strength)) / 2)
    return np.inf if power > _MOST else 2.0**power


def _bends(levels, known, lag, axis):
    """Squared second differences of three known pixels in a row or a column."""
    levels, known = np.moveaxis(levels, axis, 0), np.moveaxis(known, axis, 0)
    first, middle, last = slice(None, -2 * lag), slice(lag, -lag), slice(2 * lag, None)
    whole = known[first] & known[middle] & known[last]
    return (levels[first] - 2.0 * levels[middle] + levels[last])[whole] ** 2


@cached(8, "variances of second differences")
def _second_differences(arp, ratio):
    """Variances by lag of second differences of means over pixels along each axis, for a process and a trend of one."""
    process, slow = densities_of_means(arp, ratio, (_PIXELS, _PIXELS))
    frequency = 2.0 * np.pi * np.fft.fftfreq(_PIXELS)
    variances = {}
    for lag in _LAGS:
        bend = (2.0 - 2.0 * np.cos(lag * frequency)) ** 2
        axes = bend[:, None], bend
        variances[lag] = [(float(np.mean(process * each)), float(np.mean(slow * each))) for each in axes]
    return variances


# Second place of the gradient, as a fraction of the shift: (1 - H)^(-1/2) = 1 + H / 2 + 3 / 8 H^2 for quadratic ln w.
_AGAIN = 0.75

# Standard deviation of the weights of the local mean of pixel levels, a quarter of the pixels read around a tile. With
# narrower weights, the process itself would be part of the mean. [pixel]
_SURROUNDINGS = 3.0


class Kriging(NamedTuple):
    """Filters of a window of pixels, for a process of unit variance."""

    response: np.ndarray  # from pixels to cells, of `kriging_filter`
    process: np.ndarray  # spectral density of the cells, on the half plane of a real transform
    precision: np.ndarray  # inverse spectral density of the pixels without their local mean, on such a half plane
    shares: np.ndarray  # shape (down, across): weight of a cell in its estimate from the means over pixels

    @classmethod
    def of(cls, arp, trend, ratio, shape):
        """Filters of a process on a trend, in a window of pixels."""
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
            spectral_densities(arp, ratio, shape)[0][:, : response.shape[1]].astype(np.float32),
            precision[:, : shape[1] // 2 + 1].astype(np.float32),
            kriged(single, response, ratio)[: ratio[0], : ratio[1]],
        )


def residual_shift(own, known, shift, kriging, transform, deviation):
    r"""
    Shift of the residuals to their density given the means of a function of the field.

    .. math::

        \ln w = -\tfrac12 y^\mathsf{T} P y - \ln \left| \frac{\partial m}{\partial y} \right|, \qquad
        r' = r + C \, \nabla_r \ln w

    with y the means of the field for r and m, P the inverse of their covariance, and C the covariance of the cells.

    Parameters
    ----------
    own : array, shape (rows * down, columns * across)
        Field of the process.
    known : array, shape (rows, columns)
        y, for this field and the shift so far.
    shift : array, shape of own, or 0.0
        Previous shift: the gradient is taken at half the residuals of own plus three quarters of this.
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
    For a quadratic ln w, half of the gradient corrects variances, for a linear one all of it: both is the gradient
    at half of the residuals. A second shift, which knows the first, is right in the square of ln w as well. The
    derivative of m is inverted as if it were diagonal.

    The weight follows from a change of variables, from y to m, in the normal density of r and y.

    References
    ----------
    [KyriakidisYoo2005]_ for residuals of straight functions, which need none of this
    """
    variance = float(np.mean(np.square(deviation)))
    if not variance:
        return np.zeros_like(own)
    ratio = kriging.shares.shape
    half = own / 2 + np.float32(_AGAIN) * shift
    steep, bent = transform.slopes(kriged(known - kriging_block_means(half, ratio), kriging.response, ratio) + half)
    mean = kriging_block_means(steep, ratio)
    inverse = by_pixel(np.divide(1.0, mean, out=np.zeros_like(mean), where=mean > 0), ratio)
    steep = (steep * inverse).astype(np.float32)
    bent = (bent * inverse).astype(np.float32) * np.tile(kriging.shares, mean.shape)
    spectrum = fft.rfft2(known) * kriging.precision
    # Where cells hardly vary, residuals have nowhere to go.
    if np.ndim(deviation):
        variance = np.maximum(kriging_block_means(np.square(deviation), ratio), variance / 4)
    pixels = fft.irfft2(spectrum, s=known.shape) / variance + weighed(bent, kriging.response, ratio)
    gradient = by_pixel((pixels / bent[: ratio[0], : ratio[1]].size).astype(np.float32), ratio) * steep - bent
    # The mean over the cells of a pixel is not part of the residual.
    gradient -= by_pixel(kriging_block_means(gradient, ratio), ratio)
    spectrum = fft.rfft2(deviation * gradient)
    spectrum *= kriging.process
    return np.clip(deviation * fft.irfft2(spectrum, s=own.shape, overwrite_x=True), -deviation, deviation)


# Towards the map's means before, between and after the two shifts of residuals. Each step makes what is left of the
# misfit five times smaller or more.
STEPS = (1, 1, 3)

PIXEL_SHIFTS = 8  # of single pixels

_FURTHEST = 8.5  # level of a distribution's ends, in standard deviations

# Of FIFE's three treatments: the standard deviations of their cells, 0.53, 0.34 and 0.57, of which 0.85 stays within
# pixels of 3 x 3 cells at arp 0.15, and the largest of 0.85 times 0.53 / 0.74, 0.34 / 1.41 and 0.57 / 1.18.
FIFE_DEVIATION = 0.4  # [m2 m-2]
FIFE_LARGEST_VARIATION = 0.6


def fife_variation(mean):
    r"""
    Coefficient of variation of cells within pixels of 10 m, for the grass of FIFE.

    .. math:: c = \min(0.4 / \bar l, 0.6)

    Parameters
    ----------
    mean : array
        Mean leaf area of pixels, above 0. [m2 m-2]

    Returns
    -------
    variation : array, shape of mean
        [1]

    Notes
    -----
    The standard deviation does not grow with the mean in the three treatments of ``lai_distributions.csv``.
    """
    return np.minimum(FIFE_DEVIATION / mean, FIFE_LARGEST_VARIATION)


@dataclass(frozen=True, eq=False)
class LogNormal:
    """Log-normal cells, whose logarithm is the field; the level of a pixel is the logarithm of its mean."""

    def cells(self, field):
        """Leaf area of a field. [m2 m-2]"""
        return np.exp(field)

    def slopes(self, field):
        """First and second derivatives of leaf area with respect to the field. [m2 m-2]"""
        lai = np.exp(field)
        return lai, lai

    def level(self, mean):
        """Level of the field in pixels with a mean leaf area."""
        return np.log(mean)

    def check(self, mean):
        """Raise ValueError for impossible means; all positive means are possible."""


@dataclass(frozen=True, eq=False)
class Marginal:
    """
    Cells of a distribution, whose standard normal deviates are the field.

    Means of pixels, and first and second derivatives of leaf area, are tabulated by the level of the field; derivatives
    for a field that is known but for three quarters of the variance within pixels.
    """

    table: np.ndarray
    levels: np.ndarray
    means: np.ndarray
    steep: np.ndarray
    bent: np.ndarray
    cure: str

    @classmethod
    def of(cls, distribution, kept):
        """Marginal of a distribution, with the share of variance that means over pixels keep."""
        cure = "give a distribution= that reaches beyond all of the map, or cv= instead"
        return cls.of_table(quantile_table(distribution), kept, cure)

    @classmethod
    def of_table(cls, table, kept, cure):
        """Marginal of quantiles as from `quantile_table`, and the remedy for means outside of them."""
        levels = np.linspace(-_FURTHEST, _FURTHEST, 1025)
        nodes, weights = np.polynomial.hermite_e.hermegauss(48)
        weights = weights / np.sqrt(2.0 * np.pi)
        around = quantile_map(levels[:, None] + np.sqrt(1.0 - kept) * nodes, table)
        # Halved residuals lack three quarters of their variance. Integrals by parts need no derivative of quantiles.
        lacking = np.sqrt(0.75 * (1.0 - kept))
        near = quantile_map(levels[:, None] + lacking * nodes, table)
        steep, bent = near @ (weights * nodes) / lacking, near @ (weights * (nodes**2 - 1.0)) / lacking**2
        return cls(table, levels, np.maximum.accumulate(around @ weights), steep, bent, cure)

    def cells(self, field):
        """Leaf area of a field. [m2 m-2]"""
        return quantile_map(field, self.table)

    def slopes(self, field):
        """First and second derivatives of leaf area by the field, smoothed over unknown residuals. [m2 m-2]"""
        return quantile_map(field, self.steep), quantile_map(field, self.bent)

    def level(self, mean):
        """Level of the field in pixels with a mean leaf area."""
        return np.interp(mean, self.means, self.levels)

    def check(self, mean):
        """Raise ValueError for means outside of the distribution."""
        lowest, highest = self.table[0], self.table[-1]
        wrong = mean[(mean <= lowest) | (mean >= highest)]
        if wrong.size:
            raise ValueError(
                f"the map has a pixel of mean LAI {wrong[0]:.4g}, which cells of a distribution from "
                f"{round(lowest, 9):.4g} to {highest:.4g} cannot have: {self.cure}"
            )


def downscaled(pixels, field, kriging, transform, deviation):
    """Leaf area of the cells in a window of pixels, with the pixel means of the map. [m2 m-2]"""
    # The filter is periodic, so that some pixels at the rim must be dropped. Pixels that are NaN or 0 stay so, and
    # count as the nearest other pixel in the estimate.
    ratio = tuple(cells // size for cells, size in zip(field.shape, pixels.shape, strict=True))
    vegetated = pixels > 0
    if not vegetated.any():
        return by_pixel(np.where(pixels == 0, 0.0, np.nan), ratio)
    transform.check(pixels[vegetated])
    filled = _nearest(vegetated)
    means = pixels[filled]
    wanted = transform.level(means)
    if np.ndim(deviation):
        deviation = _between(deviation[filled], ratio).astype(np.float32)
    own = field * deviation

    def solved(known, own, steps):
        """Means of the field that give the wanted means of leaf area."""
        means_of_own = kriging_block_means(own, ratio)
        for _ in range(steps):
            got = kriging_block_means(
                transform.cells(kriged(known - means_of_own, kriging.response, ratio) + own), ratio
            )
            known = known + (wanted - transform.level(got))[filled]
        return known

    known, shift = solved(wanted, own, STEPS[0]), np.float32(0.0)
    for steps in STEPS[1:]:
        shift = residual_shift(own, known, shift, kriging, transform, deviation)
        known = solved(known, own + shift, steps)
    own = own + shift
    cells = kriged(known - kriging_block_means(own, ratio), kriging.response, ratio) + own
    lai = _met(cells, wanted, means, vegetated, transform)
    lai *= by_pixel(
        np.where(vegetated, means / kriging_block_means(lai, ratio), np.where(pixels == 0, 0.0, np.nan)), ratio
    )
    return lai


def _met(field, wanted, means, vegetated, transform):
    """Leaf area of a field; pixels with an error of the mean above 0.001 are shifted one by one."""
    lai = transform.cells(field).astype(float)
    (rows, columns), ratio = means.shape, tuple(np.floor_divide(field.shape, means.shape))
    off = np.nonzero(vegetated & (np.abs(kriging_block_means(lai, ratio) - means) > 1e-3 * means))
    if off[0].size:
        apart = rows, ratio[0], columns, ratio[1]
        part = field.reshape(apart)[off[0], :, off[1]].reshape(off[0].size, -1)
        for _ in range(PIXEL_SHIFTS):
            part += (wanted[off] - transform.level(transform.cells(part).mean(axis=1)))[:, None].astype(np.float32)
        lai.reshape(apart)[off[0], :, off[1]] = transform.cells(part).reshape(-1, *ratio)
    return lai


def filled_field(pixels, field):
    """Pixels, NaN where no cell of the field is known, and the field, the mean of its pixel where it is unknown."""
    ratio = tuple(cells // size for cells, size in zip(field.shape, pixels.shape, strict=True))
    known = np.isfinite(field)
    share = kriging_block_means(known, ratio)
    if not share.any():
        return np.full_like(pixels, np.nan), np.zeros_like(field)
    means = kriging_block_means(np.where(known, field, 0.0), ratio) / np.where(share > 0, share, 1.0)
    return np.where(share > 0, pixels, np.nan), np.where(known, field, by_pixel(means[_nearest(share > 0)], ratio))


def without_cells(cells, pixels, unknown):
    """Cells that keep the means of their pixels without the unknown ones, which become NaN."""
    if not unknown.any():
        return cells
    ratio = tuple(size // count for size, count in zip(cells.shape, pixels.shape, strict=True))
    means = kriging_block_means(np.where(unknown, 0.0, cells), ratio)
    wanted = pixels * kriging_block_means(~unknown, ratio)
    factor = np.divide(wanted, means, out=np.ones_like(means), where=means > 0)
    return np.where(unknown, np.nan, cells * by_pixel(factor, ratio))


def _nearest(known):
    """Indices that give each pixel the value of the nearest known one."""
    if known.all():
        return np.s_[:, :]
    return tuple(ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True))


def _between(values, ratio):
    """Bilinear interpolation between the centres of pixels."""
    for axis, number in enumerate(ratio):
        size = values.shape[axis]
        place = np.clip((np.arange(size * number) + 0.5) / number - 0.5, 0, size - 1)
        lower = np.minimum(place.astype(int), max(size - 2, 0))
        share = np.expand_dims(place - lower, 1 - axis)
        upper = np.minimum(lower + 1, size - 1)
        values = np.take(values, lower, axis) * (1.0 - share) + np.take(values, upper, axis) * share
    return values


# Largest standard deviation of the logarithm of cells.
LARGEST_DEVIATION = 2.0

_NODES = 41

# Cells along a side of the sample, and pixels at least.
_SAMPLE, _FEWEST = 504, 8


def kept_variance(arp, ratio):
    r"""
    Share of the variance of cells that the means over pixels keep.

    .. math:: v = \frac{1}{n^2} \sum_{ij} \rho_{ij}

    Parameters
    ----------
    arp : float
        [1]
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    share : float
        [1]
    """
    correlation, weight = pair_correlations(arp, ratio)
    return float(np.sum(weight * correlation))


def pixel_sample(arp, ratio):
    """Standard normal cells of some pixels of the process, a fixed draw of shape (pixels, cells)."""
    # The mean of each pixel is scaled so that their variance is exactly the one of the process.
    size = [max(_SAMPLE // number, _FEWEST) for number in ratio]
    field = periodic_field(0, arp, tuple(count * number for count, number in zip(size, ratio, strict=True)))
    cells = field.reshape(size[0], ratio[0], size[1], ratio[1]).transpose(0, 2, 1, 3).reshape(size[0] * size[1], -1)
    means = cells.mean(axis=1, keepdims=True)
    kept = kept_variance(arp, ratio)
    inside = (cells - means) * np.sqrt((1.0 - kept) / np.mean((cells - means) ** 2)) if cells.shape[1] > 1 else 0.0
    means = means - np.mean(means)
    return means * np.sqrt(kept / np.mean(means**2)) + inside


def deviation_table(arp, ratio):
    r"""
    Coefficients of variation c of log-normal cells within pixels, shape (41,), and deviations s of logarithms. [1]
    :math:`c^2 = \left\langle \frac{\overline{l^2} - \bar l^2}{\bar l^2} \right\rangle, \quad l = e^{s z}`. Both
    increase from 0. They come from `pixel_sample`, with an error of 0.5 %.
    """
    sample = pixel_sample(arp, ratio)
    sample = sample - sample.mean(axis=1, keepdims=True)
    deviations = np.linspace(0.0, LARGEST_DEVIATION, _NODES)
    squared = []
    for deviation in deviations:
        cells = np.exp(deviation * sample)
        squared.append(np.mean(np.mean(cells**2, axis=1) / np.mean(cells, axis=1) ** 2) - 1.0)
    return np.sqrt(np.maximum.accumulate(squared)), deviations


def level_deviations(transform, deviations, arp, ratio):
    r"""
    Deviations of a process whose means over pixels vary as the levels of the means of leaf area, shape (n,).
    :math:`s_l^2 = \mathrm{var}\,g(\bar l) / v` with g the level of a mean by the ``transform``, and v the share of
    `kept_variance`. They exceed the deviations of the field of cells where leaf area is a nonlinear function: variation
    within a pixel changes its mean.
    """
    sample = pixel_sample(arp, ratio)
    found = [np.std(transform.level(transform.cells(each * sample).mean(axis=1))) for each in deviations]
    return np.array(found) / np.sqrt(kept_variance(arp, ratio))
