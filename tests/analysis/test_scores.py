"""Scores against quadrature and brute force, also for labelled estimates with uncertainty."""

import warnings

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from lazy import in_chunks
from scipy.integrate import quad
from scipy.stats import norm

import fifesim
from fifesim.analysis import scores

LEVELS = [0.5, 0.8, 0.95]

# The estimates of these tests are the truth plus an independent error, so that their highest values are too high.
pytestmark = pytest.mark.filterwarnings("ignore:the estimate of lai is wrong")


@pytest.mark.parametrize(("mean", "sd", "truth"), [(0.2, 1.2, -1.9), (-1.4, 0.3, 0.4), (1.0, 0.5, 1.0)])
def test_scores_of_a_normal_distribution_agree_with_quadrature(mean, sd, truth):
    forecast = norm(mean, sd)
    below = quad(lambda x: forecast.cdf(x) ** 2, -30, truth, epsabs=1e-13)[0]
    above = quad(lambda x: forecast.sf(x) ** 2, truth, 30, epsabs=1e-13)[0]
    assert scores.normal_crps(mean, sd, truth) == pytest.approx(below + above, rel=1e-10)
    assert scores.normal_pit(mean, sd, truth) == pytest.approx(forecast.cdf(truth), rel=1e-12)
    # Without spread, the score is the absolute error.
    np.testing.assert_array_equal(scores.normal_crps([mean, np.nan], 0.0, truth), [abs(mean - truth), np.nan])


def test_ensemble_scores_agree_with_sums_over_all_pairs():
    rng = np.random.default_rng(1)
    members, truth = rng.normal(0, 1, (5, 7)), rng.normal(0, 1, 5)
    pairs = np.abs(members[:, :, None] - members[:, None, :]).sum(axis=(1, 2))
    error = np.abs(members - truth[:, None]).mean(axis=1)
    np.testing.assert_allclose(scores.ensemble_crps(members, truth), error - pairs / (2 * 49), rtol=1e-12)
    np.testing.assert_allclose(scores.ensemble_crps(members, truth, fair=True), error - pairs / (2 * 42), rtol=1e-12)
    np.testing.assert_allclose(
        scores.ensemble_pit(members, truth), ((members < truth[:, None]).sum(axis=1) + 0.5) / 8, rtol=1e-12
    )
    assert np.isnan(scores.ensemble_pit([np.nan, 1.0], 0.0)) and np.isnan(scores.ensemble_crps([np.nan, 1.0], 0.0))


def test_interval_score_of_a_normal_has_a_closed_form():
    """2 pdf(q) / alpha for each of the two ends, at the quantiles; narrower or shifted intervals have higher scores."""
    truth, half = norm.ppf((np.arange(20000) + 0.5) / 20000), norm.ppf(0.9)
    best = scores.interval_score(-half, half, truth, 0.8).mean()
    assert best == pytest.approx(4 / 0.2 * norm.pdf(half), rel=1e-3)
    assert scores.interval_score(-0.8 * half, 0.8 * half, truth, 0.8).mean() > best + 0.01
    assert scores.interval_score(0.2 - half, 0.2 + half, truth, 0.8).mean() > best + 0.01


@pytest.fixture(scope="module")
def truth():
    rng = np.random.default_rng(2)
    values = rng.normal(2, 0.8, (12, 30, 25))
    values[0, 3, 4] = np.nan
    coords = {"landscape": np.arange(12), "y": 30.0 * np.arange(30)[::-1], "x": 30.0 * np.arange(25)}
    return xr.DataArray(values, coords, ("landscape", "y", "x"), "lai", {"units": "1"})


@pytest.fixture(scope="module")
def estimate(truth):
    """Estimates whose stated standard deviation is too small by a sixth and whose bias is 0.05."""
    rng = np.random.default_rng(3)
    value = truth + rng.normal(0.05, 0.3, truth.shape)
    sd = xr.full_like(value, 0.25)
    half = xr.DataArray(norm.ppf(0.5 + np.array(LEVELS) / 2), {"level": LEVELS}, "level")
    return xr.Dataset({"lai": value, "sd": sd, "low": value - half * sd, "high": value + half * sd})


def test_scores_agree_with_plain_numpy(estimate, truth):
    found = estimate.fifesim.score(truth)
    known = np.isfinite(truth.values)
    error = (estimate["lai"] - truth).values[known]
    assert int(found.n) == known.sum() == 12 * 30 * 25 - 1
    assert float(found.bias) == pytest.approx(error.mean(), rel=1e-12)
    assert float(found.rmse) == pytest.approx(np.sqrt((error**2).mean()), rel=1e-12)
    assert float(found.crps) == pytest.approx(scores.normal_crps(error, 0.25, 0).mean(), rel=1e-12)
    for number, level in enumerate(LEVELS):
        half = norm.ppf(0.5 + level / 2) * 0.25
        assert float(found.coverage[number]) == pytest.approx((np.abs(error) <= half).mean(), rel=1e-12)
        assert float(found.width[number]) == pytest.approx(2 * half, rel=1e-12)
        expected = scores.interval_score(error - half, error + half, 0.0, level).mean()
        assert float(found.interval_score[number]) == pytest.approx(expected, rel=1e-12)
    histogram = np.histogram(norm.cdf(-error / 0.25), np.linspace(0, 1, 11), density=True)[0]
    np.testing.assert_allclose(found.pit, histogram, rtol=1e-12)


def test_scores_are_identical_in_any_chunks(estimate, truth):
    """Also for one map, which has intervals by level."""
    pieces, whole = {"landscape": 7, "y": 17, "x": 11}, estimate.fifesim.score(truth)
    lazy = estimate.map(lambda each: each.chunk({dim: pieces.get(dim, -1) for dim in each.dims}))
    xr.testing.assert_identical(lazy.fifesim.score(truth.chunk(pieces)), whole)
    one = estimate.isel(landscape=1, drop=True).fifesim.score(truth.isel(landscape=1, drop=True), pair="index")
    xr.testing.assert_identical(one, estimate.isel(landscape=[1]).fifesim.score(truth.isel(landscape=[1])))


def test_ensembles_are_scored_from_their_members(truth):
    truth = truth.isel(landscape=1, drop=True)
    noise = np.random.default_rng(4).normal(0, 0.3, (9, *truth.shape))
    members = (truth + xr.DataArray(noise, dims=("member", *truth.dims))).transpose("member", ...).rename("lai")
    whole = members.fifesim.score(truth, pair="index")
    expected = scores.ensemble_crps(members.transpose(..., "member").values, truth.values).mean()
    assert float(whole.crps) == pytest.approx(expected, rel=1e-12)
    for pieces in ({"member": 4}, {"member": -1, "y": 7}, {"member": 1, "x": 11}):
        xr.testing.assert_identical(members.chunk(pieces).fifesim.score(truth, pair="index"), whole)


def test_groups_are_scored_separately(estimate, truth):
    """Pixels of no class are left out, and the upper edge belongs to the last bin."""
    west = estimate.isel(x=slice(10)).fifesim.score(truth.isel(x=slice(10)))
    for other in (7.0, np.nan):
        found = estimate.fifesim.score(truth, xr.where(truth["x"] < 300, 3.0, other).rename("cover"))
        assert found.cover.values.tolist() == ([3.0, 7.0] if other == 7 else [3.0])
        xr.testing.assert_allclose(found.isel(cover=0, drop=True), west[list(found.data_vars)], rtol=1e-12)
    bins = estimate.fifesim.score(truth, [0, 1, 2, 5])
    assert bins.lai_bin.values.tolist() == [0.5, 1.5, 3.5]
    inside = ((truth >= 1) & (truth < 2)).values
    assert int(bins.n[1]) == inside.sum()
    assert float(bins.bias[1]) == pytest.approx(float((estimate["lai"] - truth).values[inside].mean()), rel=1e-12)
    edge = xr.DataArray([[0.0, 1.0, 2.0]], dims=("pixel", "x"), name="lai")
    assert fifesim.score(edge, edge, [0, 1, 2]).n.values.tolist() == [1, 2]


def test_intervals_contain_their_ends():
    """Bare soil has a leaf area of exactly zero, where intervals are clipped."""
    level = {"level": [0.9]}
    low, high = (xr.DataArray([end], level | {"x": range(4)}, ("level", "x")) for end in ([0, 0, 1, 1], [2, 2, 3, 3]))
    truth = xr.DataArray([0.0, 2.0, 3.5, 0.5], {"x": range(4)}, "x", "lai", {"units": "1"})
    assert xr.Dataset({"lai": truth, "low": low, "high": high}).fifesim.score(truth).coverage.item() == 0.5


def test_deciles_and_slope_agree_with_brute_force(estimate, truth):
    # No edge of a decile is a value of one of 8998 pixels.
    truth = truth.where((truth.x > 0) | (truth.y > 0) | (truth.landscape > 0))
    found, known = estimate.fifesim.score(truth), np.isfinite(truth.values)
    value, true, landscape = estimate["lai"].values[known], truth.values[known], np.nonzero(known)[0]
    assert float(found.slope) == pytest.approx(np.polyfit(value, true, 1)[0], rel=1e-9)
    error, half = value - true, 0.25 * norm.ppf(0.9)
    for kind, values in (("estimate", value), ("truth", true)):
        number = pd.qcut(values, 10, labels=False)
        for decile in range(10):
            at = number == decile
            own = found.sel(decile=decile + 1)
            assert float(own[f"bias_by_{kind}"]) == pytest.approx(error[at].mean(), rel=1e-9)
            inside = (np.abs(error) <= half)[at]
            assert float(own[f"coverage_by_{kind}"].sel(level=0.8)) == pytest.approx(inside.mean(), rel=1e-9)
            sums, counts = (np.bincount(landscape[at], each, 12) for each in (error[at], None))
            assert float(own[f"bias_by_{kind}_se"]) == pytest.approx(scores.ratio_error(sums, counts), rel=1e-9)
    # High estimates are too high because of their error, and high truths are missed.
    assert float(found.bias_by_estimate[-1]) > 0.15 and float(found.bias_by_truth[-1]) == pytest.approx(0.05, abs=0.03)


def drawn_estimates(rng, slope=1.0, spread=0.0):
    """Expected truth of pixels whose error is partly common to a landscape, times a slope, and normal intervals."""
    mean, dims, half = rng.normal(0, 1, (20, 200)), ("landscape", "pixel"), 0.5 * norm.ppf(0.9)
    sd = 0.5 * np.exp(spread * mean)
    error = sd * (rng.normal(0, 0.4, (20, 1)) + rng.normal(0, np.sqrt(1 - 0.16), mean.shape))
    value = xr.DataArray(3 + mean * slope, dims=dims)
    truth = xr.DataArray(3 + mean + error, dims=dims, name="lai")
    return xr.Dataset({"lai": value, "low": value - half, "high": value + half}, {"level": 0.8}), truth


@pytest.mark.filterwarnings("default:the estimate of lai is wrong")
def test_wrong_deciles_give_a_warning_without_false_alarms():
    """
    Errors are correlated within a landscape. For independent pixels, standard errors would be much smaller than their
    spread over 60 sets of 20 landscapes.
    """
    rng, found = np.random.default_rng(6), []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = [fifesim.score(*drawn_estimates(rng)) for _ in range(60)]
        estimate, truth = drawn_estimates(rng, slope=0.6)
        # Dependence of the pixels is unknown without landscapes, and the error of two landscapes is uncertain.
        fifesim.score(estimate.rename(landscape="row"), truth.rename(landscape="row"))
        fifesim.score(estimate.isel(landscape=slice(2)), truth.isel(landscape=slice(2)))
    assert float(found[-1].bias_by_truth[0]) > 0.2 and float(found[-1].bias_by_truth[-1]) < -0.2
    for name in ("bias", "coverage"):
        stated = np.mean([each[f"{name}_se"] for each in found])
        assert stated == pytest.approx(np.std([each[name] for each in found]), rel=0.25)
    assert np.mean([each.bias_se for each in found]) > 3 * 0.5 / np.sqrt(4000)
    with pytest.warns(UserWarning, match=r"estimate of lai is wrong in \d+ of 10 deciles.*bias -0\.\d+ ± .* decile 10"):
        fifesim.score(estimate, truth)
    with pytest.warns(UserWarning, match=r"estimate: coverage of the 80 % interval 0\.\d+ ± 0\.\d+ in decile 10"):
        found = fifesim.score(*drawn_estimates(rng, spread=0.4))
    assert abs(found.coverage.item() - 0.8) < 0.06


def test_landscapes_can_be_a_coordinate(estimate, truth):
    chips = truth.rename(landscape="chip").assign_coords(landscape=("chip", np.repeat(np.arange(4), 3)))
    given = estimate.rename(landscape="chip")
    found = fifesim.score(given, chips)
    by_hand = [float((given["lai"] - chips).isel(chip=slice(3 * k, 3 * k + 3)).sum()) for k in range(4)]
    count = [float(chips.isel(chip=slice(3 * k, 3 * k + 3)).count()) for k in range(4)]
    assert float(found.bias_se) == pytest.approx(
        float(scores.ratio_error(np.array(by_hand), np.array(count))), rel=1e-9
    )
    assert np.isnan(fifesim.score(given.drop_vars("chip"), chips.drop_vars(["chip", "landscape"])).bias_se)


def test_maps_are_paired_by_location(lai, whole):
    """Scores of a line on the fitted pixels: bias 0, and the residual deviation apart from n - 2."""
    ndvi, true = whole["ndvi"], whole["truth"]
    fit = fifesim.regress(true, ndvi)
    low, high = fit.prediction_interval(ndvi.values, level=0.9)
    maps = {"lai": fit.predict(ndvi.values), "low": low, "high": high}
    bare = ndvi.drop_attrs(deep=False)
    estimate = xr.Dataset({name: bare.copy(data=each) for name, each in maps.items()}, {"level": 0.9})
    found = estimate.fifesim.score(true)
    assert float(found.bias) == pytest.approx(0, abs=1e-9) and int(found.n) == fit.n
    assert float(found.rmse) == pytest.approx(fit.residual_deviation * np.sqrt((fit.n - 2) / fit.n), rel=1e-9)
    assert 0 < int(estimate.fifesim.score(in_chunks(true[2:], {"y": 2, "x": 3})).n) < fit.n


def test_mask_scores_count_omitted_and_committed_area_by_thickness():
    """Expected shares by hand: pixels of cloud, half cloud and clear sky in two classes of thickness."""
    dims = ("landscape", "pixel")
    truth = xr.DataArray([[1.0, 1.0, 0.5, 0.0, 1.0, 1.0, 0.0, np.nan]], dims=dims, name="cloud")
    mask = xr.DataArray([[True, False, True, True, True, True, False, True]], dims=dims)
    thick = xr.DataArray([[0, 0, 0, 0, 1, 1, 1, 1]], dims=dims, name="thickness")
    found = fifesim.score(mask, truth)
    assert int(found.n) == 7
    np.testing.assert_allclose([found.omission, found.commission], [1 / 4.5, 1.5 / 5])
    by = fifesim.score(mask, truth, by=thick)
    np.testing.assert_allclose(by.omission, [1 / 2.5, 0.0])
    np.testing.assert_allclose(by.commission, [1.5 / 3, 0.0])
    assert by.omission.dims == ("thickness",) and by.n.values.tolist() == [4, 3]
    other = fifesim.score(mask, truth > 0.4)
    xr.testing.assert_identical(other, fifesim.score(mask, (truth > 0.4).astype(float)))
