"""Band weights and best linear estimates of bands compared with quadrature and least squares."""

import numpy as np
import pytest

from fifesim.base.bands import Band, solar_spectrum
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.spectral import GREY, GREY_SHARE, band_weights, best_linear, covered_steps, line_between

TRIANGLE = Band("triangle", (0.5, 0.6, 0.7), (0.0, 1.0, 0.0))
BANDS = [band.response for name in ("OLI", "MSI", "TM") for band in instrument(name).bands]


@pytest.fixture(scope="module")
def spectrum():
    """Leaf spectrum in steps of 5 to 11 nm that do not coincide with nodes of the responses or the sun."""
    wavelength, reflectance, _ = leaf_spectrum(Leaf())
    uneven = 0.4 + np.cumsum([0.0, *np.linspace(0.005, 0.0111, 260)])
    uneven = uneven[uneven < 2.5]
    return uneven, np.interp(uneven, wavelength, reflectance)


def by_quadrature(band, wavelength, values, sun):
    """Five-point Gauss quadrature of the interpolated spectrum between all nodes of response, sun and spectrum."""
    x, w = np.polynomial.legendre.leggauss(5)
    low, high = band.limits
    bends = np.concatenate([band.wavelength, wavelength, solar_spectrum()[0], [low, high]])
    edges = np.unique(bends[(bends >= low) & (bends <= high)])
    at = (edges[1:] + edges[:-1])[:, None] / 2 + np.diff(edges)[:, None] / 2 * x
    density = np.interp(at, band.wavelength, band.response) * w * np.diff(edges)[:, None] / 2
    density = density * np.interp(at, *solar_spectrum()) if sun else density
    return np.sum(density * np.interp(at, wavelength, values)) / np.sum(density)


@pytest.mark.parametrize("sun", [True, False])
def test_band_mean_is_the_integral_of_the_interpolated_spectrum(spectrum, sun):
    wavelength, values = spectrum
    for band in BANDS:
        found = band_weights(band, wavelength, covered_steps(wavelength), sun=sun)
        assert found.coverage == pytest.approx(1, abs=1e-12)
        assert found.weights @ values == pytest.approx(by_quadrature(band, wavelength, values, sun), rel=1e-9)


def test_weights_sum_to_one_and_are_zero_outside_the_spectrum(spectrum):
    wavelength, _ = spectrum
    sums = [band_weights(band, wavelength, covered_steps(wavelength)).weights.sum() for band in BANDS]
    np.testing.assert_allclose(sums, 1, rtol=0, atol=1e-12)
    found = band_weights(TRIANGLE, [0.8, 0.9], [True])
    assert (found.coverage, found.weights.tolist()) == (0.0, [0.0, 0.0])


def test_coverage_of_a_partly_sampled_band():
    found = band_weights(TRIANGLE, [0.3, 0.6], [True], sun=False)
    assert found.coverage == pytest.approx(0.5, abs=1e-12)
    assert found.weights.sum() == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(found.missing, [(0.6, 0.7)])


def test_gap_has_no_weight_and_is_reported():
    wavelength = np.round(np.arange(0.45, 0.755, 0.01), 3)
    wavelength = wavelength[(wavelength <= 0.58) | (wavelength >= 0.63)]
    covered = covered_steps(wavelength)
    found = band_weights(TRIANGLE, wavelength, covered, sun=False)
    # Integral of the response from 0.58 to 0.63 um, divided by 0.1.
    assert found.coverage == pytest.approx(1 - (0.02 * 0.9 + 0.03 * 0.85) / 0.1, abs=1e-12)
    np.testing.assert_allclose(found.missing, [(0.58, 0.63)])
    values = np.where(wavelength < 0.6, 0.1, 0.5)
    left, right = 0.5 * 0.08 * 0.8, 0.5 * 0.07 * 0.7
    assert found.weights @ values == pytest.approx((0.1 * left + 0.5 * right) / (left + right), abs=1e-12)


@pytest.mark.parametrize(
    ("wavelength", "fwhm", "covered"),
    [
        ([0.50, 0.51, 0.52, 0.54, 0.55, 0.56], None, [True] * 5),  # one sample dropped
        ([0.50, 0.51, 0.52, 0.55, 0.56, 0.57], None, [True, True, False, True, True]),  # two
        ([0.5, 0.501, 0.502, 0.503, 0.513, 0.523, 0.533], None, [True] * 6),  # a coarser detector follows
        ([0.5, 0.51, 0.52, 0.62, 0.72, 0.73, 0.74], None, [True, True, False, False, True, True]),  # one alone
        ([0.50, 0.51, 0.53], [0.009, 0.011, 0.008], [True, False]),
        ([0.50, 0.51, 0.53], [0.009, 0.011, 0.009], [True, True]),
    ],
)
def test_covered_steps_detects_gaps(wavelength, fwhm, covered):
    assert covered_steps(wavelength, fwhm).tolist() == covered


def test_means_agree_with_spectral_python():
    """SPy uses a Gaussian response truncated at half maximum, and a spectrum that is constant around each sample."""
    spectral = pytest.importorskip("spectral")
    wavelength, values, _ = leaf_spectrum(Leaf())
    for center, width in ((0.56, 0.06), (0.70, 0.04), (0.842, 0.115), (1.61, 0.09), (2.19, 0.18)):
        theirs = spectral.BandResampler(wavelength, [center], fwhm2=[width])(values)[0]
        nodes = np.linspace(center - width / 2, center + width / 2, 401)
        gauss = np.exp(-4 * np.log(2) * ((nodes - center) / width) ** 2)
        ours = band_weights(Band("gauss", nodes, gauss), wavelength, covered_steps(wavelength), sun=False)
        assert ours.weights @ values == pytest.approx(theirs, rel=1e-4)


# ------------------------------------------------------------------------------------------ other bands


def test_error_equals_explicit_leave_one_out():
    """The library is small, so that each leaf has much influence; the fit is repeated without each leaf."""
    random = np.random.Generator(np.random.Philox(5))
    source, target = random.uniform(0.05, 0.5, (7, 3, 2)), random.uniform(0.05, 0.5, (7, 3, 2))
    uncertainty, grey = 0.02, np.sqrt(21 * GREY_SHARE) * GREY
    found = best_linear(source, target, uncertainty)

    def fitted(leaves):
        # Rows of the least-squares system: library, grey surfaces, uncertainty of each band.
        left = np.vstack([source[leaves].reshape(-1, 2), [[grey] * 2], np.sqrt(21) * uncertainty * np.eye(2)])
        right = np.vstack([target[leaves].reshape(-1, 2), [[grey] * 2], np.zeros((2, 2))])
        return np.linalg.lstsq(left, right, rcond=None)[0].T

    leaves = np.arange(7)
    np.testing.assert_allclose(found.weights, fitted(leaves), rtol=1e-10)
    errors = [target[leaf] - source[leaf] @ fitted(leaves[leaves != leaf]).T for leaf in leaves]
    expected = np.mean(np.square(errors), axis=(0, 1)) + uncertainty**2 * np.sum(found.weights**2, axis=1)
    np.testing.assert_allclose(found.error**2, expected, rtol=1e-10)


def test_line_between_equals_polyfit():
    random = np.random.Generator(np.random.Philox(6))
    source = random.uniform(0, 0.5, 300)
    target = 0.9 * source + 0.01 + 0.02 * random.standard_normal(300)
    found = line_between(source, target)
    np.testing.assert_allclose((found.slope, found.offset), np.polyfit(source, target, 1), rtol=1e-10)
    assert found.error == pytest.approx(np.std(target - np.polyval([found.slope, found.offset], source)), rel=1e-12)
    assert found.difference == pytest.approx(np.sqrt(np.mean((target - source) ** 2)), rel=1e-12)
