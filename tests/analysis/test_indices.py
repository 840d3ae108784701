"""Vegetation indices at their limits."""

import numpy as np
import pytest

from fifesim.analysis.indices import normalized_difference


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
