"""The picture of the front pages shows its scene, and the pages state the numbers of runs."""

import json
import re
import warnings
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import make_landscape_budget
import make_picture as picture
import make_why_scatter as why
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

import fifesim

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
NUMBERS = picture.numbers()
# Largest difference between a number of the picture and a run.
LARGEST = 0.005


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


def text(path):
    return (ROOT / path).read_text(encoding="utf-8")


def test_picture_shows_image_cells_pixels_and_fit(monkeypatch, tmp_path):
    for name, value in {"TOP": 5, "LEFT": 8, "SIDE": 4}.items():
        monkeypatch.setattr(picture, name, value)
    scene = picture.front(((1800, 1980), (2700, 2880)))
    fit = scene.fit()
    figure = picture.draw(scene, fit)
    colour, green, cells, pixels, scatter = figure.axes[:5]
    ndvi = scene.image.fifesim.ndvi()
    shown = [axis.get_images()[0].get_array() for axis in (colour, green, cells, pixels)]
    assert shown[0].shape == (20, 20, 3)
    np.testing.assert_array_equal(shown[1].filled(np.nan), ndvi)
    np.testing.assert_array_equal(shown[2], scene.land.lai[45:81, 72:108])
    np.testing.assert_array_equal(shown[3], ndvi[5:9, 8:12])
    (frame,) = green.patches
    assert (frame.get_xy(), frame.get_width()) == ((7.5, 4.5), 4)
    (line,) = scatter.get_lines()
    slope = np.diff(line.get_ydata()) / np.diff(line.get_xdata())
    used = np.isfinite(ndvi.values)
    expected = np.polyfit(ndvi.values[used], scene.truth.values[used], 1)[0]
    assert slope[0] == pytest.approx(expected)
    assert scatter.get_title(loc="left") == f"LAI by NDVI: R² = {fit.r2:.2f}"

    picture.save(figure, {"front": fit.r2}, tmp_path / "picture.png")
    monkeypatch.setattr(picture, "FILE", tmp_path / "picture.png")
    assert picture.numbers() == {"front": fit.r2}


def table_rows(page, start):
    """Cells of the rows of a table after a text of a page, without emphasis and links."""
    (table, *_) = re.findall(r"(?:^\|.*\n)+", text(page).partition(start)[2], re.MULTILINE)
    lines = re.sub(r"\[(.*?)\]\(.*?\)|\*\*", r"\1", table).splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_front_pages_state_the_numbers_of_the_picture():
    readme, index = text("README.md"), text("docs/index.md")
    for page, link in ((readme, "docs/_static"), (index, "_static")):
        assert f"({link}/{picture.FILE.name})" in page
    assert f"```text\nR² = {NUMBERS['front']:.2f}\n```" in readme
    assert "{include} ../README.md" in index
    (rows, columns), code = picture.WINDOW, text("docs/gallery_src/plot_0_ten_minutes.py")
    assert f"window=({rows}, {columns})" in readme and f"window=({rows}, {columns})" in code
    # The reader of the report of the default run finds the same number.
    assert f"{NUMBERS['run']:.2f}" == f"{NUMBERS['front']:.2f}"


def test_table_of_r2_states_the_runs():
    budget = pd.read_csv(make_landscape_budget.TABLE).set_index(["instrument", "variable", "stage"])
    paper = json.loads(text("docs/paper.json"))["table2"]["native"]
    stand = next(
        row["r2"]
        for row in paper
        if (row["variable"], row["distribution"], row["arp"]) == ("lai", "burned-grazed", 0.15)
    )
    (percent,) = re.findall(r"unexplained: (\d+) % of the variance\n", text("docs/why_scatter.md"))
    names = ["front", "MSI", "registration", "noise", "registration and noise", "haze", "run"]
    expected = [NUMBERS[name] for name in names]
    expected += [np.mean(NUMBERS["budget"]), 1 - budget.loc[("TM", "lai", "total"), "share"], NUMBERS["panel"]]
    expected += [1 - int(percent) / 100, stand]
    rows = table_rows("docs/why_scatter.md", "## Why R² differs between pages")
    assert [row[-1] for row in rows] == [f"{value:.2f}" for value in expected]
    least, most = re.findall(r"R² of the 20 parts of 1.1 km ranges from (.*?) to (.*?):", text("docs/why_scatter.md"))[
        0
    ]
    assert [least, most] == [f"{end:.2f}" for end in (min(NUMBERS["budget"]), max(NUMBERS["budget"]))]
    moved = f"{fifesim.instrument('TM').geolocation:g} m"
    assert [row[3] for row in rows[:7]] == ["none", "none", moved, "none", moved, "none", "none"]
    assert rows[7][1] == f"mean of {picture.REALISATIONS} parts of {picture.CELLS / 300:.1f} km"
    cells, parts = make_landscape_budget.WINDOWS["TM"]
    assert rows[8][1] == f"mean of {parts} parts of {cells / 300:g} km" and rows[9][1] == f"{why.CELLS / 300:g} km"


def test_answers_of_the_readme():
    """The numbers of the answers, from the picture and from the tables of the linked pages."""
    rows = table_rows("README.md", "<!-- questions -->")
    answers = [re.findall(r"\d+\.\d+|\d+(?= %)", answer) for _, answer in rows]
    shares, table = why.shares(), pd.read_csv(DOCS / "intervals.csv")
    within, tm = "variation of LAI within pixels", shares["TM"]
    chosen = table.query("instrument == 'OLI' and level == 'toa' and method == 'quantiles' and prior == 'landscapes'")
    rmse = chosen[chosen["images"] == "as in the training"].set_index("pixels")["rmse"]
    causes = ("geolocation error", "curved relation between LAI and NDVI", "noise and digital numbers")
    expected = [
        [f"{100 * NUMBERS['front']:.0f}"],
        [f"{tm[cause]:.0f}" for cause in causes],
        [f"{-NUMBERS['change of NDVI in haze']:.2f}", "0.01"],
        [f"{tm[within]:.0f}", f"{shares['MODIS'][within]:.0f}"],
        [f"{rmse['uniform']:.2f}", f"{rmse['chain']:.2f}"],
    ]
    assert answers == expected
    assert 0 < NUMBERS["front"] - NUMBERS["haze"] < 0.01


@pytest.mark.slow
def test_numbers_of_the_picture_agree_with_runs():
    """To update, run ``python docs/make_picture.py``."""
    scene = picture.front()
    found = picture.changes(scene) | {"run": picture.default_run(), "panel": picture.panel()}
    assert found == pytest.approx({name: NUMBERS[name] for name in found}, abs=LARGEST)
    assert picture.budgets(2) == pytest.approx(NUMBERS["budget"][:2], abs=LARGEST)


@pytest.mark.slow
def test_ten_minutes_has_the_front_scene_and_no_warning():
    """Also its statement that a curve, unlike a line, fits leaf area better with MSI than with TM."""
    printed, names = StringIO(), {}
    with warnings.catch_warnings(), redirect_stdout(printed):
        warnings.simplefilter("error", UserWarning)
        exec(compile(text("docs/gallery_src/plot_0_ten_minutes.py"), "ten minutes", "exec"), names)
    assert names["fit"].r2 == pytest.approx(NUMBERS["front"], abs=LARGEST)
    assert f"explains {100 * NUMBERS['front']:.0f} % of the variance" in printed.getvalue()
    lines, curves, deviations = {}, {}, {}
    for name, size in (("TM", 30), ("MSI", 10)):
        ndvi, truth = (
            names["images"][name]["dn"].fifesim.ndvi().values,
            names["land"].lai.fifesim.aggregate(size).values,
        )
        used = np.isfinite(ndvi) & np.isfinite(truth)
        ndvi, truth = ndvi[used], truth[used]
        lines[name] = np.corrcoef(ndvi, truth)[0, 1] ** 2
        curves[name] = 1 - np.var(truth - np.polyval(np.polyfit(ndvi, truth, 4), ndvi)) / np.var(truth)
        deviations[name] = truth.std()
    assert lines["MSI"] == pytest.approx(NUMBERS["MSI"], abs=LARGEST) and lines["MSI"] < lines["TM"]
    assert curves["MSI"] > curves["TM"] and deviations["MSI"] > deviations["TM"]
