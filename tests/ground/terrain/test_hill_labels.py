"""The synthetic Flint Hills on labelled rasters."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_place, no_compute

import fifesim
from fifesim.grids import cf
from fifesim.ground.terrain import flint_hills


def test_raster_has_its_labels_and_place():
    grid = fifesim.fife_site(30 / 9, window=((90, 190), (180, 334)))
    dem = fifesim.flint_hills(grid, 7)
    check_place(dem, "EPSG:26914")
    assert cf.attributes("dem").items() <= dem.attrs.items()
    assert dem.attrs["rng_seed"] == "7"
    np.testing.assert_array_equal(dem, flint_hills.hills_elevation(7, dem["y"].values, dem["x"].values))
    for chunks in ({"y": 33, "x": 100}, "auto", 7):
        with no_compute():
            lazy = fifesim.flint_hills(grid, 7, chunks=chunks)
        assert lazy.chunks is not None
        xr.testing.assert_identical(lazy.compute(), dem)
    xr.testing.assert_equal(fifesim.flint_hills(grid[10:20, 50:99], 7), dem[10:20, 50:99])


def test_same_hills_on_other_cells():
    """Cells of 10 m have their centres on every third cell of 3.33 m."""
    fine = fifesim.flint_hills(fifesim.grid_at("EPSG:26914", 7.1e5, 4.33e6, 300, 300, 10 / 3), 2)
    coarse = fifesim.flint_hills(fifesim.grid_at("EPSG:26914", 7.1e5, 4.33e6, 300, 300, 10.0), 2)
    np.testing.assert_allclose(fine.values[1::3, 1::3], coarse, rtol=0, atol=1e-6)


def test_what_cannot_be_made_is_refused():
    grid = fifesim.fife_site(30, window=((0, 9), (0, 9)))
    with pytest.raises(ValueError, match="seed must be a whole number"):
        fifesim.flint_hills(grid, -1)
    with pytest.raises(ValueError, match="at most 100 m"):
        fifesim.flint_hills(fifesim.fife_site(500), 1)
