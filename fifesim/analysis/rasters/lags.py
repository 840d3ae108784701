"""Variograms of labelled rasters, and the variance that regularization leaves."""

from __future__ import annotations

from functools import partial

import numpy as np
import xarray as xr

from fifesim.analysis import variogram as kernels
from fifesim.analysis.rasters.means import aggregate
from fifesim.analysis.rasters.pairs import origins, sound_cells
from fifesim.base.annotations import Metres
from fifesim.base.line_spread import Boxcar, Spread
from fifesim.rasters import grid as grids
from fifesim.rasters.reductions import extremes, sums_by_block
from fifesim.rasters.regularization import operators

# Blocks of cells that are transformed together, counted from the first cell of the raster: fixed, so that the chunks
# change no rounding.
_BLOCK = 512


def autocovariance(array: xr.DataArray, reach: float) -> xr.Dataset:
    """
    Covariance and semivariance of a raster by lag; computes.

    Parameters
    ----------
    array : xarray.DataArray, dims (y, x)
        NaN is left out.
    reach : float
        Largest lag along each axis. [m]

    Returns
    -------
    lags : xarray.Dataset, dims (lag_y, lag_x)
        ``covariance`` about the mean of all cells, ``semivariance`` and the ``count`` of pairs; lags are in metres,
        southward from 0 and from west to east: the other half is its mirror image. The same to the bit under any
        chunking.

    Raises
    ------
    ValueError
        If the reach is less than a cell or more than half of the raster, or nothing is there.

    See Also
    --------
    fifesim.analysis.variogram.lag_sums

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> lags = lai.fifesim.autocovariance(10)
    >>> dict(lags.sizes)
    {'lag_y': 4, 'lag_x': 7}
    """
    array = sound_cells(array)
    if set(array.dims) != {"y", "x"}:
        raise ValueError(f"a variogram is of a raster over (y, x), got {array.dims}: select one band first")
    array = array.transpose("y", "x")
    sizes = grids.cell_size(grids.geobox(array))
    steps = tuple(int(reach / size + 1e-6) for size in sizes)
    if min(steps) < 1 or any(2 * step > count for step, count in zip(steps, array.shape, strict=True)):
        raise ValueError(
            f"reach must be at least a cell ({max(sizes):g} m) and at most half of the raster "
            f"({min(count * size / 2 for count, size in zip(array.shape, sizes, strict=True)):g} m), got {reach:g} m"
        )
    (origin,) = origins(array)
    shape = (kernels.SUMS, steps[0] + 1, 2 * steps[1] + 1)
    kernel = partial(kernels.lag_sums, reach=steps, origin=origin)
    sums = sums_by_block(kernel, array.data, shape, _BLOCK, steps)
    if not sums[0].any():
        raise ValueError("the raster has no valid cells")
    found = {
        "covariance": kernels.covariance(sums),
        "semivariance": kernels.semivariance(sums),
        "count": sums[0].astype(np.int64),
    }
    lags = {"lag_y": np.arange(steps[0] + 1) * sizes[0], "lag_x": np.arange(-steps[1], steps[1] + 1) * sizes[1]}
    out = xr.Dataset({name: (("lag_y", "lag_x"), values) for name, values in found.items()}, coords=lags)
    for name in lags:
        out[name].attrs = {"units": "m", "long_name": "lag southward" if name == "lag_y" else "lag eastward"}
    return out


def variogram(array: xr.DataArray, reach: float) -> xr.Dataset:
    """
    Variogram of a raster along rows and columns; computes.

    Parameters
    ----------
    array : xarray.DataArray, dims (y, x)
    reach : float
        Largest lag. [m]

    Returns
    -------
    variogram : xarray.Dataset, dims (direction, lag)
        ``semivariance``, ``correlation`` and ``count`` along "x" and "y" by ``lag`` [m]; and ``practical_range`` by
        direction, where the correlation has fallen to 0.05, NaN if not within the reach. [m]

    Raises
    ------
    ValueError
        As in `autocovariance`, and if the cells are not square or their values do not vary.

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> along = lai.fifesim.variogram(30).semivariance.sel(direction="x")
    >>> bool(along[1] < along[5])
    True
    """
    down, across = grids.cell_size(grids.geobox(array))
    if abs(down - across) > 1e-6 * across:
        raise ValueError(f"a variogram by distance needs square cells, got {down:g} x {across:g} m: use autocovariance")
    lags = autocovariance(array, reach)
    low, high = extremes(array)
    if not high > low:
        raise ValueError(f"a correlation needs values that vary, got {low:g} to {high:g}: use autocovariance")
    east = lags.sel(lag_y=0.0, drop=True).sel(lag_x=slice(0, None)).rename(lag_x="lag")
    south = lags.sel(lag_x=0.0, drop=True).rename(lag_y="lag")
    along = xr.concat([east, south], dim=xr.Variable("direction", ["x", "y"]), join="override")
    variance = float(lags["covariance"].sel(lag_y=0.0, lag_x=0.0))
    out = along[["semivariance", "count"]].assign(correlation=along["covariance"] / variance)
    ranges = [kernels.crossing(out["lag"].values, values) for values in out["correlation"].values]
    out["practical_range"] = ("direction", ranges, {"units": "m"})
    out["lag"].attrs = {"units": "m", "long_name": "distance"}
    out.attrs = {"variance": variance}
    return out


def regularized_variance(array: xr.DataArray, pixel: Metres = 30.0, lsf: Spread | None = None) -> xr.Dataset:
    """
    Variance of pixels, predicted from that of cells and their variogram, beside the simulated; computes.

    Parameters
    ----------
    array : xarray.DataArray, dims (y, x)
        Of cells.
    pixel : float, optional
        Size of the pixels. [m]
    lsf : line spread function, optional
        As `fifesim.base.footprints` has it, such as ``instrument("TM").line_spread``; the mean over the pixel by
        default.

    Returns
    -------
    variance : xarray.Dataset
        Of the ``cells``, and of the pixels as ``predicted`` and ``simulated``, which differ by what the borders leave
        out.

    Raises
    ------
    ValueError
        If the footprint is larger than half of the raster.

    References
    ----------
    [Jupp1988]_

    See Also
    --------
    fifesim.analysis.variogram.footprint_variance

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> left = lai.fifesim.regularized_variance(30)
    >>> bool(left.simulated < left.cells)
    True
    """
    scene = grids.geobox(array)
    lsf = Boxcar(pixel) if lsf is None else lsf
    lags = autocovariance(array, 2 * lsf.half_width + max(grids.cell_size(scene)))
    rows, columns = operators((lsf, lsf), scene, grids.aligned(scene, pixel))
    down = kernels.weight_correlation(rows, lags.sizes["lag_y"] - 1)
    across = kernels.weight_correlation(columns, lags.sizes["lag_x"] // 2)
    predicted = kernels.footprint_variance(lags["covariance"].values, down, across)
    # In memory, so that the chunks change no rounding.
    simulated = float(aggregate(array, pixel, lsf=lsf).compute().var())
    cells = float(lags["covariance"].sel(lag_y=0.0, lag_x=0.0))
    return xr.Dataset({"cells": cells, "predicted": predicted, "simulated": simulated}, attrs={"pixel": float(pixel)})
