"""Checks of line spreads notice a width that is wrong by a thousandth."""

import pytest

from fifesim.base.footprints import Boxcar
from fifesim.experiments.verification import line_spread
from fifesim.sensor.response.spatial import CosineSpread, GaussianSpread


@pytest.mark.parametrize(
    ("name", "wrong"), [("cosine", CosineSpread(30.03)), ("boxcar", Boxcar(30.03)), ("Gaussian", GaussianSpread(33.03))]
)
def test_a_width_that_is_wrong_is_named(monkeypatch, exceeded, name, wrong):
    monkeypatch.setitem(line_spread._SHAPES, name, (wrong, *line_spread._SHAPES[name][1:]))
    assert exceeded(line_spread) == [f"line spread and transfer, {name}"]


def test_all_is_well(exceeded):
    assert exceeded(line_spread) == []
