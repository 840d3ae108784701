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


def test_crps_without_spread_is_the_absolute_error():
    np.testing.assert_array_equal(scores.normal_crps([1.0, np.nan], 0.0, 3.0), [2.0, np.nan])


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


def test_interval_score_of_a_normal_is_minimal_at_its_quantiles():
    """The score is proper: intervals that are too narrow, too wide or shifted have a higher mean score."""
    truth = norm.ppf((np.arange(20000) + 0.5) / 20000)
    half = norm.ppf(0.9)
    best = scores.interval_score(-half, half, truth, 0.8).mean()
    for low, high in ((-0.8 * half, 0.8 * half), (-1.2 * half, 1.2 * half), (0.2 - half, 0.2 + half)):
        assert scores.interval_score(low, high, truth, 0.8).mean() > best + 0.01
    # Closed form: 2 pdf(q) / alpha for each of the two ends.
    assert best == pytest.approx(4 / 0.2 * norm.pdf(half), rel=1e-3)


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
    assert found.pit[0] > 1.2 and found.pit[9] > 1.05, "too confident: both ends are too full"


def test_intervals_contain_their_ends():
    """Bare soil has a leaf area of exactly zero, where intervals are clipped."""
    level = {"level": [0.9]}
    low, high = (xr.DataArray([end], level | {"x": range(4)}, ("level", "x")) for end in ([0, 0, 1, 1], [2, 2, 3, 3]))
    truth = xr.DataArray([0.0, 2.0, 3.5, 0.5], {"x": range(4)}, "x", "lai", {"units": "1"})
    assert xr.Dataset({"lai": truth, "low": low, "high": high}).fifesim.score(truth).coverage.item() == 0.5


def test_scores_are_identical_in_any_chunks(estimate, truth):
    pieces = {"landscape": 7, "y": 17, "x": 11}
    lazy = estimate.map(lambda each: each.chunk({dim: pieces.get(dim, -1) for dim in each.dims}))
    xr.testing.assert_identical(lazy.fifesim.score(truth.chunk(pieces)), estimate.fifesim.score(truth))


def test_scores_of_ensembles_are_identical_in_any_chunks(truth):
    truth = truth.isel(landscape=1, drop=True)
    noise = np.random.default_rng(4).normal(0, 0.3, (37, *truth.shape))
    members = (truth + xr.DataArray(noise, dims=("member", *truth.dims))).transpose("member", ...).rename("lai")
    whole = members.fifesim.score(truth, pair="index")
    for pieces in ({"member": 5}, {"member": -1, "y": 7}, {"member": 1, "x": 11}):
        xr.testing.assert_identical(members.chunk(pieces).fifesim.score(truth, pair="index"), whole)


def test_maps_without_other_dimensions_have_intervals_by_level(estimate, truth):
    found = estimate.isel(landscape=1, drop=True).fifesim.score(truth.isel(landscape=1, drop=True), pair="index")
    xr.testing.assert_identical(found, estimate.isel(landscape=[1]).fifesim.score(truth.isel(landscape=[1])))


def test_groups_are_scored_separately(estimate, truth):
    by = xr.where(truth["x"] < 300, 3, 7).rename("cover")
    found = estimate.fifesim.score(truth, by)
    assert found.cover.values.tolist() == [3, 7]
    west = estimate.isel(x=slice(10)).fifesim.score(truth.isel(x=slice(10)))
    west = west[list(found.data_vars)]
    xr.testing.assert_allclose(found.isel(cover=0, drop=True), west, rtol=1e-12)
    # Pixels of no class are left out.
    some = estimate.fifesim.score(truth, xr.where(truth["x"] < 300, 3.0, np.nan).rename("cover"))
    xr.testing.assert_allclose(some.isel(cover=0, drop=True), west, rtol=1e-12)
    assert some.cover.values.tolist() == [3.0]
    bins = estimate.fifesim.score(truth, [0, 1, 2, 5])
    assert bins.lai_bin.values.tolist() == [0.5, 1.5, 3.5]
    assert estimate.fifesim.score(truth, [-9, 9]).lai_bin.values.tolist() == [0.0]
    inside = ((truth >= 1) & (truth < 2)).values
    assert int(bins.n[1]) == inside.sum()
    assert float(bins.bias[1]) == pytest.approx(float((estimate["lai"] - truth).values[inside].mean()), rel=1e-12)
    # The upper edge belongs to the last bin.
    edge = xr.DataArray([[0.0, 1.0, 2.0]], dims=("y", "x"), name="lai", coords={"y": [0.0], "x": [0.0, 30.0, 60.0]})
    assert fifesim.score(edge.expand_dims("pixel"), edge.expand_dims("pixel"), [0, 1, 2]).n.values.tolist() == [1, 2]


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
    mean = rng.normal(0, 1, (20, 200))
    sd = 0.5 * np.exp(spread * mean)
    error = sd * (rng.normal(0, 0.4, (20, 1)) + rng.normal(0, np.sqrt(1 - 0.16), mean.shape))
    maps = {"lai": 3 + mean * slope} | {end: 3 + mean * slope + side * half for end, side, half in (
        ("low", -1, 0.5 * norm.ppf(0.9)), ("high", 1, 0.5 * norm.ppf(0.9)))}  # fmt: skip
    dims = ("landscape", "pixel")
    truth = xr.DataArray(3 + mean + error, dims=dims, name="lai")
    return xr.Dataset({name: (dims, each) for name, each in maps.items()}, {"level": 0.8}), truth


@pytest.mark.filterwarnings("default:the estimate of lai is wrong")
def test_wrong_deciles_give_a_warning_without_false_alarms():
    rng, alarms = np.random.default_rng(6), 0
    for _ in range(60):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = fifesim.score(*drawn_estimates(rng))
        alarms += len(caught)
    assert alarms == 0
    assert float(found.bias_by_truth[0]) > 0.2 and float(found.bias_by_truth[-1]) < -0.2
    with pytest.warns(UserWarning, match=r"estimate of lai is wrong in \d+ of 10 deciles.*bias -0\.\d+ ± .* decile 10"):
        fifesim.score(*drawn_estimates(rng, slope=0.6))
    with pytest.warns(UserWarning, match=r"estimate: coverage of the 80 % interval 0\.\d+ ± 0\.\d+ in decile 10"):
        found = fifesim.score(*drawn_estimates(rng, spread=0.4))
    assert abs(found.coverage.item() - 0.8) < 0.06
    estimate, truth = drawn_estimates(rng, slope=0.6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Dependence of the pixels is unknown without landscapes, and the error of two landscapes is uncertain.
        fifesim.score(estimate.rename(landscape="row"), truth.rename(landscape="row"))
        fifesim.score(estimate.isel(landscape=slice(2)), truth.isel(landscape=slice(2)))


def test_standard_errors_match_the_spread_over_redrawn_landscapes():
    """
    Errors are correlated within a landscape; 120 sets of 20 landscapes. For independent pixels, standard errors would
    be much smaller.
    """
    rng = np.random.default_rng(4)
    drawn, errors, biases, stated = [], [], [], []
    for _ in range(120):
        shared = rng.normal(0, 0.2, (20, 1))
        truth = xr.DataArray(rng.normal(2, 0.5, (20, 100)), dims=("landscape", "pixel"), name="lai")
        value = truth + shared + rng.normal(0, 0.2, truth.shape)
        limits = {"low": value - 0.3, "high": value + 0.3}
        found = fifesim.score(xr.Dataset({"lai": value} | limits).assign_coords(level=0.8), truth)
        drawn.append(float(found.coverage[0]))
        errors.append(float(found.coverage_se[0]))
        biases.append(float(found.bias))
        stated.append(float(found.bias_se))
    assert np.mean(errors) == pytest.approx(np.std(drawn), rel=0.25)
    assert np.mean(stated) == pytest.approx(np.std(biases), rel=0.25)
    assert np.mean(errors) > 3 * np.sqrt(0.7 * 0.3 / 2000)


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
    with pytest.raises(ValueError, match="no dimension or coordinate 'scene'"):
        fifesim.score(given, chips, landscape="scene")


def test_ensemble_is_scored_from_its_members(truth):
    rng = np.random.default_rng(5)
    members = truth + xr.DataArray(rng.normal(0, 0.3, (9, *truth.shape)), dims=("member", *truth.dims))
    found = fifesim.score(members.rename("lai"), truth)
    cells = members.transpose(..., "member").values[np.isfinite(truth.values)]
    expected = scores.ensemble_crps(cells, truth.values[np.isfinite(truth.values)]).mean()
    assert float(found.crps) == pytest.approx(expected, rel=1e-12)


def test_maps_are_paired_by_location(lai):
    """Scores of a line on the fitted pixels: bias 0, the residual deviation apart from n - 2, and 90 % coverage."""
    image = (
        lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"]).fifesim.to_toa().fifesim.sense("TM", min_valid=0.1)
    )
    ndvi, true = image.fifesim.ndvi(), lai.fifesim.aggregate(30, min_valid=0.1)
    fit = fifesim.regress(true, ndvi)
    low, high = fit.prediction_interval(ndvi.values, level=0.9)
    maps = {"lai": fit.predict(ndvi.values), "low": low, "high": high}
    bare = ndvi.drop_attrs(deep=False)
    estimate = xr.Dataset({name: bare.copy(data=each) for name, each in maps.items()}, {"level": 0.9})
    found = estimate.fifesim.score(true)
    assert float(found.bias) == pytest.approx(0, abs=1e-9) and int(found.n) == fit.n
    assert float(found.rmse) == pytest.approx(fit.residual_deviation * np.sqrt((fit.n - 2) / fit.n), rel=1e-9)
    assert float(found.coverage.sel(level=0.9)) > 0.85
    part = in_chunks(true[1:], {"y": 2, "x": 3})
    assert int(estimate.fifesim.score(part).n) < int(found.n)
    with pytest.raises(ValueError, match=r"has dimensions .*: select one"):
        fifesim.score(true.expand_dims(member=2, model=3), true)


@pytest.mark.parametrize(
    ("change", "by", "message"),
    [
        (lambda given: given.rename(lai="fpar").assign(other=given["lai"]), None, "must have a variable lai"),
        (lambda given: given.drop_vars("low"), None, "an interval has two ends"),
        (lambda given: given.drop_vars("level"), None, "need a coordinate level"),
        (lambda given: given.assign_coords(level=[0.5, 0.8, 95.0]), None, "level must be between 0 and 1, got .*95"),
        (lambda given: given.assign_coords(x=given.x + 1), None, "different labels"),
        (lambda given: given.isel(y=0), None, "of the estimate has dimensions"),
        (lambda given: given * np.nan, None, "no pixel has both .* not flagged"),
        (lambda given: given.assign(high=given["low"]), None, "low and high of a level are equal in every pixel"),
        (lambda given: given, [2, 1], "increasing edges"),
        (lambda given: given, [2], "increasing edges"),
        (lambda given: given.assign_coords(level=[0.0, 0.5, 0.8]), None, "level must be between 0 and 1, got .*0.0"),
        (lambda given: given, xr.DataArray([1, 2], dims="z"), "bring it onto its grid"),
    ],
)
def test_invalid_estimates_are_rejected(estimate, truth, change, by, message):
    with pytest.raises(ValueError, match=message):
        fifesim.score(change(estimate), truth, by)


def test_different_quantities_are_rejected(estimate, truth):
    fpar = truth.assign_attrs(standard_name="leaf_area_index")
    other = estimate.assign(lai=estimate["lai"].assign_attrs(standard_name="surface_altitude"))
    with pytest.raises(ValueError, match="must be the same quantity"):
        fifesim.score(other, fpar)


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
    with pytest.raises(ValueError, match="truth of a mask is a share from 0 to 1, got 0 to 2"):
        fifesim.score(mask, 2 * truth)
    with pytest.raises(ValueError, match="the truth is a mask and the estimate is not"):
        fifesim.score(truth, mask)
