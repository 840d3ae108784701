"""The page on the paper is made of its numbers, and they bear its conclusions."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.readings import READINGS

DOCS = Path(__file__).parents[1] / "docs"
NUMBERS = json.loads((DOCS / "paper.json").read_text(encoding="utf-8"))

# What the paper states, and round numbers of the definitions.
STATED = {"0.05", "0.15", "0.24", "4.778", "0.1", "1.0"}


@pytest.fixture
def make_paper(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("make_paper")


def reading(name, dem="flat"):
    (found,) = (one for one in NUMBERS["readings"] if (one["name"], one["dem"]) == (name, dem))
    return found


def nine(row, name):
    """Values of LAI by treatment and arp, shape (3, 3)."""
    return np.array([row[f"{name} {treatment} {arp:g}"] for treatment, arp in friedl1995.scenes()]).reshape(3, 3)


def test_page_is_made_of_its_numbers(make_paper):
    """Else run ``python docs/make_paper.py --text``."""
    assert (DOCS / "paper.md").read_text(encoding="utf-8") == make_paper.text(NUMBERS)


def test_no_number_of_the_page_is_typed_by_hand():
    text = re.sub(r"\{\{.*?\}\}|\{%.*?%\}", "", (DOCS / "paper.md.j2").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert set(re.findall(r"(?<![\w.])\d+\.\d+", text)) <= STATED


@pytest.mark.parametrize("name", ["native", "aligned"])
def test_r2_rises_with_the_length_scale(name):
    assert (np.diff(nine(reading(name), "r2"), axis=1) > 0).all()


def test_pixels_on_the_blocks_do_not_make_the_scatter_of_the_paper():
    one = reading("aligned")
    assert (nine(one, "r2") > nine(one, "paper_r2") + 0.1).all()
    hills = reading("aligned", "flint-hills")
    assert (nine(hills, "r2")[0] > nine(hills, "paper_r2")[0] + 0.1).all()


def test_a_shift_makes_r2_and_slopes_like_the_paper_and_the_drift_does_better():
    """Within the limits that were wanted; the constant shift misses that of slopes."""
    drift, shift = reading("native"), reading("offset")
    assert drift["lai_r2_rms"] < shift["lai_r2_rms"] < 0.06
    assert drift["lai_slope_largest"] < 0.15 < shift["lai_slope_largest"] < 0.2
    for name in READINGS.keys() - {"native", "offset"}:
        assert reading(name)["lai_r2_rms"] > 0.08 and reading(name)["lai_slope_largest"] > 0.2


def test_narrower_spread_makes_a_part_of_the_scatter():
    assert 0.1 < reading("narrow")["lai_r2_rms"] < reading("aligned")["lai_r2_rms"] / 2
    assert reading("narrow")["lai_r2_largest_long"] > 0.15


def test_slopes_tell_blur_from_drift():
    """By how they grow with arp, which brighter soil does not help: in deviations of samples of 200 pixels."""
    paper, deviation = reading("native")["paper_growth"], NUMBERS["growth_deviation"]
    assert abs(reading("native")["growth"] - paper) < deviation
    for name in ("blur-40.8", "blur-48.6"):
        assert (nine(reading(name), "slope") > nine(reading(name), "paper_slope")).all()
        assert reading(name)["growth"] < paper - 2 * deviation
    assert NUMBERS["deviations"]["blur"]["growth"] < reading("blur-48.6")["growth"]


def test_what_was_fitted_hardly_moves_r2():
    assert max(abs(one["lai_r2"]) for one in NUMBERS["sensitivity"]) < 0.02
    assert max(abs(one["lai_slope"]) for one in NUMBERS["sensitivity"]) > 0.03


def test_hills_and_drift_are_not_both_in_the_paper():
    one = reading("native", "flint-hills")
    assert one["r2 burned-ungrazed 0.05"] < one["paper_r2 burned-ungrazed 0.05"] - 0.1


def test_hills_alone_give_one_row_like_the_paper_and_not_the_others():
    one = reading("aligned", "flint-hills")
    assert one["r2 burned-ungrazed 0.05"] == pytest.approx(one["paper_r2 burned-ungrazed 0.05"], abs=0.03)
    assert (np.delete(nine(one, "r2") - nine(one, "paper_r2"), 3) > 0.15).all()


def test_noise_is_the_papers_by_one_of_two_slopes(make_paper):
    found = make_paper.noise(NUMBERS["text"], NUMBERS["table2"]["native"])
    stated = [row["paper"] for row in NUMBERS["text"] if row["quantity"] == "ren" and row["variable"] == "lai"]
    assert found["largest"] < 0.2 and found["growth"] == pytest.approx(found["paper_growth"], rel=0.1)
    assert (np.divide(found["by_other"], stated) < 0.75).all()


def test_pixels_keep_more_of_the_range_than_the_papers():
    rows = [row for row in NUMBERS["text"] if row["quantity"] == "range_kept" and row["paper"] is not None]
    assert len(rows) == 6 and all(row["value"] > row["paper"] for row in rows)
    (widest,) = (row for row in rows if (row["variable"], row["arp"]) == ("lai", 0.24))
    assert widest["value"] > widest["paper"] + 3 * widest["deviation"]


def test_every_choice_made_in_view_of_the_paper_is_called_fitted():
    origins = {row["name"]: row["origin"] for row in NUMBERS["origins"]}
    assert origins["reading of Table 1"] == origins["size of the scenes"] == "fitted to Table 2"
    assert origins["form of the random field"] == origins["bounds of LAI"] == "fitted to the text"
    assert {name for name, origin in origins.items() if origin == "assumed"} == {
        "shape of the densities",
        "elevation",
        "hour and view",
    }


def test_no_threshold_gives_the_lengths_of_the_paper():
    there = [one["there"] for one in NUMBERS["deviations"]["lengths"]]
    assert max(there) > 10 * min(there)


def test_ndvi_of_the_mean_is_the_lower_and_the_criterion_is_not_met():
    assert all(one["bias"] < 0 and abs(one["correlation"]) > 0.3 for one in NUMBERS["scaling"])


def test_limits_are_met():
    assert all(one["met"] for one in NUMBERS["limits"])


@pytest.mark.slow
def test_numbers_are_those_of_this_program(make_paper):
    """Sizes that need no realisation, and Table 2 within the scatter of two. Else run ``python docs/make_paper.py``."""
    for name, found in make_paper.words(friedl1995.Case()).items():
        assert found == NUMBERS[name]
    sizes = make_paper.paper_deviations
    for name, found in (("lengths", sizes.lengths()), ("sun", sizes.sun())):
        for one, kept in zip(found, NUMBERS["deviations"][name], strict=True):
            for key in one.keys() - {"time"}:
                assert one[key] == pytest.approx(kept[key], rel=1e-4)
    lines = sizes.fits(friedl1995.Case(), range(make_paper.SEED, make_paper.SEED + 2)).mean(axis=0)
    kept = [row for row in NUMBERS["table2"]["native"] if row["variable"] == "lai"]
    np.testing.assert_allclose(lines[:, 2], [row["r2"] for row in kept], atol=0.06)
    np.testing.assert_allclose(lines[:, 1], [row["slope"] for row in kept], rtol=0.1)
