"""Stores of chips: sharded Zarr that xarray opens."""

import json
import warnings
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
import zarr

from fifesim.output.chips.store import Shards, checksums, chip_arrays, layout_of, make_store, stored_names, write_shard
from fifesim.scenario.chips import chips_of
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.studies import Study

SMALL = {"grid": {"width": 180.0, "height": 180.0}, "terrain": {"dem": "flat"}}
DRAWS = {"visibility": {"uniform": [10, 60]}, "distribution": {"choice": ["burned-grazed", "burned-ungrazed"]}}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A store of seven chips in shards of four, and what was written."""
    folder = tmp_path_factory.mktemp("chips")
    chips = chips_of(Study(parse_scenario(SMALL), DRAWS, landscapes=3), 7)
    layout, shards = layout_of(chips), Shards(7, 1, 4)
    shards.length, shards.chunk = 4, 2
    make_store(folder, chips, layout, shards)
    arrays = {}
    for shard in range(2):
        first, last = shards.range_of(shard)
        arrays[first] = chip_arrays(chips, range(first, last), layout)
        write_shard(folder, first, arrays[first])
    return folder, chips, layout, shards, arrays


def test_xarray_opens_it_without_a_warning(made):
    folder, chips, layout, _, arrays = made
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dataset = xr.open_zarr(folder).load()
    for name in layout.variables:
        both = np.concatenate([arrays[0][name], arrays[4][name]])
        np.testing.assert_array_equal(dataset[name].values, both.astype(dataset[name].dtype))
    table = chips.table()
    for name in table.data_vars:
        np.testing.assert_array_equal(dataset[name].values, table[name].values)
    assert set(dataset.data_vars) == {"dn", "toa_reflectance", "ndvi", "lai", "fpar"}
    assert {"split", "landscape", "atmosphere.visibility", "sza", "gain", "spatial_ref"} <= set(dataset.coords)


def test_what_it_holds_says_its_units(made):
    dataset = xr.open_zarr(made[0])
    assert all({"units", "long_name"} <= set(each.attrs) for each in dataset.data_vars.values())
    assert dataset["atmosphere.visibility"].attrs == {"long_name": "meteorological range", "units": "km"}
    assert dataset.rio.crs.to_epsg() == 26914
    assert dataset.lai.attrs["standard_name"] == "leaf_area_index"
    assert np.diff(dataset.y.values).tolist() == [-30.0] * 5 and dataset.x.values[0] == 15


def test_chips_lie_in_the_shards_of_their_ranges():
    shards = Shards(50, 30_000, 12)
    for shard in range(len(shards)):
        assert set(shards.shard_of(np.arange(*shards.range_of(shard)))) == {shard}


def test_a_shard_is_a_file(made):
    folder = made[0]
    files = sorted(path.relative_to(folder / "dn").as_posix() for path in (folder / "dn").rglob("0") if path.is_file())
    assert files == ["c/0/0/0/0", "c/1/0/0/0"]
    codecs = json.loads((folder / "dn" / "zarr.json").read_text())["codecs"]
    assert codecs[0]["name"] == "sharding_indexed" and codecs[0]["configuration"]["chunk_shape"] == [2, 2, 6, 6]
    raw = zarr.open_array(folder, path="dn", mode="r")
    assert raw.dtype == np.uint8 and raw.shards == (4, 2, 6, 6)


def test_making_it_again_leaves_the_shards(made):
    folder, chips, layout, shards, _ = made
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    (folder / "dn" / "zarr.json").write_text("half")
    make_store(folder, chips, layout, shards)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_names_are_those_of_its_folders(made):
    folder, chips, layout, _, _ = made
    assert {path.name for path in folder.iterdir()} == {*stored_names(chips, layout), "zarr.json"}


def test_checksums_find_a_changed_byte_and_a_missing_file(made, tmp_path):
    folder, chips, layout, shards, arrays = made
    names = list(layout.variables)
    make_store(tmp_path, chips, layout, shards)
    write_shard(tmp_path, 4, arrays[4])
    whole = checksums(tmp_path, names, 1)
    np.testing.assert_array_equal(whole, checksums(folder, names, 1))
    path = tmp_path / "lai" / "c" / "1" / "0" / "0"
    path.write_bytes(path.read_bytes()[:-1] + b"?")
    assert (checksums(tmp_path, names, 1) != whole).sum() == 1
    path.unlink()
    with pytest.raises(OSError):
        checksums(tmp_path, names, 1)


@pytest.mark.parametrize(
    ("count", "size", "together", "length"),
    [(10_000, 35_634, 450, 450), (1000, 35_634, 450, 250), (30, 35_634, 450, 20), (10_000, 2**26, 450, 1)],
)
def test_shards_are_large_enough_to_share_tiles_and_small_enough_for_memory(count, size, together, length):
    shards = Shards(count, size, together)
    assert shards.length == length and length % shards.chunk == 0
    ranges = [shards.range_of(shard) for shard in range(len(shards))]
    assert ranges[0][0] == 0 and ranges[-1][1] == count
    assert all(before[1] == after[0] for before, after in pairwise(ranges))
