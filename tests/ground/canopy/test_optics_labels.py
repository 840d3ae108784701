"""Tests of leaves and backgrounds that vary by cell: values compared with uniform scenes, laziness, and errors."""

import cloudpickle
import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim
from fifesim.ground.canopy.optics_labels import soil_kernel
from fifesim.ground.canopy.soil import soil_line

TM34 = ["TM3", "TM4"]
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


def reflectance(lai, leaf_optics=None, background=None, soil=None, moisture=None, **options):
    canopy = fifesim.Canopy(leaf_optics=leaf_optics, background=background, soil=soil, moisture=moisture)
    return fifesim.surface_reflectance(lai, bands=TM34, canopy=canopy, **options)


def check_cells(found, scene, lai, *rasters, atol):
    """Compare some cells with exact scenes that have the values of the rasters at the cell everywhere."""
    for cell in CELLS:
        alone = scene(lai, *(float(raster[cell]) for raster in rasters), exact=True)
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=atol)


def check_by_cell(scene, lai, *rasters, atol, missing=(True, True)):
    """Check the rules for raster functions, the bands in which the missing cell is NaN, and the values of cells."""
    found = check_raster_function(scene, lai, *rasters, quantity="surface_reflectance")
    assert tuple(np.isnan(found[:, 3, 4]).values) == missing and int(np.isnan(found).sum()) == sum(missing)
    check_cells(found, scene, lai, *rasters, atol=atol)
    return found


def test_leaf_optics_by_band_and_cell(lai, by_cell):
    def scene(area, rho, tau, **options):
        return reflectance(area, {"TM3": (rho, tau), "TM4": (0.45, 0.42)}, background=0.2, **options)

    rasters = by_cell(0.02, 0.15), by_cell(0.02, 0.15, 1)
    check_by_cell(scene, lai, *rasters, missing=(True, False), atol=1e-12)


def test_pair_of_rasters_has_all_bands(lai, by_cell):
    one, other = by_cell(0.02, 0.1), by_cell(0.3, 0.45)
    both = xr.concat([other, one], "band").assign_coords(band=["TM4", "TM3"])
    xr.testing.assert_equal(
        reflectance(lai, (both, both)), reflectance(lai, {"TM3": (one, one), "TM4": (other, other)})
    )
    xr.testing.assert_equal(reflectance(lai, (one, one)), reflectance(lai, dict.fromkeys(TM34, (one, one))))
    with pytest.raises(ValueError, match="the leaf reflectance lacks band TM3, it has TM4"):
        reflectance(lai, (both[:1], both))


def test_one_content_by_cell(lai, by_cell):
    """The error of tabulated leaf optics is an upper bound of the error of canopy reflectance."""

    def scene(area, content, **options):
        return reflectance(area, fifesim.Leaf(chlorophyll=content), **options)

    chlorophyll = by_cell(5, 80)
    found = check_by_cell(scene, lai, chlorophyll, atol=2e-8)
    exact = scene(lai, chlorophyll, exact=True)
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-8)
    check_cells(exact, scene, lai, chlorophyll, atol=1e-9)


def test_two_kinds_of_leaf_by_cell(lai, by_cell):
    """Contents by cover type, made with `xr.where`, which drops the CRS."""
    young = by_cell(0, 1) > 0.5
    found = check_raster_function(
        lambda area, which: reflectance(
            area, fifesim.Leaf(chlorophyll=xr.where(which, 30.0, 50.0), brown=xr.where(which, 0.0, 0.5))
        ),
        lai, young, quantity="surface_reflectance",
    )  # fmt: skip
    for kind, chlorophyll, brown in ((True, 30.0, 0.0), (False, 50.0, 0.5)):
        alone = reflectance(lai, fifesim.Leaf(chlorophyll=chlorophyll, brown=brown), exact=True)
        cells = (young.values == kind) & np.isfinite(found.values)
        np.testing.assert_allclose(found.values[cells], alone.values[cells], rtol=0, atol=1e-9)


def test_leaves_by_cell_with_angles_by_cell_and_terrain(lai, by_cell):
    leaf = fifesim.Leaf(water=by_cell(0.005, 0.02))
    angles = xr.Dataset({"sza": by_cell(20, 40), "saa": 120.0})
    found = reflectance(lai, leaf, geometry=angles)
    cell = CELLS[1]
    alone = reflectance(
        lai, fifesim.Leaf(water=float(leaf.water[cell])),
        geometry=fifesim.Geometry(float(angles["sza"][cell]), 120.0), exact=True,
    )  # fmt: skip
    np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=2e-6)
    level = (lai.drop_attrs(deep=False) * 0 + 300.0).rename("dem")
    xr.testing.assert_allclose(reflectance(lai, leaf, dem=level), reflectance(lai, leaf), rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("leaf_optics", lambda r: fifesim.Leaf(water=r.values), "Leaf: water must be a number, or .* got ndarray"),
        ("leaf_optics", lambda r: fifesim.Leaf(water=r.isel(x=0)), r"Leaf: water must .* got dimensions \('y',\)"),
        ("leaf_optics", lambda r: {"TM3": r, "TM4": r}, "leaf_optics of TM3 are a pair"),
        ("leaf_optics", lambda r: {"TM3": (r, r)}, "no leaf optics for band 'TM4'"),
        ("leaf_optics", lambda r: {"TM3": (r.values, r), "TM4": (r, r)}, "TM3 must be a number, or one raster"),
        ("leaf_optics", lambda r: {"TM3": (r * 100, r), "TM4": (r, r)}, r"leaf reflectance must be in \[0, 1\]"),
        ("leaf_optics", lambda r: fifesim.Leaf(water=r * 100), r"Leaf: water must be in \[0, 0.2\] cm"),
        ("leaf_optics", lambda r: {"TM3": (r, shifted(r)), "TM4": (r, r)}, "different grids"),
        ("leaf_optics", lambda r: (r, 0.1), "the leaf transmittance is a raster"),
        ("background", lambda r: {"TM3": r}, "no background for band 'TM4'"),
        ("background", lambda r: {"TM3": r, "TM4": r.values}, "TM4 must be a number, or one raster .* got ndarray"),
        ("background", lambda r: {"TM3": r, "TM4": r * 100}, r"background reflectance must be in \[0, 1\]"),
        ("background", lambda r: {"soil_dry": r, "shade": r}, "fractions must add up to 1"),
        ("background", lambda r: {"soil_dry": r, "shade": -r}, r"fraction of 'shade' must be in \[0, 1\], got -"),
        ("background", lambda r: {"TM3": r, "TM4": shifted(r)}, "different grids"),
        ("moisture", lambda r: shifted(r), "different grids"),
    ],
)
def test_impossible_properties_are_refused_with_a_short_message(lai, by_cell, name, given, message):
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        reflectance(lai, **{name: given(by_cell(0.02, 0.15))})
    assert len(str(caught.value)) <= 500


def shifted(raster):
    return raster.assign_coords(x=raster["x"] + 9)


def test_background_by_band_mixes_numbers_and_rasters(lai, share):
    def scene(area, soil, **options):
        return reflectance(area, background={"TM3": soil * 0.3, "TM4": 0.3}, **options)

    check_by_cell(scene, lai, share, missing=(True, False), atol=1e-6)


def test_fractions_of_a_mixture_by_cell(lai, share):
    """Also for fractions made with `xr.where`, which drops the CRS."""

    def scene(area, dry, exact=True):
        return reflectance(area, background={"soil_dry": dry, "shade": 1 - dry}, exact=exact)

    check_by_cell(scene, lai, share, atol=1e-9)
    assert np.isfinite(scene(lai, xr.where(share > 0.5, 0.25, 0.75), exact=False)).all()


def test_background_of_numbers_refers_to_background_by_cell_for_rasters(share):
    said = r"fraction of 'soil_dry' must be a number, .*: rasters of fractions are backgr"
    with pytest.raises(TypeError, match=said):
        fifesim.Background({"soil_dry": share, "shade": 1 - share})


def test_soil_and_moisture_of_0_change_no_bit(lai):
    plain = reflectance(lai)
    assert (reflectance(lai, soil=0.0, moisture=0.0) == plain).all()
    # A raster of zeros is evaluated by other code, so the results differ by the errors of the tables.
    np.testing.assert_allclose(reflectance(lai, soil=0 * lai), plain, rtol=0, atol=1e-6)


def test_brightness_and_moisture_by_cell(lai, share):
    def scene(area, soil, water, **options):
        return reflectance(area, soil=soil, moisture=water, **options)

    found = check_by_cell(scene, lai, (share - 0.5) * 0.1, share, atol=1e-6)
    assert found.attrs["soil"] == found.attrs["moisture"] == "raster"
    assert scene(lai, 0.03, 0.2).attrs["soil"] == 0.03
    one_layer = reflectance(lai, background=share * 0.2, soil=0.01)
    by_band = reflectance(lai, background={"TM3": share * 0.2, "TM4": share * 0.2}, soil=0.01)
    np.testing.assert_array_equal(one_layer, by_band)


def test_bare_soil_follows_the_soil_line_and_darkens_with_water(lai):
    brighter = reflectance(0 * lai, soil=0.05) - reflectance(0 * lai)
    expected = 0.05 * soil_line(tuple(band.response for band in fifesim.instrument("TM").select(TM34)))
    np.testing.assert_allclose(brighter[:, 0, 0], expected, rtol=1e-9)
    assert (reflectance(0 * lai, moisture=1.0) < reflectance(0 * lai, moisture=0.5)).all()


def test_soil_kernel_holds_no_rasters(lai, share):
    """Rasters are arguments of the kernel; dask would hash and pickle rasters in its closure."""
    bands = tuple(band.response for band in fifesim.instrument("TM").select(TM34))
    large = xr.concat([share] * 40, "y")
    kernel, rasters = soil_kernel(bands, lai, soil=large, moisture=large)
    assert len(rasters) == 2 and len(cloudpickle.dumps(kernel)) < large.nbytes / 4
