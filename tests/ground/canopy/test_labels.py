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
RESPONSES = tuple(band.response for band in fifesim.instrument("TM").select(["TM3", "TM4"]))


@pytest.fixture(scope="module")
def by_cell(lai_values):
    """Function that returns a raster of uniform random numbers on the cells of the scene, one of them missing."""

    def made(low, high, seed=0):
        values = np.random.default_rng(seed).uniform(low, high, lai_values.shape)
        values[3, 4] = np.nan
        return lai_values.drop_attrs(deep=False).copy(data=values).rename(None)

    return made


def reflectance(lai, exact=False, geometry=None, dem=None, **canopy):
    given = {"geometry": geometry, "dem": dem, "exact": exact}
    return fifesim.surface_reflectance(lai, bands=["TM3", "TM4"], canopy=Canopy(**canopy), **given)


def level(lai):
    return level_reflectance(lai, BANDS, BandCanopy(Canopy(), LEAF, None, (0.1, 0.2)), Light(SUN, SKY))


def test_reflectance_is_lazy_and_labelled_and_equals_the_kernel(lai_with_hole):
    result = check_raster_function(level, lai_with_hole, quantity="surface_reflectance")
    angles = {"sza": SUN.sza, "vza": SUN.vza, "raa": SUN.raa}
    expected = canopy_reflectance(lai_with_hole.values, *LEAF, (0.1, 0.2), diffuse_fraction=SKY, **angles)
    np.testing.assert_array_equal(result, expected)
    assert result.dims == ("band", "y", "x")
    assert result["band"].values.tolist() == ["TM3", "TM4"] and result["wavelength"].values.tolist() == [0.66, 0.84]
    assert directions.geometry_of(result) == SUN
    assert result.attrs["arp"] == 0.15
    for band in result:
        np.testing.assert_array_equal(np.isnan(band), np.isnan(lai_with_hole))


def test_fpar_is_lazy_and_labelled_and_equals_the_kernel(lai_with_hole):
    """The default sun is the one of the raster, then of FIFE."""
    verb = {"canopy": Canopy(leaf_angles="planophile"), "fpar_inf": 0.9}
    result = check_raster_function(lambda lai: fifesim.fpar(lai, geometry=SUN, **verb), lai_with_hole, quantity="fpar")
    extinction = float(layers.extinction_coefficient(SUN.sza, "planophile"))
    expected = layers.beer_fpar(lai_with_hole.values, extinction=extinction, fpar_inf=0.9)
    np.testing.assert_array_equal(result, expected)
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


BOTH, CROWNS = (True, True), {"dissociation": 0.6, "crown_shape": 0.5}
# Fields of a canopy from values by cell, ranges of these values, bands in which the missing cell is NaN, and tolerance
# of the tables. Optics by cell are evaluated without tables.
SCENES = {
    "leaf optics": (
        lambda rho, tau: {"leaf_optics": {"TM3": (rho, tau), "TM4": (0.45, 0.42)}, "background": 0.2},
        [(0.02, 0.15), (0.02, 0.15)], (True, False), 0.0,
    ),
    "chlorophyll": (lambda content: {"leaf_optics": fifesim.Leaf(chlorophyll=content)}, [(5, 80)], BOTH, 2e-8),
    "background": (lambda soil: {"background": {"TM3": soil, "TM4": 0.3}}, [(0, 0.3)], (True, False), 1e-6),
    "mixture": (lambda dry: {"background": {"soil_dry": dry, "shade": 1 - dry}}, [(0, 1)], BOTH, 1e-6),
    "soil": (lambda soil, water: {"soil": soil, "moisture": water}, [(-0.05, 0.05), (0, 1)], BOTH, 1e-6),
    "crowns": (lambda brown, cover: {"brown": brown, "crown_cover": cover} | CROWNS, [(0, 1), (0.3, 1)], BOTH, 1e-6),
    "dead leaves": (
        lambda brown, cover: {
            "brown": brown, "crown_cover": cover, "brown_leaf": {"TM3": (0.2 * cover, 0.04), "TM4": (0.45, 0.42)},
        } | CROWNS,
        [(0, 1), (0.3, 1)], BOTH, 0.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_properties_by_cell_equal_uniform_scenes(lai, by_cell, name):
    canopy, ranges, missing, atol = SCENES[name]
    rasters = [by_cell(*ends, seed) for seed, ends in enumerate(ranges)]
    found = check_raster_function(
        lambda area, *given: reflectance(area, **canopy(*given)), lai, *rasters, quantity="surface_reflectance"
    )
    assert tuple(np.isnan(found[:, 3, 4]).values) == missing and int(np.isnan(found).sum()) == sum(missing)
    exact = reflectance(lai, exact=True, **canopy(*rasters))
    np.testing.assert_allclose(found, exact, rtol=0, atol=atol)
    for row, column in ((0, 0), (10, 20), (44, 53)):
        one = lai[row : row + 1, column : column + 1]
        alone = reflectance(one, exact=True, **canopy(*(float(each[row, column]) for each in rasters)))
        np.testing.assert_allclose(exact[:, row, column], alone[:, 0, 0], rtol=0, atol=1e-13)


def test_rasters_of_all_bands_are_matched_by_name_and_placed_by_coordinates(lai, by_cell):
    one, other = by_cell(0.02, 0.15), by_cell(0.02, 0.15, 1)
    both = xr.concat([other, one], "band").assign_coords(band=["TM4", "TM3"])
    leaves = {"TM3": (one, one), "TM4": (other, other)}
    xr.testing.assert_equal(reflectance(lai, leaf_optics=(both, both)), reflectance(lai, leaf_optics=leaves))
    by_band = reflectance(lai, background={"TM3": one, "TM4": other})
    xr.testing.assert_equal(reflectance(lai, background=both), by_band)
    xr.testing.assert_equal(reflectance(lai, brown=one[::-1]), reflectance(lai, brown=one))
    for given, what in (({"background": both[:1]}, "background"), ({"leaf_optics": (both[:1], both)}, "leaf refl.*")):
        with pytest.raises(ValueError, match=f"the {what} lacks band TM3, it has TM4"):
            reflectance(lai, **given)


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


def test_kinds_of_leaf_and_soil_by_cell_equal_their_scenes(lai, by_cell):
    """Made with `xr.where`, which drops the CRS."""
    young = by_cell(0, 1) > 0.5
    contents = {"chlorophyll": xr.where(young, 30.0, 50.0), "brown": xr.where(young, 0.0, 0.5)}
    dry = xr.where(young, 0.25, 0.75)
    found = reflectance(lai, leaf_optics=fifesim.Leaf(**contents), background={"soil_dry": dry, "shade": 1 - dry})
    for kind, (chlorophyll, brown, dry) in ((True, (30.0, 0.0, 0.25)), (False, (50.0, 0.5, 0.75))):
        leaf, soil = fifesim.Leaf(chlorophyll=chlorophyll, brown=brown), {"soil_dry": dry, "shade": 1 - dry}
        alone = reflectance(lai, exact=True, leaf_optics=leaf, background=soil)
        cells = np.broadcast_to(young.values == kind, found.shape)
        np.testing.assert_allclose(found.values[cells], alone.values[cells], rtol=0, atol=1e-9)


def test_leaves_by_cell_with_angles_by_cell_and_terrain(lai, by_cell):
    leaf = fifesim.Leaf(water=by_cell(0.005, 0.02))
    angles = xr.Dataset({"sza": by_cell(20, 40), "saa": 120.0})
    found = reflectance(lai, leaf_optics=leaf, geometry=angles)[:, 10, 20]
    here = fifesim.Geometry(float(angles["sza"][10, 20]), 120.0)
    alone = reflectance(lai, exact=True, geometry=here, leaf_optics=fifesim.Leaf(water=float(leaf.water[10, 20])))
    np.testing.assert_allclose(found, alone[:, 10, 20], rtol=0, atol=2e-6)
    flat = (lai.drop_attrs(deep=False) * 0 + 300.0).rename("dem")
    hills = reflectance(lai, leaf_optics=leaf, dem=flat)
    xr.testing.assert_allclose(hills, reflectance(lai, leaf_optics=leaf), rtol=1e-12)


def test_bare_soil_follows_the_soil_line_and_darkens_with_water(lai):
    plain = reflectance(0 * lai)
    assert (reflectance(0 * lai, soil=0.0, moisture=0.0) == plain).all()
    brighter = reflectance(0 * lai, soil=0.05)
    np.testing.assert_allclose((brighter - plain)[:, 0, 0], 0.05 * soil_line(RESPONSES), rtol=1e-9)
    assert (reflectance(0 * lai, moisture=1.0) < reflectance(0 * lai, moisture=0.5)).all()
    assert brighter.attrs["soil"] == 0.05


def test_soil_kernel_holds_no_rasters(lai, by_cell):
    """Rasters are arguments of the kernel; dask would hash and pickle rasters in its closure."""
    large = xr.concat([by_cell(0, 1)] * 40, "y")
    kernel, rasters = soil_kernel(RESPONSES, lai, soil=large, moisture=large)
    assert len(rasters) == 2 and len(cloudpickle.dumps(kernel)) < large.nbytes / 4
