"""Kernels of canopies: those of labelled rasters, on any cells."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim import Canopy
from fifesim.base.geometry import Geometry
from fifesim.ground.canopy.labels import BandCanopy, Light, canopy_kernel, level_reflectance

BANDS = ["red", "nir"]
LABELS = [SimpleNamespace(name="red", wavelength=0.66), SimpleNamespace(name="nir", wavelength=0.84)]
SUN = Geometry(30.0, 120.0, 10.0, 90.0)
LIGHT = Light(SUN, [0.1, 0.05])
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
    light, canopy = LIGHT, CANOPY
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
    kernel, rasters = canopy_kernel(lai, BANDS, canopy, light)
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


def reflectance(lai, canopy, **options):
    return fifesim.surface_reflectance(lai, bands=TM34, canopy=canopy, **options)


def test_rasters_of_shares_keep_their_word_and_are_the_models_at_each_cell(lai, rasters):
    rest = Canopy(dissociation=0.6, crown_shape=0.5)
    found = check_raster_function(
        lambda area, brown, cover: reflectance(area, rest.replace(brown=brown, crown_cover=cover)),
        lai, *rasters, quantity="surface_reflectance",
    )  # fmt: skip
    holes = np.isnan(found)
    assert holes[:, 3, 4].all() and holes[:, 5, 6].all() and int(holes.sum()) == 4
    for cell in CELLS:
        brown, cover = (float(each[cell]) for each in rasters)
        one = lai[cell[0] : cell[0] + 1, cell[1] : cell[1] + 1]
        alone = reflectance(one, rest.replace(brown=brown, crown_cover=cover), exact=True)
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[:, 0, 0], rtol=0, atol=1e-6)
    assert "brown by cell, dissociation 0.6, crown_cover by cell, sza" in found.attrs["history"]


def test_leaves_of_each_cell_go_with_them(lai, rasters):
    brown, cover = rasters
    optics = {"TM3": (0.2 * cover, 0.04), "TM4": (0.45, 0.42)}
    found = check_raster_function(
        lambda area, brown, cover: reflectance(area, Canopy(brown=brown, crown_cover=cover, brown_leaf=optics)),
        lai, brown, cover, quantity="surface_reflectance",
    )  # fmt: skip
    cell = CELLS[1]
    dead = {"TM3": (0.2 * float(cover[cell]), 0.04), "TM4": (0.45, 0.42)}
    one = lai[cell[0] : cell[0] + 1, cell[1] : cell[1] + 1]
    canopy = Canopy(brown=float(brown[cell]), crown_cover=float(cover[cell]), brown_leaf=dead)
    np.testing.assert_allclose(found[(slice(None), *cell)], reflectance(one, canopy, exact=True)[:, 0, 0], rtol=1e-12)


def test_rows_from_south_to_north_are_turned(lai, rasters):
    brown, _ = rasters
    np.testing.assert_array_equal(reflectance(lai, Canopy(brown=brown[::-1])), reflectance(lai, Canopy(brown=brown)))


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


def test_shares_of_another_unit_are_refused(lai, rasters):
    brown, _ = rasters
    with pytest.raises(ValueError, match="units '%'"):
        reflectance(lai, Canopy(brown=brown.assign_attrs(units="%")))
    with pytest.raises(ValueError, match="leaves must be 'all' or 'green', got 'dead'"):
        fifesim.fpar(lai, leaves="dead")
