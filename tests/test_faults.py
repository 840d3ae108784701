"""Faults in long runs: killed processes and workers, full disks, broken files, and Ctrl-C."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
import rasterio
from typer.testing import CliRunner

from fifesim.cli import app
from fifesim.output.folders import UNFINISHED
from fifesim.output.run_folder import FILES

COMMAND = [sys.executable, "-c", "from fifesim.cli import app; app()", "simulate"]
# Tests that a script starts in the background ignore SIGINT, and child processes inherit this.
HEARS_CTRL_C = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
# Run that receives a signal as soon as the first block of its image is saved.
SIGNALLED = f"""
{HEARS_CTRL_C}
import os
from fifesim.cli import app
from fifesim.output import blocks

save = blocks.save_block

def and_signal(array, *given):
    save(array, *given)
    if array.path == "image":
        blocks.save_block = save
        os.kill(os.getpid(), SIGNAL)

blocks.save_block = and_signal
app()
"""
SCENARIO = """
[grid]
width = 7200
height = 4800

[ground]
seed = 3

[terrain]
horizon_reach = 900
"""
# Timeout, far longer than any step. [s]
PATIENCE = 300


def run(*arguments):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE)


def run_here(*arguments):
    """Run in this process, to save the import time."""
    return CliRunner().invoke(app, ["simulate", *map(str, arguments)])


def start(*arguments):
    return subprocess.Popen([*COMMAND, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def saved(folder):
    return [path for path in (folder / UNFINISHED / "blocks" / "image" / "c").rglob("*") if path.is_file()]


def wait_for_a_block(folder, process):
    while not saved(folder):
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)


def signalled(signal_number, *arguments):
    """Run that is ended by a signal after its first block."""
    code = SIGNALLED.replace("SIGNAL", str(int(signal_number)))
    command = [sys.executable, "-c", code, "simulate", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)


def contents(folder):
    return {name: (folder / name).read_bytes() for name in FILES}


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("faults") / "scenario.toml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="module")
def whole(scenario, tmp_path_factory):
    """Files of an undisturbed run."""
    folder = tmp_path_factory.mktemp("whole") / "out"
    done = run_here(scenario, "-o", folder, "--threads", 1)
    assert done.exit_code == 0, done.stderr
    return contents(folder)


def resumed(scenario, folder):
    done = run_here(scenario, "-o", folder, "--resume", "--json")
    assert done.exit_code == 0, done.stderr
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    return contents(folder), [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def killed_once(scenario, tmp_path_factory):
    """Folder of a run that was killed after its first block."""
    out = tmp_path_factory.mktemp("killed") / "out"
    assert signalled(signal.SIGKILL, scenario, "-o", out, "--threads", 1).returncode == -signal.SIGKILL
    return out


@pytest.fixture
def killed(killed_once, tmp_path):
    """A copy of the folder of a killed run."""
    return shutil.copytree(killed_once, tmp_path / "out")


@pytest.mark.slow
def test_killed_run_resumes_to_the_same_files(scenario, whole, killed):
    assert [path.name for path in killed.iterdir()] == [UNFINISHED]
    files, lines = resumed(scenario, killed)
    assert files == whole
    assert 0 < lines[0]["cells_done"] < lines[0]["cells"]


def all_of(folder):
    """Contents of every file of a folder, including files of a store."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def whole_scene(scenario, tmp_path_factory):
    """Files of an undisturbed run with the scene, and its duration. [s]"""
    folder, began = tmp_path_factory.mktemp("whole") / "scene", time.monotonic()
    assert run(scenario, "-o", folder, "--scene").returncode == 0
    return all_of(folder), time.monotonic() - began


# Options of killed runs, and the earliest time of the kill as a fraction of the duration.
WAYS = ((("--workers", 2), 0.0), (("--scene",), 0.0), (("--scene",), 0.8))


@pytest.mark.slow
@pytest.mark.parametrize("number", range(int(os.environ.get("FIFESIM_KILLS", len(WAYS)))))
def test_run_killed_at_any_time_resumes_to_the_same_files(scenario, whole, whole_scene, tmp_path, number):
    """FIFESIM_KILLS sets the number of runs."""
    (options, earliest), out = WAYS[number % len(WAYS)], tmp_path / "out"
    files, duration = whole_scene
    # The STAC item lists the files of its folder, so it differs between runs with and without the scene.
    expected = files if "--scene" in options else whole
    process = start(scenario, "-o", out, *options)
    time.sleep(duration * np.random.default_rng(number).uniform(earliest, 1))
    children = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
    process.kill()
    process.communicate()
    _, orphans = psutil.wait_procs(children, timeout=30)
    assert not orphans
    if not out.exists() or any(path.name == UNFINISHED for path in out.iterdir()):
        done = run(scenario, "-o", out, "--resume", *options[:1] * (options[:1] == ("--scene",)))
        assert done.returncode == 0, done.stderr
    found = all_of(out)
    assert found == {name: expected[name] for name in found} and set(FILES) <= set(found)
    assert ("--scene" in options) == (len(found) > len(FILES))


@pytest.mark.slow
@pytest.mark.parametrize("number", range(int(os.environ.get("FIFESIM_RIVALS", 1))))
@pytest.mark.parametrize("option", ["--overwrite", "--resume"])
def test_one_of_two_concurrent_runs_completes(scenario, whole, tmp_path, option, number):
    """FIFESIM_RIVALS sets the number of repetitions."""
    out = tmp_path / "out"
    processes = [start(scenario, "-o", out, option) for _ in range(2)]
    said = [process.communicate(timeout=PATIENCE)[1] for process in processes]
    assert sorted(process.returncode for process in processes) == [0, 2], said
    assert "in use by" in "".join(said)
    assert all_of(out) == whole


@pytest.mark.slow
def test_processes_sharing_an_empty_kernel_cache_give_the_same_files(tmp_path):
    (tmp_path / "small.toml").write_text("[grid]\nwidth = 300\nheight = 300\n")
    new = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    commands = [[*COMMAND, str(tmp_path / "small.toml"), "-o", str(tmp_path / str(number))] for number in range(2)]
    processes = [subprocess.Popen(command, env=new, stderr=subprocess.PIPE, text=True) for command in commands]
    said = [process.communicate(timeout=PATIENCE)[1] for process in processes]
    assert [process.returncode for process in processes] == [0] * 2, said
    assert contents(tmp_path / "0") == contents(tmp_path / "1")
    assert any((tmp_path / "cache").rglob("*.nbc"))


@pytest.mark.slow
def test_truncated_block_is_recomputed(scenario, whole, killed):
    block = saved(killed)[0]
    os.truncate(block, block.stat().st_size - 100)
    assert resumed(scenario, killed)[0] == whole


@pytest.mark.slow
def test_killed_worker_does_not_change_the_files(scenario, whole, tmp_path):
    out = tmp_path / "out"
    process = start(scenario, "-o", out, "--workers", 2)
    wait_for_a_block(out, process)
    children = psutil.Process(process.pid).children(recursive=True)
    workers = [child for child in children if any("spawn_main" in word for word in child.cmdline())]
    assert len(workers) >= 2
    workers[0].kill()
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    assert contents(out) == whole


@pytest.mark.slow
@pytest.mark.parametrize("options", [["--threads", 2], ["--workers", 1]])
def test_run_ended_by_ctrl_c_can_be_resumed(scenario, whole, tmp_path, options):
    out = tmp_path / "out"
    process = signalled(signal.SIGINT, scenario, "-o", out, *options)
    assert process.returncode == 130
    assert "--resume" in process.stderr and "Traceback" not in process.stderr
    assert [path.name for path in out.iterdir()] == [UNFINISHED]
    assert resumed(scenario, out)[0] == whole


STUDY = """
[grid]
width = 600
height = 600

[terrain]
dem = "flat"

[dataset]
landscapes = 4

[draw]
visibility = { uniform = ["10 km", 60] }
"""


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.3, 0.9, 2.4])
def test_ctrl_c_ends_all_processes_of_a_dataset_with_one_line(tmp_path, delay):
    """The signal reaches every process of the group, at any time after the first child has started."""
    (tmp_path / "study.toml").write_text(STUDY)
    code = f"{HEARS_CTRL_C}from fifesim.cli import app; app()"
    command = [sys.executable, "-c", code, "dataset", "study.toml", "-n", "4000", "--workers", "2"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=tmp_path, start_new_session=True, **pipes)
    try:
        while not (children := psutil.Process(process.pid).children(recursive=True)):
            assert process.poll() is None, process.communicate()
            time.sleep(0.01)
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 130, errors
    assert re.fullmatch(r"(fifesim: warning: [^\n]*\n)*fifesim: interrupted; [^\n]*\n", errors), errors
    assert not psutil.wait_procs(children, timeout=30)[1]


@pytest.fixture
def small_disk(tmp_path):
    """Function that mounts a file system with given options, such as a size."""
    place = tmp_path / "disk"
    place.mkdir()

    def mount(*options):
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", ",".join(options), "tmpfs", place], capture_output=True)
        if done.returncode:
            pytest.skip("a file system can only be mounted by root")
        return place

    yield mount
    subprocess.run(["umount", place], capture_output=True)


@pytest.mark.slow
@pytest.mark.parametrize("size", ["4k", "100k", "2000k", "3000k"])
def test_full_disk_leaves_only_finished_files(scenario, whole, small_disk, size):
    """The disk is full at the start, at the first blocks, at the last blocks, or when the final files are written."""
    out = small_disk(f"size={size}") / "out"
    done = run_here(scenario, "-o", out)
    assert done.exit_code == 1, done.stdout
    assert "space" in done.stderr and "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not out.exists() or [path.name for path in out.iterdir()] == [UNFINISHED]
    small_disk("remount", "size=64m")
    assert resumed(scenario, out)[0] == whole


def test_read_only_folder_error_names_the_folder(scenario, small_disk):
    place = small_disk("ro")
    done = run_here(scenario, "-o", place / "out")
    assert done.exit_code == 1
    assert "Read-only file system" in done.stderr and str(place) in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.fixture(scope="module")
def broken_dem(tmp_path_factory):
    """DEM file that is truncated."""
    path = tmp_path_factory.mktemp("dem") / "broken.tif"
    profile = {"driver": "GTiff", "width": 400, "height": 300, "count": 1, "dtype": "float32", "crs": "EPSG:26914"}
    transform = rasterio.transform.from_origin(702000, 4337000, 30, 30)
    heights = 400 + np.random.default_rng(1).normal(0, 1, (300, 400)).cumsum(axis=0).astype("float32")
    with rasterio.open(path, "w", **profile, transform=transform) as sink:
        sink.write(heights, 1)
    os.truncate(path, path.stat().st_size // 2)
    return path


def test_unreadable_dem_error_names_the_file(scenario, broken_dem, tmp_path):
    broken = tmp_path / "broken.toml"
    broken.write_text(SCENARIO + f'dem = "{broken_dem}"\n')
    done = run_here(broken, "-o", tmp_path / "out")
    assert done.exit_code == 1, done.stdout
    assert "broken.tif" in done.stderr and "Traceback" not in done.stderr
    assert not any((tmp_path / "out" / name).exists() for name in FILES)


@pytest.mark.slow
def test_other_scenario_cannot_resume_a_run(scenario, killed, tmp_path):
    other = tmp_path / "other.toml"
    other.write_text(SCENARIO.replace("seed = 3", "seed = 4"))
    done = run_here(other, "-o", killed, "--resume")
    assert done.exit_code == 2
    assert "seed = 3" in done.stderr and "--overwrite" in done.stderr
    assert saved(killed)
    refused = run_here(scenario, "-o", killed)
    assert refused.exit_code == 2 and "--resume" in refused.stderr
