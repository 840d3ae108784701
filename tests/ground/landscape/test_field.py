"""The autoregressive field against its own equations, solved by other routes."""

import numpy as np
import pytest
from oracles_field import covariances
from scipy import fft, sparse, stats
from scipy.sparse.linalg import spsolve

import fifesim
from fifesim.ground.canopy.reflectance_table import canopy_reflectance
from fifesim.ground.landscape.autoregression import (
    FIELD_TILE,
    LARGEST_STREAMING_ARP,
    autocorrelation,
    field_variance,
    margin,
    mixed_field,
    periodic_field,
    response,
    streaming_field,
    white_noise,
    window_field,
)
from fifesim.ground.landscape.distribution import lai_distribution, quantile_map, quantile_table

ARPS = [0.05, 0.1, 0.15, 0.2, 0.24]
SIZE = 4 * FIELD_TILE


def standard_error(arp, cells):
    """
    Largest standard error of a covariance or variance estimated from so many cells, in variances.

    Bartlett's: the variance of an estimated covariance is (sum of c(h)**2 + c(h + d) c(h - d)) / cells over all lags h,
    at most 2 / (independent cells), with cells / sum of squared correlations of them.
    """
    correlations = covariances(arp) / covariances(arp)[0, 0]
    return np.sqrt(2 * np.sum(correlations**2) / cells)


@pytest.fixture(scope="module", params=ARPS)
def arp_and_field(request):
    return request.param, streaming_field(20, request.param, -SIZE // 2, 17, (SIZE, SIZE))


def test_field_agrees_with_the_analytic_moments(arp_and_field):
    """Four standard errors: with 60 comparisons a false alarm has a probability of 0.4 %."""
    arp, field = arp_and_field
    error = standard_error(arp, field.size)
    assert np.mean(field**2) == pytest.approx(1, abs=4 * error)
    lags = np.array([1, 2, 3, 5, 10, 40])
    expected = autocorrelation(arp, lags)
    rows = [np.mean(field[:-lag] * field[lag:]) for lag in lags]
    columns = [np.mean(field[:, :-lag] * field[:, lag:]) for lag in lags]
    np.testing.assert_allclose(rows, expected, rtol=0, atol=4 * error)
    np.testing.assert_allclose(columns, expected, rtol=0, atol=4 * error)


def test_mean_is_zero(arp_and_field):
    """The variance of the mean is the spectrum at frequency zero over the number of cells."""
    arp, field = arp_and_field
    error = np.sqrt(response(arp, 0, 0) ** 2 / field_variance(arp) / field.size)
    assert field.mean() == pytest.approx(0, abs=4 * error)


def test_spectrum_follows_the_response(arp_and_field):
    """
    Power over squared response, averaged in rings of frequency, is 1.

    A Hann window keeps the ends from leaking. It ties (3/2)**2 neighbouring frequencies along each axis to each other.
    Half of the plane mirrors the other, and is not looked at.
    """
    arp, field = arp_and_field
    window = np.hanning(SIZE + 1)[:-1]
    power = np.abs(fft.rfft2(field * window[:, None] * window)) ** 2 / np.sum(window**2) ** 2
    down, across = 2 * np.pi * fft.fftfreq(SIZE)[:, None], 2 * np.pi * fft.rfftfreq(SIZE)
    ratio = power * field_variance(arp) / response(arp, down, across) ** 2
    ring = np.minimum(np.hypot(down, across) * (8 / np.pi), 7).astype(int).ravel()
    cells = np.bincount(ring)
    means, errors = np.bincount(ring, ratio.ravel()) / cells, np.sqrt((3 / 2) ** 4 / cells)
    assert len(cells) == 8 and (np.abs(means - 1) < 4 * errors).all()


def test_without_interaction_the_field_is_white():
    field = streaming_field(3, 0.0, 5, -9, (1000, 1000))
    error = 4 / np.sqrt(field.size)
    for down, across in [(0, 1), (1, 0), (1, 1), (2, 1), (72, 0), (0, 504)]:
        product = field[down:, across:] * field[: 1000 - down, : 1000 - across]
        assert product.mean() == pytest.approx(0, abs=1.5 * error)
    assert stats.kstest(field.ravel(), "norm").statistic < 1.95 / 1000


@pytest.mark.parametrize("arp", [0.1, 0.15, 0.24])
def test_seams_of_tiles_solve_the_equation(arp):
    """
    The linear system x = e + arp (sum of four neighbours) on a patch across four tiles, away from its own borders.

    The noise is the field without interaction. Borders reach in as exp(-d arccosh(1 / (2 arp) - 1)): 5e-13 after 70
    cells at arp 0.24. Single precision leaves 3e-7 of the standard deviation rms, 2e-6 at most.
    """
    half, reach = 110, 70
    first, size = FIELD_TILE - half, 2 * half
    noise = streaming_field(11, 0.0, first, -half, (size, size))
    path = sparse.diags_array([np.ones(size - 1)] * 2, offsets=[-1, 1])
    neighbours = sparse.kronsum(path, path)
    system = (sparse.eye_array(size**2) - arp * neighbours).tocsc()
    solved = spsolve(system, noise.ravel()).reshape(size, size) / np.sqrt(field_variance(arp))
    inside = slice(reach, -reach)
    field = streaming_field(11, arp, first, -half, (size, size))
    np.testing.assert_allclose(field[inside, inside], solved[inside, inside], rtol=0, atol=2e-6)


@pytest.mark.parametrize("arp", [0.05, 0.24])
def test_single_precision_moves_cells_and_reflectances_by_as_little_as_is_said(arp):
    """The same noise on the same torus, filtered in double precision."""
    around = margin(arp)
    size = fft.next_fast_len(FIELD_TILE + 2 * around, real=True)
    noise = white_noise(3, -around, -around, (size, size)).astype(float)
    u = 2 * np.pi * np.fft.fftfreq(size)
    double = np.fft.ifft2(np.fft.fft2(noise) * response(arp, u[:, None], u)).real / np.sqrt(field_variance(arp))
    double, single = (
        double[around : around + FIELD_TILE, around : around + FIELD_TILE],
        streaming_field(3, arp, 0, 0, (FIELD_TILE, FIELD_TILE)),
    )
    assert np.sqrt(np.mean((single - double) ** 2)) < 3e-7
    np.testing.assert_allclose(single, double, rtol=0, atol=2e-6)
    table = quantile_table(lai_distribution("burned-grazed"))
    seen = [
        canopy_reflectance(quantile_map(field, table), [0.07, 0.45], [0.04, 0.42], [0.15, 0.2], sza=28.5)
        for field in (single, double)
    ]
    np.testing.assert_allclose(*seen, rtol=0, atol=6e-8)


@pytest.mark.parametrize("arp", [0.15, LARGEST_STREAMING_ARP])
def test_window_is_a_slice_of_the_whole(arp):
    """Across tile seams, on both sides of the lattice's origin."""
    whole = streaming_field(7, arp, -40, FIELD_TILE - 60, (100, 130))
    for row, column, height, width in [
        (0, 0, 100, 130),
        (39, 59, 3, 3),
        (40, 60, 1, 1),
        (99, 0, 1, 130),
        (7, 11, 60, 90),
    ]:
        part = streaming_field(7, arp, row - 40, column + FIELD_TILE - 60, (height, width))
        np.testing.assert_array_equal(part, whole[row : row + height, column : column + width])


def test_seeds_give_unrelated_fields():
    """The last three are the same number in double precision."""
    seeds = (0, 1, 2**63 - 3, 2**63 - 2, 2**63 - 1)
    for fields in (
        [streaming_field(seed, 0.0, 0, 0, (400, 400)) for seed in seeds],
        [periodic_field(seed, 0.0, (400, 400)) for seed in seeds],
    ):
        correlations = np.corrcoef([field.ravel() for field in fields])
        np.testing.assert_allclose(correlations, np.eye(5), rtol=0, atol=4 / 400)


def test_opposite_places_are_not_the_same():
    """Block numbers below zero are counters from 2**64 down."""
    here, there = streaming_field(7, 0.0, 0, 0, (200, 200)), streaming_field(7, 0.0, -200, -200, (200, 200))
    assert abs(np.corrcoef(here.ravel(), there.ravel())[0, 1]) < 4 / 200
    assert abs(np.corrcoef(here.ravel(), there[::-1, ::-1].ravel())[0, 1]) < 4 / 200


@pytest.mark.parametrize("arp", ARPS)
def test_periodic_field_solves_the_equation_on_a_torus(arp):
    shape = (90, 70)
    noise = periodic_field(5, 0.0, shape)
    field = periodic_field(5, arp, shape) * np.sqrt(field_variance(arp))
    neighbours = sum(np.roll(field, step, axis) for step in (-1, 1) for axis in (0, 1))
    np.testing.assert_allclose(field - arp * neighbours, noise, rtol=0, atol=1e-12)


@pytest.mark.parametrize("arp", [-0.01, 0.25, 0.3, np.nan])
def test_process_that_is_not_stationary_is_refused(arp):
    for call in (
        lambda: streaming_field(1, arp, 0, 0, (2, 2)),
        lambda: periodic_field(1, arp, (2, 2)),
        lambda: fifesim.correlation_length(arp),
    ):
        with pytest.raises(ValueError, match=r"arp must be in \[0, 0\.25\), got"):
            call()


def test_streaming_stops_before_its_margin_grows_without_bound():
    with pytest.raises(ValueError, match=r"at most 0\.2498.*method=\"periodic\""):
        streaming_field(1, 0.2499, 0, 0, (2, 2))
    assert np.isfinite(periodic_field(1, 0.2499, (50, 50))).all()


def test_field_of_mixed_noise_is_the_mixture_of_fields():
    """The filter is linear; single precision rounds each by 3e-7 rms."""
    window = 0.15, FIELD_TILE - 20, -30, (50, 60)
    one, other = (streaming_field(seed, *window) for seed in (7, 8))
    found = mixed_field({7: 0.6, 8: -0.8}, *window)
    np.testing.assert_allclose(found, 0.6 * one - 0.8 * other, rtol=0, atol=5e-6)
    np.testing.assert_array_equal(mixed_field({7: 1.0}, *window), one)


@pytest.mark.parametrize("arp", [0.0, 0.15, 0.24])
def test_window_filtered_by_itself_has_the_cells_of_the_tiles(arp):
    """Across the corner of four tiles."""
    found = window_field(20, arp, -50, FIELD_TILE - 40, (90, 70))
    np.testing.assert_allclose(found, streaming_field(20, arp, -50, FIELD_TILE - 40, (90, 70)), rtol=0, atol=1e-5)
