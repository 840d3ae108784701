"""Relative equivalent noise, inversion and sweeps of regressions."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks

import fifesim
from fifesim.analysis import uncertainty

CELL = 30 / 9


@pytest.fixture(scope="module")
def pair():
    """LAI from 0.2 to 2.2, and NDVI on a line with noise of a known deviation."""
    grid = fifesim.fife_site(CELL, window=((0, 300), (0, 300)))
    lai = fifesim.lai_scene(grid, arp=0.0, seed=2)
    rng = np.random.default_rng(8)
    lai = lai.copy(data=rng.uniform(0.2, 2.2, lai.shape))
    ndvi = (0.1 + 0.3 * lai + rng.normal(0, 0.03, lai.shape)).rename("ndvi")
    return lai, ndvi


def test_noise_on_a_line_is_its_deviation_over_slope_and_value(pair):
    """Closed form, with the share of the slope within an increment; 900 pairs each know a deviation to 2.4 %."""
    lai, ndvi = pair
    found = fifesim.relative_equivalent_noise(lai, ndvi, 0.02)
    expected = np.hypot(0.03, 0.3 * 0.02 / np.sqrt(12)) / (0.3 * found["increment"])
    np.testing.assert_allclose(found["ren"], expected, rtol=0.12)
    assert found.attrs["slope"] == pytest.approx(0.3, rel=0.01)
    assert int(found["count"].sum()) == lai.size


def test_noise_agrees_with_groups_of_pandas(pair):
    lai, ndvi = pair
    lai = lai.where(lai < 2)
    found = fifesim.relative_equivalent_noise(lai, ndvi, 0.25, slope=0.3)
    table = xr.Dataset({"lai": lai, "ndvi": ndvi}).to_dataframe()[["lai", "ndvi"]].dropna()
    groups = table.groupby(np.floor(table["lai"] / 0.25))
    np.testing.assert_array_equal(found["count"], groups.size())
    np.testing.assert_allclose(found["ren"], groups["ndvi"].std() / 0.3 / groups["lai"].mean(), rtol=1e-10)


def test_noise_has_the_same_bits_in_any_chunks(pair):
    lai, ndvi = pair
    whole = fifesim.relative_equivalent_noise(lai, ndvi)
    xr.testing.assert_identical(
        fifesim.relative_equivalent_noise(in_chunks(lai, {"y": 77, "x": 50}), in_chunks(ndvi, ODD_CHUNKS)), whole
    )


def test_few_pairs_have_no_noise():
    sums = uncertainty.increment_sums(np.array([[0.5, 1.5, 1.6]]), np.array([[0.1, 0.2, 0.4]]), 0, 1.0, 3, 0.0)
    count, mean, deviation = uncertainty.increment_moments(sums)
    assert count.tolist() == [1, 2, 0]
    assert np.isnan(deviation).tolist() == [True, False, True]
    assert np.isnan(mean).tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"increment": 0.0}, "increment must be positive, got 0"),
        ({"increment": 1e-6}, "take a larger one"),
        ({"min_count": 1}, "at least 2, got 1"),
    ],
)
def test_impossible_increments_are_refused(pair, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.relative_equivalent_noise(*pair, **options)


def test_inversion_holds_its_share_and_has_the_residual_as_error(pair):
    """On the pixels that it was fitted to: no bias, and the residual deviation but for n - 2; 95 % within 4 errors."""
    lai, ndvi = pair
    fit = fifesim.regress(lai, ndvi)
    estimate = fifesim.invert(ndvi, fit)
    error = fifesim.inversion_error(estimate, lai)
    assert float(error["bias"]) == pytest.approx(0, abs=1e-10)
    assert float(error["rmse"]) == pytest.approx(fit.residual_deviation * np.sqrt((fit.n - 2) / fit.n), rel=1e-9)
    assert float(error["coverage"]) == pytest.approx(0.95, abs=0.02)
    assert int(error["n"]) == lai.size
    assert estimate.fifesim.inversion_error(lai).identical(error)


def test_map_is_lazy_labelled_and_as_the_line_says(pair):
    lai, ndvi = pair
    fit = fifesim.regress(lai, ndvi)
    lazy = fifesim.invert(in_chunks(ndvi, ODD_CHUNKS | {"y": 100, "x": 99}), fit, level=0.5)
    assert lazy["low"].chunks is not None
    np.testing.assert_array_equal(lazy["lai"], fit.predict(ndvi.values))
    np.testing.assert_array_equal(lazy["high"], fit.prediction_interval(ndvi.values, 0.5)[1])
    assert lazy["lai"].attrs["standard_name"] == "leaf_area_index"
    assert "standard_name" not in lazy["low"].attrs
    assert lazy["lai"].rio.crs.to_epsg() == 26914


def test_error_of_a_map_alone_and_of_nothing(pair):
    lai, _ = pair
    error = fifesim.inversion_error(lai + 0.25, lai)
    assert float(error["bias"]) == pytest.approx(0.25, rel=1e-12)
    assert float(error["rmse"]) == pytest.approx(0.25, rel=1e-12)
    assert "coverage" not in error
    with pytest.raises(ValueError, match="no pixel has both"):
        fifesim.inversion_error(lai * np.nan, lai)


@pytest.mark.parametrize(
    ("options", "message"),
    [({"quantity": "ndvi"}, "quantity must be 'lai' or 'fpar'"), ({"level": 95}, "level must be between 0 and 1")],
)
def test_impossible_inversion_is_refused(pair, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.invert(pair[1], fifesim.regress(*pair), **options)


def test_error_of_what_is_no_estimate_is_refused(pair):
    estimate = fifesim.invert(pair[1], fifesim.regress(*pair))
    for wrong in (estimate[["lai"]], estimate[["low", "high"]], estimate.assign(other=estimate["lai"])):
        with pytest.raises(ValueError, match="one variable with low and high"):
            fifesim.inversion_error(wrong, pair[0])


def test_noise_of_nothing_is_refused(pair):
    with pytest.raises(ValueError, match="needs finite values"):
        fifesim.relative_equivalent_noise(pair[0] * np.nan, pair[1], slope=0.4)
