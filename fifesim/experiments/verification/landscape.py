"""Checks of the random field against its equation and its analytic spectrum."""

from functools import partial

import numpy as np

from fifesim.experiments.verification.deviations import Deviation, largest
from fifesim.ground.landscape.autoregression import autocorrelation, field_variance
from fifesim.ground.landscape.field import periodic_field, streaming_field

_deviation = partial(Deviation, "random field")

_ARPS = (0.15, 0.24)
_SIZE = 1024  # cells on a side: many correlation lengths


def _covariances(arp):
    """Covariances by lag on a torus, the transform of the spectrum of the process."""
    wave = np.cos(2 * np.pi * np.fft.fftfreq(512))
    return np.fft.ifft2((1 - 2 * arp * (wave[:, None] + wave)) ** -2.0).real


def _moments():
    variance = largest([field_variance(arp) / _covariances(arp)[0, 0] for arp in _ARPS], 1)
    yield _deviation("variance", variance, 1e-12, "1", "integral of the spectrum")
    lags = np.arange(40)
    found, expected = [], []
    for arp in _ARPS:
        found.append(autocorrelation(arp, lags))
        expected.append(_covariances(arp)[0, lags] / _covariances(arp)[0, 0])
    yield _deviation("autocorrelation by lag", largest(found, expected), 1e-12, "1", "transform of the spectrum")


def _samples():
    """Bartlett's standard error of a covariance that is estimated from so many correlated cells; 4 of them."""
    for arp in _ARPS:
        field = streaming_field(20, arp, -_SIZE // 2, 17, (_SIZE, _SIZE))
        correlations = _covariances(arp) / _covariances(arp)[0, 0]
        error = np.sqrt(2 * np.sum(correlations**2) / field.size)
        pairs = [field[:-1] * field[1:], field[:, :-1] * field[:, 1:]]
        one = [np.mean(product) - correlations[0, 1] for product in pairs]
        source = f"spectrum, standard error {error:.1g}"
        yield _deviation(f"variance of a field, arp {arp:g}", abs(np.mean(field**2) - 1), 4 * error, "1", source)
        yield _deviation(f"correlation at one cell, arp {arp:g}", largest(one, 0), 4 * error, "1", source)


def _equation():
    worst = 0.0
    for arp in _ARPS:
        noise = periodic_field(5, 0.0, (90, 70))
        field = periodic_field(5, arp, (90, 70)) * np.sqrt(field_variance(arp))
        neighbours = sum(np.roll(field, step, axis) for step in (-1, 1) for axis in (0, 1))
        worst = np.maximum(worst, largest(field - arp * neighbours, noise))
    yield _deviation("a field is its neighbours and noise", worst, 1e-12, "1", "its own equation, cell by cell")


CHECKS = (_moments, _samples, _equation)
