"""Trends of maps: what the process alone has of them, what is drawn with one, and what leaves them alone."""

import numpy as np
import pytest

from fifesim.ground.landscape.autoregression import periodic_field
from fifesim.ground.landscape.downscaling import kriging_block_means, map_trend

RATIO, CELLS = (3, 3), (180, 180)


def trend(seed, ratio=RATIO):
    """Cells of a trend of density 1 at one radian a pixel."""
    u, v = (2 * np.pi * np.fft.fftfreq(size) * number for size, number in zip(CELLS, ratio, strict=True))
    squared = u[:, None] ** 2 + v**2
    squared[0, 0] = np.inf
    noise = np.random.default_rng(seed).standard_normal(CELLS)
    return np.fft.ifft2(np.fft.fft2(noise) * np.sqrt(np.prod(ratio)) / squared).real


def known(levels):
    return np.ones(levels.shape, bool)


@pytest.mark.parametrize("arp", [0.0, 0.15, 0.24])
def test_map_of_the_process_has_hardly_a_trend(arp):
    """A trend of one half adds 3 % to the variance of second differences, their standard error."""
    for seed in range(5):
        levels = kriging_block_means(0.2 * periodic_field(seed, arp, CELLS), RATIO)
        assert map_trend(levels, known(levels), 0.2, arp, RATIO) <= 1.0


@pytest.mark.parametrize("ratio", [(3, 3), (2, 4)])
@pytest.mark.parametrize("strength", [4.0, 16.0])
def test_trend_is_found_beside_the_process(strength, ratio):
    for seed in range(4):
        levels = kriging_block_means(0.2 * (periodic_field(seed, 0.15, CELLS) + strength * trend(seed, ratio)), ratio)
        assert map_trend(levels, known(levels), 0.2, 0.15, ratio) == strength


def test_gentle_hills_are_known_by_their_wide_differences():
    """Over one pixel they bend by a hundredth of the process."""
    hills = kriging_block_means(np.broadcast_to(np.sin(2 * np.pi * np.arange(180) / 180), CELLS), RATIO)
    levels = hills + kriging_block_means(0.2 * periodic_field(1, 0.15, CELLS), RATIO)
    assert map_trend(levels, known(levels), 0.2, 0.15, RATIO) >= 0.5
    assert map_trend(levels - hills, known(levels), 0.2, 0.15, RATIO) <= 0.25


def test_fences_and_pixels_without_leaves_leave_it_alone():
    levels = kriging_block_means(0.2 * (periodic_field(3, 0.15, CELLS) + 4.0 * trend(3)), RATIO)
    fenced = levels + np.where(np.arange(60) < 23, 0.0, 5.0)
    holed = known(levels)
    fenced[20:30, 40:50], holed[20:30, 40:50] = -50.0, False
    assert map_trend(fenced, holed, 0.2, 0.15, RATIO) == 4.0
    # One that bends nowhere is no trend but a plane.
    assert map_trend(np.full((60, 60), 2.0), holed, 0.2, 0.15, RATIO) == 0.0


def test_without_a_process_there_is_the_trend_alone():
    levels = np.zeros((8, 8))
    assert map_trend(levels, known(levels), 0.0, 0.15, RATIO) == np.inf
    assert map_trend(1e6 * trend(1)[:8, :8], known(levels), 1.0, 0.15, RATIO) == np.inf
