"""
Whole commands, with imports, files, pictures and report: processor time, time on the clock and peak memory.

A floor is drawing and filtering a normal for each cell of the default site. Scenes of 60 and 185 km take minutes.

    python benchmarks/commands.py
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from chain import floor
from timing import seconds

COMMAND = "from fifesim.cli import app; app()"
SIDE = 4500
WIDE = """
base = "paper"
[grid]
crs = "EPSG:26914"
west = 500000.0
north = 4350000.0
width = {width}.0
height = {width}.0
[terrain]
dem = "{dem}"
[sensor]
bands = ["TM3", "TM4"]
[geometry]
time = "1987-06-06T16:35:00Z"
[atmosphere]
altitude = 0.4
"""
CASES = {
    "fifesim simulate (15 km, landscape on hills)": ("simulate",),
    "fifesim simulate --paper (15 km, one stand on hills)": ("simulate", "--paper"),
    "fifesim reproduce": ("reproduce",),
    "fifesim budget": ("budget",),
    "fifesim simulate, 60 km, hills": ("simulate", WIDE.format(width=60_030, dem="flint-hills")),
    "fifesim simulate, 185 km, flat": ("simulate", WIDE.format(width=185_040, dem="flat")),
}


def measured(folder, name, *options):
    """Processor time and time on the clock [s], and peak memory [GB]."""
    scenarios = []
    if options and "\n" in options[-1]:
        scenarios = [folder / "wide.toml"]
        scenarios[0].write_text(options[-1], encoding="utf-8")
        options = options[:-1]
    start = time.perf_counter()
    call = [sys.executable, "-c", COMMAND, name, *map(str, scenarios), *options, "-o", str(folder / "out")]
    run = subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(run.pid, 0)
    if status:
        return None
    return used.ru_utime + used.ru_stime, time.perf_counter() - start, used.ru_maxrss / 1e6


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--quick", action="store_true", help="leave out 60 and 185 km")
    cases = list(CASES.items())[: 4 if parser.parse_args().quick else None]
    base = seconds(lambda: floor(SIDE))
    print(f"A floor takes {base:.2f} s.\n")
    print("| | processor time [s] | floors | on the clock [s] | peak memory [GB] |\n|---|---|---|---|---|")
    for name, case in cases:
        with tempfile.TemporaryDirectory() as folder:
            found = measured(Path(folder), *case)
        if found is None:
            print(f"| {name} | failed | | | |")
            continue
        spent, clock, memory = found
        print(f"| {name} | {spent:.1f} | {spent / base:.1f} | {clock:.1f} | {memory:.2f} |", flush=True)


if __name__ == "__main__":
    main()
