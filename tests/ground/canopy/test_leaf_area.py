"""Tests of the range of leaf area index: scaled integers are refused with a scale, implausible means cause warnings."""

import warnings

import numpy as np
import pytest

from fifesim.ground.canopy.leaf_area import check_fraction, check_map, check_share, check_source, warn_of_large, within


def test_message_for_percent_does_not_only_suggest_a_scale():
    percent = np.linspace(0, 100, 500)
    with pytest.raises(ValueError, match=r"may be percent of cover or of FPAR.*where they are scaled.*lai \* 0\.1"):
        check_map(percent)
    with pytest.raises(ValueError, match=r"at most 20: where the numbers are scaled, type lai \* 0\.1"):
        check_map(percent / 2)


def test_error_names_the_source_and_the_nodata_option():
    with pytest.raises(ValueError, match=r"^map\.tif, on the grid or next to it: .*got -9999.*-a_nodata"):
        check_source("map.tif", np.array([1.0, np.nan, -9999.0]))


def test_mean_above_dense_forest_causes_a_warning():
    tenths = 10 * np.array([[0.4, 1.2, np.nan], [0.9, 1.7, 0.3]])
    with pytest.warns(UserWarning, match=r"mean leaf area index is 9, dense forests have about 8.*lai \* 0\.1"):
        assert warn_of_large(tenths) is tenths
    with warnings.catch_warnings(action="error"):
        warn_of_large(np.array([7.9, 8.1, np.nan]))
        warn_of_large(np.full(3, np.nan))


def test_within_finds_values_outside_a_range_in_any_memory_layout():
    assert within(np.array([0.0, 1.0, np.nan]), 0, 1) and within(0.5, 0, 1) and within(np.empty(0), 0, 1)
    for wrong in (-1e-9, 1 + 1e-9, np.inf, -np.inf):
        for cells in (np.array([0.5, wrong]), np.array([[0.5, wrong]] * 4).T, np.array([[0.5, wrong]] * 4)[::2, ::-1]):
            assert not within(cells, 0, 1)
    assert check_share("brown", 0.3) == 0.3


@pytest.mark.parametrize("check", [check_fraction, check_share])
def test_invalid_fractions_are_refused_by_name_and_value(check):
    with pytest.raises(ValueError, match=r"brown must be in \[0, 1\], got 40: give a fraction, not percent"):
        check("brown", np.array([0.4, 40.0]))
    with pytest.raises(ValueError, match=r"got 1\.005"):
        check("brown", np.array([0.4, 1.005]))
