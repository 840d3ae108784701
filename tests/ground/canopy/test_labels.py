"""The canopy on labelled rasters: labels, laziness, properties by cell, and the kernel's numbers."""

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


def test_reflectance_keeps_its_word_and_equals_the_kernel(lai_with_hole):
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
    one = check_raster_function(
        lambda lai, soil: reflectance(lai, soil), lai, soil, quantity="surface_reflectance"
    )  # fmt: skip
    expected = canopy_reflectance(
        lai.values, *LEAF, np.stack([soil, soil]), sza=SUN.sza, vza=SUN.vza, raa=SUN.raa, diffuse_fraction=SKY
    )
    np.testing.assert_array_equal(one, expected)
    by_band = xr.concat([soil + 0.1, soil], dim="band").assign_coords(band=["TM4", "TM3"])
    two = check_raster_function(
        lambda lai, soil: reflectance(lai, soil), lai, by_band, quantity="surface_reflectance"
    )  # fmt: skip
    np.testing.assert_array_equal(two.sel(band="TM3"), one.sel(band="TM3"))
    assert (two.sel(band="TM4") > one.sel(band="TM4")).all()
    with pytest.raises(ValueError, match="the background lacks band TM4, it has TM3"):
        reflectance(lai, by_band.sel(band=["TM3"]))


def test_background_in_percent_is_refused(lai):
    with pytest.raises(ValueError, match="units '%', surface_reflectance needs '1'"):
        reflectance(lai, xr.full_like(lai, 20.0).assign_attrs(units="%"))


def test_hole_in_the_background_is_a_hole_in_the_reflectance(lai):
    soil = xr.full_like(lai, 0.2)
    soil.attrs = {}
    soil[3, 4] = np.nan
    holes = np.isnan(reflectance(lai, soil))
    assert holes[:, 3, 4].all() and int(holes.sum()) == 2


def test_fpar_keeps_its_word_and_equals_the_kernel(lai_with_hole):
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


def test_fpar_takes_the_sun_that_the_raster_carries(lai):
    carried = fifesim.fpar(directions.with_geometry(lai, SUN))
    np.testing.assert_array_equal(carried, fifesim.fpar(lai, geometry=SUN))
    np.testing.assert_array_equal(fifesim.fpar(lai), fifesim.fpar(lai, geometry=fifesim.fife_geometry()))
    assert not np.array_equal(carried, fifesim.fpar(lai))


@pytest.mark.parametrize("function", [reflectance, fifesim.fpar])
def test_wrong_units_raise(lai, function):
    lai.attrs["units"] = "percent"
    with pytest.raises(ValueError, match="lai has units 'percent', lai needs '1'"):
        function(lai)


@pytest.mark.parametrize("function", [reflectance, fifesim.fpar])
def test_negative_leaf_area_raises_when_it_computes(lai, function):
    lai[1, 1] = -0.1
    with pytest.raises(ValueError, match=r"negative|at least 0"):
        function(lai)
    with no_compute():
        lazy = function(in_chunks(lai, ODD_CHUNKS))
    with pytest.raises(ValueError, match=r"negative|at least 0"):
        lazy.compute()


def test_each_class_is_its_canopy_alone(lai, cover):
    made = reflectance_of_classes(lai, cover, BANDS, STANDS, LIGHT, attrs={"atmosphere": "none"})
    for code, stand in STANDS.items():
        alone = level_reflectance(lai, BANDS, stand, LIGHT)
        np.testing.assert_array_equal(made.values[:, cover == code], alone.values[:, cover == code])
    assert made.name == "surface_reflectance" and made.attrs["atmosphere"] == "none"
    assert made.attrs["leaf_angles"] == alone.attrs["leaf_angles"] and made.attrs["background"] == "by class"


NAMES = ["red", "nir"]
LABELS = [SimpleNamespace(name="red", wavelength=0.66), SimpleNamespace(name="nir", wavelength=0.84)]
SUN_BY_CELL = Geometry(30.0, 120.0, 10.0, 90.0)
LIGHT_BY_CELL = Light(SUN_BY_CELL, [0.1, 0.05])
CANOPY = BandCanopy(Canopy(), ([0.07, 0.46], [0.04, 0.41]), None, [0.1, 0.2])
DEAD = [0.3, 0.4], [0.2, 0.3]
TM34 = ["TM3", "TM4"]
CELLS = [(0, 0), (10, 20), (44, 53)]


@pytest.fixture
def cells(lai):
    return np.random.default_rng(1).choice(lai.size, 300, replace=False)


def flat(raster):
    """A raster by cells, shape (n, [band])."""
    return np.moveaxis(raster.values, 0, -1).reshape(-1, 2) if "band" in raster.dims else raster.values.ravel()


@pytest.mark.parametrize("kind", ["uniform", "background", "brown", "sun", "leaves"])
def test_some_cells_have_the_bits_of_the_scene(lai, cells, kind):
    """Whatever is a raster: the kernel takes it cell by cell, after the leaf area, and what is none as it is."""
    light, canopy = LIGHT_BY_CELL, CANOPY
    if kind == "background":
        canopy = CANOPY._replace(background=(0.1 + lai / 20).drop_attrs(deep=False))
    if kind == "brown":
        own = Canopy(brown=(lai / 5).drop_attrs(deep=False), dissociation=0.5, crown_cover=0.8)
        canopy = CANOPY._replace(canopy=own, dead=DEAD)
    if kind == "leaves":
        rho = xr.concat([0.05 + lai / 50, 0.4 + lai / 50], "band").drop_attrs(deep=False)
        canopy = CANOPY._replace(leaf=(rho, [0.04, 0.41]))
    if kind == "sun":
        sza = (30 + lai).drop_attrs(deep=False).rename("sza").assign_attrs(units="degree")
        angles = xr.Dataset({"sza": sza, "saa": 120.0, "vza": 10.0, "vaa": 90.0, "earth_sun_distance": 1.0})
        light = Light(angles, [0.1, 0.05])
    whole = level_reflectance(lai, LABELS, canopy, light)
    kernel, rasters = canopy_kernel(lai, NAMES, canopy, light)
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


def test_rasters_of_shares_keep_their_word_and_are_the_models_at_each_cell(lai, rasters):
    rest = Canopy(dissociation=0.6, crown_shape=0.5)
    found = check_raster_function(
        lambda area, brown, cover: shared_reflectance(area, rest.replace(brown=brown, crown_cover=cover)),
        lai, *rasters, quantity="surface_reflectance",
    )  # fmt: skip
    holes = np.isnan(found)
    assert holes[:, 3, 4].all() and holes[:, 5, 6].all() and int(holes.sum()) == 4
    for cell in CELLS:
        brown, cover = (float(each[cell]) for each in rasters)
        one = lai[cell[0] : cell[0] + 1, cell[1] : cell[1] + 1]
        alone = shared_reflectance(one, rest.replace(brown=brown, crown_cover=cover), exact=True)
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[:, 0, 0], rtol=0, atol=1e-6)
    assert "brown by cell, dissociation 0.6, crown_cover by cell, sza" in found.attrs["history"]


def test_leaves_of_each_cell_go_with_them(lai, rasters):
    brown, cover = rasters
    optics = {"TM3": (0.2 * cover, 0.04), "TM4": (0.45, 0.42)}
    found = check_raster_function(
        lambda area, brown, cover: shared_reflectance(area, Canopy(brown=brown, crown_cover=cover, brown_leaf=optics)),
        lai, brown, cover, quantity="surface_reflectance",
    )  # fmt: skip
    cell = CELLS[1]
    dead = {"TM3": (0.2 * float(cover[cell]), 0.04), "TM4": (0.45, 0.42)}
    one = lai[cell[0] : cell[0] + 1, cell[1] : cell[1] + 1]
    canopy = Canopy(brown=float(brown[cell]), crown_cover=float(cover[cell]), brown_leaf=dead)
    alone = shared_reflectance(one, canopy, exact=True)
    np.testing.assert_allclose(found[(slice(None), *cell)], alone[:, 0, 0], rtol=1e-12)


def test_rows_from_south_to_north_are_turned(lai, rasters):
    brown, _ = rasters
    turned, straight = (shared_reflectance(lai, Canopy(brown=each)) for each in (brown[::-1], brown))
    np.testing.assert_array_equal(turned, straight)


def test_green_leaves_absorb_less_than_all(lai, rasters):
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


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("by_cell", [False, True])
def test_leaf_area_that_crowns_cannot_hold_is_refused(lai, by_cell, exact):
    cover = xr.full_like(lai, 1e-3).drop_attrs(deep=False) if by_cell else 1e-3
    with pytest.raises(ValueError, match="within the crowns is lai / crown_cover, at most 100"):
        shared_reflectance(lai, Canopy(crown_cover=cover), exact=exact)


def test_one_band_has_one_layer(lai):
    found = fifesim.surface_reflectance(lai, bands=["TM4"], canopy=Canopy(hotspot=0.1))
    np.testing.assert_array_equal(found[0], shared_reflectance(lai, Canopy(hotspot=0.1))[1])


def test_shares_of_another_unit_are_refused(lai, rasters):
    brown, _ = rasters
    with pytest.raises(ValueError, match="units '%'"):
        shared_reflectance(lai, Canopy(brown=brown.assign_attrs(units="%")))
    with pytest.raises(ValueError, match="leaves must be 'all' or 'green', got 'dead'"):
        fifesim.fpar(lai, leaves="dead")
