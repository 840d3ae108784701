"""The canopy on labelled rasters: labels, laziness, and the kernel's numbers."""

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
from fifesim.ground.canopy import labels as canopy_labels
from fifesim.ground.canopy import layers
from fifesim.ground.canopy.labels import BandCanopy, Light, level_reflectance, reflectance_of_classes
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


def test_classes_of_one_canopy_are_evaluated_together(lai, cover, monkeypatch):
    """What differs by a number, or by another raster of the same values, is not."""
    asked = []
    real = canopy_labels.canopy_kernel
    monkeypatch.setattr(
        canopy_labels, "canopy_kernel", lambda *args, **given: asked.append(args) or real(*args, **given)
    )
    share = lai.drop_attrs(deep=False) / 10
    alike = STANDS[3]._replace(canopy=Canopy(crown_cover=share, hotspot=0.1))
    for other, kinds in (({}, 1), ({"hotspot": 0.2}, 2), ({"crown_cover": share.copy()}, 2), ({"crown_cover": 0.5}, 2)):
        asked.clear()
        changed = alike._replace(
            canopy=alike.canopy.replace(**other), leaf=(np.array([0.07, 0.46]), np.array([0.04, 0.41]))
        )
        pair = {3: changed._replace(canopy=alike.canopy, leaf=tuple(map(np.copy, changed.leaf))), 8: changed}
        made = reflectance_of_classes(lai, cover, BANDS, pair, LIGHT)
        assert len(asked) == kinds
        alone = level_reflectance(lai, BANDS, pair[8], LIGHT)
        np.testing.assert_array_equal(made.values[:, cover == 8], alone.values[:, cover == 8])
