"""The autoregressive process: its spectrum, its variance and its lengths by other routes."""

from functools import partial

import numpy as np
import pytest
from oracles_field import covariances
from scipy import special

import fifesim
from fifesim.ground.landscape.autoregression import (
    LARGEST_STREAMING_ARP,
    autocorrelation,
    correlation_length,
    field_variance,
    margin,
)

ARPS = [0.05, 0.1, 0.15, 0.2, 0.24]


@pytest.mark.parametrize("arp", ARPS)
def test_variance_is_the_integral_of_the_squared_response(arp):
    assert field_variance(arp) == pytest.approx(covariances(arp)[0, 0], rel=1e-12)


@pytest.mark.parametrize("arp", ARPS)
def test_autocorrelation_is_the_transform_of_the_squared_response(arp):
    expected = covariances(arp)
    np.testing.assert_allclose(autocorrelation(arp, np.arange(60)), expected[0, :60] / expected[0, 0], atol=1e-12)


def test_correlation_has_fallen_to_5_percent_at_the_correlation_length():
    """Where the length is a whole number of cells, nothing is interpolated."""
    for cells in (1, 2, 5, 9, 20):
        arp = fifesim.arp_for_length(cells)
        assert autocorrelation(arp, cells) == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("cell", [1.0, 10 / 3])
def test_length_and_arp_are_inverse(cell):
    arps = np.array([0.001, 0.05, 0.15, 0.24, 0.249, LARGEST_STREAMING_ARP])
    lengths = [fifesim.correlation_length(arp, cell) for arp in arps]
    assert np.all(np.diff(lengths) > 0)
    np.testing.assert_allclose([fifesim.arp_for_length(length, cell) for length in lengths], arps, rtol=1e-9)
    assert fifesim.correlation_length(0.0) == fifesim.arp_for_length(0.0) == 0.0


def test_margin_holds_the_response():
    """What a unit impulse leaves at the margin, by quadrature of the response along a row at the lowest frequency."""
    for arp in ARPS:
        cells = margin(arp)
        impulse = np.fft.ifft(1 / (1 - 2 * arp * (1 + np.cos(2 * np.pi * np.fft.fftfreq(4096))))).real
        assert impulse[cells] < 2e-8 * impulse[0]


@pytest.mark.parametrize("function", [field_variance, correlation_length, partial(autocorrelation, lag=0)])
@pytest.mark.parametrize("arp", [-0.01, 0.25, 0.3, np.nan])
def test_what_is_not_stationary_is_refused(function, arp):
    with pytest.raises(ValueError, match="the four-neighbour process is not stationary"):
        function(arp)


def test_length_beyond_streaming_is_refused():
    with pytest.raises(ValueError, match="use larger cells for a longer range"):
        fifesim.arp_for_length(1e6)


def test_variance_of_the_paper_smoothest_field():
    """k = 0.96: the elliptic integral by its series, to the digits that 400 terms give."""
    k2, n = 0.96**2, np.arange(400)
    ratio = np.exp(2 * (special.gammaln(2 * n + 1) - 2 * special.gammaln(n + 1) - 2 * n * np.log(2)))
    integral = np.pi / 2 * np.sum(ratio * k2**n / (1 - 2 * n))
    assert field_variance(0.24) == pytest.approx(2 / np.pi * integral / (1 - k2), rel=1e-12)
