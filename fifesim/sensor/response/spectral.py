"""Bands from spectra: the weight of each sample of a spectrum in the mean over a band's response."""

from typing import NamedTuple

import numpy as np

from fifesim.base.bands import solar_spectrum

# A step between samples is a gap from this many times the median of the steps around it, where no widths are known.
_GAP = 2.5
# Steps to either side whose median says what is usual.
_AROUND = 2


class BandWeights(NamedTuple):
    """What the samples of a spectrum count in a band, and what of the band they cover."""

    weights: np.ndarray  # of the samples, shape (n,); they sum to 1, or are 0 where nothing is covered [1]
    coverage: float  # share of the band's weight on wavelengths that are covered [1]
    missing: tuple  # wavelengths that are not covered, pairs of (low, high) [um]


def covered_steps(wavelength, fwhm=None):
    r"""
    Which steps between the samples of a spectrum are covered, and which are gaps.

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
        Of the samples, increasing. [um]
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
