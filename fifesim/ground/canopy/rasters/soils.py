"""What lies below a canopy, on labelled rasters: by its reflectance, or by the shares of what it is mixed from."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from fifesim.ground.canopy import optics
from fifesim.ground.canopy.description import is_raster
from fifesim.ground.canopy.soil import brightened, soil_line
from fifesim.ground.canopy.soil_water import moistened, water_films
from fifesim.ground.canopy.spectra import check_shares, is_mixture
from fifesim.ground.canopy.spectrum import Spectrum
from fifesim.rasters import cf
from fifesim.rasters import chunks as chunking
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.layers import by_band, layers_of
from fifesim.rasters.own_rasters import micrometres


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
        given = spectrum_of(given, "background")
    if isinstance(given, Mapping) and any(isinstance(value, xr.DataArray) for value in given.values()):
        names = [band.name for band in bands]
        if is_mixture(given) and not set(given) <= set(names):
            return _mixed(bands, given, lai)
        return by_band({name: optics.of_band(given, name, "background") for name in names}, lai)
    return optics.background(bands, given)


def spectrum_of(dataset, what, kind=Spectrum):
    """
    Spectrum of a Dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        With ``wavelength`` in um or in the unit of its attribute ``units``, ``reflectance`` and, for a leaf,
        ``transmittance`` [1].
    what : str
        Name of the argument, for messages.
    kind : type, optional
        `Spectrum` or `LeafSpectrum`.

    Returns
    -------
    spectrum : Spectrum

    Raises
    ------
    ValueError
        If a variable is missing, or the values are no such spectrum.
    """
    missing = [name for name in ("wavelength", *kind.names()) if name not in dataset.variables]
    if missing:
        raise ValueError(
            f"{what}: the Dataset has no {' nor '.join(missing)}; a spectrum has wavelength [um] and "
            f"{' and '.join(kind.names())} [1], rename them with .rename"
        )
    try:
        return kind(micrometres(dataset["wavelength"]), *(dataset[name].values for name in kind.names()))
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None


def as_it_lies(bands, below, lai, soil=None, moisture=None):
    """
    Background where the soil is brighter or darker, and moist.

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band
    below : array, shape (band,), or xarray.DataArray, dims ([band], y, x)
        Dry, from `background`. [1]
    lai : xarray.DataArray, dims (y, x)
        Whose CRS the rasters have where they lost theirs.
    soil : float or xarray.DataArray, dims (y, x), optional
        Brightness, a change along the soil line. [1]
    moisture : float or xarray.DataArray, dims (y, x), optional
        0 is dry, 1 saturated. [1]

    Returns
    -------
    background : array, shape (band,), or xarray.DataArray, dims (band, y, x)
        What was given where neither is. [1]

    Raises
    ------
    ValueError
        If one is out of its range, on lazy data when it computes; if rasters lie on different grids.

    See Also
    --------
    fifesim.ground.canopy.soil.brightened, fifesim.ground.canopy.soil_water.moistened
    """
    kernel, changes = soil_kernel(bands, lai, soil, moisture)
    if kernel is None:
        return below
    if not any(isinstance(each, xr.DataArray) for each in (below, soil, moisture)):
        return kernel(below, *(each.values for each in changes))
    names = [band.name for band in bands]
    if isinstance(below, xr.DataArray):
        cf.check_units(below, "surface_reflectance")
        below = by_band(dict(zip(names, layers_of(below, names, "background"), strict=True)), lai)
    else:
        below = xr.DataArray(below, dims="band")

    def bands_first(*blocks):
        return np.moveaxis(kernel(*blocks), -1, 0)

    out = chunking.pointwise(bands_first, below.drop_vars("band", errors="ignore"), *changes, bands=len(names))
    out.attrs = {}
    return out.rename("background").assign_coords(band=names)


def soil_kernel(bands, lai, soil=None, moisture=None):
    """
    What brightness and moisture make of a background, and the rasters that it takes.

    Parameters
    ----------
    bands, lai, soil, moisture
        As in `as_it_lies`.

    Returns
    -------
    kernel : callable, or None
        ``kernel(dry, *blocks)`` gives reflectance, shape (..., band), from that of dry ground, shape (band,) or (...,
        band), and blocks of the rasters, shape (...). None where neither is given. [1]
    rasters : list of xarray.DataArray
    """
    given = {name: value for name, value in (("soil", soil), ("moisture", moisture)) if value is not None}
    if not given:
        return None, []
    line = None if soil is None else soil_line(bands)
    films = None if moisture is None else water_films(tuple(bands))
    names = tuple(given)

    def kernel(reflectance, *changes):
        change = dict(zip(names, changes, strict=True))
        if line is not None:
            reflectance = brightened(reflectance, change["soil"], line)
        if films is not None:
            reflectance = moistened(reflectance, change["moisture"], films)
        return reflectance

    return kernel, [_by_cell(name, value, lai) for name, value in given.items()]


def changes_of(canopy):
    """Brightness and moisture of the background of a canopy, numbers or rasters; None for no change."""
    return tuple(None if not is_raster(each) and each == 0 else each for each in (canopy.soil, canopy.moisture))


def in_words(canopy):
    """Attributes that describe the brightness and moisture of the background: numbers, or "raster"."""
    changes = zip(("soil", "moisture"), changes_of(canopy), strict=True)
    return {name: "raster" if is_raster(each) else float(each) for name, each in changes if each is not None}


def _by_cell(name, value, lai):
    """A raster over (y, x), or a number, as one that broadcasts."""
    if not isinstance(value, xr.DataArray):
        return xr.DataArray(np.float64(value))
    if set(value.dims) != {"y", "x"}:
        raise ValueError(f"{name} is a number, or a raster over (y, x), got dimensions {value.dims}: select one layer")
    cf.check_units(value, "soil" if name == "soil" else "moisture")
    plain = with_crs_of(value, lai)
    return plain.drop_vars(set(plain.coords) - {"y", "x", "spatial_ref"}).rename(name)


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
