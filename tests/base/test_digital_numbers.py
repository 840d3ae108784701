"""Digital numbers are whole numbers within the range of the instrument."""

import numpy as np
import pytest

from fifesim.base.bands import check_counts, counts


@pytest.mark.parametrize(("dn", "said"), [(-1.0, "-1"), (256, "256"), (1.5, "1.5"), (-1, "-1"), (np.inf, "inf")])
def test_values_that_no_instrument_records_are_refused(dn, said):
    with pytest.raises(ValueError, match=f"digital number of {said} is not a whole number from 0 to 255: give nodata="):
        counts(np.array([dn]), 0, 255, "give nodata=")


def test_counts_are_kept_and_no_data_are_0():
    np.testing.assert_array_equal(counts(np.array([-9999, 7, 255], np.int16), -9999, 255, ""), [0, 7, 255])
    assert counts(np.array([300]), 0, 65535, "").dtype == np.uint16
    assert counts(np.array([30]), 0, 255, "").dtype == np.uint8


def test_saturated_counts_are_no_data():
    np.testing.assert_array_equal(counts(np.array([7, 254, 255]), 0, 255, "", saturated=255), [7, 254, 0])
    np.testing.assert_array_equal(counts(np.array([7, 254, 255]), 0, 255, ""), [7, 254, 255])


def test_nan_and_the_ends_of_the_range_pass():
    check_counts(np.array([np.nan, 0.0, 255.0]), 255, "")
