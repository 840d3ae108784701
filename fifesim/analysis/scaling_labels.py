"""Scale effects of labelled rasters: block means, scale invariance, variograms and regularization."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Annotated

import numpy as np
import xarray as xr

from fifesim.analysis import scaling as kernels
from fifesim.analysis.index_labels import red_and_nir
from fifesim.analysis.regression_labels import check_same_quantity, origins, regress, sound_cells
from fifesim.base.arguments import FparLimit, Metres, Range
from fifesim.base.footprints import Boxcar, Spread
from fifesim.grids import cf, chunks
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date
from fifesim.grids.inputs import AnyDimensions, incoming
from fifesim.grids.reductions import areas, extremes, operators, regularized, sums_by_block


@by_date
def aggregate_blocks(array, pixel=30.0, *, min_valid=0.98, lsf=None):
    """Means over square blocks of ground, on the grid of whole blocks."""
    array = sound_cells(array)
    blocks = grids.aligned_grid(grids.geobox(array), pixel)
    spreads = areas(blocks) if lsf is None else (lsf, lsf)
    means = regularized(array, spreads, blocks, min_valid=min_valid)
    history = "\n".join(filter(None, [array.attrs.get("history", ""), f"aggregate: means over {pixel:g} m"]))
    means.attrs = dict(array.attrs) | {"history": history}
    return means


# Bins of the histogram that stands for the values of a raster: 1/2000 of their range is far less than a bandwidth.
_BINS = 2000

# Quantities whose density is reflected at zero, by name and standard name: not negative, and often near zero.
_AT_LEAST_ZERO = {"lai", "fpar"} | {cf.QUANTITIES[name].standard_name for name in ("lai", "fpar")}

# Blocks of values that are counted together. [cell]
_BLOCK = 1024


def scale_bias(
    algorithm: Callable[[xr.DataArray], xr.DataArray], array: xr.DataArray, pixel: Metres = 30.0
) -> xr.Dataset:
    """
    Mean of an algorithm over pixels, minus the algorithm of the mean.

    Parameters
    ----------
    algorithm : callable
        Function of a raster like ``array`` that returns a raster, such as ``fifesim.ndvi`` or ``fifesim.fpar``.
    array : xarray.DataArray, dims (..., y, x)
        Values of cells.
    pixel : float, optional
        [m]

    Returns
    -------
    bias : xarray.Dataset, dims (y, x)
        ``mean_of_algorithm``, ``algorithm_of_mean`` and their difference ``bias``, which is zero everywhere only if the
        algorithm is scale-invariant. Lazy where the array is.

    References
    ----------
    [Friedl1995]_, Eq. 1; [Hall1992]_

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> bias = fifesim.scaling.scale_bias(fifesim.ndvi, rho)["bias"]
    >>> bias.shape, bool((bias < 0.01).all())
    ((10, 10), True)
    """
    of_cells = aggregate_blocks(algorithm(array), pixel)
    of_mean = algorithm(aggregate_blocks(array, pixel))
    bias = chunks.pointwise(np.subtract, of_cells, of_mean)
    found = {"mean_of_algorithm": of_cells, "algorithm_of_mean": of_mean, "bias": bias}
    out = xr.Dataset({name: values.rename(name) for name, values in found.items()})
    long_name = "mean of the algorithm less the algorithm of the mean"
    out["bias"].attrs = {"long_name": long_name, "units": of_cells.attrs.get("units", "1")}
    return out


def ndvi_bias(reflectance: xr.DataArray, pixel: Metres = 30.0) -> xr.DataArray:
    """
    Mean NDVI minus NDVI of the mean reflectance, predicted from variances and covariance within pixels.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        Reflectance of cells. [1]
    pixel : float, optional
        [m]

    Returns
    -------
    bias : xarray.DataArray, dims (y, x)
        Bias to second order; ``scale_bias(fifesim.ndvi, reflectance)`` gives the simulated bias. [1]

    Raises
    ------
    ValueError
        As in `ndvi`.

    References
    ----------
    [Garrigues2006]_

    See Also
    --------
    fifesim.scaling.scale_bias, fifesim.scaling.ndvi_linearity

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> simulated = fifesim.scaling.scale_bias(fifesim.ndvi, rho)["bias"]
    >>> predicted = rho.fifesim.ndvi_bias()
    >>> bool(abs(predicted - simulated).max() < 1e-3)
    True
    """
    red, nir = red_and_nir(reflectance)
    # Moments of the same cells: a cell that lacks one band has no NDVI.
    red, nir = red.where(nir.notnull()), nir.where(red.notnull())
    means = [aggregate_blocks(array, pixel) for array in (red, nir, red * red, red * nir, nir * nir)]
    out = grids.place(chunks.pointwise(_ndvi_bias, *means), grids.geobox(means[0]))
    return cf.label(out, "ndvi_bias", source=reflectance, history=f"ndvi_bias: second order, {pixel:g} m")


def fpar_bias(
    lai: xr.DataArray,
    extinction: Annotated[float, Range("1", 0, np.inf, note="it is K of Eq. 6, about 0.5", ends="()")],
    fpar_inf: FparLimit = 0.94,
    pixel: Metres = 30.0,
) -> xr.DataArray:
    """
    Mean FPAR minus FPAR of the mean LAI, predicted from the variance of LAI within pixels.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        Leaf area index of cells. [m2 m-2]
    extinction : float
        K of Eq. 6. [1]
    fpar_inf : float, optional
        FPAR of an infinitely thick canopy. [1]
    pixel : float, optional
        [m]

    Returns
    -------
    bias : xarray.DataArray, dims (y, x)
        To second order; never positive. [1]

    Raises
    ------
    ValueError
        If the extinction or fpar_inf is not allowed.

    See Also
    --------
    fifesim.scaling.scale_bias, fifesim.fpar

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> bool((lai.fifesim.fpar_bias(extinction=0.57) <= 0).all())
    True
    """
    cf.check_quantity(lai, "lai")
    means = [aggregate_blocks(array, pixel) for array in (lai, lai * lai)]
    bias = chunks.pointwise(_fpar_bias, *means, extinction=float(extinction), fpar_inf=float(fpar_inf))
    out = grids.place(bias, grids.geobox(means[0]))
    return cf.label(out, "fpar_bias", source=lai, history=f"fpar_bias: second order, {pixel:g} m")


def ndvi_linearity(reflectance: xr.DataArray) -> float:
    """
    Correlation that must be zero for NDVI to be linear in reflectance; computes.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)

    Returns
    -------
    r : float
        [1]

    Raises
    ------
    ValueError
        As in `ndvi`.

    References
    ----------
    [Friedl1995]_, Eq. 2

    See Also
    --------
    fifesim.scaling.ndvi_bias

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> round(rho.fifesim.ndvi_linearity(), 2)
    0.64
    """
    red, nir = red_and_nir(incoming(reflectance, "surface_reflectance"))
    fit = regress(nir - red, 1.0 / (nir + red), pair="index")
    return math.copysign(math.sqrt(fit.r2), fit.slope)


def share_kept(pixels: AnyDimensions, cells: xr.DataArray) -> xr.Dataset:
    """
    Ratios of range and variance of pixels to those between cells.

    Parameters
    ----------
    pixels, cells : xarray.DataArray
        The same quantity at two scales.

    Returns
    -------
    kept : xarray.Dataset
        ``range`` and ``variance``. Lazy if an input is; the last digit of the variance may then depend on the chunks.
        [1]

    Raises
    ------
    ValueError
        If the quantities differ, there are digital numbers or fill values, or the pixels are smaller than the cells.

    References
    ----------
    [Friedl1995]_, Fig. 6

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> kept = lai.fifesim.aggregate(30).fifesim.share_kept(lai)
    >>> bool(0 < kept["variance"] < 1)
    True
    """
    pixels, cells = sound_cells(pixels), sound_cells(cells)
    check_same_quantity(pixels, cells, ("pixels", "cells"))
    coarse, fine = (abs(np.diff(each["x"].values[:2])) if "x" in each.coords else [] for each in (pixels, cells))  # type: ignore[var-annotated]
    if len(coarse) and len(fine) and coarse[0] < 0.99 * fine[0]:
        raise ValueError(f"pixels must not be finer than cells, got {coarse[0]:g} and {fine[0]:g} m: exchange them")
    extent = (pixels.max() - pixels.min()) / (cells.max() - cells.min())
    kept = {"range": extent, "variance": pixels.var() / cells.var()}
    # The remaining coordinates belong to one of the two.
    return xr.Dataset({name: value.drop_vars(list(value.coords)).drop_attrs() for name, value in kept.items()})


def density(
    array: AnyDimensions,
    points: Annotated[int, Range("1", 2, np.inf, note="it is the number of values of the density")] = 256,
    bandwidth: float | None = None,
    *,
    reflect: bool | None = None,
) -> xr.DataArray:
    """
    Gaussian kernel density of the values of a raster; computes.

    Parameters
    ----------
    array : xarray.DataArray
        NaN is left out.
    points : int, optional
        Number of evenly spaced points over the range of the values.
    bandwidth : float, optional
        Bandwidth of the kernel, in units of the values; Silverman's rule of thumb by default.
    reflect : bool, optional
        Whether to reflect kernels at zero, for quantities that cannot be negative; by default for leaf area and FPAR.

    Returns
    -------
    density : xarray.DataArray, dims (value,)
        Density per unit of the values, from a histogram of 2000 bins, so that the raster need not fit into memory.
        Identical for any chunks.

    Raises
    ------
    ValueError
        If there are fewer than two values, they do not vary, or values to be reflected are negative.

    References
    ----------
    [Silverman1986]_; [Friedl1995]_, Figs. 3 and 6

    See Also
    --------
    fifesim.regress

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> density = lai.fifesim.density()
    >>> round(float(density.integrate("value")), 2)
    1.0
    """
    array = sound_cells(array)
    low, high = extremes(array)
    if reflect is None:
        # The difference of two LAI rasters keeps the name, but may be negative.
        reflect = low >= 0 and bool({array.name, array.attrs.get("standard_name")} & _AT_LEAST_ZERO)
    if not high > low:
        raise ValueError(f"a density needs values that vary, got {low:g} to {high:g}")
    edges = np.linspace(low, high, _BINS + 1)
    counts = sums_by_block(partial(_counts, edges=edges), np.atleast_2d(array.data), (_BINS,), _BLOCK)
    middles = (edges[1:] + edges[:-1]) / 2
    if bandwidth is None:
        n = counts.sum()
        mean = np.sum(counts * middles) / n
        deviation = np.sqrt(np.sum(counts * (middles - mean) ** 2) / (n - 1))
        lower, upper = np.interp((0.25, 0.75), np.cumsum(counts) / n, middles)
        bandwidth = kernels.silverman_bandwidth(deviation, upper - lower, n)
    at = np.linspace(low, high, points)
    found = kernels.gaussian_density(middles, at, bandwidth, counts, reflect=bool(reflect))
    attrs = {"long_name": f"density of {array.name or 'values'}", "bandwidth": float(bandwidth)}
    return xr.DataArray(found, dims="value", coords={"value": at}, name="density", attrs=attrs)


def _ndvi_bias(red, nir, rr, rn, nn):
    mixed = rn - red * nir
    covariance = np.array([[rr - red**2, mixed], [mixed, nn - nir**2]])
    return kernels.second_order_bias(kernels.ndvi_hessian(red, nir), covariance)


def _fpar_bias(mean, square, **parameters):
    return kernels.beer_bias(mean, np.maximum(square - mean**2, 0.0), **parameters)


def _counts(cells, margin, edges):
    """Histogram of a block, in whole numbers, so that the order of summation does not matter."""
    return np.histogram(cells[np.isfinite(cells)], edges)[0].astype(float)


# Blocks of cells that are transformed together, counted from the first cell of the raster: fixed, so that the chunks
# change no rounding.
_LAG_BLOCK = 512


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
        ``covariance`` about the mean of all cells, ``semivariance`` and the ``count`` of pairs. Lags are in metres,
        southward from 0 and from west to east; the other half is symmetric. Identical for any chunks.

    Raises
    ------
    ValueError
        If the reach is less than a cell or more than half of the raster, or there are no data.

    See Also
    --------
    fifesim.scaling.variogram, fifesim.scaling.regularized_variance

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
    shape = (kernels.LAG_SUMS, steps[0] + 1, 2 * steps[1] + 1)
    kernel = partial(kernels.lag_sums, reach=steps, origin=origin)
    sums = sums_by_block(kernel, array.data, shape, _LAG_BLOCK, steps)
    if not sums[0].any():
        raise ValueError("the raster has no valid cells")
    found = {"covariance": kernels.covariance(sums), "semivariance": kernels.semivariance(sums)}
    found["count"] = sums[0].astype(np.int64)
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
    Variance of pixels, predicted from the variogram of cells and simulated; computes.

    Parameters
    ----------
    array : xarray.DataArray, dims (y, x)
        Values of cells.
    pixel : float, optional
        Size of the pixels. [m]
    lsf : line spread function, optional
        Line spread function from `fifesim.base.footprints`, such as ``instrument("TM").line_spread``; by default
        uniform over the pixel.

    Returns
    -------
    variance : xarray.Dataset
        Variance of the ``cells``, and ``predicted`` and ``simulated`` variance of the pixels, which differ because
        border pixels are omitted.

    Raises
    ------
    ValueError
        If the footprint is larger than half of the raster.

    References
    ----------
    [Jupp1988]_

    See Also
    --------
    fifesim.scaling.autocovariance, fifesim.aggregate

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
    rows, columns = operators((lsf, lsf), scene, grids.aligned_grid(scene, pixel))
    down = kernels.weight_correlation(rows, lags.sizes["lag_y"] - 1)
    across = kernels.weight_correlation(columns, lags.sizes["lag_x"] // 2)
    predicted = kernels.footprint_variance(lags["covariance"].values, down, across)
    # In memory, so that the chunks change no rounding.
    simulated = float(aggregate_blocks(array, pixel, lsf=lsf).compute().var())
    cells = float(lags["covariance"].sel(lag_y=0.0, lag_x=0.0))
    return xr.Dataset({"cells": cells, "predicted": predicted, "simulated": simulated}, attrs={"pixel": float(pixel)})
