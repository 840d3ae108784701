"""Maps of a variable from an image by a fitted line, and their error against the truth."""

from __future__ import annotations

import math
from typing import Literal

import xarray as xr

from fifesim.analysis import uncertainty
from fifesim.analysis.rasters.pairs import check_same_quantity, matched
from fifesim.analysis.regression import Regression, totals
from fifesim.base.annotations import Pairing
from fifesim.rasters import cf, chunks, swaths
from fifesim.rasters.reductions import sums_by_row

_LIMITS = ("low", "high")


def invert(
    ndvi: xr.DataArray, fit: Regression, quantity: Literal["lai", "fpar"] = "lai", *, level: float = 0.95
) -> xr.Dataset:
    """
    Map of a variable from an index by a regression, with its prediction interval.

    Parameters
    ----------
    ndvi : xarray.DataArray, dims (y, x)
        What the variable was regressed on.
    fit : fifesim.analysis.regression.Regression
        From `regress`, of the variable on the index.
    quantity : {"lai", "fpar"}, optional
        The variable.
    level : float, optional
        Share of new values that the interval holds. [1]

    Returns
    -------
    estimate : xarray.Dataset, dims (y, x)
        The variable, and ``low`` and ``high``, the ends of its interval. Lazy where ``ndvi`` is. Values are as the line
        gives them, and may be negative.

    Raises
    ------
    ValueError
        If the quantity or the level is not one allowed, or the fit is of another quantity or on another index.

    See Also
    --------
    fifesim.analysis.regression.Regression.prediction_interval

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> ndvi, truth = image.fifesim.ndvi(), lai.fifesim.aggregate(30)
    >>> estimate = ndvi.fifesim.invert(fifesim.regress(truth, ndvi))
    >>> sorted(estimate.data_vars)
    ['high', 'lai', 'low']
    """
    if quantity not in ("lai", "fpar"):
        raise ValueError(f"quantity must be 'lai' or 'fpar', got {quantity!r}")
    _check_names(ndvi, fit, quantity)
    if not 0 < level < 1:
        raise ValueError(f"level must be between 0 and 1, got {level:g}: 0.95 holds 95 % of new values")
    kernels = {quantity: fit.predict} | {name: _limit(fit, k, level) for k, name in enumerate(_LIMITS)}
    found = {}
    for name, kernel in kernels.items():
        values = swaths.placed_as(chunks.pointwise(kernel, ndvi), ndvi)
        line = f"invert: {fit.intercept:.6g} + {fit.slope:.6g} x {ndvi.name or 'index'}"
        found[name] = cf.label(values, quantity, source=ndvi, history=line).rename(name)
        # A standard name says that the values are the quantity, which the ends of an interval are not.
        if name in _LIMITS:
            found[name].attrs.pop("standard_name", None)
            found[name].attrs["long_name"] += f", {name} end of the {100 * level:g} % prediction interval"
    return xr.Dataset(found)


def inversion_error(
    estimate: xr.Dataset | xr.DataArray, truth: xr.DataArray, *, pair: Pairing = "coordinates"
) -> xr.Dataset:
    """
    Error of an estimated map against the truth; computes.

    Parameters
    ----------
    estimate : xarray.Dataset or xarray.DataArray, dims (y, x)
        From `invert`, or a map alone.
    truth : xarray.DataArray, dims (y, x)
    pair : {"coordinates", "index"}, optional
        As in `regress`.

    Returns
    -------
    error : xarray.Dataset
        ``bias``, mean of estimate less truth; ``rmse``, the root of its mean square; ``n``, the pixels; of a Dataset
        ``coverage`` also, the share of true values within the interval. The same to the bit under any chunking.

    Raises
    ------
    ValueError
        If the rasters do not match, no pixel has both, or a Dataset is not as `invert` gives it.

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> ndvi, truth = image.fifesim.ndvi(), lai.fifesim.aggregate(30)
    >>> estimate = ndvi.fifesim.invert(fifesim.regress(truth, ndvi))
    >>> error = estimate.fifesim.inversion_error(truth)
    >>> abs(round(float(error.bias), 6)), round(float(error.coverage), 2)
    (0.0, 0.96)
    """
    value, low, high = [estimate] * 3 if isinstance(estimate, xr.DataArray) else _map_and_limits(estimate)
    check_same_quantity(value, truth, ("estimate", "truth"))
    value, true = matched(value, truth, pair)
    low, _ = matched(low, truth, pair)
    high, _ = matched(high, truth, pair)
    n, total, squares, inside = totals(sums_by_row(uncertainty.error_sums, true, value, low, high, count=4))
    if n == 0:
        raise ValueError("no pixel has both an estimate and a true value: do the rasters overlap?")
    found = {"bias": total / n, "rmse": math.sqrt(squares / n), "n": int(n)}
    if isinstance(estimate, xr.Dataset):
        found["coverage"] = inside / n
    return xr.Dataset(found)


def _check_names(ndvi, fit, quantity):
    """Raise ValueError if a regression is not of the quantity on the index, by their standard names."""
    wanted, given = cf.QUANTITIES[quantity].standard_name, ndvi.attrs.get("standard_name", "")
    if fit.y_name and fit.y_name != wanted:
        raise ValueError(
            f"fit must be of {wanted}, got one of {fit.y_name} on {fit.x_name or 'an index'}: exchange the arguments "
            "of regress, or name the quantity"
        )
    if fit.x_name and given and fit.x_name != given:
        raise ValueError(f"ndvi must be {fit.x_name}, as in the fit, got {given}: give the raster of the index")


def _map_and_limits(estimate):
    """Variable of an estimate, and the ends of its interval."""
    variables = [name for name in estimate.data_vars if name not in _LIMITS]
    if len(variables) != 1 or not set(_LIMITS) <= set(estimate.data_vars):
        raise ValueError(
            f"an estimate has one variable with low and high, as invert gives it, got {list(estimate.data_vars)}: "
            "give a single map as a DataArray"
        )
    return [estimate[name] for name in (*variables, *_LIMITS)]


def _limit(fit, end, level):
    return lambda values: fit.prediction_interval(values, level)[end]
