"""Line spread functions against their definition: point, edge, sinusoid, quadrature, and the variance of a field."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from fifesim.base.footprints import axis_operator, regularize
from fifesim.base.line_spread import Boxcar
from fifesim.ground.landscape.autoregression import streaming_field
from fifesim.sensor.response.spatial import CosineSpread, GaussianSpread, SystemSpread, TableSpread

# A measured table: not symmetric, with a dark lobe.
POSITIONS = (-31.0, -19.0, -12.5, -3.0, 4.0, 11.0, 17.0, 26.0, 38.0)
VALUES = (0.0, -0.02, 0.31, 0.93, 1.0, 0.7, 0.2, -0.03, 0.0)

SPREADS = {
    "cosine": (CosineSpread(30.32), lambda x: np.where(np.abs(x) <= 15.16, np.cos(2 * np.pi * x / 90.96), 0.0)),
    "boxcar": (Boxcar(30.0), lambda x: np.where(np.abs(x) <= 15.0, 1.0, 0.0)),
    "gaussian": (GaussianSpread(33.0), lambda x: 2.0 ** (-((2 * x / 33.0) ** 2))),
    "table": (TableSpread(POSITIONS, VALUES), lambda x: np.interp(x, POSITIONS, VALUES, left=0.0, right=0.0)),
    # A boxcar of 30 m seen through a boxcar of 12 m.
    "trapezoid": (
        SystemSpread((Boxcar(30.0), Boxcar(12.0)), truncation=1e-9),
        lambda x: np.clip((21.0 - np.abs(x)) / 12.0, 0.0, 1.0),
    ),
}
EACH = pytest.mark.parametrize(("spread", "density"), SPREADS.values(), ids=SPREADS.keys())
# Kinks of a product are rounded by its table, whose step is 1/128 of its width.
TOLERANCE = {"trapezoid": 2e-5}
FINE = 0.02


def tolerance(spread):
    return TOLERANCE["trapezoid"] if isinstance(spread, SystemSpread) else 1e-6


def mean_of(density, low, high, reach=250.0):
    """Integral of a normalized density, by quadrature between its kinks."""
    kinks = sorted({*POSITIONS, -21.0, -9.0, 9.0, 21.0, -15.0, 15.0, -15.16, 15.16, 0.0, low, high, -reach, reach})

    def integral(a, b):
        edges = [a, *(x for x in kinks if a < x < b), b]
        return sum(quad(density, u, v, epsabs=1e-14)[0] for u, v in pairwise(edges))

    return integral(low, high) / integral(-reach, reach)


def columns_of(spread, n_cells, cell, pixel=30.315, origin=300.7, n_pixels=6):
    return axis_operator(
        spread, cell_origin=0.0, cell_size=cell, n_cells=n_cells, pixel_origin=origin, pixel_size=pixel,
        n_pixels=n_pixels,
    )  # fmt: skip


def image_of(line, spread, cell, **pixels):
    """A scene of one row, and the centres of its pixels."""
    row = axis_operator(
        Boxcar(1.0), cell_origin=0.0, cell_size=1.0, n_cells=1, pixel_origin=0.0, pixel_size=1.0, n_pixels=1
    )
    columns = columns_of(spread, line.size, cell, **pixels)
    pixel, origin = pixels.get("pixel", 30.315), pixels.get("origin", 300.7)
    return regularize(line[None, :], row, columns)[0], origin + (np.arange(len(columns)) + 0.5) * pixel


@EACH
def test_point_returns_the_point_spread(spread, density):
    """A bright cell of 1 m at many distances from the pixel's centre."""
    for distance in (-24.3, -15.0, -7.7, 0.0, 3.1, 14.9, 22.0):
        line = np.zeros(601)
        line[300] = 1.0
        image, centers = image_of(line, spread, 1.0, n_pixels=1, origin=300.5 - distance - 15.0, pixel=30.0)
        low = 300 - centers[0]
        assert abs(image[0] - mean_of(density, low, low + 1)) < tolerance(spread)


@EACH
def test_edge_returns_the_integral(spread, density):
    line = np.where(np.arange(700) >= 400, 1.0, 0.0)
    image, centers = image_of(line, spread, 1.0, n_pixels=30, pixel=3.7, origin=350.0)
    expected = [mean_of(density, 400 - x, 250.0) for x in centers]
    np.testing.assert_allclose(image, expected, rtol=0, atol=tolerance(spread))


@EACH
@pytest.mark.parametrize("period", [47.0, 60.63, 200.0])
def test_sinusoid_returns_the_modulation_transfer(spread, density, period):
    """Cells of 2 cm take (pi cell / period)^2 / 3 = 6e-7 from the amplitude."""
    x = (np.arange(32000) + 0.5) * FINE
    image = {}
    for name, wave in (("even", np.cos), ("odd", np.sin)):
        image[name], centers = image_of(wave(2 * np.pi * x / period), spread, FINE)
    amplitude = np.hypot(image["even"], image["odd"])
    np.testing.assert_allclose(amplitude, np.abs(spread.mtf(1 / period)), rtol=0, atol=1e-6)
    if not isinstance(spread, TableSpread):
        phase = 2 * np.pi * centers / period
        np.testing.assert_allclose(image["even"], spread.mtf(1 / period) * np.cos(phase), rtol=0, atol=1e-6)


@EACH
def test_mtf_is_the_fourier_transform_of_the_density(spread, density):
    x = np.linspace(-250, 250, 2_000_001)
    weight = density(x)
    for frequency in (0.0, 1 / 200, 1 / 60, 1 / 31):
        transform = abs(np.trapezoid(weight * np.exp(-2j * np.pi * frequency * x), x)) / np.trapezoid(weight, x)
        # A jump of a boxcar falls between two samples, 0.25 mm apart.
        assert abs(abs(spread.mtf(frequency)) - transform) < 2e-5


def test_gaussian_has_the_transfer_that_was_asked_for():
    for mtf in (0.1, 0.28, 0.6):
        assert float(GaussianSpread.from_mtf(mtf, 10.0).mtf(0.05)) == pytest.approx(mtf, rel=1e-12)
    assert GaussianSpread(30.0).truncated_share < 2.1e-9


@EACH
def test_constant_scene_stays_constant(spread, density):
    """Whatever the ratio of sizes."""
    for cell, pixel in ((30 / 9, 30.0), (30 / 9, 30.315), (30 / 9, 1100.0), (7.1, 2.3)):
        image, _ = image_of(np.full(int(9000 / cell), 0.3), spread, cell, pixel=pixel, n_pixels=5)
        np.testing.assert_allclose(image, 0.3, rtol=1e-14)


@EACH
def test_mean_is_conserved(spread, density):
    """Pixels at every cell: each cell counts once, and the sum is that of the scene, which is dark at its borders."""
    line = np.zeros(600)
    line[200:400] = np.random.default_rng(5).uniform(0.1, 0.6, 200)
    image, _ = image_of(line, spread, 3.0, pixel=3.0, origin=200.3, n_pixels=440)
    assert image.sum() == pytest.approx(line.sum(), rel=1e-12)


def test_an_area_of_pixels_side_by_side_conserves_the_mean():
    scene = np.random.default_rng(6).uniform(0.1, 0.6, 900)
    image, _ = image_of(scene, Boxcar(30.0), 30 / 9, pixel=30.0, origin=0.0, n_pixels=100)
    assert image.mean() == pytest.approx(scene.mean(), rel=1e-12)


@pytest.mark.parametrize(("pixel", "width"), [(30.0, 30.0), (30.315, 33.0), (1100.0, 1500.0)])
def test_any_ratio_agrees_with_brute_force(pixel, width):
    """Midpoint sums over cells of 3.33 m, each cut in 64, on both axes."""
    cell, fine, n = 30 / 9, 64, 3000 if pixel > 100 else 300
    scene = np.random.default_rng(8).random((n, n + 7))
    origin, count = n * cell * 0.45 - pixel, 2
    rows, columns = (
        axis_operator(
            GaussianSpread(width), cell_origin=0.0, cell_size=cell, n_cells=size, pixel_origin=origin + 0.77 * k,
            pixel_size=pixel, n_pixels=count,
        )
        for k, size in enumerate(scene.shape)
    )  # fmt: skip
    weights = []
    for k, size in enumerate(scene.shape):
        x = (np.arange(size * fine) + 0.5) * cell / fine
        centers = origin + 0.77 * k + (np.arange(count) + 0.5) * pixel
        dense = 2.0 ** (-((2 * (x - centers[:, None]) / width) ** 2))
        weights.append(dense.reshape(count, size, fine).sum(axis=2))
    total = weights[0] @ scene @ weights[1].T / np.outer(weights[0].sum(1), weights[1].sum(1))
    # Midpoints: (cell / 64)^2 / 24 times a curvature of 8 ln 2 / width^2.
    np.testing.assert_allclose(regularize(scene, rows, columns), total, rtol=1e-6)


@pytest.mark.parametrize("spread", [CosineSpread(30.32), GaussianSpread(36.0)], ids=["cosine", "gaussian"])
@pytest.mark.parametrize("arp", [0.05, 0.15, 0.24])
def test_variance_of_an_autoregressive_scene_agrees_with_theory(spread, arp):
    """The scene's covariance summed over the footprint's autocorrelation; the standard error from the image's own."""
    n, cell, pixel = 1100, 30 / 9, 30.315
    scene = streaming_field(3, arp, 0, 0, (n, n))
    count = 110
    axis = columns_of(spread, n, cell, pixel=pixel, origin=100.0, n_pixels=count)
    image = regularize(scene, axis, axis)
    u = 2 * np.pi * np.fft.fftfreq(1024)
    power = (1 - 2 * arp * (np.cos(u)[:, None] + np.cos(u))) ** -2.0
    covariance = np.fft.ifft2(power / power.mean()).real
    # Cells weigh as the footprint integrates over them, for all positions of a pixel on the cells.
    phases = np.linspace(0, 1, 40, endpoint=False) * cell
    correlation = np.zeros(1024)
    for phase in phases:
        weights = np.zeros(1024)
        edges = (np.arange(-200, 201) * cell) - phase
        weights[:400] = np.diff(spread.cumulative(edges))
        correlation += np.fft.ifft(np.abs(np.fft.fft(weights)) ** 2).real / phases.size
    expected = float(correlation @ covariance @ correlation)
    lag = np.fft.ifft2(np.abs(np.fft.fft2(image - image.mean())) ** 2).real
    error = expected * np.sqrt(2 * np.sum((lag / lag[0, 0]) ** 2)) / count
    assert abs(image.var() - expected) < 3 * error
    assert error < 0.1 * expected


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GaussianSpread(0.0), "width"),
        (lambda: GaussianSpread.from_mtf(30.0, 30.0), "share, not percent"),
        (lambda: TableSpread([0, 1, 1], [0, 1, 0]), "increase"),
        (lambda: TableSpread([0, 1], [0, 1, 0]), "a value for each"),
        (lambda: TableSpread([0, 1, 2], [0, -1, 0]), "positive integral"),
    ],
)
def test_a_response_that_is_none_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
