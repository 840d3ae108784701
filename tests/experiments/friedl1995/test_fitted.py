"""What is fitted, and how near is near."""

import numpy as np
import pytest

from fifesim.experiments.friedl1995 import effects
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import case_of


def by_name(case):
    return {row.name: row for row in effects.number_sources(case)}


def test_fitted_numbers_are_counted():
    """Three means and deviations, four of leaves, two of background, the size of the scenes, and the reading."""
    assert effects.fitted_count(case_of()) == 3 + 3 + 4 + 2 + 1 + 1
    rows = by_name(case_of())
    assert rows["elevation"].origin == rows["hour and view"].origin == "assumed"
    assert rows["bounds of LAI"].origin == rows["form of the random field"].origin == "fitted to the text"
    assert rows["mean LAI"].text.startswith("0.74, 1.41, 1.18 (burned-grazed, burned-ungrazed, unburned-ungrazed)")


def test_what_a_reader_gives_is_not_called_fitted(folders, tmp_path):
    case = case_of(reading="aligned", cells=90, **folders)
    rows = by_name(case)
    assert effects.fitted_count(case) == 0
    for name in ("densities of LAI", "leaf reflectance and transmittance", "background", "size of the scenes"):
        assert rows[name].origin == "given by you"
    assert by_name(case_of(sensor="OLI"))["instrument"].origin == "given by you"


@pytest.fixture
def table(found):
    """A Table 2 that is the paper's own, in which a sample scatters by a tenth."""
    table = friedl1995_table.table2(found.sel(reading="native"))
    for name in friedl1995_table.COEFFICIENTS:
        table[name], table[f"{name}_deviation_200"] = table[f"paper_{name}"], 0.1
    return table


def test_the_papers_own_numbers_meet_every_limit(table):
    rows = effects.limits(table, table)
    assert len(rows) == 10 and all(row["met"] and row["value"] == row["beside"] == 0 for row in rows)


@pytest.mark.parametrize(
    ("column", "change", "name"),
    [
        ("r2", 0.13, "R² of LAI, largest difference of nine rows"),
        ("intercept", -0.3, "intercept of LAI"),
        ("slope", 0.5, "slope of LAI"),
    ],
)
def test_one_number_beyond_its_limit_is_named(table, column, change, name):
    other = table.copy()
    table.loc[table.index[table["variable"] == "lai"][0], column] += change
    rows = effects.limits(table, other)
    missed = [row["name"] for row in rows if not row["met"]]
    assert len(missed) == 1 and missed[0].startswith(name)
    assert all(row["beside"] == 0 for row in rows)
    assert [row["name"] for row in effects.limits(other, table) if not row["met"]] == []


def test_limits_are_told_in_deviations_of_a_sample(table):
    told = {row["name"]: row["deviations"] for row in effects.limits(table, table)}
    assert told["R² of LAI, largest difference of nine rows"] == pytest.approx(1.2)
    assert told["R² of LAI, root mean square difference"] == pytest.approx(0.6)
    assert told["intercept of LAI, largest difference"] == pytest.approx(2.5)
    smallest = table[table["variable"] == "lai"]["paper_slope"].min()
    assert told["slope of LAI, largest relative difference"] == pytest.approx(0.15 / (0.1 / smallest))
    long = table["arp"] == 0.24
    table.loc[long, "r2_deviation_200"] = 0.02
    told = {row["name"]: row["deviations"] for row in effects.limits(table, table)}
    assert told["R² of FPAR, largest difference at arp 0.24"] == pytest.approx(4)
    assert told["R² of FPAR, root mean square difference"] == pytest.approx(0.06 / np.sqrt((6 * 0.01 + 3 * 0.0004) / 9))


def test_limits_of_this_experiment_are_of_the_order_of_a_samples_scatter(found):
    native, aligned = (friedl1995_table.table2(found.sel(reading=name)) for name in ("native", "aligned"))
    assert all(1 < row["deviations"] < 3.5 for row in effects.limits(native, aligned))
