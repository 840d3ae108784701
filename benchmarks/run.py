"""
All benchmarks by one command, each in a process of its own, and their tables on one page.

    python benchmarks/run.py --output tables.md
"""

import argparse
import platform
import subprocess
import sys
from contextlib import nullcontext
from datetime import date
from pathlib import Path

import psutil

PARTS = {
    "Stages, chains and peers": "stages.py",
    "Threads": "chain.py",
    "Whole commands": "commands.py",
    "Ensembles": "ensembles.py",
    "Training sets": "dataset.py",
    "Landscapes": "landscape.py",
    "Classes": "classes.py",
    "Fields and soils": "fields.py",
    "Leaves by cell": "leaves.py",
    "Terrain": "terrain.py",
    "Atmosphere": "atmosphere.py",
    "Sensor": "sensor.py",
    "Spectra": "spectra.py",
    "Start": "start.py",
}


def lines(parts):
    """Of the page, as they are found."""
    cores, memory = psutil.cpu_count(), psutil.virtual_memory().total / 1e9
    machine = f"{platform.machine()}, {cores} cores, {memory:.0f} GB, Python {platform.python_version()}"
    yield "# Tables\n"
    yield f"Measured on {date.today()}: {machine}."
    for title in parts:
        yield f"\n## {title}\n"
        command = [sys.executable, Path(__file__).with_name(PARTS[title])]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as run:
            yield from (line.rstrip("\n") for line in run.stdout)
        if run.returncode:
            yield "failed"


def main():
    """Print the page, and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART")
    parser.add_argument("--output", type=Path, help="file for the page, beside standard output")
    given = parser.parse_args()
    with given.output.open("w", encoding="utf-8") if given.output else nullcontext() as file:
        for line in lines(given.parts):
            print(line, flush=True)
            print(line, file=file, flush=True) if file else None


if __name__ == "__main__":
    main()
