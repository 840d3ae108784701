"""Tests of synthetic Flint Hills against a real watershed, of their tiles and benches, and of light on them."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_place, no_compute
from scipy import interpolate

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.grids.grid import as_carried
from fifesim.ground.terrain import flint_hills
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain.flint_hills import BASE, NODES, SADDLE, upland
from fifesim.ground.terrain.labels import light_on_slopes
from fifesim.ground.terrain.sky_labels import horizon
from fifesim.ground.terrain.spline import SPLINE_REACH, spline_points

CELL = 10.0
SIZE = 522
SEEDS = range(1, 13)


@pytest.fixture(scope="module")
def landscapes():
    """Twelve landscapes of 27 km2 at 10 m, one for each seed."""
    northing, easting = 4.33e6 - CELL * np.arange(SIZE), 7.1e5 + CELL * np.arange(SIZE)
    return [flint_hills.hills_elevation(seed, northing, easting) for seed in SEEDS]


def means_30m(values):
    return values.reshape(SIZE // 3, 3, SIZE // 3, 3).mean(axis=(1, 3))


def semivariance(values, lag):
    """Semivariance along rows and columns; lag in cells."""
    return 0.25 * sum(np.mean(diff**2) for diff in (values[lag:] - values[:-lag], values[:, lag:] - values[:, :-lag]))


# All reference values are from USGS 3DEP for one watershed, Kings Creek on Konza Prairie, 11 km2. Between synthetic
# squares of its size, the standard deviation is 1.4 degrees for the median slope and 11 m for the relief over 1 km.
def test_slopes_agree_with_the_watershed(landscapes):
    """Mean quantiles of 48 squares of 2.61 km, about as large as the watershed; within 15 % and two standard errors."""
    found = []
    for values in landscapes:
        down, across = np.gradient(means_30m(values), 30.0)
        slopes = np.degrees(np.arctan(np.hypot(down, across)))
        for i in (0, 87):
            for j in (0, 87):
                found.append(np.percentile(slopes[i : i + 87, j : j + 87], [5, 25, 50, 75, 95, 99]))
    watershed, error = np.array([1.8, 4.2, 6.7, 9.4, 12.7, 14.6]), np.std(found, axis=0) / np.sqrt(len(found))
    assert (np.abs(np.mean(found, axis=0) - watershed) < 0.15 * watershed + 2 * error).all()


def test_semivariogram_agrees_with_the_watershed(landscapes):
    """Beyond 500 m the watershed also has a trend, which a larger landscape does not have."""
    lags = {20: 2.6, 30: 5.5, 50: 13.4, 100: 38.9, 200: 88, 300: 128, 500: 198, 800: 299, 1200: 399}
    for lag, value in lags.items():
        found = np.mean([semivariance(values, int(lag / CELL)) for values in landscapes])
        assert found == pytest.approx(value, rel=0.15 if lag <= 500 else 0.25)


def test_quantiles_of_elevation_agree_with_the_watershed(landscapes):
    """Within 6 % of its range of 110 m at each quantile."""
    found = np.quantile(landscapes, [0, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1])
    expected = np.array([334, 341, 352, 379, 400, 412, 434, 440, 443.5])
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.06 * 110)


def test_elevation_has_the_same_bits_in_windows():
    """Across tiles of the lattice, uplands, and the origin of the CRS; other seeds give other hills."""
    for north, east in ((4.3e6, 7e5), (200.0, -300.0)):
        northing, easting = north - 10 / 3 * np.arange(150), east + 10 / 3 * np.arange(170)
        whole = flint_hills.hills_elevation(7, northing, easting)
        for window in (np.s_[0:1, 0:1], np.s_[60:150, 3:99], np.s_[149:150, 40:170]):
            part = flint_hills.hills_elevation(7, northing[window[0]], easting[window[1]])
            np.testing.assert_array_equal(part, whole[window])
        others = [flint_hills.hills_elevation(seed, northing, easting) for seed in (0, 2**63 - 1)]
        assert all(np.abs(other - whole).mean() > 1 for other in others)


def test_tiles_and_uplands_have_no_seams():
    """Curvature along 1 km across the edge of a tile, and slope along 20 km across many uplands."""
    seam = flint_hills.HILLS_TILE * flint_hills.HILLS_STEP
    profile = flint_hills.hills_elevation(5, np.array([40.0]), seam - 500 + np.arange(1000.0))[0]
    curvature = np.abs(np.diff(profile, 2))
    assert curvature[480:520].max() <= np.delete(curvature, slice(480, 520)).max()
    assert curvature.max() < 0.05
    long = flint_hills.hills_elevation(5, np.array([40.0]), np.arange(0, 20000, 5.0))[0]
    assert np.abs(np.diff(long)).max() < 5 * np.tan(np.radians(35))


def test_hypsometry_equals_pchip_interpolation_and_is_linear_beyond_the_survey():
    """Same bits as scipy, also at the knots and in arrays of any shape."""
    knots, heights = flint_hills._ERODED, flint_hills._WATERSHED
    eroded = np.concatenate([np.random.default_rng(1).uniform(knots[0], knots[-1], 900), knots]).reshape(9, -1)
    expected = interpolate.PchipInterpolator(knots, heights)(eroded)
    assert flint_hills.hypsometry(eroded).tobytes() == expected.tobytes()
    assert flint_hills.hypsometry(eroded.T).tobytes() == expected.T.tobytes()
    found = flint_hills.hypsometry(np.array([302.1, 322.1, 1108.3, 1158.3]))
    np.testing.assert_allclose(found, [330.0, 334.0, 443.5, 453.5], rtol=1e-12)


@pytest.mark.parametrize(("height", "share"), flint_hills.BENCHES)
def test_benches_add_sines_of_the_elevation(height, share):
    ground = np.random.default_rng(2).uniform(300, 500, (40, 50))
    ground[0, :4] = height * np.array([30, 30.25, 30.5, 30.75])
    clear, found = np.random.default_rng(3).uniform(0, 1, ground.shape), ground.copy()
    flint_hills._add_bench(found.reshape(-1), clear.reshape(-1), height, share)
    turn = 2 * np.pi / height
    np.testing.assert_allclose(found, ground + share / turn * clear * np.sin(turn * ground), rtol=0, atol=1e-12)


def test_elevation_around_equals_the_elevation_of_its_cells():
    """In a window across the corner of four cached tiles."""
    rows, columns = -144370 + np.arange(20), 23600 + np.arange(30)
    row, column = 28 * (rows[0] // 28) - 7, 28 * (columns[0] // 28) - 11
    found = flint_hills.elevation_around(5, (30.0, 29.6), row, column, (20, 30))
    northing, easting = -30.0 * (row + np.arange(20) + 0.5), 29.6 * (column + np.arange(30) + 0.5)
    np.testing.assert_array_equal(found, flint_hills.hills_elevation(5, northing, easting))


def test_uplands_are_cached_and_higher_than_the_rivers_at_their_edges():
    """Rivers have the elevation of the base; valleys between them rise to the saddle half way."""
    one = upland(3, 5, -2)
    assert upland(3, 5, -2) is one and one.shape == (NODES + 2 * SPLINE_REACH,) * 2
    assert not np.array_equal(upland(3, 6, -2), one)
    nodes = spline_points(one, *(np.indices((NODES, NODES), float) + SPLINE_REACH))
    valley = BASE + SADDLE * (1 - np.abs(np.linspace(-1, 1, NODES))) ** 0.6
    for side, level in ((nodes[0], BASE), (nodes[-1], BASE), (nodes[:, 0], valley), (nodes[:, -1], valley)):
        np.testing.assert_allclose(side, level, rtol=0, atol=1e-6)
    inside = nodes[2:-2, 2:-2]
    assert inside.min() > BASE and 600 < np.median(inside) < 1100


def test_raster_has_labels_and_the_same_bits_in_chunks_and_windows():
    grid = fifesim.fife_site(30 / 9, window=((90, 190), (180, 334)))
    dem = fifesim.flint_hills(grid, 7)
    check_place(dem, "EPSG:26914")
    assert cf.attributes("dem").items() <= dem.attrs.items()
    assert dem.attrs["rng_seed"] == "7"
    np.testing.assert_array_equal(dem, flint_hills.hills_elevation(7, dem["y"].values, dem["x"].values))
    with no_compute():
        lazy = fifesim.flint_hills(grid, 7, chunks={"y": 33, "x": 100})
    assert lazy.chunks is not None
    xr.testing.assert_identical(lazy.compute(), dem)
    xr.testing.assert_equal(fifesim.flint_hills(grid[10:20, 50:99], 7), dem[10:20, 50:99])


def test_hills_do_not_depend_on_the_cell_size():
    """The centres of 10 m cells are the centres of every third cell of 3.33 m."""
    fine = fifesim.flint_hills(fifesim.grid_at("EPSG:26914", 7.1e5, 4.33e6, 300, 300, 10 / 3), 2)
    coarse = fifesim.flint_hills(fifesim.grid_at("EPSG:26914", 7.1e5, 4.33e6, 300, 300, 10.0), 2)
    np.testing.assert_allclose(fine.values[1::3, 1::3], coarse, rtol=0, atol=1e-6)


SUN = Geometry(60.0, 110.0, 25.0, 280.0)


def grids_of(cell, coarse, reach):
    """Grid of a scene, and grid of the terrain around it."""
    grid = grids.grid_at("EPSG:26914", 708001.3, 4331002.9, 61 * cell, 47 * cell, cell)
    box = grid.boundingbox
    west, north = np.floor((box.left - reach) / coarse) * coarse, np.ceil((box.top + reach) / coarse) * coarse
    width, height = box.right + reach - west + coarse, north - box.bottom + reach + coarse
    return grid, grids.grid_at("EPSG:26914", west, north, width, height, coarse)


@pytest.mark.parametrize(("cell", "coarse", "reach"), [(3.7, 29.6, 400.0), (20.0, 40.0, 900.0)])
def test_light_on_hills_equals_the_light_on_labelled_hills(cell, coarse, reach):
    grid, around = grids_of(cell, coarse, reach)
    dem = fifesim.flint_hills(grid.pad(1), 4)
    above = horizon(fifesim.flint_hills(around, 4, chunks=50), reach=reach, beside=dem).compute()
    expected = light_on_slopes(dem, as_carried(grid), SUN, above)
    found = terrain_labels.light_on_hills(grid, around, 4, reach, SUN, 0.4)
    data, sky, size, sun = found
    np.testing.assert_array_equal(data, expected[0])
    for one, other in zip(sky, expected[1], strict=True):
        np.testing.assert_array_equal(one, other)
    assert (size, sun) == expected[2:]
    assert np.ptp(sky.layers[3]) > 0


def test_steepest_is_the_largest_slope():
    _, around = grids_of(10 / 3, 30.0, 600.0)
    assert terrain_labels.steepest(around, 4) == float(terrain_labels.slope(fifesim.flint_hills(around, 4)).max())


def test_altitude_that_disagrees_with_the_hills_causes_a_warning():
    grid, around = grids_of(10 / 3, 30.0, 300.0)
    with pytest.warns(UserWarning, match="beside an altitude of the atmosphere of 3 km"):
        terrain_labels.light_on_hills(grid, around, 4, 300.0, SUN, 3.0)
