"""The page on the paper is generated from stored numbers, which support its statements."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ALIGNED, NATIVE, READINGS

DOCS = Path(__file__).parents[1] / "docs"
NUMBERS = json.loads((DOCS / "paper.json").read_text(encoding="utf-8"))


# Numbers that the paper states, and round numbers in definitions.
STATED = {"0.05", "0.15", "0.24", "3.33", "4.778", "0.1", "1.0"}


TABLE, TEXT = "fitted to Table 2", "fitted to the text"
ASSUMED = {"shape of the densities", "elevation", "hour and view"}


@pytest.fixture
def make_paper(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("make_paper")


def reading(name, dem="flat"):
    (found,) = (one for one in NUMBERS["readings"] if (one["name"], one["dem"]) == (name, dem))
    return found


def nine(row, name):
    """Values for LAI by treatment and arp, shape (3, 3)."""
    return np.array([row[f"{name} {treatment} {arp:g}"] for treatment, arp in friedl1995.scenes()]).reshape(3, 3)


def test_page_is_generated_from_the_numbers(make_paper):
    """To update the page, run ``python docs/make_paper.py --text``."""
    assert (DOCS / "paper.md").read_text(encoding="utf-8") == make_paper.text(NUMBERS)


def test_no_number_of_the_page_is_typed_by_hand():
    text = re.sub(r"\{\{.*?\}\}|\{%.*?%\}", "", (DOCS / "paper.md.j2").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert set(re.findall(r"(?<![\w.])\d+\.\d+", text)) <= STATED


def test_numbers_support_the_statements_of_the_page(make_paper):
    """A change of the model updates the numbers, but not the text of the template."""
    drift, shift, aligned, narrow = map(reading, ("native", "offset", "aligned", "narrow"))
    hills, both = reading("aligned", "flint-hills"), reading("native", "flint-hills")
    blurred = [reading("blur-40.8"), reading("blur-48.6")]
    others = [reading(name) for name in READINGS.keys() - {"native", "offset"}]
    excess, on_hills = (nine(one, "r2") - nine(one, "paper_r2") for one in (aligned, hills))
    growth, deviation = drift["paper_growth"], NUMBERS["growth_deviation"]
    sensitivity, origins = NUMBERS["sensitivity"], {row["name"]: row["origin"] for row in NUMBERS["origins"]}
    lengths = [one["there"] for one in NUMBERS["deviations"]["lengths"]]
    noise = make_paper.noise(NUMBERS)
    statements = {
        "R2 rises with the length scale": all((np.diff(nine(one, "r2"), axis=1) > 0).all() for one in (drift, aligned)),
        "aligned pixels lack the scatter of the paper": (excess > 0.1).all() and (on_hills[0] > 0.1).all(),
        "the drift has the paper's R2, and a shift too": drift["lai_r2_rms"] < shift["lai_r2_rms"] < 0.06,
        "a shift misses the slopes": drift["lai_slope_largest"] < 0.15 < shift["lai_slope_largest"] < 0.2,
        "other readings miss R2": min(one["lai_r2_rms"] for one in others) > 0.08,
        "other readings miss the slopes": min(one["lai_slope_largest"] for one in others) > 0.2,
        "a narrow spread makes some scatter": 0.1 < narrow["lai_r2_rms"] < aligned["lai_r2_rms"] / 2,
        "a narrow spread misses long scales": narrow["lai_r2_largest_long"] > 0.15,
        "slopes grow with arp as in the paper": abs(drift["growth"] - growth) < deviation,
        "blurred slopes are too large": all((nine(one, "slope") > nine(one, "paper_slope")).all() for one in blurred),
        "blurred slopes grow too little": max(one["growth"] for one in blurred) < growth - 2 * deviation,
        "soil does not help": NUMBERS["deviations"]["blur"]["growth"] < blurred[1]["growth"],
        "fitted values hardly move R2": max(abs(one["lai_r2"]) for one in sensitivity) < 0.02,
        "fitted values move slopes": max(abs(one["lai_slope"]) for one in sensitivity) > 0.03,
        "hills and drift are not both in the paper": (nine(both, "r2") - nine(both, "paper_r2"))[1, 0] < -0.1,
        "hills alone give one row of the paper": abs(on_hills[1, 0]) <= 0.03 and (np.delete(on_hills, 3) > 0.15).all(),
        "choices in view of the table": origins["reading of Table 1"] == origins["size of the scenes"] == TABLE,
        "choices in view of the text": origins["form of the random field"] == origins["bounds of LAI"] == TEXT,
        "assumptions": {name for name, origin in origins.items() if origin == "assumed"} == ASSUMED,
        "no threshold gives the paper's lengths": max(lengths) > 10 * min(lengths),
        "NDVI of the mean is lower": all(one["bias"] < 0 for one in NUMBERS["scaling"]),
        "the criterion of scaling is not met": all(abs(one["correlation"]) > 0.3 for one in NUMBERS["scaling"]),
        "limits are met": all(one["met"] for one in NUMBERS["limits"]),
        "noise follows from R2": all(0.8 < each["native"]["estimate"] / each["native"]["value"] < 1 for each in noise),
        "aligned noise is half the paper's": all(2 * each["aligned"]["value"] < each["paper"] for each in noise),
        "its estimate is lower": all(each["aligned"]["estimate"] < each["aligned"]["value"] for each in noise),
        "another spread misses it": all(
            each["native"]["by_other"] < 0.75 * each["paper"] for each in noise if each["variable"] == "lai"
        ),
    }
    assert [words for words, holds in statements.items() if not holds] == []


def text_values(quantity, name):
    """Values of a reading and of the paper, by variable and arp."""
    rows = (row for row in NUMBERS["text"][name] if row["quantity"] == quantity and row["paper"] is not None)
    return {(row["variable"], row["arp"]): row for row in rows}


def test_noise_estimate_agrees_with_normal_pairs(make_paper):
    """Eq. 7 from drawn pairs: residual standard deviation divided by slope and mean."""
    rng = np.random.default_rng(0)
    lai = 0.74 + 0.11 * rng.standard_normal(20_000)
    ndvi = 0.3 * lai + 0.03 * rng.standard_normal(lai.size)
    intercept, slope, r2 = friedl1995_table.line(lai, ndvi)
    expected = np.std(ndvi - intercept - slope * lai) / slope / lai.mean()
    assert make_paper.expected_noise(r2, lai.std() / lai.mean()) == pytest.approx(expected, rel=1e-9)


def test_noise_and_spread_agree_with_the_program(make_paper):
    """Three realisations, four standard errors. To update, run ``python docs/make_paper.py --only scenes``."""
    seeds = range(make_paper.SEED + 100, make_paper.SEED + 103)
    case, options = friedl1995.Case(), {"readings": [NATIVE, ALIGNED], "distributions": ["burned-grazed"]}
    found = friedl1995_table.realise_scenes(case, seeds, **options)["ren"].mean("realisation").squeeze("distribution")
    for name in ("native", "aligned"):
        for (variable, arp), row in text_values("ren", name).items():
            value = float(found.sel(reading=name, variable=variable, arp=arp))
            assert value == pytest.approx(row["value"], abs=4 * row["deviation"] * np.sqrt(1 / 3 + 1 / 20))
    for variable, by_arp in make_paper.spread(case, seeds).items():
        assert by_arp == pytest.approx(NUMBERS["spread"][variable], rel=0.05)


@pytest.mark.slow
def test_numbers_agree_with_the_program(make_paper):
    """
    Values without realisations, and Table 2 within the scatter of two realisations.

    To update, run ``python docs/make_paper.py``.
    """
    for name, found in make_paper._plain(make_paper.words(friedl1995.Case())).items():
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
