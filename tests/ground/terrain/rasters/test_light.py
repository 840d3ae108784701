"""The light on slopes of labelled elevation: what raster functions owe, and planes."""

import numpy as np
import pytest
from elevations import labelled
from lazy import check_raster_function
from oracles_terrain import plane

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import projection
from fifesim.ground.terrain import labels as terrain_raster

SUN = Geometry(70.0, 117.0, 20.0, 40.0)

FUNCTIONS = {
    "sky_view": terrain_raster.sky_view,
    "terrain_view": terrain_raster.terrain_view,
    "illumination": lambda dem: terrain_raster.illumination(dem, SUN),
    "shadow": lambda dem: terrain_raster.shadow(dem, SUN),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_factors_keep_the_promises_of_rasters(dem, name):
    dem[20:23, 30] = np.nan
    found = check_raster_function(FUNCTIONS[name], dem, quantity=name)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(dem))


@pytest.mark.parametrize("slope", [0, 10, 30, 60])
def test_plane_sees_the_sky_above_itself(slope):
    """Cells of 3 x 5 m; the horizon at 30 m cuts the corner where the plane dips below the horizontal."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 300, 300, 3)
    grid = type(grid)((80, 60), grid.affine * grid.affine.scale(5 / 3, 1), grid.crs)
    found = fifesim.sky_view(labelled(grid, plane((80, 60), 3.0, 5.0, slope, 70.0)))
    np.testing.assert_allclose(found, (1 + np.cos(np.radians(slope))) / 2, rtol=0, atol=2e-4)
    np.testing.assert_allclose(
        fifesim.terrain_view(labelled(grid, plane((80, 60), 3.0, 5.0, slope, 70.0))), 0, atol=2e-4
    )


def test_sun_and_aspect_count_from_true_north():
    """In EPSG:3035 over Portugal grid north lies 12.8 degrees west of true north."""
    grid = fifesim.grid_at("EPSG:3035", 2700000, 1900000, 600, 600, 10)
    turn = projection.convergence(grid)
    assert turn == pytest.approx(-12.8, abs=0.6)
    hill = labelled(grid, plane(tuple(grid.shape), 10.0, 10.0, 20.0, 0.0))
    # The sun stands straight up the slope at the azimuth of its aspect, which counts from true north.
    aspect = float(hill.fifesim.aspect()[30, 30])
    assert aspect == pytest.approx(360 + turn, abs=0.01)
    at = [float(hill.fifesim.illumination(Geometry(40.0, aspect + side))[30, 30]) for side in (-5.0, 0.0, 5.0)]
    assert at[1] == pytest.approx(np.cos(np.radians(20.0)), abs=1e-6)
    assert at[0] == pytest.approx(at[2], abs=1e-9)
