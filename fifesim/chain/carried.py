"""What a step of the chain is given of air, bands and directions, or what the raster carries of them."""

import numpy as np

from fifesim.atmosphere.air.models import Atmosphere
from fifesim.base.bands import Band
from fifesim.base.kinds import described
from fifesim.base.warned import warn
from fifesim.rasters import cf, directions
from fifesim.rasters.own_rasters import incoming
from fifesim.rasters.sites import is_fife
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.rasters.carried import carried_instrument
from fifesim.sensor.response.rasters.matching import matching_bands, warn_of_others

# Half width of the triangular response that stands for a band known by its wavelength alone: the step of the gas
# tables. [um]
_NARROW = 0.0025


def air_of(atmosphere, array, assume=False):
    """
    Atmosphere: as given, else as an array carries it, else midlatitude summer with continental aerosol.

    Parameters
    ----------
    atmosphere : fifesim.atmosphere.air.models.Atmosphere or None
    array : xarray.DataArray
    assume : bool, optional
        Whether the one given counts, whatever the array carries.

    Returns
    -------
    atmosphere : fifesim.atmosphere.air.models.Atmosphere
        The default of a raster that fifesim did not make on the FIFE site is a warning.

    Raises
    ------
    ValueError
        If the array was made for another atmosphere.
    TypeError
        If it is something else.
    """
    if atmosphere is not None and not isinstance(atmosphere, Atmosphere):
        raise TypeError(f"atmosphere must be a fifesim.Atmosphere, got {described(atmosphere)}: see fifesim.Atmosphere")
    carried = array.attrs.get("atmosphere")
    if assume:
        if atmosphere is None:
            raise ValueError("assume=True needs the atmosphere to assume: give it too, such as fifesim.Atmosphere(...)")
        return atmosphere
    if carried is not None:
        carried = Atmosphere.parse(carried)
        if atmosphere is not None and atmosphere != carried:
            raise ValueError(
                f"the reflectance was made for another atmosphere ({carried.text}) than the one given "
                f"({atmosphere.text}): give it to surface_reflectance(atmosphere=...); or, to correct with the wrong "
                "air on purpose, to_surface(..., assume=True)"
            )
    if atmosphere is None and carried is None and not is_fife(array):
        warn(
            f"nothing says what air lies over {array.name or 'the raster'}: {Atmosphere().text} is taken; give "
            "atmosphere=fifesim.Atmosphere(...), with the altitude of its ground in km"
        )
    return atmosphere or carried or Atmosphere()


def air_bands_and_geometry(array, atmosphere, geometry, instrument, time=None, *, assume=False):
    """
    Atmosphere, spectral bands and geometry: as given, else as the array carries them.

    Parameters
    ----------
    array : xarray.DataArray, dims (band, y, x)
    atmosphere : fifesim.atmosphere.air.models.Atmosphere or None
    geometry : fifesim.base.geometry.Geometry, xarray.Dataset or None
    instrument : str, fifesim.sensor.description.instruments.Instrument or None
    time : str or datetime, optional
        In the place of a geometry.
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
        If the array was made for another atmosphere, its bands are not known, or nothing says where the sun stands.
    """
    geometry = directions.given_geometry(geometry, array, time)
    return air_of(atmosphere, array, assume), _responses(array, instrument), geometry


def as_bands_of(raster, instrument, name):
    """
    A raster of reflectance as the chain takes it, its bands by their names in an instrument.

    Parameters
    ----------
    raster : xarray.DataArray, or xarray.Dataset of bands
    instrument : str, fifesim.sensor.description.instruments.Instrument or None
        By default that which it carries.
    name : str
        The reflectance that it is: a key of `fifesim.rasters.cf.QUANTITIES`.

    Returns
    -------
    raster : xarray.DataArray, dims ([band], y, x)
        With names and wavelengths of the instrument's bands, where it has no wavelengths of its own.

    Raises
    ------
    ValueError, TypeError
        As `fifesim.rasters.own_rasters.incoming`, or if the instrument has no such bands.
    """
    array = incoming(raster, name)
    description = carried_instrument(array) if instrument is None else find_instrument(instrument)
    if description is None or "band" not in array.coords:
        return array
    other = array.attrs.get("instrument") not in (None, description.name)
    if "wavelength" in array.coords and not other:
        return array
    bands = matching_bands(array, description)
    warn_of_others(array, description, bands)
    names, centres = [band.name for band in bands], [band.wavelength for band in bands]
    along_band = cf.band_coordinates(band=names, wavelength=centres)
    return array.assign_coords({key: each if array["band"].ndim else each[0] for key, each in along_band.items()})


def _responses(array, instrument):
    """Spectral responses of an instrument that is given, or carried with the same wavelengths."""
    description = carried_instrument(array) if instrument is None else find_instrument(instrument)
    if description is not None:
        bands = matching_bands(array, description)
        centres = [band.wavelength for band in bands]
        if instrument is None and "wavelength" in array.coords and not np.allclose(array["wavelength"], centres, 1e-6):
            raise ValueError(
                f"the raster says that it was made for {description.name} and has other wavelengths than its bands: "
                "give instrument="
            )
        return tuple(band.response for band in bands)
    if "wavelength" not in array.coords:
        raise ValueError(
            "the raster has neither an instrument nor a wavelength: give instrument=, or assign a coordinate "
            "'wavelength' [um] along band"
        )
    centres = np.atleast_1d(array["wavelength"].values).astype(float)
    return tuple(Band(f"{at:g} um", (at - _NARROW, at, at + _NARROW), (0.0, 1.0, 0.0)) for at in centres)
