"""
Run all benchmarks, each in a new process, and write their tables to one page.

With ``--parts``, the other parts of an existing page are kept.

    python benchmarks/run.py --output benchmarks/tables.md
"""

import argparse
import platform
import subprocess
import sys
from datetime import date
from pathlib import Path

import psutil
from summary import sections

PARTS = {
    "Stages and chains": "stages.py",
    "Other packages": "peers.py",
    "Threads": "chain.py",
    "Small rasters": "labels.py",
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
    "Waits": "waits.py",
}


def lines(title):
    """Lines of a part, as they are printed."""
    cores, memory = psutil.cpu_count(), psutil.virtual_memory().total / 1e9
    machine = f"{platform.machine()}, {cores} cores, {memory:.0f} GB, Python {platform.python_version()}"
    yield f"Measured on {date.today()}: {machine}.\n"
    script = Path(__file__).with_name(PARTS[title])
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as run:
        yield from (line.rstrip("\n") for line in run.stdout)
    if run.returncode:
        yield "failed"


def page(found):
    """Text of the page of some parts, in their order."""
    return "# Tables\n\n" + "\n\n".join(f"## {title}\n\n{found[title]}" for title in PARTS if title in found) + "\n"


def main():
    """Print the parts, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART")
    parser.add_argument("--output", type=Path, help="file for the page")
    given = parser.parse_args()
    known = given.output and given.output.exists()
    found = sections(given.output.read_text(encoding="utf-8")) if known else {}
    for title in given.parts:
        print(f"\n## {title}\n", flush=True)
        told = []
        for line in lines(title):
            print(line, flush=True)
            told.append(line)
        found[title] = "\n".join(told)
        if given.output:
            given.output.write_text(page(found), encoding="utf-8")


if __name__ == "__main__":
    main()
