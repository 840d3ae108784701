"""Regression of labelled rasters: pairs of pixels, relative equivalent noise, and inverted maps."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks

import fifesim
from fifesim.grids import grid as grids


def test_regression_is_identical_in_any_chunks(pair):
    y, x = pair
    y[3:5, 2] = np.nan
    whole = fifesim.regress(y, x)
    for one, other in [(CHUNKS, CHUNKS), (ODD_CHUNKS, CHUNKS), (ODD_CHUNKS, {}), ({}, {"y": 1, "x": 54})]:
        assert fifesim.regress(in_chunks(y, one), in_chunks(x, other)) == whole
    y[0] = x[0] = np.nan
    assert fifesim.regress(y, x).n == 44 * 54 - 2


# ------------------------------------------------------------------------------------------ pairs


CELL = 30 / 9


def test_pixels_are_paired_by_location(pair):
    """Rasters that cover different ground are cropped to their common area."""
    y, x = pair
    cut = fifesim.regress(y[3:40, :50], x[:, 7:])
    assert cut == fifesim.regress(y[3:40, 7:50], x[3:40, 7:50])


def test_pixels_can_be_paired_by_row_and_column(pair):
    y, x = pair
    moved = grids.place(x, fifesim.fife_site(CELL, window=((91, 136), (180, 234))))
    assert fifesim.regress(y, moved, pair="index") == fifesim.regress(y, x)
    assert fifesim.regress(y, moved).r2 < 0.5
    common = fifesim.regress(y[5:20, 11:30], x[5:20, 11:30])
    assert fifesim.regress(y[5:40, :30], x[:20, 11:]) == common
    cropped = fifesim.regress(y[5:25, :30], x[:20, 11:41], pair="index")
    assert fifesim.regress(y[5:40, :30], x[:20, 11:], pair="index") == cropped
    assert fifesim.regress(y, moved).n == 44 * 54


# ------------------------------------------------------------------------------------------ noise


def test_equivalent_noise_of_a_line_matches_the_closed_form(scattered):
    """
    Closed form, including the variation of the line within an increment; 900 pairs determine a deviation to 2.4 %.
    """
    lai, ndvi = scattered
    found = fifesim.relative_equivalent_noise(lai, ndvi, 0.02)
    expected = np.hypot(0.03, 0.3 * 0.02 / np.sqrt(12)) / (0.3 * found["increment"])
    np.testing.assert_allclose(found["ren"], expected, rtol=0.12)
    assert found.attrs["slope"] == pytest.approx(0.3, rel=0.01)
    assert int(found["count"].sum()) == lai.size


def test_equivalent_noise_is_identical_in_any_chunks(scattered):
    lai, ndvi = scattered
    whole = fifesim.relative_equivalent_noise(lai, ndvi)
    xr.testing.assert_identical(
        fifesim.relative_equivalent_noise(in_chunks(lai, {"y": 77, "x": 50}), in_chunks(ndvi, ODD_CHUNKS)), whole
    )


# ------------------------------------------------------------------------------------------ inversion


@pytest.mark.filterwarnings("ignore:inversion_error is deprecated:FutureWarning")
def test_inversion_interval_has_its_coverage_and_the_error_is_the_residual(scattered):
    """
    For the fitted pixels, the bias is 0 and the RMSE is the residual deviation apart from n - 2; 95 % lie within the
    interval.
    """
    lai, ndvi = scattered[0] + 1.0, scattered[1]  # no value is clipped
    fit = fifesim.regress(lai, ndvi)
    estimate = fifesim.invert(ndvi, fit)
    error = fifesim.inversion_error(estimate, lai)
    assert float(error["bias"]) == pytest.approx(0, abs=1e-10)
    assert float(error["rmse"]) == pytest.approx(fit.residual_deviation * np.sqrt((fit.n - 2) / fit.n), rel=1e-9)
    assert float(error["coverage"]) == pytest.approx(0.95, abs=0.02)
    assert int(error["n"]) == lai.size
    lazy = fifesim.invert(in_chunks(ndvi, {"y": 50, "x": 77}), fit)
    assert lazy.fifesim.inversion_error(in_chunks(lai, {"x": 60})).identical(error)
    with pytest.warns(FutureWarning, match="use fifesim.score"):
        alone = fifesim.inversion_error(lai + 0.25, lai)
    assert (float(alone["bias"]), float(alone["rmse"])) == pytest.approx((0.25, 0.25), rel=1e-12)
    assert "coverage" not in alone


def test_inverted_map_is_lazy_labelled_and_on_the_line(scattered):
    lai, ndvi = scattered[0] + 1.0, scattered[1]  # no value is clipped
    fit = fifesim.regress(lai, ndvi)
    lazy = fifesim.invert(in_chunks(ndvi, ODD_CHUNKS | {"y": 100, "x": 99}), fit, level=0.5)
    assert lazy["low"].chunks is not None
    np.testing.assert_array_equal(lazy["lai"], fit.predict(ndvi.values))
    np.testing.assert_array_equal(lazy["high"], fit.prediction_interval(ndvi.values, 0.5)[1])
    assert lazy["lai"].attrs["standard_name"] == "leaf_area_index"
    assert "standard_name" not in lazy["low"].attrs
    assert lazy["lai"].rio.crs.to_epsg() == 26914


def test_values_outside_the_physical_range_are_clipped_and_flagged(scattered):
    """NDVI on a line through LAI 0.2 to 2.2, with a mean of 0.46 and a standard deviation of 0.18."""
    lai, ndvi = scattered
    fit = fifesim.regress(lai, ndvi)
    odd = ndvi.copy(deep=True)
    odd[0, :6] = [-0.4, 0.97, 12.0, np.nan, 0.46, 1.02]
    for index in (odd, in_chunks(odd, ODD_CHUNKS | {"y": 100, "x": 99})):
        estimate = fifesim.invert(index, fit)
        np.testing.assert_array_equal(estimate["flag"][0, :6], [2, 0, 3, -1, 0, 1])
        np.testing.assert_array_equal(estimate["lai"][0, [0, 2, 3]], [0.0, 20.0, np.nan])
        np.testing.assert_array_equal(estimate["lai"][0, 4:6], fit.predict(odd.values[0, 4:6]))
        np.testing.assert_array_equal(estimate["low"][0, :4], [0.0, fit.prediction_interval(0.97)[0], 20.0, np.nan])
        assert (estimate["low"] >= 0).sum() == (estimate["lai"] <= estimate["high"]).sum() == lai.size - 1
        assert estimate["flag"].dtype == np.int8 and estimate["flag"].chunks == index.chunks
    attrs = estimate["flag"].attrs
    meanings = dict(zip(attrs["flag_values"], attrs["flag_meanings"].split(), strict=True))
    assert meanings[2] == "clipped_to_minimum" and meanings[1] == "extrapolated"
    fpar = fifesim.invert(odd, replace(fit, y_name=""), "fpar")["fpar"]
    assert float(fpar.min()) == 0.0 and float(fpar.max()) == 1.0
    clipped = estimate["lai"][1:].fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    assert np.isfinite(clipped).all()


@pytest.mark.filterwarnings("ignore:inversion_error is deprecated:FutureWarning")
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda y, x: fifesim.regress(y[:10], x[20:]), "do not overlap"),
        (lambda y, x: fifesim.relative_equivalent_noise(y, x, increment=0.0), "increment must be positive, got 0"),
        (lambda y, x: fifesim.relative_equivalent_noise(y, x, increment=1e-6), "take a larger one"),
        (lambda y, x: fifesim.relative_equivalent_noise(y, x, min_count=1), "at least 2, got 1"),
        (lambda y, x: fifesim.relative_equivalent_noise(y * np.nan, x, slope=0.4), "needs finite values"),
        (lambda y, x: fifesim.invert(x, fifesim.regress(y, x), "ndvi"), "quantity must be 'lai' or 'fpar'"),
        (lambda y, x: fifesim.inversion_error(y * np.nan, y), "no pixel has both"),
        *(
            (
                lambda y, x, fill=fill: fifesim.regress(y.where(y > y.min(), fill), x),
                f"a value of {fill:g} marks missing",
            )
            for fill in (-999.0, -9999.0, -99999.0, -32768.0, 65535.0)
        ),
        *(
            (lambda y, x, names=names: fifesim.inversion_error(xr.Dataset(dict.fromkeys(names, y)), y), "one variable")
            for names in (["lai"], ["low", "high"], ["lai", "low", "high", "other"])
        ),
    ],
)
def test_invalid_pairs_and_estimates_are_rejected(pair, call, message):
    with pytest.raises(ValueError, match=message):
        call(*pair)
