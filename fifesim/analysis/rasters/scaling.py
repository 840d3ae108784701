"""Scale invariance of labelled rasters."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr

from fifesim.analysis import density as densities
from fifesim.analysis import scaling
from fifesim.analysis.rasters.indices import red_and_nir
from fifesim.analysis.rasters.means import aggregate
from fifesim.analysis.rasters.pairs import check_same_quantity, sound_cells
from fifesim.analysis.rasters.regression import regress
from fifesim.base.annotations import Metres
from fifesim.rasters import cf, chunks
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import AnyDimensions
from fifesim.rasters.reductions import extremes, sums_by_block

# Bins of the histogram that stands for the values of a raster: 1/2000 of their range is far less than a bandwidth.
_BINS = 2000

# Quantities whose density is reflected at zero, by name and standard name: they cannot be less, and are often near.
_AT_LEAST_ZERO = {"lai", "fpar"} | {cf.QUANTITIES[name].standard_name for name in ("lai", "fpar")}

# Blocks of values that are counted together. [cell]
_BLOCK = 1024


def scale_bias(
    algorithm: Callable[[xr.DataArray], xr.DataArray], array: xr.DataArray, pixel: Metres = 30.0
) -> xr.Dataset:
    """
    Mean over pixels of an algorithm, less the algorithm of the mean.

    Parameters
    ----------
    algorithm : callable
        Takes a raster like ``array`` and gives one, such as ``fifesim.ndvi`` or ``fifesim.fpar``.
    array : xarray.DataArray, dims (..., y, x)
        Of cells.
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
    >>> bias = fifesim.scale_bias(fifesim.ndvi, rho)["bias"]
    >>> bias.shape, bool((bias < 0.01).all())
    ((10, 10), True)
    """
    of_cells = aggregate(algorithm(array), pixel)
    of_mean = algorithm(aggregate(array, pixel))
    bias = chunks.pointwise(np.subtract, of_cells, of_mean)
    found = {"mean_of_algorithm": of_cells, "algorithm_of_mean": of_mean, "bias": bias}
    out = xr.Dataset({name: values.rename(name) for name, values in found.items()})
    long_name = "mean of the algorithm less the algorithm of the mean"
    out["bias"].attrs = {"long_name": long_name, "units": of_cells.attrs.get("units", "1")}
    return out


def ndvi_bias(reflectance: xr.DataArray, pixel: Metres = 30.0) -> xr.DataArray:
    """
    Mean NDVI less NDVI of the mean reflectance, predicted from variances and covariance within the pixels.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        Of cells.
    pixel : float, optional
        [m]

    Returns
    -------
    bias : xarray.DataArray, dims (y, x)
        To second order; that of ``scale_bias(fifesim.ndvi, reflectance)`` is the simulated one. [1]

    Raises
    ------
    ValueError
        As in `ndvi`.

    References
    ----------
    [Garrigues2006]_

    See Also
    --------
    fifesim.analysis.scaling.ndvi_hessian

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> simulated = fifesim.scale_bias(fifesim.ndvi, rho)["bias"]
    >>> predicted = rho.fifesim.ndvi_bias()
    >>> bool(abs(predicted - simulated).max() < 1e-3)
    True
    """
    red, nir = red_and_nir(reflectance)
    # Moments of the same cells: a cell that lacks one band has no NDVI.
    red, nir = red.where(nir.notnull()), nir.where(red.notnull())
    means = [aggregate(array, pixel) for array in (red, nir, red * red, red * nir, nir * nir)]
    out = grids.place(chunks.pointwise(_ndvi_bias, *means), grids.geobox(means[0]))
    return cf.label(out, "ndvi_bias", source=reflectance, history=f"ndvi_bias: second order, {pixel:g} m")


def fpar_bias(lai: xr.DataArray, extinction: float, fpar_inf: float = 0.94, pixel: Metres = 30.0) -> xr.DataArray:
    """
    Mean FPAR less FPAR of the mean LAI, predicted from the variance of LAI within the pixels.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        Of cells. [m2 m-2]
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
    fifesim.analysis.scaling.beer_bias

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> bool((lai.fifesim.fpar_bias(extinction=0.57) <= 0).all())
    True
    """
    cf.check_quantity(lai, "lai")
    if not 0 < extinction < np.inf:
        raise ValueError(f"extinction must be positive, got {extinction:g}: it is K of Eq. 6, about 0.5")
    if not 0 < fpar_inf <= 1:
        raise ValueError(f"fpar_inf must be in (0, 1], got {fpar_inf:g}: it is a fraction, 0.94 in the paper")
    means = [aggregate(array, pixel) for array in (lai, lai * lai)]
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
    fifesim.analysis.scaling.ndvi_linearity

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> round(rho.fifesim.ndvi_linearity(), 2)
    0.64
    """
    red, nir = red_and_nir(reflectance)
    fit = regress(nir - red, 1.0 / (nir + red), pair="index")
    return math.copysign(math.sqrt(fit.r2), fit.slope)


def share_kept(pixels: AnyDimensions, cells: xr.DataArray) -> xr.Dataset:
    """
    Share of the range and of the variance of cells that pixels keep.

    Parameters
    ----------
    pixels, cells : xarray.DataArray
        The same quantity at two scales.

    Returns
    -------
    kept : xarray.Dataset
        ``range`` and ``variance``; lazy where an input is, when the chunks may change the last digit of the variance.
        [1]

    Raises
    ------
    ValueError
        If the rasters are of different quantities, hold digital numbers or fill values, or the pixels are finer.

    References
    ----------
    [Friedl1995]_, Fig. 6

    See Also
    --------
    fifesim.analysis.scaling.share_kept

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
    coarse, fine = (abs(np.diff(each["x"].values[:2])) if "x" in each.coords else [] for each in (pixels, cells))
    if len(coarse) and len(fine) and coarse[0] < 0.99 * fine[0]:
        raise ValueError(f"pixels must not be finer than cells, got {coarse[0]:g} and {fine[0]:g} m: exchange them")
    extent = (pixels.max() - pixels.min()) / (cells.max() - cells.min())
    kept = {"range": extent, "variance": pixels.var() / cells.var()}
    # What is left of coordinates belongs to one of the two.
    return xr.Dataset({name: value.drop_vars(list(value.coords)).drop_attrs() for name, value in kept.items()})


def density(
    array: AnyDimensions, points: int = 256, bandwidth: float | None = None, *, reflect: bool | None = None
) -> xr.DataArray:
    """
    Gaussian kernel density of the values of a raster; computes.

    Parameters
    ----------
    array : xarray.DataArray
        NaN is left out.
    points : int, optional
        Where it is given, evenly over the range of the values.
    bandwidth : float, optional
        Of the kernel, in units of the values; by the rule of thumb by default.
    reflect : bool, optional
        Whether the parts of kernels below zero are reflected there, as of what cannot be negative; by default of leaf
        area and FPAR.

    Returns
    -------
    density : xarray.DataArray, dims (value,)
        Per unit of the values. From counts in 2000 bins, so that the raster need not fit in memory; the same under any
        chunking.

    Raises
    ------
    ValueError
        If fewer than two values are left, they do not vary, or some are negative that are to be reflected.

    References
    ----------
    [Silverman1986]_; [Friedl1995]_, Figs. 3 and 6

    See Also
    --------
    fifesim.analysis.density.gaussian_density

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
        # A difference of two leaf areas keeps their name.
        reflect = low >= 0 and bool({array.name, array.attrs.get("standard_name")} & _AT_LEAST_ZERO)
    if not high > low:
        raise ValueError(f"a density needs values that vary, got {low:g} to {high:g}")
    edges = np.linspace(low, high, _BINS + 1)
    counts = sums_by_block(partial(_counts, edges=edges), np.atleast_2d(array.data), (_BINS,), _BLOCK)
    middles = (edges[1:] + edges[:-1]) / 2
    if bandwidth is None:
        bandwidth = _rule_of_thumb(middles, counts)
    at = np.linspace(low, high, points)
    found = densities.gaussian_density(middles, at, bandwidth, counts, reflect=bool(reflect))
    attrs = {"long_name": f"density of {array.name or 'values'}", "bandwidth": float(bandwidth)}
    return xr.DataArray(found, dims="value", coords={"value": at}, name="density", attrs=attrs)


def _ndvi_bias(red, nir, rr, rn, nn):
    mixed = rn - red * nir
    covariance = np.array([[rr - red**2, mixed], [mixed, nn - nir**2]])
    return scaling.second_order_bias(scaling.ndvi_hessian(red, nir), covariance)


def _fpar_bias(mean, square, **parameters):
    return scaling.beer_bias(mean, np.maximum(square - mean**2, 0.0), **parameters)


def _counts(cells, margin, edges):
    """Histogram of a block; counts are whole, so that their order does not matter."""
    return np.histogram(cells[np.isfinite(cells)], edges)[0].astype(float)


def _rule_of_thumb(middles, counts):
    n = counts.sum()
    mean = np.sum(counts * middles) / n
    deviation = np.sqrt(np.sum(counts * (middles - mean) ** 2) / (n - 1))
    lower, upper = np.interp((0.25, 0.75), np.cumsum(counts) / n, middles)
    return densities.silverman_bandwidth(deviation, upper - lower, n)
