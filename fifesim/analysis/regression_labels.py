"""Regression of labelled rasters: pairs of pixels, and relative equivalent noise."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np
import xarray as xr

from fifesim.analysis import regression
from fifesim.analysis.regression import Regression
from fifesim.base.arguments import Pairing, Range
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.grids.grid import with_crs_of
from fifesim.grids.reductions import computed, extremes, sums_by_row

# Fill values of files, which are no valid values of any quantity here, and a bound for valid values.
_FILLS = (-999.0, -9999.0, -99999.0, -32768.0, 65535.0)
_LARGEST = 1e15

# Largest ratio of pixel sizes that count as equal: scanner pixels drift against a grid by some percent, and may be
# oblong.
_SAME_PIXEL = 2.0


def check_pair(pair):
    """Raise ValueError if no way of pairing pixels has this name."""
    if pair not in ("coordinates", "index"):
        raise ValueError(f"pair must be 'coordinates' or 'index', got {pair!r}")


def matched(y, x, pair="coordinates"):
    """Cut two rasters so that their pixels pair, by coordinates or by row and column."""
    check_pair(pair)
    y, x = sound_cells(y), sound_cells(x)
    for array in (y, x):
        if set(array.dims) != {"y", "x"}:
            cure = "select one band" if "time" not in array.dims else "select one date with .isel(time=0)"
            cure = "put a scan onto a map with .fifesim.grid_swath(grid)" if "line" in array.dims else cure
            raise ValueError(f"pairs are of rasters over (y, x), got {array.dims}: {cure} first")
    y, x = (array if array.dims == ("y", "x") else array.transpose("y", "x") for array in (y, x))
    return (_common_index if pair == "index" else _common_place)(y, x)


def sound_cells(array):
    """Check that the cells of a raster are physical values; a lazy raster is checked when it computes."""
    # A digital number of 0 is no data and would count as dark ground.
    if cf.is_counts(array):
        raise ValueError(
            f"{array.name or 'the array'} holds digital numbers, whose 0 is no data: convert it with "
            ".fifesim.to_reflectance() or .fifesim.to_radiance() first"
        )
    if array.dtype.kind == "b" or not array.size:
        return array
    check = partial(_sound, name=_range_name(array))
    lazy = not isinstance(array.data, np.ndarray)
    return grids.with_values(array, array.data.map_blocks(check, dtype=array.dtype) if lazy else check(array.data))


def _range_name(array):
    """Name of the quantity of a raster, by its standard name or name, if it has a range; else None."""
    stated = array.attrs.get("standard_name")
    named = [name for name, each in cf.QUANTITIES.items() if stated and each.standard_name == stated] or [array.name]
    known = cf.QUANTITIES.get(named[0])
    return named[0] if known is not None and None not in (known.lowest, known.highest) else None


def _sound(values, name=None):
    """Check that neither the smallest nor the largest value of a block is a fill value or in another unit."""
    if not values.size:
        return values
    ends = values.min(), values.max()
    # minimum and maximum are twice as fast as fmin and fmax, which skip NaN.
    if np.isnan(ends[0]):
        ends = np.fmin.reduce(values, axis=None), np.fmax.reduce(values, axis=None)
    for end in ends:
        if np.isinf(end) or float(end) in _FILLS or abs(end) > _LARGEST:
            raise ValueError(
                f"a value of {end:g} marks missing data and would count as a measurement: set it to NaN, such as "
                f"raster.where(raster != {end:g})"
            )
    if name is not None:
        known = cf.QUANTITIES[name]
        # Estimates and noise may leave the range, but not by its width.
        width = known.highest - known.lowest
        if ends[0] < known.lowest - width or ends[1] > known.highest + width:
            raise ValueError(
                f"{name} from {ends[0]:g} to {ends[1]:g}, where {known.lowest:g} to {known.highest:g} is possible: "
                "multiply it by its scale (0.01 for percent), or rename it if it is another quantity"
            )
    return values


def check_same_quantity(one, other, names):
    """Raise ValueError if two rasters are different quantities, by standard names, or have different units."""
    says = [array.attrs.get("standard_name") for array in (one, other)]
    if None not in says and says[0] != says[1]:
        raise ValueError(
            f"{names[0]} and {names[1]} must be the same quantity, got {says[0]} and {says[1]}: give both of one"
        )
    units = [cf.units_of(array, "") for array in (one, other) if "units" in array.attrs]
    if len(set(units)) > 1:
        raise ValueError(
            f"{names[0]} and {names[1]} must have the same units, got {units[0]!r} and {units[1]!r}: convert one, then "
            "set .attrs['units']"
        )


def origins(*arrays):
    """Offsets near the means, so that sums keep their digits: means of the first rows, or 0 where these are empty."""
    rows = computed(*(array.variable.isel(y=slice(1)).data for array in arrays))
    return tuple(float(np.nan_to_num(row[np.isfinite(row)].mean())) if np.isfinite(row).any() else 0.0 for row in rows)


def _common_index(y, x):
    coordinates = [raster[axis].values for axis in ("y", "x") for raster in (y, x) if axis in raster.coords]
    sizes = [abs(values[1] - values[0]) for values in coordinates if values.size > 1]
    if sizes and max(sizes) > _SAME_PIXEL * min(sizes):
        raise ValueError(
            f"pair='index' needs pixels of about one size, got {min(sizes):g} and {max(sizes):g} m: bring the finer "
            f"one to the cells of the other with .fifesim.aggregate({max(sizes):g})"
        )
    rows, columns = min(y.sizes["y"], x.sizes["y"]), min(y.sizes["x"], x.sizes["x"])
    return y.isel(y=slice(rows), x=slice(columns)), x.isel(y=slice(rows), x=slice(columns))


def _common_place(y, x):
    """Cut both rasters to their common area."""
    y, x = with_crs_of(y, x), with_crs_of(x, y)
    try:
        one, two = grids.geobox(y), grids.geobox(x)
        if one == two:
            return y, x
        rows, columns = grids.lattice_offset(one, two)
    except ValueError as error:
        raise ValueError(f'{error}, or use pair="index"') from None
    cut_y, cut_x = {}, {}
    for axis, shift in (("y", rows), ("x", columns)):
        start, stop = max(0, shift), min(y.sizes[axis], shift + x.sizes[axis])
        if stop <= start:
            raise ValueError("the rasters do not overlap")
        cut_y[axis], cut_x[axis] = slice(start, stop), slice(start - shift, stop - shift)
    return y.isel(cut_y), x.isel(cut_x)


def regress(y: xr.DataArray, x: xr.DataArray, *, pair: Pairing = "coordinates") -> Regression:
    """
    Fit a least-squares line between two rasters; computes.

    Parameters
    ----------
    y, x : xarray.DataArray, dims (y, x)
        Dependent and independent variable. Pairs with NaN are ignored.
    pair : {"coordinates", "index"}, optional
        Pair pixels by position, or by row and column.

    Returns
    -------
    regression : fifesim.analysis.regression.Regression
        Identical for any chunks.

    Raises
    ------
    ValueError
        If the rasters do not match, or there are fewer than three valid pairs.

    See Also
    --------
    fifesim.Regression, fifesim.aggregate, fifesim.output.plot_fit

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> fit = fifesim.regress(lai.fifesim.aggregate(30), image.fifesim.ndvi())
    >>> fit.n, round(fit.r2, 2)
    (64, 0.76)
    """
    y, x = matched(y, x, pair)
    y_origin, x_origin = origins(y, x)
    sums = sums_by_row(regression.row_sums, y, x, count=6, y_origin=y_origin, x_origin=x_origin)
    names = [array.attrs.get("standard_name", "") for array in (y, x)]
    return replace(regression.fit(sums, y_origin, x_origin), y_name=names[0], x_name=names[1])


# More increments than this are a width in other units than the variable.
_MOST_INCREMENTS = 10_000


def relative_equivalent_noise(
    variable: xr.DataArray,
    ndvi: xr.DataArray,
    increment: Annotated[float, Range("1", 0, np.inf, note="it is a width in units of the variable", ends="()")] = 0.1,
    *,
    slope: float | None = None,
    min_count: Annotated[int, Range("1", 2, np.inf, note="one value has no deviation")] = 3,
    pair: Pairing = "coordinates",
) -> xr.Dataset:
    """
    Relative equivalent noise by increments of a variable; computes.

    Parameters
    ----------
    variable, ndvi : xarray.DataArray, dims (y, x)
        True variable, such as LAI or FPAR, and the index from which it is inferred. Pairs with NaN are ignored.
    increment : float, optional
        Width of an increment, in units of the variable. The slope within an increment alone causes a relative noise of
        ``increment / (sqrt(12) variable)``.
    slope : float, optional
        Slope of NDVI with respect to the variable; by default from least squares.
    min_count : int, optional
        Minimum number of pairs in an increment, at least 2; with fewer, its noise is NaN.
    pair : {"coordinates", "index"}, optional
        As in `regress`.

    Returns
    -------
    noise : xarray.Dataset, dims (increment,)
        ``ren`` at the ``mean`` of the variable in each increment, the standard ``deviation`` of NDVI and the ``count``
        of pairs; the coordinate is the centre of the increments. Identical for any chunks.

    Raises
    ------
    ValueError
        If the rasters do not match, the increment is not positive, or there are no valid pairs.

    References
    ----------
    [Friedl1995]_, Eq. 7 and Fig. 7

    See Also
    --------
    fifesim.regress

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
    784
    """
    if variable.attrs.get("standard_name") == cf.QUANTITIES["ndvi"].standard_name:
        raise ValueError("variable is NDVI, where a variable inferred from it is needed: exchange the two rasters")
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
    kernel = partial(regression.increment_sums, first=first, width=increment, increments=increments, ndvi_origin=origin)
    sums = sums_by_row(kernel, variable, ndvi, count=regression.NOISE_SUMS * increments)
    count, mean, deviation = regression.increment_moments(sums)
    ren = np.where(count >= min_count, regression.equivalent_noise(deviation, slope, mean), np.nan)
    middle = (first + 0.5 + np.arange(increments)) * increment
    found = {"ren": ren, "mean": mean, "deviation": deviation, "count": count}
    out = xr.Dataset({name: ("increment", values) for name, values in found.items()})
    out["ren"].attrs = cf.attributes("ren")
    attrs = {"long_name": f"middle of increments of {variable.name}"}
    out = out.assign_coords(increment=("increment", middle, attrs))
    return out.assign_attrs(slope=float(slope), width=float(increment))
