"""Weighted sums along a dimension are those of the matrix, whatever the chunks."""

import threading
import time

import numpy as np
import pytest
import xarray as xr
from lazy import no_compute

from fifesim.grids import reductions
from fifesim.grids.reductions import combined

WEIGHTS = np.array([[0.5, 0.25, 0.0, 0.0, 0.25], [0.0, 0.0, 2.0, -1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0]])


@pytest.fixture
def cube():
    values = np.random.Generator(np.random.Philox(3)).random((5, 6, 7))
    coords = {"wavelength": ("band", np.arange(5.0)), "sza": 30.0, "y": np.arange(6.0)}
    return xr.DataArray(values, dims=("band", "y", "x"), coords=coords, name="rho")


def test_sums_are_those_of_the_matrix(cube):
    found = combined(cube, "band", WEIGHTS)
    np.testing.assert_allclose(found, np.einsum("bn,nyx->byx", WEIGHTS, cube), rtol=1e-15)
    assert found.dims == ("band", "y", "x") and found.name == "rho"
    assert set(found.coords) == {"sza", "y"}


@pytest.mark.parametrize("in_turn", [0, reductions._IN_TURN])
@pytest.mark.parametrize("chunks", [(5, 6, 7), (1, 6, 7), (2, 4, 3), (3, 1, 1)])
def test_chunks_give_the_same_bits_and_stay_lazy(cube, chunks, in_turn, monkeypatch):
    monkeypatch.setattr(reductions, "_IN_TURN", in_turn)
    with no_compute():
        lazy = combined(cube.chunk(dict(zip(cube.dims, chunks, strict=True))), "band", WEIGHTS)
    xr.testing.assert_identical(lazy.compute(), combined(cube, "band", WEIGHTS))
    assert lazy.chunks[1:] == cube.chunk(dict(zip(cube.dims, chunks, strict=True))).chunks[1:]


def test_large_chunks_wait_until_the_one_before_is_added(cube, monkeypatch):
    """With more threads than chunks in a row, no two of a chain are in memory together."""
    held = {"now": 0, "most": 0}
    lock, add = threading.Lock(), reductions._add

    def read(block):
        with lock:
            held["now"] += block.size > 0
            held["most"] = max(held["most"], held["now"])
        return block

    def slow_add(*arguments):
        time.sleep(0.02)
        out = add(*arguments)
        with lock:
            held["now"] -= 1
        return out

    monkeypatch.setattr(reductions, "_IN_TURN", 0)
    monkeypatch.setattr(reductions, "_add", slow_add)
    chunked = cube.chunk(band=1)
    chunked = chunked.copy(data=chunked.data.map_blocks(read, meta=np.empty((0, 0, 0))))
    lazy = combined(chunked, "band", np.ones((1, 5)))
    held.update(now=0, most=0)
    lazy.compute(scheduler="threads", num_workers=5)
    assert held["most"] == 1


def test_what_has_no_weight_is_not_read(cube):
    """A missing sample is missing in the sums that it counts in alone, and its chunk is never asked for."""
    cube[2, 1, 1] = np.nan
    found = combined(cube, "band", WEIGHTS)
    assert np.argwhere(np.isnan(found.values)).tolist() == [[1, 1, 1]]
    whole = cube.chunk(band=1).map_blocks(_refuse_third, template=cube.chunk(band=1))
    assert combined(whole, "band", WEIGHTS[:1]).compute().notnull().all()


def _refuse_third(block):
    assert block.size == 0 or float(block["wavelength"][0]) != 2.0
    return block


def test_order_of_dimensions_is_kept_but_bands_come_before_rows(cube):
    assert combined(cube.transpose("y", "x", "band"), "band", WEIGHTS).dims == ("band", "y", "x")
    spectra = cube.isel(y=0).transpose("x", "band")
    assert combined(spectra, "band", WEIGHTS).dims == ("x", "band")
    seasons = cube.expand_dims(time=2).rename(band="wavelength_number")
    assert combined(seasons, "wavelength_number", WEIGHTS).dims == ("time", "band", "y", "x")


def test_single_precision_is_kept_and_summed_in_double(cube):
    single = cube.astype(np.float32)
    found = combined(single, "band", WEIGHTS)
    assert found.dtype == np.float32
    exact = combined(single.astype(float), "band", WEIGHTS)
    np.testing.assert_array_equal(found, exact.astype(np.float32))
