"""Landscapes: variables, their places, and leaf area of each class from its own distribution."""

import numpy as np
import pyproj
import pytest
import rioxarray
import xarray as xr
from elevations import write
from lazy import check_place, no_compute
from odc.geo.geobox import GeoBox
from scipy import stats

import fifesim
from fifesim.grids import cf
from fifesim.ground.landscape.labels import classes_of

CLASSES = {
    "bare": fifesim.CoverClass(lai=0.0, canopy=fifesim.Canopy(background=0.2)),
    "grass": fifesim.CoverClass(lai="burned-grazed", arp=0.24),
    "wood": fifesim.CoverClass(lai=stats.gamma(9, scale=0.4)),
}
PATCHES = fifesim.Patches("voronoi", 30)


@pytest.fixture(scope="module")
def land(site):
    return fifesim.landscape(site, cover=PATCHES, classes=CLASSES, arp=0.1, seed=7)


@pytest.mark.parametrize("code, name, arp", [(2, "burned-grazed", 0.24), (3, CLASSES["wood"].lai, 0.1)])
def test_leaf_area_of_a_class_is_that_of_a_scene_of_it_alone(site, land, code, name, arp):
    """One white noise for all: beyond a fence the field goes on, and only its density and texture change."""
    alone = fifesim.lai_scene(site, name, arp=arp, seed=7)
    of_class = (land.cover == code).values
    assert 400 < of_class.sum() < 2000
    np.testing.assert_array_equal(land.lai.values[of_class], alone.values[of_class])


def test_class_of_one_leaf_area_has_it_everywhere(land):
    assert (land.lai.values[land.cover.values == 1] == 0).all()


def test_landscape_is_labelled_and_placed(site, land):
    assert list(land.data_vars) == ["lai", "cover"]
    for name, variable in land.data_vars.items():
        check_place(variable, site.crs)
        assert cf.attributes(name).items() <= variable.attrs.items()
    assert land.cover.dtype == np.int16
    assert land.lai.attrs["lai_distribution"] == "by class" and land.lai.attrs["rng_seed"] == "7"
    assert land.lai.attrs["history"].splitlines() == [
        "landscape: voronoi of 30 m, seed 7",
        "landscape: leaf area of 3 classes, seed 7",
    ]
    assert [each.name for each in classes_of(land.cover)] == list(CLASSES)


def test_default_is_the_three_treatments_in_pastures():
    grid = fifesim.fife_site(30)
    land = fifesim.landscape(grid, seed=1)
    assert land.attrs["site"] == land.lai.attrs["site"] == "FIFE"
    assert np.unique(land.cover).tolist() == [1, 2, 3]
    means = [float(land.lai.where(land.cover == code).mean()) for code in (1, 2, 3)]
    expected = [fifesim.lai_distribution(name).mean() for name in fifesim.treatments()]
    np.testing.assert_allclose(means, expected, rtol=0.03)
    fences = [(land.cover.diff(axis) != 0).mean("x" if axis == "y" else "y").max() for axis in ("y", "x")]
    assert min(fences) > 0.1


def test_one_class_is_everywhere(site, lai):
    land = fifesim.landscape(site, classes=fifesim.CoverClass("grass", lai="burned-grazed"), seed=7)
    assert (land.cover == 1).all()
    np.testing.assert_array_equal(land.lai, lai)


def test_own_leaf_area_is_in_the_place_of_the_classes(tmp_path, site, lai):
    path = write(tmp_path / "lai.tif", lai.values, site.affine)
    for given in (path, lai):
        land = fifesim.landscape(site, lai=given, cover=PATCHES, classes=CLASSES)
        np.testing.assert_array_equal(land.lai, lai)
        assert list(land) == ["lai", "cover"]
    assert list(fifesim.landscape(site, lai=lai)) == ["lai"]


def test_numbers_and_rasters_of_other_properties_are_variables(tmp_path, site, lai):
    brown = np.random.default_rng(1).uniform(0, 1, site.shape)
    path = write(tmp_path / "brown.tif", brown, site.affine)
    land = fifesim.landscape(site, lai=lai, brown=path, crown_cover=0.7)
    np.testing.assert_array_equal(land.brown, brown)
    check_place(land.brown, site.crs)
    assert land.crown_cover.ndim == 0 and land.crown_cover == 0.7
    opened = rioxarray.open_rasterio(path, masked=True).squeeze("band", drop=True)
    with no_compute():
        lazy = fifesim.landscape(site, lai=lai, brown=opened + 0.5, chunks=20)
    with pytest.raises(ValueError, match=r"brown must be in \[0, 1\], got 1\.\d+: it is a fraction"):
        lazy.brown.compute()


def test_map_of_cover_lies_below_the_leaf_area(tmp_path, site, land):
    codes = np.where(land.cover.values == 2, 255, land.cover.values)
    path = write(tmp_path / "map.tif", codes, site.affine, nodata=255)
    of_map = fifesim.landscape(site, cover=path, classes=CLASSES, arp=0.1, seed=7)
    known = codes != 255
    np.testing.assert_array_equal(of_map.lai.values[known], land.lai.values[known])
    assert np.isnan(of_map.lai.values[~known]).all() and (of_map.cover.values[~known] == -1).all()


def test_cover_that_carries_its_classes_needs_no_others(site, land):
    again = fifesim.landscape(site, cover=land.cover, arp=0.1, seed=7)
    xr.testing.assert_equal(again, land)


@pytest.mark.parametrize(
    "options, error, message",
    [
        ({"classes": CLASSES}, ValueError, "the layout of the 3 classes is unknown: give cover= a map"),
        ({"cover": fifesim.Patches("voronoi", 9, (0.5, 0.5))}, ValueError, "2 shares for 3 classes"),
        ({"cover": "map.tif"}, ValueError, "a map of cover needs classes="),
        (
            {"cover": 3, "classes": CLASSES},
            TypeError,
            "cover must be a fifesim.Patches, the path of",
        ),
        ({"cover": PATCHES, "classes": fifesim.CoverClass("water")}, ValueError, "class water has no leaf area"),
        ({"brown": 1.5}, ValueError, r"brown must be in \[0, 1\], got 1.5"),
        (
            {"brown": [0.5]},
            TypeError,
            "brown must be a number, a fifesim.Field, the path of a raster or an xarray.DataArray",
        ),
        ({"arp": 0.24999}, ValueError, "at most"),
        ({"seed": -1}, ValueError, "seed must be"),
        ({"chunks": {"band": 1}}, ValueError, "y and x"),
        ({"chunks": 20, "arp": 0.3}, ValueError, "arp must be"),
    ],
)
def test_impossible_landscape_is_refused_before_it_computes(site, options, error, message):
    with pytest.raises(error, match=message), no_compute():
        fifesim.landscape(site, **options)


def test_heights_of_a_grid_s_crs_are_left_out(site):
    """Whatever the variables are made of, they lie on one grid."""
    above = GeoBox(site.shape, site.affine, pyproj.CRS("EPSG:26914+5703").to_wkt())
    made = [fifesim.landscape(grid, soil=fifesim.Field(sd=0.03), brown=0.2, seed=7) for grid in (above, site)]
    xr.testing.assert_equal(*made)
