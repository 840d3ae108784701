"""The light on slopes of labelled elevation: what raster functions owe, and planes."""

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
from fifesim.ground.terrain import labels as terrain_raster
from fifesim.ground.terrain.slope import slope_aspect

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


@pytest.mark.parametrize("name", ["slope", "aspect"])
def test_slopes_keep_the_promises_of_rasters(dem, name):
    dem[20:23, 30] = np.nan
    found = check_raster_function(getattr(terrain_labels, name), dem, quantity=name)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(dem))


def test_plane_is_exact_up_to_its_edges_on_cells_that_are_not_square():
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 300, 240, (3, 5))
    tilted = labelled(grid, plane(tuple(grid.shape), 3.0, 5.0, 20.0, 250.0))
    np.testing.assert_allclose(fifesim.slope(tilted), 20.0, rtol=1e-9)
    # Grid north lies 1.48 degrees east of true north, and turns by 0.002 degrees over the scene.
    np.testing.assert_allclose(fifesim.aspect(tilted), 250.0 + projection.convergence(grid), atol=0.002)


@pytest.mark.parametrize(
    ("epsg", "longitude", "latitude"),
    [(3413, -120, 80), (3413, 135, 85), (5070, -75, 40), (3035, 30, 55), (32614, -96, 39), (3031, 10, -75)],
)
def test_aspect_counts_from_true_north(epsg, longitude, latitude):
    """Ground that descends to the true south, and one to the true east; EPSG:3035 distorts angles by 0.16."""
    to_map = Transformer.from_crs(4326, epsg, always_xy=True)
    west, north = to_map.transform(longitude, latitude)
    grid = fifesim.grid_at(f"EPSG:{epsg}", round(west, -1), round(north, -1), 3000, 3000, 10)
    x, y = (grids.coordinates(grid)[axis].values for axis in "xy")
    east_of, north_of = to_map.transform(*np.meshgrid(x, y), direction="INVERSE")
    for sides, expected in ((north_of, 180.0), (-east_of, 90.0)):
        aspect = fifesim.aspect(labelled(grid, 500 + 500 * (sides - sides.mean()) / np.ptp(sides)))
        np.testing.assert_allclose(aspect, expected, atol=0.2)


def test_aspect_of_a_window_has_the_bits_of_the_whole():
    grid = fifesim.grid_at("EPSG:3413", -1200000, -700000, 4000, 4000, 40)
    dem = labelled(grid, plane(tuple(grid.shape), 40.0, 40.0, 20.0, 250.0) ** 1.5 / 20)
    whole = fifesim.aspect(dem)
    np.testing.assert_array_equal(fifesim.aspect(dem[20:70, 33:90])[1:-1, 1:-1], whole[21:69, 34:89])
    level = labelled(grid, np.full(tuple(grid.shape), 300.0))
    assert (fifesim.aspect(level) == 0).all()


def test_one_convergence_for_a_wide_scene_is_warned_of():
    """400 km at 85 degrees north: grid north turns by 23 degrees from the middle to a corner."""
    wide = fifesim.grid_at("EPSG:3413", -600000, -200000, 400000, 400000, 10000)
    dem = labelled(wide, 1000 + plane(tuple(wide.shape), 10000.0, 10000.0, 5.0, 70.0) / 40)
    with pytest.warns(UserWarning, match=r"grid north rotates by up to \d+\.\d degrees"):
        fifesim.illumination(dem, fifesim.Geometry(60.0, 120.0))


def sunlight(dem):
    return terrain_labels.Sunlight(dem, SUN, [0.7, 0.8], [0.9, 0.95])


@pytest.fixture
def level(lai):
    return fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], geometry=SUN)


def test_kt_and_reflectance_keep_the_promises_of_rasters(level, dem):
    check_raster_function(lambda rho, z: terrain_labels.kt_on_slopes(rho, sunlight(z)), level, dem, quantity="kt")
    check_raster_function(
        lambda rho, z: terrain_labels.terrain_reflectance(rho, sunlight(z)), level, dem, quantity="surface_reflectance"
    )


@pytest.mark.parametrize("upwelling", [True, False])
@pytest.mark.parametrize("lazy", [True, False])
def test_one_pass_gives_both(level, dem, lazy, upwelling):
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


def test_terrain_beyond_the_scene_counts(site, around, lai):
    """A wall west of the scene, known in the larger elevation or through its horizon alone."""
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
    # West of the site lies shade. Beyond it the lit ground may send more than the lost sky did.
    assert (walled[..., :9] < 0.4 * flat[..., :9]).all()
    assert (abs(walled / flat - 1) > 1e-4).all()


def test_chain_without_elevation_is_the_level_chain(level, lai):
    flat = fifesim.surface_reflectance(
        lai, bands=["TM3", "TM4"], dem=labelled(grids.geobox(lai), np.full(lai.shape, 321.0)), geometry=SUN
    )
    np.testing.assert_allclose(flat, level, rtol=1e-12)
    assert flat.attrs["atmosphere"] == level.attrs["atmosphere"]
    assert flat.attrs["instrument"] == level.attrs["instrument"]


def test_chain_takes_its_light_from_the_atmosphere(lai, dem, level):
    """Reflectance is the level one times Kt, and Eq. 5's factor from the slope."""
    kt = level.fifesim.kt(dem)
    assert kt["band"].values.tolist() == ["TM3", "TM4"]
    without = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=dem, geometry=SUN, upwelling=False)
    np.testing.assert_allclose(without, level * kt, rtol=1e-12)
    height, width = grids.cell_size(grids.geobox(dem))
    ground = slope_aspect(np.pad(dem.values, 1, constant_values=np.nan), height, width)
    slope, aspect = (dem.copy(data=np.radians(each)) for each in ground)
    # This aspect counts from grid north, the view from true north.
    vza, vaa = np.radians(20.0), np.radians(40.0 - projection.convergence(grids.geobox(lai)))
    factor = np.cos(slope) + np.sin(slope) * np.tan(vza) * np.cos(vaa - aspect)
    tilted = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=dem, geometry=SUN)
    np.testing.assert_allclose(tilted, without * factor, rtol=1e-10)
    assert float(kt.sel(band="TM4").std()) > 0.02


def test_nothing_is_computed_before_it_is_asked_for(lai, around):
    with no_compute():
        lazy = fifesim.surface_reflectance(lai.chunk(20), dem=around, bands=["TM4"])
        fifesim.surface_reflectance(lai, dem=around.chunk(50), bands=["TM4"]).fifesim.to_toa().fifesim.sense("TM")
    assert lazy.chunks == ((1,), (20, 20, 5), (20, 20, 14))


def test_elevation_that_does_not_cover_is_refused_by_its_extent(lai, dem):
    with pytest.raises(ValueError, match=r"dem spans 705570 to .* does not cover the raster's 705570 to 705750 E"):
        fifesim.surface_reflectance(lai, dem=dem.isel(x=slice(0, 50)))
    with pytest.raises(ValueError, match="does not cover"):
        fifesim.surface_reflectance(lai, dem=dem.isel(y=slice(1, None)))


def test_elevation_on_other_cells_is_refused(lai):
    with pytest.raises(ValueError, match=r"other cells .*, 10 m\) than the raster .* 3.33333 m\)"):
        fifesim.surface_reflectance(lai, dem=labelled(fifesim.fife_site(10.0, window=((0, 100), (0, 100)))))


def test_all_is_lazy_where_one_is(lai, dem, around):
    """Any of reflectance, elevation and horizon in chunks gives a lazy result of the same bits."""
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
