"""Tests of leaf angle distributions against their densities, limits and another code."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from fifesim.ground.canopy.leaf_angles import leaf_angle_classes

DENSITY = {
    "spherical": np.sin,
    "planophile": lambda t: 2 / np.pi * (1 + np.cos(2 * t)),
    "erectophile": lambda t: 2 / np.pi * (1 - np.cos(2 * t)),
    "plagiophile": lambda t: 2 / np.pi * (1 - np.cos(4 * t)),
    "extremophile": lambda t: 2 / np.pi * (1 + np.cos(4 * t)),
    "uniform": lambda t: 2 / np.pi,
}


@pytest.mark.parametrize("name", DENSITY)
def test_classes_integrate_the_density(name):
    """Compare with the published densities, integrated by quadrature."""
    edges = np.radians(np.arange(0, 91, 10))
    expected = [quad(DENSITY[name], a, b)[0] for a, b in pairwise(edges)]
    np.testing.assert_allclose(leaf_angle_classes(name, classes=9).fraction, expected, atol=1e-14)


@pytest.mark.parametrize("a, b", [(-0.35, -0.15), (1, 0), (-1, 0), (0, 1), (0, -1), (0, 0), (0.3, -0.6)])
def test_verhoef_classes_agree_with_prosail(a, b):
    """prosail stops its iteration at 1e-8, which the cube root at a = 1 magnifies."""
    oracle = pytest.importorskip("prosail.FourSAIL")
    expected = oracle.verhoef_bimodal(float(a), float(b), 18)
    np.testing.assert_allclose(leaf_angle_classes(("verhoef", a, b), classes=18).fraction, expected, atol=1e-5)


@pytest.mark.parametrize("b", [-1, -1 + 1e-12, -0.7, 0.4, 1])
def test_verhoef_with_a_of_0_is_symmetric_about_45_degrees(b):
    """Exact to rounding, also at b = -1, where the equation has a triple root."""
    fraction = np.array(leaf_angle_classes(("verhoef", 0, b)).fraction)
    assert abs(fraction[:45].sum() - 0.5) < 1e-14
    np.testing.assert_allclose(fraction, fraction[::-1], atol=1e-14)


def test_ellipsoidal_leaves_with_a_mean_of_one_radian_are_spherical():
    """The mean inclination of spherical leaves is the integral of t sin t from 0 to pi / 2, which is 1."""
    expected = leaf_angle_classes("spherical").fraction
    np.testing.assert_allclose(leaf_angle_classes(("campbell", np.degrees(1))).fraction, expected, atol=1e-10)


@pytest.mark.parametrize("mean", [5, 30, 57, 80, 88])
def test_ellipsoidal_leaves_have_the_given_mean(mean):
    """Classes of 0.01 degrees determine the mean to 1e-4 degrees."""
    leaves = leaf_angle_classes(("campbell", mean), classes=9000)
    assert abs(np.dot(leaves.inclination, leaves.fraction) - mean) < 1e-4


@pytest.mark.parametrize("mean", [25, 45, 70])
def test_ellipsoidal_leaves_follow_campbell_density(mean):
    """Campbell (1990): 2 x^3 sin t / (cos^2 t + x^2 sin^2 t)^2, up to a factor; x from the ratio of two classes."""
    fraction = np.array(leaf_angle_classes(("campbell", mean), classes=900).fraction)
    t = np.radians((np.arange(900) + 0.5) / 10)

    def density(x):
        shape = np.sin(t) / (np.cos(t) ** 2 + x**2 * np.sin(t) ** 2) ** 2
        return shape / shape.sum()

    ratios = np.geomspace(0.05, 20, 4000)
    nearest = min(ratios, key=lambda x: abs(density(x)[450] / density(x)[300] - fraction[450] / fraction[300]))
    np.testing.assert_allclose(fraction, density(nearest), atol=2e-5)


@pytest.mark.parametrize(
    "given", ["spherical", "Uniform", "verhoef(-0.35,-0.15)", ("campbell", 57), [0.2, 0.3, 0.5], "30: 0.5, 60: 0.5"]
)
def test_text_of_a_distribution_recreates_it(given):
    leaves = leaf_angle_classes(given)
    assert leaf_angle_classes(str(leaves)) == leaves
    assert leaf_angle_classes(leaves) is leaves
    assert hash(leaves) == hash(leaf_angle_classes(str(leaves)))


def test_sequence_gives_equal_classes_whose_fractions_are_normalised():
    """Only rounding is corrected."""
    assert leaf_angle_classes(np.array([0.5, 0.5])).inclination == (22.5, 67.5)
    assert abs(sum(leaf_angle_classes([0.3333333, 0.3333333, 0.3333334]).fraction) - 1) < 1e-15
    with pytest.raises(ValueError, match=r"sum to 1, got a sum of 0.9 .* divide them by their sum"):
        leaf_angle_classes([0.5, 0.4])


@pytest.mark.parametrize(
    "given, message",
    [
        ("sperical", "did you mean 'spherical'.* planophile, erectophile"),
        ("xyz", "Allowed: spherical"),
        ("verhoef(0.8, 0.5)", r"\|a\| \+ \|b\| <= 1, got a = 0.8, b = 0.5"),
        ("verhoef(0.8)", "verhoef"),
        ("verhoef(a, b)", "unknown"),
        ("campbell(95)", r"\[1, 89\] degrees, got 95"),
        ([-0.5, 1.5], "not be negative"),
        ([], "give one fraction for each"),
        ([np.nan, 1.0], "not be negative"),
        ("100: 1", r"\[0, 90\]"),
    ],
)
def test_impossible_distributions_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        leaf_angle_classes(given)
