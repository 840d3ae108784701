"""Vegetation indices at their limits."""

from itertools import pairwise

import numpy as np
import pytest

from fifesim.analysis import indices
from fifesim.analysis.indices import normalized_difference, normalized_difference_std
from fifesim.base.bands import BLUE, GREEN, NEAR_INFRARED, RED, SHORTWAVE_INFRARED

# As the catalogue of spyndex writes them, with its letters for the bands.
CATALOGUE = {
    "enhanced": (("N", "R", "B"), "2.5 * (N - R) / (N + 6.0 * R - 7.5 * B + 1.0)"),
    "enhanced_of_two_bands": (("N", "R"), "2.5 * (N - R) / (N + 2.4 * R + 1.0)"),
    "soil_adjusted": (("N", "R"), "(1.0 + 0.5) * (N - R) / (N + R + 0.5)"),
    "modified_soil_adjusted": (("N", "R"), "0.5 * (2.0 * N + 1 - (((2 * N + 1) ** 2) - 8 * (N - R)) ** 0.5)"),
    "near_infrared_of_vegetation": (("N", "R"), "((N - R) / (N + R)) * N"),
}


@pytest.mark.parametrize("name", CATALOGUE)
def test_formulas_are_those_of_the_catalogue(name):
    letters, formula = CATALOGUE[name]
    values = dict(zip("NRB", np.random.default_rng(1).uniform(0.01, 0.6, (3, 50)), strict=True))
    values["B"] = values["B"] / 6
    found = getattr(indices, name)(*(values[each] for each in letters))
    np.testing.assert_allclose(found, eval(formula, {}, values), rtol=1e-13)


@pytest.mark.parametrize("name", CATALOGUE)
def test_bare_ground_without_contrast_has_none(name):
    letters, _ = CATALOGUE[name]
    np.testing.assert_allclose(getattr(indices, name)(*[0.2] * len(letters)), 0.0, rtol=0, atol=1e-15)
    assert np.isnan(getattr(indices, name)(np.nan, *[0.2] * (len(letters) - 1)))


def test_soil_adjustment_of_a_modified_index_is_its_own():
    """MSAVI is SAVI with L = 1 - MSAVI, the fixed point from which its closed form was found (Qi et al. 1994)."""
    nir, red = np.random.default_rng(2).uniform([[0.2], [0.02]], [[0.6], [0.15]], (2, 50))
    msavi = indices.modified_soil_adjusted(nir, red)
    np.testing.assert_allclose(msavi, indices.soil_adjusted(nir, red, soil=1 - msavi), rtol=1e-12)


def test_index_without_a_denominator_or_a_root_is_missing():
    assert np.isnan(indices.enhanced(0.5, 0.0, 0.2))
    assert np.isnan(indices.modified_soil_adjusted(0.5, -0.3))


def test_windows_of_bands_do_not_overlap():
    """But for the blue and the green, of which a band at 0.5 to 0.52 um shows both."""
    windows = (BLUE, GREEN, RED, NEAR_INFRARED, SHORTWAVE_INFRARED)
    assert all(each.low < each.best < each.high for each in windows)
    assert all(one.high <= other.low for one, other in pairwise(windows[1:]))


def test_index_is_antisymmetric_and_bounded():
    nir, red = np.random.default_rng(0).uniform(0, 1, (2, 1000))
    ndvi = normalized_difference(nir, red)
    np.testing.assert_array_equal(ndvi, -normalized_difference(red, nir))
    assert (np.abs(ndvi) <= 1).all()


def test_index_does_not_depend_on_brightness():
    np.testing.assert_allclose(normalized_difference(0.3, 0.1), normalized_difference(0.9, 0.3), rtol=1e-15)


@pytest.mark.parametrize("nir, red, ndvi", [(0.5, 0.0, 1.0), (0.0, 0.5, -1.0), (0.2, 0.2, 0.0)])
def test_limits(nir, red, ndvi):
    assert normalized_difference(nir, red) == ndvi


@pytest.mark.parametrize("nir, red", [(0.0, 0.0), (0.1, -0.1), (np.nan, 0.1), (0.1, np.nan)])
def test_index_of_nothing_is_missing(nir, red):
    assert np.isnan(normalized_difference(nir, red))


def test_unsigned_integers_do_not_wrap():
    ndvi = normalized_difference(np.array([1000, 65000], "uint16"), np.array([2000, 65000], "uint16"))
    np.testing.assert_allclose(ndvi, [-1 / 3, 0.0], rtol=1e-12)


@pytest.mark.parametrize(("nir", "red"), [(0.4, 0.05), (0.25, 0.25), (0.05, 0.2)])
def test_error_of_ndvi_follows_from_its_derivatives(nir, red):
    """Central differences, and the root of the sum of squares of both contributions."""
    h = 1e-6
    by_nir = (normalized_difference(nir + h, red) - normalized_difference(nir - h, red)) / (2 * h)
    by_red = (normalized_difference(nir, red + h) - normalized_difference(nir, red - h)) / (2 * h)
    found = normalized_difference_std(nir, red, 0.003, 0.001)
    assert found == pytest.approx(np.hypot(by_nir * 0.003, by_red * 0.001), rel=1e-8)
    assert np.isnan(normalized_difference_std(0.0, 0.0, 0.003, 0.001))
