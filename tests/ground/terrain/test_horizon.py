"""Horizons against marching along rays, and against what geometry says of walls and planes."""

import numpy as np
import pytest
from oracles_terrain import hills, march, plane

from fifesim.ground.terrain import horizon as horizons


def tangents_of(dem, cell_y, cell_x, azimuths, reach):
    m, n = horizons.horizon_margin(cell_y, cell_x, reach)
    return horizons.horizon_tangent(
        np.pad(dem, ((m, m), (n, n)), constant_values=np.nan), cell_y, cell_x, azimuths, reach
    )


@pytest.mark.parametrize("cells", [(10.0, 10.0), (10.0, 25.0), (30.0, 12.0)])
def test_horizon_is_that_of_a_march_along_rays(cells):
    """Away from the edge, where one counts a last half cell and the other does not."""
    dem, azimuths = hills((70, 75), length=12.0), horizons.azimuths(16) + 5.0
    found = tangents_of(dem, *cells, azimuths, 250.0)
    rng = np.random.default_rng(2)
    for row, column in zip(rng.integers(26, 44, 25), rng.integers(26, 49, 25), strict=True):
        expected = [march(dem, row, column, *cells, azimuth, 250.0) for azimuth in azimuths]
        # Linear between cells along one axis, or along both: waves of 12 cells differ by their curvature.
        np.testing.assert_allclose(found[:, row, column], expected, rtol=0, atol=0.02)
        assert np.abs(found[:, row, column] - expected).mean() < 0.004


def test_along_the_axes_and_the_diagonals_the_horizon_is_exact():
    dem, azimuths = hills((40, 40), seed=4), np.arange(8) * 45.0
    found = tangents_of(dem, 10.0, 10.0, azimuths, 200.0)
    for direction, (down, right) in enumerate([(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)]):
        expected, row, column = 0.0, 21, 17
        for k in range(1, 21):
            i, j, distance = row + k * down, column + k * right, 10.0 * k * np.hypot(down, right)
            if 0 <= i < 40 and 0 <= j < 40 and distance <= 200 + 1e-9:
                expected = max(expected, (dem[i, j] - dem[row, column]) / distance)
        assert found[direction, row, column] == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("count", [16, 20, 36])
def test_horizon_of_a_plane_is_exact_in_every_direction(count):
    azimuths = horizons.azimuths(count)
    found = tangents_of(plane((40, 60), 15.0, 10.0, 35.0, 210.0), 15.0, 10.0, azimuths, 100.0)[:, 20, 30]
    rise = -np.tan(np.radians(35.0)) * np.cos(np.radians(azimuths - 210.0))
    np.testing.assert_allclose(found, np.maximum(rise, 0), rtol=0, atol=1e-9)  # of weights rounded to 1e-9


def test_wall_is_seen_from_as_far_as_the_reach_and_no_further():
    dem = np.zeros((3, 200))
    dem[:, 150:] = 10.0
    found = tangents_of(dem, 3.0, 3.0, [90.0, 270.0], 150.0)
    distance = (150 - np.arange(200)) * 3.0
    seen = (distance > 0) & (distance <= 150)
    # Far samples skip up to 1/32 of the distance.
    np.testing.assert_allclose(found[0, 1][seen], 10.0 / distance[seen], rtol=1 / 31)
    near = seen & (distance <= 31 * 3)
    np.testing.assert_allclose(found[0, 1][near], 10.0 / distance[near], rtol=1e-12)
    assert (found[0, 1][~seen] == 0).all() and (found[1] == 0).all()


def test_unknown_ground_and_the_edge_are_open():
    dem = np.zeros((9, 9))
    dem[:, 7] = np.nan
    dem[:, 8] = 100.0
    dem[4, 2] = np.nan
    found = tangents_of(dem, 10.0, 10.0, horizons.azimuths(16), 60.0)
    assert np.isfinite(found).all()
    assert found[:, 4, 2].max() == 0 and found[0].max() == 0
    assert found[4, 4, 4] == pytest.approx(100 / 40)  # over the gap


def test_cell_has_the_same_bits_in_every_window():
    dem, azimuths, reach = hills((90, 80), seed=7), horizons.azimuths(16), 150.0
    m, n = horizons.horizon_margin(10.0, 10.0, reach)
    whole = horizons.horizon_tangent(dem, 10.0, 10.0, azimuths, reach)
    part = horizons.horizon_tangent(dem[7 : 7 + 2 * m + 5, 3 : 3 + 2 * n + 2], 10.0, 10.0, azimuths, reach)
    np.testing.assert_array_equal(part, whole[:, 7:12, 3:5])


def test_zenith_and_tangent_are_inverse():
    tangent = np.array([0.0, 0.1, 1.0, 7.0])
    np.testing.assert_allclose(horizons.tangent(horizons.zenith(tangent)), tangent, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("count", [0, 15, 16.5])
def test_too_few_directions_are_refused(count):
    with pytest.raises(ValueError, match="from 16 up"):
        horizons.azimuths(count)


def test_reach_below_a_cell_is_refused():
    with pytest.raises(ValueError, match="at least one cell of 30 x 30 m, got 10 m"):
        horizons.horizon_margin(30, 30, 10)
