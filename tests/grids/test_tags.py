"""The tag is read as what anybody may have written."""

import json

import numpy as np
import pytest
import rasterio
import xarray as xr

import fifesim
from fifesim.grids import tags
from fifesim.grids.grid import place

GOOD = {"name": "lai", "dims": ["y", "x"], "attrs": {}, "coords": {}}


def coordinate(**changed):
    return json.dumps(GOOD | {"coords": {"sza": {"dims": [], "values": 1.0, "dtype": "<f8", "attrs": {}} | changed}})


BAD = {
    "number": "1",
    "list": "[1]",
    "nothing": "null",
    "deep": "[" * 200_000,
    "long": "x" * 1_000_001,
    "escapes": '"\x1b[2J"',
    "dims": json.dumps(GOOD | {"dims": ["z", "x"]}),
    "dims twice": json.dumps(GOOD | {"dims": ["y", "x", "x"]}),
    "attrs": json.dumps(GOOD | {"attrs": [1]}),
    "missing": json.dumps({"name": "lai"}),
    "shape": coordinate(dims=["band"], values=[1.0, 2.0]),
    "nested": coordinate(dims=["band"], values=[[1.0]]),
    "object": coordinate(values={"a": 1}),
    "huge text": coordinate(values="a", dtype="<U500000000"),
    "unknown": coordinate(dtype="zz"),
    "record": coordinate(dtype="f8,f8"),
    "subarray": coordinate(dtype="(100000000,)f8"),
    "void": coordinate(dtype="V1000000000"),
    "no number": coordinate(values="a"),
    "place": json.dumps(GOOD | {"coords": {"y": {"dims": [], "values": 1.0, "dtype": "<f8", "attrs": {}}}}),
}


@pytest.fixture
def path(tmp_path):
    grid = fifesim.fife_site(30.0, window=((0, 4), (0, 5)))
    lai = place(xr.DataArray(np.ones((4, 5)), dims=("y", "x"), name="lai"), grid)
    return fifesim.to_geotiff(lai, tmp_path / "tagged.tif")


@pytest.mark.parametrize("text", BAD.values(), ids=BAD)
def test_a_foreign_tag_is_refused_by_the_name_of_its_file(path, text):
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="yes") as sink:
        sink.update_tags(**{tags.TAG: text})
    with pytest.raises(ValueError, match=r"tagged\.tif has a tag FIFESIM .*rioxarray\.open_rasterio") as said:
        fifesim.open_image(path)
    assert len(str(said.value)) <= 500 and str(said.value).isprintable()


def test_a_tag_that_fits_is_read(path):
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="yes") as sink:
        sink.update_tags(**{tags.TAG: coordinate()})
    assert float(fifesim.open_image(path)["sza"]) == 1.0
