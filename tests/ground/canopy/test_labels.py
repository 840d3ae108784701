"""Tests of canopy reflectance and FPAR on labelled rasters: labels, laziness, properties by cell, and kernel values."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim import Canopy
from fifesim.base.geometry import Geometry
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.ground.canopy import layers
from fifesim.ground.canopy.labels import BandCanopy, Light, canopy_kernel, level_reflectance, reflectance_of_classes
from fifesim.ground.canopy.reflectance_table import canopy_reflectance

SUN = Geometry(35.0, 120.0, 10.0, 200.0)
BANDS = [SimpleNamespace(name="TM3", wavelength=0.66), SimpleNamespace(name="TM4", wavelength=0.84)]
LEAF = [0.08, 0.45], [0.05, 0.45]
SKY = [0.2, 0.1]
LIGHT = Light(SUN, SKY)
STANDS = {
    3: BandCanopy(Canopy(), ([0.07, 0.46], [0.04, 0.41]), None, [0.1, 0.2]),
    8: BandCanopy(Canopy(hotspot=0.2), ([0.1, 0.4], [0.1, 0.5]), None, [0.2, 0.3]),
}


@pytest.fixture
def cover(lai):
    return lai.copy(data=np.random.default_rng(5).choice([3, 8], lai.shape).astype(np.int16)).rename("cover")


def reflectance(lai, background=(0.1, 0.2), **options):
    return level_reflectance(lai, BANDS, BandCanopy(Canopy(), LEAF, None, background), LIGHT, **options)


def test_reflectance_is_lazy_and_labelled_and_equals_the_kernel(lai_with_hole):
    result = check_raster_function(reflectance, lai_with_hole, quantity="surface_reflectance")
    kernel = canopy_reflectance(
        lai_with_hole.values, *LEAF, (0.1, 0.2), sza=SUN.sza, vza=SUN.vza, raa=SUN.raa, diffuse_fraction=SKY
    )
    np.testing.assert_array_equal(result, kernel)
    assert result.dims == ("band", "y", "x")
    assert result["band"].values.tolist() == ["TM3", "TM4"]
    assert result["wavelength"].values.tolist() == [0.66, 0.84]
    assert directions.geometry_of(result) == SUN
    assert result.attrs["arp"] == 0.15
    for band in result:
        np.testing.assert_array_equal(np.isnan(band), np.isnan(lai_with_hole))


def test_background_may_be_a_raster(lai):
    soil = grids.place(
        xr.DataArray(np.random.default_rng(0).uniform(0.05, 0.3, lai.shape), dims=("y", "x"), name="soil"),
        grids.geobox(lai),
    )
    soil[3, 4] = np.nan
    one = check_raster_function(reflectance, lai, soil, quantity="surface_reflectance")
    expected = canopy_reflectance(
        lai.values, *LEAF, np.stack([soil, soil]), sza=SUN.sza, vza=SUN.vza, raa=SUN.raa, diffuse_fraction=SKY
    )
    np.testing.assert_array_equal(one, expected)
    assert np.isnan(one[:, 3, 4]).all() and int(np.isnan(one).sum()) == 2
    by_band = xr.concat([soil + 0.1, soil], dim="band").assign_coords(band=["TM4", "TM3"])
    two = check_raster_function(reflectance, lai, by_band, quantity="surface_reflectance")
    np.testing.assert_array_equal(two.sel(band="TM3"), one.sel(band="TM3"))
    assert int((two.sel(band="TM4") > one.sel(band="TM4")).sum()) == lai.size - 1
    with pytest.raises(ValueError, match="the background lacks band TM4, it has TM3"):
        reflectance(lai, by_band.sel(band=["TM3"]))


def test_fpar_is_lazy_and_labelled_and_equals_the_kernel(lai_with_hole):
    result = check_raster_function(
        lambda lai: fifesim.fpar(lai, geometry=SUN, canopy=Canopy(leaf_angles="planophile"), fpar_inf=0.9),
        lai_with_hole,
        quantity="fpar",
    )
    extinction = layers.extinction_coefficient(SUN.sza, "planophile")
    np.testing.assert_array_equal(
        result, layers.beer_fpar(lai_with_hole.values, extinction=float(extinction), fpar_inf=0.9)
    )
    np.testing.assert_array_equal(np.isnan(result), np.isnan(lai_with_hole))


def test_fpar_uses_the_sun_position_of_the_raster(lai):
    with_sun = fifesim.fpar(directions.with_geometry(lai, SUN))
    np.testing.assert_array_equal(with_sun, fifesim.fpar(lai, geometry=SUN))
    np.testing.assert_array_equal(fifesim.fpar(lai), fifesim.fpar(lai, geometry=fifesim.fife_geometry()))
    assert not np.array_equal(with_sun, fifesim.fpar(lai))


@pytest.mark.parametrize("function", [reflectance, fifesim.fpar])
def test_negative_leaf_area_is_refused(lai, function):
    """For lazy leaf area when it is computed."""
    lai[1, 1] = -0.1
    with pytest.raises(ValueError, match=r"negative|at least 0"):
        function(lai)
    with no_compute():
        lazy = function(in_chunks(lai, ODD_CHUNKS))
    with pytest.raises(ValueError, match=r"negative|at least 0"):
        lazy.compute()


def test_each_class_equals_a_scene_of_its_canopy(lai, cover):
    made = reflectance_of_classes(lai, cover, BANDS, STANDS, LIGHT, attrs={"atmosphere": "none"})
    for code, stand in STANDS.items():
        alone = level_reflectance(lai, BANDS, stand, LIGHT)
        np.testing.assert_array_equal(made.values[:, cover == code], alone.values[:, cover == code])
    assert made.name == "surface_reflectance" and made.attrs["atmosphere"] == "none"
    assert made.attrs["leaf_angles"] == alone.attrs["leaf_angles"] and made.attrs["background"] == "by class"


TM34 = ["TM3", "TM4"]
CELLS = [(0, 0), (10, 20), (44, 53)]


@pytest.fixture
def cells(lai):
    return np.random.default_rng(1).choice(lai.size, 300, replace=False)


def flat(raster):
    """Raster reshaped to cells, shape (n, [band])."""
    return np.moveaxis(raster.values, 0, -1).reshape(-1, 2) if "band" in raster.dims else raster.values.ravel()


@pytest.mark.parametrize("kind", ["uniform", "background", "brown", "sun", "leaves"])
def test_kernel_gives_the_same_bits_for_selected_cells(lai, cells, kind):
    """Rasters are arguments of the kernel, by cell; numbers are passed unchanged."""
    light, canopy = LIGHT, STANDS[3]
    if kind == "background":
        canopy = canopy._replace(background=(0.1 + lai / 20).drop_attrs(deep=False))
    if kind == "brown":
        varied = Canopy(brown=(lai / 5).drop_attrs(deep=False), dissociation=0.5, crown_cover=0.8)
        canopy = canopy._replace(canopy=varied, dead=([0.3, 0.4], [0.2, 0.3]))
    if kind == "leaves":
        rho = xr.concat([0.05 + lai / 50, 0.4 + lai / 50], "band").drop_attrs(deep=False)
        canopy = canopy._replace(leaf=(rho, [0.04, 0.41]))
    if kind == "sun":
        sza = (30 + lai).drop_attrs(deep=False).rename("sza").assign_attrs(units="degree")
        angles = xr.Dataset({"sza": sza, "saa": 120.0, "vza": 10.0, "vaa": 90.0, "earth_sun_distance": 1.0})
        light = Light(angles, [0.1, 0.05])
    whole = level_reflectance(lai, BANDS, canopy, light)
    kernel, rasters = canopy_kernel(lai, TM34, canopy, light)
    blocks = [flat(each)[cells] if "y" in each.dims else each.values for each in rasters]
    np.testing.assert_array_equal(kernel(lai.values.ravel()[cells], *blocks), whole.values.reshape(2, -1)[:, cells])


@pytest.fixture(scope="module")
def rasters(lai_values):
    rng = np.random.default_rng(2)
    brown, cover = (
        lai_values.drop_attrs(deep=False).copy(data=rng.uniform(low, 1, lai_values.shape)).rename(None)
        for low in (0.0, 0.3)
    )
    brown[3, 4] = cover[5, 6] = np.nan
    return brown, cover


def shared_reflectance(lai, canopy, **options):
    return fifesim.surface_reflectance(lai, bands=TM34, canopy=canopy, **options)


@pytest.mark.parametrize("dead_leaves", [False, True])
def test_dead_share_and_crown_cover_by_cell_equal_uniform_scenes(lai, rasters, dead_leaves):
    """Also with optics of dead leaves by cell, which are evaluated without tables."""

    def scene(area, brown, cover, **options):
        optics = {"TM3": (0.2 * cover, 0.04), "TM4": (0.45, 0.42)} if dead_leaves else None
        canopy = Canopy(dissociation=0.6, crown_shape=0.5, brown=brown, crown_cover=cover, brown_leaf=optics)
        return shared_reflectance(area, canopy, **options)

    found = check_raster_function(scene, lai, *rasters, quantity="surface_reflectance")
    holes = np.isnan(found)
    assert holes[:, 3, 4].all() and holes[:, 5, 6].all() and int(holes.sum()) == 4
    for row, column in CELLS:
        one = lai[row : row + 1, column : column + 1]
        alone = scene(one, *(float(each[row, column]) for each in rasters), exact=True)
        tolerance = {"rtol": 1e-12} if dead_leaves else {"rtol": 0, "atol": 1e-6}
        np.testing.assert_allclose(found[:, row, column], alone[:, 0, 0], **tolerance)
    assert "brown by cell, dissociation 0.6, crown_cover by cell, sza" in found.attrs["history"]


def test_rasters_with_rows_from_south_to_north_are_flipped(lai, rasters):
    brown, _ = rasters
    flipped, straight = (shared_reflectance(lai, Canopy(brown=each)) for each in (brown[::-1], brown))
    np.testing.assert_array_equal(flipped, straight)


def test_green_fpar_is_fpar_times_the_green_share(lai, rasters):
    brown, cover = rasters
    green = check_raster_function(
        lambda area, brown, cover: fifesim.fpar(area, leaves="green", canopy=Canopy(brown=brown, crown_cover=cover)),
        lai, brown, cover, quantity="green_fpar",
    )  # fmt: skip
    total = fifesim.fpar(lai, canopy=Canopy(crown_cover=cover))
    np.testing.assert_allclose(green, total * (1 - brown), rtol=1e-12)
    np.testing.assert_array_equal(fifesim.fpar(lai, canopy=Canopy(brown=brown)), fifesim.fpar(lai))
    whole = fifesim.fpar(lai, canopy=Canopy(crown_cover=xr.ones_like(brown).where(brown.notnull())))
    np.testing.assert_allclose(whole, fifesim.fpar(lai).where(brown.notnull()), rtol=1e-14)


def test_single_band_equals_the_band_of_two(lai):
    found = fifesim.surface_reflectance(lai, bands=["TM4"], canopy=Canopy(hotspot=0.1))
    np.testing.assert_array_equal(found[0], shared_reflectance(lai, Canopy(hotspot=0.1))[1])


def test_percent_unknown_leaves_and_leaf_area_that_crowns_cannot_hold_are_refused(lai, rasters):
    brown, _ = rasters
    for cover, exact in product((1e-3, xr.full_like(lai, 1e-3).drop_attrs(deep=False)), (False, True)):
        with pytest.raises(ValueError, match="within the crowns is lai / crown_cover, at most 100"):
            shared_reflectance(lai, Canopy(crown_cover=cover), exact=exact)
    with pytest.raises(ValueError, match="units '%'"):
        shared_reflectance(lai, Canopy(brown=brown.assign_attrs(units="%")))
    with pytest.raises(ValueError, match="units '%', surface_reflectance needs '1'"):
        reflectance(lai, xr.full_like(lai, 20.0).assign_attrs(units="%"))
    with pytest.raises(ValueError, match="leaves must be 'all' or 'green', got 'dead'"):
        fifesim.fpar(lai, leaves="dead")
    with pytest.raises(ValueError, match="lai has units 'percent', lai needs '1'"):
        fifesim.fpar(lai.assign_attrs(units="percent"))
