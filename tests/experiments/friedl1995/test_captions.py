"""What captions state is what the figures show."""

import re

import numpy as np
import pytest

from fifesim.experiments.friedl1995 import captions


def test_peaks_are_counted():
    rng = np.random.default_rng(1)
    one = rng.normal(0, 1, 4000)
    assert captions.peaks(one) == 1
    assert captions.peaks(np.concatenate([one, one + 8])) == 2


def test_most_of_the_scatter_of_figure_9_is_the_drift(found):
    """1 - R2 of reflectance, by hand, in both readings."""
    share = captions.drift_share(found)
    scene = found.sel(arp=0.15)
    left = {}
    for reading in ("native", "aligned"):
        boa, toa = (scene[f"pixel_{name}_nir"].sel(reading=reading).dropna("pixel").values for name in ("boa", "toa"))
        left[reading] = 1 - np.corrcoef(boa, toa)[0, 1] ** 2
    assert share[1, 1] == pytest.approx(1 - left["aligned"] / left["native"], rel=1e-9)
    assert (share > 0.5).all()
    told = captions.figure_captions(found, "native", True)[9]
    low, high = map(int, re.search(r"Most of the scatter about it, (\d+) to (\d+) %", told).groups())
    assert (low, high) == (round(100 * share.min()), round(100 * share.max()))
    assert "11.0 m" in told and "assumed drift" in told
    assert "Most of" not in captions.figure_captions(found, "aligned", True)[9]


def test_every_caption_of_pixels_says_the_reading(found):
    for reading in ("native", "aligned"):
        texts = captions.figure_captions(found, reading, True)
        assert sorted(texts) == list(range(3, 10))
        assert all(f"pixels read as {reading}" in texts[number] for number in (5, 6, 7, 9))


def test_caption_of_figure_6_counts_the_peaks_of_digitising(found):
    """In this sample NDVI has more peaks with 8 bits than before them."""
    told = captions.figure_captions(found, "native", True)[6]
    digital, analogue = re.search(r"its curve has (.*?); before digitising \(grey\) (.*?)\.", told).groups()
    assert digital != "one peak" and analogue == "one peak"


def test_densities_of_a_readers_own_are_not_called_inferred(found):
    assert "were not found" in captions.figure_captions(found, "native", True)[3]
    assert captions.figure_captions(found, "native", False)[3].endswith("as given.")
