"""Upright plants on slopes: level ground, closed forms, and the scene of a dem."""

import numpy as np
import pytest

import fifesim
from fifesim.ground.canopy.sail_model import reflectance_factor, sail, upright_reflectance, with_background

GREEN = 0.45, 0.42


def on(slope, sza, vza, raa, aspect=0.0):
    """Arguments of a slope that faces the azimuth `aspect`, with the sun at azimuth 0 and the sensor at `raa`."""
    tilt, sun, view = np.radians([slope, sza, vza])
    local = [
        np.cos(z) * np.cos(tilt) + np.sin(z) * np.sin(tilt) * np.cos(np.radians(azimuth - aspect))
        for z, azimuth in ((sun, 0.0), (view, raa))
    ]
    plane = (1 + np.cos(tilt)) / 2
    given = {"cosine": np.cos(tilt), "mu_s_local": local[0], "mu_v_local": local[1], "sky_view": plane}
    return {"sza": sza, "vza": vza, "raa": raa, "terrain_view": 0.0} | given


@pytest.mark.parametrize("hotspot", [0.0, 0.1])
@pytest.mark.parametrize("leaf_angles", ["spherical", "planophile"])
def test_level_ground_is_sail(hotspot, leaf_angles):
    own = {"leaf_angles": leaf_angles, "hotspot": hotspot}
    lai = np.array([0.0, 0.5, 3.0])
    surface = with_background(sail(lai, *GREEN, sza=40.0, vza=25.0, raa=60.0, **own), 0.15)
    found = upright_reflectance(lai, *GREEN, 0.15, **on(0.0, 40.0, 25.0, 60.0), diffuse_fraction=0.2, **own)
    np.testing.assert_allclose(found, reflectance_factor(surface.rso, surface.rdo, 0.2), rtol=1e-12)


def test_slope_along_its_normal_is_level_with_the_leaf_area_of_the_slope():
    """Spherical leaves have no upright axis: the slope is a level canopy turned round."""
    slope = on(30.0, 30.0, 30.0, 0.0)
    level = with_background(sail(2.0 * np.cos(np.radians(30.0)), *GREEN, sza=0.0), 0.15)
    found = upright_reflectance(2.0, *GREEN, 0.15, **slope)
    # The 90 classes of leaf angles approximate spherical leaves.
    assert found == pytest.approx(level.rso / np.cos(np.radians(30.0)), rel=2e-6)


def test_dark_leaves_have_the_path_length_of_the_slope():
    """Single scattering by horizontal leaves: L rho over the path of both beams, in closed form."""
    slope = on(35.0, 50.0, 10.0, 120.0, aspect=40.0)
    rho, lai = 1e-7, 1.7
    k = [np.cos(np.radians(z)) / slope[mu] * slope["cosine"] for z, mu in ((50.0, "mu_s_local"), (10.0, "mu_v_local"))]
    mu_s, mu_v = np.cos(np.radians([50.0, 10.0]))
    # Radiance along the view: leaves of projection mu_s mu_v per volume, over the slant path of the slope.
    expected = rho * mu_v * slope["cosine"] / slope["mu_v_local"] * -np.expm1(-sum(k) * lai) / sum(k)
    found = upright_reflectance(lai, rho, 0.0, 0.0, **slope, leaf_angles="0: 1")
    assert found == pytest.approx(expected, rel=1e-5)
    assert mu_s > 0


def test_light_between_slopes_is_summed():
    rho, sky, land = 0.4, 0.7, 0.25
    given = on(20.0, 40.0, 0.0, 0.0) | {"sky_view": sky, "terrain_view": land}
    found = upright_reflectance(0.0, *GREEN, rho, **given, diffuse_fraction=0.3)
    first = 0.7 * given["mu_s_local"] / np.cos(np.radians(40.0)) + 0.3 * sky
    assert found == pytest.approx(rho * first / (1 - rho * land), rel=1e-12)


def test_shadow_and_hidden_slopes():
    given = on(20.0, 40.0, 0.0, 0.0)
    dark = upright_reflectance(1.0, *GREEN, 0.1, **given | {"mu_s_local": 0.0}, diffuse_fraction=0.2)
    sky = upright_reflectance(1.0, *GREEN, 0.1, **given, diffuse_fraction=1.0)
    assert dark == pytest.approx(0.2 * sky, rel=1e-12)
    assert upright_reflectance(1.0, *GREEN, 0.1, **given | {"mu_v_local": 0.0}) == 0


GRID = fifesim.fife_site(10.0, window=((0, 300), (0, 300)))
DEM, LAI = fifesim.flint_hills(GRID, seed=7), fifesim.lai_scene(GRID, seed=7)


def scene(dem, lai=LAI, slopes="upright", **canopy):
    return lai.fifesim.surface_reflectance(
        "TM", bands=["TM3", "TM4"], dem=dem, slopes=slopes, canopy=fifesim.Canopy(**canopy)
    )


def test_scene_of_a_dem():
    level = LAI.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    upright, kt = scene(DEM), scene(DEM, slopes="kt")
    np.testing.assert_allclose(scene(0 * DEM + 400.0), level, rtol=0, atol=1e-6)
    assert 0.9 < float(np.corrcoef((upright / level).values.ravel(), (kt / level).values.ravel())[0, 1]) < 1
    lazy = scene(DEM.chunk(y=70), LAI.chunk(y=50, x=90))
    assert lazy.chunks is not None and "upright" in lazy.history
    np.testing.assert_allclose(lazy.compute(), upright, rtol=1e-12)
    with pytest.raises(ValueError, match="upright"):
        scene(DEM, brown=0.3)
    with pytest.raises(ValueError, match="needs an elevation"):
        scene(None)
