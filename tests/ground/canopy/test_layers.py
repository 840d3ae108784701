"""Two layers of two kinds of leaf against one, against each other, and against a table."""

import numpy as np
import pytest
from oracles_canopy import sunlit_and_seen

from fifesim.base import files
from fifesim.ground.canopy.layers import added, leaf_layers, mixed, two_layers
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.sail_model import direction_distance, leaf_scattering, sail, with_background

LAI = np.array([0, 1e-6, 0.5, 3, 20, 100])[:, None]
BROWN = np.array([0, 1e-9, 0.2, 0.7, 1 - 1e-9, 1])
GREEN, DEAD = (0.45, 0.42), (0.3, 0.1)
VIEWS = [(28.5, 0, 0, 0.0), (28.5, 28.5, 0, 0.1), (60, 45, 120, 0.05), (75, 60, 180, 1.0)]


def canopies(brown, dissociation, view, green=GREEN, dead=DEAD, lai=LAI):
    sza, vza, raa, hotspot = view
    angles = {"sza": sza, "vza": vza, "raa": raa, "hotspot": hotspot}
    return two_layers(lai, *green, *dead, brown=brown, dissociation=dissociation, **angles)


def leaves(optics, view, lai=LAI):
    sza, vza, raa, hotspot = view
    return sail(lai, *optics, sza=sza, vza=vza, raa=raa, hotspot=hotspot)


def check_equal(found, expected, atol=1e-12):
    for name, value in expected._asdict().items():
        one, other = np.broadcast_arrays(getattr(found, name), value)
        np.testing.assert_allclose(one, other, rtol=0, atol=atol, err_msg=name)


def test_a_published_model_gives_the_same_reflectances():
    """Its last digit is 1e-7; its leaf angle fractions are good to 1e-8."""
    for row in files.table("verification/two_layers.csv").itertuples():
        canopy = two_layers(
            row.lai, row.rho_green, row.tau_green, row.rho_brown, row.tau_brown, brown=row.brown, sza=row.sza,
            dissociation=row.dissociation, vza=row.vza, raa=row.raa, hotspot=row.hotspot,
            leaf_angles=leaf_angle_classes(row.leaf_angles, classes=18),
        )  # fmt: skip
        expected = [row.rso, row.rdo, row.rsd, row.rdd]
        np.testing.assert_allclose(list(with_background(canopy, row.soil)), expected, rtol=0, atol=1.5e-7)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("dissociation", [0.0, 0.4, 1.0])
def test_leaves_that_are_alike_or_of_one_kind_are_one_canopy(view, dissociation):
    check_equal(canopies(BROWN, dissociation, view, dead=GREEN), leaves(GREEN, view))
    check_equal(canopies(0.0, dissociation, view), leaves(GREEN, view))
    check_equal(canopies(1.0, dissociation, view), leaves(DEAD, view))


@pytest.mark.parametrize("view", VIEWS)
def test_mixed_leaves_are_the_mean_leaf(view):
    mean = mixed(GREEN, DEAD, BROWN)
    check_equal(canopies(BROWN, 0.0, view), leaves(mean, view))


def test_a_canopy_over_a_canopy_is_one_over_a_background():
    """The lower one is made a background, order by order of light between both; no hot spot."""
    view = (50, 20, 40, 0.0)
    top, bottom = leaves((0.1, 0.3), view, 1.5), leaves((0.5, 0.2), view, 2.0)
    down, up = top.tsd, 0.0
    total = top.rso + top.tss * bottom.rso * top.too
    for order in range(200):
        sunlight = top.tss if order == 0 else 0.0
        up = sunlight * bottom.rsd + down * bottom.rdd
        total += down * bottom.rdo * top.too + up * top.tdo
        down = up * top.rdd
    np.testing.assert_allclose(added(top, bottom).rso, total, rtol=1e-13)


@pytest.mark.parametrize("dissociation", [0.0, 0.5, 1.0])
def test_layers_hold_all_leaves_of_both_kinds(dissociation):
    layers = leaf_layers(LAI, BROWN, dissociation)
    np.testing.assert_allclose(layers.lai + layers.lai_below, LAI + 0 * BROWN, rtol=1e-14)
    dead = layers.lai * layers.brown + layers.lai_below * layers.brown_below
    np.testing.assert_allclose(dead, LAI * BROWN, rtol=1e-12, atol=1e-300)


def test_hot_spot_goes_through_both_layers():
    """What a hot spot adds to single scattering, with what both beams reach in each layer by quadrature."""
    sza, vza, raa, hotspot, lai, brown = 40.0, 30.0, 20.0, 0.2, 3.0, 0.6
    angles = {"sza": sza, "vza": vza, "raa": raa}
    c = [leaf_scattering(*optics, *angles.values(), leaf_angle_classes("spherical")) for optics in (GREEN, DEAD)]
    ks, ko = float(c[0].ks), float(c[0].ko)
    alpha = 2 * direction_distance(sza, vza, raa) / (hotspot * (ks + ko))
    seen = sunlit_and_seen(lai, ks, ko, alpha)
    above = sunlit_and_seen((1 - brown) * lai, ks, ko, (1 - brown) * alpha)
    plain = [-np.expm1(-(ks + ko) * depth) / (ks + ko) for depth in (lai, (1 - brown) * lai)]
    added_light = c[0].w * (above - plain[1]) + c[1].w * (seen - above - plain[0] + plain[1])
    with_it, without = (
        two_layers(lai, *GREEN, *DEAD, brown=brown, dissociation=1.0, hotspot=h, **angles).rso for h in (hotspot, 0.0)
    )
    np.testing.assert_allclose(with_it - without, added_light, rtol=0, atol=1e-9)


@pytest.mark.parametrize("dissociation", [0.0, 0.5, 1.0])
def test_sun_and_view_may_be_exchanged(dissociation):
    there, back = (
        with_background(canopies(BROWN, dissociation, view), 0.2).rso for view in ((60, 25, 50, 0.1), (25, 60, 50, 0.1))
    )
    np.testing.assert_allclose(there, back, rtol=1e-11)


def test_no_data_stay_where_they_are():
    lai, brown = np.array([1.0, np.nan, 1.0]), np.array([0.3, 0.3, np.nan])
    found = canopies(brown, 0.5, VIEWS[1], lai=lai)
    assert [np.isnan(getattr(found, name)).tolist() for name in ("rso", "rdd_below", "tdo")] == 3 * [
        [False, True, True]
    ]
