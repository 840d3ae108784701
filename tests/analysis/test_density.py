"""Kernel densities beside those of scipy."""

import numpy as np
import pytest
from scipy import stats

from fifesim.analysis import scaling


def test_density_agrees_with_scipy():
    samples = np.random.default_rng(4).gamma(3.0, 0.3, 300)
    at = np.linspace(0, 3, 50)
    theirs = stats.gaussian_kde(samples, bw_method=0.1 / samples.std(ddof=1))
    np.testing.assert_allclose(scaling.gaussian_density(samples, at, 0.1), theirs(at), rtol=1e-10)
    weights = np.random.default_rng(5).integers(1, 9, 300)
    theirs = stats.gaussian_kde(np.repeat(samples, weights), bw_method=0.1 / np.repeat(samples, weights).std(ddof=1))
    np.testing.assert_allclose(scaling.gaussian_density(samples, at, 0.1, weights), theirs(at), rtol=1e-10)


def test_density_of_samples_takes_the_rule_of_thumb():
    samples = np.random.default_rng(6).normal(0, 1, 500)
    spread = min(samples.std(ddof=1), stats.iqr(samples) / 1.34)
    theirs = stats.gaussian_kde(samples, bw_method=0.9 * spread * 500**-0.2 / samples.std(ddof=1))
    at = np.linspace(-3, 3, 40)
    np.testing.assert_allclose(scaling.sample_density(samples, at), theirs(at), rtol=1e-10)


def test_reflected_density_has_all_its_mass_above_zero():
    """That of the samples and their mirror images, twice: scipy's. Without, a part of the mass lies below zero."""
    samples = np.abs(np.random.default_rng(8).normal(0, 1, 400))
    theirs = stats.gaussian_kde(np.r_[samples, -samples], bw_method=0.2 / np.r_[samples, -samples].std(ddof=1))
    at = np.linspace(0, 6, 901)
    found = scaling.gaussian_density(samples, at, 0.2, reflect=True)
    np.testing.assert_allclose(found, 2 * theirs(at), rtol=1e-10)
    assert np.trapezoid(found, at) == pytest.approx(1, abs=1e-6)
    assert np.trapezoid(scaling.gaussian_density(samples, at, 0.2), at) < 0.95
    np.testing.assert_array_equal(scaling.gaussian_density(samples, np.array([-0.1, -1e-9]), 0.2, reflect=True), 0.0)
    bandwidth = scaling.silverman_bandwidth(samples.std(ddof=1), stats.iqr(samples), 400)
    mine = scaling.gaussian_density(samples, at, bandwidth, reflect=True)
    np.testing.assert_allclose(scaling.sample_density(samples, at, reflect=True), mine, rtol=1e-12)


def test_what_is_negative_is_not_reflected():
    with pytest.raises(ValueError, match=r"at least 0 to be reflected there, got -0\.5"):
        scaling.gaussian_density(np.array([1.0, -0.5]), np.array([0.0]), 0.1, reflect=True)


def test_weights_stand_for_values_that_come_again():
    at = np.linspace(-1, 3, 9)
    weighted = scaling.gaussian_density(np.array([0.0, 2.0]), at, 0.7, weights=np.array([1.0, 3.0]))
    np.testing.assert_allclose(weighted, scaling.gaussian_density(np.array([0.0, 2, 2, 2]), at, 0.7), rtol=1e-14)


def test_parts_of_many_samples_add_up(monkeypatch):
    samples, at = np.random.default_rng(2).normal(size=50), np.linspace(-3, 3, 7)
    whole = scaling.gaussian_density(samples, at, 0.3)
    monkeypatch.setattr(scaling, "_PART", 7)
    np.testing.assert_allclose(scaling.gaussian_density(samples, at, 0.3), whole, rtol=1e-13)


def test_bandwidth_falls_with_the_fifth_root_of_the_number():
    """The narrower of the two spreads counts, and a deviation stands for an empty interquartile range."""
    assert scaling.silverman_bandwidth(1.0, 1.34 * 0.5, 32.0) == pytest.approx(0.9 * 0.5 / 2, rel=1e-12)
    assert scaling.silverman_bandwidth(1.0, 0.0, 1.0) == pytest.approx(0.9, rel=1e-12)


def test_samples_without_a_density_are_refused():
    with pytest.raises(ValueError, match="at least 2 values"):
        scaling.sample_density(np.array([1.0, np.nan]), np.array([0.0]))
    with pytest.raises(ValueError, match="bandwidth must be positive, got 0: do the samples vary"):
        scaling.sample_density(np.array([1.0, 1.0]), np.array([0.0]))
