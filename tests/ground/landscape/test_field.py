"""The autoregressive field against its own equations, solved by other routes."""

import numpy as np
import pytest
from scipy import sparse, special, stats
from scipy.sparse.linalg import spsolve

import fifesim
from fifesim.ground.landscape import field as random_field
from fifesim.ground.landscape.field import autocorrelation, field_variance, periodic_field, response, streaming_field

ARPS = [0.05, 0.1, 0.15, 0.2, 0.24]
SIZE = 4 * random_field.TILE


def covariances(arp, size=512):
    """Covariances by lag on a torus, from the two-dimensional spectrum; the torus is many correlation lengths wide."""
    u = 2 * np.pi * np.fft.fftfreq(size)
    return np.fft.ifft2(response(arp, u[:, None], u) ** 2).real


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


@pytest.mark.parametrize("arp", ARPS)
def test_variance_is_the_integral_of_the_squared_response(arp):
    assert field_variance(arp) == pytest.approx(covariances(arp)[0, 0], rel=1e-12)


@pytest.mark.parametrize("arp", ARPS)
def test_autocorrelation_is_the_transform_of_the_squared_response(arp):
    expected = covariances(arp)
    np.testing.assert_allclose(autocorrelation(arp, np.arange(60)), expected[0, :60] / expected[0, 0], atol=1e-12)


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

    A Hann window keeps the ends from leaking. It ties (3/2)**2 neighbouring frequencies along each axis to each other,
    and half of the plane mirrors the other.
    """
    arp, field = arp_and_field
    window = np.hanning(SIZE + 1)[:-1]
    power = np.abs(np.fft.fft2(field * np.outer(window, window))) ** 2 / np.sum(np.outer(window, window) ** 2)
    u = 2 * np.pi * np.fft.fftfreq(SIZE)
    ratio = power * field_variance(arp) / response(arp, u[:, None], u) ** 2
    ring = np.digitize(np.hypot(u[:, None], u), np.linspace(0, np.pi, 9)[1:-1])
    for number in range(8):
        inside = ratio[ring == number]
        independent = inside.size / 2 / (3 / 2) ** 4
        assert inside.mean() == pytest.approx(1, abs=4 / np.sqrt(independent))


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
    first, size = random_field.TILE - half, 2 * half
    noise = streaming_field(11, 0.0, first, -half, (size, size))
    path = sparse.diags_array([np.ones(size - 1)] * 2, offsets=[-1, 1])
    neighbours = sparse.kronsum(path, path)
    system = (sparse.eye_array(size**2) - arp * neighbours).tocsc()
    solved = spsolve(system, noise.ravel()).reshape(size, size) / np.sqrt(field_variance(arp))
    inside = slice(reach, -reach)
    field = streaming_field(11, arp, first, -half, (size, size))
    np.testing.assert_allclose(field[inside, inside], solved[inside, inside], rtol=0, atol=2e-6)


@pytest.mark.parametrize("arp", [0.15, random_field.LARGEST_STREAMING_ARP])
def test_window_is_a_slice_of_the_whole(arp):
    """Across tile seams, on both sides of the lattice's origin."""
    tile = random_field.TILE
    whole = streaming_field(7, arp, -40, tile - 60, (100, 130))
    for row, column, height, width in [
        (0, 0, 100, 130),
        (39, 59, 3, 3),
        (40, 60, 1, 1),
        (99, 0, 1, 130),
        (7, 11, 60, 90),
    ]:
        part = streaming_field(7, arp, row - 40, column + tile - 60, (height, width))
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


def test_correlation_has_fallen_to_5_percent_at_the_correlation_length():
    """Where the length is a whole number of cells, nothing is interpolated."""
    for cells in (1, 2, 5, 9, 20):
        arp = fifesim.arp_for_length(cells)
        assert autocorrelation(arp, cells) == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("cell", [1.0, 10 / 3])
def test_length_and_arp_are_inverse(cell):
    arps = np.array([0.001, 0.05, 0.15, 0.24, 0.249, random_field.LARGEST_STREAMING_ARP])
    lengths = [fifesim.correlation_length(arp, cell) for arp in arps]
    assert np.all(np.diff(lengths) > 0)
    np.testing.assert_allclose([fifesim.arp_for_length(length, cell) for length in lengths], arps, rtol=1e-9)
    assert fifesim.correlation_length(0.0) == fifesim.arp_for_length(0.0) == 0.0


def test_margin_holds_the_response():
    """What a unit impulse leaves at the margin, by quadrature of the response along a row at the lowest frequency."""
    for arp in ARPS:
        cells = random_field.margin(arp)
        impulse = np.fft.ifft(1 / (1 - 2 * arp * (1 + np.cos(2 * np.pi * np.fft.fftfreq(4096))))).real
        assert impulse[cells] < 2e-8 * impulse[0]


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


def test_length_beyond_streaming_is_refused():
    with pytest.raises(ValueError, match="use larger cells for a longer range"):
        fifesim.arp_for_length(1e6)


def test_variance_of_the_paper_smoothest_field():
    """k = 0.96: the elliptic integral by its series, to the digits that 400 terms give."""
    k2, n = 0.96**2, np.arange(400)
    ratio = np.exp(2 * (special.gammaln(2 * n + 1) - 2 * special.gammaln(n + 1) - 2 * n * np.log(2)))
    integral = np.pi / 2 * np.sum(ratio * k2**n / (1 - 2 * n))
    assert field_variance(0.24) == pytest.approx(2 / np.pi * integral / (1 - k2), rel=1e-12)
