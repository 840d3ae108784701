"""Instruments for labelled rasters: their bands by name and wavelength, point spread, modulation transfer and noise."""

from __future__ import annotations

import itertools
from contextlib import suppress
from dataclasses import replace

import numpy as np
import xarray as xr
from pydantic import TypeAdapter, ValidationError

from fifesim.base.arguments import Names, NumberOrList, Numbers, Range, check_number
from fifesim.base.messages import warn
from fifesim.grids import cf
from fifesim.grids.sites import is_fife
from fifesim.sensor.description.fields import band_called
from fifesim.sensor.description.instrument_file import Instrument, InstrumentLike
from fifesim.sensor.description.instruments import catalogued, instrument_names
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.spectral_response import ResponseList

_ADAPTER: TypeAdapter = TypeAdapter(Instrument)

# Instrument of the paper, the default for scenes on the FIFE site.
_FIFE = "TM"

# [W m-2 sr-1 um-1]
_BRIGHTEST = 2000.0


def attributes_of(description):
    """Attributes for the instrument of a raster: its name, and the full description of a user-supplied one."""
    named = {"instrument": description.name}
    with suppress(ValueError):
        if catalogued(description.name) == description:
            return named
    responses = [ResponseList(band.response.wavelength, band.response.response) for band in description.bands]
    bands = tuple(replace(band, srf=srf) for band, srf in zip(description.bands, responses, strict=True))
    return named | {"instrument_description": _ADAPTER.dump_json(replace(description, bands=bands)).decode()}


def coordinates_of_bands(bands, scales=None, solar_irradiance=None):
    """Coordinates along band: names, wavelengths, scales by name, and solar irradiance."""
    names, wavelengths = [band.name for band in bands], [band.wavelength for band in bands]
    if solar_irradiance is None:
        solar_irradiance = [band.solar_irradiance for band in bands]
    scales = {} if scales is None else scales
    return cf.band_coordinates(band=names, wavelength=wavelengths, **scales, solar_irradiance=solar_irradiance)


def is_radiance(array):
    """Whether a raster holds radiance, by its units."""
    return str(array.attrs.get("units", "1")).strip() == cf.QUANTITIES["toa_radiance"].units


def carried_instrument(array):
    """Instrument in the attributes of a raster, or None."""
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
    """Instrument: as given, else as carried by a raster, else of the paper for a scene made on the FIFE site."""
    found = find_instrument(given) if given is not None else carried_instrument(array)
    if found is None and is_fife(array):
        found = find_instrument(_FIFE)
    if found is None:
        raise ValueError(
            f"the instrument of {array.name or 'the raster'} is unknown: give instrument=, one of "
            f"{', '.join(instrument_names())}, or an instrument file"
        )
    return found


def matching_bands(array, instrument):
    """Match the bands of a raster to the bands of an instrument by names or wavelengths."""
    known = {band.name.lower() for band in instrument.bands}
    names, wavelengths = _names_and_wavelengths(array)
    if names and {name.lower() for name in names} <= known:
        found = instrument.select(names)
        if wavelengths is None or all(map(_responds, found, wavelengths)):
            return found
        check_wavelengths(array, instrument)
    if wavelengths is not None:
        return instrument.select([_band_at(value, instrument).name for value in wavelengths])
    if names:
        _warn_of_counted(array, instrument)
        return instrument.select(names)
    raise ValueError(
        f"the raster's bands have neither names of {instrument.name} ({', '.join(b.name for b in instrument.bands)}) "
        "nor a wavelength: assign a coordinate 'band' or 'wavelength' [um] along band"
    )


def _responds(band, wavelength, share=0.1):
    """Whether a band responds at a wavelength with a share of its peak; NaN is compatible with every band."""
    # Bands respond at their nominal centres with 0.6 of their peak and more.
    table = band.response
    response = np.interp(wavelength, table.wavelength, table.response, left=0.0, right=0.0)
    return bool(np.isnan(wavelength) or response >= share * max(table.response))


def check_wavelengths(array, instrument=None):
    """Raise ValueError if bands have names of an instrument but wavelengths outside of their responses."""
    names, wavelengths = _names_and_wavelengths(array)
    if not names or wavelengths is None:
        return
    first, others = None, instrument_names()
    own = [] if instrument is None else [instrument]
    if "instrument_description" in array.attrs or array.attrs.get("instrument") in others:
        own.append(carried_instrument(array))
    for candidate in itertools.chain(own, map(catalogued, others)):
        known = {band.name.lower(): band for band in candidate.bands}
        if not {name.lower() for name in names} <= known.keys():
            continue
        bands = [known[name.lower()] for name in names]
        wrong = [pair for pair in zip(bands, wavelengths, strict=True) if not _responds(*pair)]
        if not wrong:
            return
        first = first or (candidate.name, *wrong[0])
    if first:
        name, band, wavelength = first
        raise ValueError(
            f"band {band.name} has the wavelength {wavelength:g} um, and {band.name} of {name} is at "
            f"{band.wavelength:.3g} um: name and wavelength contradict each other. Correct the order of the bands or "
            "one coordinate, or drop the wavelengths with .drop_vars('wavelength') if the names are right"
        )


def _names_and_wavelengths(array):
    """Names of bands, an empty list without any, and wavelengths or None."""
    known = array.coords.variables
    names = [str(name) for name in np.atleast_1d(known["band"].values)] if "band" in known else []
    return names, np.atleast_1d(known["wavelength"].values).astype(float) if "wavelength" in known else None


def warn_of_others(array, instrument, bands):
    """Warn if bands of one instrument are taken for bands of another."""
    carried, names = array.attrs.get("instrument"), [band.name for band in bands]
    own = _names_and_wavelengths(array)[0] or names
    if carried not in (None, instrument.name) and own != names:
        warn(
            f"bands {', '.join(own)} of {carried} are taken for {', '.join(names)} of {instrument.name}, as they are: "
            f".fifesim.adjust_bands({instrument.name!r}) of surface reflectance brings them there"
        )


def _warn_of_counted(array, instrument):
    """Warn of band numbers that rioxarray counted from 1, which match numbers of the instrument by chance only."""
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
    """Band with the centre nearest to a wavelength, among those that respond with half of their peak."""
    # A panchromatic band may respond more than the narrow band that is meant.
    found = [band for band in instrument.bands if _responds(band, wavelength, 0.5)]
    if not found:
        centres = ", ".join(f"{band.name} at {band.wavelength:.3f}" for band in instrument.bands)
        raise ValueError(f"no band of {instrument.name} responds at {wavelength:g} um: it has {centres} um")
    return min(found, key=lambda band: abs(band.wavelength - wavelength))


# Samples of a point spread over the full width of its support, when no spacing is given.
_SAMPLES = 121

# Samples of the finest spacing, which take 200 MB.
_MOST_SAMPLES = 5000


def psf(instrument: InstrumentLike = "TM", band: str | None = None, *, spacing: float | None = None) -> xr.DataArray:
    r"""
    Point spread function of an instrument on the ground at nadir.

    .. math:: p(x, y) = w_\mathrm{along}(y) \, w_\mathrm{across}(x)

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument, optional
    band : str, optional
        Name of a band; the first by default.
    spacing : float, optional
        Distance between samples; by default the response is 121 samples wide. [m]

    Returns
    -------
    psf : xarray.DataArray, dims (y, x)
        Mean of the response over each sample, so that the sum times the squared spacing is 1. ``x`` and ``y`` count
        from the pixel's centre, across and along the track. [m-2]

    Raises
    ------
    ValueError
        If the instrument or band is unknown, or the spacing is not positive.

    See Also
    --------
    fifesim.sensor.mtf, fifesim.sense

    Examples
    --------
    >>> import fifesim
    >>> response = fifesim.sensor.psf("TM", "TM3", spacing=3.0)
    >>> round(float(response.sum()) * 3.0**2, 6)
    1.0
    """
    description = find_instrument(instrument)
    band = description.bands[0] if band is None else description.select(band)[0]
    along, across = description.line_spreads(band)
    if spacing is None:
        spacing = 2 * max(along.half_width, across.half_width) / _SAMPLES
    widest = 2 * max(along.half_width, across.half_width)
    note = f"from 1/{_MOST_SAMPLES} of the support; give metres, not km"
    check_number("spacing", spacing, Range("m", widest / _MOST_SAMPLES, np.inf, note=note, ends="[)"))
    y, rows = _line(along, spacing)
    x, columns = _line(across, spacing)
    return xr.DataArray(
        np.outer(rows, columns),
        dims=("y", "x"),
        coords={
            "y": ("y", y, {"long_name": "distance along the track, from the pixel's centre", "units": "m"}),
            "x": ("x", x, {"long_name": "distance across the track, from the pixel's centre", "units": "m"}),
            "band": band.name,
        },
        name="psf",
        attrs={"long_name": "point spread function", "units": "m-2", "instrument": description.name},
    )


def mtf(
    instrument: InstrumentLike = "TM", bands: Names | None = None, *, frequency: NumberOrList | None = None
) -> xr.DataArray:
    """
    Modulation transfer function of an instrument on the ground at nadir.

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument, optional
    bands : str or sequence of str, optional
        Names of bands; all by default.
    frequency : array, optional
        Spatial frequencies; by default from 0 to twice the Nyquist frequency of the finest sampling. [cycles m-1]

    Returns
    -------
    mtf : xarray.DataArray, dims (band, direction, frequency)
        ``direction`` is "along" or "across" the track. Negative values mean reversed contrast. Coordinates along band
        and direction are the Nyquist frequency of the sampling interval, ``nyquist``, and the transfer there,
        ``at_nyquist``; and likewise ``product_nyquist`` and ``at_product_nyquist`` for the pixels of the gridded
        product. [1]

    Raises
    ------
    ValueError
        If the instrument or band is unknown.

    See Also
    --------
    fifesim.sensor.psf, fifesim.Instrument

    Examples
    --------
    >>> import fifesim
    >>> transfer = fifesim.sensor.mtf("TM", ["TM3"], frequency=[0.0, 1 / 60])
    >>> transfer.sel(direction="across").round(2).values
    array([[1.  , 0.28]])
    """
    description = find_instrument(instrument)
    selected = description.select(bands)
    spreads = [description.line_spreads(band) for band in selected]
    own = np.array([[0.5 / interval for interval in description.ground_intervals(band)] for band in selected])
    product = np.array([0.5 / description.pixel(band) for band in selected])
    frequency = np.linspace(0, 2 * own.max(), 201) if frequency is None else np.atleast_1d(frequency).astype(float)
    if not np.all((frequency >= 0) & (frequency <= 100 * own.max())):
        raise ValueError(
            f"frequency must be from 0 to {100 * own.max():.3g} cycles m-1, 100 times the Nyquist frequency, got "
            f"{np.max(np.abs(frequency)):g}: a wave of 60 m has 1 / 60"
        )
    both, units = ("band", "direction"), {"units": "cycles m-1"}
    return xr.DataArray(
        np.array([[spread.mtf(frequency) for spread in pair] for pair in spreads]),
        dims=(*both, "frequency"),
        coords={
            "band": [band.name for band in selected],
            "direction": ["along", "across"],
            "frequency": ("frequency", frequency, {"long_name": "spatial frequency"} | units),
            "nyquist": (both, own, {"long_name": "Nyquist frequency of the own interval"} | units),
            "at_nyquist": (both, _at(spreads, own), {"long_name": "transfer at the Nyquist frequency", "units": "1"}),
            "product_nyquist": ("band", product, {"long_name": "Nyquist frequency of the gridded product"} | units),
            "at_product_nyquist": (
                both,
                _at(spreads, np.stack([product, product], axis=1)),
                {"long_name": "transfer at the Nyquist frequency of the gridded product", "units": "1"},
            ),
        },
        name="mtf",
        attrs={"long_name": "modulation transfer function", "units": "1", "instrument": description.name},
    )


def _at(spreads, frequencies):
    """Transfer of each band along and across at separate frequencies, shape (band, direction). [1]"""
    pairs = zip(spreads, frequencies, strict=True)
    return np.array([[float(one.mtf(at)) for one, at in zip(spread, own, strict=True)] for spread, own in pairs])


def _line(spread, spacing):
    """Centres of samples of a line spread function, and its mean over each. [m-1]"""
    half = int(np.ceil(spread.half_width / spacing - 0.5))
    centers = np.arange(-half, half + 1) * spacing
    edges = np.append(centers - spacing / 2, centers[-1] + spacing / 2)
    return centers, np.diff(spread.cumulative(edges)) / spacing


def noise_equivalent_radiance(instrument: InstrumentLike, band: str, radiance: Numbers) -> np.ndarray:
    """
    Standard deviation of an instrument's shot and thermal noise at a radiance.

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument
    band : str
        Name of a band.
    radiance : array
        [W m-2 sr-1 um-1]

    Returns
    -------
    nedl : array, shape of radiance
        Without fixed pattern and quantisation. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If the instrument or band is unknown, its description has no noise, or a radiance is negative.

    Examples
    --------
    >>> import fifesim
    >>> round(fifesim.sensor.noise_equivalent_radiance("OLI", "OLI4", 22.0).item(), 3)
    0.096
    """
    return _noise_of(instrument, band).noise_equivalent_radiance(_checked(radiance))


def snr(instrument: InstrumentLike, band: str, radiance: Numbers) -> np.ndarray:
    """
    Signal-to-noise ratio of an instrument at a radiance, with shot and thermal noise.

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument
    band : str
        Name of a band.
    radiance : array
        [W m-2 sr-1 um-1]

    Returns
    -------
    snr : array, shape of radiance
        Without fixed pattern and quantisation. [1]

    Raises
    ------
    ValueError
        If the instrument or band is unknown, its description has no noise, or a radiance is negative.

    Examples
    --------
    >>> import fifesim
    >>> fifesim.sensor.snr("OLI", "OLI4", [22.0, 60.0]).round()
    array([230., 510.])
    """
    return _noise_of(instrument, band).snr(_checked(radiance))


def _checked(radiance):
    """Radiance as an array; ValueError if a value is impossible."""
    radiance = np.asarray(radiance, float)
    # White ground under the sun at the zenith has 700.
    if (wrong := radiance[~((radiance >= 0) & (radiance <= _BRIGHTEST))]).size:
        raise ValueError(
            f"radiance must not be negative, nor above {_BRIGHTEST:g} W m-2 sr-1 um-1, got {wrong.flat[0]:g}"
        )
    return radiance


def _noise_of(instrument, band):
    description = find_instrument(instrument)
    (found,) = description.select([band])
    return description.noise_model(found)
