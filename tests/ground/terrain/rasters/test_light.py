"""Terrain on labelled rasters: what every raster function owes, windows, edges, and the way into the chain."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function, no_compute
from oracles_terrain import hills, plane

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.ground.terrain.rasters import light as terrain_raster
from fifesim.ground.terrain.rasters import sky as sky_raster
from fifesim.ground.terrain.rasters import slopes
from fifesim.rasters import grid as grids
from fifesim.rasters import projection

SUN = Geometry(70.0, 117.0, 20.0, 40.0)
LIGHT = {"direct_transmittance": [0.7, 0.8], "transmittance_down": [0.9, 0.95], "geometry": SUN}


def elevation(grid, values=None, **attrs):
    values = hills(tuple(grid.shape), seed=1, relief=40.0) if values is None else values
    return grids.place(xr.DataArray(values, dims=("y", "x"), name="dem", attrs={"units": "m"} | attrs), grid)


@pytest.fixture
def dem(site):
    return elevation(site)


@pytest.fixture
def level(lai):
    return fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], geometry=SUN)


@pytest.fixture
def around():
    """Elevation 60 cells further than `site` on all sides."""
    return elevation(fifesim.fife_site(30 / 9, window=((30, 195), (120, 294))))


FUNCTIONS = {
    "slope": slopes.slope,
    "aspect": slopes.aspect,
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


def test_horizon_keeps_the_promises_of_rasters(dem):
    dem.attrs["source_resolution"] = 10.0
    found = check_raster_function(lambda each: sky_raster.horizon(each, reach=60.0), dem, quantity="horizon")
    assert found.sizes == {"direction": 32, "y": 15, "x": 18}
    assert found["y"].isin(dem["y"]).all() and found["x"].isin(dem["x"]).all()


def test_kt_and_reflectance_keep_the_promises_of_rasters(level, dem):
    check_raster_function(lambda rho, z: terrain_raster.kt_on_slopes(rho, z, **LIGHT), level, dem, quantity="kt")
    check_raster_function(
        lambda rho, z: terrain_raster.terrain_reflectance(rho, z, **LIGHT), level, dem, quantity="surface_reflectance"
    )


def test_horizons_longer_than_a_chunk_leave_no_seams(around, lai):
    around.attrs["source_resolution"] = 10 / 3
    whole = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=around, geometry=SUN)
    for chunks in ({"y": 37, "x": 50}, {"y": 165, "x": 29}):
        parts = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=around.chunk(chunks), geometry=SUN)
        np.testing.assert_array_equal(parts, whole)


@pytest.mark.parametrize("slope", [0, 10, 30, 60])
def test_plane_sees_the_sky_above_itself(slope):
    """Cells of 3 x 5 m; the horizon at 30 m cuts the corner where the plane dips below the horizontal."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 300, 300, 3)
    grid = type(grid)((80, 60), grid.affine * grid.affine.scale(5 / 3, 1), grid.crs)
    found = fifesim.sky_view(elevation(grid, plane((80, 60), 3.0, 5.0, slope, 70.0)))
    np.testing.assert_allclose(found, (1 + np.cos(np.radians(slope))) / 2, rtol=0, atol=2e-4)
    np.testing.assert_allclose(
        fifesim.terrain_view(elevation(grid, plane((80, 60), 3.0, 5.0, slope, 70.0))), 0, atol=2e-4
    )


def test_coarse_horizons_stay_near_those_at_every_cell():
    """Ground of 200 m waves and more, which 30 m cells resolve; the figures of the docstring."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 900, 900, 10 / 3)
    z = hills((270, 270), seed=2, relief=26.0, length=60.0)
    coarse, fine = elevation(grid, z), elevation(grid, z, source_resolution=10 / 3)
    difference = fifesim.sky_view(coarse) - fifesim.sky_view(fine)
    assert float(fifesim.sky_view(fine).std()) > 0.003
    assert float(abs(difference).max()) < 0.004
    assert float(difference.std()) < 5e-4


def test_terrain_beyond_the_scene_counts(site, around, lai):
    """A wall west of the scene, known in the larger elevation or through its horizon alone."""
    around.values[:] = 400.0
    around.values[:, :40] = 460.0
    inside = elevation(site, np.full(tuple(site.shape), 400.0))
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


def test_a_larger_elevation_gives_what_its_window_gives(around, lai):
    """On cells away from the window's edge; the horizon is that of the larger one in both."""
    window = around.isel(y=slice(50, 120), x=slice(50, 130))
    whole = fifesim.surface_reflectance(lai, bands=["TM4"], dem=around, geometry=SUN)
    part = fifesim.surface_reflectance(lai, bands=["TM4"], dem=window, horizon=fifesim.horizon(around), geometry=SUN)
    np.testing.assert_allclose(part, whole, rtol=1e-12)


def test_chain_without_elevation_is_the_level_chain(level, lai):
    flat = fifesim.surface_reflectance(
        lai, bands=["TM3", "TM4"], dem=elevation(grids.geobox(lai), np.full(lai.shape, 321.0)), geometry=SUN
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
    slope, aspect = np.radians(dem.fifesim.slope()), np.radians(dem.fifesim.aspect())
    # Aspect counts from the north of the grid, the view from true north.
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


def test_sun_below_every_horizon_is_refused(site):
    steep = elevation(site, plane(tuple(site.shape), 10 / 3, 10 / 3, 40.0, 0.0))
    for function in (fifesim.shadow, fifesim.illumination):
        with pytest.raises(ValueError, match=r"sza 60, 178.* from grid north.*below the horizon of every slope"):
            function(steep, Geometry(60.0, 180.0))


def test_elevation_that_does_not_cover_is_refused_by_its_extent(lai, dem):
    with pytest.raises(ValueError, match=r"dem spans 705570 to .* does not cover the raster's 705570 to 705750 E"):
        fifesim.surface_reflectance(lai, dem=dem.isel(x=slice(0, 50)))
    with pytest.raises(ValueError, match="does not cover"):
        fifesim.surface_reflectance(lai, dem=dem.isel(y=slice(1, None)))


def test_elevation_on_other_cells_is_refused(lai):
    with pytest.raises(ValueError, match=r"other cells .*, 10 m\) than the raster .* 3.33333 m\)"):
        fifesim.surface_reflectance(lai, dem=elevation(fifesim.fife_site(10.0, window=((0, 100), (0, 100)))))


@pytest.mark.parametrize("units", ["ft", "US survey foot", "km"])
def test_other_units_are_refused(dem, units):
    dem.attrs["units"] = units
    with pytest.raises(ValueError, match=f"units '{units}', dem needs 'm'"):
        fifesim.slope(dem)


def test_units_may_be_spelled_out(dem):
    xr.testing.assert_identical(fifesim.slope(dem.assign_attrs(units="metre")), fifesim.slope(dem))


def test_geographic_and_unplaced_elevation_are_refused(dem):
    degrees = dem.drop_vars("spatial_ref").assign_coords(y=39 - 1e-4 * np.arange(45), x=-96 + 1e-4 * np.arange(54))
    with pytest.raises(ValueError, match="geographic CRS"):
        fifesim.sky_view(degrees.rio.write_crs("EPSG:4326"))
    with pytest.raises(ValueError, match="no CRS"):
        fifesim.slope(dem.drop_vars("spatial_ref"))
    with pytest.raises(ValueError, match="north up"):
        fifesim.slope(dem.isel(y=slice(None, None, -1)))


def test_horizon_that_does_not_cover_is_refused(lai, dem, around):
    horizon = fifesim.horizon(around.isel(x=slice(0, 90)))
    with pytest.raises(ValueError, match=r"horizon spans .* does not cover the dem's"):
        fifesim.sky_view(dem, horizon)
    with pytest.raises(ValueError, match="give dem= too"):
        fifesim.surface_reflectance(lai, horizon=horizon)
    with pytest.raises(ValueError, match="evenly spaced"):
        fifesim.sky_view(dem, fifesim.horizon(around).isel(direction=slice(0, 20)))


def test_small_and_coarse_rasters_have_horizons_too():
    """Fewer cells than one of the source, and cells larger than the reach."""
    tiny = elevation(fifesim.grid_at("EPSG:26914", 700000, 4330000, 12, 9, 3), np.full((3, 4), 7.0))
    np.testing.assert_allclose(fifesim.sky_view(tiny), 1, rtol=1e-12)
    wide = elevation(fifesim.grid_at("EPSG:26914", 700000, 4330000, 80000, 60000, 10000), np.full((6, 8), 7.0))
    np.testing.assert_allclose(fifesim.sky_view(wide), 1, rtol=1e-12)


def test_the_sun_counts_from_true_north_and_the_slope_from_grid_north():
    """In EPSG:3035 over Portugal grid north lies 12.8 degrees west of true north."""
    grid = fifesim.grid_at("EPSG:3035", 2700000, 1900000, 600, 600, 10)
    turn = projection.convergence(grid)
    assert turn == pytest.approx(-12.8, abs=0.6)
    hill = elevation(grid, plane(tuple(grid.shape), 10.0, 10.0, 20.0, 0.0))
    # Straight up the slope, by the grid, stands the sun at the azimuth of the slope and the convergence.
    aspect = float(hill.fifesim.aspect()[30, 30])
    at = [float(hill.fifesim.illumination(Geometry(40.0, aspect + turn + side))[30, 30]) for side in (-5.0, 0.0, 5.0)]
    assert at[1] == pytest.approx(np.cos(np.radians(20.0)), abs=1e-6)
    assert at[0] == pytest.approx(at[2], abs=1e-9)


def test_a_dem_of_integers_is_an_elevation_and_an_undeclared_mark_is_not(dem):
    whole = dem.round().astype("int16").assign_attrs(dem.attrs)
    np.testing.assert_array_equal(fifesim.slope(whole), fifesim.slope(whole.astype(float).assign_attrs(dem.attrs)))
    with pytest.raises(ValueError, match="masked=True"):
        fifesim.slope(dem.rio.write_nodata(-9999.0))
    with pytest.raises(TypeError, match="fine_dem"):
        fifesim.slope("hill.tif")
