"""Regression of labelled rasters."""

from __future__ import annotations

from dataclasses import replace

import xarray as xr

from fifesim.analysis import regression
from fifesim.analysis.rasters.pairs import matched, origins
from fifesim.analysis.regression import Regression
from fifesim.base.annotations import Pairing
from fifesim.rasters.reductions import sums_by_row


def regress(y: xr.DataArray, x: xr.DataArray, *, pair: Pairing = "coordinates") -> Regression:
    """
    Least-squares line of one raster on another; computes.

    Parameters
    ----------
    y, x : xarray.DataArray, dims (y, x)
        The dependent and the independent variable; pairs with NaN are left out.
    pair : {"coordinates", "index"}, optional
        Match pixels that lie in the same place, or that have the same row and column.

    Returns
    -------
    regression : fifesim.analysis.regression.Regression
        The same to the bit under any chunking.

    Raises
    ------
    ValueError
        If the rasters do not match, or fewer than three pairs are left.

    See Also
    --------
    fifesim.analysis.regression.fit

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> fit = fifesim.regress(lai.fifesim.aggregate(30), image.fifesim.ndvi())
    >>> fit.n, round(fit.r2, 2)
    (100, 0.95)
    """
    y, x = matched(y, x, pair)
    y_origin, x_origin = origins(y, x)
    sums = sums_by_row(regression.row_sums, y, x, count=6, y_origin=y_origin, x_origin=x_origin)
    names = [array.attrs.get("standard_name", "") for array in (y, x)]
    return replace(regression.fit(sums, y_origin, x_origin), y_name=names[0], x_name=names[1])
