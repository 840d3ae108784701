"""The instrument that a raster carries: by name, and one of one's own whole."""

from dataclasses import replace

from pydantic import TypeAdapter, ValidationError

from fifesim.rasters.sites import is_fife
from fifesim.sensor.description.instrument_file import Instrument
from fifesim.sensor.description.instruments import catalogued, instrument_names
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.spectral_response import ResponseList

_ADAPTER = TypeAdapter(Instrument)

# What the paper simulates, and so scenes made on its site.
_FIFE = "TM"


def attributes_of(description):
    """
    Attributes by which a raster carries an instrument.

    Parameters
    ----------
    description : Instrument

    Returns
    -------
    attributes : dict of str
        ``instrument``, its name; of one that fifesim does not have, ``instrument_description``, all of it with its
        responses written out.
    """
    named = {"instrument": description.name}
    if _is_catalogued(description):
        return named
    bands = tuple(replace(band, srf=_written_out(band.response)) for band in description.bands)
    return named | {"instrument_description": _ADAPTER.dump_json(replace(description, bands=bands)).decode()}


def _is_catalogued(description):
    try:
        return catalogued(description.name) == description
    except ValueError:
        return False


def carried_instrument(array):
    """
    Instrument that a raster carries.

    Parameters
    ----------
    array : xarray.DataArray

    Returns
    -------
    description : Instrument or None

    Raises
    ------
    ValueError
        If it carries the name of one that fifesim does not have, or a description that is none.
    """
    name, description = array.attrs.get("instrument"), array.attrs.get("instrument_description")
    if description:
        try:
            return _ADAPTER.validate_json(description)
        except ValidationError as error:
            raise ValueError(
                f"the raster's instrument_description is no instrument ({error.error_count()} mistakes): give "
                "instrument="
            ) from None
    if name is None:
        return None
    try:
        return catalogued(name)
    except (TypeError, ValueError):
        raise ValueError(
            f"the raster was made for an instrument {name!r}, which fifesim does not have: give instrument="
        ) from None


def given_instrument(given, array):
    """
    Instrument: as given, else as a raster carries it, else that of the paper for a scene made on the FIFE site.

    Parameters
    ----------
    given : str, Instrument or None
    array : xarray.DataArray

    Returns
    -------
    description : Instrument

    Raises
    ------
    ValueError
        If nothing says which, or it is unknown.
    """
    found = find_instrument(given) if given is not None else carried_instrument(array)
    if found is None and is_fife(array):
        found = find_instrument(_FIFE)
    if found is None:
        raise ValueError(
            f"nothing says which instrument looks at {array.name or 'the raster'}: give instrument=, one of "
            f"{', '.join(instrument_names())}, or a file of your own"
        )
    return found


def _written_out(response):
    return ResponseList(response.wavelength, response.response)
