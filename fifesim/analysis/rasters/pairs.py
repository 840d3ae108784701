"""Pairs of pixels of two rasters."""

import numpy as np

from fifesim.rasters import grid as grids
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.reductions import computed

PAIRINGS = ("coordinates", "index")

# Numbers by which files mark missing data and which no quantity here takes, and a bound that all of them keep.
_FILLS = (-999.0, -9999.0, -99999.0, -32768.0, 65535.0)
_LARGEST = 1e15

# Pixels that count as one size: those of scanners drift against a grid by some percent, and may be oblong.
_SAME_PIXEL = 2.0


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
    y, x = sound_cells(y), sound_cells(x)
    for array in (y, x):
        if set(array.dims) != {"y", "x"}:
            cure = "select one band" if "time" not in array.dims else "select one date with .isel(time=0)"
            cure = "put a scan onto a map with .fifesim.grid_swath(grid)" if "line" in array.dims else cure
            raise ValueError(f"pairs are of rasters over (y, x), got {array.dims}: {cure} first")
    return (_common_index if pair == "index" else _common_place)(y.transpose("y", "x"), x.transpose("y", "x"))


def sound_cells(array):
    """
    A raster whose cells are values of a quantity.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    array : xarray.DataArray
        The same values; a lazy raster is checked when it computes.

    Raises
    ------
    ValueError
        If it holds digital numbers, fill values or infinity.
    """
    # A digital number of 0 is no data and would count as dark ground.
    if "gain" in array.coords:
        raise ValueError(
            f"{array.name or 'the array'} holds digital numbers, whose 0 is no data: convert it with "
            ".fifesim.to_reflectance() or .fifesim.to_radiance() first"
        )
    if array.dtype.kind != "f" or not array.size:
        return array
    return array.copy(data=array.data.map_blocks(_no_fill, dtype=array.dtype) if array.chunks else _no_fill(array.data))


def _no_fill(values):
    """Values of a block, or ValueError if the smallest or largest of them is a fill value."""
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
    return values


def check_same_quantity(one, other, names):
    """
    Refuse two rasters of different quantities.

    Parameters
    ----------
    one, other : xarray.DataArray
        What a raster does not say is taken as right.
    names : (str, str)
        Their arguments.

    Raises
    ------
    ValueError
        If their standard names differ.
    """
    says = [array.attrs.get("standard_name") for array in (one, other)]
    if None not in says and says[0] != says[1]:
        raise ValueError(
            f"{names[0]} and {names[1]} must be the same quantity, got {says[0]} and {says[1]}: give both of one"
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
    sizes = [abs(np.diff(each[axis].values[:2])) for axis in ("y", "x") for each in (y, x) if axis in each.coords]
    sizes = [size[0] for size in sizes if size.size]
    if sizes and max(sizes) > _SAME_PIXEL * min(sizes):
        raise ValueError(
            f"pair='index' needs pixels of about one size, got {min(sizes):g} and {max(sizes):g} m: bring one raster "
            "onto the other's grid first, for instance with .fifesim.aggregate"
        )
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
