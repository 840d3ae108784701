"""Estimates count what a run has, in words and as JSON."""

import json
import subprocess
import sys
import time

import numpy as np
import pytest

from fifesim.output import report
from fifesim.output.run import folder as estimates
from fifesim.output.run import workers
from fifesim.output.run.folder import estimate, estimate_in_words, simulate_to_folder
from fifesim.scenario.scenario import parse_scenario

FOUND = {"cells": 72900, "pixels": 900, "tasks": 12, "threads": 2, "memory": 2**30, "disk": 2**20, "seconds": 90.0}


def test_cells_and_pixels_are_those_of_the_scenario(monkeypatch):
    monkeypatch.setattr(report, "png", lambda figure, dpi: b"")
    scenario = parse_scenario({"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}})
    found, with_scene = estimate(scenario, threads=1), estimate(scenario, threads=1, scene=True)
    assert found["cells"] == 90 * 90 and found["pixels"] == 100
    assert with_scene["disk"] - found["disk"] >= found["cells"] * 8
    assert found["threads"] == 1 and found["seconds"] > 0 and found["memory"] > 0


def test_piece_that_is_timed_is_part_of_the_scene():
    """Of whole pixels in its middle, and no more cells than a tile has."""
    scenario = parse_scenario({"grid": {"width": 24000, "height": 300}, "terrain": {"dem": "flat"}}).complete()
    piece, whole = estimates._piece(scenario), scenario.geobox()
    box = piece.geobox()
    assert box.shape.y == whole.shape.y and 1900 < box.shape.x <= estimates._PIECE
    assert np.hypot(*np.subtract(box.center_pixel.boundingbox[:2], whole.center_pixel.boundingbox[:2])) <= 30
    assert (box.affine.c - whole.affine.c) % 30 == pytest.approx(0, abs=1e-6)


def test_pace_is_that_of_making_all_blocks(monkeypatch):
    scenario, made = parse_scenario({"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}}).complete(), []
    monkeypatch.setattr(estimates, "simulate_to_folder", lambda *given, **options: None)
    monkeypatch.setattr(workers, "run_on_threads", lambda *given: made.append(given) or time.sleep(0.2))
    _, cells, pace, _ = estimates._calibrate(scenario, 1)
    ((graph, outputs, _, threads),) = made
    assert {name for name, _ in outputs.values()} >= {"image", "lai"} and set(outputs) <= set(graph) and threads == 1
    assert cells == 90 * 90 and cells / pace > 0.2


@pytest.mark.slow
def test_time_is_that_of_the_whole_run_with_start_and_report(tmp_path):
    """A scene no larger than the piece takes as long as its run, within what a busy machine makes of it."""
    scenario = parse_scenario({"grid": {"width": 300, "height": 300}, "terrain": {"dem": "flat"}})
    begun = time.monotonic()
    simulate_to_folder(scenario, tmp_path / "run", threads=1)
    taken = time.monotonic() - begun
    assert 0.2 * taken < estimate(scenario, threads=1)["seconds"] < 5 * taken
    assert estimate(scenario, threads=1, start=1000.0)["seconds"] > 1000


PEAK = """
import json, sys
from fifesim.cli import app
try:
    app(sys.argv[1:])
finally:
    # ru_maxrss of a child begins with the memory of its parent, VmHWM does not. [byte]
    (peak,) = [line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")]
    print(json.dumps(int(peak) * 1024))
"""


def last_line(folder, *arguments, line=-1):
    command = [sys.executable, "-c", PEAK, "simulate", "scenario.toml", "--threads", "2", "--json", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[line])


@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured in kB on Linux alone")
@pytest.mark.parametrize(
    ("size", "dem"), [(300, "flat"), (15_000, "flat"), pytest.param(15_000, "flint-hills", marks=pytest.mark.slow)]
)
def test_memory_that_is_promised_suffices(tmp_path, size, dem):
    """And it is not more than half as much again as a run takes."""
    text = f'[grid]\nwidth = {size}\nheight = {size}\n[terrain]\ndem = "{dem}"\n'
    (tmp_path / "scenario.toml").write_text(text)
    # Kernels that are compiled in the run would count.
    last_line(tmp_path, "--dry-run")
    promised, taken = last_line(tmp_path, "--dry-run", line=-2)["memory"], last_line(tmp_path, "-o", "out")
    assert taken <= promised <= 1.5 * taken


def test_memory_grows_with_the_chunks_in_a_row():
    assert [estimates._growth(columns) for columns in (1, 2, 5, 15)] == pytest.approx([1, 1, 1.75, 2.05])


def test_words_have_units():
    text = estimate_in_words(FOUND)
    assert "0.1 million" in text and "1.00 GiB with 2 threads" in text and "1.00 MiB" in text


def test_json_is_the_estimate():
    assert json.loads(estimate_in_words(FOUND, as_json=True)) == {"event": "estimate", **FOUND}
