"""Tests of crowns and gaps: limits, energy, crowns at random places, and spheres by a Monte Carlo model."""

import numpy as np
import pytest
from verification import tables

from fifesim.ground.canopy.crowns import check_crowns, clumped, crown_shares, lai_in_crowns
from fifesim.ground.canopy.sail_model import sail, with_background

COVER = np.array([0, 1e-9, 0.3, 0.8, 1 - 1e-9, 1])
VIEWS = [(28.5, 0, 0), (28.5, 28.5, 0), (60, 45, 120), (75, 60, 180)]


def crowns(lai=2.0, view=VIEWS[2], rho=0.45, tau=0.42):
    sza, vza, raa = view
    return sail(lai, rho, tau, sza=sza, vza=vza, raa=raa, hotspot=0.05)


@pytest.mark.parametrize("view", VIEWS)
def test_crown_cover_of_1_is_the_canopy_and_of_0_the_ground(view):
    canopy = crowns(view=view)
    for name, value in clumped(canopy, crown_shares(1.0, 0.7, *view))._asdict().items():
        np.testing.assert_allclose(value, getattr(canopy, name), rtol=0, atol=1e-15, err_msg=name)
    for found in with_background(clumped(canopy, crown_shares(0.0, 0.7, *view)), 0.15):
        np.testing.assert_allclose(found, 0.15, rtol=0, atol=1e-15)


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


@pytest.mark.parametrize("cover", COVER)
def test_crowns_of_white_leaves_conserve_energy(cover):
    canopy = clumped(crowns(rho=0.5, tau=0.5), crown_shares(cover, 1.0, *VIEWS[2]))
    np.testing.assert_allclose(canopy.rsd + canopy.tsd + canopy.tss, 1, rtol=1e-12)
    np.testing.assert_allclose(canopy.rdd + canopy.tdd, 1, rtol=1e-12)
    surface = with_background(canopy, 1.0)
    np.testing.assert_allclose([surface.rsd, surface.rdd, surface.rdo], 1, rtol=1e-12)


def test_crowns_are_reciprocal():
    there, back = (
        with_background(clumped(crowns(view=view), crown_shares(COVER, 0.8, *view)), 0.2).rso
        for view in ((60, 25, 50), (25, 60, 50))
    )
    np.testing.assert_allclose(there, back, rtol=1e-11)


def test_crowns_agree_with_rami_het01_better_than_a_plain_canopy():
    """Spheres of leaves by Eradiate: within 14 %, whereas a plain canopy is 14 to 36 % too bright."""
    table = tables.table("spheres_of_leaves.csv")
    angles = 20.0, table["vza"].to_numpy(), table["raa"].to_numpy()
    given = {"sza": 20.0, "vza": angles[1], "raa": angles[2], "hotspot": 0.01}
    canopy = sail(lai_in_crowns(2.356, 0.4712), 0.4957, 0.4409, **given)
    found = with_background(clumped(canopy, crown_shares(0.4712, 1.0, *angles)), 0.159).rso / table["brf"]
    plain = with_background(sail(2.356, 0.4957, 0.4409, **given), 0.159).rso / table["brf"]
    assert np.abs(found - 1).max() < 0.14 and plain.min() > 1.14 and plain.max() > 1.35
    assert abs(np.mean(found) - 1) < 0.03


@pytest.mark.parametrize(
    "lai, cover, message",
    [
        (1.0, 1.2, r"crown_cover must be in \[0, 1\], got 1.2"),
        ([1.0, 3.0], 0.02, "lai / crown_cover, at most 100, got up to 150"),
    ],
)
def test_impossible_crowns_are_refused(lai, cover, message):
    with pytest.raises(ValueError, match=message):
        check_crowns(lai, cover)
    check_crowns([5.0, np.nan, 5.0], [0.0, 0.5, np.nan])
