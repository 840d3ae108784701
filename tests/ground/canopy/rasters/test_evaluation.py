"""Kernels of canopies: those of labelled rasters, on any cells."""

import numpy as np
import pytest
import xarray as xr

from fifesim.base.geometry import Geometry
from fifesim.ground.canopy.raster import level_reflectance
from fifesim.ground.canopy.rasters.evaluation import canopy_kernel

BANDS = ["red", "nir"]
SUN = Geometry(30.0, 120.0, 10.0, 90.0)
LIGHT = {"diffuse_fraction": [0.1, 0.05], "geometry": SUN}
CANOPY = {"leaf_reflectance": [0.07, 0.46], "leaf_transmittance": [0.04, 0.41], "background": [0.1, 0.2]}
DEAD = {"brown_optics": ([0.3, 0.4], [0.2, 0.3]), "dissociation": 0.5, "crown_cover": 0.8}


@pytest.fixture
def cells(lai):
    return np.random.default_rng(1).choice(lai.size, 300, replace=False)


def flat(raster):
    """A raster by cells, shape (n, [band])."""
    return np.moveaxis(raster.values, 0, -1).reshape(-1, 2) if "band" in raster.dims else raster.values.ravel()


@pytest.mark.parametrize("kind", ["uniform", "background", "brown", "sun", "leaves"])
def test_some_cells_have_the_bits_of_the_scene(lai, cells, kind):
    """Whatever is a raster: the kernel takes it cell by cell, after the leaf area, and what is none as it is."""
    light, canopy = dict(LIGHT), dict(CANOPY)
    if kind == "background":
        canopy["background"] = (0.1 + lai / 20).drop_attrs(deep=False)
    if kind == "brown":
        canopy |= DEAD | {"brown": (lai / 5).drop_attrs(deep=False)}
    if kind == "leaves":
        canopy["leaf_reflectance"] = xr.concat([0.05 + lai / 50, 0.4 + lai / 50], "band").drop_attrs(deep=False)
    if kind == "sun":
        sza = (30 + lai).drop_attrs(deep=False).rename("sza").assign_attrs(units="degree")
        light["geometry"] = xr.Dataset({"sza": sza, "saa": 120.0, "vza": 10.0, "vaa": 90.0, "earth_sun_distance": 1.0})
    whole = level_reflectance(lai, bands=BANDS, wavelengths=[0.66, 0.84], **canopy, **light)
    kernel, rasters = canopy_kernel(lai, BANDS, **canopy, **light)
    blocks = [flat(each)[cells] if "y" in each.dims else each.values for each in rasters]
    np.testing.assert_array_equal(kernel(lai.values.ravel()[cells], *blocks), whole.values.reshape(2, -1)[:, cells])


def test_background_of_the_same_bands_is_taken_as_it_lies_in_memory(lai):
    raster = xr.concat([lai / 20, lai / 10], xr.Variable("band", BANDS)).drop_attrs(deep=False)
    _, (taken,) = canopy_kernel(lai, BANDS, **CANOPY | {"background": raster}, **LIGHT)
    assert np.shares_memory(taken, raster)
    _, (turned,) = canopy_kernel(lai, BANDS[::-1], **CANOPY | {"background": raster}, **LIGHT)
    np.testing.assert_array_equal(turned, raster[::-1])
    with pytest.raises(ValueError, match="the background lacks band green, it has red, nir"):
        canopy_kernel(lai, ["green"], **CANOPY | {"background": raster}, **LIGHT)


def test_hot_spot_below_zero_is_refused(lai):
    with pytest.raises(ValueError, match=r"hotspot must be in \[0, 10\], got -0\.1"):
        canopy_kernel(lai, BANDS, **CANOPY, **LIGHT, hotspot=-0.1)
