"""What a file was made of, in its own tags."""

import json
import tomllib

import rasterio

from fifesim.output.folders import versions
from fifesim.output.run.identity import PRODUCT, SCENARIO_TAG, VERSIONS, origin_tags
from fifesim.scenario.scenario import parse_scenario, read_scenario
from fifesim.scenario.toml import write_scenario


def test_tags_hold_the_scenario_and_what_computed_it(travelled):
    with rasterio.open(travelled / "truth.tif") as source:
        tags = source.tags()
    assert tags[SCENARIO_TAG] == write_scenario(read_scenario(travelled / "scenario.toml"))
    assert (tags[PRODUCT], json.loads(tags[VERSIONS])) == ("truth.tif", versions())


def test_files_are_named_from_where_the_file_lies(tmp_path):
    """So that nobody reads in an image where its maker's files are, and all can be moved together."""
    data = tmp_path / "data" / "hills.tif"
    data.parent.mkdir()
    data.touch()
    scenario = parse_scenario({"terrain": {"dem": str(data)}})
    for folder, expected in ((tmp_path / "out", "../data/hills.tif"), (data.parent, "hills.tif")):
        text = origin_tags(scenario, "image.tif", folder)[SCENARIO_TAG]
        assert tomllib.loads(text)["terrain"]["dem"] == expected
        assert str(tmp_path) not in text
    virtual = parse_scenario({"terrain": {"dem": "/vsizip/hills.zip/hills.tif"}})
    assert "/vsizip/hills.zip/hills.tif" in origin_tags(virtual, "image.tif", tmp_path)[SCENARIO_TAG]
