"""Relative equivalent noise of labelled rasters."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fifesim.analysis import uncertainty
from fifesim.analysis.rasters.pairs import matched, origins
from fifesim.analysis.rasters.regression import regress
from fifesim.base.annotations import Pairing
from fifesim.rasters import cf
from fifesim.rasters.reductions import extremes, sums_by_row

# More increments than this are a width in other units than the variable.
_MOST_INCREMENTS = 10_000


def relative_equivalent_noise(
    variable: xr.DataArray,
    ndvi: xr.DataArray,
    increment: float = 0.1,
    *,
    slope: float | None = None,
    min_count: int = 3,
    pair: Pairing = "coordinates",
) -> xr.Dataset:
    """
    Relative equivalent noise by increments of a variable; computes.

    Parameters
    ----------
    variable, ndvi : xarray.DataArray, dims (y, x)
        The truth, such as LAI or FPAR, and the index that it is inferred from; pairs with NaN are left out.
    increment : float, optional
        Width of an increment, in units of the variable. NDVI varies within it by the slope too, which alone makes a
        relative noise of ``increment / (sqrt(12) variable)``.
    slope : float, optional
        Of NDVI on the variable; by default that of its least-squares line.
    min_count : int, optional
        Pairs that an increment needs, at least 2; with fewer its noise is NaN.
    pair : {"coordinates", "index"}, optional
        As in `regress`.

    Returns
    -------
    noise : xarray.Dataset, dims (increment,)
        ``ren`` at the mean of the variable in each increment, that ``mean``, the ``deviation`` of NDVI and the
        ``count`` of pairs, with the middle of the increments as coordinate. The same to the bit under any chunking.

    Raises
    ------
    ValueError
        If the rasters do not match, the increment is not positive, or nothing is left.

    References
    ----------
    [Friedl1995]_, Eq. 7 and Fig. 7

    See Also
    --------
    fifesim.analysis.uncertainty.equivalent_noise

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 270), (0, 270)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> ndvi, truth = image.fifesim.ndvi(), lai.fifesim.aggregate(30)
    >>> noise = truth.fifesim.relative_equivalent_noise(ndvi, increment=0.2)
    >>> int(noise["count"].sum())
    900
    """
    if not 0 < increment < np.inf:
        raise ValueError(f"increment must be positive, got {increment:g}: it is a width in units of the variable")
    if min_count < 2:
        raise ValueError(f"min_count must be at least 2, got {min_count}: one value has no deviation")
    variable, ndvi = matched(variable, ndvi, pair)
    if slope is None:
        slope = regress(ndvi, variable, pair="index").slope
    low, high = extremes(variable)
    if not (np.isfinite(low) and np.isfinite(high)):
        raise ValueError(f"the variable goes from {low:g} to {high:g}: relative noise needs finite values")
    first, last = int(np.floor(low / increment)), int(np.floor(high / increment))
    if last - first >= _MOST_INCREMENTS:
        raise ValueError(
            f"increment {increment:g} cuts {low:g} to {high:g} into {last - first + 1} parts: "
            f"take a larger one, at most {_MOST_INCREMENTS} parts"
        )
    increments = last - first + 1
    (origin,) = origins(ndvi)
    sums = sums_by_row(
        uncertainty.increment_sums, variable, ndvi, count=uncertainty.SUMS * increments, first=first, width=increment,
        increments=increments, ndvi_origin=origin,
    )  # fmt: skip
    count, mean, deviation = uncertainty.increment_moments(sums)
    ren = np.where(count >= min_count, uncertainty.equivalent_noise(deviation, slope, mean), np.nan)
    middle = (first + 0.5 + np.arange(increments)) * increment
    out = xr.Dataset(
        {name: ("increment", values) for name, values in {
            "ren": ren, "mean": mean, "deviation": deviation, "count": count}.items()},
        coords={"increment": ("increment", middle, {"long_name": f"middle of increments of {variable.name}"})},
        attrs={"slope": float(slope), "width": float(increment)},
    )  # fmt: skip
    out["ren"].attrs = cf.attributes("ren")
    return out
