"""BRDF kernels and corrections against values computed with 40 digits, and corrections of simulated slopes."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lazy import in_chunks, no_compute

import fifesim
from fifesim.analysis import corrections
from fifesim.base.surface_kernels import li_sparse, ross_li, ross_thick, rpv

DATA = Path(__file__).parents[1] / "data"
GRID = fifesim.fife_site(10.0, window=((0, 300), (0, 300)))
DEM = fifesim.flint_hills(GRID, seed=7)
LAI = fifesim.lai_scene(GRID, seed=7)
BANDS = ["TM3", "TM4"]


def table(name):
    return pd.read_csv(DATA / name, comment="#")


@pytest.fixture(scope="module")
def level():
    return LAI.fifesim.surface_reflectance("TM", bands=BANDS, dem=None)


@pytest.fixture(scope="module")
def hilly():
    return LAI.fifesim.surface_reflectance("TM", bands=BANDS, dem=DEM)


def test_ross_li_kernels():
    t = table("ross_li.csv")
    np.testing.assert_allclose(ross_thick(t.sza, t.vza, t.raa), t.volume, rtol=0, atol=1e-9)
    np.testing.assert_allclose(li_sparse(t.sza, t.vza, t.raa), t.geometric, rtol=0, atol=1e-9)
    weights = t.f_iso, t.f_vol, t.f_geo
    seen, nadir = (ross_li(*weights, sza=t.sza, vza=vza, raa=t.raa) for vza in (t.vza, 0 * t.vza))
    np.testing.assert_allclose(seen, t.reflectance, rtol=0, atol=1e-9)
    np.testing.assert_allclose(corrections.c_factor(seen, nadir), t.c_factor, rtol=1e-9)
    there, back = (rpv(0.1, 0.7, -0.1, 0.3, sza=s, vza=v, raa=70.0) for s, v in ((20.0, 55.0), (55.0, 20.0)))
    assert there == pytest.approx(back, rel=1e-14)


def test_topographic_corrections():
    """The cosine of the illumination is part of the table."""
    t = table("topographic_correction.csv")
    rho = t.reflectance, t.cos_i, t.sza
    found = {
        "cosine": corrections.cosine_correction(*rho),
        "c_correction": corrections.c_correction(*rho, t.c),
        "scs": corrections.scs_correction(*rho, t.slope),
        "scs_c": corrections.scs_c_correction(*rho, t.slope, t.c),
        "minnaert": corrections.minnaert_correction(*rho, t.k),
    }
    for name, values in found.items():
        np.testing.assert_allclose(values, t[name], rtol=0, atol=1e-9, err_msg=name)


def test_c_and_k_are_least_squares_estimates(hilly):
    """On level ground, c is unknown."""
    cos_i = DEM.fifesim.illumination(fifesim.fife_geometry()).values
    found = hilly.fifesim.topographic_correction(DEM, "c")
    for band in BANDS:
        m, b = np.polyfit(cos_i.ravel(), hilly.sel(band=band).values.ravel(), 1)
        assert float(found.c.sel(band=band)) == pytest.approx(b / m, rel=1e-6)
    found = hilly.fifesim.topographic_correction(DEM, "minnaert")
    k, _ = np.polyfit(np.log(cos_i.ravel()), np.log(hilly.sel(band="TM4").values.ravel()), 1)
    assert float(found.k.sel(band="TM4")) == pytest.approx(k, rel=1e-6)
    cos_i = np.full((4, 5), 0.7) + 1e-16 * np.arange(20).reshape(4, 5)
    assert np.isnan(corrections.line_constant(corrections.line_sums(0.2 + cos_i, cos_i)))


@pytest.mark.parametrize(
    ("method", "constant"),
    [("cosine", None), ("c", "c"), ("scs", None), ("scs+c", "c"), ("minnaert", "k"), ("kt", None)],
)
def test_corrections_have_the_same_bits_in_any_chunks_and_do_not_change_level_ground(level, hilly, method, constant):
    """Also with one band per chunk, and when threads add in any order; kt restores level ground exactly."""
    whole = hilly.fifesim.topographic_correction(DEM, method)
    for chunks in ({"y": 70, "x": 90}, {"band": 1, "y": 41, "x": 100}):
        with no_compute():
            lazy = in_chunks(hilly, chunks).fifesim.topographic_correction(DEM.chunk(y=70, x=300), method)
        for scheduler in ("synchronous", "threads"):
            found = lazy.compute(scheduler=scheduler)
            np.testing.assert_array_equal(found, whole)
            assert constant is None or found[constant].values.tobytes() == whole[constant].values.tobytes()
    assert whole.rio.crs == DEM.rio.crs and list(whole.band.values) == BANDS
    given = {constant: 0.5} if constant else {}
    flat = level.fifesim.topographic_correction(0 * DEM + 400.0, method, **given)
    np.testing.assert_allclose(flat, level, rtol=1e-12)
    if method == "kt":
        np.testing.assert_allclose(whole, level, rtol=1e-6)


@pytest.mark.parametrize("method", ["cosine", "c", "scs", "scs+c", "minnaert"])
def test_corrections_end_where_the_divisor_is_below_a_tenth(level, method):
    """Hills of up to 63 degrees below a low sun, where the quotient would reach 160; c and k are near 0 and 1."""
    sun, constant = fifesim.Geometry(65.0, 140.0), {"c": 0.02, "scs+c": 0.02, "minnaert": 0.9}.get(method)
    y, x = np.mgrid[:60, :60]
    dem = DEM[:60, :60].copy(data=400 + 100 * np.sin(x / 5) * np.sin(y / 5))
    given = {} if constant is None else {"k" if method == "minnaert" else "c": constant}
    rho = level[:, :60, :60].drop_vars(["sza", "saa", "vza", "vaa"])
    found = rho.fifesim.topographic_correction(dem, method, geometry=sun, **given)
    cos_i = dem.fifesim.illumination(sun).values
    divisor = cos_i + given.get("c", 0.0)
    kept = (cos_i > 0) & (divisor >= 0.1)
    np.testing.assert_array_equal(np.isfinite(found), np.broadcast_to(kept, found.shape))
    assert found.attrs["masked_cells"] == ((cos_i > 0) & ~kept).sum() > 10


def test_brdf_normalise_converts_between_views(level):
    land = fifesim.ground.RossLi([0.1, 0.3], [0.05, 0.15], [0.01, 0.03])
    slant = fifesim.Geometry(sza=40.0, saa=120.0, vza=35.0, vaa=300.0)
    nadir = fifesim.Geometry(sza=40.0, saa=120.0)
    level = level.drop_vars(["sza", "saa", "vza", "vaa"])
    seen = level.copy(data=np.broadcast_to(land.reflectance(40.0, 35.0, 180.0)[:, None, None], level.shape))
    found = seen.fifesim.brdf_normalise(land, geometry=slant)
    np.testing.assert_allclose(found[:, 0, 0], land.reflectance(40.0, 0.0, 0.0), rtol=1e-12)
    assert float(found.vza) == 0
    np.testing.assert_allclose(found.fifesim.brdf_normalise(land, geometry=nadir, to=slant), seen, rtol=1e-12)
