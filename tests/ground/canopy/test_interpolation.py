"""Tests of tables over leaf area index against the tabulated functions."""

import numpy as np
import pytest

from fifesim.ground.canopy.crowns import crown_shares, crowns_over_background
from fifesim.ground.canopy.interpolation import (
    LARGEST_FOLIAGE_LAI,
    LARGEST_TABLE_LAI,
    crown_table,
    interpolate,
    interpolate_crowned,
    interpolate_foliage,
    tabulate,
    tabulate_foliage,
)


def test_tables_meet_their_tolerance_or_raise():
    table = tabulate(lambda lai: np.stack([np.exp(-5 * lai), lai**2 / (1 + lai**2)]), rate=5.0)
    lai = np.random.default_rng(2).uniform(0, LARGEST_TABLE_LAI, 10_000)
    np.testing.assert_allclose(interpolate(table, lai), [np.exp(-5 * lai), lai**2 / (1 + lai**2)], atol=2.5e-7)
    with pytest.raises(ValueError, match="exact=True"):
        tabulate(lambda lai: np.floor(lai)[None], rate=1.0)
    with pytest.raises(ValueError, match="exact=True"):
        tabulate_foliage(lambda lai, _: np.floor(lai)[None], rate=1.0, by_brown=False)


def test_values_outside_a_table_are_nan():
    table = tabulate(lambda lai: np.exp(-lai)[None], rate=1.0)
    assert np.all(np.isnan(interpolate(table, [np.nan, -1e-9, LARGEST_TABLE_LAI * 1.001, np.inf])))


def terms_of(count, lai, brown):
    """Terms of two bands for dead leaves below green ones, with decay rates typical of canopies."""
    rates = np.linspace(0.5, 2.0, 2 * count)[:, None]
    return (np.exp(-rates * (1 - brown) * lai) + 0.5 * np.exp(-rates * brown * lai)) / (1 + rates)


@pytest.fixture(scope="module")
def table():
    return tabulate_foliage(lambda lai, brown: terms_of(4, lai, brown), rate=2.0)


@pytest.fixture(scope="module")
def crowned():
    return tabulate_foliage(lambda lai, brown: 0.5 * terms_of(8, lai, brown), rate=2.0)


@pytest.mark.parametrize("view", [(28.5, 0, 0), (60, 58, 10), (85, 80, 180)])
def test_interpolate_crowned_matches_its_terms(crowned, view):
    rng = np.random.default_rng(3)
    lai = np.concatenate([[0, 0, 50, 50], rng.gamma(1.5, 1.5, 500), rng.uniform(0, LARGEST_FOLIAGE_LAI, 500)])
    brown, cover = rng.uniform(0, 1, 1004), rng.uniform(0.1, 1, 1004)
    brown[:4], cover[:4] = [0, 1, 0, 1], [0, 1, 1, 1]
    lai, ground = np.minimum(lai, 0.99 * LARGEST_FOLIAGE_LAI * cover), rng.uniform(0, 0.4, (2, 1004))
    shares = crown_shares(cover, 0.8, *view)
    of_crowns = cover, shares.sun, shares.view, shares.apart, shares.lit
    inside = np.divide(lai, cover, where=cover > 0, out=np.zeros_like(lai))
    terms = tuple(0.5 * terms_of(8, inside, brown).reshape(2, 8, -1).swapaxes(0, 1))
    expected = crowns_over_background(terms, of_crowns, ground)
    found, wrong = interpolate_crowned(crowned, crown_table(0.8, *view), lai, brown, cover, ground)
    assert wrong == 0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_single_dead_share_applies_to_all_cells(table):
    lai = np.random.default_rng(3).uniform(0, 8, 600)
    one, all_cells = (interpolate_foliage(table, lai, np.full(n, 0.3), np.full((2, 1), 0.2))[0] for n in (1, 600))
    np.testing.assert_array_equal(one, all_cells)


def test_foliage_is_nan_without_data_and_infinite_beyond_the_table(table):
    lai, brown = np.array([1, np.nan, 1, LARGEST_FOLIAGE_LAI + 1e-9]), np.array([0.2, 0.2, np.nan, 0.2])
    found, wrong = interpolate_foliage(table, lai, brown, np.array([[0.1], [0.2]]))
    assert np.isfinite(found[:, 0]).all() and np.isnan(found[:, 1:3]).all() and np.isinf(found[:, 3]).all()
    assert wrong == 0


def test_crowned_is_nan_without_data_and_infinite_beyond_the_table(crowned):
    lai = np.array([1, np.nan, 1, 1, 1, 0.5 * LARGEST_FOLIAGE_LAI + 1e-9])
    brown, cover = np.array([0.2, 0.2, np.nan, 0.2, 0.2, 0.2]), np.array([0.5, 0.5, 0.5, np.nan, 1.5, 0.5])
    found, wrong = interpolate_crowned(crowned, crown_table(1.0, 30, 0, 0), lai, brown, cover, np.full((2, 1), 0.2))
    assert np.isfinite(found[:, 0]).all() and np.isnan(found[:, 1:5]).all() and np.isinf(found[:, 5]).all()
    assert wrong > 0


@pytest.mark.parametrize(("name", "most"), [("lai", 100), ("brown", 1), ("ground", 1), ("cover", 1)])
@pytest.mark.parametrize("is_low", [True, False])
def test_invalid_values_are_counted(table, crowned, name, most, is_low):
    """In any run of cells; NaN is not counted."""
    n = 600
    given = {"lai": np.ones(n), "brown": np.full(n, 0.2), "cover": np.full(n, 0.5), "ground": np.full((2, n), 0.2)}
    for each in given.values():
        each[..., 5] = np.nan
    given[name].reshape(-1)[-10] = -0.005 if is_low else most + 0.005
    assert interpolate_crowned(crowned, crown_table(1.0, 30, 0, 0), *given.values())[1] > 0
    del given["cover"]
    assert bool(interpolate_foliage(table, *given.values())[1]) == (name != "cover")
