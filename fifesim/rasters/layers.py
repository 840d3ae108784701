"""Bands put together from layers, and layers taken out of them."""

import numpy as np
import xarray as xr

from fifesim.rasters import chunks
from fifesim.rasters.crs import with_crs_of


def by_band(values, main):
    """
    Raster of bands from a number or a raster for each.

    Parameters
    ----------
    values : dict of str to float or xarray.DataArray, dims (y, x)
        By name of a band; one raster at least.
    main : xarray.DataArray
        Whose CRS they have where they lost theirs.

    Returns
    -------
    raster : xarray.DataArray, dims (band, y, x)
        Lazy where one of them is.

    Raises
    ------
    ValueError
        If they are no layers over (y, x), or lie on different grids.
    """
    for name, value in values.items():
        if np.ndim(value) and (not isinstance(value, xr.DataArray) or set(value.dims) != {"y", "x"}):
            got = f"dimensions {value.dims}" if isinstance(value, xr.DataArray) else type(value).__name__
            raise ValueError(f"{name} must be a number, or one raster (xarray.DataArray) over (y, x), got {got}")
    on_one_grid = iter(chunks.aligned([with_crs_of(value, main) for value in values.values() if np.ndim(value)]))
    rasters = [next(on_one_grid).astype(float) if np.ndim(value) else float(value) for value in values.values()]
    like = next(each for each in rasters if np.ndim(each))
    layers = [each if np.ndim(each) else xr.full_like(like, each) for each in rasters]
    plain = [each.transpose("y", "x").drop_vars(set(each.coords) - {"y", "x", "spatial_ref"}) for each in layers]
    names = xr.Variable("band", np.array(list(values), dtype=str))
    options = {"join": "exact", "coords": "minimal", "compat": "override", "combine_attrs": "drop"}
    return xr.concat(plain, dim="band", **options).assign_coords(band=names)


def layers_of(raster, names, what):
    """
    Layers of a raster for some bands.

    Parameters
    ----------
    raster : xarray.DataArray, dims ([band], y, x)
        Without a dimension band it stands for all.
    names : sequence of str
    what : str
        What it is, for the message.

    Returns
    -------
    layers : list of xarray.DataArray, dims (y, x)

    Raises
    ------
    ValueError
        If it is no raster, or lacks a band.
    """
    if not isinstance(raster, xr.DataArray) or {"y", "x"} - set(raster.dims):
        raise ValueError(f"the {what} is a raster (xarray.DataArray) over ([band], y, x), got {type(raster).__name__}")
    if "band" not in raster.dims:
        return [raster.drop_vars("band", errors="ignore")] * len(names)
    known = raster["band"].values.tolist()
    if missing := [name for name in names if name not in known]:
        raise ValueError(f"the {what} lacks band {', '.join(missing)}, it has {', '.join(map(str, known))}")
    return [raster.isel(band=known.index(name)) for name in names]
