"""Scale effects of rasters: block means, biases, densities and variograms in any chunks."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, check_place, check_raster_function, in_chunks, no_compute
from scipy import integrate

import fifesim
from fifesim.analysis import scaling
from fifesim.analysis import scaling_labels as variogram_raster
from fifesim.grids import grid as grids
from fifesim.ground.canopy import layers
from fifesim.ground.landscape import autoregression
from fifesim.ground.landscape.autoregression import streaming_field

CELL = 30 / 9


def test_aggregate_is_the_mean_of_blocks(lai):
    """Cells of 30/9 m: 81 whole cells per pixel."""
    truth = check_raster_function(lambda lai: fifesim.aggregate(lai, 30.0), lai, quantity="lai")
    expected = lai.values.reshape(5, 9, 6, 9).mean(axis=(1, 3))
    np.testing.assert_allclose(truth, expected, rtol=1e-14)
    assert grids.same_grid(grids.geobox(truth), grids.aligned_grid(grids.geobox(lai), 30.0))
    with no_compute():
        bands = fifesim.aggregate(in_chunks(cube(lai), ODD_CHUNKS), 30.0)
    check_place(bands, grids.geobox(lai).crs)
    np.testing.assert_array_equal(bands[1], fifesim.aggregate(cube(lai)[1], 30.0))


def test_cells_cut_by_blocks_are_weighted_by_area(lai):
    """Brute force: every cell is split into a hundred parts."""
    truth = fifesim.aggregate(lai, 25.0)
    parts = np.repeat(np.repeat(lai.values, 10, axis=0), 10, axis=1)
    expected = parts[: 5 * 75, : 7 * 75].reshape(5, 75, 7, 75).mean(axis=(1, 3))
    np.testing.assert_allclose(truth[:5, :7], expected, rtol=1e-12)


def test_block_with_too_few_valid_cells_is_missing(lai):
    lai[0:9, 0:2] = np.nan
    lai[9, 9] = np.nan
    truth = fifesim.aggregate(lai, 30.0)
    assert np.isnan(truth[0, 0]) and int(np.isnan(truth).sum()) == 1
    block = lai.values[9:18, 9:18]
    assert float(truth[1, 1]) == pytest.approx(np.nanmean(block), rel=1e-14)
    assert np.isfinite(fifesim.aggregate(lai, 30.0, min_valid=0.5)).all()


def test_blocks_can_be_weighted_by_a_line_spread_function(lai):
    """Expected: one weight matrix per axis, computed from the line spread function directly."""
    lsf = fifesim.instrument("TM", response="paper").line_spread
    weights = [
        [[lsf.cumulative(CELL * (j + 1) - 30 * (i + 0.5)) - lsf.cumulative(CELL * j - 30 * (i + 0.5)) for j in range(n)]
         for i in range(n // 9)]
        for n in lai.shape
    ]  # fmt: skip
    rows, columns = (np.array(each) / np.sum(each, axis=1, keepdims=True) for each in weights)
    found = fifesim.aggregate(lai, 30.0, lsf=lsf)
    np.testing.assert_allclose(found, rows @ lai.values @ columns.T, rtol=1e-12)


# ------------------------------------------------------------------------------------------ biases and densities


def cube(lai, spread=1.0):
    """Reflectances that vary with LAI: red decreases, near infrared increases."""
    bands = [0.12 - spread * 0.04 * (lai - 0.7), 0.25 + spread * 0.08 * (lai - 0.7)]
    out = grids.place(xr.concat(bands, "band").transpose("band", "y", "x"), grids.geobox(lai))
    out = out.assign_coords(wavelength=("band", [0.66, 0.83]))
    out.attrs = {"units": "1"}
    return out.rename("surface_reflectance")


def test_bias_of_a_linear_algorithm_is_zero(lai_with_hole):
    with no_compute():
        lazy = fifesim.scaling.scale_bias(lambda array: 3 * array + 1, in_chunks(lai_with_hole, ODD_CHUNKS))
    assert float(np.abs(lazy["bias"]).max()) < 1e-14
    assert lazy.sizes == {"y": 5, "x": 6}


def test_predicted_bias_of_ndvi_agrees_with_the_simulation(lai):
    """Coefficients of variation are about 0.1; third-order terms are smaller by this factor."""
    reflectance = cube(lai, 0.5)
    simulated = fifesim.scaling.scale_bias(fifesim.ndvi, reflectance)["bias"]
    predicted = check_raster_function(fifesim.scaling.ndvi_bias, reflectance, quantity="ndvi_bias")
    np.testing.assert_allclose(predicted, simulated, rtol=0.25)
    assert float(np.abs(predicted - simulated).mean() / np.abs(simulated).mean()) < 0.08


def test_predicted_bias_of_fpar_agrees_with_the_simulation(lai):
    """The third-order term is K times skewness and standard deviation of LAI, about 0.1."""
    extinction = float(layers.extinction_coefficient(fifesim.fife_geometry().sza))
    simulated = fifesim.scaling.scale_bias(fifesim.fpar, lai)["bias"]
    predicted = check_raster_function(lambda lai: fifesim.scaling.fpar_bias(lai, extinction), lai, quantity="fpar_bias")
    assert (predicted < 0).all() and (simulated < 0).all()
    np.testing.assert_allclose(predicted, simulated, rtol=0.2)


def test_bias_of_fpar_uses_the_asymptote_of_fpar(lai):
    """A canopy of LAI 20 absorbs the asymptotic fraction to within 1e-5."""
    dense = fifesim.fpar(lai.copy(data=np.full(lai.shape, 20.0)), geometry=fifesim.fife_geometry())
    ratio = fifesim.scaling.fpar_bias(lai, 0.5) / fifesim.scaling.fpar_bias(lai, 0.5, fpar_inf=1.0)
    np.testing.assert_allclose(ratio, float(dense[0, 0]), rtol=3e-5)


def test_white_noise_keeps_a_ninth_of_its_standard_deviation():
    """Pixels of 9 x 9 cells. The variance of 900 means is known to sqrt(2 / 900) = 5 %; tolerance four times this."""
    grid = fifesim.fife_site(CELL, window=((0, 270), (0, 270)))
    cells = fifesim.lai_scene(grid, arp=0.0, seed=1)
    kept = fifesim.scaling.share_kept(fifesim.aggregate(cells), cells)
    assert float(kept["variance"]) == pytest.approx(1 / 81, rel=0.2)
    assert 0 < float(kept["range"]) < 0.35
    pixels = fifesim.aggregate(cells).values
    shares = np.ptp(pixels) / np.ptp(cells.values), pixels.var() / cells.values.var()
    assert shares == pytest.approx((float(kept["range"]), float(kept["variance"])), rel=1e-12)


def test_density_of_a_raster_integrates_to_one_and_ignores_chunks(lai_with_hole):
    """The kernel extends beyond the range of the values, where a few percent of the mass lie."""
    whole = fifesim.scaling.density(lai_with_hole, points=400)
    assert 0.95 < integrate.trapezoid(whole, whole["value"]) <= 1
    xr.testing.assert_identical(fifesim.scaling.density(in_chunks(lai_with_hole, ODD_CHUNKS), points=400), whole)
    values = lai_with_hole.values[np.isfinite(lai_with_hole)]
    exact = scaling.gaussian_density(values, whole["value"].values, whole.attrs["bandwidth"], reflect=True)
    # Bins of 1/2000 of the range and a bandwidth of 1/10 of it: relative error (bin / bandwidth)^2 / 24 of the
    # curvature.
    np.testing.assert_allclose(whole, exact, rtol=1e-3)


def test_density_of_lai_agrees_with_its_distribution_at_zero():
    """
    Exact ranks for burned, grazed ground, whose density is 0.853 at the cut-off at 0; differences of LAI may be
    negative.
    """
    site = fifesim.fife_site(30 / 9, window=((0, 333), (0, 333)))
    lai = fifesim.lai_scene(site, arp=0.24, seed=1, method="periodic")
    known = fifesim.ground.lai_distribution("burned-grazed").pdf(0.0)
    assert known == pytest.approx(0.853, abs=0.01)
    assert float(fifesim.scaling.density(lai)[0]) == pytest.approx(known, rel=0.06)
    assert float(fifesim.scaling.density(lai, reflect=False)[0]) == pytest.approx(known / 2, rel=0.1)
    about = lai - 0.74
    assert about.name == "lai" and float(fifesim.scaling.density(about)["value"][0]) < 0


def test_cells_without_one_band_are_ignored_in_both(lai):
    """A gap in red alone has the same effect on the prediction as a gap in both bands."""
    one = cube(lai).copy(deep=True)
    both = one.copy(deep=True)
    one[0, 0, 0] = both[:, 0, 0] = np.nan
    xr.testing.assert_equal(fifesim.scaling.ndvi_bias(one), fifesim.scaling.ndvi_bias(both))
    assert np.isfinite(fifesim.scaling.ndvi_bias(one)[0, 0])
    # The bias has the units of the algorithm.
    squared = fifesim.scaling.scale_bias(lambda array: (array**2).assign_attrs(units="m4 m-4"), lai)
    assert squared["bias"].attrs["units"] == "m4 m-4"


def test_density_takes_any_dimensions(lai):
    """The layout of the values does not matter."""
    whole = fifesim.scaling.density(lai, points=50)
    line = lai.stack(cell=("y", "x")).drop_vars(["cell", "y", "x", "spatial_ref"])
    for array in (line, line.chunk(cell=1000), lai.expand_dims(band=1).chunk(y=7), lai.T):
        np.testing.assert_allclose(fifesim.scaling.density(array, points=50), whole, rtol=1e-12)


def test_linearity_of_rasters_equals_the_kernel(lai):
    red, nir = cube(lai).values
    for chunks in ({}, ODD_CHUNKS):
        found = fifesim.scaling.ndvi_linearity(in_chunks(cube(lai), chunks))
        assert found == pytest.approx(scaling.linearity_correlation(red, nir), rel=1e-9)


# ------------------------------------------------------------------------------------------ variograms


def test_autocovariance_is_the_same_in_blocks(monkeypatch, lai_with_hole):
    whole = fifesim.scaling.autocovariance(lai_with_hole, 30.0)
    monkeypatch.setattr(variogram_raster, "_LAG_BLOCK", 16)
    parts = fifesim.scaling.autocovariance(lai_with_hole, 30.0)
    np.testing.assert_array_equal(parts["count"], whole["count"])
    np.testing.assert_allclose(parts["covariance"], whole["covariance"], atol=1e-13)
    np.testing.assert_allclose(parts["semivariance"], whole["semivariance"], atol=1e-13)


def test_variogram_is_identical_in_any_chunks(monkeypatch, lai_with_hole):
    monkeypatch.setattr(variogram_raster, "_LAG_BLOCK", 16)
    whole = fifesim.scaling.variogram(lai_with_hole, 40.0)
    for chunks in (CHUNKS, ODD_CHUNKS):
        xr.testing.assert_identical(fifesim.scaling.variogram(in_chunks(lai_with_hole, chunks), 40.0), whole)


@pytest.fixture(scope="module")
def gaussian():
    """An autoregressive field of unit variance at arp 0.24, whose covariance is known: 1.4 km square."""
    grid = fifesim.fife_site(CELL, window=((0, 420), (0, 420)))
    lai = fifesim.lai_scene(grid, arp=0.24, seed=5)
    return lai.copy(data=streaming_field(5, 0.24, 0, 0, (420, 420)))


def test_variogram_of_the_autoregressive_field_is_analytic(gaussian):
    """
    Correlation and practical range agree within the sampling error.

    The standard error of a covariance is about sqrt(2 integral scale / cells). The squared correlation sums to 60 cells
    over all lags, so it is sqrt(2 x 60 / 176400) = 0.026; the tolerance is four times this.
    """
    found = fifesim.scaling.variogram(gaussian, 40.0)
    expected = autoregression.autocorrelation(0.24, np.arange(found.sizes["lag"]))
    np.testing.assert_allclose(found["correlation"], np.broadcast_to(expected, (2, expected.size)), atol=0.1)
    assert found.attrs["variance"] == pytest.approx(1, abs=0.1)
    np.testing.assert_allclose(found["practical_range"], autoregression.correlation_length(0.24, CELL), rtol=0.25)
    np.testing.assert_allclose(found["semivariance"], found.attrs["variance"] * (1 - found["correlation"]), atol=0.03)


@pytest.mark.parametrize("lsf", [None, fifesim.instrument("TM").line_spread])
def test_predicted_variance_agrees_with_the_simulation(gaussian, lsf):
    """The covariance comes from the same scene, so that only the borders differ: 46 pixels along an edge, 2 %."""
    found = fifesim.scaling.regularized_variance(gaussian, 30.0, lsf)
    assert float(found["predicted"]) == pytest.approx(float(found["simulated"]), rel=0.05)
    assert float(found["predicted"]) < 0.5 * float(found["cells"])
    assert float(found["cells"]) == pytest.approx(float(gaussian.var()), rel=1e-10)


def test_constant_rasters_have_zero_covariance(lai):
    found = fifesim.scaling.autocovariance(lai * 0 + 0.25, 30.0)
    assert int(found["count"].max()) == lai.size
    np.testing.assert_allclose(found["covariance"], 0, atol=1e-15)
    np.testing.assert_allclose(found["semivariance"], 0, atol=1e-15)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda lai: fifesim.aggregate(lai, 500.0), "no pixel of 500 x 500 m fits"),
        (lambda lai: fifesim.scaling.fpar_bias(lai, 0.57, 94), r"fpar_inf must be in \(0, 1\]"),
        (lambda lai: fifesim.scaling.autocovariance(lai, 100.0), r"at most half of the raster \(75 m\), got 100 m"),
        (lambda lai: fifesim.scaling.autocovariance(lai * np.nan, 30.0), "no valid cells"),
        # Constant values are valid, but have neither correlation nor density.
        (lambda lai: fifesim.scaling.variogram(lai * 0 + 0.3, 20), "a correlation needs values that vary"),
        (lambda lai: fifesim.scaling.density(lai * 0), "a density needs values that vary"),
        (lambda lai: fifesim.scaling.density(lai - 0.74, reflect=True), "at least 0 to be reflected"),
    ],
)
def test_invalid_scales_are_refused(lai, call, message):
    with pytest.raises(ValueError, match=message):
        call(lai)
