"""Tables of the data folder are copies, and one that is missing is named."""

import pytest

from fifesim.base import files


def test_tables_are_copies_that_may_be_changed():
    files.table("lai_distributions.csv").loc[:, "mean"] = -1.0
    assert (files.table("lai_distributions.csv")["mean"] > 0).all()


def test_missing_table_is_named():
    with pytest.raises(FileNotFoundError, match=r"'no_such\.csv'"):
        files.path("no_such.csv")
