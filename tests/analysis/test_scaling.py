"""Scale invariance against closed forms and quadrature."""

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, check_raster_function, in_chunks, no_compute
from scipy import integrate, stats

import fifesim
from fifesim.analysis import density, scaling
from fifesim.analysis.indices import normalized_difference
from fifesim.ground.canopy import absorption
from fifesim.rasters import grid as grids

CELL = 30 / 9


def cube(lai, spread=1.0):
    """Reflectances that vary with LAI, red down and near infrared up."""
    bands = [0.12 - spread * 0.04 * (lai - 0.7), 0.25 + spread * 0.08 * (lai - 0.7)]
    out = grids.place(xr.concat(bands, "band").transpose("band", "y", "x"), grids.geobox(lai))
    out = out.assign_coords(wavelength=("band", [0.66, 0.83]))
    out.attrs = {"units": "1"}
    return out.rename("surface_reflectance")


@pytest.mark.parametrize(("red", "nir"), [(0.08, 0.3), (0.2, 0.2), (0.3, 0.1)])
def test_hessian_is_the_second_difference(red, nir):
    """Central differences with a step of 1e-4 are good to 1e-8 of derivatives of the order of 1/S^4 = 40 at most."""
    h, found = 1e-4, scaling.ndvi_hessian(red, nir)
    step = {0: (h, 0.0), 1: (0.0, h)}
    for i in range(2):
        for j in range(2):
            (a, b), (c, d) = step[i], step[j]
            difference = sum(
                sign * float(normalized_difference(nir + s * b + t * d, red + s * a + t * c))
                for s, t, sign in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
            ) / (4 * h * h)
            assert found[i, j] == pytest.approx(difference, abs=1e-4)


def test_beer_bias_is_the_leading_term_of_the_exact_one():
    """For normal LAI the mean of exp(-K L) is exp(-K m + K^2 s^2 / 2), whose next term is K^2 s^2 / 4 of the first."""
    mean, deviation, extinction, limit = 1.2, 0.1, 0.57, 0.94
    exact = limit * (np.exp(-extinction * mean) - np.exp(-extinction * mean + (extinction * deviation) ** 2 / 2))
    found = scaling.beer_bias(mean, deviation**2, extinction, limit)
    assert found == pytest.approx(exact, rel=(extinction * deviation) ** 2 / 2)
    assert found < 0


def test_ndvi_bias_of_a_mixture_of_two_grounds():
    """Exact sums over two equal halves; the third order vanishes by symmetry, the fourth is of the order (d/S)^2."""
    red, nir, d = np.array([0.10, 0.12]), np.array([0.24, 0.20]), 1.0
    exact = normalized_difference(nir, red).mean() - normalized_difference(nir.mean(), red.mean())
    covariance = np.cov(np.stack([red, nir]), ddof=0) * d
    found = scaling.second_order_bias(scaling.ndvi_hessian(red.mean(), nir.mean()), covariance)
    assert found == pytest.approx(exact, rel=0.02)


def test_linearity_is_zero_where_the_sum_is_constant():
    """Then the denominator does not vary, and NDVI is linear; with a little noise in it the correlation is small."""
    rng = np.random.default_rng(3)
    red = rng.uniform(0.05, 0.15, 4000)
    assert np.isnan(scaling.ndvi_linearity(red, 0.4 - red)) or abs(scaling.ndvi_linearity(red, 0.4 - red)) < 1e-6
    noise = rng.normal(0, 0.01, red.size)
    # Half of the noise to each band: the difference does not know it. Four standard errors of 1/sqrt(n).
    assert abs(scaling.ndvi_linearity(red + noise / 2, 0.4 - red + noise / 2)) < 4 / np.sqrt(red.size)


def test_linearity_agrees_with_numpy(lai):
    red, nir = cube(lai).values
    expected = np.corrcoef((nir - red).ravel(), (1 / (nir + red)).ravel())[0, 1]
    assert scaling.ndvi_linearity(red, nir) == pytest.approx(expected, rel=1e-12)
    for chunks in ({}, ODD_CHUNKS):
        assert fifesim.ndvi_linearity(in_chunks(cube(lai), chunks)) == pytest.approx(expected, rel=1e-9)


def test_bias_of_a_linear_algorithm_is_zero(lai_with_hole):
    with no_compute():
        lazy = fifesim.scale_bias(lambda array: 3 * array + 1, in_chunks(lai_with_hole, ODD_CHUNKS))
    assert float(np.abs(lazy["bias"]).max()) < 1e-14
    assert lazy.sizes == {"y": 5, "x": 6}


def test_predicted_bias_of_ndvi_is_the_simulated_one(lai):
    """Coefficients of variation of a tenth: the third order is that much less."""
    reflectance = cube(lai, 0.5)
    simulated = fifesim.scale_bias(fifesim.ndvi, reflectance)["bias"]
    predicted = check_raster_function(fifesim.ndvi_bias, reflectance, quantity="ndvi_bias")
    np.testing.assert_allclose(predicted, simulated, rtol=0.25)
    assert float(np.abs(predicted - simulated).mean() / np.abs(simulated).mean()) < 0.08


def test_predicted_bias_of_fpar_is_the_simulated_one(lai):
    """The third order is K times the skewness and deviation of LAI, a tenth."""
    extinction = float(absorption.extinction_coefficient(fifesim.fife_geometry().sza))
    simulated = fifesim.scale_bias(fifesim.fpar, lai)["bias"]
    predicted = check_raster_function(lambda lai: fifesim.fpar_bias(lai, extinction), lai, quantity="fpar_bias")
    assert (predicted < 0).all() and (simulated < 0).all()
    np.testing.assert_allclose(predicted, simulated, rtol=0.2)


def test_white_noise_keeps_a_ninth_of_its_deviation():
    """Of 9 x 9 cells; 900 means, whose variance is known to sqrt(2 / 900) = 5 %, four of it."""
    grid = fifesim.fife_site(CELL, window=((0, 270), (0, 270)))
    cells = fifesim.lai_scene(grid, arp=0.0, seed=1)
    kept = fifesim.share_kept(fifesim.aggregate(cells), cells)
    assert float(kept["variance"]) == pytest.approx(1 / 81, rel=0.2)
    assert 0 < float(kept["range"]) < 0.35
    assert scaling.share_kept(fifesim.aggregate(cells), cells) == pytest.approx(
        (float(kept["range"]), float(kept["variance"])), rel=1e-12
    )


def test_share_kept_stays_lazy(lai_with_hole):
    with no_compute():
        lazy = fifesim.share_kept(fifesim.aggregate(in_chunks(lai_with_hole, CHUNKS)), in_chunks(lai_with_hole, CHUNKS))
    assert lazy["range"].chunks is not None
    assert 0 < float(lazy["range"]) < 1


def test_density_agrees_with_scipy():
    samples = np.random.default_rng(4).gamma(3.0, 0.3, 300)
    at = np.linspace(0, 3, 50)
    theirs = stats.gaussian_kde(samples, bw_method=0.1 / samples.std(ddof=1))
    np.testing.assert_allclose(density.gaussian_density(samples, at, 0.1), theirs(at), rtol=1e-10)
    weights = np.random.default_rng(5).integers(1, 9, 300)
    theirs = stats.gaussian_kde(np.repeat(samples, weights), bw_method=0.1 / np.repeat(samples, weights).std(ddof=1))
    np.testing.assert_allclose(density.gaussian_density(samples, at, 0.1, weights), theirs(at), rtol=1e-10)


def test_density_of_samples_takes_the_rule_of_thumb():
    samples = np.random.default_rng(6).normal(0, 1, 500)
    spread = min(samples.std(ddof=1), stats.iqr(samples) / 1.34)
    theirs = stats.gaussian_kde(samples, bw_method=0.9 * spread * 500**-0.2 / samples.std(ddof=1))
    at = np.linspace(-3, 3, 40)
    np.testing.assert_allclose(density.sample_density(samples, at), theirs(at), rtol=1e-10)


def test_density_of_a_raster_integrates_to_one_and_ignores_chunks(lai_with_hole):
    """The kernel reaches past the range of the values on both sides, where a few hundredths of the mass lie."""
    whole = fifesim.density(lai_with_hole, points=400)
    assert 0.9 < integrate.trapezoid(whole, whole["value"]) <= 1
    xr.testing.assert_identical(fifesim.density(in_chunks(lai_with_hole, ODD_CHUNKS), points=400), whole)
    values = lai_with_hole.values[np.isfinite(lai_with_hole)]
    exact = density.gaussian_density(values, whole["value"].values, whole.attrs["bandwidth"])
    # Bins of 1/2000 of the range beside a bandwidth of a tenth of it: (bin / bandwidth)^2 / 24 of the curvature.
    np.testing.assert_allclose(whole, exact, rtol=1e-3)


def test_values_that_do_not_vary_have_no_density(lai):
    with pytest.raises(ValueError, match="needs values that vary"):
        fifesim.density(lai * 0)
    with pytest.raises(ValueError, match="at least 2 values"):
        density.sample_density(np.array([1.0, np.nan]), np.array([0.0]))


def test_cells_that_lack_one_band_count_in_neither(lai):
    """A gap in red alone changes the prediction as a gap in both bands does."""
    one = cube(lai).copy(deep=True)
    both = one.copy(deep=True)
    one[0, 0, 0] = both[:, 0, 0] = np.nan
    xr.testing.assert_equal(fifesim.ndvi_bias(one), fifesim.ndvi_bias(both))
    assert np.isfinite(fifesim.ndvi_bias(one)[0, 0])


def test_bias_has_the_units_of_its_algorithm(lai):
    def squared(array):
        return (array**2).assign_attrs(units="m4 m-4")

    assert fifesim.scale_bias(squared, lai)["bias"].attrs["units"] == "m4 m-4"


@pytest.mark.parametrize(
    ("numbers", "message"),
    [((-0.57, 0.94), "extinction must be positive"), ((0.57, 94), r"fpar_inf must be in \(0, 1\]")],
)
def test_impossible_beer_laws_are_refused(lai, numbers, message):
    with pytest.raises(ValueError, match=message):
        fifesim.fpar_bias(lai, *numbers)
