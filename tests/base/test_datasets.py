"""Tables of the data folder are copies, and one that is missing is named."""

import pytest

from fifesim.base import datasets


def test_tables_are_copies_that_may_be_changed():
    datasets.table("lai_distributions.csv").loc[:, "mean"] = -1.0
    assert (datasets.table("lai_distributions.csv")["mean"] > 0).all()


def test_missing_table_is_named():
    with pytest.raises(FileNotFoundError, match=r"'no_such\.csv'"):
        datasets.path("no_such.csv")
