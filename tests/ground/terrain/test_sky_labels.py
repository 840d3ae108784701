"""Tests of horizons on labelled rasters, and of sky view from them."""

import numpy as np
import pytest
from elevations import labelled
from lazy import check_raster_function, no_compute
from oracles_terrain import hills, plane
from scipy import ndimage

import fifesim
from fifesim.base.geometry import Geometry
from fifesim.ground.terrain import sky_labels as sky_raster

SUN = Geometry(70.0, 117.0, 20.0, 40.0)


def test_horizon_follows_the_rules_for_raster_functions(dem):
    dem.attrs["source_resolution"] = 10.0
    found = check_raster_function(lambda each: sky_raster.horizon(each, reach=60.0), dem, quantity="horizon")
    assert found.sizes == {"direction": 32, "y": 15, "x": 18}
    assert found["y"].isin(dem["y"]).all() and found["x"].isin(dem["x"]).all()


def test_coarse_horizons_agree_with_horizons_at_every_cell():
    """Terrain with waves of 200 m and more, which 30 m cells resolve; tolerances from the docstring."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, 900, 900, 10 / 3)
    z = hills((270, 270), seed=2, relief=26.0, length=60.0)
    coarse, fine = labelled(grid, z, source_resolution=30.0), labelled(grid, z)
    difference = fifesim.terrain.sky_view(coarse) - fifesim.terrain.sky_view(fine)
    assert float(fifesim.terrain.sky_view(fine).std()) > 0.003
    assert float(abs(difference).max()) < 0.004
    assert float(difference.std()) < 5e-4


@pytest.mark.parametrize(("size", "cell"), [(41, 10.0), (64, 1.0), (110, 90.0)])
@pytest.mark.parametrize("azimuth", [0.0, 45.0, 117.3])
def test_rotating_scene_and_sun_by_90_degrees_rotates_the_result(size, cell, azimuth):
    """Only rounding may differ: a model of unknown source has places at all its cells."""
    grid = fifesim.grid_at("EPSG:26914", 700000, 4330000, size * cell, size * cell, cell)
    z = 500 + cell * ndimage.gaussian_filter(np.random.default_rng(5).normal(size=(size, size)), 3) * 12
    found = []
    for turns, chunks in ((0, None), (1, None), (1, {"y": 19, "x": 33})):
        dem = labelled(grid, np.rot90(z, -turns).copy())
        lai = 2 + dem.copy(data=np.cos(dem.values))
        if chunks:
            dem, lai = dem.chunk(chunks), lai.chunk(chunks)
        angles = Geometry(50.0, azimuth + 90 * turns, 20.0, 40.0 + 90 * turns)
        lai.attrs = {"units": "1", "site": "FIFE"}
        rho = fifesim.surface_reflectance(lai.rename("lai"), "TM", bands=["TM3", "TM4"], dem=dem, geometry=angles)
        found.append(np.rot90([*rho.values, fifesim.terrain.sky_view(dem).values], turns, axes=(1, 2)))
    assert found[0][2].std() > 0.003
    np.testing.assert_allclose(found[1], found[0], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found[2], found[1])


def test_sun_below_the_horizon_of_all_slopes_is_refused(site):
    steep = labelled(site, plane(tuple(site.shape), 10 / 3, 10 / 3, 40.0, 0.0))
    for function in (fifesim.terrain.shadow, fifesim.terrain.illumination):
        with pytest.raises(ValueError, match=r"sza 60, 178.* from grid north.*below the horizon of every slope"):
            function(steep, Geometry(60.0, 180.0))


def test_horizons_longer_than_a_chunk_have_no_seams(around, lai):
    around.attrs["source_resolution"] = 10 / 3
    whole = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=around, geometry=SUN)
    for chunks in ({"y": 37, "x": 50}, {"y": 165, "x": 29}):
        parts = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], dem=around.chunk(chunks), geometry=SUN)
        np.testing.assert_array_equal(parts, whole)


@pytest.mark.parametrize("options", [{"directions": 12}, {"reach": 1.0}, {"resolution": 0.0}])
def test_invalid_horizon_options_are_refused(dem, options):
    with pytest.raises(ValueError, match=r"from 16 up|at least one cell|positive metres"):
        fifesim.horizon(dem, **options)


def test_lazy_horizon_has_as_many_chunks_as_the_scene(around, dem):
    whole = fifesim.horizon(around, reach=90.0, resolution=10.0)
    with no_compute():
        lazy = fifesim.horizon(around.chunk(50), reach=90.0, resolution=10.0, beside=dem.chunk({"y": 15, "x": 27}))
    assert [len(sizes) for sizes in lazy.chunks[1:]] == [5, 4]
    np.testing.assert_array_equal(lazy, whole)


def test_horizon_that_does_not_cover_the_scene_is_refused(lai, dem, around):
    horizon = fifesim.horizon(around.isel(x=slice(0, 90)))
    with pytest.raises(ValueError, match=r"horizon spans .* does not cover the dem's"):
        fifesim.terrain.sky_view(dem, horizon)
    with pytest.raises(ValueError, match="give dem= too"):
        fifesim.surface_reflectance(lai, horizon=horizon)
    with pytest.raises(ValueError, match="evenly spaced"):
        fifesim.terrain.sky_view(dem, fifesim.horizon(around).isel(direction=slice(0, 20)))


@pytest.mark.parametrize(
    "cut", [{"x": slice(1, None)}, {"x": slice(None, -1)}, {"y": slice(1, None)}, {"y": slice(None, -1)}], ids=str
)
def test_horizon_may_end_less_than_one_cell_before_the_elevation(cut):
    """A horizon on nine of ten cells of 30 m is too small, but sufficient for the elevation without its last cell."""
    dem = labelled(fifesim.fife_site(30 / 9, window=((0, 90), (0, 90))), np.full((90, 90), 7.0))
    dem.attrs["source_resolution"] = 30.0
    horizon = fifesim.horizon(dem).isel(cut)
    with pytest.raises(ValueError, match="does not cover the dem's"):
        fifesim.terrain.sky_view(dem, horizon)
    np.testing.assert_allclose(fifesim.terrain.sky_view(dem.isel(cut), horizon), 1, rtol=1e-12)


def test_horizons_of_small_and_coarse_rasters():
    """A raster smaller than one cell of the source, and cells larger than the reach."""
    tiny = labelled(
        fifesim.grid_at("EPSG:26914", 700000, 4330000, 12, 9, 3), np.full((3, 4), 7.0), source_resolution=30.0
    )
    np.testing.assert_allclose(fifesim.terrain.sky_view(tiny), 1, rtol=1e-12)
    wide = labelled(fifesim.grid_at("EPSG:26914", 700000, 4330000, 80000, 60000, 10000), np.full((6, 8), 7.0))
    np.testing.assert_allclose(fifesim.terrain.sky_view(wide), 1, rtol=1e-12)
