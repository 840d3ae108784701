"""Tests of LAI distributions: moments, densities of samples, quantile and rank maps, and errors."""

import numpy as np
import pandas as pd
import pytest
from scipy import integrate, stats

import fifesim
from fifesim.base import files
from fifesim.ground.landscape.distribution import (
    QUANTILE_NODES,
    kernel_density,
    lai_distribution,
    quantile_map,
    quantile_map_of_classes,
    quantile_table,
    rank_map,
    truncated_normal,
)

SAMPLES = np.random.default_rng(4).gamma(2.0, 0.5, 60)
ROWS = [pytest.param(row, id=row.treatment) for row in files.table("lai_distributions.csv").itertuples()]


@pytest.mark.parametrize("row", ROWS)
def test_treatments_have_the_tabulated_moments(row):
    """By quadrature of the density, to the digits of the table."""
    distribution = lai_distribution(row.treatment)

    def moment(function):
        return integrate.quad(lambda x: function(x) * distribution.pdf(x), row.lower, row.upper, epsabs=1e-12)[0]

    assert moment(lambda x: 1.0) == pytest.approx(1, abs=1e-10)
    mean = moment(lambda x: x)
    assert mean == pytest.approx(row.mean, abs=1e-8)
    assert np.sqrt(moment(lambda x: (x - mean) ** 2)) == pytest.approx(row.standard_deviation, abs=1e-8)


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_impossible_moments_are_refused():
    with pytest.raises(ValueError, match="no normal truncated"):
        truncated_normal(1.0, 5.0, 0.0, 2.0)


def test_kernel_density_agrees_with_scipy_reflected_at_zero():
    x = np.linspace(0, 5, 50)
    plain, distribution = stats.gaussian_kde(SAMPLES), kernel_density(SAMPLES)
    np.testing.assert_allclose(distribution.pdf(x), plain(x) + plain(-x), rtol=1e-12)
    high = distribution.support()[1]
    assert distribution.cdf(0.0) == 0
    assert distribution.cdf(-1.0) == 0 and distribution.pdf(-0.01) == 0
    assert integrate.quad(distribution.pdf, 0, high, limit=200)[0] == pytest.approx(1, abs=1e-9)
    for x in (0.1, 1.0, 2.0):
        assert distribution.cdf(x) == pytest.approx(integrate.quad(distribution.pdf, 0, x)[0], abs=1e-10)


def test_quantiles_of_the_kernel_density_invert_its_cdf():
    """Errors from nodes at 1/8192 of the support: slope of the density times half the squared step, below 1e-6."""
    distribution = kernel_density(SAMPLES)
    q = np.array([1e-9, 1e-4, 0.1, 0.5, 0.9, 0.9999, 1 - 1e-9])
    np.testing.assert_allclose(distribution.cdf(distribution.ppf(q)), q, rtol=0, atol=1e-6)
    np.testing.assert_allclose(distribution.sf(distribution.isf(1 - q)), 1 - q, rtol=0, atol=1e-6)


def test_kernel_density_of_equal_samples_is_refused():
    with pytest.raises(ValueError, match="all 6 LAI samples are 2: a density needs some spread"):
        kernel_density(np.full(6, 2.0))


def write(path, table):
    path.write_text(table)
    return path


def test_samples_are_read_from_csv_files(tmp_path):
    samples = pd.DataFrame({"plot": range(60), "lai": SAMPLES})
    several, one = tmp_path / "several.csv", tmp_path / "one.CSV"
    samples.to_csv(several, index=False)
    samples[["lai"]].rename(columns={"lai": "anything"}).to_csv(one, index=False)
    gaps = write(tmp_path / "gaps.csv", several.read_text() + "60,\n61,NA\n")
    for path in (several, str(several), one, gaps):
        assert lai_distribution(path).pdf(0.7) == pytest.approx(kernel_density(SAMPLES).pdf(0.7), rel=1e-9)
    bare = write(tmp_path / "bare.csv", several.read_text() + "60,0.0\n")
    assert lai_distribution(bare).pdf(0.7) == pytest.approx(kernel_density([*SAMPLES, 0.0]).pdf(0.7), rel=1e-9)


def test_tables_of_samples_are_kept_by_content(tmp_path):
    """Equal samples share one distribution, by which tables are cached, whatever the file; a changed file does not."""
    one, other = (write(tmp_path / name, "lai\n1\n2\n3\n4\n5\n") for name in ("one.csv", "other.csv"))
    first = lai_distribution(one)
    assert quantile_table(lai_distribution(other)) is quantile_table(first)
    write(one, "lai\n1\n2\n3\n4\n5.5\n")
    assert lai_distribution(one).support()[1] > first.support()[1]


@pytest.mark.parametrize(
    "table, message",
    [
        ("a,b\n1,2\n", "needs a column 'lai', it has a, b"),
        ("lai\n1\n2\n3\n", "holds 3 LAI samples, at least 5"),
        ("lai\n1\n2\n3\n4\n-0.5\n", r"samples\.csv, line 6: '-0\.5' is not a leaf area index"),
        ("lai\n1\n2\n3\n4\n20.5\n", r"line 6: '20\.5' is not.*from 0 to 20 .*multiply scaled values"),
        ("# mine\n\nlai\n1\n2 # wet\n3\n#\n4\n1e308\n", r"line 9: '1e\+308' is not"),
        ("plot,lai\na,1\nb,2\nc,3\nd,4\ne,x\n", "line 6: 'x' is not a leaf area index"),
        ("lai\n1\n2\n3\n4\n1.5 m2\n", "line 6: '1.5 m2' is not"),
        ('lai\n1\n2\n3\n4\n"1,5"\n', "line 6: '1,5' is not.*decimals with a point"),
        ("lai\n1,5\n2,5\n3,5\n4,5\n5,5\n", "rows have more values than.*decimals with a point"),
        ("lai,lai\n1,2\n2,3\n", "needs a column 'lai', it has lai, lai.1: name the column"),
        ("1.0\n2\n3\n4\n5\n6\n", "begins with the number 1.0: type lai as its first line"),
    ],
)
def test_unusable_samples_are_refused(tmp_path, table, message):
    with pytest.raises(ValueError, match=message):
        lai_distribution(write(tmp_path / "samples.csv", table))


@pytest.mark.parametrize(
    "source, error, message",
    [
        ("missing.csv", ValueError, r"cannot read the LAI samples missing\.csv: there is no such file"),
        (stats.norm(1.0, 0.5), ValueError, "cannot be negative.*truncnorm"),
        (3.0, TypeError, "a name, a CSV file or a frozen scipy distribution"),
    ],
)
def test_invalid_distributions_are_refused(source, error, message):
    with pytest.raises(error, match=message):
        lai_distribution(source)


def kolmogorov_distance(values, distribution):
    """Largest difference between the empirical and the given distribution function."""
    ordered = np.sort(values, axis=None)
    below = distribution.cdf(ordered)
    steps = np.arange(ordered.size + 1) / ordered.size
    return max(np.max(steps[1:] - below), np.max(below - steps[:-1]))


@pytest.mark.parametrize("name", fifesim.ground.treatments())
def test_quantile_map_is_monotone_and_within_the_support(name):
    field = np.array([[-40.0, -8.5, -1.0, 0.0, 1.0, 8.5, 40.0]])
    distribution = lai_distribution(name)
    values = quantile_map(field, quantile_table(distribution))
    assert values.min() >= 0
    assert (np.diff(values[0]) >= 0).all()
    # Quantiles by scipy near the end of the support are accurate to a few units in the last place.
    assert values.max() <= distribution.support()[1] * (1 + 4e-15)


@pytest.mark.parametrize(
    "distribution",
    [*map(lai_distribution, fifesim.ground.treatments()), stats.uniform(0.5, 2.0), stats.beta(2, 3, 0, 4)],
    ids=lambda distribution: distribution.dist.name,
)
def test_quantile_map_is_within_its_error_bound(distribution):
    """Error bound of linear interpolation: squared step / 8 times the largest second derivative."""
    deviates = np.linspace(-6, 6, 20_011)
    exact = np.where(
        deviates < 0, distribution.ppf(stats.norm.cdf(deviates)), distribution.isf(stats.norm.sf(deviates))
    )
    curvature = np.abs(np.gradient(np.gradient(exact, deviates), deviates)).max()
    step = 17 / 2**14
    found = quantile_map(deviates[None], quantile_table(distribution))[0]
    assert np.abs(found - exact).max() <= 1.05 * step**2 / 8 * curvature + 1e-14


def test_quantile_map_keeps_nan_by_cell():
    field = np.array([[0.0, np.nan], [np.nan, 1.0]])
    mapped = quantile_map(field, quantile_table(stats.uniform()))
    np.testing.assert_array_equal(np.isnan(mapped), np.isnan(field))
    assert quantile_map(field, quantile_table(stats.uniform()), out=field) is field
    np.testing.assert_array_equal(field, mapped)


def test_quantile_map_of_classes_equals_the_map_of_each_class():
    """NaN in the field stays NaN in classes with a distribution."""
    rng = np.random.default_rng(2)
    field, numbers = rng.normal(size=(60, 70)), rng.integers(0, 3, (60, 70)).astype(np.int16)
    field[::7, ::5] = np.nan
    first, last = quantile_table(lai_distribution("burned-grazed")), quantile_table(stats.uniform())
    tables = np.stack([first, np.full(QUANTILE_NODES, 1.1), last])
    out = quantile_map_of_classes(field, numbers, tables)
    for number in (0, 2):
        cells = numbers == number
        np.testing.assert_array_equal(out[cells], quantile_map(field[cells], tables[number]))
    assert (out[numbers == 1] == 1.1).all()


@pytest.mark.parametrize("name", fifesim.ground.treatments())
def test_rank_map_reproduces_the_distribution(name):
    """Each quantile (k + 1/2) / n occurs once, which gives the smallest Kolmogorov distance of n values."""
    field = np.random.default_rng(1).normal(size=(40, 50))
    distribution = lai_distribution(name)
    values = rank_map(field, distribution)
    np.testing.assert_array_equal(np.argsort(values, axis=None), np.argsort(field, axis=None))
    np.testing.assert_array_equal(np.sort(values, axis=None), distribution.ppf((np.arange(2000) + 0.5) / 2000))
    assert kolmogorov_distance(values, distribution) == pytest.approx(0.5 / 2000, rel=1e-9)
