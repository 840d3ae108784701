"""Relative equivalent noise of rasters: closed form, groups of pandas, chunks."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks

import fifesim


def test_noise_on_a_line_is_its_deviation_over_slope_and_value(scattered):
    """Closed form, with the share of the slope within an increment; 900 pairs each know a deviation to 2.4 %."""
    lai, ndvi = scattered
    found = fifesim.relative_equivalent_noise(lai, ndvi, 0.02)
    expected = np.hypot(0.03, 0.3 * 0.02 / np.sqrt(12)) / (0.3 * found["increment"])
    np.testing.assert_allclose(found["ren"], expected, rtol=0.12)
    assert found.attrs["slope"] == pytest.approx(0.3, rel=0.01)
    assert int(found["count"].sum()) == lai.size


def test_noise_agrees_with_groups_of_pandas(scattered):
    lai, ndvi = scattered
    lai = lai.where(lai < 2)
    found = fifesim.relative_equivalent_noise(lai, ndvi, 0.25, slope=0.3)
    table = xr.Dataset({"lai": lai, "ndvi": ndvi}).to_dataframe()[["lai", "ndvi"]].dropna()
    groups = table.groupby(np.floor(table["lai"] / 0.25))
    np.testing.assert_array_equal(found["count"], groups.size())
    np.testing.assert_allclose(found["ren"], groups["ndvi"].std() / 0.3 / groups["lai"].mean(), rtol=1e-10)


def test_noise_has_the_same_bits_in_any_chunks(scattered):
    lai, ndvi = scattered
    whole = fifesim.relative_equivalent_noise(lai, ndvi)
    xr.testing.assert_identical(
        fifesim.relative_equivalent_noise(in_chunks(lai, {"y": 77, "x": 50}), in_chunks(ndvi, ODD_CHUNKS)), whole
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"increment": 0.0}, "increment must be positive, got 0"),
        ({"increment": 1e-6}, "take a larger one"),
        ({"min_count": 1}, "at least 2, got 1"),
    ],
)
def test_impossible_increments_are_refused(scattered, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.relative_equivalent_noise(*scattered, **options)


def test_noise_of_nothing_is_refused(scattered):
    with pytest.raises(ValueError, match="needs finite values"):
        fifesim.relative_equivalent_noise(scattered[0] * np.nan, scattered[1], slope=0.4)
