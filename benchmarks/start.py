"""Processor time until something happens, in units of importing the libraries that fifesim is built on."""

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

UNIT = "import xarray, matplotlib.pyplot, rasterio, dask.array, numba, scipy.stats, odc.geo"
COMMAND = "from fifesim.cli import app; app()"
FLAT = '[grid]\nwidth = 300.0\nheight = 300.0\n[terrain]\ndem = "flat"\n'


def processor_time(code, *arguments, folder=None):
    """Processor time of a Python process and its children. [s]"""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code, *arguments], cwd=folder, capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=5, help="of each; the median counts")
    times = parser.parse_args().times
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "flat.toml").write_text(FLAT, encoding="utf-8")
        (Path(folder) / "typo.toml").write_text("[grid]\nwidht = 300.0\n", encoding="utf-8")
        cases = {
            "the libraries": (UNIT,),
            "`import fifesim`": ("import fifesim",),
            "`fifesim --help`": (COMMAND, "--help"),
            "`fifesim simulate` of a misspelt key": (COMMAND, "simulate", "typo.toml"),
            "`fifesim simulate`, 300 m, flat": (COMMAND, "simulate", "flat.toml", "--overwrite"),
        }
        # Numba's cache on disk exists from the second round on. The commands take turns, because the load varies.
        rounds = [
            {name: processor_time(*case, folder=folder) for name, case in cases.items()} for _ in range(times + 1)
        ]
    found = {name: median(each[name] / each["the libraries"] for each in rounds[1:]) for name in cases}
    print("| | processor time, units |\n|---|---|")
    print("\n".join(f"| {name} | {value:.2f} |" for name, value in found.items()))


if __name__ == "__main__":
    main()
