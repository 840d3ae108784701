"""Range of leaf area index: scaled values are refused with their scale, and implausible means are a warning."""

import warnings

import numpy as np
import pytest

from fifesim.ground.canopy.leaf_area import check_map, check_source, warn_of_large


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
