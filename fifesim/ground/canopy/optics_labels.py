"""Optics of leaves and backgrounds that vary from cell to cell, on labelled rasters."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from fifesim.base.arguments import check_number
from fifesim.grids import cf
from fifesim.grids import chunks as chunking
from fifesim.grids.chunks import by_band, layers_of
from fifesim.grids.grid import with_crs_of
from fifesim.grids.inputs import micrometres
from fifesim.ground.canopy import optics
from fifesim.ground.canopy.measured_spectra import PER_FRACTION, LeafSpectrum, Spectrum
from fifesim.ground.canopy.optics import leaf_means
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.soil import brightened, moistened, soil_line, water_films
from fifesim.ground.canopy.spectra import check_shares, is_mixture


def background(bands, given, lai):
    """Background reflectance of bands, shape (band,), or dims ([band], y, x) where it varies by cell. [1]"""
    if given is None:
        return optics.default_background(tuple(bands))
    if isinstance(given, xr.DataArray):
        return given.rename("background")
    if isinstance(given, xr.Dataset):
        given = spectrum_of(given, "background")
    if isinstance(given, Mapping) and any(isinstance(value, xr.DataArray) for value in given.values()):
        names = [band.name for band in bands]
        if is_mixture(given) and not set(given) <= set(names):
            return _mixed(bands, given, lai)
        return by_band({name: optics.of_band(given, name, "background") for name in names}, lai)
    return optics.band_background(bands, given)


def spectrum_of(dataset, what, kind=Spectrum):
    """Spectrum of a Dataset with wavelength [um], reflectance and, for a leaf, transmittance [1]."""
    missing = [name for name in ("wavelength", *kind.names()) if name not in dataset.variables]
    if missing:
        raise ValueError(
            f"{what}: the Dataset has no {' nor '.join(missing)}; a spectrum has wavelength [um] and "
            f"{' and '.join(kind.names())} [1], rename them with .rename"
        )
    try:
        return kind(micrometres(dataset["wavelength"]), *(_fractions(dataset[name]) for name in kind.names()))
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None


def _fractions(array):
    """Reflectance or transmittance as fractions, from the unit in their attribute. [1]"""
    unit = str(array.attrs.get("units", "1")).strip()
    if unit.lower() not in PER_FRACTION:
        raise ValueError(f"{array.name} has units {unit!r}: they are to be 1 or percent")
    return np.asarray(array.values, float) / PER_FRACTION[unit.lower()]


def as_it_lies(bands, below, lai, soil=None, moisture=None):
    """Background with changed soil brightness and moisture, shape (band,) or dims (band, y, x). [1]"""
    if soil is None and moisture is None:
        return below
    kernel, changes = soil_kernel(bands, lai, soil, moisture)
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
    """Kernel of a changed background, ``kernel(dry, *blocks)`` of shape (..., band), and its rasters."""
    steps, rasters = [], []
    if soil is not None:
        steps.append((_brightened, soil_line(bands)))
        rasters.append(_by_cell("soil", soil, lai))
    if moisture is not None:
        steps.append((moistened, water_films(tuple(bands))))
        rasters.append(_by_cell("moisture", moisture, lai))

    def kernel(reflectance, *blocks):
        for (change, parameters), block in zip(steps, blocks, strict=True):
            reflectance = change(reflectance, block, parameters)
        return reflectance

    return kernel, rasters


def _brightened(dry, change, line):
    """Background of another brightness, with a warning if its change is large in the mean."""
    check_number("soil", change, PROPERTIES["soil"])
    return brightened(dry, change, line)


def changes_of(canopy):
    """Brightness and moisture of the background of a canopy, numbers or rasters, where they differ from 0."""
    changes = {}
    for name in ("soil", "moisture"):
        value = getattr(canopy, name)
        if isinstance(value, xr.DataArray) or value != 0:
            changes[name] = value
    return changes


def background_attributes(canopy):
    """Attributes for the brightness and moisture of the background: numbers, or "raster"."""
    attributes = changes_of(canopy)
    for name, each in attributes.items():
        attributes[name] = "raster" if isinstance(each, xr.DataArray) else float(each)
    return attributes


def _by_cell(name, value, lai):
    """Raster over (y, x), or a number as a raster that broadcasts."""
    if not isinstance(value, xr.DataArray):
        return xr.DataArray(np.float64(value))
    if set(value.dims) != {"y", "x"}:
        raise ValueError(f"{name} is a number, or a raster over (y, x), got dimensions {value.dims}: select one layer")
    cf.check_units(value, name)
    plain = with_crs_of(value, lai)
    return plain.drop_vars(set(plain.coords) - {"y", "x", "spatial_ref"}).rename(name)


def _mixed(bands, given, lai):
    """Mixture of spectra whose shares vary from cell to cell."""
    pure = np.array([optics.band_background(bands, {name: 1.0}) for name in given])
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


def leaf_optics(bands, given, lai, *, exact=False):
    """Leaf reflectance and transmittance of bands, shape (band,), or dims (band, y, x) where they vary by cell. [1]"""
    if given is None:
        return optics.optics_of_leaf(tuple(bands), given)
    if isinstance(given, xr.Dataset):
        given = spectrum_of(given, "leaf_optics", LeafSpectrum)
    names = [band.name for band in bands]
    if isinstance(given, Leaf) and given.varying():
        return _of_contents(bands, given, lai, exact)
    if isinstance(given, Mapping):
        if any(_has_raster(pair) for pair in given.values()):
            pairs = [_pair(name, optics.of_band(given, name, "leaf optics")) for name in names]
            return tuple(_of_bands(names, values, lai) for values in zip(*pairs, strict=True))
    elif _has_raster(given):
        return tuple(
            by_band(dict(zip(names, layers_of(value, names, f"leaf {what}"), strict=True)), lai)
            for what, value in zip(("reflectance", "transmittance"), _pair("every band", given), strict=True)
        )
    return optics.band_leaf_optics(bands, given)


def _of_bands(names, values, lai):
    return by_band(dict(zip(names, values, strict=True)), lai) if _has_raster(values) else np.asarray(values, float)


def _has_raster(given):
    return any(isinstance(value, xr.DataArray) for value in (given if isinstance(given, tuple | list) else [given]))


def _pair(band, given):
    if not isinstance(given, tuple | list) or len(given) != 2:
        raise ValueError(
            f"leaf_optics of {band} are a pair (reflectance, transmittance), each a number or a raster, "
            f"got {type(given).__name__}"
        )
    return given


def _of_contents(bands, leaf, lai, exact):
    """Optics of leaves with rasters of contents, dims (y, x)."""
    varying = leaf.varying()
    for name, value in varying.items():
        if not isinstance(value, xr.DataArray) or set(value.dims) != {"y", "x"}:
            got = f"dimensions {value.dims}" if isinstance(value, xr.DataArray) else type(value).__name__
            raise ValueError(f"Leaf: {name} must be a number, or a raster (xarray.DataArray) over (y, x), got {got}")

    def kernel(*contents):
        means = leaf_means(bands, replace(leaf, **dict(zip(varying, contents, strict=True))), exact)
        return means.reshape(2 * len(bands), *means.shape[2:])

    rasters = [with_crs_of(value, lai) for value in varying.values()]
    both = chunking.pointwise(kernel, *rasters, bands=2 * len(bands))
    return tuple(both.isel(band=slice(start, start + len(bands))) for start in (0, len(bands)))
