"""Tests of kernels by cover class on labelled rasters, in any chunks."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks, no_compute

from fifesim.grids import classes
from fifesim.grids.classes import by_class, check_codes


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
def test_each_class_has_the_values_of_its_kernel(monkeypatch, lai, cover, kernels, chunks, at_once):
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
def test_classes_with_the_same_kernel_are_evaluated_together(lai, codes):
    calls = []
    both = (lambda cells: calls.append(cells.size) or np.sqrt(cells), [])
    cover = lai.copy(data=np.random.default_rng(3).choice(codes, lai.shape).astype(np.int16))
    made = by_class({1: both, 5: both, 9: (np.negative, [])}, cover, lai)
    known = np.where(cover == 9, -lai, np.where(cover == -1, np.nan, np.sqrt(lai)))
    np.testing.assert_array_equal(made, known)
    assert calls == [int(cover.isin([1, 5]).sum())]


def test_code_without_a_kernel_raises_when_computed(lai, cover):
    lazy = by_class({1: (np.sqrt, []), 5: (np.sqrt, [])}, in_chunks(cover, CHUNKS), lai)
    with pytest.raises(ValueError, match="codes without a class: 9"):
        lazy.compute()


TABLE = (40, 0, 32764)


@pytest.mark.parametrize("dtype", [np.int16, np.int64, float, np.uint16])
def test_known_codes_pass_in_any_number_type(dtype):
    """NaN and -1 have no class."""
    known = np.random.default_rng(1).choice(TABLE, 1000)
    np.testing.assert_array_equal(check_codes(known.astype(dtype), TABLE), known)
    assert check_codes(known.astype(dtype), TABLE).dtype == np.int16
    assert check_codes(np.array([np.nan, 40.0, -1.0]), TABLE).tolist() == [-1, 40, -1]


@pytest.mark.parametrize("dtype", [np.int16, np.int32, float])
@pytest.mark.parametrize("wrong", [-5, 7, 32765])
def test_unknown_codes_are_named(dtype, wrong):
    """As an index from the end of an array, -5 would be 32764."""
    with pytest.raises(ValueError, match=rf"codes without a class: {wrong}, in 2 of 3 cells. Classes are 40, 0, 32764"):
        check_codes(np.array([wrong, 40, wrong], dtype), TABLE)


def test_fractional_codes_and_many_codes_give_a_short_message():
    with pytest.raises(ValueError, match=r"codes without a class: 1\.5, in 1 of 1"):
        check_codes(np.array([1.5]), (1, 2))
    with pytest.raises(ValueError, match=r"1, 2, 3, 4, 5, 6, 7, 8, \.\.\., in") as caught:
        check_codes(np.arange(1, 1001), tuple(range(2000, 3000)))
    assert len(str(caught.value)) < 500
