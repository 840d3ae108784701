"""Line spread functions compared with their definition, and transfer functions of system components."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import butter, freqs
from scipy.special import k0

from fifesim.base.footprints import Boxcar, axis_operator
from fifesim.sensor.response.spatial import (
    CosineSpread,
    Difference,
    Diffraction,
    GaussianSpread,
    LowPass,
    Mixture,
    SystemSpread,
    TableSpread,
)

# Like a measured table: asymmetric, with negative lobes.
POSITIONS = (-31.0, -19.0, -12.5, -3.0, 4.0, 11.0, 17.0, 26.0, 38.0)
VALUES = (0.0, -0.02, 0.31, 0.93, 1.0, 0.7, 0.2, -0.03, 0.0)

SPREADS = {
    "cosine": (CosineSpread(30.32), lambda x: np.where(np.abs(x) <= 15.16, np.cos(2 * np.pi * x / 90.96), 0.0)),
    "boxcar": (Boxcar(30.0), lambda x: np.where(np.abs(x) <= 15.0, 1.0, 0.0)),
    "gaussian": (GaussianSpread(33.0), lambda x: 2.0 ** (-((2 * x / 33.0) ** 2))),
    "table": (TableSpread(POSITIONS, VALUES), lambda x: np.interp(x, POSITIONS, VALUES, left=0.0, right=0.0)),
    # Boxcar of 30 m convolved with a boxcar of 12 m.
    "trapezoid": (
        SystemSpread((Boxcar(30.0), Boxcar(12.0)), truncation=1e-9),
        lambda x: np.clip((21.0 - np.abs(x)) / 12.0, 0.0, 1.0),
    ),
}
EACH = pytest.mark.parametrize(("spread", "density"), SPREADS.values(), ids=SPREADS.keys())
# The table of a system response has steps of 1/128 of its width, which rounds kinks.
TOLERANCE = {"trapezoid": 2e-5}
FINE = 0.02


def tolerance(spread):
    return TOLERANCE["trapezoid"] if isinstance(spread, SystemSpread) else 1e-6


def mean_of(density, low, high, reach=250.0):
    """Integral of the normalized density, by quadrature between kinks."""
    kinks = sorted({*POSITIONS, -21.0, -9.0, 9.0, 21.0, -15.0, 15.0, -15.16, 15.16, 0.0, low, high, -reach, reach})

    def integral(a, b):
        edges = [a, *(x for x in kinks if a < x < b), b]
        return sum(quad(density, u, v, epsabs=1e-14)[0] for u, v in pairwise(edges))

    return integral(low, high) / integral(-reach, reach)


def operator_of(spread, cells, cell, origin, pixel):
    """Operator of one pixel."""
    return axis_operator(
        spread, cell_origin=0.0, cell_size=cell, n_cells=cells, pixel_origin=origin, pixel_size=pixel, n_pixels=1
    )


@EACH
def test_cumulative_response_is_the_integral_of_the_density(spread, density):
    for low in (-38.3, -24.3, -15.0, -7.7, 0.0, 3.1, 14.9, 22.0):
        found = spread.cumulative(low + 1) - spread.cumulative(low)
        assert abs(found - mean_of(density, low, low + 1)) < tolerance(spread)


@EACH
def test_image_has_the_whole_response_and_is_not_mirrored(spread, density):
    """Each cell is seen with the response at its distance from the pixel centre, positive to the right."""
    operator = operator_of(spread, 601, 1.0, origin=285.5, pixel=30.0)
    distances = operator.start[0] + np.arange(operator.count[0] + 1) - (285.5 + 15.0)
    found = operator.weights[0, : operator.count[0]]
    np.testing.assert_allclose(found, np.diff(spread.cumulative(distances)), rtol=0, atol=1e-12)
    assert found.sum() == pytest.approx(1.0, abs=1e-6)
    assert (abs(found - found[::-1]).max() > 0.001) == isinstance(spread, TableSpread)


@EACH
@pytest.mark.parametrize("period", [47.0, 60.63, 200.0])
def test_mtf_is_the_transform_of_the_response(spread, density, period):
    """Steps of 2 cm reduce the amplitude by (pi step / period)^2 / 6 = 3e-7."""
    edges = np.arange(-16000, 16001) * FINE
    middle, weights = (edges[1:] + edges[:-1]) / 2, np.diff(spread.cumulative(edges))
    transform = weights @ np.exp(2j * np.pi * middle / period)
    assert abs(transform) == pytest.approx(abs(float(spread.mtf(1 / period))), abs=1e-6)
    if not isinstance(spread, TableSpread):
        assert transform == pytest.approx(float(spread.mtf(1 / period)), abs=1e-6)


# ------------------------------------------------------------------------------------------ system components


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.8, 1.0, 1.7])
def test_diffraction_mtf_is_the_autocorrelation_of_the_aperture(nu):
    """Overlap of two disks displaced by nu diameters; zero beyond nu = 1, for both signs."""
    overlap = 4 / np.pi * quad(lambda t: np.sqrt(1 - t * t), min(nu, 1), 1)[0]
    for sign in (-1, 1):
        assert float(Diffraction(0.2).mtf(sign * nu * 0.2)) == pytest.approx(overlap, abs=1e-12)


@pytest.mark.parametrize("poles", [1, 2, 5])
def test_electronics_mtf_is_a_butterworth_filter(poles):
    frequency = np.array([0.0, 0.01, 0.05, 0.3])
    response = freqs(*butter(poles, 2 * np.pi * 0.05, analog=True), 2 * np.pi * frequency)[1]
    np.testing.assert_allclose(LowPass(0.05, poles).mtf(frequency), np.abs(response), rtol=1e-10)


def test_diffraction_agrees_with_the_line_spread_of_the_airy_disk():
    """The line spread of an Airy disk (Struve) decreases as x^-2: the tail beyond X is 2 / (pi^3 fc X)."""
    cutoff = 0.5
    spread = SystemSpread((Diffraction(cutoff), GaussianSpread(3.0)), truncation=2e-3)
    asymptotic = 4 / (np.pi**3 * cutoff * spread.half_width)
    assert spread.truncated_share == pytest.approx(asymptotic, rel=0.02)
    assert spread.truncated_share <= 2e-3


def test_one_pole_line_spread_is_a_bessel_function():
    """The transform of [1 + (f / fc)^2]^(-1/2) is 2 fc K0(2 pi fc |x|), here averaged over a detector of 4 m."""
    cutoff = 0.01
    spread = SystemSpread((LowPass(cutoff), Boxcar(4.0)), truncation=1e-7)

    def inside(x):
        return 4 * cutoff * quad(lambda t: k0(2 * np.pi * cutoff * t), 0, x, epsabs=1e-12)[0]

    for x in (5.0, 20.0, 60.0):
        expected = quad(inside, x - 2, x + 2)[0] / 4
        assert float(spread.cumulative(x) - spread.cumulative(-x)) == pytest.approx(expected, abs=1e-5)


def test_system_mtf_is_the_product_of_its_parts():
    """Optics, detector, smear and electronics of a scanner; the truncated share is at most `truncation`."""
    frequency = np.linspace(0, 1 / 30, 40)
    for truncation in (1e-3, 1e-4):
        spread = SystemSpread((GaussianSpread(12.0), Boxcar(30.0), Boxcar(9.0), LowPass(0.05, 2)), truncation)
        assert spread.truncated_share <= truncation
        np.testing.assert_allclose(spread.mtf(frequency), spread.product(frequency), rtol=0, atol=4 * truncation)


def sampled_contrast(spread, frequency, recorded, cell=10.0, pixel=30.0):
    """Contrast of a recorded wave, sampled at cell centres and averaged with a line spread function."""
    cells = 400
    operator = operator_of(spread, cells, cell, cells * cell / 2 - pixel / 2, pixel)
    places = (np.arange(cells) + 0.5) * cell - cells * cell / 2
    wave = float(recorded.mtf(frequency)) * np.cos(2 * np.pi * frequency * places)
    window = slice(operator.start[0], operator.start[0] + operator.count[0])
    return float(operator.weights[0, : operator.count[0]] @ wave[window])


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
    recorded = Boxcar(30.0)
    difference = Difference(Boxcar(1.0), recorded, 0.2)
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


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TableSpread([0, 1, 1], [0, 1, 0]), "increase"),
        (lambda: TableSpread([0, 1], [0, 1, 0]), "a value for each"),
        (lambda: TableSpread([0, 1, 2], [0, -1, 0]), "positive integral"),
        (lambda: SystemSpread((Boxcar(30.0),)), "has jumps"),
        (lambda: SystemSpread((Diffraction(0.01), Boxcar(3.0)), truncation=1e-7), "decays too slowly"),
        (lambda: SystemSpread((Boxcar(30.0), LowPass(0.1)), truncation=0.2), "it is a share of the response"),
    ],
)
def test_invalid_response_raises(make, message):
    with pytest.raises(ValueError, match=message):
        make()
