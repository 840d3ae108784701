"""What captions state is what the figures show."""

import re

import numpy as np
import pytest

from fifesim.experiments.friedl1995 import figures
from fifesim.experiments.friedl1995.table import INCREMENTS


@pytest.fixture
def caption(found, sentence):
    """Caption of a figure for a reading."""

    def text(number, reading, own_densities=True):
        numbers = figures.caption_numbers(found, reading)
        return sentence("caption", number, reading, numbers, found.attrs["cell"], own_densities, INCREMENTS)

    return text


def test_peaks_are_counted():
    rng = np.random.default_rng(1)
    one = rng.normal(0, 1, 4000)
    assert figures.peaks(one) == 1
    assert figures.peaks(np.concatenate([one, one + 8])) == 2


def test_most_of_the_scatter_of_figure_9_is_the_drift(found, caption):
    """1 - R2 of reflectance, by hand, in both readings."""
    share = figures.drift_share(found)
    scene = found.sel(arp=0.15)
    left = {}
    for reading in ("native", "aligned"):
        boa, toa = (scene[f"pixel_{name}_nir"].sel(reading=reading).dropna("pixel").values for name in ("boa", "toa"))
        left[reading] = 1 - np.corrcoef(boa, toa)[0, 1] ** 2
    assert share[1, 1] == pytest.approx(1 - left["aligned"] / left["native"], rel=1e-9)
    assert (share > 0.5).all()
    told = caption(9, "native")
    low, high = map(int, re.search(r"Most of the scatter about it, (\d+) to (\d+) %", told).groups())
    assert (low, high) == (round(100 * share.min()), round(100 * share.max()))
    assert "11.0 m" in told and "assumed drift" in told
    assert "Most of" not in caption(9, "aligned")


def test_every_caption_of_pixels_says_the_reading(caption):
    for reading in ("native", "aligned"):
        assert all(caption(number, reading) for number in figures.FIGURE_NUMBERS)
        assert all(f"pixels read as {reading}" in caption(number, reading) for number in (5, 6, 7, 9))


def test_caption_of_figure_6_counts_the_peaks_of_digitising(caption):
    """In this sample NDVI has more peaks with 8 bits than before them."""
    text = caption(6, "native")
    digital, analogue = re.search(r"its curve has (.*?); before digitising \(grey\) (.*?)\.", text).groups()
    assert digital != "one peak" and analogue == "one peak"


def test_densities_of_a_readers_own_are_not_called_inferred(caption):
    assert "were not found" in caption(3, "native")
    assert caption(3, "native", own_densities=False).endswith("as given.")
