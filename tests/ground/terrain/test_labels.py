"""Tests of slopes and their light on labelled rasters: rules for raster functions, planes, true north, and errors."""

import numpy as np
import pytest
import xarray as xr
from elevations import labelled
from lazy import check_raster_function, in_chunks, no_compute
from oracles_terrain import plane
from pyproj import Transformer

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain.slope import slope_aspect

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


@pytest.mark.parametrize("slope", [0, 10, 20, 30, 60])
def test_slope_aspect_and_views_of_a_plane_on_cells_that_are_not_square(slope):
    """Slopes are exact up to the edges."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 300, 240, (3, 5))
    dem = labelled(grid, plane(tuple(grid.shape), 3.0, 5.0, slope, 250.0))
    np.testing.assert_allclose(fifesim.terrain.slope(dem), slope, rtol=1e-9, atol=1e-9)
    if slope:
        # Grid north is 1.48 degrees east of true north, and varies by 0.002 degrees over the scene.
        np.testing.assert_allclose(fifesim.terrain.aspect(dem), 250.0 + projection.convergence(grid), atol=0.002)
    # The reach of 30 m cuts the corner where the plane falls below the horizontal.
    np.testing.assert_allclose(fifesim.terrain.sky_view(dem), (1 + np.cos(np.radians(slope))) / 2, rtol=0, atol=2e-4)
    np.testing.assert_allclose(
        fifesim.terrain.terrain_view(dem), (1 - np.cos(np.radians(slope))) / 2, rtol=0, atol=2e-4
    )


def test_sun_azimuth_and_aspect_are_relative_to_true_north():
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
    level = labelled(grid, np.full(tuple(grid.shape), 300.0))
    assert (fifesim.terrain.aspect(level) == 0).all()


def test_wide_scene_with_varying_grid_north_causes_a_warning():
    """400 km at 85 degrees north, where grid north rotates by 23 degrees from the centre to a corner."""
    wide = fifesim.grid_at("EPSG:3413", -600000, -200000, 400000, 400000, 10000)
    dem = labelled(wide, 1000 + plane(tuple(wide.shape), 10000.0, 10000.0, 5.0, 70.0) / 40)
    with pytest.warns(UserWarning, match=r"grid north rotates by up to \d+\.\d degrees"):
        fifesim.terrain.illumination(dem, fifesim.Geometry(60.0, 120.0))


def sunlight(dem):
    return terrain_labels.Sunlight(dem, SUN, [0.7, 0.8], [0.9, 0.95])


@pytest.fixture
def level(lai):
    return fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], geometry=SUN)


def test_kt_and_reflectance_follow_the_rules_for_raster_functions(level, dem):
    check_raster_function(lambda rho, z: terrain_labels.kt_on_slopes(rho, sunlight(z)), level, dem, quantity="kt")
    check_raster_function(
        lambda rho, z: terrain_labels.terrain_reflectance(rho, sunlight(z)), level, dem, quantity="surface_reflectance"
    )


@pytest.mark.parametrize("upwelling", [True, False])
@pytest.mark.parametrize("lazy", [True, False])
def test_kt_and_reflectance_in_one_pass_equal_separate_calls(level, dem, lazy, upwelling):
    ground = [in_chunks(each, {"y": 20, "x": 11}) for each in (level, dem)] if lazy else (level, dem)
    with no_compute():
        found = terrain_labels.slope_kt_and_reflectance(ground[0], sunlight(ground[1]), upwelling=upwelling)
    expected = (
        terrain_labels.kt_on_slopes(level, sunlight(dem)),
        terrain_labels.terrain_reflectance(level, sunlight(dem), upwelling=upwelling),
    )
    for one, other in zip(found, expected, strict=True):
        assert (one.chunks is not None) == lazy
        xr.testing.assert_identical(one.compute(), other)


def test_terrain_outside_the_scene_casts_shadow(site, around, lai):
    """A wall west of the scene, from a larger elevation raster or only from its horizon."""
    around.values[:] = 400.0
    around.values[:, :40] = 460.0
    inside = labelled(site, np.full(tuple(site.shape), 400.0))
    sun = Geometry(80.0 - 20, 270.0)
    flat = fifesim.surface_reflectance(lai, bands=["TM4"], geometry=sun)
    walled = fifesim.surface_reflectance(lai, bands=["TM4"], dem=around, geometry=sun)
    known = fifesim.surface_reflectance(lai, bands=["TM4"], dem=inside, horizon=fifesim.horizon(around), geometry=sun)
    alone = fifesim.surface_reflectance(lai, bands=["TM4"], dem=inside, geometry=sun)
    np.testing.assert_allclose(alone, flat, rtol=1e-12)
    np.testing.assert_allclose(known, walled, rtol=1e-9)
    # Cells in the west are in shadow. Elsewhere, light from the wall may exceed the light of the hidden sky.
    assert (walled[..., :9] < 0.4 * flat[..., :9]).all()
    assert (abs(walled / flat - 1) > 1e-4).all()


def test_reflectance_on_a_level_dem_equals_reflectance_without_a_dem(level, lai):
    flat = fifesim.surface_reflectance(
        lai, bands=["TM3", "TM4"], dem=labelled(grids.geobox(lai), np.full(lai.shape, 321.0)), geometry=SUN
    )
    np.testing.assert_allclose(flat, level, rtol=1e-12)
    assert flat.attrs["atmosphere"] == level.attrs["atmosphere"]
    assert flat.attrs["instrument"] == level.attrs["instrument"]


def test_reflectance_on_slopes_is_level_reflectance_times_kt(lai, dem, level):
    """And times the upwelling factor of eq. 5, from slope and aspect."""
    kt = level.fifesim.kt(dem)
    assert kt["band"].values.tolist() == ["TM3", "TM4"]
    without = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=dem, geometry=SUN, upwelling=False)
    np.testing.assert_allclose(without, level * kt, rtol=1e-12)
    height, width = grids.cell_size(grids.geobox(dem))
    ground = slope_aspect(np.pad(dem.values, 1, constant_values=np.nan), height, width)
    slope, aspect = (dem.copy(data=np.radians(each)) for each in ground)
    # This aspect is relative to grid north, and the view azimuth to true north.
    vza, vaa = np.radians(20.0), np.radians(40.0 - projection.convergence(grids.geobox(lai)))
    factor = np.cos(slope) + np.sin(slope) * np.tan(vza) * np.cos(vaa - aspect)
    tilted = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=dem, geometry=SUN)
    np.testing.assert_allclose(tilted, without * factor, rtol=1e-10)
    assert float(kt.sel(band="TM4").std()) > 0.02


def test_elevation_that_does_not_cover_the_scene_or_has_other_cells_is_refused(lai, dem):
    with pytest.raises(ValueError, match=r"dem spans 705570 to .* does not cover the raster's 705570 to 705750 E"):
        fifesim.surface_reflectance(lai, dem=dem.isel(x=slice(0, 50)))
    with pytest.raises(ValueError, match="does not cover"):
        fifesim.surface_reflectance(lai, dem=dem.isel(y=slice(1, None)))
    with pytest.raises(ValueError, match=r"other cells .*, 10 m\) than the raster .* 3.33333 m\)"):
        fifesim.surface_reflectance(lai, dem=labelled(fifesim.fife_site(10.0, window=((0, 100), (0, 100)))))


def test_light_on_slopes_is_lazy_if_any_raster_is_lazy(lai, dem, around):
    """Lazy leaf area, reflectance, elevation or horizon; same bits."""
    with no_compute():
        lazy = fifesim.surface_reflectance(lai.chunk(20), dem=around, bands=["TM4"])
        fifesim.surface_reflectance(lai, dem=around.chunk(50), bands=["TM4"]).fifesim.to_toa().fifesim.sense("TM")
    assert lazy.chunks == ((1,), (20, 20, 5), (20, 20, 14))
    horizon = fifesim.horizon(around)
    level = fifesim.surface_reflectance(lai, bands=["TM4"], geometry=SUN)
    whole = level.fifesim.kt(dem, horizon=horizon)
    rasters = level, dem, horizon
    for one in range(3):
        rho, z, far = (in_chunks(each, {"y": 20, "x": 11}) if k == one else each for k, each in enumerate(rasters))
        with no_compute():
            lazy = rho.fifesim.kt(z, horizon=far)
        assert lazy.chunks is not None
        np.testing.assert_array_equal(lazy, whole)
