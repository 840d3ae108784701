"""The pages state the speeds that were measured, and other packages do the same work as fifesim."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import fifesim

ROOT = Path(__file__).parents[1]
BENCHMARKS = ROOT / "benchmarks"

SAMPLE = """# Tables

Measured on 2026-11-22: x86_64, 2 cores, 25 GB, Python 3.11.7.

## Stages and chains

Measured on 2027-01-02: arm64, 4 cores, 8 GB, Python 3.12.1.

| | 1 M: million cells/s | 4 M: million cells/s | times the floor |
|---|---|---|---|
| flat chain, field to DN | 8.4 | 16.7 | 0.99 |
| terrain chain, field to DN | 3.7 | 7.3 | 3.04 |

## Other packages

| work: other package | million cells | fifesim: million cells/s | other: million cells/s | fifesim / other |
|---|---|---|---|---|
| SAIL in each cell: radiative-transfer-models | 0.98 | 0.169 | 0.178 | 0.95 |
| SAIL interpolated in LAI: radiative-transfer-models and numpy.interp | 16 | 96.1 | 5.92 | 16.2 |
| field: GSTools | not installed | | | |

## Whole commands

A floor takes 0.59 s.

| | processor time [s] | floors | on the clock [s] | peak memory [GB] |
|---|---|---|---|---|
| fifesim simulate (15 km, landscape on hills) | 9.3 | 15.8 | 6.9 | 1.02 |
| fifesim simulate, 60 km, hills | 34.0 | 57.9 | 22.1 | 1.37 |
| fifesim simulate, 185 km, flat | 104.3 | 177.9 | 67.8 | 1.00 |
"""


@pytest.fixture
def load(monkeypatch):
    """Import a script of the benchmarks, which is forgotten after the test."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    known = set(sys.modules)
    yield importlib.import_module
    for name in set(sys.modules) - known:
        if str(BENCHMARKS) in str(getattr(sys.modules[name], "__file__", None)):
            del sys.modules[name]


@pytest.mark.parametrize("page", ["README.md", "docs/large_scenes.md", "docs/howto/haze.md"])
def test_page_states_the_figures_of_the_tables(load, page):
    """Else run ``python benchmarks/summary.py``."""
    summary = load("summary")
    found = summary.rows(summary.TABLES.read_text("utf-8"))
    text = (ROOT / page).read_text("utf-8")
    assert text == summary.written(text, summary.PAGES[page](found))


def test_figures_of_a_sample(load):
    summary = load("summary")
    found = summary.rows(SAMPLE)
    assert " ".join(summary.readme(found).split()) == (
        "- On one core (arm64 machine with 4 cores, 2 January 2027), fifesim simulates 16.7 million ground cells per "
        "second on level ground and 7.3 million on hills, from random field to digital numbers in two bands (4 million "
        "cells of 3.33 m). - A Landsat scene of 185 km (3,080 million cells) takes 68 s and 1.0 GB on two cores "
        "(measured on an x86_64 machine with 2 cores, 22 November 2026). - SAIL in each cell reaches 0.169 million "
        "cells per second (radiative-transfer-models: 0.178). Interpolated in LAI, "
        "with an error below 1e-6, it reaches 96.1 million."
    )
    table = summary.large_scenes(found).splitlines()
    assert "x86_64 machine with 2 cores, 22 November 2026" in table[0]
    assert table[-2] == "| 60 km, hills | 324 | 22.1 | 34.0 | 1.37 |"
    assert table[-1] == "| 185 km, level ground (a Landsat scene) | 3,080 | 67.8 | 104.3 | 1.00 |"


def test_summary_reads_rows_that_the_benchmarks_write(load):
    summary, work, commands, peers = (load(name) for name in ("summary", "work", "commands", "peers"))
    assert {summary.LEVEL, summary.HILLS} <= set(work.CHAINS)
    assert set(summary.RUNS) <= set(commands.CASES)
    assert {summary.EACH, summary.INTERPOLATED} <= set(peers.ROWS)


def test_parts_that_are_not_measured_anew_stay_with_their_measurement(load):
    run, summary = load("run"), load("summary")
    found = summary.sections(SAMPLE)
    again = run.page(found | {"Whole commands": "Measured on 2027-03-04: anew"})
    assert summary.sections(again) == found | {"Whole commands": "Measured on 2027-03-04: anew"}
    assert "## Other packages\n\nMeasured on 2026-11-22: x86_64, 2 cores" in again


# A speed, floors, or how long a Landsat scene takes.
_SPEED = re.compile(
    r"million cells/s|\d[\d.,]* million (ground )?cells (a|per) second|\d[\d.,]* (times the )?floors?\b"
    r"|185 km[^#]{0,120}?\b(\d+ s\b|\d+ min|minutes)"
)


def test_pages_state_no_other_speed(load):
    summary = load("summary")
    pages = [ROOT / "README.md", BENCHMARKS / "README.md", *(ROOT / "docs").rglob("*.md")]
    pages += (ROOT / "docs" / "gallery_src").rglob("*.py")
    found = []
    for page in set(pages) - {ROOT / "docs" / "changes.md"}:
        text = re.sub(f"{summary.FIRST}.*?{summary.LAST}", "", page.read_text("utf-8"), flags=re.DOTALL)
        found += [(page.name, match[0]) for match in _SPEED.finditer(text)]
    assert found == []


def errors(peers, name, side):
    """Numbers of the errors of fifesim and of the other package."""
    make, module, _ = peers.ROWS[name]
    pytest.importorskip(module)
    work = make(side)
    texts = work.errors(work.ours(), work.theirs())
    return [[float(number) for number in re.findall(r"(?<!\w)\d[\d.e-]*(?!\w)", text)] for text in texts]


@pytest.mark.parametrize("package", ["prosail", "radiative-transfer-models"])
def test_sail_of_other_packages_has_the_same_inputs(load, package):
    found = errors(load("peers"), f"SAIL in each cell: {package}", 18)
    assert found[0] == found[1] and 0 < found[0][0] < 2e-4


def test_interpolation_is_within_the_bound_that_the_page_states(load):
    peers, summary = load("peers"), load("summary")
    own, other = errors(peers, summary.INTERPOLATED, 90)
    assert own[0] < 1e-6 and other[0] < 1e-6


def test_fields_have_the_covariance_of_their_models(load):
    own, other = errors(load("peers"), "field: white noise filtered by scipy.fft, periodic", 720)
    assert own[0] < 0.005 and other[0] < 0.005


def test_6s_has_the_same_atmosphere(load):
    try:
        own, other = errors(load("peers"), "atmosphere: 6S once a band through Py6S, then its formula", 18)
    except RuntimeError as error:
        if "the system lacks" in str(error):
            pytest.skip(str(error))
        raise
    assert max(own) < 0.003 and other[0] < 3e-5


@pytest.mark.parametrize(
    "name, bounds",
    [
        ("sensor: numpy, mean of blocks", (0.1, 0.3)),
        ("sensor: rasterio, average", (0.1, 0.3)),
        ("sensor: scipy.ndimage, convolution", (0.001, 0.05)),
    ],
)
def test_only_a_spread_function_gives_the_ndvi_of_the_sensor(load, name, bounds):
    own, other = errors(load("peers"), name, 360)
    assert own[0] < 1e-12 and bounds[0] < other[0] < bounds[1]


def test_digital_numbers_of_a_block_mean_are_near_those_of_the_sensor(load):
    """Else the mean would be calibrated by another scale."""
    work = load("peers").numpy_mean(180)
    assert np.abs(work.ours().values.astype(int) - work.theirs()).max() <= 3


def test_hashes_tell_types_and_shapes_apart(load):
    hash_of = load("bits").of_array
    whole = np.arange(6)
    different = [whole, whole[::-1], whole.reshape(2, 3), whole.astype("int32"), whole.astype(float)]
    assert len({hash_of(values) for values in different}) == len(different)
    assert hash_of(whole.reshape(2, 3).T) == hash_of(whole.reshape(2, 3).T.copy())
    with pytest.raises(TypeError):
        hash_of(np.array(["lai"], object))


def test_hashes_that_differ_are_printed(load, tmp_path, capsys):
    compare = load("bits").compare
    before, after = tmp_path / "before.json", tmp_path / "after.json"
    before.write_text('{"lai": "1", "ndvi": "2", "dem": "3"}')
    after.write_text('{"lai": "1", "ndvi": "4", "kt": "5"}')
    assert compare(before, after)
    assert capsys.readouterr().out.splitlines() == ["dem: only in A", "kt: only in B", "ndvi", "3 of 4 differ"]
    assert not compare(before, before)


def test_lines_of_code_and_docstrings(load, tmp_path):
    sizes, path = load("sizes"), tmp_path / "sample.py"
    path.write_text(
        '"""Module."""\n\n# comment\ndef f(a,\n      b):\n    """One.\n\n    Two."""\n    return """x\ny"""\n'
    )
    tree = sizes.ast.parse(path.read_text())
    [(name, node)] = sizes.definitions(tree)
    assert (name, list(sizes.docstring_lines(tree)), list(sizes.docstring_lines(node))) == ("f", [1], [6, 7, 8])
    assert sizes.code_lines(path) - {1, 6, 7, 8} == {4, 5, 9, 10}


def test_files_that_a_call_enters(load):
    entered = load("sizes").entered
    assert entered(lambda: sum([1, 2])) == (0, 0, 0)
    files, functions, depth = entered(lambda: fifesim.Canopy(brown=0.2))
    assert 1 <= files <= functions and 1 <= depth <= functions
