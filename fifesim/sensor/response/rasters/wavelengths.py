"""The spectral axis of labelled spectra: which dimension it is, and its wavelengths in micrometres."""

from typing import NamedTuple

import numpy as np

from fifesim.rasters.own_rasters import LONGEST, PER_MICROMETRE


class SpectralAxis(NamedTuple):
    """Where the samples of spectra lie."""

    dim: str
    wavelength: np.ndarray  # in the order of the array, shape (n,) [um]
    fwhm: np.ndarray | None  # full width at half maximum of the samples, shape (n,) [um]


def spectral_axis(array):
    """
    The spectral axis of an array.

    Parameters
    ----------
    array : xarray.DataArray
        With a coordinate ``wavelength`` along one dimension, and perhaps ``fwhm`` along the same. They are in
        micrometres, or in what their attribute ``units`` says: um or nm.

    Returns
    -------
    axis : SpectralAxis

    Raises
    ------
    ValueError
        If there is no such coordinate, or its unit is not known, or its values are missing or not in this unit.
    """
    if "wavelength" not in array.coords or array.coords["wavelength"].ndim != 1:
        raise ValueError(
            f"spectra need a coordinate 'wavelength' along one dimension, got dimensions {array.dims} and coordinates "
            f"{', '.join(map(str, array.coords)) or 'none'}: assign it with .assign_coords(wavelength=('band', [...]))"
        )
    coordinate = array.coords["wavelength"]
    (dim,) = coordinate.dims
    scale = _per_micrometre(coordinate, "wavelength")
    wavelength = _in_micrometres(coordinate, scale)
    if wavelength.size < 2 or np.unique(wavelength).size < wavelength.size:
        raise ValueError(
            f"spectra need two different wavelengths or more, each once, got {wavelength.size}, of which "
            f"{np.unique(wavelength).size} differ: select others with .isel({dim}=...)"
        )
    if "fwhm" not in array.coords or array.coords["fwhm"].dims != (dim,):
        return SpectralAxis(dim, wavelength, None)
    widths = array.coords["fwhm"]
    own = _per_micrometre(widths, "fwhm") if widths.attrs.get("units") else scale
    return SpectralAxis(dim, wavelength, _in_micrometres(widths, own))


def _per_micrometre(coordinate, name):
    """How many of a coordinate's unit are a micrometre."""
    said = str(coordinate.attrs.get("units", "")).strip()
    if said and said.lower() not in PER_MICROMETRE:
        raise ValueError(f"{name} is in {said!r}, it must be in 'um' or 'nm': convert it, then set .attrs['units']")
    scale, largest = PER_MICROMETRE.get(said.lower(), 1.0), float(np.max(coordinate.values))
    if largest / scale > LONGEST:
        raise ValueError(
            f"{name} reaches {largest:g}{' ' + said if said else ' without a unit'}: if these are nanometres, "
            f"set cube[{name!r}].attrs['units'] = 'nm'"
        )
    if name == "wavelength" and largest / scale < 0.1:
        raise ValueError(
            f"wavelength reaches only {largest:g} {said}: if these are um, set its attribute units to 'um'"
        )
    return scale


def _in_micrometres(coordinate, scale):
    values = np.asarray(coordinate.values, float) / scale
    if not np.all(values > 0):
        raise ValueError(
            f"{coordinate.name} must be positive throughout, got {values[~(values > 0)][0] * scale:g}: "
            "select the samples that have one with .isel"
        )
    return values
