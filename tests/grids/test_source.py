"""Sources of users: what is read of them, their scale, and their identity for dask."""

import tracemalloc

import numpy as np
import pytest
import rasterio
import rioxarray
import xarray as xr
from affine import Affine
from elevations import write

import fifesim
from fifesim.grids import grid as grids

GRID = fifesim.fife_site(10.0, window=((300, 330), (500, 540)))
AROUND = GRID.pad(60)


def test_array_of_an_open_file_is_read_by_window(tmp_path):
    """The file has 288 MB, of which a window is needed."""
    profile = {"driver": "GTiff", "width": 6000, "height": 6000, "count": 1, "dtype": "float64", "crs": "EPSG:26914"}
    path, affine = tmp_path / "map.tif", AROUND.affine * Affine.translation(-3000, -3000)
    with rasterio.open(path, "w", **profile, transform=affine, tiled=True, sparse_ok=True):
        pass
    with rioxarray.open_rasterio(path, masked=True) as opened:
        tracemalloc.start()
        lai = fifesim.open_lai(opened.isel(band=0, drop=True), GRID)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert (lai == 0).all() and peak < 50e6


def test_map_with_flags_among_its_numbers_is_scaled():
    """As of MODIS, whose codes above the valid range are explained by flags."""
    stored = np.full(AROUND.shape, 23, np.uint8)
    stored[:70] = 250
    attrs = {"scale_factor": 0.1, "valid_range": [0, 100], "_FillValue": 255, "flag_values": 250}
    lai = grids.place(xr.DataArray(stored, dims=("y", "x"), attrs=attrs), AROUND)
    found = fifesim.open_lai(lai, GRID)
    assert np.isnan(found[:10]).all() and float(abs(found[11:] - 2.3).max()) < 1e-12


@pytest.mark.parametrize("bring", [fifesim.open_lai, fifesim.fine_dem])
def test_changed_file_is_another_array_for_dask(tmp_path, bring):
    path, names = tmp_path / "map.tif", []
    for level in (1.0, 1.0, 2.0):
        if level > 1 or not names:
            write(path, np.full(AROUND.shape, level), AROUND.affine, "EPSG:26914")
        names.append(bring(path, GRID, chunks=20).data.name)
    assert names[0] == names[1] != names[2]
    assert float(bring(path, GRID, chunks=20).mean()) == pytest.approx(2.0)


def test_elevation_of_one_place_is_the_same_by_any_kernel_of_a_plane():
    """Average, bilinear interpolation and spline agree on a plane, so that they place cells alike, within 1e-9 m."""
    grid = fifesim.fife_site(30.0, window=((110, 120), (180, 190)))
    northing, easting = grids.centres_of(AROUND)
    plane = 1 + 1e-3 * (easting - easting[0]) + 2e-3 * (northing[:, None] - northing[-1])
    raster = grids.place(xr.DataArray(plane, dims=("y", "x")), AROUND)
    for cells in (grid, fifesim.fife_site(5.0, window=((620, 640), (1020, 1040)))):
        average, spline = fifesim.open_lai(raster, cells), fifesim.fine_dem(raster, cells, vertical_units="m")
        np.testing.assert_allclose(average, spline, rtol=0, atol=2e-12)
