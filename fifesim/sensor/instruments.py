"""
Instruments: bands, sampling, spatial response and radiometry, each number with its source.

The descriptions are the files ``data/instruments/*.toml``; a further instrument is a further file.
"""

import tomllib
from dataclasses import field
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass
from pyrsr.rsr import RSR_reader

from fifesim import datasets
from fifesim.bands import Band
from fifesim.sensor.spatial import CosineSpread

_CONFIG = ConfigDict(extra="forbid")

# Strict: TOML has types, and text where a number belongs is a mistake.
_Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
_Name = Annotated[str, Field(strict=True, min_length=1)]

_INSTRUMENT_NUMBERS = ("altitude", "gsd", "interval", "bits", "lsf")
_BAND_NUMBERS = ("srf", "full_scale_radiance", "min_radiance", "solar_irradiance")


@dataclass(frozen=True, config=_CONFIG)
class CosineResponse:
    """
    Spatial response as tables of sensors give it: a cosine truncated at half amplitude, sampled at angles.

    Parameters
    ----------
    kind : "cosine"
    step : float
        Angle between samples of the response. [rad]
    count : int
        Number of samples.
    """

    kind: Literal["cosine"]
    step: _Positive
    count: Annotated[int, Field(strict=True, gt=0)]

    def spread(self, altitude):
        """
        Line spread function on the ground.

        Parameters
        ----------
        altitude : float
            Of the instrument. [m]

        Returns
        -------
        lsf : fifesim.sensor.spatial.CosineSpread
        """
        return CosineSpread(self.count * self.step * altitude)


@dataclass(frozen=True, config=_CONFIG)
class PyrsrResponse:
    """
    Relative spectral response among those that pyrsr distributes.

    Parameters
    ----------
    satellite, sensor, band : str
        Names in pyrsr, such as ``"Landsat-5"``, ``"TM"``, ``"3"``.
    """

    satellite: _Name
    sensor: _Name
    band: _Name


@dataclass(frozen=True, config=_CONFIG)
class InstrumentBand:
    """
    One band of an instrument.

    Parameters
    ----------
    name : str
        Name, such as ``"TM3"``.
    srf : PyrsrResponse
        Where the relative spectral response is found.
    full_scale_radiance, min_radiance : float
        Radiances of the largest digital number and of digital number 0. [W m-2 sr-1 um-1]
    solar_irradiance : float
        Extraterrestrial irradiance that the agency publishes for planetary reflectance. [W m-2 um-1]
    sources : dict
        Key of the instrument's references for each number that has another source than the instrument says.

    Raises
    ------
    pydantic.ValidationError
        If a value is wrong; `read_instrument` names file and key.
    """

    name: _Name
    srf: PyrsrResponse
    full_scale_radiance: _Number
    min_radiance: _Number
    solar_irradiance: _Positive
    sources: dict[Literal[_BAND_NUMBERS], str] = field(default_factory=dict, repr=False, hash=False)

    def __post_init__(self):
        if self.full_scale_radiance <= self.min_radiance:
            raise ValueError(
                f"full_scale_radiance must be above min_radiance, got {self.full_scale_radiance:g} "
                f"and {self.min_radiance:g} W m-2 sr-1 um-1"
            )

    @property
    def response(self):
        """Relative spectral response, a `fifesim.bands.Band`."""
        return _read_response(self.name, self.srf)

    @property
    def wavelength(self):
        """Response-weighted mean wavelength [um]."""
        return self.response.center


@dataclass(frozen=True, config=_CONFIG)
class Instrument:
    """
    Description of an instrument.

    Parameters
    ----------
    name, title : str
        Short name, such as ``"TM"``, and full name.
    altitude : float
        Above the ground. [m]
    gsd : float
        Pixel of the gridded product. [m]
    interval : float
        Angle between the instrument's own samples. [rad]
    bits : int
        Number of radiometric bits.
    lsf : CosineResponse
        Spatial response, the same along both axes.
    bands : tuple of InstrumentBand
    sources : dict
        Key of ``references`` for each number; a band's own sources come first.
    references : dict
        Publications by key.

    Raises
    ------
    pydantic.ValidationError
        If a value is wrong or has no source; `read_instrument` names file and key.
    """

    name: _Name
    title: _Name
    altitude: _Positive
    gsd: _Positive
    interval: _Positive
    bits: Annotated[int, Field(strict=True, ge=2, le=16)]
    lsf: CosineResponse
    bands: Annotated[tuple[InstrumentBand, ...], Field(min_length=1)] = field(repr=False)
    sources: dict[Literal[_INSTRUMENT_NUMBERS + _BAND_NUMBERS], str] = field(repr=False, hash=False)
    references: dict[str, str] = field(repr=False, hash=False)

    def __post_init__(self):
        names = [band.name for band in self.bands]
        if len(set(names)) < len(names):
            raise ValueError(f"bands: each name may occur once, got {', '.join(names)}")
        for number in _INSTRUMENT_NUMBERS:
            self.source(number)
        for band in self.bands:
            for number in _BAND_NUMBERS:
                self.source(number, band)

    @property
    def line_spread(self):
        """Line spread function on the ground."""
        return self.lsf.spread(self.altitude)

    @property
    def ground_interval(self):
        """Distance on the ground between the instrument's own samples at nadir [m]."""
        return self.interval * self.altitude

    def select(self, bands=None):
        """
        Bands by name.

        Parameters
        ----------
        bands : str or sequence of str, optional
            Names in any case; all bands by default.

        Returns
        -------
        bands : tuple of InstrumentBand
            In the order asked for.

        Raises
        ------
        ValueError
            If the instrument has no such band.

        Examples
        --------
        >>> [band.name for band in instrument("TM").select(["TM4", "tm3"])]
        ['TM4', 'TM3']
        """
        known = {band.name.lower(): band for band in self.bands}
        names = known if bands is None else [bands] if isinstance(bands, str) else bands
        found = tuple(_lookup(name, known, f"band of {self.name}") for name in names)
        if not found or len(set(found)) < len(found):
            raise ValueError(
                f"bands of {self.name} must be at least one, each once, got {', '.join(map(str, names)) or 'none'}"
            )
        return found

    def source(self, number, band=None):
        """
        Publication that a number comes from.

        Parameters
        ----------
        number : str
            Name of a parameter, such as ``"altitude"`` or ``"min_radiance"``.
        band : InstrumentBand, optional
            The band whose number it is.

        Returns
        -------
        reference : str

        Raises
        ------
        ValueError
            If the number has no source, or its source is not among the references.
        """
        key = (band.sources if band else {}).get(number) or self.sources.get(number)
        if key not in self.references:
            raise ValueError(f"sources.{number}: must be one of {', '.join(self.references)}, got {key!r}")
        return self.references[key]


def instrument(name):
    """
    Description of an instrument by its name.

    Parameters
    ----------
    name : str or Instrument
        Name in any case, such as ``"TM"``. An Instrument passes through.

    Returns
    -------
    instrument : Instrument

    Raises
    ------
    ValueError
        If no instrument has this name; the message lists those there are.

    Examples
    --------
    >>> tm = instrument("tm")
    >>> tm.name, round(tm.line_spread.width, 2), round(tm.ground_interval, 3)
    ('TM', 30.32, 30.315)
    """
    return name if isinstance(name, Instrument) else _lookup(name, _catalogue(), "instrument")


def instrument_names():
    """
    Names of the instruments.

    Returns
    -------
    names : tuple of str
        In alphabetical order.

    Examples
    --------
    >>> "TM" in instrument_names()
    True
    """
    return tuple(sorted(item.name for item in _catalogue().values()))


def read_instrument(path):
    """
    Description of an instrument from a file, such as a copy of ``data/instruments/tm.toml``.

    Parameters
    ----------
    path : str or path-like
        TOML file.

    Returns
    -------
    instrument : Instrument

    Raises
    ------
    ValueError
        If the file is no valid TOML, or a key is missing, unknown or has a wrong value; the message names it.
    """
    path = Path(path)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path.name} is not valid TOML: {error}") from None
    try:
        return TypeAdapter(Instrument).validate_python(content)
    except ValidationError as error:
        reasons = "; ".join(_explain(item) for item in error.errors())
        raise ValueError(f"{path.name}: {reasons}") from None


def _explain(error):
    """One line that names the key, its value and what is allowed; bands count from 1."""
    key = ".".join(str(part + 1) if isinstance(part, int) else part for part in error["loc"])
    if error["type"] == "unexpected_keyword_argument":
        return f"unknown key {key}"
    if error["type"] == "missing":
        return f"the key {key} is missing"
    if error["type"] == "value_error":
        return ": ".join(filter(None, (key, str(error["ctx"]["error"]))))
    return f"{key} = {error['input']!r}: {error['msg']}"


@lru_cache
def _catalogue():
    files = sorted(datasets.path("instruments").glob("*.toml"))
    return {item.name.lower(): item for item in map(read_instrument, files)}


def _lookup(name, known, kind):
    if not isinstance(name, str):
        raise TypeError(f"{kind}: the name must be text, got {name!r}")
    if name.lower() in known:
        return known[name.lower()]
    nearest = [known[key].name for key in get_close_matches(name.lower(), known, n=2, cutoff=0.4)]
    hint = f"did you mean {' or '.join(nearest)}? " if nearest else ""
    raise ValueError(f"unknown {kind} {name!r}: {hint}There are {', '.join(v.name for v in known.values())}")


@lru_cache
def _read_response(name, response):
    table = RSR_reader(response.satellite, response.sensor, LayerBandsAssignment=[response.band])[response.band]
    # pyrsr holds some sensors in nanometres and others in micrometres; no band reaches 100 um.
    wavelength = table[:, 0] / 1000 if table[-1, 0] > 100 else table[:, 0]
    # Measured responses scatter around zero outside of the band.
    return Band(name, wavelength, np.maximum(table[:, 1], 0))
