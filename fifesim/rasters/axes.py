"""Dimensions of a raster: which they are, and which way they run."""

import xarray as xr

# Other names of y and x.
_OTHERS = (("latitude", "longitude"), ("lat", "lon"), ("northing", "easting"), ("Y", "X"), ("row", "column"))


def north_up(array):
    """
    A raster whose rows run from north to south.

    Parameters
    ----------
    array : xarray.DataArray, dims (..., y, x), or (..., line, sample) of a scan, which stays as it is

    Returns
    -------
    array : xarray.DataArray

    Raises
    ------
    ValueError
        If it has other dimensions than these.
    """
    if is_scan(array):
        return array
    check_axes(array)
    if array.sizes["y"] > 1 and "y" in array.coords and array["y"].values[1] > array["y"].values[0]:
        return array.isel(y=slice(None, None, -1))
    return array


def is_scan(array):
    """
    Whether an array is by the lines and samples of a scan instead of rows and columns.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    is_scan : bool
    """
    return {"line", "sample"} <= set(getattr(array, "dims", ()))


def check_axes(array):
    """
    Refuse a raster without dimensions y and x.

    Parameters
    ----------
    array : xarray.DataArray

    Raises
    ------
    ValueError
        If they have other names; the message says what to type.
    TypeError
        If it is no DataArray.
    """
    if not isinstance(array, xr.DataArray):
        raise TypeError(f"a raster is an xarray.DataArray, got {type(array).__name__}: open it with rioxarray")
    if {"y", "x"} <= set(array.dims):
        return
    if is_scan(array):
        raise ValueError(
            f"a raster has dimensions y and x, got {array.dims} of a scan: put it onto a map with "
            ".fifesim.grid_swath(grid)"
        )
    for down, across in _OTHERS:
        if {down, across} <= set(array.dims):
            cure = f".rename({down}='y', {across}='x')"
            if down.startswith("lat"):
                cure += ".rio.write_crs(4326).rio.reproject('EPSG:32614'), with the UTM zone of its place"
            raise ValueError(f"a raster has dimensions y and x, in metres, got {array.dims}: type {cure}")
    raise ValueError(f"a raster has dimensions y and x, got {array.dims}: rename or select with .rename, .isel")
