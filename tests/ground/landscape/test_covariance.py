"""Tests of correlated fields against integrals of spectra and independent statistics, and of normal scores."""

import numpy as np
import pytest
from scipy import integrate, stats

from fifesim.ground.landscape.autoregression import field_variance, response
from fifesim.ground.landscape.covariance import (
    copula,
    correlated,
    cross_correlation,
    field_seed,
    normal_scores,
    pairs_of,
    score_table,
)

ARPS = {"lai": 0.15, "soil": 0.24, "moisture": 0.05}
EQUAL_ARPS = dict.fromkeys(ARPS, 0.1)


@pytest.fixture(scope="module")
def places():
    """Three correlated properties of the ground, none of them normal."""
    drawn = np.random.default_rng(4).standard_normal((3, 20_000))
    height = drawn[0]
    wet = np.exp(-0.5 * height + drawn[1])
    lit = np.maximum(0.4 * height + drawn[2], -1.0)
    return {"elevation": 400 + 30 * height**3, "wetness": wet, "illumination": lit}


def field_of(parts, name, noises, places):
    """Field of a name, with independent random numbers as the noise of cells."""
    noise = sum(weight * noises[other] for other, weight in parts.noise[name].items())
    if name not in parts.ground:
        return noise
    return correlated(parts.ground[name], noise, parts.covariates, places)


def noise_of(places, seed=9):
    count = next(iter(places.values())).size
    return dict(zip(ARPS, np.random.default_rng(seed).standard_normal((3, count)), strict=True))


@pytest.mark.parametrize(("one", "other"), [(0.05, 0.24), (0.15, 0.2), (0.0, 0.2498), (0.1, 0.1001)])
def test_cross_correlation_is_the_integral_of_both_spectra(one, other):
    product, _ = integrate.dblquad(
        lambda u, v: response(one, u, v) * response(other, u, v), 0, np.pi, 0, np.pi, epsabs=1e-9, epsrel=1e-9
    )
    expected = product / np.pi**2 / np.sqrt(field_variance(one) * field_variance(other))
    assert cross_correlation(one, other) == pytest.approx(expected, abs=1e-7)
    assert cross_correlation(other, one) == cross_correlation(one, other)


THREE_PAIRS = {("lai", "soil"): 0.9, ("lai", "moisture"): 0.9, ("soil", "moisture"): -0.9}
REQUESTED = {
    ("lai", "elevation"): 0.3,
    ("lai", "wetness"): 0.5,
    ("lai", "illumination"): -0.2,
    ("soil", "elevation"): -0.6,
    ("lai", "soil"): -0.4,
    ("lai", "moisture"): 0.35,
}


def test_fields_have_the_given_correlations(places):
    """Independent noise in each cell, hence equal arps; 20 000 cells and five standard errors."""
    parts, noises = copula(EQUAL_ARPS, REQUESTED, places), noise_of(places)
    found = {name: field_of(parts, name, noises, places) for name in ARPS}
    found |= {name: normal_scores(values, score_table(values)) for name, values in places.items()}
    for (one, other), requested in REQUESTED.items():
        r = np.corrcoef(found[one], found[other])[0, 1]
        assert r == pytest.approx(requested, abs=5 * (1 - requested**2) / np.sqrt(20_000)), (one, other)
    for name in ARPS:
        assert stats.kstest(found[name], "norm").pvalue > 0.001


def test_correlations_with_ground_that_is_not_jointly_normal():
    """Each property is normal, but their sum is not: beyond 1, one is the mirror image of the other."""
    one = np.random.default_rng(8).standard_normal(20_000)
    ground = {"elevation": one, "wetness": np.where(np.abs(one) < 1.0, one, -one)}
    requested = {("lai", "elevation"): 0.3, ("lai", "wetness"): 0.1}
    parts = copula({"lai": 0.1}, requested, ground)
    follows = field_of(parts, "lai", {"lai": np.zeros(20_000)}, ground)
    for (_, name), r in requested.items():
        assert np.mean(follows * normal_scores(ground[name], parts.covariates[name])) == pytest.approx(r, abs=1e-3)
    assert follows.std() == pytest.approx(parts.ground["lai"].share, rel=1e-3)
    with pytest.raises(ValueError, match="no sum of elevation, wetness has such ranks that lai follows each"):
        copula({"lai": 0.1}, {("lai", "elevation"): 0.4, ("lai", "wetness"): 0.3}, ground)


@pytest.mark.parametrize(
    ("arps", "requested", "message", "nearest", "coarser"),
    [
        (EQUAL_ARPS, THREE_PAIRS, "no correlation matrix", 0.5, ()),
        (EQUAL_ARPS, THREE_PAIRS, "cannot be: .* nearest allowed", 0.5, ("soil",)),
        (EQUAL_ARPS, THREE_PAIRS, "cannot be: .* nearest allowed", 0.5, ("soil", "moisture")),
        (EQUAL_ARPS, THREE_PAIRS, "cannot be: .* nearest allowed", 0.5, ("lai", "soil", "moisture")),
        ({"lai": 0.05, "soil": 0.24}, {("lai", "soil"): 0.8}, "can have -0.63 to 0.63, by their arps", 0.63, ()),
    ],
)
def test_impossible_correlations_are_refused_with_the_nearest_possible_ones(arps, requested, message, nearest, coarser):
    """For r, r and -r the smallest eigenvalue of the correlation matrix is 1 - 2 r, so r is at most 0.5."""
    with pytest.raises(ValueError, match=message) as caught:
        copula(arps, requested, coarser=coarser)
    text = str(caught.value)
    assert len(text) <= 500 and all(f"{one}-{other} {r:g}" in text for (one, other), r in requested.items())
    allowed = float(text.split()[-1])
    assert abs(allowed) == pytest.approx(nearest, abs=0.011)
    copula(arps, {pair: np.sign(r) * abs(allowed) for pair, r in requested.items()}, coarser=coarser)
    with pytest.raises(ValueError):
        copula(arps, {pair: np.sign(r) * (abs(allowed) + 0.02) for pair, r in requested.items()}, coarser=coarser)


def test_impossible_correlations_with_the_ground_are_refused(places):
    """Wetness decreases with elevation, so no field can have high correlations with both."""
    requested = {("lai", "elevation"): 0.9, ("lai", "wetness"): 0.9}
    with pytest.raises(ValueError, match="lai cannot follow all of elevation, wetness so closely") as caught:
        copula({"lai": 0.1}, requested, places)
    allowed = float(str(caught.value).split()[-1])
    parts = copula({"lai": 0.1}, dict.fromkeys(requested, allowed), places)
    assert 0.95 < parts.ground["lai"].share <= 1


def test_places_with_missing_values_are_left_out_and_level_ground_is_refused(places):
    holes = {name: values.copy() for name, values in places.items()}
    holes["wetness"][::3] = np.nan
    parts = copula({"lai": 0.1}, {("lai", "elevation"): 0.5, ("lai", "wetness"): -0.2}, holes)
    kept = {name: np.delete(values, np.s_[::3]) for name, values in places.items()}
    other = copula({"lai": 0.1}, {("lai", "elevation"): 0.5, ("lai", "wetness"): -0.2}, kept)
    np.testing.assert_array_equal(parts.ground["lai"].weights, other.ground["lai"].weights)
    with pytest.raises(ValueError, match="nowhere are all known"):
        copula({"lai": 0.1}, {("lai", "elevation"): 0.5}, {"elevation": np.full(9, np.nan)})
    with pytest.raises(ValueError, match="elevation is the same everywhere"):
        copula({"lai": 0.1}, {("lai", "elevation"): 0.3}, {"elevation": np.ones(50)})


def put_together(parts, names, noises):
    """Fields on coarser lattices that do not follow the ground, with independent noise in each cell."""
    found = {}
    for name in names:
        known = parts.coarse.get(name, {})
        noise = sum(weight * noises[other] for other, weight in parts.noise[name].items())
        part = sum(weight * noises[other] for other, weight in known.items())
        rest = np.sqrt(1 - sum(weight**2 for weight in known.values()))
        found[name] = part + rest * noise
    return found


def test_fields_on_coarser_lattices_have_the_given_covariance(places):
    """Five fields, two of them on coarser lattices."""
    names = ["wet", "soil", "lai", "brown", "crowns"]
    requested = {
        ("wet", "soil"): -0.5, ("lai", "wet"): 0.6, ("lai", "soil"): -0.4, ("brown", "wet"): -0.3,
        ("lai", "brown"): -0.4, ("lai", "crowns"): 0.5,
    }  # fmt: skip
    parts = copula(dict.fromkeys(names, 0.1), requested, coarser=("wet", "soil"))
    noises = dict(zip(names, np.random.default_rng(3).standard_normal((5, 200_000)), strict=True))
    found = put_together(parts, names, noises)
    wanted = np.eye(5)
    for (one, other), r in requested.items():
        i, j = names.index(one), names.index(other)
        wanted[i, j] = wanted[j, i] = r
    np.testing.assert_allclose(np.cov([found[name] for name in names]), wanted, atol=0.012)
    assert parts.noise["wet"] == {"wet": 1.0} and set(parts.noise["lai"]) <= {"lai", "brown", "crowns"}


def test_fields_on_different_lattices_may_have_any_correlation():
    """On one lattice, these arps limit the correlation to 0.63."""
    arps, requested = {"soil": 0.24, "lai": 0.05}, {("lai", "soil"): -0.9}
    with pytest.raises(ValueError, match=r"can have -0\.63 to 0\.63, by their arps"):
        copula(arps, requested)
    parts = copula(arps, requested, coarser=("soil",))
    assert parts.coarse["lai"] == {"soil": pytest.approx(-0.9)} and parts.noise["lai"] == {"lai": 1.0}
    assert copula(arps, {("lai", "soil"): 1.0}, coarser=("soil",)).coarse["lai"] == {"soil": 1.0}


def test_coarse_field_may_follow_the_ground(places):
    requested = {("soil", "elevation"): -0.6, ("lai", "elevation"): 0.3, ("lai", "soil"): -0.4}
    parts = copula({"soil": 0.1, "lai": 0.1}, requested, places, coarser=("soil",))
    noises = dict(zip(("soil", "lai"), np.random.default_rng(5).standard_normal((2, 20_000)), strict=True))
    mixed = put_together(parts, ["soil", "lai"], noises)
    found = {name: correlated(parts.ground[name], mixed[name], parts.covariates, places) for name in mixed}
    assert np.corrcoef(found["lai"], found["soil"])[0, 1] == pytest.approx(-0.4, abs=0.03)
    elevation = normal_scores(places["elevation"], parts.covariates["elevation"])
    assert np.corrcoef(found["soil"], elevation)[0, 1] == pytest.approx(-0.6, abs=0.03)


def test_correlated_cells_do_not_depend_on_their_block(places):
    parts = copula({"lai": 0.1}, {("lai", "elevation"): 0.5}, places)
    many = {"elevation": np.tile(places["elevation"], 8)}
    noise = np.random.default_rng(2).standard_normal(many["elevation"].size)
    found = correlated(parts.ground["lai"], noise, parts.covariates, many)
    last = {"elevation": many["elevation"][-70:]}
    np.testing.assert_array_equal(found[-70:], correlated(parts.ground["lai"], noise[-70:], parts.covariates, last))


def test_each_name_and_seed_has_different_noise():
    seeds = {field_seed(seed, name) for seed in (0, 1) for name in ("lai", "soil", "moisture", "brown")}
    assert len(seeds) == 8
    assert field_seed(2**63 - 1, "lai") == 2**63 - 1


FIELDS, GROUND = ["lai", "soil", "moisture"], ["elevation", "wetness"]


def test_nested_and_paired_correlations_are_equivalent():
    pairs = {("lai", "soil"): -0.4, ("soil", "elevation"): 0.3}
    assert pairs_of({"lai": {"soil": -0.4}, "elevation": {"soil": 0.3}}, FIELDS, GROUND) == pairs
    assert pairs_of({("lai", "soil"): -0.4, ("elevation", "soil"): 0.3}, FIELDS, GROUND) == pairs
    assert pairs_of(None, FIELDS) == {}


@pytest.mark.parametrize(
    ("correlations", "kind", "message"),
    [
        ({("lai", "sand"): 0.1}, ValueError, "name 'sand', there are 'lai', 'soil'"),
        ({("elevation", "wetness"): 0.1}, ValueError, "of two fields, or of a field with the ground"),
        ({("lai", "lai"): 1.0}, ValueError, "of two fields"),
        ({("lai", "soil"): 0.1, ("soil", "lai"): 0.1}, ValueError, "'soil' with 'lai' is given twice"),
        ({("lai", "soil"): 1.2}, ValueError, r"must be in \[-1, 1\], got 1.2"),
        ({("lai", "soil"): float("nan")}, ValueError, r"must be in \[-1, 1\], got nan"),
        ({("lai", "soil"): "much"}, TypeError, "correlation of lai with soil must be a number, got 'much'"),
        ({"soil": 0.1}, TypeError, "the key 'soil': name the other one too"),
        ([("lai", "soil", 0.1)], TypeError, "got list"),
    ],
)
def test_invalid_correlations_are_refused_with_a_short_message(correlations, kind, message):
    with pytest.raises(kind, match=message) as caught:
        pairs_of(correlations, FIELDS, GROUND)
    assert len(str(caught.value)) <= 500


def test_normal_scores_are_normal_and_keep_the_order(places):
    for values in (places["elevation"], places["wetness"]):
        scores = normal_scores(values, score_table(values))
        assert stats.kstest(scores, "norm").statistic < 1e-3
        assert stats.spearmanr(scores, values).statistic == pytest.approx(1, abs=1e-9)


def test_equal_values_have_one_score():
    table = score_table(np.array([0.0, 0.0, 0.0, 1.0, 2.0]))
    assert table.values.tolist() == [0, 1, 2]
    scores = normal_scores(np.array([0.0, 0.0, 0.0, 1.0, 2.0]), table)
    assert scores.mean() == pytest.approx(0, abs=1e-12) and scores.std() == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("sample", [None, [-1e6, 0, 1, 2, 3], [-3, -2, -1, 0, 1e6], [-1e6, 0, 1, 2, 1e6]])
def test_normal_scores_interpolate_their_table(places, sample):
    """Compare with numpy at the nodes, between them and beyond, also where nearly all nodes are in one search step."""
    table = score_table(places["elevation"] if sample is None else np.array(sample, float))
    values = np.concatenate([table.values, np.linspace(-5000, 6000, 3001), np.linspace(-4, 4, 81), [np.inf, -np.inf]])
    expected = np.interp(values, table.values, table.scores)
    np.testing.assert_allclose(normal_scores(values, table), expected, rtol=0, atol=1e-9)


def test_nan_has_no_score_and_shapes_are_kept(places):
    table = score_table(places["wetness"])
    found = normal_scores(np.array([[np.nan, 1.0], [2.0, 3.0]]), table)
    assert np.isnan(found).tolist() == [[True, False], [False, False]]
