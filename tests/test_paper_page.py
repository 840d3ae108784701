"""The page on the paper is made of its numbers, and they bear its conclusions."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ALIGNED, NATIVE, PASSAGES, READINGS

DOCS = Path(__file__).parents[1] / "docs"
NUMBERS = json.loads((DOCS / "paper.json").read_text(encoding="utf-8"))

# The two sentences of the paper on cells and pixels, by section.
SENTENCES = {
    "Ground Scene Model": "For example, the simulations performed for this work used ground scene cell dimensions "
    "roughly 0.11 times the size of the sensor IFOV (i.e., 9² ground cells per simulated sensor pixel).",
    "Analyses": "To do this, we defined the high resolution ground scene as being composed of uniform cells with a "
    "spatial dimension of 3.33 m, or 81 (9²) ground scene elements per 30-m TM pixel.",
}

# What the paper states, and round numbers of the definitions.
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
    """Values of LAI by treatment and arp, shape (3, 3)."""
    return np.array([row[f"{name} {treatment} {arp:g}"] for treatment, arp in friedl1995.scenes()]).reshape(3, 3)


def test_page_is_made_of_its_numbers(make_paper):
    """Else run ``python docs/make_paper.py --text``."""
    assert (DOCS / "paper.md").read_text(encoding="utf-8") == make_paper.text(NUMBERS)


def test_no_number_of_the_page_is_typed_by_hand():
    text = re.sub(r"\{\{.*?\}\}|\{%.*?%\}", "", (DOCS / "paper.md.j2").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert set(re.findall(r"(?<![\w.])\d+\.\d+", text)) <= STATED


def test_numbers_bear_the_statements_of_the_page(make_paper):
    """The numbers are made anew with each change of the model, and the words of the template stay."""
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


def in_a_line(path):
    """Text of a page or of an example without its line breaks."""
    return re.sub(r"\s+", " ", path.read_text(encoding="utf-8").replace("\n# ", " "))


def rows_below(heading):
    """Cells of the first table of the page below some words, without its head."""
    page = (DOCS / "paper.md").read_text(encoding="utf-8")
    lines = page[page.index(heading) :].splitlines()
    table = lines[next(k for k, line in enumerate(lines) if line.startswith("|")) :]
    end = next(k for k, line in enumerate(table) if not line.startswith("|"))
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table[2:end]]


def of_text(quantity, name):
    """Values of a reading and the paper's, by variable and arp."""
    rows = (row for row in NUMBERS["text"][name] if row["quantity"] == quantity and row["paper"] is not None)
    return {(row["variable"], row["arp"]): row for row in rows}


def percent(ratio):
    """A relative difference as the page prints it."""
    return f"{100 * (ratio - 1):+.0f} %".replace("-", "−")


def test_passages_are_sentences_of_the_paper():
    assert PASSAGES.keys() == SENTENCES.keys()
    assert all(passage in SENTENCES[section] for section, passage in PASSAGES.items())


def test_page_quotes_both_passages_before_it_explains_the_reading():
    page = in_a_line(DOCS / "paper.md")
    reading = page[page.index("## Registration") : page.index("## Relief")]
    for part in (page[: page.index("## Table 2")], reading[: reading.index("`fifesim reproduce` nevertheless")]):
        assert "for pixels that are aligned with the blocks" in part
        assert all(f'"{passage}" (*{section}*)' in part for section, passage in PASSAGES.items())
    assert all(f'"{passage}"' in page[page.index("## Deviations") :] for passage in PASSAGES.values())
    cells = (43e-6 * 705_000 / (30 / 9)) ** 2
    assert f"would hold {cells:.1f}." in reading


@pytest.mark.parametrize("path", ["physics.md", "gallery_src/instruments/plot_2_point_spread.py"])
def test_other_pages_quote_the_passage_of_the_paper(path):
    assert f'aligned pixels: "{PASSAGES["Analyses"]}"' in in_a_line(DOCS / path)


def test_every_printed_noise_is_of_its_reading():
    """Values and deviations are those of the numbers, the paper's those of its text, percentages of what is printed."""
    stated = friedl1995.paper_text().query("quantity == 'ren'").set_index(["variable", "arp"])["value"]
    native, aligned = of_text("ren", "native"), of_text("ren", "aligned")
    rows = rows_below("**Mean relative equivalent")
    assert len(rows) == len(stated) == len(native) == len(aligned) == 6
    for variable, arp, paper, *cells, _, _ in rows:
        key = variable.lower(), float(arp)
        assert paper == f"{stated[key]:.2f}"
        for one, (value, difference) in zip((native[key], aligned[key]), (cells[:2], cells[2:]), strict=True):
            assert value == f"{one['value']:.3f} ± {one['deviation']:.3f}"
            assert difference == percent(float(value[:5]) / float(paper))


def test_noise_of_the_summary_is_that_of_the_table():
    page, rows = in_a_line(DOCS / "paper.md"), rows_below("**Mean relative equivalent")[:3]
    native, aligned, paper = ([row[k][:5] for row in rows] for k in (3, 5, 2))
    said = "for LAI it is {} with drifting pixels and {} with aligned ones; the paper has {}."
    assert said.format(*(f"{a}, {b} and {c}" for a, b, c in (native, aligned, paper))) in page
    lower = [row[k].lstrip("−") for k in (4, 6) for row in rows]
    said = "REN of LAI is {}, {} and {} below the paper's, with aligned pixels {}, {} and {}."
    assert said.format(*lower) in page


def test_noise_is_listed_as_fitted_and_not_as_found():
    page = in_a_line(DOCS / "paper.md")
    fitted, found = page.index("**Fitted to Table 2:**"), page.index("**Found**")
    assert fitted < page.index("(REN) follows approximately from R²") < page.index("**Fitted to the paper's text:**")
    assert "REN" not in page[found : page.index("## Table 2")]


def test_estimate_of_noise_is_that_of_a_normal_pair(make_paper):
    """Deviation about the line over the slope and the mean, which is Eq. 7, of drawn pairs."""
    rng = np.random.default_rng(0)
    lai = 0.74 + 0.11 * rng.standard_normal(20_000)
    ndvi = 0.3 * lai + 0.03 * rng.standard_normal(lai.size)
    intercept, slope, r2 = friedl1995_table.line(lai, ndvi)
    expected = np.std(ndvi - intercept - slope * lai) / slope / lai.mean()
    assert make_paper.expected_noise(r2, lai.std() / lai.mean()) == pytest.approx(expected, rel=1e-9)


def test_noise_and_spread_are_those_of_this_program(make_paper):
    """Of three realisations, within four standard errors. Else run ``python docs/make_paper.py --only scenes``."""
    seeds = range(make_paper.SEED + 100, make_paper.SEED + 103)
    case, options = friedl1995.Case(), {"readings": [NATIVE, ALIGNED], "distributions": ["burned-grazed"]}
    found = friedl1995_table.realise_scenes(case, seeds, **options)["ren"].mean("realisation").squeeze("distribution")
    for name in ("native", "aligned"):
        for (variable, arp), row in of_text("ren", name).items():
            value = float(found.sel(reading=name, variable=variable, arp=arp))
            assert value == pytest.approx(row["value"], abs=4 * row["deviation"] * np.sqrt(1 / 3 + 1 / 20))
    for variable, by_arp in make_paper.spread(case, seeds).items():
        assert by_arp == pytest.approx(NUMBERS["spread"][variable], rel=0.05)


def test_pixels_keep_more_of_the_range_than_the_papers():
    """In all rows; LAI at arp 0.24 has the largest difference, NDVI at arp 0.05 the largest relative one."""
    native, aligned = of_text("range_kept", "native"), of_text("range_kept", "aligned")
    rows = rows_below("**Share of the cells' range")
    assert len(rows) == len(native) == 6
    for variable, arp, paper, value, difference, relative, other in rows:
        key = variable.lower(), float(arp)
        assert paper == f"{native[key]['paper']:.2f}"
        for text, one in ((value, native[key]), (other, aligned[key])):
            assert text == f"{one['value']:.3f} ± {one['deviation']:.3f}"
        assert difference == f"{float(value[:5]) - float(paper):+.3f}" and difference[0] == "+"
        assert relative == percent(float(value[:5]) / float(paper))
    widest, steepest = (max(rows, key=lambda row: float(row[k].rstrip(" %"))) for k in (4, 5))
    said = (
        f"The difference is largest for {widest[0]} at arp {widest[1]} ({widest[3][:5]} compared with {widest[2]}), "
        f"the relative difference for {steepest[0]} at arp {steepest[1]} ({steepest[5]})."
    )
    assert said in in_a_line(DOCS / "paper.md")
    one = native["lai", 0.24]
    assert one["value"] > one["paper"] + 3 * one["deviation"]


@pytest.mark.slow
def test_numbers_are_those_of_this_program(make_paper):
    """Sizes that need no realisation, and Table 2 within the scatter of two. Else run ``python docs/make_paper.py``."""
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
