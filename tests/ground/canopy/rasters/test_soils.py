"""What lies below the canopy by cell: by band, and mixed."""

import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function

import fifesim

TM34 = ["TM3", "TM4"]
CELLS = [(0, 0), (10, 20), (44, 53)]


@pytest.fixture(scope="module")
def share(lai_values):
    values = np.random.default_rng(2).uniform(0, 1, lai_values.shape)
    values[3, 4] = np.nan
    return lai_values.drop_attrs(deep=False).copy(data=values).rename(None)


def reflectance(lai, background, **options):
    return fifesim.surface_reflectance(lai, bands=TM34, background=background, **options)


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
