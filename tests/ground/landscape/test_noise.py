"""White noise by place: its generator beside the authors' known answers, its normals beside the distribution."""

import numpy as np
import pytest
from scipy import stats

from fifesim.ground.landscape.autoregression import _box_muller, philox, white_noise

# kat_vectors of Random123 1.14: counter, key, answer.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


def words(text):
    return np.array([int(word, 16) for word in text.split()], np.uint64)


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_generator_gives_the_known_answers(counter, key, answer):
    np.testing.assert_array_equal(philox(*words(counter), *words(key)), words(answer))


def test_normals_are_those_of_box_and_muller():
    """Beside double precision: rounding of u near 1 leaves 6e-8 under the root, 6e-6 where the root is 0.01."""
    rng = np.random.default_rng(4)
    one, other = (rng.integers(0, 2**32, 20_000, dtype=np.uint32) for _ in range(2))
    one[:3] = 0, 1, 2**32 - 1
    memory, found = np.empty((2, one.size), np.float32), np.empty((2, one.size), np.float32)
    _box_muller(one, other, memory[0], memory[0].view(np.int32), memory[1], *found)
    expected = np.sqrt(-2 * np.log((one + 0.5) / 2**32))
    clear = expected > 0.01
    np.testing.assert_allclose(np.hypot(*found.astype(float))[clear], expected[clear], rtol=0, atol=6e-6)
    assert np.isfinite(found).all()
    # A whole turn holds each angle once: the quarter is from two bits and the place in it from the others.
    angle = np.arctan2(*found.astype(float))[clear] / (2 * np.pi)
    assert stats.kstest(angle % 1, "uniform").pvalue > 0.001


def test_noise_is_standard_normal():
    """Four standard errors of the moments; the Kolmogorov-Smirnov distance at 1 in a thousand."""
    noise = white_noise(3, -700, 5, (2000, 1500)).astype(float).ravel()
    n = noise.size
    assert noise.mean() == pytest.approx(0, abs=4 / np.sqrt(n))
    assert noise.var() == pytest.approx(1, abs=4 * np.sqrt(2 / n))
    assert stats.skew(noise) == pytest.approx(0, abs=4 * np.sqrt(6 / n))
    assert stats.kurtosis(noise) == pytest.approx(0, abs=4 * np.sqrt(24 / n))
    assert stats.kstest(noise, "norm").statistic < 1.95 / np.sqrt(n)


@pytest.mark.parametrize("shift", [(0, 1), (0, 2), (0, 3), (0, 4), (1, 0), (1, 1), (4, 1)])
def test_neighbours_are_independent(shift):
    """In their values and in their squares: the four numbers of a block come from two pairs."""
    noise = white_noise(3, 0, 0, (1000, 1000)).astype(float)
    down, across = shift
    here, there = noise[down:, across:], noise[: 1000 - down, : 1000 - across]
    assert np.corrcoef(here.ravel(), there.ravel())[0, 1] == pytest.approx(0, abs=4e-3)
    assert np.corrcoef(here.ravel() ** 2, there.ravel() ** 2)[0, 1] == pytest.approx(0, abs=4e-3)


@pytest.mark.parametrize("column", [-9, -1, 0, 1, 2, 3, 2**33])
def test_window_is_a_slice_at_any_column(column):
    whole = white_noise(2**63, -2, column, (6, 21))
    for skip in range(5):
        np.testing.assert_array_equal(white_noise(2**63, 0, column + skip, (3, 8)), whole[2:5, skip : skip + 8])
