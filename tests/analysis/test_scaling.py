"""Scale effects compared with closed forms, brute force and scipy; densities, variograms and Sobol indices."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, check_place, check_raster_function, in_chunks, no_compute
from scipy import integrate, stats
from scipy.stats import qmc

import fifesim
from fifesim.analysis import scaling
from fifesim.analysis import scaling_labels as variogram_raster
from fifesim.analysis.scaling import sobol_indices, sobol_points
from fifesim.base import footprints
from fifesim.grids import grid as grids
from fifesim.ground.canopy import layers
from fifesim.ground.landscape import autoregression
from fifesim.ground.landscape.autoregression import streaming_field

# ------------------------------------------------------------------------------------------ variograms


def test_pixels_beyond_the_scene_are_ignored():
    """Two of three pixels of four cells lie inside the scene; their correlation is a triangle."""
    axis = footprints.axis_operator(
        footprints.Boxcar(4), cell_origin=0, cell_size=1, n_cells=10, pixel_origin=-2, pixel_size=4, n_pixels=3
    )
    triangle = np.maximum(4 - np.abs(np.arange(-5, 6)), 0) / 16
    np.testing.assert_allclose(scaling.weight_correlation(axis, 5), triangle, atol=1e-15)


# ------------------------------------------------------------------------------------------ densities


def test_reflected_density_has_all_its_mass_above_zero(monkeypatch):
    """
    Expected: twice scipy's density of the samples and their mirror images. Without reflection, part of the mass is
    below zero.
    """
    samples = np.abs(np.random.default_rng(8).normal(0, 1, 400))
    theirs = stats.gaussian_kde(np.r_[samples, -samples], bw_method=0.2 / np.r_[samples, -samples].std(ddof=1))
    at = np.linspace(0, 6, 901)
    found = scaling.gaussian_density(samples, at, 0.2, reflect=True)
    np.testing.assert_allclose(found, 2 * theirs(at), rtol=1e-10)
    assert np.trapezoid(found, at) == pytest.approx(1, abs=1e-6)
    assert np.trapezoid(scaling.gaussian_density(samples, at, 0.2), at) < 0.95
    np.testing.assert_array_equal(scaling.gaussian_density(samples, np.array([-0.1, -1e-9]), 0.2, reflect=True), 0.0)
    bandwidth = scaling.silverman_bandwidth(samples.std(ddof=1), stats.iqr(samples), 400)
    mine = scaling.gaussian_density(samples, at, bandwidth, reflect=True)
    np.testing.assert_allclose(scaling.sample_density(samples, at, reflect=True), mine, rtol=1e-12)
    monkeypatch.setattr(scaling, "_PART", 7)
    parts = scaling.gaussian_density(samples, at[:9], bandwidth, reflect=True)
    np.testing.assert_allclose(parts, mine[:9], rtol=1e-13)
    # The smaller of the two spreads is used; the standard deviation replaces an interquartile range of 0.
    assert scaling.silverman_bandwidth(1.0, 1.34 * 0.5, 32.0) == pytest.approx(0.9 * 0.5 / 2, rel=1e-12)
    assert scaling.silverman_bandwidth(1.0, 0.0, 1.0) == pytest.approx(0.9, rel=1e-12)


# ------------------------------------------------------------------------------------------ shares and indices


SOBOL = pd.read_csv(Path(__file__).parents[1] / "data" / "sobol_indices.csv", comment="#")


def ishigami(text, share):
    a, b = (float(each.partition("=")[2]) for each in text.split())
    x = np.pi * (2 * share - 1)
    return np.sin(x[..., 0]) + a * np.sin(x[..., 1]) ** 2 + b * x[..., 2] ** 4 * np.sin(x[..., 0])


def sobol_g(text, share):
    a = np.array([float(each) for each in text.removeprefix("a=").split()])
    return np.prod((np.abs(4 * share - 2) + a) / (1 + a), axis=-1)


@pytest.mark.parametrize("case", SOBOL["case"].unique())
def test_sobol_indices_agree_with_the_closed_form(case):
    rows = SOBOL[SOBOL["case"] == case]
    function = ishigami if case.startswith("ishigami") else sobol_g
    sets = sobol_points(qmc.Sobol(2 * len(rows), seed=1).random_base2(12))
    values = function(rows["parameters"].iloc[0], sets)
    np.testing.assert_allclose(values[:2].var(), rows["variance"].iloc[0], rtol=0.01)
    found = sobol_indices(values)
    for name in ("first", "total"):
        index, error = getattr(found, name), getattr(found, f"{name}_error")
        difference = np.abs(index - rows[name].to_numpy())
        assert (difference < 3 * error).all() and (difference < 0.01).all(), name


def test_sobol_indices_agree_with_salib():
    pytest.importorskip("SALib")
    from SALib.analyze import sobol

    sets = sobol_points(np.random.default_rng(4).random((512, 6)))
    values = ishigami("a=7 b=0.1", sets)
    # For each point, SALib expects A, then A_B of each input, then B.
    ordered = np.concatenate([values[:1], values[2:], values[1:2]]).T.ravel()
    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0, 1]] * 3}
    expected = sobol.analyze(problem, ordered, calc_second_order=False, seed=1)
    found = sobol_indices(values)
    np.testing.assert_allclose(found.first, expected["S1"], rtol=1e-9)
    np.testing.assert_allclose(found.total, expected["ST"], rtol=1e-9)


CELL = 30 / 9


def test_aggregate_is_the_mean_of_blocks(lai):
    """Cells of 30/9 m: 81 whole cells per pixel."""
    truth = check_raster_function(lambda lai: fifesim.aggregate(lai, 30.0), lai, quantity="lai")
    expected = lai.values.reshape(5, 9, 6, 9).mean(axis=(1, 3))
    np.testing.assert_allclose(truth, expected, rtol=1e-14)
    shares = float(truth.max() - truth.min()) / np.ptp(lai.values), float(truth.var()) / lai.values.var()
    kept = fifesim.scaling.share_kept(truth, lai)
    assert (float(kept["range"]), float(kept["variance"])) == pytest.approx(shares, rel=1e-12)
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
    assert float(truth[1, 1]) == pytest.approx(np.nanmean(lai.values[9:18, 9:18]), rel=1e-14)
    assert np.isfinite(fifesim.aggregate(lai, 30.0, min_valid=0.5)).all()


# ------------------------------------------------------------------------------------------ biases and densities


def cube(lai, spread=1.0):
    """Reflectances that vary with LAI: red decreases, near infrared increases."""
    bands = [0.12 - spread * 0.04 * (lai - 0.7), 0.25 + spread * 0.08 * (lai - 0.7)]
    out = grids.place(xr.concat(bands, "band").transpose("band", "y", "x"), grids.geobox(lai))
    out = out.assign_coords(wavelength=("band", [0.66, 0.83]))
    out.attrs = {"units": "1"}
    return out.rename("surface_reflectance")


def test_bias_of_linear_and_square_algorithms(lai):
    """The bias of a linear algorithm is 0, and of the square it is the variance, in the units of the algorithm."""
    with no_compute():
        lazy = fifesim.scaling.scale_bias(lambda array: 3 * array + 1, in_chunks(lai, ODD_CHUNKS))
    assert float(np.abs(lazy["bias"]).max()) < 1e-14
    assert lazy.sizes == {"y": 5, "x": 6}
    squared = fifesim.scaling.scale_bias(lambda array: (array**2).assign_attrs(units="m4 m-4"), lai)["bias"]
    np.testing.assert_allclose(squared, lai.values.reshape(5, 9, 6, 9).var(axis=(1, 3)), rtol=1e-9)
    assert squared.attrs["units"] == "m4 m-4"


def test_predicted_biases_agree_with_the_simulation(lai):
    """
    Third-order terms are smaller by the coefficient of variation, about 0.1. A canopy of LAI 20 absorbs the asymptotic
    fraction to within 1e-5.
    """
    bands = cube(lai, 0.5)
    simulated = fifesim.scaling.scale_bias(fifesim.ndvi, bands)["bias"]
    predicted = check_raster_function(fifesim.scaling.ndvi_bias, bands, quantity="ndvi_bias")
    np.testing.assert_allclose(predicted, simulated, rtol=0.25)
    assert float(np.abs(predicted - simulated).mean() / np.abs(simulated).mean()) < 0.08
    extinction = float(layers.extinction_coefficient(fifesim.fife_geometry().sza))
    simulated = fifesim.scaling.scale_bias(fifesim.fpar, lai)["bias"]
    predicted = check_raster_function(lambda lai: fifesim.scaling.fpar_bias(lai, extinction), lai, quantity="fpar_bias")
    assert (predicted < 0).all() and (simulated < 0).all()
    np.testing.assert_allclose(predicted, simulated, rtol=0.2)
    dense = fifesim.fpar(lai.copy(data=np.full(lai.shape, 20.0)), geometry=fifesim.fife_geometry())
    ratio = predicted / fifesim.scaling.fpar_bias(lai, extinction, fpar_inf=1.0)
    np.testing.assert_allclose(ratio, float(dense[0, 0]), rtol=3e-5)


def test_bands_of_ndvi_are_used_together(lai):
    """A gap in red alone has the same effect as a gap in both bands; linearity is that of the kernel in any chunks."""
    one, (red, nir) = cube(lai).copy(deep=True), cube(lai).values
    for chunks in ({}, ODD_CHUNKS):
        found = fifesim.scaling.ndvi_linearity(in_chunks(one, chunks))
        assert found == pytest.approx(scaling.linearity_correlation(red, nir), rel=1e-9)
    both = one.copy(deep=True)
    one[0, 0, 0] = both[:, 0, 0] = np.nan
    xr.testing.assert_equal(fifesim.scaling.ndvi_bias(one), fifesim.scaling.ndvi_bias(both))
    assert np.isfinite(fifesim.scaling.ndvi_bias(one)[0, 0])


def test_density_of_a_raster_ignores_chunks_and_layout(lai_with_hole):
    """
    The kernel extends beyond the range of the values, where a few percent of the mass lie.

    Bins of 1/2000 of the range and a bandwidth of 1/10 of it: relative error (bin / bandwidth)^2 / 24 of the curvature.
    """
    whole = fifesim.scaling.density(lai_with_hole, points=400)
    assert 0.95 < integrate.trapezoid(whole, whole["value"]) <= 1
    xr.testing.assert_identical(fifesim.scaling.density(in_chunks(lai_with_hole, ODD_CHUNKS), points=400), whole)
    line = lai_with_hole.stack(cell=("y", "x")).drop_vars(["cell", "y", "x", "spatial_ref"]).chunk(cell=1000)
    for array in (line, lai_with_hole.expand_dims(band=1).chunk(y=7), lai_with_hole.T):
        np.testing.assert_allclose(fifesim.scaling.density(array, points=400), whole, rtol=1e-12)
    values, at = lai_with_hole.values[np.isfinite(lai_with_hole)], whole["value"].values
    for reflect in (None, False):
        found = fifesim.scaling.density(lai_with_hole, points=400, reflect=reflect)
        exact = scaling.gaussian_density(values, at, found.attrs["bandwidth"], reflect=reflect is None)
        np.testing.assert_allclose(found, exact, rtol=1e-3)
    # Differences of LAI may be negative and are not reflected.
    about = lai_with_hole - float(lai_with_hole.mean())
    assert about.name == "lai" and float(fifesim.scaling.density(about)["value"][0]) < 0


# ------------------------------------------------------------------------------------------ variograms


def test_variogram_is_the_same_in_blocks_and_chunks(monkeypatch, lai_with_hole):
    """Constant rasters have no covariance."""
    whole = fifesim.scaling.autocovariance(lai_with_hole, 40.0)
    monkeypatch.setattr(variogram_raster, "_LAG_BLOCK", 16)
    parts = fifesim.scaling.autocovariance(lai_with_hole, 40.0)
    xr.testing.assert_allclose(parts, whole, rtol=0, atol=1e-13)
    whole = fifesim.scaling.variogram(lai_with_hole, 40.0)
    for chunks in (CHUNKS, ODD_CHUNKS):
        xr.testing.assert_identical(fifesim.scaling.variogram(in_chunks(lai_with_hole, chunks), 40.0), whole)
    found = fifesim.scaling.autocovariance(lai_with_hole.fillna(0) * 0 + 0.25, 30.0)
    assert int(found["count"].max()) == lai_with_hole.size
    np.testing.assert_allclose([found["covariance"], found["semivariance"]], 0, atol=1e-15)


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
    assert float(found["cells"]) == pytest.approx(float(gaussian.var()), rel=1e-10)
