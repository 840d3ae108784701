"""Vegetation indices at their limits, and the date of each cell of a composite."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.analysis import indices
from fifesim.analysis.indices import date_of_maximum, normalized_difference, normalized_difference_std

# Formulas in the notation of the spyndex catalogue, with its letters for the bands.
CATALOGUE = {
    "normalized_difference": ("NR", "(N - R) / (N + R)"),
    "enhanced": ("NRB", "2.5 * (N - R) / (N + 6.0 * R - 7.5 * B + 1.0)"),
    "enhanced_of_two_bands": ("NR", "2.5 * (N - R) / (N + 2.4 * R + 1.0)"),
    "soil_adjusted": ("NR", "(1.0 + 0.5) * (N - R) / (N + R + 0.5)"),
    "modified_soil_adjusted": ("NR", "0.5 * (2.0 * N + 1 - (((2 * N + 1) ** 2) - 8 * (N - R)) ** 0.5)"),
    "near_infrared_of_vegetation": ("NR", "((N - R) / (N + R)) * N"),
}


@pytest.mark.parametrize("name", CATALOGUE)
def test_formulas_agree_with_the_catalogue(name):
    letters, formula = CATALOGUE[name]
    values = dict(zip("NRB", np.random.default_rng(1).uniform(0.01, 0.6, (3, 50)), strict=True))
    values["B"] = values["B"] / 6
    index = getattr(indices, name)
    np.testing.assert_allclose(index(*(values[each] for each in letters)), eval(formula, {}, values), rtol=1e-13)
    # Bare ground without spectral contrast has an index of 0.
    np.testing.assert_allclose(index(*[0.2] * len(letters)), 0.0, rtol=0, atol=1e-15)
    assert np.isnan(index(np.nan, *[0.2] * (len(letters) - 1)))


def test_undefined_index_is_missing_and_integers_do_not_overflow():
    assert np.isnan(indices.enhanced(0.5, 0.0, 0.2)) and np.isnan(indices.modified_soil_adjusted(0.5, -0.3))
    assert np.isnan(normalized_difference([0.0, 0.1, 0.1], [0.0, -0.1, np.nan])).all()
    # An index beyond 1, and one of two negative reflectances, which is within.
    assert np.isnan(normalized_difference([0.3, -0.1, -0.1], [-0.02, 0.2, -0.2])).all()
    assert np.isnan(normalized_difference_std(0.3, -0.02, 0.01, 0.01))
    np.testing.assert_array_equal(normalized_difference([0.5, 0.0], [0.0, 0.5]), [1.0, -1.0])
    ndvi = normalized_difference(np.array([1000, 65000], "uint16"), np.array([2000, 65000], "uint16"))
    np.testing.assert_allclose(ndvi, [-1 / 3, 0.0], rtol=1e-12)


@pytest.mark.parametrize(("nir", "red"), [(0.4, 0.05), (0.25, 0.25), (0.05, 0.2)])
def test_error_of_ndvi_follows_from_its_derivatives(nir, red):
    """Central differences; the errors of both bands are added in quadrature."""
    h = 1e-6
    by_nir = (normalized_difference(nir + h, red) - normalized_difference(nir - h, red)) / (2 * h)
    by_red = (normalized_difference(nir, red + h) - normalized_difference(nir, red - h)) / (2 * h)
    found = normalized_difference_std(nir, red, 0.003, 0.001)
    assert found == pytest.approx(np.hypot(by_nir * 0.003, by_red * 0.001), rel=1e-8)
    assert np.isnan(normalized_difference_std(0.0, 0.0, 0.003, 0.001))


def test_missing_dates_are_skipped_and_ties_take_the_first():
    index = np.array([[np.nan, -0.2, -0.1], [0.3, 0.3, np.nan], [np.nan, -np.inf, np.nan], [np.nan] * 3])
    assert date_of_maximum(index).tolist() == [2, 0, 1, -1]


def test_maximum_of_normals_agrees_with_the_table():
    """rtol=1e-9: accuracy of the quadrature behind the table."""
    known = pd.read_csv(Path(__file__).parents[1] / "data" / "clouds" / "maximum_of_normals.csv", comment="#")
    found = [indices.maximum_of_normals(dates) for dates in known["dates"]]
    np.testing.assert_allclose(found, known[["mean", "sd"]], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("dates", [2, 5, 10, 14])
def test_bias_of_a_maximum_composite_follows_the_maximum_of_normals(dates):
    """Within 3 standard errors, for independent errors of NDVI."""
    ndvi = 0.5 + 0.03 * np.random.default_rng(dates).standard_normal((40_000, dates))
    best = indices.values_of_date(ndvi, indices.date_of_maximum(ndvi), np.nan)
    mean, sd = indices.maximum_of_normals(dates)
    assert abs((best.mean() - 0.5) / 0.03 - mean) < 3 * sd / 200
    assert abs(best.std() / 0.03 / sd - 1) < 0.02
