"""Band means of spectra, and the best linear estimate of other bands from them."""

from typing import NamedTuple

import numpy as np

from fifesim.base.bands import solar_spectrum

# A step between samples is a gap from this many times the median of the steps around it, where no widths are known.
_GAP = 2.5
# Number of steps to either side whose median is the usual step.
_AROUND = 2


class BandWeights(NamedTuple):
    """Weights of the samples of a spectrum in a band, and the covered part of the band."""

    weights: np.ndarray  # of the samples, shape (n,); they sum to 1, or are 0 where nothing is covered [1]
    coverage: float  # share of the band's weight on wavelengths that are covered [1]
    missing: tuple  # wavelengths that are not covered, pairs of (low, high) [um]


def covered_steps(wavelength, fwhm=None):
    r"""
    Mask of the steps between the samples of a spectrum that are covered rather than gaps.

    The spectrum is taken as straight between the two samples of a covered step. With widths, a step is covered if the
    hole between both samples is not wider than their mean width,
    :math:`\lambda_{i+1} - \lambda_i \le w_i + w_{i+1}`; without, if it is at most 2.5 times the median of the five
    steps around it.

    Parameters
    ----------
    wavelength : array, shape (n,)
        Increasing, two or more. [um]
    fwhm : array, shape (n,), optional
        Full width at half maximum of each sample. [um]

    Returns
    -------
    covered : array of bool, shape (n - 1,)

    Examples
    --------
    >>> covered_steps([0.50, 0.51, 0.52, 0.60, 0.61, 0.62]).tolist()
    [True, True, False, True, True]
    >>> covered_steps([0.50, 0.51, 0.53], fwhm=[0.01, 0.01, 0.01]).tolist()
    [True, True]
    """
    wavelength = np.asarray(wavelength, float)
    steps = np.diff(wavelength)
    if fwhm is not None:
        fwhm = np.asarray(fwhm, float)
        # Differences of decimal fractions miss their sum by rounding.
        return steps <= (fwhm[1:] + fwhm[:-1]) * (1 + 1e-6)
    places = [slice(max(at - _AROUND, 0), at + _AROUND + 1) for at in range(steps.size)]
    usual = np.array([np.median(steps[place]) for place in places])
    return steps <= _GAP * usual


def band_weights(band, wavelength, covered, *, sun=True):
    r"""
    Weights of the samples of a spectrum in the mean over a band.

    .. math::

        \bar\rho = \frac{\int \rho(\lambda) \, R(\lambda) \, E(\lambda) \, d\lambda}
            {\int R(\lambda) \, E(\lambda) \, d\lambda} = \sum_i w_i \, \rho_i

    over the wavelengths that are covered, where :math:`\rho` is straight between its samples. Response :math:`R` and
    solar irradiance :math:`E` are straight between theirs, so that Simpson's rule is exact between the nodes of all.

    Parameters
    ----------
    band : fifesim.base.bands.Band
    wavelength : array, shape (n,)
        Wavelengths of the samples, increasing. [um]
    covered : array of bool, shape (n - 1,)
        From `covered_steps`.
    sun : bool, optional
        Whether with :math:`E`, as reflectance needs; without it, :math:`E = 1`, as radiance does.

    Returns
    -------
    weights : BandWeights

    Examples
    --------
    >>> from fifesim.base.bands import Band
    >>> found = band_weights(Band("a", (0.5, 0.6, 0.7), (0, 1, 0)), [0.4, 0.6, 0.8], [True, True], sun=False)
    >>> found.weights.round(6).tolist(), found.coverage
    ([0.083333, 0.833333, 0.083333], 1.0)
    """
    wavelength, covered = np.asarray(wavelength, float), np.asarray(covered, bool)
    low, high = band.limits
    own = [np.asarray(band.wavelength), wavelength, solar_spectrum()[0]]
    inside = [nodes[(nodes > low) & (nodes < high)] for nodes in own]
    nodes = np.unique(np.concatenate([[low, high], *inside]))
    middle = (nodes[1:] + nodes[:-1]) / 2
    step = np.searchsorted(wavelength, middle) - 1
    within = (step >= 0) & (step < wavelength.size - 1)
    step = np.clip(step, 0, wavelength.size - 2)
    seen = within & covered[step]
    total, sums = np.zeros(middle.size), np.zeros(wavelength.size)
    for at, simpson in ((nodes[:-1], 1 / 6), (middle, 4 / 6), (nodes[1:], 1 / 6)):
        part = simpson * np.diff(nodes) * _density(band, at, sun)
        share = (at - wavelength[step]) / (wavelength[step + 1] - wavelength[step])
        np.add.at(sums, step, np.where(seen, part * (1 - share), 0.0))
        np.add.at(sums, step + 1, np.where(seen, part * share, 0.0))
        total += part
    return BandWeights(
        weights=sums / sums.sum() if sums.sum() > 0 else sums,
        coverage=float(total[seen].sum() / total.sum()),
        missing=_runs(nodes, ~seen & (total > 0)),
    )


def _density(band, wavelength, sun):
    """Response times irradiance."""
    response = np.interp(wavelength, band.wavelength, band.response, left=0.0, right=0.0)
    return response * np.interp(wavelength, *solar_spectrum()) if sun else response


def _runs(nodes, chosen):
    """Ends of the runs of chosen intervals between nodes."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    return tuple((float(nodes[first]), float(nodes[last])) for first, last in edges.reshape(-1, 2))


# How real spectra differ from those of a library: by a smooth factor of this standard deviation [1] and
# correlation length [um]. Held out soils and canopies decided it: more costs what the library knows of water, less
# follows the library into bands far away.
DEVIATION = 0.005
CORRELATION = 0.05

# Share [1] and reflectance [1] of grey surfaces beside a library of land: roads, roofs and clouds stay about what they
# are. A tenth of it would leave a road of 0.2 at 0.196 in TM5.
GREY_SHARE = 0.01
GREY = 0.3


class Estimate(NamedTuple):
    """Linear estimate of the bands of one instrument from the bands of another."""

    weights: np.ndarray  # of the source's bands in each target band, shape (target, source) [1]
    error: np.ndarray  # standard error of each target band over the library, shape (target,) [1]


class Line(NamedTuple):
    """Linear relation of one band to another."""

    slope: float
    offset: float
    error: float  # standard deviation about the line [1]
    difference: float  # root mean square of the bands' difference, without the line [1]


def band_moments(weights, wavelength, spectra):
    r"""
    Second moments of band means over a library of spectra with smooth relative deviations.

    .. math:: C = W \, (M \circ (1 + K)) \, W^T, \quad M = \frac{1}{N} \sum_n \rho_n \rho_n^T + g \rho_g^2, \quad
        K_{ij} = s^2 \exp\left(-\frac{(\lambda_i - \lambda_j)^2}{2 \ell^2}\right)

    with :math:`s = 0.005` and :math:`\ell = 0.05` um, and a share :math:`g = 0.01` of grey surfaces of
    :math:`\rho_g = 0.3`.

    Parameters
    ----------
    weights : array, shape (band, n)
        Weights of the wavelengths in each band. [1]
    wavelength : array, shape (n,)
        [um]
    spectra : array, shape (spectrum, n)
        [1]

    Returns
    -------
    moments : array, shape (band, band)
        [1]

    Examples
    --------
    >>> band_moments([[1.0, 0.0]], [0.5, 0.6], [[0.2, 0.4]]).round(6).tolist()
    [[0.040901]]
    """
    weights, spectra = np.asarray(weights, float), np.asarray(spectra, float)
    apart = np.subtract.outer(np.asarray(wavelength, float), np.asarray(wavelength, float))
    deviation = DEVIATION**2 * np.exp(-(apart**2) / (2 * CORRELATION**2))
    land = spectra.T @ spectra / len(spectra) + GREY_SHARE * GREY**2
    return weights @ (land * (1 + deviation)) @ weights.T


def best_linear(moments, sources, uncertainty):
    r"""
    Best linear estimate of bands from other bands, and its error.

    .. math:: B = C_{ts} \, (C_{ss} + u^2 I)^{-1}, \quad
        e_t^2 = (C_{tt} - B \, C_{st})_{tt}

    It has no offset: a black surface is black in all bands, and half the light is half the reflectance.

    Parameters
    ----------
    moments : array, shape (band, band)
        Second moments :math:`C` of the source's bands, then the target's, from `band_moments`. [1]
    sources : int
        How many bands are the source's.
    uncertainty : float
        Standard error :math:`u` of the source's reflectance, independent from band to band. [1]

    Returns
    -------
    estimate : Estimate

    Examples
    --------
    A band that is another's double is found as such:

    >>> found = best_linear(np.array([[1.0, 2.0], [2.0, 4.0]]), 1, 0.0)
    >>> found.weights.tolist(), found.error.tolist()
    ([[2.0]], [0.0])
    """
    moments = np.asarray(moments, float)
    own, cross, target = moments[:sources, :sources], moments[:sources, sources:], moments[sources:, sources:]
    weights = np.linalg.solve(own + uncertainty**2 * np.eye(sources), cross).T
    # Rounding may leave less than nothing of a band that the source has itself.
    squared = np.diag(target) - np.sum(weights * cross.T, axis=1)
    return Estimate(weights, np.sqrt(np.maximum(squared, 0.0)))


def line_between(source, target):
    """Least-squares line from one band to another over spectra."""
    source, target = np.asarray(source, float), np.asarray(target, float)
    from_mean = source - source.mean()
    slope = np.sum(from_mean * (target - target.mean())) / np.sum(from_mean**2)
    offset = target.mean() - slope * source.mean()
    error = np.sqrt(np.mean((target - offset - slope * source) ** 2))
    difference = np.sqrt(np.mean((target - source) ** 2))
    return Line(*map(float, (slope, offset, error, difference)))
