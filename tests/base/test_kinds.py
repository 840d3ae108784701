"""What a value is, and a few words for it, whatever its size."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.base import arguments
from fifesim.base.arguments import kind_of
from fifesim.ground.canopy.description import LEAF
from fifesim.sensor.description.instrument_file import InstrumentLike


@pytest.mark.parametrize(
    ("kind", "fits", "others"),
    [
        (arguments.NUMBER, [1, 2.5, np.float32(1), np.array(3.0)], [True, "1", None, [1.0], np.ones(2), np.array("a")]),
        (arguments.NUMBERS, [1, [1.0, 2.0], np.ones((2, 2)), xr.DataArray([1.0])], [None, "1", ["1"], np.array(["a"])]),
        (arguments.PAIR, [30, (30, 15)], [(1, 2, 3), "30", np.ones((2, 2)), ("a", "b")]),
        (arguments.FLAG, [True, np.bool_(False)], [1, 0, None, "no"]),
        (arguments.CHUNKS, [256, "auto", "64MB", {"y": 2}, (2, 2), None], ["many", xr.Dataset(), np.ones(2)]),
        (LEAF, [fifesim.Leaf(), {"TM3": (0.1, 0.1)}, (0.1, 0.1)], [0.1, (0.1,), 5]),
        (kind_of(InstrumentLike), ["TM", fifesim.instrument("TM")], [None, ["TM"], 5]),
    ],
)
def test_kinds_know_their_own(kind, fits, others):
    assert all(kind.fits(value) for value in fits)
    assert not any(kind.fits(value) for value in others)


def test_a_value_is_told_in_a_few_words(lai):
    values = [lai, lai.to_dataset(), lai.values, "x" * 900, list(range(900)), lai.odc.geobox, np.ma.ones(3), object]
    for value in values:
        text = arguments.described(value)
        assert len(text) <= 120 and "\n" not in text
    assert arguments.described(lai) == "an xarray.DataArray (y: 45, x: 54)"
    assert arguments.described(np.ma.ones(3)) == "a masked numpy array (3,)"
