import numpy as np
import pytest
import xarray as xr

from fifesim.rasters.spacing import along_axis, exact_cell


def axis(values):
    return xr.DataArray(np.zeros(len(values)), dims="x", coords={"x": values})


def test_edge_and_cell_are_those_of_all_coordinates():
    assert along_axis(axis([5.0, 15.0, 25.0]), "x", 0.0, 9.0) == (0.0, 10.0)
    assert along_axis(axis([5.0]), "x", 1.0, 4.0) == (3.0, 4.0)
    assert along_axis(axis([5.0]).drop_vars("x"), "x", 1.0, 4.0) == (1.0, 4.0)
    with pytest.raises(ValueError, match="x is not evenly spaced"):
        along_axis(axis([5.0, 15.0, 26.0]), "x", 0.0, 10.0)


def test_a_transform_that_agrees_keeps_its_digits():
    third = axis([1.0, 2.0]).assign_coords(spatial_ref=0)
    third["spatial_ref"].attrs["GeoTransform"] = f"0 {10 / 3!r} 0 0 0 {-10 / 3!r}"
    assert exact_cell(third, 3.333333, -3.333333) == (10 / 3, -10 / 3)
    assert exact_cell(third, 3.4, -3.4) == (3.4, -3.4)
