"""Check that annotations mean what the package takes and gives."""

import dask.array as da
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy import stats

import fifesim
from fifesim.base.annotations import Array, FrozenDistribution

MEMBERS = {Array: ["__array__"], FrozenDistribution: ["ppf", "cdf", "pdf", "mean", "std", "support"]}


@pytest.mark.parametrize("protocol", MEMBERS)
def test_members_are_those_that_are_looked_for(protocol):
    assert [name for name in vars(protocol) if name in MEMBERS[protocol] or not name.startswith("_")] == MEMBERS[
        protocol
    ]


@pytest.mark.parametrize("array", [np.ones(2), da.ones(2), pd.Series([1.0]), xr.DataArray([1.0])], ids=type)
def test_array_is_what_numpy_reads(array):
    assert all(hasattr(array, name) for name in MEMBERS[Array])


@pytest.mark.parametrize("source", [stats.gamma(4, scale=0.4), "burned-grazed"], ids=["frozen", "name"])
def test_distribution_is_a_frozen_one_of_scipy(source):
    found = fifesim.lai_distribution(source)
    assert all(callable(getattr(found, name)) for name in MEMBERS[FrozenDistribution])
