"""Stores of chips: sharded Zarr that xarray opens."""

import json
import shutil
import warnings
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
import zarr

import fifesim
from fifesim.output.blocks import is_saved, save_block
from fifesim.output.chips import store
from fifesim.output.chips.store import Shards, chip_arrays, layout_of, make_store


def write_shard(folder, shard, arrays):
    for name, values in arrays.items():
        save_block(zarr.open_array(folder, path=name), (shard,), values)


@pytest.fixture(scope="module")
def made(tmp_path_factory, chips_on):
    """A store of seven chips in shards of four, and the written arrays."""
    folder = tmp_path_factory.mktemp("chips")
    chips = chips_on(7, draws={"brown": {"choice": [0.0, 0.3]}})
    layout, shards = layout_of(chips), Shards(7, 1, 4)
    shards.length, shards.chunk = 4, 2
    make_store(folder, chips, layout, shards)
    arrays = {}
    for shard in range(2):
        first, last = shards.range_of(shard)
        arrays[first] = chip_arrays(chips, range(first, last), layout)
        write_shard(folder, shard, arrays[first])
    return folder, chips, layout, shards, arrays


def test_xarray_opens_the_store_without_a_warning(made):
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
    assert set(dataset.data_vars) == {"dn", "toa_reflectance", "ndvi", "lai", "fpar", "green_fpar"}
    assert {"split", "landscape", "atmosphere.visibility", "sza", "gain", "spatial_ref"} <= set(dataset.coords)


def test_saturated_pixels_have_no_reflectance(made):
    """The store states the number of saturated pixels, as the image does."""
    _, _, layout, _, arrays = made
    assert xr.open_zarr(made[0]).dn.attrs["saturated"] == layout.saturated == 255
    bright = {name: values.copy() for name, values in arrays[0].items()}
    bright["dn"][0, :, 1, 1] = 255
    light = store._reflectance(bright, layout)
    assert np.isnan(light[0, :, 1, 1]).all()
    np.testing.assert_array_equal(np.isnan(light).sum(), len(bright["dn"][0]) + (arrays[0]["dn"] == 0).sum())


def test_variables_have_units(made):
    dataset = xr.open_zarr(made[0])
    assert all({"units", "long_name"} <= set(each.attrs) for each in dataset.data_vars.values())
    assert dataset["atmosphere.visibility"].attrs == {"long_name": "meteorological range", "units": "km"}
    assert dataset.rio.crs.to_epsg() == 26914
    assert dataset.lai.attrs["standard_name"] == "leaf_area_index"
    assert np.diff(dataset.y.values).tolist() == [-30.0] * 5 and dataset.x.values[0] == 15


def test_each_shard_is_a_file(made):
    folder = made[0]
    files = sorted(path.relative_to(folder / "dn").as_posix() for path in (folder / "dn").rglob("0") if path.is_file())
    assert files == ["c/0/0/0/0", "c/1/0/0/0"]
    codecs = json.loads((folder / "dn" / "zarr.json").read_text())["codecs"]
    assert codecs[0]["name"] == "sharding_indexed" and codecs[0]["configuration"]["chunk_shape"] == [2, 2, 6, 6]
    raw = zarr.open_array(folder, path="dn", mode="r")
    assert raw.dtype == np.uint8 and raw.shards == (4, 2, 6, 6)


def test_creating_the_store_again_keeps_the_shards(made):
    folder, chips, layout, shards, _ = made
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    (folder / "dn" / "zarr.json").write_text("half")
    make_store(folder, chips, layout, shards)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("damage", ["changed", "truncated", "missing"])
def test_damaged_shard_is_found_and_replaced(made, tmp_path, damage):
    folder, _, layout, _, arrays = made
    copied = shutil.copytree(folder, tmp_path / "chips")
    path = copied / "lai" / "c" / "1" / "0" / "0"
    content = path.read_bytes()
    path.write_bytes(content[:-1] + b"?" if damage == "changed" else content[:20])
    if damage == "missing":
        path.unlink()
    whole = [name for name in layout.variables if is_saved(zarr.open_array(copied, path=name), (1,))]
    assert set(layout.variables) - set(whole) == {"lai"} and is_saved(zarr.open_array(copied, path="lai"), (0,))
    write_shard(copied, 1, arrays[4])
    assert path.read_bytes() == content


@pytest.mark.parametrize("name", ["chip/c/0", "sza/c/0", "lai/c/0/0/0"])
def test_damaged_numbers_of_chips_are_not_read(made, tmp_path, name):
    """Without checksums, many of these bits change numbers of the dataset."""
    path = shutil.copytree(made[0], tmp_path / "chips") / name
    whole = path.read_bytes()
    for at in range(0, len(whole), max(len(whole) // 40, 1)):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(ValueError, match=r"[Cc]hecksum"):
            xr.open_zarr(tmp_path / "chips")[name.split("/")[0]].load()


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


def test_error_names_the_chip_with_different_truth_variables(made):
    _, chips, layout, *_ = made
    without = layout._replace(truth=("lai", "fpar"))
    with pytest.raises(ValueError, match=r"chip \d: has a true property that others lack, green_fpar"):
        chip_arrays(chips, range(0, 7), without)


GRASS = {"landscape": {"cover": "voronoi"}, "classes": {"grass": {}, "burned": {"distribution": "burned-grazed"}}}


@pytest.mark.parametrize(
    "sections",
    [
        {"sensor": {"instrument": "MSI"}},
        {"sensor": {"instrument": "L4TM", "offset": [0.5, -1.2], "noise": ["all"]}},
        {"sensor": {"instrument": "L4TM", "interval": 30.0}, **GRASS},
        {"sensor": {"instrument": "MSI"}, "terrain": {"dem": "flint-hills"}},
        {"sensor": {"instrument": "MSI"}, "atmosphere": {"adjacency": True}},
    ],
    ids=["blur", "offset", "cover", "hills", "adjacency"],
)
def test_chips_have_no_missing_pixels(chips_on, sections):
    """Edge pixels see the surrounding ground; each chip equals its scenario simulated with that ground."""
    chips = chips_on(3, **sections)
    found = chip_arrays(chips, range(3), layout_of(chips))
    for name in ("toa_reflectance", "ndvi", "lai", "fpar"):
        assert np.isfinite(found[name]).all(), name
    assert (found["dn"] > 0).all()
    run = fifesim.simulate(chips.scenario(2), complete=True)
    np.testing.assert_array_equal(found["dn"][2], run["image"]["dn"])
    np.testing.assert_array_equal(found["lai"][2], run["truth"]["lai"].values.astype(np.float32))
    bare = fifesim.simulate(chips.scenario(2))
    assert run["scene"].sizes == bare["scene"].sizes
    np.testing.assert_array_equal(run["truth"]["lai"], bare["truth"]["lai"])
    if "atmosphere" not in sections:
        # Closer to the edge, pixels of the scene without surroundings see only 98 to 100 % of their footprint.
        middle = (..., slice(size := bare["image"].sizes["y"] // 2 - 1, -size), slice(size, -size))
        assert (run["image"]["dn"].values[middle] > 0).all()
        np.testing.assert_array_equal(run["image"]["dn"].values[middle], bare["image"]["dn"].values[middle])


def test_edge_pixels_equal_those_of_a_larger_scene(small):
    scenario = small(sensor={"instrument": "L4TM"})
    image = fifesim.simulate(scenario, complete=True)["image"]["dn"]
    grid = scenario.geobox().pad(90)
    larger = {"west": grid.affine.c, "north": grid.affine.f, "width": 780.0, "height": 780.0}
    whole = fifesim.simulate(small(grid=larger, sensor={"instrument": "L4TM"}))["image"]["dn"]
    np.testing.assert_array_equal(image, whole.sel(y=image.y, x=image.x, method="nearest", tolerance=0.01))
    with pytest.raises(ValueError, match=r"no ground beyond the scene: use method = \"streaming\""):
        fifesim.simulate(small(ground={"method": "periodic"}), complete=True)
