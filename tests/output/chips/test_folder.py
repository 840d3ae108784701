"""Dataset folders are complete or absent, and have the same bits after interruptions and with any workers."""

import multiprocessing
import os
import re
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.output.chips import folder as chips_folder
from fifesim.output.chips import store
from fifesim.output.chips.folder import dataset_to_folder, study_to_resume
from fifesim.output.folders import UNFINISHED
from fifesim.scenario.studies import Study

DRAWS = {"visibility": {"uniform": [10, 60]}, "ground.brown": {"choice": [0.0, 0.3]}, "sza": {"uniform": [20, 50]}}
SUN = {"sza": 30.0, "saa": 120.0}
COUNT = 7


@pytest.fixture(scope="module", autouse=True)
def small_shards():
    """Use shards of two chips, so that there are four shards."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(store, "_FEWEST", 2)
        yield


@pytest.fixture(scope="module")
def study(small):
    return Study(small(geometry=SUN), DRAWS, landscapes=3, seed=5)


@pytest.fixture(scope="module")
def whole(study, tmp_path_factory):
    """A dataset written without interruption."""
    folder = tmp_path_factory.mktemp("whole") / "chips.zarr"
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


def test_function_returns_the_written_dataset(study, whole, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(study.to_toml())
    found = fifesim.dataset(path, tmp_path / "chips.zarr", COUNT)
    assert contents(tmp_path / "chips.zarr") == contents(whole)
    xr.testing.assert_identical(found, xr.open_zarr(whole))
    assert found.sizes == {"chip": COUNT, "band": 2, "y": 6, "x": 6}


def test_chip_equals_its_simulated_scenario(study, whole):
    run = fifesim.simulate(fifesim.scenario.chips_of(study, COUNT).scenario(4), complete=True)
    chip = xr.open_zarr(whole, mask_and_scale=False).isel(chip=4)
    image, truth = run["image"], run["truth"]
    expected = {"ndvi": image["ndvi"], "toa_reflectance": image["dn"].fifesim.to_reflectance()}
    for name, values in (expected | {"lai": truth["lai"], "fpar": truth["fpar"]}).items():
        np.testing.assert_array_equal(chip[name], values.astype(np.float32))
    np.testing.assert_array_equal(chip.dn, image["dn"])
    assert float(chip.sza) == float(image["sza"])
    assert (
        float(chip["atmosphere.visibility"]) == fifesim.scenario.chips_of(study, 40).scenario(4).atmosphere.visibility
    )


def test_green_fpar_equals_fpar_without_dead_leaves(whole):
    chips = xr.open_zarr(whole)
    assert set(chips["ground.brown"].values) == {0.0, 0.3}
    alike = (chips.green_fpar == chips.fpar).all(("y", "x"))
    np.testing.assert_array_equal(alike, chips["ground.brown"] == 0)


def interrupt(monkeypatch, study, folder, after):
    """Interrupt the writing of a dataset after some chips."""
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        interrupt_after(patch, after)
        dataset_to_folder(study, folder, COUNT)


# There are two chips in each shard.
@pytest.mark.parametrize("after", [3, 6])
def test_resumed_run_gives_the_same_bits(after, study, whole, tmp_path, monkeypatch):
    folder = tmp_path / "chips.zarr"
    interrupt(monkeypatch, study, folder, after)
    assert {path.name for path in folder.iterdir()} == {UNFINISHED}
    assert study_to_resume(folder) == (study, COUNT)
    with pytest.raises(ValueError, match="has an unfinished run"):
        dataset_to_folder(study, folder, COUNT)
    made = interrupt_after(monkeypatch, 100)
    dataset_to_folder(study, folder, COUNT, resume=True)
    assert len(made) == COUNT - 2 * (after // 2)
    assert contents(folder) == contents(whole)


def test_resuming_a_finished_dataset_computes_nothing(study, whole, tmp_path, monkeypatch):
    folder = tmp_path / "chips.zarr"
    shutil.copytree(whole, folder)
    made = interrupt_after(monkeypatch, 0)
    dataset_to_folder(study, folder, COUNT, resume=True)
    assert not made and contents(folder) == contents(whole)
    assert study_to_resume(folder) == (study, COUNT)
    with pytest.raises(ValueError, match=r"dataset of 7 chips, not 8: give that number.*--overwrite"):
        dataset_to_folder(study, folder, 8, resume=True)
    other = Study(study.scenario, DRAWS, landscapes=3, seed=6)
    with pytest.raises(ValueError, match=r"of another scenario, with seed = 5.*--overwrite"):
        dataset_to_folder(other, folder, COUNT, resume=True)
    assert contents(folder) == contents(whole)
    for name in ("dn", "lai"):
        (folder / name / "c" / "1" / "0" / "0").rename(tmp_path / name)
    shutil.rmtree(folder / "sza" / "c")
    with pytest.raises(ValueError, match=r"lacks files of dn, lai, sza: make it again with --overwrite"):
        dataset_to_folder(study, folder, COUNT, resume=True)


def test_truncated_shards_are_ignored(study, whole, tmp_path, monkeypatch):
    folder = tmp_path / "chips.zarr"
    interrupt(monkeypatch, study, folder, 6)
    hidden = folder / UNFINISHED
    half = hidden / "lai" / "c" / "1" / "0" / "0"
    half.write_bytes(half.read_bytes()[:100])
    (hidden / "dn" / "c" / "2" / "0" / "0").mkdir(parents=True, exist_ok=True)
    (hidden / "dn" / "c" / "2" / "0" / "0" / "0.1f2e.partial").write_bytes(b"half")
    (hidden / "zarr.json").unlink()
    dataset_to_folder(study, folder, COUNT, resume=True)
    assert contents(folder) == contents(whole)


def test_failed_run_leaves_no_files(study, tmp_path, monkeypatch):
    interrupt_after(monkeypatch, 4, ValueError("cannot be"))
    with pytest.raises(ValueError, match=r"chip \d: cannot be"):
        dataset_to_folder(study, tmp_path / "chips.zarr", COUNT)
    assert list(tmp_path.iterdir()) == []


def test_earlier_dataset_is_replaced_completely(whole, study, tmp_path):
    folder = tmp_path / "chips.zarr"
    sun = Study(study.scenario, {"vza": {"uniform": [0, 20]}}, landscapes=3)
    dataset_to_folder(sun, folder, 3)
    assert (folder / "geometry.vza").is_dir()
    (folder / "notes.txt").write_text("mine")
    (folder / "datasheet.html").write_text("of an earlier version")
    with pytest.raises(ValueError, match="is not empty"):
        dataset_to_folder(study, folder, COUNT)
    dataset_to_folder(study, folder, COUNT, overwrite=True)
    assert contents(folder) == contents(whole) | {"notes.txt": b"mine"}


@pytest.fixture(scope="module")
def earlier(study, tmp_path_factory):
    """A dataset of another seed, with the same arrays."""
    folder = tmp_path_factory.mktemp("earlier") / "chips.zarr"
    dataset_to_folder(Study(study.scenario, DRAWS, landscapes=3, seed=6), folder, COUNT)
    return folder


@pytest.mark.parametrize("number", [1, 2, 8, 20, 40])
def test_run_killed_between_moves_leaves_no_mixed_store(earlier, whole, study, tmp_path, monkeypatch, number):
    folder, replace, moved = tmp_path / "chips.zarr", os.replace, []
    shutil.copytree(earlier, folder)

    def killed(source, target):
        moved.extend([target] * (folder in (Path(source).parent, Path(target).parent)))
        if len(moved) >= number:
            raise KeyboardInterrupt
        replace(source, target)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(os, "replace", killed)
        dataset_to_folder(study, folder, COUNT, overwrite=True)
    if number == 1:
        xr.testing.assert_identical(xr.open_zarr(folder), xr.open_zarr(earlier))
    else:
        with pytest.raises(FileNotFoundError):
            xr.open_zarr(folder)
    dataset_to_folder(study, folder, COUNT, resume=True)
    assert contents(folder) == contents(whole)


def test_invalid_study_is_reported_before_anything_is_written(study, small, tmp_path, monkeypatch):
    draws = {"brown": {"choice": [0.3, 0.95]}, "landscape.deviations.brown": {"choice": [0.05, 0.25]}}
    with pytest.raises(ValueError, match=r"chip \d+: landscape\.deviations: brown"):
        dataset_to_folder(Study(study.scenario, draws, landscapes=3), tmp_path / "chips.zarr", 20)
    wide = small(grid={"width": 30_000.0, "height": 30_000.0}, geometry=SUN)
    far = fifesim.scenario.chips_of(Study(wide, DRAWS, landscapes=1, split={"all": 1.0}), 60_000)
    monkeypatch.setattr(chips_folder, "_LOOKED_AT", 1)
    with pytest.raises(ValueError, match=r"chip 59999: .*use more landscapes, so that chips are closer"):
        chips_folder._look_at(far)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("count", "none"), [(1, "test and (train|validation)"), (2, "(test|train|validation)")])
def test_part_without_chips_gives_a_warning(count, none, study):
    chips = fifesim.scenario.chips_of(study, count)
    with pytest.warns(UserWarning, match=rf"no chip for {none}: {count} chips are in as many of 3 landscapes.*-n"):
        chips_folder._warn_of_empty_parts(chips)


def test_drawn_file_is_an_input(tmp_path, study):
    samples = tmp_path / "mine.csv"
    samples.write_text("lai\n0.5\n0.7\n0.9\n1.1\n1.4\n")
    draws = {"distribution": {"choice": ["burned-grazed", str(samples)]}}
    chips = fifesim.scenario.chips_of(Study(study.scenario, draws, landscapes=3), 2)
    assert list(chips_folder._inputs(chips)) == [str(samples)]


def test_documented_loader_reads_each_chip_of_a_part_once(whole, monkeypatch):
    """PyTorch is replaced by a stub in which this process is the second of two workers that share the shards."""
    page = Path(__file__).parents[3] / "docs" / "howto" / "training_set.md"
    (block,) = re.findall(r"^:class: no-run\n(.*?)^```", page.read_text("utf-8"), re.S | re.M)
    workers = [SimpleNamespace(id=number, num_workers=2) for number in (0, 1)]
    data = SimpleNamespace(IterableDataset=object, DataLoader=lambda chips, **options: chips)
    data.get_worker_info = lambda: workers[0]
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(utils=SimpleNamespace(data=data), from_numpy=np.asarray))
    monkeypatch.chdir(whole.parent)
    names = {}
    exec(compile(block, page, "exec"), names)
    found = list(names["loader"])
    data.get_worker_info = lambda: workers[1]
    found += list(names["loader"])
    store = xr.open_zarr(whole)
    train = store.isel(chip=np.flatnonzero(store.split == "train"))
    assert len(found) == train.sizes["chip"]
    expected = {(x.tobytes(), y.tobytes()) for x, y in zip(train.toa_reflectance.values, train.lai.values, strict=True)}
    assert {(x.tobytes(), y.tobytes()) for x, y in found} == expected


def test_processes_give_the_same_bits_and_end(study, whole, tmp_path):
    fifesim.dataset(study, tmp_path / "chips.zarr", COUNT, workers=2)
    assert not multiprocessing.active_children()
    assert contents(tmp_path / "chips.zarr") == contents(whole)


@pytest.mark.parametrize(
    ("workers", "client", "said"),
    [
        (0, None, "at least 1, got 0"),
        (2.0, None, "at least 1, got 2.0"),
        (2, type("Client", (), {})(), "give one of them"),
    ],
)
def test_processes_must_be_a_number_or_a_client(workers, client, said, study, tmp_path):
    with pytest.raises(ValueError, match=said):
        fifesim.dataset(study, tmp_path / "chips.zarr", 2, workers=workers, client=client)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_workers_of_a_cluster_give_the_same_bits(study, whole, tmp_path):
    from fifesim.output.workers import cluster

    with cluster(workers=2) as client:
        dataset_to_folder(study, tmp_path / "chips.zarr", COUNT, client=client)
    assert contents(tmp_path / "chips.zarr") == contents(whole)
