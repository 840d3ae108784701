"""Kt and reflectance of slopes on rasters: what raster functions owe, windows, edges, and the way into the chain."""

import numpy as np
import pytest
import xarray as xr
from elevations import labelled
from lazy import check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.grids import grid as grids
from fifesim.grids import projection
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain.slope import slope_aspect

SUN = Geometry(70.0, 117.0, 20.0, 40.0)


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


def test_a_larger_elevation_gives_what_its_window_gives(around, lai):
    """On cells away from the window's edge; the horizon is that of the larger one in both."""
    window = around.isel(y=slice(50, 120), x=slice(50, 130))
    whole = fifesim.surface_reflectance(lai, bands=["TM4"], dem=around, geometry=SUN)
    part = fifesim.surface_reflectance(lai, bands=["TM4"], dem=window, horizon=fifesim.horizon(around), geometry=SUN)
    np.testing.assert_allclose(part, whole, rtol=1e-12)


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
