"""Tests of canopies on labelled rasters: labels, laziness, leaves, backgrounds and properties by cell."""

from types import SimpleNamespace

import cloudpickle
import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim import Canopy
from fifesim.base.geometry import Geometry
from fifesim.grids import directions
from fifesim.ground.canopy import layers
from fifesim.ground.canopy.labels import BandCanopy, Light, level_reflectance
from fifesim.ground.canopy.optics_labels import soil_kernel
from fifesim.ground.canopy.reflectance_table import canopy_reflectance
from fifesim.ground.canopy.soil import soil_line

SUN = Geometry(35.0, 120.0, 10.0, 200.0)
BANDS = [SimpleNamespace(name="TM3", wavelength=0.66), SimpleNamespace(name="TM4", wavelength=0.84)]
LEAF = [0.08, 0.45], [0.05, 0.45]
SKY = [0.2, 0.1]
TM34 = ["TM3", "TM4"]
RESPONSES = tuple(band.response for band in fifesim.instrument("TM").select(TM34))
CELLS = [(0, 0), (10, 20), (44, 53)]


@pytest.fixture(scope="module")
def by_cell(lai_values):
    """Function that returns a raster of uniform random numbers on the cells of the scene, one of them missing."""

    def made(low, high, seed=0):
        values = np.random.default_rng(seed).uniform(low, high, lai_values.shape)
        values[3, 4] = np.nan
        return lai_values.drop_attrs(deep=False).copy(data=values).rename(None)

    return made


@pytest.fixture(scope="module")
def share(by_cell):
    return by_cell(0, 1, 2)


def level(lai, background=(0.1, 0.2)):
    return level_reflectance(lai, BANDS, BandCanopy(Canopy(), LEAF, None, background), Light(SUN, SKY))


def kernel(lai, background):
    angles = {"sza": SUN.sza, "vza": SUN.vza, "raa": SUN.raa}
    return canopy_reflectance(lai.values, *LEAF, background, diffuse_fraction=SKY, **angles)


def reflectance(lai, exact=False, geometry=None, dem=None, **canopy):
    given = {"geometry": geometry, "dem": dem, "exact": exact}
    return fifesim.surface_reflectance(lai, bands=TM34, canopy=Canopy(**canopy), **given)


def check_cells(found, scene, lai, *rasters, atol):
    """Compare some cells with exact scenes that have the values of the rasters at the cell everywhere."""
    for row, column in CELLS:
        one = lai[row : row + 1, column : column + 1]
        alone = scene(one, *(float(raster[row, column]) for raster in rasters), exact=True)
        np.testing.assert_allclose(found[:, row, column], alone[:, 0, 0], rtol=0, atol=atol)


def check_by_cell(scene, lai, *rasters, atol, missing=(True, True)):
    """Check the rules for raster functions, the bands in which the missing cell is NaN, and the values of cells."""
    found = check_raster_function(scene, lai, *rasters, quantity="surface_reflectance")
    assert tuple(np.isnan(found[:, 3, 4]).values) == missing and int(np.isnan(found).sum()) == sum(missing)
    check_cells(found, scene, lai, *rasters, atol=atol)
    return found


def test_reflectance_is_lazy_and_labelled_and_equals_the_kernel(lai_with_hole):
    result = check_raster_function(level, lai_with_hole, quantity="surface_reflectance")
    np.testing.assert_array_equal(result, kernel(lai_with_hole, (0.1, 0.2)))
    assert result.dims == ("band", "y", "x")
    assert result["band"].values.tolist() == TM34 and result["wavelength"].values.tolist() == [0.66, 0.84]
    assert directions.geometry_of(result) == SUN
    assert result.attrs["arp"] == 0.15
    for band in result:
        np.testing.assert_array_equal(np.isnan(band), np.isnan(lai_with_hole))


def test_background_may_be_a_raster(lai, by_cell):
    soil = by_cell(0.05, 0.3).rename("soil")
    one = check_raster_function(level, lai, soil, quantity="surface_reflectance")
    np.testing.assert_array_equal(one, kernel(lai, np.stack([soil, soil])))
    assert np.isnan(one[:, 3, 4]).all() and int(np.isnan(one).sum()) == 2
    bands = xr.concat([soil + 0.1, soil], dim="band").assign_coords(band=["TM4", "TM3"])
    two = check_raster_function(level, lai, bands, quantity="surface_reflectance")
    np.testing.assert_array_equal(two.sel(band="TM3"), one.sel(band="TM3"))
    assert int((two.sel(band="TM4") > one.sel(band="TM4")).sum()) == lai.size - 1
    with pytest.raises(ValueError, match="the background lacks band TM4, it has TM3"):
        level(lai, bands.sel(band=["TM3"]))


def test_fpar_is_lazy_and_labelled_and_equals_the_kernel(lai_with_hole):
    """The default sun is the one of the raster, then of FIFE."""
    verb = {"canopy": Canopy(leaf_angles="planophile"), "fpar_inf": 0.9}
    result = check_raster_function(lambda lai: fifesim.fpar(lai, geometry=SUN, **verb), lai_with_hole, quantity="fpar")
    extinction = float(layers.extinction_coefficient(SUN.sza, "planophile"))
    expected = layers.beer_fpar(lai_with_hole.values, extinction=extinction, fpar_inf=0.9)
    np.testing.assert_array_equal(result, expected)
    np.testing.assert_array_equal(np.isnan(result), np.isnan(lai_with_hole))
    np.testing.assert_array_equal(fifesim.fpar(directions.with_geometry(lai_with_hole, SUN), **verb), result)
    fife = fifesim.fpar(lai_with_hole, **verb)
    np.testing.assert_array_equal(fife, fifesim.fpar(lai_with_hole, geometry=fifesim.fife_geometry(), **verb))
    assert not np.array_equal(fife, result, equal_nan=True)


@pytest.mark.parametrize("function", [level, fifesim.fpar])
def test_negative_leaf_area_is_refused_when_it_is_computed(lai, function):
    lai[1, 1] = -0.1
    with no_compute():
        lazy = function(in_chunks(lai, ODD_CHUNKS))
    with pytest.raises(ValueError, match=r"negative|at least 0"):
        lazy.compute()


@pytest.mark.parametrize("dead_leaves", [False, True])
def test_dead_share_and_crown_cover_by_cell_equal_uniform_scenes(lai, by_cell, dead_leaves):
    """Also with optics of dead leaves by cell, which are evaluated without tables."""
    brown, cover = by_cell(0, 1), by_cell(0.3, 1, 2)
    cover[3, 4], cover[5, 6] = 0.5, np.nan

    def scene(area, brown, cover, exact=False):
        optics = {"TM3": (0.2 * cover, 0.04), "TM4": (0.45, 0.42)} if dead_leaves else None
        shares = {"brown": brown, "crown_cover": cover, "brown_leaf": optics}
        return reflectance(area, exact, dissociation=0.6, crown_shape=0.5, **shares)

    found = check_raster_function(scene, lai, brown, cover, quantity="surface_reflectance")
    holes = np.isnan(found)
    assert holes[:, 3, 4].all() and holes[:, 5, 6].all() and int(holes.sum()) == 4
    check_cells(found, scene, lai, brown, cover, atol=1e-13 if dead_leaves else 1e-6)
    assert "brown by cell, dissociation 0.6, crown_cover by cell, sza" in found.attrs["history"]
    np.testing.assert_array_equal(scene(lai, brown[::-1], cover), found)


def test_green_fpar_is_fpar_times_the_green_share(lai, by_cell):
    brown, cover = by_cell(0, 1), by_cell(0.3, 1, 2)
    green = check_raster_function(
        lambda area, brown, cover: fifesim.fpar(area, leaves="green", canopy=Canopy(brown=brown, crown_cover=cover)),
        lai, brown, cover, quantity="green_fpar",
    )  # fmt: skip
    total = fifesim.fpar(lai, canopy=Canopy(crown_cover=cover))
    np.testing.assert_allclose(green, total * (1 - brown), rtol=1e-12)
    np.testing.assert_array_equal(fifesim.fpar(lai, canopy=Canopy(brown=brown)), fifesim.fpar(lai))
    whole = fifesim.fpar(lai, canopy=Canopy(crown_cover=xr.ones_like(brown).where(brown.notnull())))
    np.testing.assert_allclose(whole, fifesim.fpar(lai).where(brown.notnull()), rtol=1e-14)


def test_leaf_optics_by_band_and_cell(lai, by_cell):
    """Numbers and rasters may be mixed; a raster may have all bands."""

    def scene(area, rho, tau, exact=False):
        return reflectance(area, exact, leaf_optics={"TM3": (rho, tau), "TM4": (0.45, 0.42)}, background=0.2)

    one, other = by_cell(0.02, 0.15), by_cell(0.02, 0.15, 1)
    check_by_cell(scene, lai, one, other, missing=(True, False), atol=1e-12)
    both = xr.concat([other, one], "band").assign_coords(band=["TM4", "TM3"])
    named = {"TM3": (one, one), "TM4": (other, other)}
    xr.testing.assert_equal(reflectance(lai, leaf_optics=(both, both)), reflectance(lai, leaf_optics=named))
    with pytest.raises(ValueError, match="the leaf reflectance lacks band TM3, it has TM4"):
        reflectance(lai, leaf_optics=(both[:1], both))


def test_one_content_by_cell(lai, by_cell):
    """The error of tabulated leaf optics is an upper bound of the error of canopy reflectance."""

    def scene(area, content, exact=False):
        return reflectance(area, exact, leaf_optics=fifesim.Leaf(chlorophyll=content))

    chlorophyll = by_cell(5, 80)
    found = check_by_cell(scene, lai, chlorophyll, atol=2e-8)
    exact = scene(lai, chlorophyll, exact=True)
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-8)
    check_cells(exact, scene, lai, chlorophyll, atol=1e-9)


def test_two_kinds_of_leaf_by_cell(lai, by_cell):
    """Contents by cover type, made with `xr.where`, which drops the CRS."""
    young = by_cell(0, 1) > 0.5
    contents = {"chlorophyll": xr.where(young, 30.0, 50.0), "brown": xr.where(young, 0.0, 0.5)}
    found = reflectance(lai, leaf_optics=fifesim.Leaf(**contents))
    for kind, chlorophyll, brown in ((True, 30.0, 0.0), (False, 50.0, 0.5)):
        alone = reflectance(lai, exact=True, leaf_optics=fifesim.Leaf(chlorophyll=chlorophyll, brown=brown))
        cells = (young.values == kind) & np.isfinite(found.values)
        np.testing.assert_allclose(found.values[cells], alone.values[cells], rtol=0, atol=1e-9)


def test_leaves_by_cell_with_angles_by_cell_and_terrain(lai, by_cell):
    leaf = fifesim.Leaf(water=by_cell(0.005, 0.02))
    angles = xr.Dataset({"sza": by_cell(20, 40), "saa": 120.0})
    found = reflectance(lai, leaf_optics=leaf, geometry=angles)
    cell = CELLS[1]
    here = fifesim.Geometry(float(angles["sza"][cell]), 120.0)
    alone = reflectance(lai, exact=True, geometry=here, leaf_optics=fifesim.Leaf(water=float(leaf.water[cell])))
    np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=2e-6)
    flat = (lai.drop_attrs(deep=False) * 0 + 300.0).rename("dem")
    hills = reflectance(lai, leaf_optics=leaf, dem=flat)
    xr.testing.assert_allclose(hills, reflectance(lai, leaf_optics=leaf), rtol=1e-12)


def test_background_by_band_mixes_numbers_and_rasters(lai, share):
    def scene(area, soil, exact=False):
        return reflectance(area, exact, background={"TM3": soil * 0.3, "TM4": 0.3})

    check_by_cell(scene, lai, share, missing=(True, False), atol=1e-6)


def test_fractions_of_a_mixture_by_cell(lai, share):
    """Also for fractions made with `xr.where`, which drops the CRS."""

    def scene(area, dry, exact=True):
        return reflectance(area, exact, background={"soil_dry": dry, "shade": 1 - dry})

    check_by_cell(scene, lai, share, atol=1e-9)
    assert np.isfinite(scene(lai, xr.where(share > 0.5, 0.25, 0.75), exact=False)).all()


def test_brightness_and_moisture_by_cell(lai, share):
    def scene(area, soil, water, exact=False):
        return reflectance(area, exact, soil=soil, moisture=water)

    found = check_by_cell(scene, lai, (share - 0.5) * 0.1, share, atol=1e-6)
    assert found.attrs["soil"] == found.attrs["moisture"] == "raster"
    assert scene(lai, 0.03, 0.2).attrs["soil"] == 0.03
    bands = {"TM3": share * 0.2, "TM4": share * 0.2}
    one_layer, by_band = (reflectance(lai, background=each, soil=0.01) for each in (share * 0.2, bands))
    np.testing.assert_array_equal(one_layer, by_band)


def test_bare_soil_follows_the_soil_line_and_darkens_with_water(lai):
    plain = reflectance(0 * lai)
    assert (reflectance(0 * lai, soil=0.0, moisture=0.0) == plain).all()
    brighter = reflectance(0 * lai, soil=0.05) - plain
    np.testing.assert_allclose(brighter[:, 0, 0], 0.05 * soil_line(RESPONSES), rtol=1e-9)
    assert (reflectance(0 * lai, moisture=1.0) < reflectance(0 * lai, moisture=0.5)).all()


def test_soil_kernel_holds_no_rasters(lai, share):
    """Rasters are arguments of the kernel; dask would hash and pickle rasters in its closure."""
    large = xr.concat([share] * 40, "y")
    kernel, rasters = soil_kernel(RESPONSES, lai, soil=large, moisture=large)
    assert len(rasters) == 2 and len(cloudpickle.dumps(kernel)) < large.nbytes / 4
