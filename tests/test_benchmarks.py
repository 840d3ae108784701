"""Pages state the measured speeds, and benchmarked packages do the same work as fifesim."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
BENCHMARKS = ROOT / "benchmarks"


@pytest.fixture
def load(monkeypatch):
    """Function that imports a benchmark script until the end of the test."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    known = set(sys.modules)
    yield importlib.import_module
    for name in set(sys.modules) - known:
        if str(BENCHMARKS) in str(getattr(sys.modules[name], "__file__", None)):
            del sys.modules[name]


@pytest.mark.parametrize("page", ["README.md", "docs/large_scenes.md", "docs/howto/haze.md"])
def test_page_agrees_with_the_benchmark_tables(load, page):
    """To update the pages, run ``python benchmarks/summary.py``."""
    summary = load("summary")
    found = summary.rows(summary.TABLES.read_text("utf-8"))
    text = (ROOT / page).read_text("utf-8")
    assert text == summary.written(text, summary.PAGES[page](found))


def test_summary_rows_exist_in_the_benchmarks(load):
    summary, work, commands, peers = (load(name) for name in ("summary", "work", "commands", "peers"))
    assert {summary.LEVEL, summary.HILLS, summary.DEFAULT} <= set(work.CHAINS)
    assert set(summary.RUNS) <= set(commands.CASES)
    assert {summary.EACH, summary.INTERPOLATED} <= set(peers.ROWS)


def errors(peers, name, side):
    """Errors of fifesim and of the other package as numbers."""
    make, module, _ = peers.ROWS[name]
    pytest.importorskip(module)
    work = make(side)
    texts = work.errors(work.ours(), work.theirs())
    return [[float(number) for number in re.findall(r"(?<!\w)\d[\d.e-]*(?!\w)", text)] for text in texts]


@pytest.mark.parametrize("package", ["prosail", "radiative-transfer-models"])
def test_sail_of_other_packages_agrees(load, package):
    found = errors(load("peers"), f"SAIL in each cell: {package}", 18)
    assert found[0] == found[1] and 0 < found[0][0] < 2e-4


def test_interpolation_error_is_within_the_stated_bound(load):
    peers, summary = load("peers"), load("summary")
    own, other = errors(peers, summary.INTERPOLATED, 90)
    assert own[0] < 1e-6 and other[0] < 1e-6


def test_fields_have_the_covariance_of_their_models(load):
    own, other = errors(load("peers"), "field: white noise filtered by scipy.fft, periodic", 720)
    assert own[0] < 0.005 and other[0] < 0.005


@pytest.mark.slow
def test_6s_with_the_same_atmosphere_agrees(load):
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
def test_ndvi_without_the_sensor_psf_differs(load, name, bounds):
    """A larger difference would indicate a different calibration."""
    own, other = errors(load("peers"), name, 360)
    assert own[0] < 1e-12 and bounds[0] < other[0] < bounds[1]
    work = load("peers").numpy_mean(180)
    assert np.abs(work.ours().values.astype(int) - work.theirs()).max() <= 3


def test_hashes_depend_on_type_and_shape(load):
    hash_of = load("bits").of_array
    whole = np.arange(6)
    different = [whole, whole[::-1], whole.reshape(2, 3), whole.astype("int32"), whole.astype(float)]
    assert len({hash_of(values) for values in different}) == len(different)
    assert hash_of(whole.reshape(2, 3).T) == hash_of(whole.reshape(2, 3).T.copy())
    with pytest.raises(TypeError):
        hash_of(np.array(["lai"], object))
