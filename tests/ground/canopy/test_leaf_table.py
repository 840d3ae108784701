"""Leaves that differ: the table and the kinds of leaf beside PROSPECT of one leaf after the other."""

from dataclasses import replace

import numpy as np
import pytest

import fifesim
from fifesim.base.arrays import distinct_columns
from fifesim.ground.canopy import optics
from fifesim.ground.canopy.optics import LEAF_TOLERANCE, leaf_means
from fifesim.ground.canopy.prospect import CONTENTS, LARGEST_STRUCTURE, Leaf

BANDS = tuple(band.response for band in fifesim.instrument("TM").select(["TM3", "TM4"]))


def one_by_one(leaf, name, values):
    return np.stack(
        [optics.band_leaf_optics(BANDS, replace(leaf, **{name: float(value)})) for value in values], axis=-1
    )


@pytest.mark.parametrize("name", ["structure", *CONTENTS])
def test_table_of_a_content_is_within_its_bound(name):
    """Over the whole range, its ends and small values, where light decays fastest."""
    low, high = (1.0, LARGEST_STRUCTURE) if name == "structure" else (0.0, CONTENTS[name][1])
    share = np.concatenate([[0, 1], np.random.default_rng(5).uniform(0, 1, 20) ** 4])
    values = np.minimum(low + share * (high - low), high)
    found = leaf_means(BANDS, Leaf(**{name: values}))
    np.testing.assert_allclose(found, one_by_one(Leaf(), name, values), rtol=0, atol=LEAF_TOLERANCE)


def test_exact_leaves_are_those_of_prospect():
    values = np.array([[5.0, 20.0, 20.0], [80.0, 5.0, 0.0]])
    found = leaf_means(BANDS, Leaf(chlorophyll=values), exact=True)
    expected = one_by_one(Leaf(), "chlorophyll", values.ravel()).reshape(2, 2, 2, 3)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_several_contents_are_computed_by_kind_of_leaf(monkeypatch):
    """Equal leaves once, and contents that broadcast."""
    asked = []
    means = optics.leaf_band_means
    monkeypatch.setattr(
        optics,
        "leaf_band_means",
        lambda contents, weights: asked.append(max(map(np.size, contents))) or means(contents, weights),
    )
    water, chlorophyll = np.array([0.01, 0.02, 0.01, 0.02]), np.array([[30.0], [50.0], [30.0]])
    found = leaf_means(BANDS, Leaf(water=water, chlorophyll=chlorophyll))
    assert found.shape == (2, 2, 3, 4) and asked == [4]
    for row, column in np.ndindex(3, 4):
        leaf = Leaf(water=float(water[column]), chlorophyll=float(chlorophyll[row, 0]))
        np.testing.assert_allclose(found[..., row, column], optics.band_leaf_optics(BANDS, leaf), rtol=1e-12)


def test_missing_content_is_missing_optics():
    for leaf in (
        Leaf(water=np.array([0.01, np.nan])),
        Leaf(water=np.array([0.01, np.nan]), brown=np.array([0.1, 0.2])),
    ):
        found = leaf_means(BANDS, leaf)
        assert np.isfinite(found[..., 0]).all() and np.isnan(found[..., 1]).all()
    assert np.isnan(leaf_means(BANDS, Leaf(water=np.full(2, np.nan), brown=np.zeros(2)))).all()


def test_leaves_almost_without_absorption_give_no_more_than_they_get():
    """The table's error beside 1 is more than rounding here, and SAIL would refuse such a leaf."""
    coastal = fifesim.instrument("MSI").select(["MSI1"])[0].response
    clear = dict.fromkeys(CONTENTS, 0.0) | {"brown": np.geomspace(1e-15, 0.1, 3000)}
    assert leaf_means((coastal,), Leaf(structure=1.0, **clear)).sum(axis=0).max() <= 1 + 1e-15


def test_equal_columns_are_found():
    rows = np.array([[1.0, 2.0, 1.0, np.nan, 2.0, np.nan], [5.0, 5.0, 5.0, 1.0, 6.0, 1.0]])
    first, kind = distinct_columns(rows)
    assert first.tolist() == [0, 1, 3, 4] and kind.tolist() == [0, 1, 0, 2, 3, 2]
    np.testing.assert_array_equal(rows[:, first][:, kind], rows)
    assert [each.tolist() for each in distinct_columns(np.empty((2, 0)))] == [[], []]
