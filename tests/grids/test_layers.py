"""Bands from layers and layers from bands."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute

from fifesim.grids.chunks import by_band, layers_of


def test_numbers_fill_layers_and_order_stays(lai):
    out = by_band({"b": 0.5, "a": lai.transpose("x", "y")}, lai)
    assert out.dims == ("band", "y", "x") and out["band"].values.tolist() == ["b", "a"]
    np.testing.assert_array_equal(out[0], np.full(lai.shape, 0.5))
    np.testing.assert_array_equal(out[1], lai)
    assert out.rio.crs == lai.rio.crs


def test_stays_lazy(lai):
    with no_compute():
        lazy = by_band({"b": 0.5, "a": in_chunks(lai, ODD_CHUNKS)}, lai)
    xr.testing.assert_equal(lazy.compute(), by_band({"b": 0.5, "a": lai}, lai))


def test_layers_by_name_or_one_for_all(lai):
    both = by_band({"b": lai + 1, "a": lai}, lai)
    assert [float(each[0, 0] - lai[0, 0]) for each in layers_of(both, ["a", "b"], "soil")] == [0, 1]
    assert all(each.identical(lai) for each in layers_of(lai, ["a", "b"], "soil"))
    with pytest.raises(ValueError, match="the soil lacks band c, it has b, a"):
        layers_of(both, ["a", "c"], "soil")
    with pytest.raises(ValueError, match=r"the soil is a raster .* got float"):
        layers_of(0.5, ["a"], "soil")
    with pytest.raises(ValueError, match=r"a must be a number, or one raster .* got dimensions \('band', 'y', 'x'\)"):
        by_band({"a": both}, lai)
