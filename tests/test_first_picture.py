"""All panels of the figure on the first page come from one run."""

import importlib
import re
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture
def picture(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("make_first_picture")


def test_budget_of_the_picture_equals_the_scatter_of_its_run(picture, monkeypatch):
    sections = picture.scenario(cells=108).model_dump(exclude_unset=True)
    # Hills take most of the time.
    sections["terrain"] = {"dem": "flat"}
    found = picture.run(picture.Scenario(**sections))
    assert found.total == pytest.approx(1 - found.fit.r2, abs=1e-9)
    assert float(found.shares.sum()) == pytest.approx(found.total, abs=1e-9)

    for name, value in {"TOP": 1, "LEFT": 1, "SIDE": 9}.items():
        monkeypatch.setattr(picture, name, value)
    figure = picture.draw(found)
    titles = [axis.get_title(loc="left") for axis in figure.axes[:6]]
    r2, percent = (float(re.search(r"\d+\.\d+", title)[0]) for title in titles[4:])
    assert r2 + percent / 100 == pytest.approx(1, abs=0.00101)
    bars = [bar.get_width() for bar in figure.axes[5].patches]
    assert np.sum(bars) == pytest.approx(100 * found.total)
    assert percent > 5
    plt.close(figure)
