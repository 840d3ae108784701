"""Physical properties of every canopy."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.reflectance_table import canopy_reflectance
from fifesim.ground.canopy.sail_model import sail, with_background

modest = settings(max_examples=80)
zenith = st.floats(0, 89.9)
azimuth = st.floats(0, 180)
lai = st.floats(0, 50)
fraction = st.floats(0, 1)
hotspot = st.one_of(st.just(0.0), st.floats(0.001, 2))
verhoef = st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(lambda p: ("verhoef", p[0], p[1] * (1 - abs(p[0]))))
leaf_angles = st.one_of(
    st.sampled_from(["spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform"]),
    verhoef,
    st.tuples(st.just("campbell"), st.floats(5, 85)),
)


@modest
@given(lai, fraction, fraction, zenith, zenith, azimuth, leaf_angles, hotspot, fraction)
def test_reflectance_is_finite_reciprocal_and_not_negative(lai, rho, share, sza, vza, raa, shape, hotspot, r):
    tau = share * (1 - rho)
    shape = leaf_angle_classes(shape)
    there = with_background(sail(lai, rho, tau, sza=sza, vza=vza, raa=raa, leaf_angles=shape, hotspot=hotspot), r)
    back = with_background(sail(lai, rho, tau, sza=vza, vza=sza, raa=raa, leaf_angles=shape, hotspot=hotspot), r)
    assert np.isfinite(there.rso) and there.rso >= 0
    np.testing.assert_allclose(there.rso, back.rso, rtol=1e-12, atol=1e-300)
    # Reciprocity: a beam into the canopy and a view out of it are the same problem.
    np.testing.assert_allclose(there.rsd, back.rdo, rtol=1e-12, atol=1e-300)


@modest
@given(lai, fraction, fraction, zenith, leaf_angles, fraction)
def test_canopies_do_not_create_light(lai, rho, share, sza, shape, r):
    canopy = sail(lai, rho, share * (1 - rho), sza=sza, leaf_angles=shape)
    assert canopy.rdd + canopy.tdd <= 1 + 1e-12
    assert canopy.rsd + canopy.tsd + canopy.tss <= 1 + 1e-12
    assert all(value <= 1 + 1e-12 for value in with_background(canopy, r)[2:])


@modest
@given(lai, fraction, zenith, leaf_angles)
def test_conservative_leaves_lose_no_light(lai, rho, sza, shape):
    canopy = sail(lai, rho, 1 - rho, sza=sza, leaf_angles=shape)
    np.testing.assert_allclose(canopy.rdd + canopy.tdd, 1, atol=1e-9)
    np.testing.assert_allclose(canopy.rsd + canopy.tsd + canopy.tss, 1, atol=1e-9)
    np.testing.assert_allclose(with_background(canopy, 1.0).rdd, 1, atol=1e-9)


@modest
@given(lai, lai, fraction, fraction, zenith, leaf_angles, fraction)
def test_two_layers_equal_one_thick_layer(upper, lower, rho, share, sza, shape, r):
    """The surface below may be a canopy too: for diffuse light, two layers combine like a layer and its background."""
    tau = share * (1 - rho)
    below = with_background(sail(lower, rho, tau, sza=sza, leaf_angles=shape), r).rdd
    stacked = with_background(sail(upper, rho, tau, sza=sza, leaf_angles=shape), below).rdd
    whole = with_background(sail(upper + lower, rho, tau, sza=sza, leaf_angles=shape), r).rdd
    np.testing.assert_allclose(stacked, whole, rtol=1e-9, atol=1e-12)


@settings(modest, max_examples=40)
@given(lai, fraction, fraction, zenith, zenith, azimuth, leaf_angles, hotspot, fraction, fraction)
def test_table_is_within_its_bound(lai, rho, share, sza, vza, raa, shape, hotspot, r, sky):
    angles = {"sza": sza, "vza": vza, "raa": raa, "leaf_angles": shape, "hotspot": hotspot, "diffuse_fraction": sky}
    lai = np.array([lai, lai / 50, lai / 5])
    for ground in (r, np.full((1, 3), r)):
        quick = canopy_reflectance(lai, rho, share * (1 - rho), ground, exact=False, **angles)
        exact = canopy_reflectance(lai, rho, share * (1 - rho), ground, exact=True, **angles)
        np.testing.assert_allclose(quick, exact, rtol=0, atol=1e-6)
