"""Pairs of pixels of two rasters."""

import numpy as np

from fifesim.rasters import grid as grids
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.reductions import computed

PAIRINGS = ("coordinates", "index")


def matched(y, x, pair="coordinates"):
    """
    Two rasters cut so that their pixels pair.

    Parameters
    ----------
    y, x : xarray.DataArray, dims (y, x)
    pair : {"coordinates", "index"}, optional
        Match pixels that lie in the same place, or that have the same row and column.

    Returns
    -------
    y, x : xarray.DataArray, dims (y, x)
        Of one shape.

    Raises
    ------
    ValueError
        If the rasters do not match, are not over (y, x) alone, or hold digital numbers.
    """
    if pair not in PAIRINGS:
        raise ValueError(f"pair must be 'coordinates' or 'index', got {pair!r}")
    for array in (y, x):
        check_no_counts(array)
        if set(array.dims) != {"y", "x"}:
            cure = "select one band" if "time" not in array.dims else "select one date with .isel(time=0)"
            cure = "put a scan onto a map with .fifesim.grid_swath(grid)" if "line" in array.dims else cure
            raise ValueError(f"pairs are of rasters over (y, x), got {array.dims}: {cure} first")
    return (_common_index if pair == "index" else _common_place)(y.transpose("y", "x"), x.transpose("y", "x"))


def check_no_counts(array):
    """
    Refuse digital numbers, which hold 0 for no data: it would be taken for dark ground.

    Parameters
    ----------
    array : xarray.DataArray

    Raises
    ------
    ValueError
        If it holds digital numbers.
    """
    if "gain" in array.coords:
        raise ValueError(
            f"{array.name or 'the array'} holds digital numbers, whose 0 is no data: convert it with "
            ".fifesim.to_reflectance() or .fifesim.to_radiance() first"
        )


def origins(*arrays):
    """
    Values near the means that leave digits to sums; those of the first rows, or 0 where these are empty.

    Parameters
    ----------
    *arrays : xarray.DataArray, dims (y, x)

    Returns
    -------
    origins : tuple of float
    """
    rows = computed(*(array.isel(y=slice(1)).data for array in arrays))
    return tuple(float(np.nan_to_num(row[np.isfinite(row)].mean())) if np.isfinite(row).any() else 0.0 for row in rows)


def _common_index(y, x):
    rows, columns = min(y.sizes["y"], x.sizes["y"]), min(y.sizes["x"], x.sizes["x"])
    return y.isel(y=slice(rows), x=slice(columns)), x.isel(y=slice(rows), x=slice(columns))


def _common_place(y, x):
    """Both cut to the ground that they share."""
    y, x = with_crs_of(y, x), with_crs_of(x, y)
    one, two = grids.geobox(y), grids.geobox(x)
    try:
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
