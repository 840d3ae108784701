"""How far a result lies from another."""

import numpy as np
import pytest

from fifesim.experiments.verification.deviations import Deviation, largest, rms_percent


def test_what_is_not_a_number_is_beyond_its_bound():
    assert np.isnan(largest([1.0, np.nan], 1.0))
    assert not Deviation("canopy", "anything", np.nan, 1.0, "1", "theory").within
    assert Deviation("canopy", "anything", 1.0, 1.0, "1", "theory").within


def test_deviations_are_the_largest_and_the_mean():
    assert largest([1.0, 4.0], [2.0, 2.0]) == 2.0 and largest([1.0, 4.0], [2.0, 4.0], relative=True) == 0.5
    assert rms_percent([1.03, 0.96], 1.0) == pytest.approx(np.sqrt((9 + 16) / 2), rel=1e-12)
