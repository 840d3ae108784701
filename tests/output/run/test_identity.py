"""A run goes on with what it was begun with, and with files that did not change."""

import json
import os

import numpy as np
import pytest
import rasterio
import rasterio.shutil

from fifesim.base import datasets
from fifesim.output.folders import BEGUN
from fifesim.output.run.identity import NotThisRun, begin, check_inputs, identity_of, inputs_of
from fifesim.scenario.scenario import parse_scenario

SMALL = {"grid": {"width": 90, "height": 90}, "terrain": {"dem": "flat"}}


@pytest.fixture
def lai_file(tmp_path):
    """A VRT, and the file that it names."""
    source = tmp_path / "source.tif"
    profile = {"driver": "GTiff", "width": 9, "height": 9, "count": 1, "dtype": "float32", "crs": "EPSG:26914"}
    with rasterio.open(
        source, "w", **profile, transform=rasterio.transform.from_origin(704970, 4334220, 30, 30)
    ) as sink:
        sink.write(np.full((1, 9, 9), 2.0, "float32"))
    rasterio.shutil.copy(source, tmp_path / "lai.vrt", driver="VRT")
    return tmp_path / "lai.vrt"


def test_files_that_others_name_are_inputs(lai_file, tmp_path):
    text = datasets.path("instruments/avhrr9.toml").read_text(encoding="utf-8").replace('"AVHRR"', '"MINE"', 1)
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    (tmp_path / "avhrr_response.csv").write_bytes(datasets.path("avhrr_response.csv").read_bytes())
    (tmp_path / "samples.csv").write_text("lai\n" + "\n".join(map(str, np.linspace(0.5, 3, 50))), encoding="utf-8")
    ground = {"lai_file": str(lai_file), "distribution": str(tmp_path / "samples.csv")}
    sensor = {"instrument": str(tmp_path / "mine.toml"), "bands": ["AVHRR1"], "pixel": 30}
    found = inputs_of(parse_scenario(SMALL | {"ground": ground, "sensor": sensor}))
    names = {os.path.basename(name) for name in found}
    assert names == {"lai.vrt", "source.tif", "mine.toml", "avhrr_response.csv", "samples.csv"}


def test_a_table_of_bands_is_an_input(tmp_path):
    """It says how wide the bands are and what noise they have, as the instrument's file does."""
    (tmp_path / "bands.csv").write_text("name,center,width\nred,0.668,0.010\nnir,0.840,0.040\n")
    (tmp_path / "mine.toml").write_text('name = "Mine"\naltitude = 7e5\ngsd = 30.0\nbits = 12\nbands = "bands.csv"\n')
    found = inputs_of(parse_scenario(SMALL | {"sensor": {"instrument": str(tmp_path / "mine.toml")}}))
    assert {os.path.basename(name) for name in found} == {"mine.toml", "bands.csv"}


def scenario_of(lai_file):
    return parse_scenario(SMALL | {"ground": {"lai_file": str(lai_file)}}).complete()


def test_a_source_that_changed_is_told_at_resume_and_at_the_end(lai_file, tmp_path):
    identity = identity_of(scenario_of(lai_file), False)
    begin(tmp_path, identity)
    check_inputs(scenario_of(lai_file), identity)
    with rasterio.open(tmp_path / "source.tif", "r+") as sink:
        sink.write(np.full((1, 9, 9), 3.0, "float32"))
    with pytest.raises(ValueError, match=r"source\.tif changed while it was read"):
        check_inputs(scenario_of(lai_file), identity)
    with pytest.raises(NotThisRun, match=r"an input file that has changed.*--overwrite"):
        begin(tmp_path, identity_of(scenario_of(lai_file), False))


@pytest.mark.parametrize("text", ["[]", "{}", "{", "1", '{"versions": []}'])
def test_a_state_that_no_run_wrote_is_named(tmp_path, text):
    identity = identity_of(parse_scenario(SMALL).complete(), False)
    begin(tmp_path, identity)
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(NotThisRun, match=r"run\.json is not what a run writes.*--overwrite"):
        begin(tmp_path, identity)


@pytest.mark.parametrize(("key", "said"), [("versions", "other versions"), ("scene", "--scene or without")])
def test_another_state_is_not_gone_on_with(tmp_path, key, said):
    identity = identity_of(parse_scenario(SMALL).complete(), False)
    begin(tmp_path, identity)
    state = json.loads(identity["run.json"])
    other = identity | {"run.json": json.dumps(state | {key: {} if key == "versions" else True})}
    with pytest.raises(NotThisRun, match=said):
        begin(tmp_path, other)


def test_another_scenario_is_not_gone_on_with(tmp_path):
    begin(tmp_path, identity_of(parse_scenario(SMALL).complete(), False))
    other = identity_of(parse_scenario(SMALL | {"ground": {"seed": 8}}).complete(), False)
    with pytest.raises(NotThisRun, match=r"seed = 7.*--overwrite"):
        begin(tmp_path, other)
    assert (tmp_path / BEGUN).is_file()
