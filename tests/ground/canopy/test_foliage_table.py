"""Tables over leaf area and dead share."""

import numpy as np
import pytest

from fifesim.ground.canopy.crowns import crown_shares
from fifesim.ground.canopy.interpolation import crown_table, tabulate_foliage


def test_nodes_of_a_table_are_its_function():
    """Of B-splines times 6, (c_-1 + 4 c_0 + c_1) / 6, in single precision."""
    table = tabulate_foliage(lambda lai, brown: np.exp(-lai * (1 + brown))[None], rate=1.0)
    c = 6 * table.coefficients[..., 0].astype(float)
    across = (c[:-2] + 4 * c[1:-1] + c[2:]) / 6
    found = across[:, :-2] + 4 * across[:, 1:-1] + across[:, 2:]
    position = np.arange(len(found)) / table.steps[0]
    odds = np.arange(found.shape[1]) / table.steps[1]
    lai, brown = (1 / (1 - position) ** 2 - 1) / table.rate, odds**2 / (odds**2 + (1 - odds) ** 2)
    np.testing.assert_allclose(found, np.exp(-lai[:, None] * (1 + brown)), rtol=0, atol=3e-7)


def test_crowns_at_nodes_of_their_table():
    table = crown_table(0.8, 60, 40, 10)
    found = table[:-2] + 4 * table[1:-1] + table[2:]
    root = np.linspace(0, 1, len(found))
    shares = crown_shares(1 - root**4, 0.8, 60, 40, 10)
    expected = np.stack([shares.sun, shares.view, shares.apart, shares.lit], axis=-1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_a_table_that_cannot_be_says_so():
    with pytest.raises(ValueError, match="exact=True"):
        tabulate_foliage(lambda lai, _: np.floor(lai)[None], rate=1.0, by_brown=False)
