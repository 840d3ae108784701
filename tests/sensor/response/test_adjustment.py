"""The best linear estimate, beside cases that are known by hand and beside least squares."""

import numpy as np
import pytest

from fifesim.sensor.response.spectral import GREY, GREY_SHARE, best_linear, line_between


@pytest.fixture
def spectra():
    """Spectra of 500 leaves, 8 of each, in 6 bands."""
    return np.random.Generator(np.random.Philox(2)).uniform(0.05, 0.5, (500, 8, 6))


def test_estimate_is_least_squares_with_noisy_bands(spectra):
    """With as many noisy copies of the spectra as one likes, ordinary least squares finds the same weights."""
    truth = spectra @ np.array([0.5, 0.2, 0.0, 0.3, 0.0, -0.1])
    noise = 0.05 * np.random.Generator(np.random.Philox(3)).standard_normal(spectra.shape)
    found = best_linear(spectra, truth[..., None], 0.05)
    noisy = (spectra + noise).reshape(-1, 6)
    by_squares, *_ = np.linalg.lstsq(noisy, truth.ravel(), rcond=None)
    np.testing.assert_allclose(found.weights[0], by_squares, atol=0.02)
    left = np.sqrt(np.mean((truth.ravel() - noisy @ found.weights[0]) ** 2))
    assert found.error[0] == pytest.approx(left, rel=0.03)


def test_error_is_that_of_fits_without_each_leaf():
    """Few leaves of few spectra, so that each has much influence, fitted again without each of them."""
    random = np.random.Generator(np.random.Philox(5))
    source, target = random.uniform(0.05, 0.5, (7, 3, 2)), random.uniform(0.05, 0.5, (7, 3, 2))
    uncertainty, grey = 0.02, np.sqrt(21 * GREY_SHARE) * GREY
    found = best_linear(source, target, uncertainty)

    def fitted(leaves):
        # Rows of least squares: spectra, the grey surfaces, and the uncertainty of each band.
        left = np.vstack([source[leaves].reshape(-1, 2), [[grey] * 2], np.sqrt(21) * uncertainty * np.eye(2)])
        right = np.vstack([target[leaves].reshape(-1, 2), [[grey] * 2], np.zeros((2, 2))])
        return np.linalg.lstsq(left, right, rcond=None)[0].T

    leaves = np.arange(7)
    np.testing.assert_allclose(found.weights, fitted(leaves), rtol=1e-10)
    errors = [target[leaf] - source[leaf] @ fitted(leaves[leaves != leaf]).T for leaf in leaves]
    expected = np.mean(np.square(errors), axis=(0, 1)) + uncertainty**2 * np.sum(found.weights**2, axis=1)
    np.testing.assert_allclose(found.error**2, expected, rtol=1e-10)


def test_a_band_that_is_there_is_itself(spectra):
    found = best_linear(spectra, spectra, 1e-6)
    np.testing.assert_allclose(found.weights, np.eye(6), atol=1e-6)
    assert np.all(found.error < 1e-5)


def test_more_uncertainty_is_more_error(spectra):
    errors = [best_linear(spectra[..., :5], spectra[..., 5:], each).error[0] for each in (0.001, 0.01, 0.1)]
    assert errors[0] < errors[1] < errors[2]


def test_line_is_that_of_a_fit():
    random = np.random.Generator(np.random.Philox(6))
    source = random.uniform(0, 0.5, 300)
    target = 0.9 * source + 0.01 + 0.02 * random.standard_normal(300)
    found = line_between(source, target)
    np.testing.assert_allclose((found.slope, found.offset), np.polyfit(source, target, 1), rtol=1e-10)
    assert found.error == pytest.approx(np.std(target - np.polyval([found.slope, found.offset], source)), rel=1e-12)
    assert found.difference == pytest.approx(np.sqrt(np.mean((target - source) ** 2)), rel=1e-12)
