"""Tests of the autoregressive process: spectrum, variance and correlation length by other methods."""

import numpy as np
import pytest
from oracles_field import covariances
from scipy import fft, sparse, stats
from scipy.sparse.linalg import spsolve

import fifesim
from fifesim.ground.landscape.autoregression import (
    FIELD_TILE,
    LARGEST_STREAMING_ARP,
    _box_muller,
    autocorrelation,
    field_seed,
    field_variance,
    margin,
    periodic_field,
    philox,
    response,
    streaming_field,
    white_noise,
    window_field,
)

ARPS = [0.05, 0.1, 0.15, 0.2, 0.24]


@pytest.mark.parametrize("arp", ARPS)
def test_variance_and_autocorrelation_are_transforms_of_the_squared_response(arp):
    expected = covariances(arp)
    assert field_variance(arp) == pytest.approx(expected[0, 0], rel=1e-12)
    np.testing.assert_allclose(autocorrelation(arp, np.arange(60)), expected[0, :60] / expected[0, 0], atol=1e-12)


def test_autocorrelation_is_5_percent_at_the_correlation_length():
    """Correlation lengths of whole numbers of cells, which need no interpolation."""
    for cells in (1, 2, 5, 9, 20):
        arp = fifesim.ground.arp_for_length(cells)
        assert autocorrelation(arp, cells) == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("cell", [1.0, 10 / 3])
def test_arp_for_length_inverts_correlation_length(cell):
    arps = np.array([0.001, 0.05, 0.15, 0.24, 0.249, LARGEST_STREAMING_ARP])
    lengths = [fifesim.ground.correlation_length(arp, cell) for arp in arps]
    assert np.all(np.diff(lengths) > 0)
    np.testing.assert_allclose([fifesim.ground.arp_for_length(length, cell) for length in lengths], arps, rtol=1e-9)
    assert fifesim.ground.correlation_length(0.0) == fifesim.ground.arp_for_length(0.0) == 0.0


def test_response_has_decayed_at_the_margin():
    """Response to a unit impulse along a row at frequency zero of the other axis, by an inverse FFT."""
    for arp in ARPS:
        cells = margin(arp)
        impulse = np.fft.ifft(1 / (1 - 2 * arp * (1 + np.cos(2 * np.pi * np.fft.fftfreq(4096))))).real
        assert impulse[cells] < 2e-8 * impulse[0]


# Counter, key and answer from kat_vectors of Random123 1.14.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


def words(text):
    return np.array([int(word, 16) for word in text.split()], np.uint64)


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_philox_gives_the_published_answers(counter, key, answer):
    np.testing.assert_array_equal(philox(*words(counter), *words(key)), words(answer))


def test_box_muller_agrees_with_double_precision():
    """Rounding of u near 1 is 6e-8 under the root, and 6e-6 where the root is 0.01."""
    rng = np.random.default_rng(4)
    one, other = (rng.integers(0, 2**32, 20_000, dtype=np.uint32) for _ in range(2))
    one[:3] = 0, 1, 2**32 - 1
    memory, found = np.empty((2, one.size), np.float32), np.empty((2, one.size), np.float32)
    _box_muller(one, other, memory[0], memory[0].view(np.int32), memory[1], *found)
    expected = np.sqrt(-2 * np.log((one + 0.5) / 2**32))
    clear = expected > 0.01
    np.testing.assert_allclose(np.hypot(*found.astype(float))[clear], expected[clear], rtol=0, atol=6e-6)
    assert np.isfinite(found).all()
    # Angles are uniform over the circle: two bits give the quadrant and the other bits the angle within it.
    angle = np.arctan2(*found.astype(float))[clear] / (2 * np.pi)
    assert stats.kstest(angle % 1, "uniform").pvalue > 0.001


def test_noise_is_standard_normal():
    """Moments within four standard errors; Kolmogorov-Smirnov distance at a significance of 0.001."""
    noise = white_noise(3, -700, 5, (2000, 1500)).astype(float).ravel()
    n = noise.size
    assert noise.mean() == pytest.approx(0, abs=4 / np.sqrt(n))
    assert noise.var() == pytest.approx(1, abs=4 * np.sqrt(2 / n))
    assert stats.skew(noise) == pytest.approx(0, abs=4 * np.sqrt(6 / n))
    assert stats.kurtosis(noise) == pytest.approx(0, abs=4 * np.sqrt(24 / n))
    assert stats.kstest(noise, "norm").statistic < 1.95 / np.sqrt(n)


@pytest.mark.parametrize("shift", [(0, 1), (0, 2), (0, 3), (0, 4), (1, 0), (1, 1), (4, 1)])
def test_neighbouring_noise_is_independent(shift):
    """Values and squares, since the four numbers of a block come from two pairs."""
    noise = white_noise(3, 0, 0, (1000, 1000)).astype(float)
    down, across = shift
    here, there = noise[down:, across:], noise[: 1000 - down, : 1000 - across]
    assert np.corrcoef(here.ravel(), there.ravel())[0, 1] == pytest.approx(0, abs=4e-3)
    assert np.corrcoef(here.ravel() ** 2, there.ravel() ** 2)[0, 1] == pytest.approx(0, abs=4e-3)


@pytest.mark.parametrize("column", [-9, -1, 0, 1, 2, 3, 2**33])
def test_noise_windows_equal_slices_at_any_column(column):
    whole = white_noise(2**63, -2, column, (6, 21))
    for skip in range(5):
        np.testing.assert_array_equal(white_noise(2**63, 0, column + skip, (3, 8)), whole[2:5, skip : skip + 8])


SIZE = 4 * FIELD_TILE


def standard_error(arp, cells):
    """Upper bound of the standard error of a covariance over the variance, by Bartlett's formula."""
    # The variance of a covariance at lag d is (sum over lags h of c(h)**2 + c(h + d) c(h - d)) / cells.
    correlations = covariances(arp) / covariances(arp)[0, 0]
    return np.sqrt(2 * np.sum(correlations**2) / cells)


@pytest.fixture(scope="module", params=ARPS)
def arp_and_field(request):
    return request.param, streaming_field(20, request.param, -SIZE // 2, 17, (SIZE, SIZE))


def test_field_agrees_with_the_analytic_moments(arp_and_field):
    """Four standard errors: with 70 comparisons a false alarm has a probability of 0.4 %."""
    arp, field = arp_and_field
    error = standard_error(arp, field.size)
    assert np.mean(field**2) == pytest.approx(1, abs=4 * error)
    lags = np.array([1, 2, 3, 5, 10, 40])
    expected = autocorrelation(arp, lags)
    rows = [np.mean(field[:-lag] * field[lag:]) for lag in lags]
    columns = [np.mean(field[:, :-lag] * field[:, lag:]) for lag in lags]
    np.testing.assert_allclose(rows, expected, rtol=0, atol=4 * error)
    np.testing.assert_allclose(columns, expected, rtol=0, atol=4 * error)
    # The variance of the mean is the spectral density at frequency zero over the number of cells.
    error = np.sqrt(response(arp, 0, 0) ** 2 / field_variance(arp) / field.size)
    assert field.mean() == pytest.approx(0, abs=4 * error)


def test_spectrum_follows_the_response(arp_and_field):
    """Power over squared response is 1 in rings of frequency, computed from half of the symmetric plane."""
    arp, field = arp_and_field
    # The Hann window reduces leakage, and correlates (3/2)**2 neighbouring frequencies along each axis.
    window = np.hanning(SIZE + 1)[:-1]
    power = np.abs(fft.rfft2(field * window[:, None] * window)) ** 2 / np.sum(window**2) ** 2
    down, across = 2 * np.pi * fft.fftfreq(SIZE)[:, None], 2 * np.pi * fft.rfftfreq(SIZE)
    ratio = power * field_variance(arp) / response(arp, down, across) ** 2
    ring = np.minimum(np.hypot(down, across) * (8 / np.pi), 7).astype(int).ravel()
    cells = np.bincount(ring)
    means, errors = np.bincount(ring, ratio.ravel()) / cells, np.sqrt((3 / 2) ** 4 / cells)
    assert len(cells) == 8 and (np.abs(means - 1) < 4 * errors).all()


@pytest.mark.parametrize("arp", [0.1, 0.15, 0.24])
def test_field_solves_its_equation_across_tiles(arp):
    """
    Linear system x = e + arp (sum of four neighbours) across four tiles; the noise e is the field at arp 0. Edges decay
    as exp(-d arccosh(1 / (2 arp) - 1)): 5e-13 after 70 cells at arp 0.24. Errors of single precision are 3e-7 of the
    standard deviation rms and 2e-6 at most.
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
def test_errors_of_single_precision(arp):
    """The same noise on the same torus, filtered in double precision; rms and largest error."""
    around = margin(arp)
    size = fft.next_fast_len(FIELD_TILE + 2 * around, real=True)
    noise = white_noise(3, -around, -around, (size, size)).astype(float)
    u = 2 * np.pi * np.fft.fftfreq(size)
    double = np.fft.ifft2(np.fft.fft2(noise) * response(arp, u[:, None], u)).real / np.sqrt(field_variance(arp))
    double = double[around : around + FIELD_TILE, around : around + FIELD_TILE]
    single = streaming_field(3, arp, 0, 0, (FIELD_TILE, FIELD_TILE))
    assert np.sqrt(np.mean((single - double) ** 2)) < 3e-7
    np.testing.assert_allclose(single, double, rtol=0, atol=2e-6)


@pytest.mark.parametrize("arp", [0.15, LARGEST_STREAMING_ARP])
def test_field_windows_equal_slices(arp):
    """Across tile edges, on both sides of the lattice's origin."""
    whole = streaming_field(7, arp, -40, FIELD_TILE - 60, (100, 130))
    windows = [(0, 0, 100, 130), (39, 59, 3, 3), (40, 60, 1, 1), (99, 0, 1, 130), (7, 11, 60, 90)]
    for row, column, height, width in windows:
        part = streaming_field(7, arp, row - 40, column + FIELD_TILE - 60, (height, width))
        np.testing.assert_array_equal(part, whole[row : row + height, column : column + width])


def test_seeds_give_uncorrelated_fields():
    """The last three seeds are equal if rounded to double precision."""
    seeds = (0, 1, 2**63 - 3, 2**63 - 2, 2**63 - 1)
    for fields in (
        [streaming_field(seed, 0.0, 0, 0, (400, 400)) for seed in seeds],
        [periodic_field(seed, 0.0, (400, 400)) for seed in seeds],
    ):
        correlations = np.corrcoef([field.ravel() for field in fields])
        np.testing.assert_allclose(correlations, np.eye(5), rtol=0, atol=4 / 400)


def test_noise_at_opposite_places_is_uncorrelated():
    """Negative block numbers become counters from 2**64 down."""
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
def test_arp_of_a_process_that_is_not_stationary_is_refused(arp):
    for call in (
        lambda: streaming_field(1, arp, 0, 0, (2, 2)),
        lambda: periodic_field(1, arp, (2, 2)),
        lambda: fifesim.ground.correlation_length(arp),
    ):
        with pytest.raises(ValueError, match=r"arp must be in \[0, 0\.25\), got"):
            call()


def test_streaming_refuses_arps_and_lengths_with_too_large_a_margin():
    with pytest.raises(ValueError, match=r"in \[0, 0\.2498\], got 0\.2499: use method=\"periodic\""):
        streaming_field(1, 0.2499, 0, 0, (2, 2))
    assert np.isfinite(periodic_field(1, 0.2499, (50, 50))).all()
    with pytest.raises(ValueError, match="use larger cells for a longer range"):
        fifesim.ground.arp_for_length(1e6)


def test_each_name_and_seed_has_different_noise():
    seeds = {field_seed(seed, name) for seed in (0, 1) for name in ("lai", "soil", "moisture", "brown")}
    assert len(seeds) == 8
    assert field_seed(2**63 - 1, "lai") == 2**63 - 1


@pytest.mark.parametrize("arp", [0.0, 0.15, 0.24])
def test_window_field_equals_the_tiled_field(arp):
    """Across the corner of four tiles."""
    found = window_field(20, arp, -50, FIELD_TILE - 40, (90, 70))
    np.testing.assert_allclose(found, streaming_field(20, arp, -50, FIELD_TILE - 40, (90, 70)), rtol=0, atol=1e-5)
