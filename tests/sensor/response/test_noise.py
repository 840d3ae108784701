"""Noise of a uniform scene compared with its model, and independence of the draws."""

import numpy as np
import pytest

from fifesim.sensor.response.noise import NoiseModel, add_noise, check_kinds, fixed_pattern, line_noise, radiance_std

SHAPE = (300, 400)
MODEL = NoiseModel(0.4, 0.01, detectors=16, gain_spread=0.004, offset_spread=0.2)
ALL = ["shot", "thermal", "fixed-pattern"]


def residual(radiance, kinds, model=MODEL, seed=5, band=2, **place):
    return add_noise(np.full(SHAPE, float(radiance)), model, kinds, seed=seed, band=band, **place) - radiance


@pytest.mark.parametrize(
    ("kinds", "variance"),
    [(["thermal"], lambda L: 0.16), (["shot"], lambda L: 0.01 * L), (["shot", "thermal"], lambda L: 0.16 + 0.01 * L)],
)
@pytest.mark.parametrize("radiance", [5.0, 60.0, 180.0])
def test_noise_of_a_uniform_scene_has_the_requested_variance(kinds, variance, radiance):
    """Standard deviation and mean within three standard errors of independent normal deviates."""
    noise = residual(radiance, kinds)
    sigma = np.sqrt(variance(radiance))
    assert abs(noise.std() - sigma) < 3 * sigma / np.sqrt(2 * noise.size)
    assert abs(noise.mean()) < 3 * sigma / np.sqrt(noise.size)
    for axis in (0, 1):
        lagged = np.mean(np.diff(noise, axis=axis) ** 2)
        # Neighbours are independent: the mean square of 119,000 differences has the relative error sqrt(3 / n).
        assert abs(lagged / (2 * sigma**2) - 1) < 3 * np.sqrt(3 / noise.size)


def test_model_reproduces_published_snr():
    """OLI red by hand, from (22 / 230)^2 and (150 / 950)^2: b = 1.233e-4 and c0 = 0.0802 W m-2 sr-1 um-1."""
    model = NoiseModel.from_snr([22.0, 150.0], [230.0, 950.0], detectors=6)
    np.testing.assert_allclose(model.snr([22.0, 60.0, 150.0]), [230, 510.3, 950], rtol=1e-3)
    np.testing.assert_allclose([model.thermal, model.shot, model.detectors], [0.0802, 1.233e-4, 6], rtol=1e-3)
    for share in (0.0, 0.4, 1.0, None):
        model = NoiseModel.from_snr(80.0, 200.0, share)
        assert float(model.snr(80.0)) == pytest.approx(200.0, rel=1e-12)
        # A quarter of the signal has half the shot noise and all other noise. By default, all is shot noise.
        shot = 1.0 if share is None else share
        expected = 0.4**2 * (shot / 4 + 1 - shot)
        assert float(model.noise_equivalent_radiance(20.0)) ** 2 == pytest.approx(expected, rel=1e-12)
    assert model.kinds == ("shot",) and float(model.noise_equivalent_radiance(0.0)) == 0.0


def test_fixed_pattern_repeats_with_the_detectors():
    """Rows of one detector have equal noise in a uniform scene."""
    noise = residual(100.0, ["fixed-pattern"])
    np.testing.assert_array_equal(noise, noise[:, :1] + np.zeros(SHAPE))
    np.testing.assert_array_equal(noise[16:], noise[:-16])
    assert np.unique(noise[:, 0].round(12)).size == 16
    gain, offset = fixed_pattern(MODEL, 5, 2)
    np.testing.assert_allclose(noise[:16, 0], 100 * (gain - 1) + offset, rtol=0, atol=1e-12)
    pushed = NoiseModel(0.0, 0.0, detectors=7000, gain_spread=0.004, along="columns")
    noise = residual(100.0, ["fixed-pattern"], pushed)
    np.testing.assert_array_equal(noise, noise[:1] + np.zeros(SHAPE))
    assert np.unique(noise[0]).size == SHAPE[1]


def test_fixed_pattern_has_the_given_spread():
    many = NoiseModel(0.0, 0.0, detectors=20000, gain_spread=0.004, offset_spread=0.2)
    gain, offset = fixed_pattern(many, 1, 0)
    assert abs(gain.std() - 0.004) < 3 * 0.004 / np.sqrt(2 * 20000)
    assert abs(offset.std() - 0.2) < 3 * 0.2 / np.sqrt(2 * 20000)
    assert abs(np.corrcoef(gain, offset)[0, 1]) < 3 / np.sqrt(20000)


@pytest.mark.parametrize("radiance", [2.0, 40.0, 300.0])
def test_propagated_noise_agrees_with_a_sample_of_detectors(radiance):
    """1 %: the standard error of 90,000 detectors is 0.24 %, after rounding to digital steps."""
    model = NoiseModel(0.3, 0.01, detectors=90_000, gain_spread=0.02, offset_spread=0.2, along="columns")
    measured = add_noise(np.full((1, 90_000), radiance), model, ALL, seed=4, band=1)
    expected = np.sqrt(np.mean((np.rint(measured / 0.5) * 0.5 - radiance) ** 2))
    assert radiance_std(radiance, model, tuple(ALL), 0.5) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("place", [(0, 0), (-40, -1500), (144_000, 23_566)])
def test_noise_does_not_depend_on_the_window(place):
    """Also across the tiles of 1024 pixels in which a line is drawn, and on both sides of the origin."""
    row, column = place
    scene = np.random.default_rng(0).uniform(10, 90, (50, 1200))
    whole = add_noise(scene, MODEL, ALL, seed=5, band=2, row=row, column=column)
    for y, x, height, width in ((0, 0, 7, 1200), (13, 1, 20, 40), (49, 990, 1, 210)):
        window = np.s_[y : y + height, x : x + width]
        found = add_noise(scene[window], MODEL, ALL, seed=5, band=2, row=row + y, column=column + x)
        np.testing.assert_array_equal(found, whole[window])


def test_seeds_bands_and_lines_are_independent():
    lines = [line_noise(*key, 0, 4000) for key in ((1, 0, 0), (2, 0, 0), (1, 1, 0), (1, 0, 1), (1, 0, -1))]
    # Ten pairs: four standard errors.
    assert np.abs(np.corrcoef(lines) - np.eye(5)).max() < 4 / np.sqrt(4000)


def test_no_kinds_give_no_noise_and_nan_is_kept():
    scene = np.array([[1.0, np.nan], [3.0, 4.0]])
    np.testing.assert_array_equal(add_noise(scene, MODEL, (), seed=1, band=0), scene)
    noisy = add_noise(scene, MODEL, ALL, seed=1, band=0)
    np.testing.assert_array_equal(np.isnan(noisy), np.isnan(scene))
    assert scene[0, 0] == 1.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: NoiseModel(-1.0, 0.0), "thermal must be at least 0 W m-2 sr-1 um-1, got -1"),
        (lambda: NoiseModel(1.0, np.inf), "shot must be at least 0 W m-2 sr-1 um-1, got inf"),
        (lambda: NoiseModel(1.0, 0.0, detectors=0), "detectors must be at least 1, got 0"),
        (lambda: NoiseModel(1.0, 0.0, along="lines"), "along must be .columns. or .rows., got .lines."),
        (lambda: NoiseModel.from_snr(80.0, 200.0, 40.0), "share of the variance"),
        (lambda: NoiseModel.from_snr([80.0, 20.0], [200.0, 300.0]), "negative variance of thermal"),
        (lambda: NoiseModel.from_snr([20.0, 200.0], [20.0, 300.0]), "negative variance of shot"),
        (lambda: NoiseModel.from_snr([20.0, 20.0], [20.0, 30.0]), "two radiances"),
        (lambda: NoiseModel.from_snr([20.0, 40.0], [20.0, 30.0], 0.5), "leave it out"),
        (lambda: NoiseModel.from_snr([20.0, -40.0], [20.0, 30.0]), "positive radiance"),
        (lambda: NoiseModel.from_snr(0.0, 200.0, 0.5), "positive radiance"),
        (lambda: NoiseModel.from_snr(80.0, 0.0, 0.5), "positive radiance"),
        (lambda: check_kinds(["shot", "speckle"]), "unknown noise speckle: there are shot, thermal, fixed-pattern"),
    ],
)
def test_invalid_noise_raises(call, message):
    with pytest.raises(ValueError, match=message):
        call()
