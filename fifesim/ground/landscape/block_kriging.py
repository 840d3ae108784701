r"""
Cells from means over pixels: block kriging of the autoregressive process on a smooth trend.

A field x of cells is a trend plus the process. Its means over pixels, :math:`B x`, are known to be m. The best linear
estimate of the cells is :math:`K m` with :math:`K = C B^T (B C B^T)^{-1}`, and any field z of the same law becomes one
with these means as :math:`z + K (m - B z)`. Pixels are whole numbers of cells, so that K is a filter, which a Fourier
transform applies exactly.
"""

import numpy as np
from scipy import fft

from fifesim.ground.landscape.autoregression import field_variance, response

# Of the squared frequency, so that the trend has a spectral density at zero. [radian2 per pixel2]
_SLOWEST = 1e-5


def block_means(cells, ratio):
    """
    Means of cells over the pixels that hold them.

    Parameters
    ----------
    cells : array, shape (rows * ratio[0], columns * ratio[1])
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    means : array, shape (rows, columns)

    Examples
    --------
    >>> block_means(np.array([[1.0, 3.0, 5.0, 5.0]]), (1, 2)).tolist()
    [[2.0, 5.0]]
    """
    down, across = ratio
    # Strides are several times faster than a mean over two axes of a few cells each.
    rows = sum(cells[i::down] for i in range(1, down)) + cells[::down]
    return (sum(rows[:, j::across] for j in range(1, across)) + rows[:, ::across]) / (down * across)


def by_pixel(pixels, ratio):
    """
    Cells that have the value of their pixel.

    Parameters
    ----------
    pixels : array, shape (rows, columns)
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    cells : array, shape (rows * ratio[0], columns * ratio[1])

    Examples
    --------
    >>> by_pixel(np.array([[1, 2]]), (1, 2)).tolist()
    [[1, 1, 2, 2]]
    """
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
    arp : float
        Of the cells. [1]
    trend : float
        Root of the trend's density at one radian a pixel, over the deviation of the process, :math:`\tau`: from
        `fifesim.ground.landscape.map_trends.map_trend`. Infinite where the trend alone is interpolated. [1]
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
    process, slow, mean = densities(arp, ratio, shape)
    density = slow if np.isinf(trend) else process + trend**2 * slow
    seen = of_means(density, mean, ratio)
    half = mean.shape[1] // 2 + 1
    columns = np.arange(half) % shape[1]
    estimated = density[:, :half] * np.conj(mean[:, :half]) / np.tile(seen, (ratio[0], 1))[:, columns]
    return estimated.astype(np.complex64)


def densities(arp, ratio, shape):
    """
    Spectral densities of the process and of a trend, and the response of means over pixels.

    Parameters
    ----------
    arp, ratio, shape
        As in `kriging_filter`.

    Returns
    -------
    process, trend : array, shape (rows * ratio[0], columns * ratio[1])
        Of unit variance, and of unit density at one radian a pixel. [1]
    mean : array of complex, of this shape
        [1]
    """
    u, v = (2.0 * np.pi * fft.fftfreq(size * number) for size, number in zip(shape, ratio, strict=True))
    return _densities(arp, ratio, u, v)


def _densities(arp, ratio, u, v):
    """At angular frequencies of rows and of columns."""
    squared = 2.0 * (1.0 - np.cos(u[:, None])) * ratio[0] ** 2 + 2.0 * (1.0 - np.cos(v)) * ratio[1] ** 2
    trend = ratio[0] * ratio[1] / (squared + _SLOWEST) ** 2
    process = response(arp, u[:, None], v) ** 2 / field_variance(arp)
    return process, trend, _mean_response(u, ratio[0])[:, None] * _mean_response(v, ratio[1])


def densities_of_means(arp, ratio, shape):
    """
    Spectral densities of the means of the process and of a trend over pixels.

    Parameters
    ----------
    arp, ratio, shape
        As in `kriging_filter`.

    Returns
    -------
    process, trend : array, shape (rows, columns)
        Of those of `densities`. [1]
    """
    u, v = (2.0 * np.pi * fft.fftfreq(size * number) for size, number in zip(shape, ratio, strict=True))
    process, trend = np.zeros(shape), np.zeros(shape)
    # The frequencies of rows that are one of pixels after one another: those of all cells would be large.
    for some in u.reshape(ratio[0], shape[0]):
        *both, mean = _densities(arp, ratio, some, v)
        for total, each in zip((process, trend), both, strict=True):
            total += of_means(each, mean, (1, ratio[1])) / ratio[0]
    return process, trend


def of_means(density, mean, ratio):
    """
    Spectral density of means over pixels.

    Parameters
    ----------
    density, mean : array, shape (rows * ratio[0], columns * ratio[1])
        From `densities`.
    ratio : (int, int)

    Returns
    -------
    density : array, shape (rows, columns)
        Its mean is the variance of the means. [1]
    """
    rows, columns = (size // number for size, number in zip(density.shape, ratio, strict=True))
    seen = (density * np.abs(mean) ** 2).reshape(ratio[0], rows, ratio[1], columns).sum((0, 2))
    return seen / (ratio[0] * ratio[1])


def _mean_response(frequency, number):
    """Response of the mean over some cells from each on."""
    return np.exp(1j * frequency[:, None] * np.arange(number)).mean(axis=1)


def kriged(pixels, response, ratio):
    """
    Cells that block kriging estimates from pixels.

    Parameters
    ----------
    pixels : array, shape (rows, columns)
    response : array
        From `kriging_filter`, of this shape.
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    cells : array of float32, shape (rows * ratio[0], columns * ratio[1])
        Their means over pixels are the pixels, within single precision.

    Examples
    --------
    What is the same everywhere stays so:

    >>> cells = kriged(np.full((4, 4), 2.0), kriging_filter(0.2, 0.1, (3, 3), (4, 4)), (3, 3))
    >>> bool(np.allclose(cells, 2.0, atol=1e-5))
    True
    """
    spectrum = fft.fft2(pixels.astype(np.float32))
    spectrum = spectrum[:, np.arange(response.shape[1]) % pixels.shape[1]]
    # Frequencies of cells that are one of pixels have its value.
    repeated = (response.reshape(ratio[0], *spectrum.shape) * spectrum).reshape(response.shape)
    size = pixels.shape[0] * ratio[0], pixels.shape[1] * ratio[1]
    return fft.irfft2(repeated, s=size, overwrite_x=True)


def weighed(cells, response, ratio):
    """
    Sums of cells by the weights that pixels have in them: the transpose of `kriged`.

    Parameters
    ----------
    cells : array, shape (rows * ratio[0], columns * ratio[1])
    response : array
        From `kriging_filter`.
    ratio : (int, int)
        Cells in a pixel, down and across.

    Returns
    -------
    pixels : array, shape (rows, columns)

    Examples
    --------
    All pixels together have a weight of one in each cell:

    >>> pixels = weighed(np.full((12, 12), 2.0), kriging_filter(0.2, 0.1, (3, 3), (4, 4)), (3, 3))
    >>> bool(np.allclose(pixels, 2.0 * 9, atol=1e-4))
    True
    """
    spectrum = fft.rfft2(cells)
    spectrum *= np.conj(response)
    # Of every ratio-th row the spectrum is the mean over the frequencies that are one of pixels.
    folded = spectrum.reshape(ratio[0], -1, spectrum.shape[1]).mean(axis=0)
    return fft.irfft2(folded, s=(len(folded), cells.shape[1]))[:, :: ratio[1]]
