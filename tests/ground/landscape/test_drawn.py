"""Properties that are drawn: their distributions, and what none can have."""

import numpy as np
import pytest
from scipy import integrate

import fifesim
from fifesim.ground.landscape.classes import SHARES, Field


@pytest.mark.parametrize("name", SHARES)
@pytest.mark.parametrize(("mean", "sd"), [(0.2, 0.1), (0.2, 0.39), (0.5, 0.02), (0.9, 0.05), (0.01, 0.005)])
def test_share_has_exactly_its_mean_and_deviation(name, mean, sd):
    found = Field(mean=mean, sd=sd).distribution(name)
    assert found.support() == (0, 1)
    assert (found.mean(), found.std()) == pytest.approx((mean, sd), rel=1e-12)
    assert Field(mean=mean, sd=sd, arp=0.24).distribution(name) is found


@pytest.mark.parametrize(("mean", "sd"), [(0.2, 0.1), (0.7, 0.15)])
def test_moments_of_a_share_are_those_of_its_density(mean, sd):
    """Quadrature of the density, and the third moment that the beta distribution has beside any other."""
    density = Field(mean=mean, sd=sd).distribution("brown").pdf
    moments = [integrate.quad(lambda x, n=n: (x - mean) ** n * density(x), 0, 1, epsabs=1e-12)[0] for n in range(4)]
    skewness = 2 * sd * (1 - 2 * mean) / (mean * (1 - mean) + sd**2)
    np.testing.assert_allclose(moments, [1, 0, sd**2, skewness * sd**3], rtol=1e-8, atol=1e-10)


def test_share_of_the_deviation_of_the_uniform_one_is_uniform():
    found = Field(mean=0.5, sd=12**-0.5).distribution("moisture")
    np.testing.assert_allclose(found.cdf([0.1, 0.5, 0.8]), [0.1, 0.5, 0.8], rtol=1e-12)


def test_shares_of_green_and_dead_leaves_mirror_each_other():
    dead, green = Field(mean=0.2, sd=0.1), Field(mean=0.8, sd=0.1)
    x = np.linspace(0, 1, 11)
    np.testing.assert_allclose(dead.distribution("brown").cdf(x), green.distribution("brown").sf(1 - x), atol=1e-12)


@pytest.mark.parametrize(
    ("mean", "sd", "said"),
    [
        (0.2, 0.4, "below 0.4, got 0.4"),
        (0.2, 0.5, "brown lies between 0 and 1: with a mean of 0.2 its sd must be above 0 and below 0.4, got 0.5"),
        (0.2, 0.0, "its sd must be above 0 and below 0.4, got 0"),
        (0.0, 0.1, "brown lies between 0 and 1: for it to vary .* such as 0.2, got 0$"),
        (1.0, 0.1, "for it to vary .*, got 1$"),
        (-0.2, 0.1, "for it to vary .*, got -0.2$"),
    ],
)
def test_what_no_share_has_is_refused(mean, sd, said):
    with pytest.raises(ValueError, match=said):
        Field(mean=mean, sd=sd).distribution("brown")
    assert Field(mean=0.2, sd=0.3999).distribution("brown").std() == pytest.approx(0.3999, rel=1e-12)


def test_field_is_that_of_the_paper_without_a_word_and_takes_limits():
    assert Field() == Field(mean=0.0, sd=0.0, arp=0.15)
    assert fifesim.Field is Field
    for limit in ({"mean": 1}, {"mean": -1}, {"sd": np.int64(0)}, {"arp": 0}, {"arp": 0.2498}, {"sd": np.float32(3)}):
        Field(**limit)


@pytest.mark.parametrize(
    ("values", "error", "said"),
    [
        ({"sd": -0.1}, ValueError, "Field: sd must be at least 0, got -0.1"),
        ({"sd": np.inf}, ValueError, "sd must be at least 0"),
        ({"sd": np.nan}, ValueError, "sd must be at least 0"),
        ({"mean": 1.01}, ValueError, r"Field: mean must be in \[-1, 1\], got 1.01"),
        ({"mean": -1.01}, ValueError, r"mean must be in \[-1, 1\], got -1.01"),
        ({"mean": np.nan}, ValueError, "mean must be in"),
        ({"arp": 0.25}, ValueError, "arp must be in"),
        ({"arp": -0.01}, ValueError, "arp must be in"),
        ({"coarser": 0}, ValueError, "coarser must be in 1 to 100, got 0"),
        ({"coarser": 2.5}, TypeError, "coarser must be a whole number"),
        ({"arp": 0.2499}, ValueError, "Field: arp must be at most 0.2498, got 0.2499"),
        ({"sd": True}, TypeError, "sd must be a number"),
        ({"mean": "0.2"}, TypeError, r"Field: mean must be a number, got .*: type Field\(mean=0.2, sd=0.1\)"),
        ({"arp": None}, TypeError, "arp must be a number"),
        ({"mean": np.zeros((2, 2))}, TypeError, "mean must be a number"),
    ],
)
def test_number_out_of_range_is_named(values, error, said):
    with pytest.raises(error, match=said):
        Field(**values)
