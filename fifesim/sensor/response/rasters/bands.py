"""Hyperspectral images and field spectra as the bands of an instrument."""

from __future__ import annotations

import numpy as np
import xarray as xr

from fifesim.base.annotations import Names
from fifesim.rasters import cf
from fifesim.rasters.annotations import AnyDimensions
from fifesim.rasters.combination import combined
from fifesim.rasters.own_rasters import check_reflectance
from fifesim.rasters.packed import unpacked
from fifesim.sensor.description.annotations import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.rasters.carried import attributes_of
from fifesim.sensor.response.rasters.wavelengths import spectral_axis
from fifesim.sensor.response.spectral import band_weights, covered_steps

MIN_COVERAGE = 0.99
"""Share of a band's weight that a spectrum must cover [1]."""

# A message names so many bands, and refers to others by their number.
_NAMED = 3


def to_bands(
    spectra: AnyDimensions,
    instrument: InstrumentLike,
    *,
    bands: Names | None = None,
    min_coverage: float = MIN_COVERAGE,
) -> xr.DataArray:
    """
    Spectra as the bands of an instrument: a hyperspectral image, or field spectra.

    Reflectance is weighted by spectral response times solar irradiance, for a band's reflectance is reflected over
    incident light. Radiance is weighted by the response alone. `units` tells them apart.

    Parameters
    ----------
    spectra : xarray.DataArray
        Reflectance or radiance with a coordinate ``wavelength`` along one of its dimensions, in um, or in nm where its
        attribute ``units`` says so; in any order, evenly spaced or not. Other dimensions are what they are: (y, x),
        (sample), (time, y, x). A coordinate ``fwhm`` along the same dimension says how wide the samples are.
        [1 or W m-2 sr-1 um-1]
    instrument : str or Instrument
        Whose bands.
    bands : str or sequence of str, optional
        Names of its bands; all by default.
    min_coverage : float, optional
        Share of a band's weight that must lie on wavelengths that the spectra cover. [1]

    Returns
    -------
    image : xarray.DataArray
        With a dimension ``band``, of the same dimensions otherwise, and the coordinates that are not along wavelength.
        NaN where a sample that counts in the band is. Lazy where the spectra are. [1 or W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If a band is not covered; the message names the wavelengths that are missing. If wavelengths have no unit and
        are not in um, or the spectra are whole numbers.

    Notes
    -----
    The samples are taken as they are, as points of a spectrum that is straight between them: they are already means
    over the response of the spectrometer, and that is not undone. A step is a gap, which covers nothing, where the
    hole between two samples is wider than the mean of both ``fwhm``; without ``fwhm``, where the step is more than
    2.5 times the median of those around it. What is missing within ``min_coverage`` has no weight: a flat spectrum
    stays flat.

    See Also
    --------
    fifesim.sensor.response.spectral.band_weights

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
    spectra = unpacked(spectra)
    if spectra.dtype.kind != "f":
        raise ValueError(
            f"spectra must be reflectance or radiance, got whole numbers ({spectra.dtype}) without a scale: type "
            ".assign_attrs(scale_factor=0.0001) for what scales them"
        )
    if not 0 < min_coverage <= 1:
        raise ValueError(f"min_coverage must be in (0, 1], got {min_coverage:g}: it is a share, such as 0.95")
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
    """What the spectra are, by their units and standard name."""
    if str(spectra.attrs.get("units", "1")).strip() == cf.QUANTITIES["toa_radiance"].units:
        return "toa_radiance"
    says = spectra.attrs.get("standard_name")
    return "toa_reflectance" if says == cf.QUANTITIES["toa_reflectance"].standard_name else "surface_reflectance"


def _weights(axis, bands, sun):
    """Weights for each band, of the samples in the order of the array."""
    order = np.argsort(axis.wavelength)
    wavelength = axis.wavelength[order]
    covered = covered_steps(wavelength, None if axis.fwhm is None else axis.fwhm[order])
    back = np.argsort(order)
    found = [band_weights(band.response, wavelength, covered, sun=sun) for band in bands]
    return [each._replace(weights=each.weights[back]) for each in found]


def _check_coverage(found, bands, description, axis, min_coverage):
    """Refuse bands that the spectra do not cover."""
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
    told = [f"{band.name} {each.coverage:.1%}, without {_ranges(each.missing)} um" for band, each in lacking]
    raise ValueError(
        f"{reach}, and cover less than {min_coverage:g} of {_some(told, '; ')}: pick others with bands=, interpolate "
        "the spectra with .interp(wavelength=...), or lower min_coverage="
    )


def _some(told, between=", "):
    more = len(told) - _NAMED
    return between.join(told[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _ranges(missing):
    return _some([f"{low:.4g} to {high:.4g}" for low, high in missing])
