"""Hyperspectral images and field spectra as the bands of an instrument."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import xarray as xr

from fifesim.base.arguments import Names, Range
from fifesim.grids import cf
from fifesim.grids.inputs import AnyDimensions, check_reflectance, micrometres, per_micrometre, storage_of
from fifesim.grids.reductions import combined
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.instrument_labels import attributes_of, is_radiance
from fifesim.sensor.response.spectral import band_weights, covered_steps


class SpectralAxis(NamedTuple):
    """Wavelengths and dimension of the samples of spectra."""

    dim: str
    wavelength: np.ndarray  # in the order of the array, shape (n,) [um]
    fwhm: np.ndarray | None  # full width at half maximum of the samples, shape (n,) [um]


def spectral_axis(array):
    """Spectral axis of an array."""
    if "wavelength" not in array.coords or array.coords["wavelength"].ndim != 1:
        raise ValueError(
            f"spectra need a coordinate 'wavelength' along one dimension, got dimensions {array.dims} and coordinates "
            f"{', '.join(map(str, array.coords)) or 'none'}: assign it with .assign_coords(wavelength=('band', [...]))"
        )
    coordinate = array.coords["wavelength"]
    (dim,) = coordinate.dims
    wavelength = micrometres(_positive(coordinate))
    if wavelength.size < 2 or np.unique(wavelength).size < wavelength.size:
        raise ValueError(
            f"spectra need two different wavelengths or more, each once, got {wavelength.size}, of which "
            f"{np.unique(wavelength).size} differ: select others with .isel({dim}=...)"
        )
    if "fwhm" not in array.coords or array.coords["fwhm"].dims != (dim,):
        return SpectralAxis(dim, wavelength, None)
    widths = array.coords["fwhm"]
    own = widths if widths.attrs.get("units") else coordinate
    return SpectralAxis(dim, wavelength, np.asarray(_positive(widths), float) / per_micrometre(own))


def _positive(coordinate):
    values = coordinate.values
    if not np.all(values > 0):
        raise ValueError(
            f"{coordinate.name} must be positive throughout, got {values[~(values > 0)][0]:g}: select the samples that "
            "have one with .isel"
        )
    return coordinate


MIN_COVERAGE = 0.99
"""Share of a band's weight that a spectrum must cover [1]."""

# Maximum number of band names in a message.
_NAMED = 3


def to_bands(
    spectra: AnyDimensions,
    instrument: InstrumentLike,
    *,
    bands: Names | None = None,
    min_coverage: Annotated[float, Range("1", 0, 1, note="it is a share, such as 0.95", ends="(]")] = MIN_COVERAGE,
) -> xr.DataArray:
    """
    Convert spectra to the bands of an instrument, for hyperspectral images and field spectra.

    Reflectance is weighted by spectral response times solar irradiance, because band reflectance is the ratio of
    reflected to incident light. Radiance is weighted by the response alone. The attribute `units` determines the case.

    Parameters
    ----------
    spectra : xarray.DataArray
        Reflectance or radiance with a coordinate ``wavelength`` along one dimension, in um, or in nm if stated in its
        attribute ``units``. Any order and spacing is possible, and any other dimensions. A coordinate ``fwhm`` along
        the same dimension gives the width of the samples. [1 or W m-2 sr-1 um-1]
    instrument : str or Instrument
        Instrument that has the bands.
    bands : str or sequence of str, optional
        Names of its bands; all by default.
    min_coverage : float, optional
        Minimum fraction of the band weight on wavelengths covered by the spectra. [1]

    Returns
    -------
    image : xarray.DataArray
        The wavelength dimension is replaced by ``band``; other dimensions and coordinates are kept. NaN if a sample
        within the band is NaN. Lazy if the spectra are. [1 or W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If a band is not covered (the message names the missing wavelengths), the unit of the wavelengths is unclear, or
        the spectra are integers without a scale.

    Notes
    -----
    Spectra are interpolated linearly between samples, without deconvolving the response of the spectrometer. A step is
    treated as a gap if the uncovered interval exceeds the mean ``fwhm`` of its samples; without ``fwhm``, if the step
    exceeds 2.5 times the median of the neighbouring steps. Gaps allowed by ``min_coverage`` have no weight, so a flat
    spectrum remains flat.

    See Also
    --------
    fifesim.instrument, fifesim.sensor.read_responses

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> import xarray as xr
    >>> wavelength = xr.Variable("wavelength", np.arange(0.4, 1.0, 0.005), {"units": "um"})
    >>> grey = np.full((120, 2, 2), 0.3)
    >>> spectra = xr.DataArray(grey, {"wavelength": wavelength}, ("wavelength", "y", "x"))
    >>> spectra.fifesim.to_bands("OLI", bands=["OLI4", "OLI5"]).isel(y=0, x=0).round(6).values
    array([0.3, 0.3])
    """
    cf.check_quantity(spectra, "surface_reflectance", "toa_reflectance", "toa_radiance")
    dtype, scaled, _ = storage_of(spectra)
    if not scaled:
        raise ValueError(
            f"spectra must be reflectance or radiance, got whole numbers ({dtype}) without a scale: type "
            ".assign_attrs(scale_factor=0.0001) with the scale of the data"
        )
    description = find_instrument(instrument)
    selected = description.select(bands)
    quantity = _quantity(spectra)
    axis = spectral_axis(spectra)
    found = _weights(axis, selected, sun=quantity != "toa_radiance")
    _check_coverage(found, selected, description, axis, min_coverage)
    image = combined(spectra, axis.dim, [each.weights for each in found])
    if quantity != "toa_radiance":
        image = xr.apply_ufunc(
            check_reflectance, image, dask="parallelized", output_dtypes=[image.dtype], keep_attrs=True
        )
    along_band = {"band": [band.name for band in selected], "wavelength": [band.wavelength for band in selected]}
    if quantity == "toa_radiance":
        along_band["solar_irradiance"] = [band.solar_irradiance for band in selected]
    image = image.assign_coords(cf.band_coordinates(**along_band))
    image.encoding = {"grid_mapping": "spatial_ref"} if "spatial_ref" in image.coords else {}
    weighted = "response" if quantity == "toa_radiance" else "response and sun"
    history = f"to_bands: {description.name}, {axis.wavelength.size} wavelengths weighted by {weighted}"
    return cf.label(image, quantity, source=spectra, history=history, **attributes_of(description))


def _quantity(spectra):
    """Quantity of the spectra, by units and standard name."""
    if is_radiance(spectra):
        return "toa_radiance"
    says = spectra.attrs.get("standard_name")
    return "toa_reflectance" if says == cf.QUANTITIES["toa_reflectance"].standard_name else "surface_reflectance"


def _weights(axis, bands, sun):
    """Weights of the samples in each band, in the order of the array."""
    order = np.argsort(axis.wavelength)
    wavelength = axis.wavelength[order]
    covered = covered_steps(wavelength, None if axis.fwhm is None else axis.fwhm[order])
    back = np.argsort(order)
    found = [band_weights(band.response, wavelength, covered, sun=sun) for band in bands]
    return [each._replace(weights=each.weights[back]) for each in found]


def _check_coverage(found, bands, description, axis, min_coverage):
    """Raise ValueError for bands that the spectra do not cover."""
    lacking = [(band, each) for band, each in zip(bands, found, strict=True) if each.coverage < min_coverage - 1e-12]
    if not lacking:
        return
    reach = f"the spectra reach from {min(axis.wavelength):g} to {max(axis.wavelength):g} um"
    none = [band.name for band, each in lacking if each.coverage == 0]
    if none:
        others = [band.name for band, each in zip(bands, found, strict=True) if each.coverage >= min_coverage]
        raise ValueError(
            f"{reach} and hold nothing of {_some(none)} of {description.name}: pick bands, bands={others or '[...]'}"
        )
    parts = [f"{band.name} {share.coverage:.1%}, without {_ranges(share.missing)} um" for band, share in lacking]
    raise ValueError(
        f"{reach}, and cover less than {min_coverage:g} of {_some(parts, '; ')}: pick others with bands=, interpolate "
        "the spectra with .interp(wavelength=...), or lower min_coverage="
    )


def _some(parts, between=", "):
    more = len(parts) - _NAMED
    return between.join(parts[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _ranges(missing):
    return _some([f"{low:.4g} to {high:.4g}" for low, high in missing])
