"""Tests of slope, horizon, sky, light and wetness on labelled rasters: raster rules, planes, true north, and errors."""

import numpy as np
import pytest
import xarray as xr
from elevations import hills, labelled, plane
from lazy import check_raster_function, in_chunks, no_compute
from pyproj import Transformer

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain.slope import slope_aspect
from fifesim.ground.terrain.wetness import wetness_index

SUN = Geometry(70.0, 117.0, 20.0, 40.0)

FUNCTIONS = {
    "slope": terrain_labels.slope,
    "aspect": terrain_labels.aspect,
    "sky_view": terrain_labels.sky_view,
    "terrain_view": terrain_labels.terrain_view,
    "illumination": lambda dem: terrain_labels.illumination(dem, SUN),
    "shadow": lambda dem: terrain_labels.shadow(dem, SUN),
    "wetness": fifesim.terrain.wetness,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_terrain_functions_follow_the_rules_for_raster_functions(dem, name):
    dem[20:23, 30] = np.nan
    found = check_raster_function(FUNCTIONS[name], dem, quantity=name)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(dem))


def test_horizon_follows_the_rules_for_raster_functions(dem):
    dem.attrs["source_resolution"] = 10.0
    found = check_raster_function(lambda each: fifesim.horizon(each, reach=60.0), dem, quantity="horizon")
    assert found.sizes == {"direction": 32, "y": 15, "x": 18}
    assert found["y"].isin(dem["y"]).all() and found["x"].isin(dem["x"]).all()


@pytest.mark.parametrize("slope", [0, 10, 60])
def test_slope_aspect_and_views_of_a_plane_on_cells_that_are_not_square(slope):
    """Slopes are exact up to the edges."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 300, 240, (3, 5))
    dem = labelled(grid, plane(tuple(grid.shape), 3.0, 5.0, slope, 250.0))
    np.testing.assert_allclose(fifesim.terrain.slope(dem), slope, rtol=1e-9, atol=1e-9)
    if slope:
        # Grid north is 1.48 degrees east of true north, and varies by 0.002 degrees over the scene.
        np.testing.assert_allclose(fifesim.terrain.aspect(dem), 250.0 + projection.convergence(grid), atol=0.002)
    # The reach of 30 m cuts the corner where the plane falls below the horizontal.
    cosine = np.cos(np.radians(slope))
    np.testing.assert_allclose(fifesim.terrain.sky_view(dem), (1 + cosine) / 2, rtol=0, atol=2e-4)
    np.testing.assert_allclose(fifesim.terrain.terrain_view(dem), (1 - cosine) / 2, rtol=0, atol=2e-4)


def test_sun_azimuth_is_relative_to_true_north():
    """In EPSG:3035 over Portugal, grid north is 12.8 degrees west of true north."""
    grid = fifesim.grid_at("EPSG:3035", 2700000, 1900000, 600, 600, 10)
    turn = projection.convergence(grid)
    assert turn == pytest.approx(-12.8, abs=0.6)
    hill = labelled(grid, plane(tuple(grid.shape), 10.0, 10.0, 20.0, 0.0))
    # Illumination is largest where the azimuth of the sun equals the aspect.
    aspect = float(hill.fifesim.aspect()[30, 30])
    assert aspect == pytest.approx(360 + turn, abs=0.01)
    at = [float(hill.fifesim.illumination(Geometry(40.0, aspect + side))[30, 30]) for side in (-5.0, 0.0, 5.0)]
    assert at[1] == pytest.approx(np.cos(np.radians(20.0)), abs=1e-6)
    assert at[0] == pytest.approx(at[2], abs=1e-9)


@pytest.mark.parametrize(
    ("epsg", "longitude", "latitude"),
    [(3413, -120, 80), (3413, 135, 85), (5070, -75, 40), (3035, 30, 55), (32614, -96, 39), (3031, 10, -75)],
)
def test_aspect_is_relative_to_true_north(epsg, longitude, latitude):
    """Ground that falls toward true south and toward true east; EPSG:3035 distorts angles by 0.16 degrees."""
    to_map = Transformer.from_crs(4326, epsg, always_xy=True)
    west, north = to_map.transform(longitude, latitude)
    grid = fifesim.grid_at(f"EPSG:{epsg}", round(west, -1), round(north, -1), 3000, 3000, 10)
    x, y = (grids.coordinates(grid)[axis].values for axis in "xy")
    east_of, north_of = to_map.transform(*np.meshgrid(x, y), direction="INVERSE")
    for sides, expected in ((north_of, 180.0), (-east_of, 90.0)):
        aspect = fifesim.terrain.aspect(labelled(grid, 500 + 500 * (sides - sides.mean()) / np.ptp(sides)))
        np.testing.assert_allclose(aspect, expected, atol=0.2)


def test_aspect_has_the_same_bits_in_windows():
    grid = fifesim.grid_at("EPSG:3413", -1200000, -700000, 4000, 4000, 40)
    dem = labelled(grid, plane(tuple(grid.shape), 40.0, 40.0, 20.0, 250.0) ** 1.5 / 20)
    whole = fifesim.terrain.aspect(dem)
    np.testing.assert_array_equal(fifesim.terrain.aspect(dem[20:70, 33:90])[1:-1, 1:-1], whole[21:69, 34:89])
    assert (fifesim.terrain.aspect(dem * 0 + 300.0) == 0).all()


def test_wetness_at_a_coarser_resolution_is_interpolated(around):
    """Every ninth cell, as in `horizon`, has the index of the coarse elevation; the index between them is linear."""
    found, places = fifesim.terrain.wetness(around, resolution=30.0), fifesim.horizon(around, resolution=30.0)
    cells = [np.abs(around[axis].values[:, None] - places[axis].values).argmin(axis=0).tolist() for axis in ("y", "x")]
    expected = wetness_index(around.values[np.ix_(*cells)], 30.0, 30.0)
    np.testing.assert_allclose(found.values[np.ix_(*cells)], expected, rtol=0, atol=1e-9)
    row, (start, stop) = cells[0][3], cells[1][4:6]
    between = found.values[row, start : stop + 1]
    np.testing.assert_allclose(between, np.linspace(between[0], between[-1], 10), rtol=0, atol=1e-9)
    cell = 30 / 9
    finest = fifesim.terrain.wetness(around, resolution=1.0)
    np.testing.assert_array_equal(finest, wetness_index(around.values, cell, cell))
    assert np.isnan(fifesim.terrain.wetness(around * np.nan)).all()


def test_coarse_horizons_agree_with_horizons_at_every_cell():
    """Terrain with waves of 200 m and more, which 30 m cells resolve; tolerances from the docstring."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 900, 900, 10 / 3)
    z = hills((270, 270), seed=2, relief=26.0, length=60.0)
    coarse, fine = labelled(grid, z, source_resolution=30.0), labelled(grid, z)
    difference = fifesim.terrain.sky_view(coarse) - fifesim.terrain.sky_view(fine)
    assert float(fifesim.terrain.sky_view(fine).std()) > 0.003
    assert float(abs(difference).max()) < 0.004
    assert float(difference.std()) < 5e-4


@pytest.mark.parametrize(
    "cut", [{"x": slice(1, None)}, {"x": slice(None, -1)}, {"y": slice(1, None)}, {"y": slice(None, -1)}], ids=str
)
def test_horizon_may_end_less_than_one_cell_before_the_elevation(cut):
    """A horizon on nine of ten cells of 30 m is too small, but sufficient for the elevation without its last cell."""
    grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    dem = labelled(grid, np.full((90, 90), 7.0), source_resolution=30.0)
    horizon = fifesim.horizon(dem).isel(cut)
    with pytest.raises(ValueError, match=r"horizon spans .* does not cover the dem's"):
        fifesim.terrain.sky_view(dem, horizon)
    np.testing.assert_allclose(fifesim.terrain.sky_view(dem.isel(cut), horizon), 1, rtol=1e-12)


def test_sky_and_wetness_of_small_and_coarse_rasters():
    """A raster smaller than one cell of the source, and cells larger than the reach."""
    for width, height, cell, source in ((12, 9, 3, 30.0), (80000, 60000, 10000, 10000.0)):
        grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, width, height, cell)
        level = labelled(grid, np.full(tuple(grid.shape), 7.0), source_resolution=source)
        np.testing.assert_allclose(fifesim.terrain.sky_view(level), 1, rtol=1e-12)
        assert np.isfinite(fifesim.terrain.wetness(level)).all()


def sunlight(dem):
    return terrain_labels.Sunlight(dem, SUN, [0.7, 0.8], [0.9, 0.95])


def on(lai, bands=("TM3", "TM4"), **options):
    return fifesim.surface_reflectance(lai, bands=list(bands), **{"geometry": SUN} | options)


@pytest.fixture
def level(lai):
    return on(lai)


@pytest.mark.parametrize("upwelling", [True, False])
def test_kt_and_reflectance_follow_the_rules_for_raster_functions(level, dem, upwelling):
    """In separate calls and in one pass."""
    single = (
        lambda rho, z: terrain_labels.kt_on_slopes(rho, sunlight(z)),
        lambda rho, z: terrain_labels.terrain_reflectance(rho, sunlight(z), upwelling=upwelling),
    )
    both = terrain_labels.slope_kt_and_reflectance(level, sunlight(dem), upwelling=upwelling)
    for function, quantity, found in zip(single, ("kt", "surface_reflectance"), both, strict=True):
        xr.testing.assert_identical(check_raster_function(function, level, dem, quantity=quantity), found)


def test_terrain_outside_the_scene_casts_shadow(site, around, lai):
    """A wall west of the scene, from a larger elevation raster or only from its horizon."""
    around.values[:] = 400.0
    around.values[:, :40] = 460.0
    inside, sun = labelled(site, np.full(tuple(site.shape), 400.0)), Geometry(60.0, 270.0)
    flat, walled = on(lai, geometry=sun), on(lai, dem=around, geometry=sun)
    known = on(lai, dem=inside, horizon=fifesim.horizon(around), geometry=sun)
    alone = on(lai, dem=inside, geometry=sun)
    np.testing.assert_allclose(alone, flat, rtol=1e-12)
    np.testing.assert_allclose(known, walled, rtol=1e-9)
    # Cells in the west are in shadow. Elsewhere, light from the wall may exceed the light of the hidden sky.
    assert (walled[1, :, :9] < 0.4 * flat[1, :, :9]).all()
    assert (abs(walled[1] / flat[1] - 1) > 1e-4).all()


def test_reflectance_on_slopes_is_level_reflectance_times_kt(lai, dem, level):
    """And times the upwelling factor of eq. 5, from slope and aspect."""
    kt = level.fifesim.kt(dem)
    assert kt["band"].values.tolist() == ["TM3", "TM4"]
    without = on(lai, dem=dem, upwelling=False)
    np.testing.assert_allclose(without, level * kt, rtol=1e-12)
    height, width = grids.cell_size(grids.geobox(dem))
    ground = slope_aspect(np.pad(dem.values, 1, constant_values=np.nan), height, width)
    slope, aspect = (dem.copy(data=np.radians(each)) for each in ground)
    # This aspect is relative to grid north, and the view azimuth to true north.
    vza, vaa = np.radians(20.0), np.radians(40.0 - projection.convergence(grids.geobox(lai)))
    factor = np.cos(slope) + np.sin(slope) * np.tan(vza) * np.cos(vaa - aspect)
    np.testing.assert_allclose(on(lai, dem=dem), without * factor, rtol=1e-10)
    assert float(kt.sel(band="TM4").std()) > 0.02


def test_light_on_slopes_is_lazy_and_without_seams_if_any_raster_is_lazy(lai, level, dem, around):
    """Lazy leaf area, reflectance, elevation or horizon; same bits, also where horizons are longer than a chunk."""
    around.attrs["source_resolution"] = 10 / 3
    whole = on(lai, dem=around)
    with no_compute():
        lazy = on(lai.chunk(20), dem=around)
        parts = on(lai, dem=around.chunk({"y": 37, "x": 29}))
    assert lazy.chunks == ((2,), (20, 20, 5), (20, 20, 14))
    np.testing.assert_array_equal(lazy, whole)
    np.testing.assert_array_equal(parts, whole)
    rasters = level, dem, fifesim.horizon(around)
    whole = level.fifesim.kt(dem, horizon=rasters[2])
    for one in range(3):
        rho, z, far = (in_chunks(each, {"y": 20, "x": 11}) if k == one else each for k, each in enumerate(rasters))
        with no_compute():
            lazy = rho.fifesim.kt(z, horizon=far)
        assert lazy.chunks is not None
        np.testing.assert_array_equal(lazy, whole)
