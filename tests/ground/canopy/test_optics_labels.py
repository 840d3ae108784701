"""Leaves and backgrounds by cell: each cell as its own optics would have it, lazily; and what is refused."""

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
    """A raster of even random numbers on the cells of the scene, one of them missing."""

    def made(low, high, seed=0):
        values = np.random.default_rng(seed).uniform(low, high, lai_values.shape)
        values[3, 4] = np.nan
        return lai_values.drop_attrs(deep=False).copy(data=values).rename(None)

    return made


def reflectance(lai, optics, background=None, **options):
    canopy = fifesim.Canopy(leaf_optics=optics, background=background)
    return fifesim.surface_reflectance(lai, bands=TM34, canopy=canopy, **options)


def test_optics_by_band_and_cell(lai, by_cell):
    rasters = by_cell(0.02, 0.15), by_cell(0.02, 0.15, 1)
    found = check_raster_function(
        lambda area, rho, tau: reflectance(area, {"TM3": (rho, tau), "TM4": (0.45, 0.42)}, background=0.2),
        lai, *rasters, quantity="surface_reflectance",
    )  # fmt: skip
    assert np.isnan(found[:, 3, 4]).values.tolist() == [True, False]
    assert int(np.isnan(found).sum()) == 1
    for cell in CELLS:
        own = {"TM3": tuple(float(raster[cell]) for raster in rasters), "TM4": (0.45, 0.42)}
        alone = reflectance(lai, own, background=0.2, exact=True)[(slice(None), *cell)]
        np.testing.assert_allclose(found[(slice(None), *cell)], alone, rtol=0, atol=1e-12)


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
    """The table's bound on leaves is that on the canopy, which no leaf's change moves by more."""
    chlorophyll = by_cell(5, 80)
    found = check_raster_function(
        lambda area, content: reflectance(area, fifesim.Leaf(chlorophyll=content)), lai, chlorophyll,
        quantity="surface_reflectance",
    )  # fmt: skip
    exact = reflectance(lai, fifesim.Leaf(chlorophyll=chlorophyll), exact=True)
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-8)
    assert np.isnan(found[:, 3, 4]).all() and int(np.isnan(found).sum()) == 2
    for cell in CELLS:
        alone = reflectance(lai, fifesim.Leaf(chlorophyll=float(chlorophyll[cell])), exact=True)
        np.testing.assert_allclose(exact[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=1e-9)


def test_kinds_of_leaf_by_cell(lai, by_cell):
    """A map of two covers, made with `xr.where`, which drops the CRS."""
    young = by_cell(0, 1) > 0.5
    found = check_raster_function(
        lambda area, which: reflectance(
            area, fifesim.Leaf(chlorophyll=xr.where(which, 30.0, 50.0), brown=xr.where(which, 0.0, 0.5))
        ),
        lai, young, quantity="surface_reflectance",
    )  # fmt: skip
    for kind, chlorophyll, brown in ((True, 30.0, 0.0), (False, 50.0, 0.5)):
        alone = reflectance(lai, fifesim.Leaf(chlorophyll=chlorophyll, brown=brown), exact=True)
        mine = (young.values == kind) & np.isfinite(found.values)
        np.testing.assert_allclose(found.values[mine], alone.values[mine], rtol=0, atol=1e-9)


def test_goes_with_angles_and_terrain_by_cell(lai, by_cell):
    leaf = fifesim.Leaf(water=by_cell(0.005, 0.02))
    angles = xr.Dataset({"sza": by_cell(20, 40), "saa": 120.0})
    found = reflectance(lai, leaf, geometry=angles)
    cell = CELLS[1]
    alone = reflectance(
        lai, fifesim.Leaf(water=float(leaf.water[cell])),
        geometry=fifesim.Geometry(float(angles["sza"][cell]), 120.0), exact=True,
    )  # fmt: skip
    np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=2e-6)
    level = lai.drop_attrs(deep=False) * 0 + 300.0
    xr.testing.assert_allclose(reflectance(lai, leaf, dem=level), reflectance(lai, leaf), rtol=1e-12)


@pytest.mark.parametrize(
    ("optics", "message"),
    [
        (lambda r: fifesim.Leaf(water=r.values), "Leaf: water must be a number, or a raster .* got ndarray"),
        (lambda r: fifesim.Leaf(water=r.isel(x=0)), r"Leaf: water must be a number, .* got dimensions \('y',\)"),
        (lambda r: {"TM3": r, "TM4": r}, "leaf_optics of TM3 are a pair"),
        (lambda r: {"TM3": (r, r)}, "no leaf optics for band 'TM4'"),
        (lambda r: {"TM3": (r.values, r), "TM4": (r, r)}, "TM3 must be a number, or one raster"),
        (lambda r: {"TM3": (r * 100, r), "TM4": (r, r)}, r"leaf reflectance must be in \[0, 1\]"),
        (lambda r: fifesim.Leaf(water=r * 100), r"Leaf: water must be in \[0, 0.2\] cm"),
        (lambda r: {"TM3": (r, r.assign_coords(x=r["x"] + 9)), "TM4": (r, r)}, "different grids"),
        (lambda r: (r, 0.1), "the leaf transmittance is a raster"),
    ],
)
def test_what_cannot_be_is_one_line(lai, by_cell, optics, message):
    with pytest.raises(ValueError, match=message) as caught:
        reflectance(lai, optics(by_cell(0.02, 0.15)))
    assert len(str(caught.value)) <= 500


@pytest.fixture(scope="module")
def share(lai_values):
    values = np.random.default_rng(2).uniform(0, 1, lai_values.shape)
    values[3, 4] = np.nan
    return lai_values.drop_attrs(deep=False).copy(data=values).rename(None)


def soil_reflectance(lai, background, soil=None, moisture=None, **options):
    canopy = fifesim.Canopy(background=background, soil=soil, moisture=moisture)
    return fifesim.surface_reflectance(lai, bands=TM34, canopy=canopy, **options)


def test_by_band_numbers_and_rasters_mix(lai, share):
    found = check_raster_function(
        lambda area, soil: soil_reflectance(area, {"TM3": soil * 0.3, "TM4": 0.3}), lai, share,
        quantity="surface_reflectance",
    )  # fmt: skip
    assert np.isnan(found[:, 3, 4]).values.tolist() == [True, False]
    for cell in CELLS:
        alone = soil_reflectance(lai, {"TM3": float(share[cell]) * 0.3, "TM4": 0.3}, exact=True)
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=1e-6)


def test_shares_of_a_mixture_by_cell(lai, share):
    """Also made with `xr.where`, which drops the CRS."""
    found = check_raster_function(
        lambda area, dry: soil_reflectance(area, {"soil_dry": dry, "shade": 1 - dry}, exact=True), lai, share,
        quantity="surface_reflectance",
    )  # fmt: skip
    assert np.isnan(found[:, 3, 4]).all() and int(np.isnan(found).sum()) == 2
    for cell in CELLS:
        dry = float(share[cell])
        alone = soil_reflectance(lai, {"soil_dry": dry, "shade": 1 - dry}, exact=True)
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=1e-9)
    dry = xr.where(share > 0.5, 0.25, 0.75)
    wet = soil_reflectance(lai, {"soil_dry": dry, "shade": 1 - dry})
    assert np.isfinite(wet).all()


@pytest.mark.parametrize(
    ("background", "message"),
    [
        (lambda s: {"TM3": s}, "no background for band 'TM4'"),
        (lambda s: {"TM3": s, "TM4": s.values}, "TM4 must be a number, or one raster .* got ndarray"),
        (lambda s: {"TM3": s, "TM4": s * 100}, r"background reflectance must be in \[0, 1\]"),
        (lambda s: {"soil_dry": s, "shade": s}, "fractions must add up to 1"),
        (lambda s: {"soil_dry": s, "shade": -s}, r"fraction of 'shade' must be in \[0, 1\], got -"),
        (lambda s: {"TM3": s, "TM4": s.assign_coords(x=s["x"] + 9)}, "different grids"),
    ],
)
def test_background_that_cannot_be_is_one_line(lai, share, background, message):
    with pytest.raises(ValueError, match=message) as caught:
        soil_reflectance(lai, background(share))
    assert len(str(caught.value)) <= 500


def test_background_of_numbers_says_where_rasters_go(share):
    with pytest.raises(
        TypeError,
        match=r"fraction of 'soil_dry' must be a number, .*: rasters of fractions are backgr",
    ):
        fifesim.Background({"soil_dry": share, "shade": 1 - share})


def test_nothing_said_of_the_soil_and_numbers_that_say_nothing_leave_all_bits(lai):
    plain = soil_reflectance(lai, None)
    assert (soil_reflectance(lai, None, soil=0.0, moisture=0.0) == plain).all()
    # A raster of zeros goes another way, within the tables' error.
    np.testing.assert_allclose(soil_reflectance(lai, None, soil=0 * lai), plain, rtol=0, atol=1e-6)


def test_brightness_and_moisture_by_cell(lai, share):
    """Each cell is what a scene of its soil alone would be; NaN by cell; one layer of a background stands for all."""
    changes = (share - 0.5) * 0.1
    found = check_raster_function(
        lambda area, soil, water: soil_reflectance(area, None, soil=soil, moisture=water), lai, changes, share,
        quantity="surface_reflectance",
    )  # fmt: skip
    assert np.isnan(found[:, 3, 4]).all() and int(np.isnan(found).sum()) == 2
    assert found.attrs["soil"] == found.attrs["moisture"] == "raster"
    for cell in CELLS:
        soil = {"soil": float(changes[cell]), "moisture": float(share[cell])}
        alone = soil_reflectance(lai, None, exact=True, **soil)
        assert alone.attrs["soil"] == soil["soil"]
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=1e-6)
    one_layer = soil_reflectance(lai, share * 0.2, soil=0.01)
    by_band = soil_reflectance(lai, {"TM3": share * 0.2, "TM4": share * 0.2}, soil=0.01)
    np.testing.assert_array_equal(one_layer, by_band)


def test_bare_soil_shows_the_line_and_the_water(lai):
    """Without leaves the surface is the soil."""
    brighter = soil_reflectance(0 * lai, None, soil=0.05) - soil_reflectance(0 * lai, None)
    expected = 0.05 * soil_line(tuple(band.response for band in fifesim.instrument("TM").select(TM34)))
    np.testing.assert_allclose(brighter[:, 0, 0], expected, rtol=1e-9)
    assert (soil_reflectance(0 * lai, None, moisture=1.0) < soil_reflectance(0 * lai, None, moisture=0.5)).all()


def test_kernel_holds_no_rasters(lai, share):
    """They are handed to it; what it holds itself is read through when lazy soil_reflectance is named."""
    bands = tuple(band.response for band in fifesim.instrument("TM").select(TM34))
    large = xr.concat([share] * 40, "y")
    kernel, rasters = soil_kernel(bands, lai, soil=large, moisture=large)
    assert len(rasters) == 2 and len(cloudpickle.dumps(kernel)) < large.nbytes / 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"soil": 5}, r"soil must be in \[-1, 1\], got 5"),
        ({"moisture": -0.2}, r"moisture must be in \[0, 1\], got -0.2"),
        ({"soil": "bright"}, "soil must be a number, or an xarray.DataArray over .y, x., got 'bright'"),
    ],
)
def test_soil_that_cannot_be_is_one_line(lai, options, message):
    with pytest.raises((ValueError, TypeError), match=message):
        soil_reflectance(lai, None, **options)
    with pytest.raises(ValueError, match="moisture must be a number, or a raster over"):
        soil_reflectance(lai, None, moisture=lai.expand_dims(band=["TM3"]))
    with pytest.raises(ValueError, match="different grids"):
        soil_reflectance(lai, None, moisture=(lai * 0).assign_coords(x=lai["x"] + 9))
