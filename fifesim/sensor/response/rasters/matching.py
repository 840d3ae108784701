"""Match the bands of a raster to the bands of an instrument, by name and wavelength."""

import itertools

import numpy as np

from fifesim.base.warned import warn
from fifesim.sensor.description.band_names import band_called
from fifesim.sensor.description.instruments import catalogued, instrument_names
from fifesim.sensor.description.rasters.carried import carried_instrument


def matching_bands(array, instrument):
    """
    Match the bands of a raster to the bands of an instrument.

    Parameters
    ----------
    array : xarray.DataArray
        Has a coordinate ``band`` of the instrument's names, or ``wavelength`` [um]; else names that
        `fifesim.sensor.description.band_names.band_called` knows.
    instrument : fifesim.sensor.description.instruments.Instrument

    Returns
    -------
    bands : tuple of fifesim.sensor.description.band.InstrumentBand

    Raises
    ------
    ValueError
        If a band matches no band of the instrument, or its name and its wavelength contradict each other. Names that
        belong to another instrument of the catalogue are matched by wavelength.
    """
    known = {band.name.lower() for band in instrument.bands}
    names, wavelengths = _names_and_wavelengths(array)
    if names and {name.lower() for name in names} <= known:
        found = instrument.select(names)
        if wavelengths is None or all(map(_spans, found, wavelengths)):
            return found
        check_wavelengths(array, instrument)
    if wavelengths is not None:
        return instrument.select([_band_at(value, instrument).name for value in wavelengths])
    if names:
        called = [(name, band_called(name, instrument)) for name in names]
        _warn_of_counted(array, instrument)
        return instrument.select([name if band is None else band.name for name, band in called])
    raise ValueError(
        f"the raster's bands have neither names of {instrument.name} ({', '.join(b.name for b in instrument.bands)}) "
        "nor a wavelength: assign a coordinate 'band' or 'wavelength' [um] along band"
    )


def _responds(band, wavelength, share):
    """Whether a band responds at a wavelength with a share of its peak; an unknown wavelength contradicts no band."""
    table = band.response
    response = np.interp(wavelength, table.wavelength, table.response, left=0.0, right=0.0)
    return bool(np.isnan(wavelength) or response >= share * max(table.response))


def _spans(band, wavelength):
    """Whether a wavelength may belong to a band: at nominal centres, a band has 0.6 of its peak and more."""
    return _responds(band, wavelength, 0.1)


def check_wavelengths(array, instrument=None):
    """
    Raise ValueError if bands have names of an instrument and wavelengths outside the responses of these bands.

    Parameters
    ----------
    array : xarray.DataArray
    instrument : fifesim.sensor.description.instruments.Instrument, optional
        Instrument to try first, before the raster's instrument and the catalogue.

    Raises
    ------
    ValueError
        If no instrument that has all of the names has them at these wavelengths: MSS4 is the green band of Landsat's
        first scanners, and a near infrared band of the later ones.
    """
    names, wavelengths = _names_and_wavelengths(array)
    if not names or wavelengths is None:
        return
    first, others = None, instrument_names()
    own = [] if instrument is None else [instrument]
    if "instrument_description" in array.attrs or array.attrs.get("instrument") in others:
        own.append(carried_instrument(array))
    for each in itertools.chain(own, map(catalogued, others)):
        known = {band.name.lower(): band for band in each.bands}
        if not {name.lower() for name in names} <= known.keys():
            continue
        bands = [known[name.lower()] for name in names]
        wrong = [pair for pair in zip(bands, wavelengths, strict=True) if not _spans(*pair)]
        if not wrong:
            return
        first = first or (each.name, *wrong[0])
    if first:
        name, band, wavelength = first
        raise ValueError(
            f"band {band.name} has the wavelength {wavelength:g} um, and {band.name} of {name} is at "
            f"{band.wavelength:.3g} um: name and wavelength contradict each other. Correct the order of the bands or "
            "one coordinate, or drop the wavelengths with .drop_vars('wavelength') if the names are right"
        )


def _names_and_wavelengths(array):
    """Names of bands, an empty list without any, and wavelengths or None."""
    names = [str(name) for name in np.atleast_1d(array["band"].values)] if "band" in array.coords else []
    return names, np.atleast_1d(array["wavelength"].values).astype(float) if "wavelength" in array.coords else None


def warn_of_others(array, instrument, bands):
    """
    Warn if bands of one instrument are taken for bands of another.

    Parameters
    ----------
    array : xarray.DataArray
    instrument : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
        Bands of the instrument, one for each band of the array.
    """
    carried, names = array.attrs.get("instrument"), [band.name for band in bands]
    own = [str(name) for name in np.atleast_1d(array["band"].values)] if "band" in array.coords else names
    if carried not in (None, instrument.name) and own != names:
        warn(
            f"bands {', '.join(own)} of {carried} are taken for {', '.join(names)} of {instrument.name}, as they are: "
            f".fifesim.adjust_bands({instrument.name!r}) of surface reflectance brings them there"
        )


def _warn_of_counted(array, instrument):
    """Files opened by rioxarray count their bands from 1: numbers of the instrument's bands by chance only."""
    numbers = np.atleast_1d(array["band"].values)
    counted = numbers.dtype.kind in "iu" and np.array_equal(numbers, np.arange(1, numbers.size + 1))
    if counted and numbers.size < len(instrument.bands):
        first, last = (band_called(number, instrument) for number in numbers[[0, -1]])
        if first and last:
            warn(
                f"the raster counts its bands 1 to {numbers.size}, taken for {first.name} to {last.name}: name them "
                "with .assign_coords(band=['red', 'nir']) where they are others"
            )


def _band_at(wavelength, instrument):
    """The band whose centre is nearest to a wavelength, among those that respond there with half of their peak."""
    # A panchromatic band may respond more than the narrow band that is meant.
    found = [band for band in instrument.bands if _responds(band, wavelength, 0.5)]
    if not found:
        centres = ", ".join(f"{band.name} at {band.wavelength:.3f}" for band in instrument.bands)
        raise ValueError(f"no band of {instrument.name} responds at {wavelength:g} um: it has {centres} um")
    return min(found, key=lambda band: abs(band.wavelength - wavelength))
