"""Datasets of chips: complete or absent, and the same bits after interruptions and with any workers."""

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import warnings
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np
import psutil
import pytest
import xarray as xr
import zarr

import fifesim
from fifesim.output.chips import folder as chips_folder
from fifesim.output.chips import store
from fifesim.output.chips.folder import dataset_to_folder, study_to_resume
from fifesim.output.chips.makers import jobs_of, made_shards, processes
from fifesim.output.chips.store import Shards, chip_arrays, layout_of
from fifesim.output.folders import UNFINISHED
from fifesim.output.workers import cluster
from fifesim.scenario.studies import Study

DRAWS = {"visibility": {"uniform": [10, 60]}, "ground.brown": {"choice": [0.0, 0.3]}, "sza": {"uniform": [20, 50]}}

SUN = {"sza": 30.0, "saa": 120.0}

COUNT = 7


@pytest.fixture
def small_shards(monkeypatch):
    """Use shards of two chips, so that there are four shards."""
    monkeypatch.setattr(store, "_FEWEST", 2)


@pytest.fixture(scope="module")
def study(small):
    return Study(small(geometry=SUN), DRAWS, landscapes=3, seed=5)


@pytest.fixture(scope="module")
def whole(study, tmp_path_factory):
    """A dataset written without interruption, in shards of two chips."""
    folder = tmp_path_factory.mktemp("whole") / "chips.zarr"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store, "_FEWEST", 2)
        dataset_to_folder(study, folder, COUNT)
    return folder


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def interrupt_after(monkeypatch, after, error=KeyboardInterrupt):
    """Make the computation of chips fail with an error."""
    made, realise = [], store.realise_arrays

    def stop(*arguments, **options):
        made.append(1)
        if len(made) > after:
            raise error
        return realise(*arguments, **options)

    monkeypatch.setattr(store, "realise_arrays", stop)
    return made


@pytest.mark.slow
def test_function_returns_the_dataset_written_by_two_processes(small_shards, study, whole, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(study.to_toml())
    found = fifesim.dataset(path, tmp_path / "chips.zarr", COUNT, workers=2)
    assert not multiprocessing.active_children()
    assert contents(tmp_path / "chips.zarr") == contents(whole)
    xr.testing.assert_identical(found, xr.open_zarr(whole))
    assert found.sizes == {"chip": COUNT, "band": 2, "y": 6, "x": 6}


@pytest.mark.slow
def test_workers_of_a_cluster_give_the_same_bits(small_shards, study, whole, tmp_path):
    with cluster(workers=2) as client:
        dataset_to_folder(study, tmp_path / "chips.zarr", COUNT, client=client)
    assert contents(tmp_path / "chips.zarr") == contents(whole)


def test_chip_equals_its_simulated_scenario(study, whole):
    """Green FPAR equals FPAR in chips without dead leaves."""
    scenario = fifesim.scenario.chips_of(study, COUNT).scenario(4)
    run, chips = fifesim.simulate(scenario, complete=True), xr.open_zarr(whole, mask_and_scale=False)
    chip, image, truth = chips.isel(chip=4), run["image"], run["truth"]
    expected = {"ndvi": image["ndvi"], "toa_reflectance": image["dn"].fifesim.to_reflectance()}
    for name, values in (expected | {"lai": truth["lai"], "fpar": truth["fpar"]}).items():
        np.testing.assert_array_equal(chip[name], values.astype(np.float32))
    np.testing.assert_array_equal(chip.dn, image["dn"])
    assert float(chip.sza) == float(image["sza"])
    assert float(chip["atmosphere.visibility"]) == scenario.atmosphere.visibility
    assert set(chips["ground.brown"].values) == {0.0, 0.3}
    np.testing.assert_array_equal((chips.green_fpar == chips.fpar).all(("y", "x")), chips["ground.brown"] == 0)


@pytest.mark.parametrize("truncated", [False, True])
def test_resumed_run_gives_the_same_bits(small_shards, truncated, study, whole, tmp_path, monkeypatch):
    """Of three complete shards of two chips, a truncated one is computed again."""
    folder = tmp_path / "chips.zarr"
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        interrupt_after(patch, 6)
        dataset_to_folder(study, folder, COUNT)
    assert {path.name for path in folder.iterdir()} == {UNFINISHED}
    assert study_to_resume(folder) == (study, COUNT)
    with pytest.raises(ValueError, match="has an unfinished run"):
        dataset_to_folder(study, folder, COUNT)
    if truncated:
        half = folder / UNFINISHED / "lai" / "c" / "1" / "0" / "0"
        half.write_bytes(half.read_bytes()[:100])
        (folder / UNFINISHED / "zarr.json").unlink()
    made = interrupt_after(monkeypatch, 100)
    dataset_to_folder(study, folder, COUNT, resume=True)
    assert len(made) == COUNT - 6 + 2 * truncated
    assert contents(folder) == contents(whole)


def test_resuming_a_finished_dataset_computes_nothing(study, whole, tmp_path, monkeypatch):
    folder = tmp_path / "chips.zarr"
    shutil.copytree(whole, folder)
    made = interrupt_after(monkeypatch, 0)
    dataset_to_folder(study, folder, COUNT, resume=True)
    assert not made and contents(folder) == contents(whole)
    assert study_to_resume(folder) == (study, COUNT)
    other = Study(study.scenario, DRAWS, landscapes=3, seed=6)
    for asked, count, said in (
        (study, 8, r"dataset of 7 chips, not 8: give that number.*--overwrite"),
        (other, COUNT, r"of another scenario, with seed = 5.*--overwrite"),
    ):
        with pytest.raises(ValueError, match=said):
            dataset_to_folder(asked, folder, count, resume=True)
    assert contents(folder) == contents(whole)
    for name in ("dn", "lai"):
        (folder / name / "c" / "1" / "0" / "0").rename(tmp_path / name)
    shutil.rmtree(folder / "sza" / "c")
    with pytest.raises(ValueError, match=r"lacks files of dn, lai, sza: make it again with --overwrite"):
        dataset_to_folder(study, folder, COUNT, resume=True)


def test_earlier_dataset_is_replaced_completely(small_shards, whole, study, tmp_path, monkeypatch):
    """The root, which marks a complete store, is removed first and added last."""
    folder, replace, moved = tmp_path / "chips.zarr", os.replace, []
    dataset_to_folder(Study(study.scenario, {"vza": {"uniform": [0, 20]}}, landscapes=3), folder, 3)
    assert (folder / "geometry.vza").is_dir()
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="is not empty"):
        dataset_to_folder(study, folder, COUNT)

    def move(source, target):
        moved.extend([Path(target).name] * (folder in (Path(source).parent, Path(target).parent)))
        replace(source, target)

    monkeypatch.setattr(os, "replace", move)
    dataset_to_folder(study, folder, COUNT, overwrite=True)
    assert contents(folder) == contents(whole) | {"notes.txt": b"mine"}
    assert moved[0] == moved[-1] == "zarr.json" and len(moved) > 20


def test_invalid_study_is_reported_before_anything_is_written(study, small, tmp_path, monkeypatch):
    draws = {"brown": {"choice": [0.3, 0.95]}, "landscape.deviations.brown": {"choice": [0.05, 0.25]}}
    with pytest.raises(ValueError, match=r"chip \d+: landscape\.deviations: brown"):
        dataset_to_folder(Study(study.scenario, draws, landscapes=3), tmp_path / "chips.zarr", 20)
    wide = small(grid={"width": 30_000.0, "height": 30_000.0}, geometry=SUN)
    far = fifesim.scenario.chips_of(Study(wide, DRAWS, landscapes=1, split={"all": 1.0}), 60_000)
    monkeypatch.setattr(chips_folder, "_LOOKED_AT", 1)
    with pytest.raises(ValueError, match=r"chip 59999: .*use more landscapes, so that chips are closer"):
        chips_folder._look_at(far)
    interrupt_after(monkeypatch, 4, ValueError("cannot be"))
    with pytest.raises(ValueError, match=r"chip \d: cannot be"):
        dataset_to_folder(study, tmp_path / "chips.zarr", COUNT)
    assert list(tmp_path.iterdir()) == []


def list_shards(length, count=30):
    shards = Shards(count, 1, length)
    shards.length = length
    return shards


@pytest.mark.parametrize("dem", ["flat", "flint-hills"])
def test_jobs_are_ordered_by_shard_and_hills_are_computed_once_for_several_shards(chips_on, dem):
    chips, shards = chips_on(30, 6, terrain={"dem": dem}), list_shards(6)
    for wanted in (range(5), [1, 4]):
        jobs = jobs_of(chips, shards, wanted, 2)
        expected = np.concatenate([np.arange(*shards.range_of(shard)) for shard in wanted])
        np.testing.assert_array_equal(np.sort(np.concatenate(jobs)), expected)
    jobs = jobs_of(chips, shards, range(5), 2)
    if dem == "flat":
        assert (np.diff(np.concatenate(jobs) // 6) >= 0).all()
        assert all(len(set(job // 6)) == 1 for job in jobs)
    else:
        assert all(len(set(chips.landscape[job])) == 1 for job in jobs)
        assert [len(job) for job in jobs] == [4] * 6 + [1] * 6


@pytest.mark.slow
def test_killed_process_is_reported(chips_on):
    chips = chips_on(7)
    shards, said = list_shards(3, 7), "ended unexpectedly, perhaps from lack of memory"
    with pytest.raises(RuntimeError, match=said), processes(1) as makers:
        for _ in made_shards(chips, layout_of(chips), shards, [0, 1, 2], [].append, makers):
            (process,) = multiprocessing.active_children()
            os.kill(process.pid, signal.SIGKILL)


ORPHANS = """
import os, signal
from fifesim.output.chips.makers import processes
if __name__ == "__main__":
    with processes(1) as makers:
        print(makers.executor.submit(os.getpid).result(), flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_processes_end_with_their_parent(tmp_path):
    (tmp_path / "main.py").write_text(ORPHANS)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, tmp_path / "main.py"]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment)
    with suppress(psutil.NoSuchProcess):
        psutil.Process(int(done.stdout)).wait(timeout=30)
    assert not psutil.pid_exists(int(done.stdout))


def test_xarray_opens_the_store_without_a_warning(study, whole):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dataset = xr.open_zarr(whole).load()
    table = fifesim.scenario.chips_of(study, COUNT).table()
    for name in table.data_vars:
        np.testing.assert_array_equal(dataset[name].values, table[name].values)
    assert set(dataset.data_vars) == {"dn", "toa_reflectance", "ndvi", "lai", "fpar", "green_fpar"}
    assert {"split", "landscape", "atmosphere.visibility", "sza", "gain", "spatial_ref"} <= set(dataset.coords)
    assert all({"units", "long_name"} <= set(each.attrs) for each in dataset.data_vars.values())
    assert dataset["atmosphere.visibility"].attrs == {"long_name": "meteorological range", "units": "km"}
    files = sorted(path.relative_to(whole / "dn").as_posix() for path in (whole / "dn").rglob("0") if path.is_file())
    assert files == [f"c/{shard}/0/0/0" for shard in range(4)]
    assert zarr.open_array(whole, path="dn", mode="r").shards == (2, 2, 6, 6)
    assert dataset.dn.encoding["dtype"] == np.uint8 and dataset.rio.crs.to_epsg() == 26914
    assert np.diff(dataset.y.values).tolist() == [-30.0] * 5 and dataset.x.values[0] == 15


def test_saturated_pixels_have_no_reflectance(whole, chips_on):
    """The store states the number of saturated pixels, as the image does."""
    chips = chips_on(2)
    layout = layout_of(chips)
    assert xr.open_zarr(whole).dn.attrs["saturated"] == layout.saturated == 255
    bright = chip_arrays(chips, range(2), layout)
    missing = (bright["dn"] == 0).sum()
    bright["dn"][0, :, 1, 1] = 255
    light = store._reflectance(bright, layout)
    assert np.isnan(light[0, :, 1, 1]).all() and np.isnan(light).sum() == len(bright["dn"][0]) + missing
    with pytest.raises(ValueError, match=r"chip \d: has a true property that others lack, green_fpar"):
        chip_arrays(chips_on(2, draws={"brown": {"choice": [0.3]}}), range(2), layout._replace(truth=("lai", "fpar")))


@pytest.mark.parametrize("name", ["chip/c/0", "sza/c/0", "lai/c/0/0/0"])
def test_damaged_numbers_of_chips_are_not_read(whole, tmp_path, name):
    """Without checksums, many of these bits change numbers of the dataset."""
    path = shutil.copytree(whole, tmp_path / "chips") / name
    content = path.read_bytes()
    for at in range(0, len(content), max(len(content) // 40, 1)):
        path.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
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


def test_edge_pixels_equal_those_of_a_larger_scene(small):
    scenario = small(sensor={"instrument": "L4TM"})
    image = fifesim.simulate(scenario, complete=True)["image"]["dn"]
    grid = scenario.geobox().pad(90)
    larger = {"west": grid.affine.c, "north": grid.affine.f, "width": 780.0, "height": 780.0}
    whole = fifesim.simulate(small(grid=larger, sensor={"instrument": "L4TM"}))["image"]["dn"]
    np.testing.assert_array_equal(image, whole.sel(y=image.y, x=image.x, method="nearest", tolerance=0.01))
    with pytest.raises(ValueError, match=r"no ground beyond the scene: use method = \"streaming\""):
        fifesim.simulate(small(ground={"method": "periodic"}), complete=True)
