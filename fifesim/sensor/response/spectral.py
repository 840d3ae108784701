"""Band means of spectra, and the best linear estimate of other bands from them."""

from typing import NamedTuple

import numpy as np

from fifesim.base.bands import solar_spectrum

# A step between samples is a gap from this many times the median of the steps around it, where no widths are known.
_GAP = 2.5
# Number of steps on each side for the median step.
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
    """
    wavelength = np.asarray(wavelength, float)
    steps = np.diff(wavelength)
    if fwhm is not None:
        fwhm = np.asarray(fwhm, float)
        # Differences of decimal fractions have rounding errors.
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


# Share [1] and reflectance [1] of grey surfaces added to the land library, so that roads, roofs and clouds keep their
# reflectance. With a tenth of this share, a road of 0.2 would become 0.196 in TM5.
GREY_SHARE = 0.01
GREY = 0.3


class Estimate(NamedTuple):
    """Linear estimate of the bands of one instrument from the bands of another."""

    weights: np.ndarray  # of the source's bands in each target band, shape (target, source) [1]
    error: np.ndarray  # standard error of each target band over spectra of unknown leaves, shape (target,) [1]


class Line(NamedTuple):
    """Linear relation of one band to another."""

    slope: float
    offset: float
    error: float  # standard deviation about the line [1]
    difference: float  # root mean square of the bands' difference, without the line [1]


def best_linear(source, target, uncertainty):
    r"""
    Best linear estimate of bands from other bands over a library, and its error for leaves outside the library.

    .. math::

        B = C_{ts} \, (C_{ss} + u^2 I)^{-1}, \quad C = \frac{1}{N} \sum_n \rho_n \rho_n^T + g \, \rho_g^2, \quad
        e_t^2 = \frac{1}{N} \sum_n (\rho_t - B_{(n)} \rho_s)_n^2 + u^2 \sum_s B_{ts}^2

    with a share :math:`g = 0.01` of grey surfaces of :math:`\rho_g = 0.3`, and :math:`B_{(n)}` the estimate without the
    spectra of the leaf of spectrum n. There is no offset: a black surface is black in all bands, and half the light is
    half the reflectance.

    Parameters
    ----------
    source, target : array, shape (leaf, spectrum, band)
        Reflectance of the library's spectra in the bands of either instrument. [1]
    uncertainty : float
        Standard error :math:`u` of the source's reflectance, independent from band to band, above 0. [1]

    Returns
    -------
    estimate : Estimate

    Notes
    -----
    Without the spectra :math:`X` of a leaf, whose errors with all spectra are :math:`E`, they are
    :math:`(I - H)^{-1} E` with :math:`H = X \, (N (C_{ss} + u^2 I))^{-1} X^T` (Sherman, Morrison and Woodbury).
    """
    source, target = np.asarray(source, float), np.asarray(target, float)
    (leaves, count, _), number = source.shape, source.shape[0] * source.shape[1]
    grey = number * GREY_SHARE * GREY**2
    own = np.einsum("lns,lnr->sr", source, source) + grey + number * uncertainty**2 * np.eye(source.shape[2])
    weights = np.linalg.solve(own, np.einsum("lns,lnt->st", source, target) + grey).T
    leverage = source @ np.linalg.solve(own, source.transpose(0, 2, 1))
    errors = np.linalg.solve(np.eye(count) - leverage, target - source @ weights.T)
    squared = np.sum(errors**2, axis=(0, 1)) / (leaves * count)
    return Estimate(weights, np.sqrt(squared + uncertainty**2 * np.sum(weights**2, axis=1)))


def line_between(source, target):
    """Least-squares line from one band to another over spectra."""
    source, target = np.asarray(source, float), np.asarray(target, float)
    from_mean = source - source.mean()
    slope = np.sum(from_mean * (target - target.mean())) / np.sum(from_mean**2)
    offset = target.mean() - slope * source.mean()
    error = np.sqrt(np.mean((target - offset - slope * source) ** 2))
    difference = np.sqrt(np.mean((target - source) ** 2))
    return Line(*map(float, (slope, offset, error, difference)))
