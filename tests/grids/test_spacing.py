import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.grids.grid import along_axis, exact_cell, regular_geobox

GRID = fifesim.fife_site(cell=10, window=((0, 60), (0, 60)))
WINDOW = fifesim.fife_site(cell=10, window=((10, 40), (10, 40)))


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


def with_coordinates(raster, axis, change):
    values = raster[axis].values.copy()
    return raster.assign_coords({axis: change(values)})


def one_missing(values):
    values[5] = np.nan
    return values


UNEVEN = {
    "gap": lambda raster, axis: raster.isel({axis: [*range(20), *range(30, 60)]}),
    "overlap": lambda raster, axis: raster.isel({axis: [*range(30), *range(25, 60)]}),
    "shuffled": lambda raster, axis: raster.isel({axis: [0, *np.random.default_rng(0).permutation(58) + 1, 59]}),
    "missing": lambda raster, axis: with_coordinates(raster, axis, one_missing),
    "changing": lambda raster, axis: with_coordinates(
        raster, axis, lambda values: values + 15 * np.sin(np.linspace(0, np.pi, values.size))
    ),
}
SOURCES = {
    "open_lai": lambda raster: fifesim.open_lai(raster.rename("lai"), WINDOW),
    "fine_dem": lambda raster: fifesim.fine_dem(300 + raster, WINDOW),
    "source_dem": lambda raster: fifesim.source_dem(300 + raster, WINDOW, margin=0.0),
    "moisture": lambda raster: fifesim.landscape(WINDOW, moisture=raster / 10),
    "cover": lambda raster: fifesim.landscape(
        WINDOW, cover=raster.astype(int), classes=[fifesim.CoverClass(str(i), lai=1.0, code=i) for i in range(10)]
    ),
}


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("change", UNEVEN)
def test_sources_with_unevenly_spaced_coordinates_are_refused(change, axis, source):
    """odc-geo takes the grid from the first and last coordinates, and would shift the cells between them."""
    raster = fifesim.lai_scene(GRID, seed=7).drop_attrs(deep=False)
    SOURCES[source](raster)
    with pytest.raises(ValueError, match=rf"{axis} is not evenly spaced.*\.interp"):
        SOURCES[source](UNEVEN[change](raster, axis))


def test_coordinates_in_single_precision_are_evenly_spaced():
    """Half a metre of a northing of 4e6 m is lost then, which matters for cells of 1 m but not of 10 m."""
    raster = fifesim.lai_scene(GRID, seed=7)
    single = with_coordinates(raster, "y", lambda values: values.astype(np.float32))
    assert regular_geobox(single).shape == GRID.shape
    fine = with_coordinates(raster, "y", lambda values: (values[0] - 1.3 * np.arange(60)).astype(np.float32))
    with pytest.raises(ValueError, match="y is not evenly spaced"):
        regular_geobox(fine)
