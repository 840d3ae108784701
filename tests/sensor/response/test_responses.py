"""Line spread functions, their combinations, and band weights, compared with quadrature and least squares."""

import numpy as np
import pytest

from fifesim.base.bands import Band, solar_spectrum
from fifesim.base.footprints import Boxcar, axis_operator
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.spatial import (
    Difference,
    GaussianSpread,
    Mixture,
    SystemSpread,
    TableSpread,
)
from fifesim.sensor.response.spectral import GREY, GREY_SHARE, band_weights, best_linear, covered_steps, line_between


def operator_of(spread, cells, cell, origin, pixel):
    """First cell and weights of one pixel."""
    operator = axis_operator(
        spread, cell_origin=0.0, cell_size=cell, n_cells=cells, pixel_origin=origin, pixel_size=pixel, n_pixels=1
    )
    return operator.start[0], operator.weights[0, : operator.count[0]]


def test_image_has_the_whole_response_and_is_not_mirrored():
    """Each cell is seen with the response at its distance from the pixel centre, positive to the right."""
    # Like a measured table: asymmetric, with negative lobes.
    positions = -31.0, -19.0, -12.5, -3.0, 4.0, 11.0, 17.0, 26.0, 38.0
    values = 0.0, -0.02, 0.31, 0.93, 1.0, 0.7, 0.2, -0.03, 0.0
    spread = TableSpread(positions, values)
    start, found = operator_of(spread, 601, 1.0, origin=285.5, pixel=30.0)
    places = start + (np.arange(found.size * 100) + 0.5) / 100 - (285.5 + 15.0)
    density = np.interp(places, positions, values, left=0.0, right=0.0) / np.trapezoid(values, positions) / 100
    # The midpoint rule is accurate to 1e-6.
    np.testing.assert_allclose(found, density.reshape(-1, 100).sum(axis=1), rtol=0, atol=1e-6)
    assert found.sum() == pytest.approx(1.0, abs=1e-6) and abs(found - found[::-1]).max() > 0.001


def sampled_contrast(spread, frequency, recorded, cell=10.0, pixel=30.0):
    """Contrast of a recorded wave, sampled at cell centres and averaged with a line spread function."""
    cells = 400
    start, weights = operator_of(spread, cells, cell, cells * cell / 2 - pixel / 2, pixel)
    places = (start + np.arange(weights.size) + 0.5) * cell - cells * cell / 2
    return float(recorded.mtf(frequency)) * float(weights @ np.cos(2 * np.pi * frequency * places))


@pytest.mark.parametrize("frequency", [0.0, 0.004, 1 / 60, 0.03])
@pytest.mark.parametrize("target", [GaussianSpread(36.0), SystemSpread((Boxcar(30.0), GaussianSpread(12.0)))])
def test_resensed_image_has_the_contrast_of_the_target_instrument(frequency, target):
    """An image with 10 m cells, averaged with the difference, has the contrast of the target times `left`."""
    recorded = GaussianSpread(14.0)
    difference = Difference(target, Mixture((1.0,), ((recorded, Boxcar(10.0)),)), 0.2)
    found = sampled_contrast(SystemSpread((difference,)), frequency, recorded)
    expected = float(difference.left(frequency) * target.mtf(frequency))
    # 0.1 % of the response is truncated, and cell sampling causes aliasing.
    assert found == pytest.approx(expected, abs=6e-3)
    assert float(difference.left(frequency)) > 0.85
    blurred_twice = sampled_contrast(target, frequency, recorded)
    assert frequency == 0 or abs(blurred_twice - expected) > abs(found - expected)


def test_unrecorded_contrast_is_not_amplified():
    difference = Difference(Boxcar(1.0), Boxcar(30.0), 0.2)
    frequency = np.linspace(0, 0.2, 4001)
    assert np.max(np.abs(difference.mtf(frequency))) <= (1 + 0.2**2) / (2 * 0.2)
    assert float(difference.mtf(1 / 30)) == pytest.approx(0.0, abs=1e-12)
    assert float(difference.left(0.0)) == 1 and float(difference.mtf(0.0)) == 1
    assert np.all(difference.left(frequency) <= 1)


def test_mixture_mtf_is_the_weighted_sum_of_bands():
    """The MTF of each band is the product of its parts."""
    mixture = Mixture((1.3, -0.3), ((GaussianSpread(20.0), Boxcar(10.0)), (Boxcar(20.0),)))
    frequency = np.array([0.0, 0.01, 0.04])
    expected = 1.3 * GaussianSpread(20.0).mtf(frequency) * np.sinc(10 * frequency) - 0.3 * np.sinc(20 * frequency)
    np.testing.assert_allclose(mixture.mtf(frequency), expected, rtol=1e-14)


# ------------------------------------------------------------------------------------------ band weights

TRIANGLE = Band("triangle", (0.5, 0.6, 0.7), (0.0, 1.0, 0.0))
BANDS = [band.response for name in ("OLI", "MSI", "TM") for band in instrument(name).bands]


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
def test_band_mean_is_the_integral_of_the_interpolated_spectrum(sun):
    """Leaf spectrum in steps of 5 to 11 nm that do not coincide with nodes of the responses or the sun."""
    fine, reflectance, _ = leaf_spectrum(Leaf())
    wavelength = 0.4 + np.cumsum([0.0, *np.linspace(0.005, 0.0111, 260)])
    wavelength = wavelength[wavelength < 2.5]
    values = np.interp(wavelength, fine, reflectance)
    for band in BANDS:
        found = band_weights(band, wavelength, covered_steps(wavelength), sun=sun)
        assert (found.coverage, found.weights.sum()) == pytest.approx((1, 1), abs=1e-12)
        assert found.weights @ values == pytest.approx(by_quadrature(band, wavelength, values, sun), rel=1e-9)


def test_coverage_of_a_partly_sampled_band():
    found = band_weights(TRIANGLE, [0.3, 0.6], [True], sun=False)
    assert (found.coverage, found.weights.sum()) == pytest.approx((0.5, 1), abs=1e-12)
    np.testing.assert_allclose(found.missing, [(0.6, 0.7)])
    found = band_weights(TRIANGLE, [0.8, 0.9], [True])
    assert (found.coverage, found.weights.tolist()) == (0.0, [0.0, 0.0])


def test_gap_has_no_weight_and_is_reported():
    wavelength = np.round(np.arange(0.45, 0.755, 0.01), 3)
    wavelength = wavelength[(wavelength <= 0.58) | (wavelength >= 0.63)]
    found = band_weights(TRIANGLE, wavelength, covered_steps(wavelength), sun=False)
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


def test_error_of_other_bands_equals_explicit_leave_one_out():
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
