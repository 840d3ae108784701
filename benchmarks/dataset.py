"""Chips a second of `fifesim dataset`, with all that it does from its start to its end, and memory."""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
from chain import floor

CHIP = 333
FIELD = """
[grid]
width = 1110
height = 1110
[terrain]
dem = "{dem}"
[dataset]
landscapes = 50
[draw]
"ground.arp" = {{ uniform = [0.05, 0.2] }}
distribution = {{ choice = ["burned-grazed", "burned-ungrazed", "unburned-ungrazed"] }}
"""
ANEW = """visibility = { log-uniform = [5, 60] }
"ground.leaf.chlorophyll" = { uniform = [20, 60] }
sza = { uniform = [20, 60] }
saa = { uniform = [90, 180] }
min_valid = { uniform = [0.8, 0.98] }
"""
CASES = {
    "one air and sun": FIELD.format(dem="flat"),
    "all anew": FIELD.format(dem="flat") + ANEW,
    "all anew, on hills": FIELD.format(dem="flint-hills") + ANEW,
}


def measured(study, chips, workers, folder):
    """Clock and processor time of a run with its processes, their greatest memory together, and the store's size."""
    (folder / "study.toml").write_text(study)
    code = "from fifesim.cli import app; app()"
    options = ["dataset", folder / "study.toml", "-o", folder / "chips.zarr", "-n", chips, "--workers", workers]
    start, spent, peak = time.monotonic(), {}, 0
    run = subprocess.Popen([sys.executable, "-c", code, *map(str, options), "--quiet"])
    while run.poll() is None:
        memory = 0
        for process in processes_of(run.pid):
            try:
                # Pages that several processes share count in proportion.
                memory += process.memory_full_info().pss
                spent[process.pid] = sum(process.cpu_times()[:2])
            except psutil.Error:
                continue
        peak = max(peak, memory)
        time.sleep(0.5)
    if run.returncode:
        raise SystemExit(run.returncode)
    size = sum(path.stat().st_size for path in (folder / "chips.zarr").rglob("*") if path.is_file())
    return time.monotonic() - start, sum(spent.values()), peak, size


def floor_seconds():
    """Processor time of a floor."""
    start = time.process_time()
    floor(CHIP)
    return time.process_time() - start


def processes_of(pid):
    """A process and all that it started."""
    try:
        process = psutil.Process(pid)
        return [process, *process.children(recursive=True)]
    except psutil.Error:
        return []


def main():
    """Print a table; a floor is drawing and filtering as many normals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--chips", type=int, default=1800)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--cases", nargs="*", default=list(CASES))
    given = parser.parse_args()
    print("| chips | a second | a second of processor time, times workers | floors | GB | MB on disk |")
    print("|---|---|---|---|---|---|")
    for name in given.cases:
        one = min(floor_seconds() for _ in range(9))
        with tempfile.TemporaryDirectory() as folder:
            clock, spent, peak, size = measured(CASES[name], given.chips, given.workers, Path(folder))
        rates = f"{given.chips / clock:.0f} | {given.workers * given.chips / spent:.0f}"
        of_one = spent / given.chips / one
        print(f"| {given.chips}, {name} | {rates} | {of_one:.1f} | {peak / 1e9:.2f} | {size / 1e6:.0f} |", flush=True)


if __name__ == "__main__":
    main()
