"""Kernels of classes on labelled rasters: each on its own cells, in any chunks."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks, no_compute

from fifesim.grids import classes
from fifesim.grids.classes import by_class


@pytest.fixture
def cover(lai):
    codes = np.random.default_rng(2).choice([-1, 1, 5, 9], lai.shape).astype(np.int16)
    return lai.copy(data=codes).rename("cover")


@pytest.fixture
def kernels(lai):
    by_band = xr.DataArray([1.0, 2.0], dims="band")
    shifted = (lai + 1).rename("shifted")
    rows = xr.DataArray(np.arange(lai.sizes["y"]) * 1.0, dims="y", coords={"y": lai.y})
    return {
        1: (lambda cells, bands: bands[:, None] * cells, [by_band]),
        5: (lambda cells, other: np.stack([cells - other, other]), [shifted]),
        9: (lambda cells, other, row, bands: np.stack([bands[0] * row, other]), [shifted, rows, by_band]),
    }


@pytest.mark.parametrize("at_once", [7, 2**17])
@pytest.mark.parametrize("chunks", [None, CHUNKS, ODD_CHUNKS], ids=str)
def test_each_class_has_what_its_kernel_gives(monkeypatch, lai, cover, kernels, chunks, at_once):
    monkeypatch.setattr(classes, "_AT_ONCE", at_once)
    expected = np.full((2, *lai.shape), np.nan)
    values, rows = lai.values, np.broadcast_to(np.arange(lai.sizes["y"])[:, None], lai.shape)
    expected[:, cover == 1] = [values[cover == 1], 2 * values[cover == 1]]
    expected[:, cover == 5] = [(values - (values + 1))[cover == 5], (values + 1)[cover == 5]]
    expected[:, cover == 9] = [rows[cover == 9], (values + 1)[cover == 9]]
    if chunks:
        lai, cover = in_chunks(lai, chunks), in_chunks(cover, chunks)
    with no_compute():
        made = by_class(kernels, cover, lai, bands=2)
    assert (made.chunks is not None) == bool(chunks)
    np.testing.assert_array_equal(made, expected)


@pytest.mark.parametrize("codes", [[1, 5], [-1, 1, 5], [1, 5, 9], [-1, 1, 5, 9]], ids=str)
def test_classes_of_one_kernel_are_evaluated_together(lai, codes):
    calls = []
    both = (lambda cells: calls.append(cells.size) or np.sqrt(cells), [])
    cover = lai.copy(data=np.random.default_rng(3).choice(codes, lai.shape).astype(np.int16))
    made = by_class({1: both, 5: both, 9: (np.negative, [])}, cover, lai)
    known = np.where(cover == 9, -lai, np.where(cover == -1, np.nan, np.sqrt(lai)))
    np.testing.assert_array_equal(made, known)
    assert calls == [int(cover.isin([1, 5]).sum())]


def test_code_without_a_kernel_is_an_error_when_it_computes(lai, cover):
    lazy = by_class({1: (np.sqrt, []), 5: (np.sqrt, [])}, in_chunks(cover, CHUNKS), lai)
    with pytest.raises(ValueError, match="codes without a class: 9"):
        lazy.compute()
