"""BRDF kernels and corrections against values computed with 40 digits, and corrections of simulated slopes."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lazy import no_compute

import fifesim
from fifesim.analysis import corrections
from fifesim.base.surface_kernels import check_surface, li_sparse, ross_li, ross_thick, rpv

DATA = Path(__file__).parents[1] / "data"
GRID = fifesim.fife_site(10.0, window=((0, 300), (0, 300)))
DEM = fifesim.flint_hills(GRID, seed=7)
LAI = fifesim.lai_scene(GRID, seed=7)
BANDS = ["TM3", "TM4"]


def table(name):
    return pd.read_csv(DATA / name, comment="#")


def scene(dem=None, lai=LAI):
    return lai.fifesim.surface_reflectance("TM", bands=BANDS, dem=dem)


def illumination_cosine(sza, saa, slope, aspect):
    """Cosine of the angle between the sun and the normal of a slope [Teillet1982]."""
    sza, turn, slope = np.radians(sza), np.radians(saa - aspect), np.radians(slope)
    return np.cos(sza) * np.cos(slope) + np.sin(sza) * np.sin(slope) * np.cos(turn)


def test_ross_li_kernels():
    t = table("ross_li.csv")
    np.testing.assert_allclose(ross_thick(t.sza, t.vza, t.raa), t.volume, rtol=0, atol=1e-9)
    np.testing.assert_allclose(li_sparse(t.sza, t.vza, t.raa), t.geometric, rtol=0, atol=1e-9)
    weights = t.f_iso, t.f_vol, t.f_geo
    seen, nadir = (ross_li(*weights, sza=t.sza, vza=vza, raa=t.raa) for vza in (t.vza, 0 * t.vza))
    np.testing.assert_allclose(seen, t.reflectance, rtol=0, atol=1e-9)
    np.testing.assert_allclose(corrections.c_factor(seen, nadir), t.c_factor, rtol=1e-9)


def test_topographic_corrections():
    t = table("topographic_correction.csv")
    cos_i = illumination_cosine(t.sza, t.saa, t.slope, t.aspect)
    rho = t.reflectance, cos_i, t.sza
    found = {
        "cos_i": cos_i,
        "cosine": corrections.cosine_correction(*rho),
        "c_correction": corrections.c_correction(*rho, t.c),
        "scs": corrections.scs_correction(*rho, t.slope),
        "scs_c": corrections.scs_c_correction(*rho, t.slope, t.c),
        "minnaert": corrections.minnaert_correction(*rho, t.k),
    }
    for name, values in found.items():
        np.testing.assert_allclose(values, t[name], rtol=0, atol=1e-9, err_msg=name)


def test_kernels_are_reciprocal():
    angles = {"sza": 20.0, "vza": 55.0, "raa": 70.0}, {"sza": 55.0, "vza": 20.0, "raa": 70.0}
    for kernel, weights in ((ross_li, (0.3, 0.1, 0.05)), (rpv, (0.1, 0.7, -0.1, 0.3))):
        there, back = (kernel(*weights, **each) for each in angles)
        assert there == pytest.approx(back, rel=1e-14)


def test_illumination_cosine_agrees_with_the_terrain_function():
    sun = fifesim.Geometry(sza=50.0, saa=117.0)
    cos_i = illumination_cosine(sun.sza, sun.saa, DEM.fifesim.slope(), DEM.fifesim.aspect())
    lit = DEM.fifesim.illumination(sun)
    # Aspect is relative to true north at each cell; the illumination uses the convergence at the centre of the grid.
    np.testing.assert_allclose(cos_i, lit.where(lit > 0, cos_i), rtol=0, atol=1e-4)


def test_kt_restores_level_ground():
    level = scene()
    found = scene(DEM).fifesim.topographic_correction(DEM, "kt")
    np.testing.assert_allclose(found, level, rtol=1e-6)


def test_c_and_k_are_least_squares_estimates():
    hilly = scene(DEM)
    cos_i = DEM.fifesim.illumination(fifesim.fife_geometry()).values
    found = hilly.fifesim.topographic_correction(DEM, "c")
    for band in BANDS:
        m, b = np.polyfit(cos_i.ravel(), hilly.sel(band=band).values.ravel(), 1)
        assert float(found.c.sel(band=band)) == pytest.approx(b / m, rel=1e-6)
    found = hilly.fifesim.topographic_correction(DEM, "minnaert")
    k, _ = np.polyfit(np.log(cos_i.ravel()), np.log(hilly.sel(band="TM4").values.ravel()), 1)
    assert float(found.k.sel(band="TM4")) == pytest.approx(k, rel=1e-6)


@pytest.mark.parametrize("method", ["cosine", "c", "scs", "scs+c", "minnaert", "kt"])
def test_corrections_are_lazy_and_do_not_change_level_ground(method):
    whole = scene(DEM).fifesim.topographic_correction(DEM, method)
    with no_compute():
        lazy = scene(DEM.chunk(y=70, x=300), LAI.chunk(y=70, x=90)).fifesim.topographic_correction(DEM, method)
    assert lazy.chunks is not None
    np.testing.assert_allclose(lazy.compute(), whole, rtol=1e-12)
    assert whole.rio.crs == DEM.rio.crs and list(whole.band.values) == BANDS
    given = {"c": 0.5} if method in ("c", "scs+c") else {"k": 0.5} if method == "minnaert" else {}
    flat = scene().fifesim.topographic_correction(0 * DEM + 400.0, method, **given)
    np.testing.assert_allclose(flat, scene(), rtol=1e-12)


@pytest.mark.parametrize("method", ["c", "scs+c", "minnaert"])
def test_constants_of_a_scene_have_the_same_bits_in_any_chunks(method):
    """Also with one band per chunk, and when threads add in any order."""
    hilly = scene(DEM)
    whole = hilly.fifesim.topographic_correction(DEM, method)
    for chunks in ({"y": 70, "x": 90}, {"y": 300, "x": 13}, {"band": 1, "y": 41, "x": 100}):
        lazy = hilly.chunk(chunks).fifesim.topographic_correction(DEM, method)
        for scheduler in ("synchronous", "threads"):
            found = lazy.compute(scheduler=scheduler)
            np.testing.assert_array_equal(found, whole)
            name = "k" if method == "minnaert" else "c"
            assert found[name].values.tobytes() == whole[name].values.tobytes()


@pytest.mark.parametrize("method", ["cosine", "c", "scs", "scs+c", "minnaert"])
def test_corrections_end_where_the_divisor_is_below_a_tenth(method):
    """Hills of up to 63 degrees below a low sun, where the quotient would reach 160; c and k are near 0 and 1."""
    sun, constant = fifesim.Geometry(65.0, 140.0), {"c": 0.02, "scs+c": 0.02, "minnaert": 0.9}.get(method)
    y, x = np.mgrid[:60, :60]
    dem = DEM[:60, :60].copy(data=400 + 100 * np.sin(x / 5) * np.sin(y / 5))
    given = {} if constant is None else {"k" if method == "minnaert" else "c": constant}
    rho = scene()[:, :60, :60].drop_vars(["sza", "saa", "vza", "vaa"])
    found = rho.fifesim.topographic_correction(dem, method, geometry=sun, **given)
    cos_i = dem.fifesim.illumination(sun).values
    divisor = cos_i + given.get("c", 0.0)
    kept = (cos_i > 0) & (divisor >= 0.1)
    np.testing.assert_array_equal(np.isfinite(found), np.broadcast_to(kept, found.shape))
    assert float(found.max()) <= 10 * float(rho.max())
    assert found.attrs["masked_cells"] == ((cos_i > 0) & ~kept).sum() > 10


def test_constants_of_exact_scenes():
    """0.1 + 0.2 cos i has c = 0.5, and 0.3 (cos i)**0.7 the exponent 0.7."""
    cos_i = np.array([[0.2, 0.4, 0.8]])
    assert corrections.line_constant(corrections.line_sums(0.1 + 0.2 * cos_i, cos_i)) == pytest.approx(0.5, rel=1e-12)
    sums = corrections.line_sums(0.3 * cos_i**0.7, cos_i, logarithmic=True)
    assert corrections.line_constant(sums, logarithmic=True) == pytest.approx(0.7, rel=1e-12)


def test_constant_of_level_ground_is_unknown():
    cos_i = np.full((4, 5), 0.7) + 1e-16 * np.arange(20).reshape(4, 5)
    assert np.isnan(corrections.line_constant(corrections.line_sums(0.2 + cos_i, cos_i)))


def test_brdf_normalise_converts_between_views():
    land = fifesim.ground.RossLi([0.1, 0.3], [0.05, 0.15], [0.01, 0.03])
    slant = fifesim.Geometry(sza=40.0, saa=120.0, vza=35.0, vaa=300.0)
    nadir = fifesim.Geometry(sza=40.0, saa=120.0)
    level = scene().drop_vars(["sza", "saa", "vza", "vaa"])
    seen = level.copy(data=np.broadcast_to(land.reflectance(40.0, 35.0, 180.0)[:, None, None], level.shape))
    found = seen.fifesim.brdf_normalise(land, geometry=slant)
    np.testing.assert_allclose(found[:, 0, 0], land.reflectance(40.0, 0.0, 0.0), rtol=1e-12)
    assert float(found.vza) == 0
    np.testing.assert_allclose(found.fifesim.brdf_normalise(land, geometry=nadir, to=slant), seen, rtol=1e-12)


ROSS = fifesim.ground.RossLi(0.3, 0.1, 0.01)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: check_surface(fifesim.ground.RossLi(0.05, 0.19, 0.06)), r"sza .* vza .* raa"),
        (lambda: check_surface(fifesim.ground.RossLi([0.1, 1.1], 0.0, 0.0)), "more than it receives"),
        (lambda: scene(DEM).fifesim.topographic_correction(DEM, "c", c=[0.1, 0.2, 0.3]), "c must be a number"),
        (lambda: scene(DEM).fifesim.topographic_correction(DEM, "minnaert", k={"TM3": 0.5}), "k has no number for TM4"),
        (
            lambda: scene().fifesim.brdf_normalise(fifesim.ground.RossLi(scene(), 0, 0)),
            "iso must be a number, or one for",
        ),
        (lambda: scene().expand_dims(stream=2).fifesim.brdf_normalise(ROSS), "dimension stream"),
    ],
)
def test_invalid_arguments_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_low_view_is_a_warning():
    with pytest.warns(UserWarning, match="75 degrees"):
        scene().fifesim.brdf_normalise(ROSS, geometry=fifesim.Geometry(sza=40.0, saa=120.0, vza=80.0, vaa=300.0))
