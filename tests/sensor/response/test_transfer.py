"""Transfer functions of parts, and the line spread of their product: overlaps, poles, closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import butter, freqs
from scipy.special import k0

from fifesim.base.footprints import axis_operator
from fifesim.base.line_spread import Boxcar
from fifesim.sensor.response.spatial import (
    Difference,
    Diffraction,
    GaussianSpread,
    LowPass,
    Mixture,
    SystemSpread,
)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.8, 1.0, 1.7])
def test_aperture_passes_what_it_overlaps_of_itself(nu):
    """Area that two disks share, moved apart by nu of their diameter; nothing from there on, on either side."""
    overlap = 4 / np.pi * quad(lambda t: np.sqrt(1 - t * t), min(nu, 1), 1)[0]
    for sign in (-1, 1):
        assert float(Diffraction(0.2).mtf(sign * nu * 0.2)) == pytest.approx(overlap, abs=1e-12)


@pytest.mark.parametrize("poles", [1, 2, 5])
def test_electronics_have_the_poles_of_butterworth(poles):
    frequency = np.array([0.0, 0.01, 0.05, 0.3])
    response = freqs(*butter(poles, 2 * np.pi * 0.05, analog=True), 2 * np.pi * frequency)[1]
    np.testing.assert_allclose(LowPass(0.05, poles).mtf(frequency), np.abs(response), rtol=1e-10)


def test_diffraction_agrees_with_the_line_spread_of_the_airy_disk():
    """Struve's: the line spread of a disk falls off as x^-2, so its tail beyond X is 2 / (pi^3 fc X)."""
    cutoff = 0.5
    spread = SystemSpread((Diffraction(cutoff), GaussianSpread(3.0)), truncation=2e-3)
    asymptotic = 4 / (np.pi**3 * cutoff * spread.half_width)
    assert spread.truncated_share == pytest.approx(asymptotic, rel=0.02)
    assert spread.truncated_share <= 2e-3


def test_electronics_of_one_pole_spread_as_a_bessel_function():
    """The transform of [1 + (f / fc)^2]^(-1/2) is 2 fc K0(2 pi fc |x|), here averaged over a detector of 4 m."""
    cutoff = 0.01
    spread = SystemSpread((LowPass(cutoff), Boxcar(4.0)), truncation=1e-7)

    def inside(x):
        return 4 * cutoff * quad(lambda t: k0(2 * np.pi * cutoff * t), 0, x, epsabs=1e-12)[0]

    for x in (5.0, 20.0, 60.0):
        expected = quad(inside, x - 2, x + 2)[0] / 4
        assert float(spread.cumulative(x) - spread.cumulative(-x)) == pytest.approx(expected, abs=1e-5)


def test_product_passes_what_its_parts_pass():
    """As they come from detector, smear, optics and electronics of a scanner; the cut takes what it says."""
    frequency = np.linspace(0, 1 / 30, 40)
    for truncation in (1e-3, 1e-4):
        spread = SystemSpread((GaussianSpread(12.0), Boxcar(30.0), Boxcar(9.0), LowPass(0.05, 2)), truncation)
        assert spread.truncated_share <= truncation
        np.testing.assert_allclose(spread.mtf(frequency), spread.product(frequency), rtol=0, atol=4 * truncation)


def test_widths_of_gaussians_add_by_their_squares():
    both, one = SystemSpread((GaussianSpread(30.0), GaussianSpread(40.0)), 1e-6), GaussianSpread(50.0)
    x = np.linspace(-70, 70, 29)
    np.testing.assert_allclose(both.cumulative(x), one.cumulative(x), rtol=0, atol=1e-5)
    np.testing.assert_allclose(both.mtf(1 / 60), one.mtf(1 / 60), rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SystemSpread((Boxcar(30.0),)), "has jumps"),
        (lambda: SystemSpread(()), "at least one"),
        (lambda: SystemSpread((Diffraction(0.01), Boxcar(3.0)), truncation=1e-7), "decays too slowly"),
        (lambda: LowPass(0.0), "cycles per metre"),
        (lambda: LowPass(0.1, 0), "poles"),
        (lambda: SystemSpread((Boxcar(30.0), LowPass(0.1)), truncation=0.2), "it is a share of the response"),
        (lambda: Diffraction(-1.0), "cycles per metre, got -1"),
    ],
)
def test_a_part_or_a_product_that_is_none_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def sampled_contrast(spread, frequency, recorded, cell=10.0, pixel=30.0):
    """Contrast of a wave that is recorded at the centres of cells and then averaged by a line spread function."""
    cells = 400
    operator = axis_operator(
        spread,
        cell_origin=0.0,
        cell_size=cell,
        n_cells=cells,
        pixel_origin=cells * cell / 2 - pixel / 2,
        pixel_size=pixel,
        n_pixels=1,
    )
    places = (np.arange(cells) + 0.5) * cell - cells * cell / 2
    wave = float(recorded.mtf(frequency)) * np.cos(2 * np.pi * frequency * places)
    window = slice(operator.start[0], operator.start[0] + operator.count[0])
    return float(operator.weights[0, : operator.count[0]] @ wave[window])


@pytest.mark.parametrize("frequency", [0.0, 0.004, 1 / 60, 0.03])
@pytest.mark.parametrize("target", [GaussianSpread(36.0), SystemSpread((Boxcar(30.0), GaussianSpread(12.0)))])
def test_an_image_of_an_image_has_the_contrast_of_the_second_instrument(frequency, target):
    """An image in cells of 10 m, averaged by the difference, has the contrast of the target times `left`."""
    recorded = GaussianSpread(14.0)
    difference = Difference(target, Mixture((1.0,), ((recorded, Boxcar(10.0)),)), 0.2)
    found = sampled_contrast(SystemSpread((difference,)), frequency, recorded)
    expected = float(difference.left(frequency) * target.mtf(frequency))
    # A thousandth of the response is cut off, and waves of the cells' own period come in.
    assert found == pytest.approx(expected, abs=6e-3)
    assert float(difference.left(frequency)) > 0.85
    blurred_twice = sampled_contrast(target, frequency, recorded)
    assert frequency == 0 or abs(blurred_twice - expected) > abs(found - expected)


def test_contrast_that_was_not_recorded_is_not_made_up():
    recorded = Boxcar(30.0)
    difference = Difference(Boxcar(1.0), recorded, 0.2)
    frequency = np.linspace(0, 0.2, 4001)
    assert np.max(np.abs(difference.mtf(frequency))) <= (1 + 0.2**2) / (2 * 0.2)
    assert float(difference.mtf(1 / 30)) == pytest.approx(0.0, abs=1e-12)
    assert float(difference.left(0.0)) == 1 and float(difference.mtf(0.0)) == 1
    assert np.all(difference.left(frequency) <= 1)
    for floor in (0.0, 1.0):
        with pytest.raises(ValueError, match=r"floor must be in \(0, 1\)"):
            Difference(Boxcar(1.0), recorded, floor)


def test_a_mixture_is_the_transfer_of_the_sum_of_bands():
    """Waves of two bands, each by its parts, weighted and added."""
    mixture = Mixture((1.3, -0.3), ((GaussianSpread(20.0), Boxcar(10.0)), (Boxcar(20.0),)))
    frequency = np.array([0.0, 0.01, 0.04])
    expected = 1.3 * GaussianSpread(20.0).mtf(frequency) * np.sinc(10 * frequency) - 0.3 * np.sinc(20 * frequency)
    np.testing.assert_allclose(mixture.mtf(frequency), expected, rtol=1e-14)
