"""What a step of the chain is given of air, bands and directions, or what the raster carries of them."""

import numpy as np

from fifesim.atmosphere.air.models import Atmosphere
from fifesim.base.bands import Band
from fifesim.base.kinds import described
from fifesim.rasters import directions
from fifesim.sensor import raster as sensor
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.instruments import instrument_names

# Half width of the triangular response that stands for a band known by its wavelength alone: the step of the gas
# tables. [um]
_NARROW = 0.0025


def given_air(atmosphere):
    """
    Refuse what is no atmosphere.

    Parameters
    ----------
    atmosphere : fifesim.atmosphere.air.models.Atmosphere or None

    Returns
    -------
    atmosphere : fifesim.atmosphere.air.models.Atmosphere or None

    Raises
    ------
    TypeError
        If it is something else.
    """
    if atmosphere is not None and not isinstance(atmosphere, Atmosphere):
        raise TypeError(f"atmosphere must be a fifesim.Atmosphere, got {described(atmosphere)}: see fifesim.Atmosphere")
    return atmosphere


def air_bands_and_geometry(array, atmosphere, geometry, instrument, assume=False):
    """
    Atmosphere, spectral bands and geometry: as given, else as the array carries them, else the paper's.

    Parameters
    ----------
    array : xarray.DataArray, dims (band, y, x)
    atmosphere : fifesim.atmosphere.air.models.Atmosphere or None
    geometry : fifesim.base.geometry.Geometry, xarray.Dataset or None
    instrument : str, fifesim.sensor.description.instruments.Instrument or None
    assume : bool, optional
        Whether the atmosphere given counts, whatever the array carries.

    Returns
    -------
    atmosphere : fifesim.atmosphere.air.models.Atmosphere
    responses : tuple of fifesim.base.bands.Band
    geometry : fifesim.base.geometry.Geometry or xarray.Dataset

    Raises
    ------
    ValueError
        If the array was made for another atmosphere, or its bands are not known.
    """
    atmosphere, carried = given_air(atmosphere), array.attrs.get("atmosphere")
    if assume and atmosphere is None:
        raise ValueError("assume=True needs the atmosphere to assume: give it too, such as fifesim.Atmosphere(...)")
    if carried is not None and not assume:
        carried = Atmosphere.parse(carried)
        if atmosphere is not None and atmosphere != carried:
            raise ValueError(
                f"the reflectance was made for another atmosphere ({carried.text}) than the one given "
                f"({atmosphere.text}): give it to surface_reflectance(atmosphere=...); or, to correct with the wrong "
                "air on purpose, to_surface(..., assume=True)"
            )
    geometry = directions.given_geometry(geometry, array)
    return atmosphere or carried or Atmosphere(), _responses(array, instrument), geometry


def _responses(array, instrument):
    """Spectral responses of an instrument that is given, or carried by name and with the same wavelengths."""
    carried = array.attrs.get("instrument")
    if instrument is not None:
        return tuple(band.response for band in sensor.matching_bands(array, find_instrument(instrument)))
    if carried is not None:
        bands = sensor.matching_bands(array, find_instrument(carried)) if carried in instrument_names() else ()
        centres = [band.wavelength for band in bands]
        if not bands or ("wavelength" in array.coords and not np.allclose(array["wavelength"], centres, rtol=1e-6)):
            raise ValueError(
                f"the raster was made for an instrument {carried!r} of your own, whose response it does not carry: "
                "give it as instrument="
            )
        return tuple(band.response for band in bands)
    if "wavelength" not in array.coords:
        raise ValueError(
            "the raster has neither an instrument nor a wavelength: give instrument=, or assign a coordinate "
            "'wavelength' [um] along band"
        )
    centres = np.atleast_1d(array["wavelength"].values).astype(float)
    if np.max(centres) > 100:
        raise ValueError(f"wavelengths are in um, got {np.max(centres):g}: divide nanometres by 1000")
    return tuple(Band(f"{at:g} um", (at - _NARROW, at, at + _NARROW), (0.0, 1.0, 0.0)) for at in centres)
