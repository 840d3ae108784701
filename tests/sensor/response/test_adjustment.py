"""The best linear estimate, beside cases that are known by hand and beside least squares."""

import numpy as np
import pytest

from fifesim.sensor.response.spectral import (
    CORRELATION,
    DEVIATION,
    GREY,
    GREY_SHARE,
    band_moments,
    best_linear,
    line_between,
)


@pytest.fixture
def spectra():
    return np.random.Generator(np.random.Philox(2)).uniform(0.05, 0.5, (4000, 6))


def test_estimate_is_least_squares_with_noisy_bands(spectra):
    """With as many noisy copies of the spectra as one likes, ordinary least squares finds the same weights."""
    truth = spectra @ np.array([0.5, 0.2, 0.0, 0.3, 0.0, -0.1])
    noise = 0.05 * np.random.Generator(np.random.Philox(3)).standard_normal(spectra.shape)
    together = np.column_stack([spectra, truth])
    found = best_linear(together.T @ together / len(truth), 6, 0.05)
    by_squares, *_ = np.linalg.lstsq(spectra + noise, truth, rcond=None)
    np.testing.assert_allclose(found.weights[0], by_squares, atol=0.02)
    left = np.sqrt(np.mean((truth - (spectra + noise) @ found.weights[0]) ** 2))
    assert found.error[0] == pytest.approx(left, rel=0.03)


def test_a_band_that_is_there_is_itself(spectra):
    moments = spectra.T @ spectra / len(spectra)
    both = np.block([[moments, moments], [moments, moments]])
    found = best_linear(both, 6, 1e-6)
    np.testing.assert_allclose(found.weights, np.eye(6), atol=1e-6)
    assert np.all(found.error < 1e-5)


def test_more_uncertainty_is_more_error(spectra):
    moments = spectra.T @ spectra / len(spectra)
    errors = [best_linear(moments, 5, uncertainty).error[0] for uncertainty in (0.001, 0.01, 0.1)]
    assert errors[0] < errors[1] < errors[2]


def test_moments_are_those_of_spectra_with_smooth_factors():
    """Beside a sample of spectra times one plus a Gaussian process."""
    wavelength = np.linspace(0.4, 0.8, 5)
    mean = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    apart = wavelength[:, None] - wavelength
    covariance = DEVIATION**2 * np.exp(-0.5 * (apart / CORRELATION) ** 2)
    factors = 1 + np.random.Generator(np.random.Philox(4)).multivariate_normal(np.zeros(5), covariance, 200_000)
    weights = np.array([[0.5, 0.5, 0, 0, 0], [0, 0, 0.2, 0.3, 0.5]])
    means = (factors * mean) @ weights.T
    straight = weights @ np.outer(mean, mean) @ weights.T
    grey = GREY_SHARE * GREY**2 * weights @ (1 + covariance) @ weights.T
    found = band_moments(weights, wavelength, mean[None]) - straight - grey
    np.testing.assert_allclose(found, np.cov(means.T), rtol=0, atol=0.01 * found.max())


def test_line_is_that_of_a_fit():
    random = np.random.Generator(np.random.Philox(6))
    source = random.uniform(0, 0.5, 300)
    target = 0.9 * source + 0.01 + 0.02 * random.standard_normal(300)
    found = line_between(source, target)
    np.testing.assert_allclose((found.slope, found.offset), np.polyfit(source, target, 1), rtol=1e-10)
    assert found.error == pytest.approx(np.std(target - np.polyval([found.slope, found.offset], source)), rel=1e-12)
    assert found.difference == pytest.approx(np.sqrt(np.mean((target - source) ** 2)), rel=1e-12)
