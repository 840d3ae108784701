"""What lies below a canopy, on labelled rasters: by its reflectance, or by the shares of what it is mixed from."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from fifesim.ground.canopy import optics
from fifesim.ground.canopy.spectra import Spectrum, check_shares, is_mixture
from fifesim.rasters import chunks as chunking
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.layers import by_band


def background(bands, given, lai):
    """
    Background reflectance of bands, of the whole scene or of each cell.

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band
    given : optional
        A raster over ([band], y, x); as `ground.canopy.optics.background` takes it, where in ``{band: reflectance}``
        and ``{spectrum: share}`` there may be a raster over (y, x) in the place of a number; or a Dataset with
        ``wavelength`` [um] and ``reflectance``.
    lai : xarray.DataArray, dims (y, x)
        Whose CRS the rasters have where they lost theirs.

    Returns
    -------
    background : array, shape (band,), or xarray.DataArray, dims ([band], y, x)
        [1]

    Raises
    ------
    ValueError
        If a band has no reflectance, it is outside its range, or rasters lie on different grids.

    See Also
    --------
    fifesim.ground.canopy.optics.background
    """
    if isinstance(given, xr.DataArray):
        return given.rename("background")
    if isinstance(given, xr.Dataset):
        missing = {"wavelength", "reflectance"} - set(given.variables)
        if missing:
            raise ValueError(f"the background's Dataset has no {' nor '.join(sorted(missing))}: it is to have both")
        given = Spectrum(given["wavelength"].values, given["reflectance"].values)
    if isinstance(given, Mapping) and any(isinstance(value, xr.DataArray) for value in given.values()):
        names = [band.name for band in bands]
        if is_mixture(given) and not set(given) <= set(names):
            return _mixed(bands, given, lai)
        return by_band({name: optics.of_band(given, name, "background") for name in names}, lai)
    return optics.background(bands, given)


def _mixed(bands, given, lai):
    """Mixture of spectra whose shares differ from cell to cell."""
    pure = np.array([optics.background(bands, {name: 1.0}) for name in given])
    shares = by_band(given, lai).drop_vars("band")
    names = tuple(given)

    def kernel(cells):
        check_shares(names, np.moveaxis(cells, -1, 0))
        mixed = np.zeros((pure.shape[1], *cells.shape[:-1]))
        for number, spectrum in enumerate(pure):
            mixed += spectrum.reshape(-1, *(1,) * (cells.ndim - 1)) * cells[..., number]
        return mixed

    out = chunking.pointwise(kernel, with_crs_of(shares, lai), bands=len(bands))
    return out.assign_coords(band=[band.name for band in bands])
