"""Maps by a fitted line, and their error against the truth."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks

import fifesim

pytestmark = pytest.mark.filterwarnings("ignore:inversion_error is deprecated:FutureWarning")


def test_inversion_holds_its_share_and_has_the_residual_as_error(scattered):
    """On the pixels that it was fitted to: no bias, and the residual deviation but for n - 2; 95 % within 4 errors."""
    lai, ndvi = scattered[0] + 1.0, scattered[1]  # so that no value is clipped
    fit = fifesim.regress(lai, ndvi)
    estimate = fifesim.invert(ndvi, fit)
    error = fifesim.inversion_error(estimate, lai)
    assert float(error["bias"]) == pytest.approx(0, abs=1e-10)
    assert float(error["rmse"]) == pytest.approx(fit.residual_deviation * np.sqrt((fit.n - 2) / fit.n), rel=1e-9)
    assert float(error["coverage"]) == pytest.approx(0.95, abs=0.02)
    assert int(error["n"]) == lai.size
    assert estimate.fifesim.inversion_error(lai).identical(error)


def test_map_is_lazy_labelled_and_as_the_line_says(scattered):
    lai, ndvi = scattered[0] + 1.0, scattered[1]  # so that no value is clipped
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
    meanings = dict(
        zip(estimate["flag"].attrs["flag_values"], estimate["flag"].attrs["flag_meanings"].split(), strict=True)
    )
    assert meanings[2] == "clipped_to_minimum" and meanings[1] == "extrapolated"
    fpar = fifesim.invert(odd, replace(fit, y_name=""), "fpar")["fpar"]
    assert float(fpar.min()) == 0.0 and float(fpar.max()) == 1.0


def test_a_clipped_map_goes_on_to_reflectance(scattered):
    lai, ndvi = scattered
    odd = ndvi.copy(deep=True)
    odd[0, :2] = [-0.4, 12.0]
    estimate = fifesim.invert(odd, fifesim.regress(lai, ndvi))
    reflectance = estimate["lai"].fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    assert np.isfinite(reflectance).all()


def test_error_of_a_map_alone_and_of_nothing(scattered):
    lai, _ = scattered
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
def test_impossible_inversion_is_refused(scattered, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.invert(scattered[1], fifesim.regress(*scattered), **options)


def test_error_of_what_is_no_estimate_is_refused(scattered):
    estimate = fifesim.invert(scattered[1], fifesim.regress(*scattered))
    for wrong in (estimate[["lai"]], estimate[["low", "high"]], estimate.assign(other=estimate["lai"])):
        with pytest.raises(ValueError, match="one variable with low and high"):
            fifesim.inversion_error(wrong, scattered[0])


def test_error_is_the_same_to_the_bit_in_any_chunks(scattered):
    lai, ndvi = scattered
    estimate = fifesim.invert(ndvi, fifesim.regress(lai, ndvi))
    whole = fifesim.inversion_error(estimate, lai)
    lazy = fifesim.invert(in_chunks(ndvi, {"y": 50, "x": 77}), fifesim.regress(lai, ndvi))
    xr.testing.assert_identical(fifesim.inversion_error(lazy, in_chunks(lai, {"x": 60})), whole)
