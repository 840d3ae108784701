"""Tests of layers of green and dead leaves, absorbed light, crowns, and discrete ordinates against other solutions."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from oracles_canopy import turned_leaves
from scipy.integrate import quad
from scipy.linalg import expm
from verification import tables
from verification.benchmarks import RAMI_AEROSOL, RAMI_GROUND, RAMI_MOLECULES, RAMI_SZA, _rami_air, hom45

import fifesim
from fifesim.ground.canopy.crowns import clumped, crown_shares
from fifesim.ground.canopy.layers import (
    FPAR_INF,
    beer_fpar,
    extinction_coefficient,
    green_fpar,
    leaf_layers,
    light_budget,
)
from fifesim.ground.canopy.leaf_transfer import discrete_ordinates
from fifesim.ground.canopy.sail_model import sail, with_background

GREEN = 0.45, 0.42


@pytest.mark.parametrize("dissociation", [0.0, 0.4, 1.0])
def test_green_fpar_is_absorption_times_green_share_at_each_depth(dissociation):
    """Quadrature over depth, and limits."""
    lai, brown, extinction = 3.0, 0.4, 0.6
    layers = leaf_layers(lai, brown, dissociation)

    def absorbed(depth):
        share = layers.brown if depth < layers.lai else layers.brown_below
        return 0.94 * extinction * np.exp(-extinction * depth) * (1 - share)

    expected = quad(absorbed, 0, layers.lai)[0] + quad(absorbed, layers.lai, lai)[0]
    np.testing.assert_allclose(green_fpar(lai, extinction, brown, dissociation), expected, rtol=1e-12)
    for share, all_of_it in ((0.0, beer_fpar(lai, extinction)), (1.0, 0.0)):
        np.testing.assert_allclose(green_fpar(lai, extinction, share, dissociation), all_of_it, rtol=1e-14)
    assert beer_fpar(np.inf, 0.5) == FPAR_INF == 0.94 and beer_fpar(1e4, 0.5, fpar_inf=0.9) == 0.9


GREEN_LEAF, DEAD_LEAF, GROUND = (0.4, 0.3), (0.3, 0.1), 0.25


def followed(lai, brown, dissociation, sza, inclination, beam, sky):
    """Green, dead and ground absorption, and reflectance, by matrix exponentials of three streams."""
    sun, *_ = turned_leaves(inclination, sza, 0.0, 0.0)
    ks, bf = sun / np.cos(np.radians(sza)), np.cos(np.radians(inclination)) ** 2
    layers, through, intercepted = leaf_layers(lai, brown, dissociation), np.eye(3), []
    for depth, dead in ((layers.lai, layers.brown), (layers.lai_below, layers.brown_below)):
        rho, tau = ((1 - dead) * one + dead * other for one, other in zip(GREEN_LEAF, DEAD_LEAF, strict=True))
        forward, backward = ([((k + s * bf) * rho + (k - s * bf) * tau) / 2 for k in (ks, 1.0)] for s in (-1, 1))
        streams = np.array(
            [[-ks, 0, 0], [forward[0], forward[1] - 1, backward[1]], [-backward[0], -backward[1], 1 - forward[1]]]
        )
        # The last row sums the light intercepted by leaves, with coefficients ks for the beam and 1 for diffuse light.
        whole = expm(np.vstack([np.hstack([streams, np.zeros((3, 1))]), [[ks, 1, 1, 0]]]) * float(depth))
        intercepted.append(whole[3, :3] @ through)
        through = whole[:3, :3] @ through
    # Choose the upward light at the top so that the ground reflects its share of the light at the bottom.
    known, up = through @ [beam, sky, 0], through @ [0, 0, 1]
    top = -(known[2] - GROUND * (known[0] + known[1])) / (up[2] - GROUND * (up[0] + up[1]))
    streams = np.array([beam, sky, top])
    met = np.array([float(row @ streams) for row in intercepted])
    dead = np.array([layers.brown, layers.brown_below])
    green, brown = met @ (1 - dead) * (1 - sum(GREEN_LEAF)), met @ dead * (1 - sum(DEAD_LEAF))
    bottom = through @ streams
    return green, brown, (1 - GROUND) * (bottom[0] + bottom[1]), top


@pytest.mark.parametrize("lai, brown, dissociation, sza", [(2, 0.4, 0.5, 30), (0.3, 0.1, 0.0, 60), (5, 0.7, 1.0, 45)])
def test_light_budget_agrees_with_matrix_exponentials(lai, brown, dissociation, sza):
    for sky in (0.0, 0.3, 1.0):
        budget = light_budget(
            lai, *GREEN_LEAF, *DEAD_LEAF, GROUND, brown=brown, dissociation=dissociation, sza=sza, leaf_angles="35: 1",
            diffuse_fraction=sky,
        )  # fmt: skip
        expected = followed(lai, brown, dissociation, sza, 35.0, 1 - sky, sky)
        np.testing.assert_allclose([float(each) for each in budget], expected, rtol=0, atol=1e-7)


COVER = np.array([0, 1e-9, 0.3, 0.8, 1 - 1e-9, 1])
VIEWS = [(28.5, 0, 0), (28.5, 28.5, 0), (60, 45, 120), (75, 60, 180)]


def crowns(cover, shape, view, rho=0.45, tau=0.42):
    sza, vza, raa = view
    canopy = sail(2.0, rho, tau, sza=sza, vza=vza, raa=raa, hotspot=0.05)
    return clumped(canopy, crown_shares(cover, shape, *view))


@pytest.mark.parametrize("shape", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("view", VIEWS)
def test_crown_shares_are_consistent_probabilities(view, shape):
    found = crown_shares(COVER, shape, *view)
    assert np.all((found.both <= np.minimum(found.sun, found.view) + 1e-15) & (found.both >= 0))
    assert np.all((found.sun >= COVER - 1e-15) & (found.lit >= found.both - 1e-15) & (found.lit <= 1))
    np.testing.assert_allclose(found.both, found.sun * found.view + found.apart, rtol=0, atol=1e-15)
    if view[0] == view[1] and view[2] == 0 and shape:
        np.testing.assert_allclose(found.both, found.sun, rtol=0, atol=1e-15)


def test_crown_shares_match_spheres_at_random_places():
    """Shadows of spheres are ellipses; the standard error of the cover by 570 spheres is about 0.02."""
    rng, radius, side, sza = np.random.default_rng(4), 1.0, 60.0, 55.0
    count = rng.poisson(-np.log(1 - 0.5) * side**2 / (np.pi * radius**2))
    at = rng.uniform(0, side, (count, 2))
    points = rng.uniform(10, 50, (40_000, 2))
    hit = np.zeros((2, len(points)), bool)
    for x, y in at:
        dx, dy = points[:, 0] - x, points[:, 1] - y
        hit[0] |= dx**2 + dy**2 < radius**2
        hit[1] |= (dx * np.cos(np.radians(sza))) ** 2 + dy**2 < radius**2
    found = crown_shares(0.5, 1.0, sza, 0.0, 0.0)
    np.testing.assert_allclose(hit.mean(axis=1), [found.view, found.sun], atol=0.04)


def test_crowns_conserve_energy_show_the_ground_and_are_reciprocal():
    """With white leaves, without crowns, and with sun and view exchanged."""
    canopy = crowns(COVER, 1.0, VIEWS[2], rho=0.5, tau=0.5)
    np.testing.assert_allclose(canopy.rsd + canopy.tsd + canopy.tss, 1, rtol=1e-12)
    np.testing.assert_allclose(canopy.rdd + canopy.tdd, 1, rtol=1e-12)
    for found in with_background(crowns(0.0, 0.7, VIEWS[2]), 0.15):
        np.testing.assert_allclose(found, 0.15, rtol=0, atol=1e-15)
    there, back = (with_background(crowns(COVER, 0.8, each), 0.2).rso for each in ((60, 25, 50), (25, 60, 50)))
    np.testing.assert_allclose(there, back, rtol=1e-11)


TABLE = pd.read_csv(Path(__file__).parents[2] / "data" / "canopy_hemispherical.csv", comment="#")
BRF = tables.table("canopy_transfer.csv")


def test_discrete_ordinates_agree_with_the_doubling_tables():
    keys = ["sza", "vza", "raa", "leaf_reflectance", "leaf_transmittance", "background"]
    for (sza, vza, raa, rho, tau, soil), rows in BRF.groupby(keys):
        canopy = discrete_ordinates(rows["lai"].to_numpy(), rho, tau, sza=sza, vza=vza, raa=raa)
        np.testing.assert_allclose(with_background(canopy, soil).rso, rows["reflectance"], rtol=0, atol=1e-4)
    optics = BRF.groupby("band")[["leaf_reflectance", "leaf_transmittance", "background"]].first()
    for (band, sza), rows in TABLE.groupby(["band", "sza"]):
        rho, tau, soil = optics.loc[band]
        canopy = discrete_ordinates(rows["lai"].to_numpy(), rho, tau, sza=sza)
        surface = with_background(canopy, soil)
        found = (surface.rsd, surface.rdd, canopy.tss + canopy.tsd, canopy.tdd, canopy.rdd)
        for name, values in zip(("dhr", "bhr", "tdir_total", "tdd", "rdd"), found, strict=True):
            np.testing.assert_allclose(values, rows[f"{name}_exact"], rtol=0, atol=1e-4, err_msg=name)


def test_discrete_ordinates_conserve_energy_are_reciprocal_and_scatter_once_as_sail():
    for leaf_angles in ("planophile", "0: 1", "90: 1"):
        canopy = discrete_ordinates([0.0, 0.1, 1.0, 8.0], 0.6, 0.4, sza=60, vza=20, raa=30, leaf_angles=leaf_angles)
        np.testing.assert_allclose(canopy.rsd + canopy.tsd + canopy.tss, 1, rtol=0, atol=1e-8)
        np.testing.assert_allclose(canopy.rdd + canopy.tdd, 1, rtol=0, atol=1e-8)
    there, back = (
        discrete_ordinates(2.0, *GREEN, sza=sza, vza=vza, raa=50, hotspot=0.1) for sza, vza in ((20, 55), (55, 20))
    )
    found, expected = (there.rso, there.rdo, there.tdo), (back.rso, back.rsd, back.tsd)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)
    angles = {"sza": 30.0, "vza": 30.0, "raa": 0.0, "hotspot": 0.1, "leaf_angles": "uniform"}
    exact, four = (model(3.0, 1e-4, 5e-5, **angles).rso for model in (discrete_ordinates, sail))
    assert exact == pytest.approx(four, rel=2e-4)


def test_rami_hom45():
    """RAMI case of discs with radius 0.025 of the canopy height under an isotropic sky, without fitted parameters."""
    table, _ = hom45()
    _, down, _, _ = _rami_air(table, RAMI_AEROSOL)
    sunlight = np.exp(-(RAMI_MOLECULES + RAMI_AEROSOL) / np.cos(np.radians(RAMI_SZA))) / down
    found = []
    for row in table.itertuples():
        angles = {"sza": RAMI_SZA, "vza": abs(row.vza), "raa": row.raa, "leaf_angles": "uniform"}
        extinction = sum(extinction_coefficient(angles[name], "uniform") for name in ("sza", "vza"))
        angles["hotspot"] = 0.025 * 2 / extinction
        surface = with_background(discrete_ordinates(3.0, 0.05653, 0.01692, **angles), RAMI_GROUND["lambert"])
        found.append(float(sunlight * surface.rso + (1 - sunlight) * surface.rdo))
    away = 100 * (np.array(found) / table["reflectance"].to_numpy() - 1)
    assert abs(away.mean()) < 0.5
    assert abs(away[table["vza"] == RAMI_SZA]).max() < 1.0
    assert abs(away[abs(table["vza"]) <= 60]).max() < 3.0


def test_canopy_uses_the_model(lai):
    optics = {"leaf_optics": {"TM3": (0.11, 0.07), "TM4": GREEN}, "background": {"TM3": 0.1, "TM4": 0.16}}
    canopy = fifesim.Canopy(model="discrete-ordinates", **optics)
    verb = {"bands": ["TM3", "TM4"], "geometry": fifesim.Geometry(sza=28.5, saa=117.0)}
    exact = lai.fifesim.surface_reflectance("TM", canopy=canopy, **verb)
    four = lai.fifesim.surface_reflectance("TM", canopy=canopy.replace(model="sail"), **verb)
    assert "discrete ordinates" in exact.history and "SAIL" in four.history
    ratio = (exact / four).mean(["y", "x"])
    assert abs(float(ratio.sel(band="TM3")) - 1) < 0.01 < float(ratio.sel(band="TM4")) - 1 < 0.03
    lazy = lai.chunk(y=11).fifesim.surface_reflectance("TM", canopy=canopy, **verb)
    np.testing.assert_array_equal(lazy.compute(), exact)
