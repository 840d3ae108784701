"""The datasheet says what the dataset holds."""

import html
import re

import numpy as np
import pytest
import xarray as xr

from fifesim.output.chips import datasheet
from fifesim.output.chips.store import Shards
from fifesim.scenario.chips import chips_of
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study

SMALL = {"grid": {"width": 180.0, "height": 180.0}, "terrain": {"dem": "flat"}}
DRAWS = {"visibility": {"uniform": [10, 60]}, "distribution": {"choice": ["burned-grazed", "burned-ungrazed"]}}
COUNT = 11


@pytest.fixture(scope="module")
def chips():
    return chips_of(Study(parse_scenario(SMALL), DRAWS, landscapes=3), COUNT)


@pytest.fixture(scope="module")
def dataset(chips):
    generator = np.random.default_rng(0)
    lai = generator.random((COUNT, 6, 6)).astype(np.float32)
    lai[:, 0, 0] = np.nan
    found = xr.Dataset({"lai": (("chip", "y", "x"), lai, {"long_name": "leaf area index", "units": "1"})})
    found = found.assign_coords(band=["TM3", "TM4"], split=("chip", chips.split))
    return found.assign_attrs(title="11 simulated chips")


def shards_of_four():
    shards = Shards(COUNT, 1, 4)
    shards.length = 4
    return shards


def test_ranges_are_those_of_all_chips(dataset, chips):
    (found,) = datasheet.ranges_of(dataset, shards_of_four()).values()
    values = dataset["lai"].values.astype(float)
    assert (found["least"], found["greatest"]) == (np.nanmin(values), np.nanmax(values))
    assert found["mean"] == pytest.approx(np.nanmean(values), rel=1e-12)
    assert found["without"] == pytest.approx(1 / 36, rel=1e-12)
    for part in ("train", "validation", "test"):
        assert found["means"][part] == pytest.approx(np.nanmean(values[chips.split == part]), rel=1e-12)


def test_what_has_no_data_has_no_range(dataset):
    (found,) = datasheet.ranges_of(dataset * np.nan, shards_of_four()).values()
    assert found["without"] == 1 and np.isnan(found["mean"])


@pytest.fixture(scope="module")
def page(dataset, chips):
    return datasheet.datasheet_page(dataset, chips, datasheet.ranges_of(dataset, shards_of_four()), b"picture")


def test_page_names_what_is_drawn_and_how(page, chips):
    for name in ("atmosphere.visibility", "ground.distribution", "ground.seed"):
        assert f"<code>{name}</code>" in page
    row = re.search(r"<code>atmosphere\.visibility</code>.*?</tr>", page, re.S)[0]
    column = chips.table()["atmosphere.visibility"].values
    assert "uniform, 10 to 60" in row and "km" in row
    assert all(f"{value:.4g}" in row for value in (column.min(), column.mean(), column.max()))
    assert "one of burned-grazed, burned-ungrazed" in page and "a scrambled Sobol sequence, seed 0" in page


def test_page_counts_chips_and_landscapes(page, chips):
    for part in ("train", "validation", "test"):
        row = re.search(rf"<tr><td>{part}</td>.*?</tr>", page, re.S)[0]
        numbers = [int(number) for number in re.findall(r'class="n">(\d+)<', row)]
        own = chips.split == part
        assert numbers == [len(set(chips.landscape[own].tolist())), int(own.sum())]


@pytest.mark.parametrize(("count", "said"), [(1, "<b>{} have none</b>"), (2, "<b>{} has none</b>"), (3, None)])
def test_page_says_why_a_part_has_no_chips(count, said, dataset):
    chips = chips_of(Study(parse_scenario(SMALL), DRAWS, landscapes=3), count)
    part = dataset.isel(chip=range(count))
    page = datasheet.datasheet_page(part, chips, datasheet.ranges_of(part, Shards(count, 1, 4)), b"")
    empty = [name for name in ("train", "validation", "test") if name not in chips.split]
    assert ("fewer chips than landscapes" in page) is bool(said)
    assert "none</b>" not in page if said is None else said.format(" and ".join(empty)) in page


def test_page_is_self_contained_and_has_the_study(page, chips):
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert chips.study.to_toml() in html.unescape(page)
