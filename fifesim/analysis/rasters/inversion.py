"""Maps of a variable from an image by a fitted line, and their error against the truth."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import xarray as xr

from fifesim.analysis import uncertainty
from fifesim.analysis.rasters.pairs import check_same_quantity, matched
from fifesim.analysis.regression import Regression, totals
from fifesim.base.annotations import Pairing
from fifesim.rasters import cf, chunks, swaths
from fifesim.rasters.annotations import RasterOrDataset
from fifesim.rasters.reductions import sums_by_row

_LIMITS = ("low", "high")

# Physical range by quantity; maps above an LAI of 20 are refused elsewhere as wrongly scaled.
_RANGES = {"lai": (0.0, 20.0), "fpar": (0.0, 1.0)}

# Meanings of the flag by value.
_FLAGS = {-1: "no_data", 0: "as_fitted", 1: "extrapolated", 2: "clipped_to_minimum", 3: "clipped_to_maximum"}


def invert(
    ndvi: xr.DataArray, fit: Regression, quantity: Literal["lai", "fpar"] = "lai", *, level: float = 0.95
) -> xr.Dataset:
    """
    Map of a variable from an index by a regression, with its prediction interval.

    The line may leave the physical range, 0 to 20 for LAI and 0 to 1 for FPAR. Such values and the ends of their
    interval are clipped to it and flagged.

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
        The variable, ``low`` and ``high``, the ends of its interval, and ``flag``. Lazy where ``ndvi`` is. The flag is
        2 or 3 where the variable was clipped to its minimum or maximum, 1 where the index is more than 3 standard
        deviations from the mean of the fitted data, -1 without data, else 0; its attributes are CF's ``flag_values``
        and ``flag_meanings``.

    Raises
    ------
    ValueError
        If the quantity or the level is not one allowed, or the fit is of another quantity or on another index.

    See Also
    --------
    fifesim.analysis.regression.Regression.prediction_interval,
    fifesim.analysis.regression.Regression.extrapolates

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
    ['flag', 'high', 'lai', 'low']
    >>> clear = estimate["lai"].where(estimate["flag"] == 0)  # without clipped and extrapolated pixels
    """
    if quantity not in _RANGES:
        raise ValueError(f"quantity must be 'lai' or 'fpar', got {quantity!r}")
    _check_names(ndvi, fit, quantity)
    if not 0 < level < 1:
        raise ValueError(f"level must be between 0 and 1, got {level:g}: 0.95 holds 95 % of new values")
    line = f"invert: {fit.intercept:.6g} + {fit.slope:.6g} x {ndvi.name or 'index'}"
    known = {"fit": fit, "allowed": _RANGES[quantity]}
    found = {quantity: chunks.pointwise(_clipped, ndvi, **known)}
    found |= {name: chunks.pointwise(_limit, ndvi, end=k, level=level, **known) for k, name in enumerate(_LIMITS)}
    for name, values in found.items():
        found[name] = cf.label(swaths.placed_as(values, ndvi), quantity, source=ndvi, history=line).rename(name)
        # A standard name says that the values are the quantity, which the ends of an interval are not.
        if name in _LIMITS:
            found[name].attrs.pop("standard_name", None)
            found[name].attrs["long_name"] += f", {name} end of the {100 * level:g} % prediction interval"
    flag = swaths.placed_as(chunks.pointwise(_flag, ndvi, dtype=np.int8, **known), ndvi).rename("flag")
    flag.attrs = {
        "standard_name": f"{found[quantity].attrs['standard_name']} status_flag",
        "long_name": f"flag of the {found[quantity].attrs['long_name']}",
        "flag_values": np.array(list(_FLAGS), np.int8),
        "flag_meanings": " ".join(_FLAGS.values()),
        "history": found[quantity].attrs["history"],
    }
    found[quantity].attrs["ancillary_variables"] = "flag"
    return xr.Dataset(found | {"flag": flag})


def inversion_error(estimate: RasterOrDataset, truth: xr.DataArray, *, pair: Pairing = "coordinates") -> xr.Dataset:
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
    variables = [name for name in estimate.data_vars if name not in (*_LIMITS, "flag")]
    if len(variables) != 1 or not set(_LIMITS) <= set(estimate.data_vars):
        raise ValueError(
            f"an estimate has one variable with low and high, as invert gives it, got {list(estimate.data_vars)}: "
            "give a single map as a DataArray"
        )
    return [estimate[name] for name in (*variables, *_LIMITS)]


def _clipped(index, fit, allowed):
    """Value of the line, clipped to its physical range."""
    return np.clip(fit.predict(index), *allowed)


def _limit(index, fit, allowed, end, level):
    """One end of the prediction interval, clipped to the physical range."""
    return np.clip(fit.prediction_interval(index, level)[end], *allowed)


def _flag(index, fit, allowed):
    """Flag of each pixel, a key of `_FLAGS`."""
    line, (lowest, highest) = fit.predict(index), allowed
    reasons = [np.isnan(line), line < lowest, line > highest, fit.extrapolates(index)]
    return np.select(reasons, [-1, 2, 3, 1], 0)
