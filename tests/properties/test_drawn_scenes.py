"""Physical properties of every canopy, and images that are identical to the bit in any chunks."""

from itertools import pairwise

import numpy as np
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from lazy import in_chunks, no_compute

import fifesim
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.reflectance_table import canopy_reflectance
from fifesim.ground.canopy.sail_model import sail, with_background

modest = settings(max_examples=80)
zenith = st.floats(0, 89.9)
azimuth = st.floats(0, 180)
lai = st.floats(0, 50)
fraction = st.floats(0, 1)
hotspot = st.one_of(st.just(0.0), st.floats(0.001, 2))
leaf_angles = st.one_of(
    st.sampled_from(["spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform"]),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(lambda p: ("verhoef", p[0], p[1] * (1 - abs(p[0])))),
    st.tuples(st.just("campbell"), st.floats(5, 85)),
)


@modest
@given(lai, fraction, fraction, zenith, zenith, azimuth, leaf_angles, hotspot, fraction)
def test_reflectance_is_finite_reciprocal_and_not_negative(lai, rho, share, sza, vza, raa, shape, hotspot, r):
    given = {"raa": raa, "leaf_angles": leaf_angle_classes(shape), "hotspot": hotspot}
    there = with_background(sail(lai, rho, share * (1 - rho), sza=sza, vza=vza, **given), r)
    back = with_background(sail(lai, rho, share * (1 - rho), sza=vza, vza=sza, **given), r)
    assert np.isfinite(there.rso) and there.rso >= 0
    # Reciprocity: a beam into the canopy and a view out of it are the same problem.
    np.testing.assert_allclose([there.rso, there.rsd], [back.rso, back.rdo], rtol=1e-12, atol=1e-300)


@modest
@given(lai, fraction, fraction, zenith, leaf_angles, fraction)
def test_canopies_create_no_light_and_conservative_leaves_lose_none(lai, rho, share, sza, shape, r):
    canopy = sail(lai, rho, share * (1 - rho), sza=sza, leaf_angles=shape)
    assert canopy.rdd + canopy.tdd <= 1 + 1e-12
    assert canopy.rsd + canopy.tsd + canopy.tss <= 1 + 1e-12
    assert all(value <= 1 + 1e-12 for value in with_background(canopy, r)[2:])
    canopy = sail(lai, rho, 1 - rho, sza=sza, leaf_angles=shape)
    kept = canopy.rdd + canopy.tdd, canopy.rsd + canopy.tsd + canopy.tss, with_background(canopy, 1.0).rdd
    np.testing.assert_allclose(kept, 1, atol=1e-9)


@modest
@given(lai, lai, fraction, fraction, zenith, leaf_angles, fraction)
def test_two_layers_equal_one_thick_layer(upper, lower, rho, share, sza, shape, r):
    """The surface below may be a canopy too: for diffuse light, two layers combine like a layer and its background."""

    def over(lai, below):
        return with_background(sail(lai, rho, share * (1 - rho), sza=sza, leaf_angles=shape), below).rdd

    np.testing.assert_allclose(over(upper, over(lower, r)), over(upper + lower, r), rtol=1e-9, atol=1e-12)


@settings(modest, max_examples=40)
@given(lai, fraction, fraction, zenith, zenith, azimuth, leaf_angles, hotspot, fraction, fraction)
def test_table_is_within_its_bound(lai, rho, share, sza, vza, raa, shape, hotspot, r, sky):
    angles = {"sza": sza, "vza": vza, "raa": raa, "leaf_angles": shape, "hotspot": hotspot, "diffuse_fraction": sky}
    lai = np.array([lai, lai / 50, lai / 5])
    for ground in (r, np.full((1, 3), r)):
        quick, exact = (
            canopy_reflectance(lai, rho, share * (1 - rho), ground, exact=each, **angles) for each in (False, True)
        )
        np.testing.assert_allclose(quick, exact, rtol=0, atol=1e-6)


ROWS, COLUMNS = 45, 54
SITE = fifesim.fife_site(30 / 9, window=((90, 90 + ROWS), (180, 180 + COLUMNS)))


def image_in(rows, columns, later, bands):
    """Lazy image of a scene in chunks of some rows and columns, which change after the reflectance."""
    lai = fifesim.lai_scene(SITE, arp=0.15, seed=7, chunks={"y": rows, "x": columns})
    assert lai.chunks == (rows, columns)
    rho = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"])
    return in_chunks(rho, {"y": later, "band": bands}).fifesim.to_toa().fifesim.sense("TM")


WHOLE = fifesim.surface_reflectance(fifesim.lai_scene(SITE, arp=0.15, seed=7), bands=["TM3", "TM4"])
IMAGE = WHOLE.fifesim.to_toa().fifesim.sense("TM")


@st.composite
def pieces(draw, size, most):
    """Tuples of lengths that add up to `size`."""
    cuts = draw(st.lists(st.integers(1, size - 1), unique=True, max_size=most - 1))
    edges = [0, *sorted(cuts), size]
    return tuple(end - start for start, end in pairwise(edges))


@settings(max_examples=25)
@given(pieces(ROWS, 9), pieces(COLUMNS, 9), pieces(ROWS, 5), st.sampled_from([(2,), (1, 1)]))
def test_image_is_the_same_in_any_chunks(rows, columns, later, bands):
    with no_compute():
        image = image_in(rows, columns, later, bands)
    xr.testing.assert_identical(image.compute(), IMAGE)
