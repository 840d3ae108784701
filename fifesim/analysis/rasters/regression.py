"""Analysis on labelled rasters: true means, vegetation indices and their regression."""

import numpy as np

from fifesim.analysis import indices, regression
from fifesim.analysis.rasters.pairs import check_no_counts, matched, origins
from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.rasters import cf, chunks
from fifesim.rasters import grid as grids
from fifesim.rasters.reductions import sums_by_row
from fifesim.rasters.regularization import areas, regularized


def aggregate(array, pixel=30.0, *, min_valid=0.98, lsf=None):
    """
    Means over square blocks of ground: the truth that a pixel is compared with.

    Parameters
    ----------
    array : xarray.DataArray, dims (..., y, x)
    pixel : float, optional
        Size of the blocks, any multiple of the cell or not. [m]
    min_valid : float, optional
        Share of its area that a block needs on valid cells; below it is NaN. [1]
    lsf : line spread function, optional
        As `fifesim.base.footprints` has it, to weight the cells about each block's middle; all within the block count
        the same by default.

    Returns
    -------
    means : xarray.DataArray, dims (..., y, x)
        On the grid of whole blocks from the upper left corner.

    Raises
    ------
    ValueError
        If the array has no grid, or no block fits.

    See Also
    --------
    fifesim.base.footprints.regularize
    """
    check_no_counts(array)
    blocks = grids.aligned(grids.geobox(array), pixel)
    spreads = areas(blocks) if lsf is None else (lsf, lsf)
    means = regularized(array, spreads, blocks, min_valid=min_valid)
    history = "\n".join(filter(None, [array.attrs.get("history", ""), f"aggregate: means over {pixel:g} m"]))
    means.attrs = dict(array.attrs) | {"history": history}
    return means


def ndvi(reflectance):
    """
    Normalized difference vegetation index.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        With a coordinate ``wavelength`` along band, which tells red (0.60-0.70 um) and near infrared (0.75-1.00 um).

    Returns
    -------
    ndvi : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        If there is no red or no near infrared band, or the units are not those of a reflectance.

    References
    ----------
    [Rouse1974]_; [Friedl1995]_

    See Also
    --------
    fifesim.analysis.indices.normalized_difference
    """
    red, nir = red_and_nir(reflectance)
    out = grids.place(chunks.pointwise(indices.normalized_difference, nir, red), grids.geobox(reflectance))
    return cf.label(out, "ndvi", source=reflectance, history="ndvi")


def regress(y, x, *, pair="coordinates"):
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
    """
    y, x = matched(y, x, pair)
    y_origin, x_origin = origins(y, x)
    sums = sums_by_row(regression.row_sums, y, x, count=6, y_origin=y_origin, x_origin=x_origin)
    return regression.fit(sums, y_origin, x_origin)


def red_and_nir(reflectance):
    """
    The red and the near infrared band of a raster.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        As `ndvi` takes it.

    Returns
    -------
    red, nir : xarray.DataArray, dims (y, x)
        Without the coordinates along band.

    Raises
    ------
    ValueError
        As in `ndvi`.
    """
    cf.check_quantity(reflectance, "toa_reflectance", "surface_reflectance")
    numbers = [_nearest_band(reflectance, window) for window in (RED, NEAR_INFRARED)]
    per_band = [name for name, value in reflectance.coords.items() if "band" in value.dims]
    return tuple(reflectance.isel(band=k).drop_vars([*per_band, "band"], errors="ignore") for k in numbers)


def _nearest_band(reflectance, window):
    if "band" not in reflectance.dims:
        raise ValueError("ndvi needs a red and a near infrared band along band, got a raster of one band")
    if "wavelength" not in reflectance.coords:
        raise ValueError("the raster has no coordinate 'wavelength' [um] along band: assign it with .assign_coords")
    wavelengths = np.atleast_1d(reflectance["wavelength"].values)
    number = nearest(wavelengths, window)
    if number is None:
        found = ", ".join(f"{value:.3f}" for value in wavelengths)
        raise ValueError(
            f"no {window.name} band between {window.low:g} and {window.high:g} um: the raster has {found} um"
        )
    return number
