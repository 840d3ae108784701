"""Checks of the random field against its equation and its analytic spectrum, and of its white noise."""

from functools import partial

import numpy as np
from scipy.stats import norm

from fifesim.ground.landscape.autoregression import (
    FIELD_TILE,
    autocorrelation,
    field_variance,
    periodic_field,
    philox,
    streaming_field,
    white_noise,
)
from fifesim.ground.landscape.distribution import lai_distribution, quantile_map, quantile_table, rank_map, treatments
from verification.deviations import Deviation, largest

_deviation = partial(Deviation, "random field")

_ARPS = (0.15, 0.24)
_SIZE = 1024  # cells on a side: many correlation lengths


def _covariances(arp):
    """Covariances by lag on a torus, by the transform of the spectrum of the process."""
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
    """Check sample covariances within 4 standard errors, by Bartlett for correlated cells."""
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


def _generator():
    """Check the generator with the counters and keys of kat_vectors of Random123."""
    known = {
        ("00000000 00000000 00000000 00000000", "00000000 00000000"): "6627e8d5 e169c58d bc57ac4c 9b00dbd8",
        ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff"): "408f276d 41c83b0e a20bc7c6 6d5451fd",
        ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0"): "d16cfe09 94fdcceb 5001e420 24126ea1",
    }
    wrong = [philox(*_words(counter), *_words(key)) != _words(answer) for (counter, key), answer in known.items()]
    source = "Salmon et al. (2011), known answers"
    yield _deviation("words of Philox-4x32-10", float(np.sum(wrong)), 0.0, "word", source)


def _words(text):
    return np.array([int(word, 16) for word in text.split()], np.uint64)


def _halves(*numbers):
    """Low and high 32-bit words of 64-bit numbers."""
    return np.array([number >> shift & 2**32 - 1 for number in numbers for shift in (0, 32)], np.uint64)


def _white_noise():
    """Check white noise against a scalar computation in double precision."""
    # Single precision must not leave a mean, neither by mantissa nor by angle. Four cells of a row use the words of one
    # place; one of the seeds gives a word of 26, for which the half counts.
    row, group = -2, -3
    worst = np.zeros(2)
    for seed in (2696, 2**40 + 7):
        found = white_noise(seed, row, 4 * group, (40, 2000)).astype(float)
        words = [philox(*_halves(k, i, seed)) for i in range(row, row + 40) for k in range(group, group + 500)]
        one, other = np.reshape(words, (-1, 2)).T
        uniform = (one + 0.5) / 2**32
        # 30 bits give the angle within an eighth of a turn, and two bits the quarter.
        angle = np.pi / 2 * (other // 4 - 2.0**29) / 2**30
        expected = np.sqrt(-2 * np.log(uniform)) * np.exp(1j * (angle - np.pi / 2 * (other % 4)))
        normals = found.reshape(-1, 2) @ [1, 1j]
        # Radii below 0.01 are dominated by the rounding error of u.
        clear = np.abs(expected) > 0.01
        worst[0] = np.maximum(worst[0], largest(np.abs(normals - expected)[clear], 0))
        usual = clear & (np.abs(expected) < 2)
        logarithm = np.abs(normals) ** 2 + 2 * np.log(uniform)
        mantissa = (np.log2(uniform) + 0.5) % 1
        means = (
            _means(logarithm[usual], mantissa[usual]),
            _means((normals / expected).imag[usual], angle[usual] / np.pi * 2 + 0.5),
        )
        worst[1] = np.maximum(worst[1], largest(means, 0))
    yield _deviation("normals, cell by cell", worst[0], 1e-5, "1", "Box and Muller (1958)")
    yield _deviation("normals, mean of alike", worst[1], 5e-8, "1", "Box and Muller (1958)")


def _means(values, place):
    """Means in 32 classes of a place from 0 to 1."""
    classes = (32 * place).astype(int)
    return np.bincount(classes, values) / np.bincount(classes)


def _quantiles():
    """Check the quantile table, whose linear interpolation errs by 1/8 of its squared step times the curvature."""
    deviates = np.append(np.random.default_rng(4).normal(0, 1.5, 20_000), [-9.0, 9.0])[None]
    worst = 0.0
    for name in treatments():
        density = lai_distribution(name)
        found, exact = quantile_map(deviates, quantile_table(density)), density.ppf(norm.cdf(deviates))
        worst = np.maximum(worst, largest(found, exact))
    evenly = quantile_map(deviates, np.linspace(0, 1, 2**14 + 1))
    worst = np.maximum(worst, largest(evenly, np.clip((deviates + 8.5) / 17, 0, 1)))
    yield _deviation("leaf area at quantiles", worst, 3e-7, "m²/m²", "quantile functions of scipy")
    ranked = rank_map(deviates[0], density)[np.argsort(deviates[0])]
    exact = density.ppf((np.arange(ranked.size) + 0.5) / ranked.size)
    yield _deviation("leaf area by ranks", largest(ranked, exact), 0.0, "m²/m²", "quantile functions of scipy")


def _tiles():
    """Check the equation of the process across the seams of four tiles, within the single precision of the filter."""
    worst = 0.0
    for arp in _ARPS:
        noise = white_noise(5, -20, FIELD_TILE - 30, (40, 60)).astype(float)
        field = streaming_field(5, arp, -21, FIELD_TILE - 31, (42, 62)) * np.sqrt(field_variance(arp))
        neighbours = field[:-2, 1:-1] + field[2:, 1:-1] + field[1:-1, :-2] + field[1:-1, 2:]
        worst = np.maximum(worst, largest(field[1:-1, 1:-1] - arp * neighbours, noise))
    yield _deviation("tiles are their neighbours and noise", worst, 1e-5, "1", "its own equation, cell by cell")


CHECKS = (_moments, _samples, _equation, _generator, _white_noise, _tiles, _quantiles)
