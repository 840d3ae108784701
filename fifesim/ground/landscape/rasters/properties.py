"""Properties of a landscape, made of standard normal fields."""

from functools import partial

import numpy as np

from fifesim.ground.landscape.quantiles import quantile_map, quantile_table
from fifesim.rasters import cf
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids


def with_distribution(field, quantity, distribution):
    """
    A standard normal field as one of another distribution, by its quantiles.

    Parameters
    ----------
    field : xarray.DataArray, dims (y, x)
        From `correlated_fields`.
    quantity : str
        What it becomes: "lai", "moisture", or another key of `fifesim.rasters.cf.QUANTITIES`.
    distribution : frozen scipy distribution
        Without negative values.

    Returns
    -------
    values : xarray.DataArray, dims (y, x)
        Lazy where the field is.

    Raises
    ------
    ValueError
        If the distribution has negative values.

    See Also
    --------
    fifesim.ground.landscape.quantiles.quantile_map
    """
    if distribution.support()[0] < -1e-12:
        raise ValueError(
            f"{quantity} cannot be negative, got a distribution from {distribution.support()[0]:g} up: truncate it, "
            "for instance scipy.stats.truncnorm"
        )
    values = chunking.pointwise(partial(quantile_map, table=quantile_table(distribution)), field)
    return _labelled(values, field, quantity, f"{quantity}: by quantiles")


def with_deviation(field, quantity, deviation):
    """
    A standard normal field times a standard deviation.

    Parameters
    ----------
    field : xarray.DataArray, dims (y, x)
        From `correlated_fields`.
    quantity : str
        Such as "soil".
    deviation : float
        Not negative.

    Returns
    -------
    values : xarray.DataArray, dims (y, x)
        Lazy where the field is.

    Raises
    ------
    ValueError
        If the deviation is negative.
    """
    if not 0 <= deviation < np.inf:
        raise ValueError(f"the standard deviation of {quantity} must not be negative, got {deviation:g}")
    return _labelled(field * float(deviation), field, quantity, f"{quantity}: standard deviation {deviation:g}")


def _labelled(values, field, quantity, said):
    placed = grids.place(values, grids.geobox(field))
    return cf.label(placed, quantity, source=field, history=said)
