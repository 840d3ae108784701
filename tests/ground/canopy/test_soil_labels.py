"""What lies below the canopy by cell: by band, and mixed."""

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
def share(lai_values):
    values = np.random.default_rng(2).uniform(0, 1, lai_values.shape)
    values[3, 4] = np.nan
    return lai_values.drop_attrs(deep=False).copy(data=values).rename(None)


def reflectance(lai, background, soil=None, moisture=None, **options):
    canopy = fifesim.Canopy(background=background, soil=soil, moisture=moisture)
    return fifesim.surface_reflectance(lai, bands=TM34, canopy=canopy, **options)


def test_by_band_numbers_and_rasters_mix(lai, share):
    found = check_raster_function(
        lambda area, soil: reflectance(area, {"TM3": soil * 0.3, "TM4": 0.3}), lai, share,
        quantity="surface_reflectance",
    )  # fmt: skip
    assert np.isnan(found[:, 3, 4]).values.tolist() == [True, False]
    for cell in CELLS:
        alone = reflectance(lai, {"TM3": float(share[cell]) * 0.3, "TM4": 0.3}, exact=True)
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=1e-6)


def test_shares_of_a_mixture_by_cell(lai, share):
    """Also made with `xr.where`, which drops the CRS."""
    found = check_raster_function(
        lambda area, dry: reflectance(area, {"soil_dry": dry, "shade": 1 - dry}, exact=True), lai, share,
        quantity="surface_reflectance",
    )  # fmt: skip
    assert np.isnan(found[:, 3, 4]).all() and int(np.isnan(found).sum()) == 2
    for cell in CELLS:
        dry = float(share[cell])
        alone = reflectance(lai, {"soil_dry": dry, "shade": 1 - dry}, exact=True)
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=1e-9)
    dry = xr.where(share > 0.5, 0.25, 0.75)
    wet = reflectance(lai, {"soil_dry": dry, "shade": 1 - dry})
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
def test_what_cannot_be_is_one_line(lai, share, background, message):
    with pytest.raises(ValueError, match=message) as caught:
        reflectance(lai, background(share))
    assert len(str(caught.value)) <= 500


def test_background_of_numbers_says_where_rasters_go(share):
    with pytest.raises(
        TypeError,
        match=r"fraction of 'soil_dry' must be a number, .*: rasters of fractions are backgr",
    ):
        fifesim.Background({"soil_dry": share, "shade": 1 - share})


def test_nothing_said_of_the_soil_and_numbers_that_say_nothing_leave_all_bits(lai):
    plain = reflectance(lai, None)
    assert (reflectance(lai, None, soil=0.0, moisture=0.0) == plain).all()
    # A raster of zeros goes another way, within the tables' error.
    np.testing.assert_allclose(reflectance(lai, None, soil=0 * lai), plain, rtol=0, atol=1e-6)


def test_brightness_and_moisture_by_cell(lai, share):
    """Each cell is what a scene of its soil alone would be; NaN by cell; one layer of a background stands for all."""
    changes = (share - 0.5) * 0.1
    found = check_raster_function(
        lambda area, soil, water: reflectance(area, None, soil=soil, moisture=water), lai, changes, share,
        quantity="surface_reflectance",
    )  # fmt: skip
    assert np.isnan(found[:, 3, 4]).all() and int(np.isnan(found).sum()) == 2
    assert found.attrs["soil"] == found.attrs["moisture"] == "raster"
    for cell in CELLS:
        soil = {"soil": float(changes[cell]), "moisture": float(share[cell])}
        alone = reflectance(lai, None, exact=True, **soil)
        assert alone.attrs["soil"] == soil["soil"]
        np.testing.assert_allclose(found[(slice(None), *cell)], alone[(slice(None), *cell)], rtol=0, atol=1e-6)
    one_layer = reflectance(lai, share * 0.2, soil=0.01)
    by_band = reflectance(lai, {"TM3": share * 0.2, "TM4": share * 0.2}, soil=0.01)
    np.testing.assert_array_equal(one_layer, by_band)


def test_bare_soil_shows_the_line_and_the_water(lai):
    """Without leaves the surface is the soil."""
    brighter = reflectance(0 * lai, None, soil=0.05) - reflectance(0 * lai, None)
    expected = 0.05 * soil_line(tuple(band.response for band in fifesim.instrument("TM").select(TM34)))
    np.testing.assert_allclose(brighter[:, 0, 0], expected, rtol=1e-9)
    assert (reflectance(0 * lai, None, moisture=1.0) < reflectance(0 * lai, None, moisture=0.5)).all()


def test_kernel_holds_no_rasters(lai, share):
    """They are handed to it; what it holds itself is read through when lazy reflectance is named."""
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
        reflectance(lai, None, **options)
    with pytest.raises(ValueError, match="moisture must be a number, or a raster over"):
        reflectance(lai, None, moisture=lai.expand_dims(band=["TM3"]))
    with pytest.raises(ValueError, match="different grids"):
        reflectance(lai, None, moisture=(lai * 0).assign_coords(x=lai["x"] + 9))
