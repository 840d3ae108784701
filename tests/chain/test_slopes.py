"""Slopes combined with the atmosphere."""

import pytest
import xarray as xr

import fifesim
from fifesim.chain.steps import kt_and_reflectance
from fifesim.grids import grid as grids


def test_reflectance_and_kt_share_the_sky_view_in_the_graph(lai):
    """Reflectance on slopes and Kt share all layers of the graph except the last layer of each."""
    grid = grids.geobox(lai)
    lai, dem = lai.chunk({"y": 20, "x": 30}), fifesim.flint_hills(grid, seed=7, chunks=25)
    level, slopes = (lai.fifesim.surface_reflectance("TM", bands=["TM4"], dem=each) for each in (None, dem))
    own = set(level.fifesim.kt(dem).data.dask.layers) - set(slopes.data.dask.layers)
    assert len(own) == 1, own


def test_kt_warns_if_elevation_and_atmosphere_altitude_differ(lai):
    """Reflectance on the same slopes warns too."""
    level = lai.fifesim.surface_reflectance("TM", bands=["TM4"])
    dem = fifesim.flint_hills(grids.geobox(lai), seed=7)
    with pytest.warns(UserWarning, match="beside an altitude of the atmosphere of 0.4 km"):
        level.fifesim.kt(dem + 2000.0)


@pytest.mark.parametrize("upwelling", [True, False])
def test_one_pass_equals_both_steps(lai, upwelling):
    """Labels are equal too, and the results are lazy."""
    dem = fifesim.flint_hills(grids.geobox(lai), seed=7)
    level = fifesim.surface_reflectance(lai.chunk(20), bands=["TM3", "TM4"])
    found = kt_and_reflectance(level, dem, upwelling=upwelling)
    expected = (
        level.fifesim.kt(dem),
        fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=dem, upwelling=upwelling),
    )
    for one, other in zip(found, expected, strict=True):
        assert one.chunks is not None
        xr.testing.assert_identical(one.compute(), other.compute())


def test_unknown_slope_model_is_rejected(lai):
    with pytest.raises(ValueError, match="slopes must be 'kt' or 'upright', got 'uprigt'"):
        lai.fifesim.surface_reflectance("TM", bands=["TM4"], slopes="uprigt")
    dem = fifesim.flint_hills(grids.geobox(lai), seed=7)
    with pytest.raises(ValueError, match="slopes must be 'kt' or 'upright'"):
        lai.fifesim.surface_reflectance("TM", bands=["TM4"], dem=dem, slopes="Upright")
