"""Range of leaf area index: scaled values are refused with their scale, and implausible means are a warning."""

import warnings

import numpy as np
import pytest

from fifesim.ground.canopy.leaf_area import check_fraction, check_map, check_share, check_source, warn_of_large, within


def test_percent_is_not_told_to_be_tenths():
    percent = np.linspace(0, 100, 500)
    with pytest.raises(ValueError, match=r"may be percent of cover or of FPAR.*where they are scaled.*lai \* 0\.1"):
        check_map(percent)
    with pytest.raises(ValueError, match=r"at most 20: where the numbers are scaled, type lai \* 0\.1"):
        check_map(percent / 2)


def test_an_error_about_a_source_names_it_and_its_nodata():
    with pytest.raises(ValueError, match=r"^map\.tif, on the grid or next to it: .*got -9999.*-a_nodata"):
        check_source("map.tif", np.array([1.0, np.nan, -9999.0]))


def test_a_mean_beyond_dense_forest_is_a_warning():
    tenths = 10 * np.array([[0.4, 1.2, np.nan], [0.9, 1.7, 0.3]])
    with pytest.warns(UserWarning, match=r"mean leaf area index is 9, dense forests have about 8.*lai \* 0\.1"):
        assert warn_of_large(tenths) is tenths
    with warnings.catch_warnings(action="error"):
        warn_of_large(np.array([7.9, 8.1, np.nan]))
        warn_of_large(np.full(3, np.nan))


def test_fractions_are_told_from_others():
    assert within(np.array([0.0, 1.0, np.nan]), 0, 1) and within(0.5, 0, 1) and within(np.empty(0), 0, 1)
    for wrong in (-1e-9, 1 + 1e-9, np.inf, -np.inf):
        for cells in (np.array([0.5, wrong]), np.array([[0.5, wrong]] * 4).T, np.array([[0.5, wrong]] * 4)[::2, ::-1]):
            assert not within(cells, 0, 1)
    assert check_share("brown", 0.3) == 0.3


@pytest.mark.parametrize("check", [check_fraction, check_share])
def test_others_are_refused_by_name_and_value(check):
    with pytest.raises(ValueError, match=r"brown must be in \[0, 1\], got 40: give a fraction, not percent"):
        check("brown", np.array([0.4, 40.0]))
