"""Which pixels of two rasters make a pair."""

import numpy as np
import pytest
from lazy import ODD_CHUNKS, in_chunks

import fifesim
from fifesim.analysis.regression_labels import matched, origins, sound_cells
from fifesim.grids import grid as grids

CELL = 30 / 9


def test_pairs_lie_in_the_same_place(pair):
    """Rasters that cover other ground are cut to what they share."""
    y, x = pair
    cut = fifesim.regress(y[3:40, :50], x[:, 7:])
    assert cut == fifesim.regress(y[3:40, 7:50], x[3:40, 7:50])


def test_pairs_may_be_matched_by_row_and_column(pair):
    y, x = pair
    moved = grids.place(x, fifesim.fife_site(CELL, window=((91, 136), (180, 234))))
    assert fifesim.regress(y, moved, pair="index") == fifesim.regress(y, x)
    assert fifesim.regress(y, moved).r2 < 0.5
    assert fifesim.regress(y, moved).n == 44 * 54


def test_unmatched_rasters_are_refused(pair):
    y, x = pair
    with pytest.raises(ValueError, match=r"different lattices.*pair=\"index\""):
        fifesim.regress(y, fifesim.aggregate(x, 30.0))
    with pytest.raises(ValueError, match="do not overlap"):
        fifesim.regress(y[:10], x[20:])
    with pytest.raises(ValueError, match="pair must be 'coordinates' or 'index', got 'place'"):
        fifesim.regress(y, x, pair="place")
    with pytest.raises(ValueError, match="select one band first"):
        fifesim.regress(y.expand_dims(band=["a"]), x)


def test_rasters_are_cut_to_their_common_ground(lai):
    """Whichever of the two begins first, along each axis."""
    one, other = matched(lai[5:40, :30], lai[:20, 11:])
    np.testing.assert_array_equal(one, lai[5:20, 11:30])
    np.testing.assert_array_equal(other, one)
    one, other = matched(lai[5:40, :30], lai[:20, 11:], pair="index")
    np.testing.assert_array_equal(one, lai[5:25, :30])
    np.testing.assert_array_equal(other, lai[:20, 11:41])


def test_origins_are_means_of_first_rows_where_there_is_one(lai):
    gap, empty = lai.copy(), lai.copy()
    gap[0, 3], empty[0] = np.inf, np.nan
    expected = [lai.values[0].mean(), np.delete(lai.values[0], 3).mean(), 0.0]
    np.testing.assert_allclose(origins(lai, gap, in_chunks(empty, ODD_CHUNKS)), expected, rtol=1e-14)


def test_digital_numbers_are_refused(lai):
    with pytest.raises(ValueError, match="lai holds digital numbers, whose 0 is no data: convert it with"):
        sound_cells(lai.assign_coords(gain=1.0))
