"""Packed rasters are taken by their scale."""

import dask.array as da
import numpy as np
import xarray as xr
from lazy import no_compute

from fifesim.grids.inputs import unpacked

CELLS = np.array([[0, 35], [255, 100]], np.uint8)


def test_scale_offset_and_fill_are_undone_and_forgotten():
    packed = xr.DataArray(CELLS, dims=("y", "x"), name="Lai_500m")
    packed.attrs = {"scale_factor": 0.1, "add_offset": 1.0, "_FillValue": 255, "units": "m2/m2"}
    found = unpacked(packed)
    np.testing.assert_allclose(found, [[1.0, 4.5], [np.nan, 11.0]], rtol=1e-15)
    assert (found.attrs, found.name, packed.attrs["scale_factor"]) == ({"units": "m2/m2"}, "Lai_500m", 0.1)
    with no_compute():
        lazy = unpacked(packed.chunk())
    assert isinstance(lazy.data, da.Array)
    np.testing.assert_array_equal(lazy, found)


def test_what_is_not_packed_passes_as_it_is():
    plain = xr.DataArray(CELLS.astype(np.float32), dims=("y", "x"), attrs={"_FillValue": np.nan, "scale_factor": 1})
    assert unpacked(plain) is plain
