"""Criteria of the page: what is met, and what is not."""

import numpy as np
import pandas as pd
import pytest

from fifesim.experiments.friedl1995 import report, table
from fifesim.experiments.friedl1995.case import ARPS, paper_table, paper_text


@pytest.fixture
def perfect():
    """A Table 2 and a text that are the paper's own."""
    paper = paper_table()
    columns = {name: paper[name] for name in table.COEFFICIENTS}
    columns |= {f"paper_{name}": paper[name] for name in table.COEFFICIENTS}
    columns |= {f"{name}_deviation_200": np.ones(len(paper)) for name in table.COEFFICIENTS}
    text = paper_text().rename(columns={"value": "paper"})
    return pd.concat([paper[["variable", "distribution", "arp"]], pd.DataFrame(columns)], axis=1), text.assign(
        value=text["paper"]
    )


def test_the_papers_own_numbers_meet_every_limit_but_those_on_growth(perfect):
    rows = report.criteria(*perfect)
    beside = [row for row in rows if not row["name"].startswith("mean REN of")]
    assert all(row["met"] and row["value"] == 0 for row in beside)
    growth = {row["name"].split()[3]: row["value"] for row in rows if row["name"].startswith("mean REN of")}
    ren = perfect[1][perfect[1]["quantity"] == "ren"].set_index(["variable", "arp"])["paper"]
    for variable in ("lai", "fpar"):
        assert growth[variable.upper()] == ren[variable, max(ARPS)] / ren[variable, min(ARPS)]


@pytest.mark.parametrize(
    ("column", "change", "name"),
    [("r2", 0.13, "R² of LAI, largest difference of nine rows"), ("intercept", -0.3, "intercept of LAI")],
)
def test_one_number_beyond_its_limit_is_named(perfect, column, change, name):
    found, text = perfect
    found.loc[found.index[found["variable"] == "lai"][0], column] += change
    missed = [row["name"] for row in report.criteria(found, text) if not row["met"]]
    assert len(missed) >= 1 and missed[0].startswith(name)
