"""
Instruments by name, and from user-supplied files, where missing values are derived from the rest of a short file.

The descriptions are the files ``data/instruments/*.toml``; a new instrument is a new file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import TypeAdapter, ValidationError

from fifesim.base import files
from fifesim.base.arguments import FilePath
from fifesim.base.bands import solar_irradiance
from fifesim.base.caches import cached
from fifesim.base.files import in_a_line, read_toml, shown
from fifesim.sensor.description.fields import errors_in_words, key, lookup
from fifesim.sensor.description.instrument_file import (
    BAND_NUMBERS,
    INSTRUMENT_NUMBERS,
    OPTIONAL_NUMBERS,
    Instrument,
    InstrumentBand,
    InstrumentLike,
    Noise,
    Product,
    Scan,
    ScanZone,
)
from fifesim.sensor.description.plausibility import check_instrument_units, check_sampling
from fifesim.sensor.description.spatial_response import ResponseName, with_response
from fifesim.sensor.description.spectral_response import LONGEST, SpectralResponse

# Keys of a band in a short file that belong to its noise, with their names there, and those that make its response.
_NOISE_KEYS = {
    "snr": "snr", "snr_radiance": "radiance", "snr_shot": "shot",
    "high_snr": "high_snr", "high_snr_radiance": "high_radiance",
}  # fmt: skip
_RESPONSE_KEYS = ("center", "width", "shape")

# Keys that are suggested for misspelt ones, including keys of short files.
_KEYS = {key.name for kind in (Instrument, InstrumentBand, Noise, Product, Scan, ScanZone) for key in fields(kind)}
_KEYS |= {*_NOISE_KEYS, *_RESPONSE_KEYS, "mtf_at_nyquist"}


def instrument(
    name: InstrumentLike,
    response: ResponseName | None = None,
) -> Instrument:
    """
    Description of an instrument by its name, or from a file.

    Parameters
    ----------
    name : str, path-like or Instrument
        Name or alias in any case, such as ``"TM"`` or ``"Landsat 8"``; or the path of a file, which ends in
        ``.toml``. An Instrument passes through.
    response : {"system", "detector", "paper", "sharpest", "softest"}, optional
        Spatial response, by default "system", the best that is known of the whole system. "detector" is the ideal case,
        the detector alone; "paper" is Table 1 of Friedl et al. (1995), for TM. "sharpest" and "softest" are the ends of
        the stated uncertainty of the modulation transfer at the Nyquist frequency.

    Returns
    -------
    instrument : Instrument

    Raises
    ------
    ValueError
        If no instrument has this name; the message lists those there are. If the file is not right.
    FileNotFoundError
        If there is no such file.

    Examples
    --------
    >>> from fifesim import instrument
    >>> tm = instrument("tm")
    >>> tm.name, round(tm.line_spread.fwhm, 2), round(tm.ground_interval, 3)
    ('TM', 36.01, 30.315)
    """
    if isinstance(name, Instrument):
        _check(name)
        found = name
    elif isinstance(name, Path) or (isinstance(name, str) and Path(name).suffix.lower() == ".toml"):
        path = Path(name).absolute()
        # A file is read again if it or a table that it names has changed.
        tables = tables_of(path) if os.path.isfile(path) else ()
        found = _read_again(path, tuple(map(_state, (path, *tables))))
    else:
        found = catalogued(name) if isinstance(name, str) else lookup(name, _catalogue(), "instrument")
    return found if response is None else with_response(found, response)


@cached(128, "instruments by name")
def catalogued(name):
    """Built-in instrument by name or alias."""
    # Most files have the name of the instrument; reading all of them takes ten times as long.
    path = _files().get(key(name)) if isinstance(name, str) else None
    if path and key(_listed(path).name) == key(name):
        return _listed(path)
    return lookup(name, _catalogue(), "instrument")


def instrument_names() -> tuple[str, ...]:
    """
    Names of the instruments.

    Returns
    -------
    names : tuple of str
        In alphabetical order.

    Examples
    --------
    >>> from fifesim.sensor import instrument_names
    >>> "TM" in instrument_names()
    True
    """
    return tuple(sorted({item.name for item in _catalogue().values()}))


def read_instrument(path: FilePath) -> Instrument:
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
        If the file is no regular one or no valid TOML, a key is missing, unknown or has a wrong value, or a number
        cannot be in the unit of its key; the message names file, key and remedy.
    FileNotFoundError
        If there is no such file.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> bands = '{ name = "red", center = 0.668, width = 0.010 }, '
    >>> bands += '{ name = "nir", center = 0.840, width = 0.040 }'
    >>> path = Path(mkdtemp()) / "camera.toml"
    >>> text = f'name = "Camera"\\naltitude = 120.0\\ngsd = 0.1\\nbits = 12\\nbands = [{bands}]\\n'
    >>> _ = path.write_text(text, encoding="utf-8")
    >>> [band.name for band in fifesim.sensor.read_instrument(path).bands]
    ['red', 'nir']
    """
    # Tables are found relative to the file, even if the working directory changes.
    path = Path(path).absolute()
    return _in_right_units(_parse(path), path)


def read_responses(
    path: FilePath,
    *,
    name: str,
    altitude: float,
    gsd: float,
    bits: int = 12,
    mtf_at_nyquist: float | None = None,
    snr: Mapping[str, tuple[float, float]] | None = None,
) -> Instrument:
    """
    Description of an instrument from a table of measured spectral responses.

    Parameters
    ----------
    path : str or path
        CSV file with a column ``wavelength`` [um] and a column for each band, whose empty cells are left out.
    name : str
    altitude : float
        Above the ground. [m]
    gsd : float
        Pixel of the gridded product. [m]
    bits : int, optional
        Number of radiometric bits.
    mtf_at_nyquist : float, optional
        Modulation transfer at the Nyquist frequency of the sampling interval; by default only the detector is
        known, which is as wide as a pixel. [1]
    snr : mapping, optional
        Ratio of signal to noise [1] and the radiance at which it holds [W m-2 sr-1 um-1], by band.

    Returns
    -------
    instrument : Instrument
        Other numbers have the defaults of a short instrument file.

    Raises
    ------
    ValueError
        If the table is not right, wavelengths are not in um, or a number cannot be in its unit.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> import fifesim
    >>> path = Path(mkdtemp()) / "srf.csv"
    >>> text = "wavelength,red,nir\\n.62,0,\\n.66,1,\\n.7,0,0\\n.8,,1\\n.9,,0\\n"
    >>> _ = path.write_text(text, encoding="utf-8")
    >>> camera = fifesim.sensor.read_responses(path, name="Camera", altitude=5e5, gsd=10.0)
    >>> [(band.name, round(band.wavelength, 3)) for band in camera.bands]
    [('red', 0.66), ('nir', 0.8)]
    """
    keys = {"name": name, "altitude": altitude, "gsd": gsd, "mtf_at_nyquist": mtf_at_nyquist}
    given = {key: float(value) if key != "name" else value for key, value in keys.items() if value is not None}
    given |= {"bits": bits, "bands": Path(path).name, "snr": dict(snr or {})}
    return _in_right_units(_validated(given, Path(path).absolute()), path)


def _in_right_units(found, path):
    try:
        check_instrument_units(found)
    except ValueError as error:
        raise ValueError(f"{Path(path).name}: {error}") from None
    return found


def tables_of(path):
    """Paths of the tables that an instrument file names, in its folder."""
    bands, folder = read_toml(path).get("bands"), Path(path).absolute().parent
    if isinstance(bands, str):
        return (folder / bands,)
    responses = [band.get("srf") for band in bands if isinstance(band, dict)] if isinstance(bands, list) else []
    names = [each["table"] for each in responses if isinstance(each, dict) and isinstance(each.get("table"), str)]
    return tuple(folder / name for name in dict.fromkeys(names))


def _parse(path):
    try:
        content = read_toml(path)
    except FileNotFoundError:
        raise FileNotFoundError(f"there is no instrument file {in_a_line(str(path))}") from None
    return _validated(content, path)


def _validated(content, path):
    try:
        return TypeAdapter(Instrument).validate_python(_completed(content, path))
    except ValidationError as error:
        raise ValueError(in_a_line(f"{path.name}: {errors_in_words(error, _KEYS)}")) from None
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from None


@cached(128, "instrument files")
def _files():
    """Instrument files by name."""
    return {path.stem: path for path in sorted(files.path("instruments").glob("*.toml"))}


_listed = cached(None, "instruments of the package")(_parse)


@cached(128, "instrument names")
def _catalogue():
    """Instruments by names and aliases."""
    found = {}
    for item in map(_listed, _files().values()):
        for name in (item.name, *item.aliases):
            if found.setdefault(key(name), item) is not item:
                raise ValueError(f"two instruments are called {name}: {found[key(name)].name} and {item.name}")
    return found


@cached(128, "checked instruments")
def _check(given):
    """Check the units of altitude, pixels and intervals of an instrument that was made in Python, once."""
    check_sampling(given)


@cached(32, "own instrument files")
def _read_again(path, states):
    return read_instrument(path)


def _state(path):
    """State by which a changed file is recognized, None if it is missing."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size


# References that are added, by their keys.
_FILE = "this file"
_SAMPLING = "gsd and altitude"
_SPECTRUM = "ASTM G173"
_WHITE = "white surface"
_REFERENCES = {
    _SAMPLING: "taken for gsd over altitude, with a detector as wide as that",
    _SPECTRUM: "ASTM G173-03, extraterrestrial spectrum, as distributed with pvlib, over the band's response",
    _WHITE: "taken for a white surface below an overhead sun of ASTM G173-03, and 0 for digital number 0",
}

# Created once, since creation takes longer than validation.
_ADAPTER: TypeAdapter = TypeAdapter(SpectralResponse)


def _completed(content, path):
    """Content of a short instrument file, completed by derived values."""
    content = dict(content)
    references = content.get("references", {})
    if isinstance(content.get("bands"), str):
        content["bands"] = _table(path.parent, content["bands"])
        _add_noise(content["bands"], content.pop("snr", {}))
    if "sources" not in content:
        numbers = (*INSTRUMENT_NUMBERS, *BAND_NUMBERS, *OPTIONAL_NUMBERS)
        content["sources"] = dict.fromkeys(numbers, _FILE)
        references = {_FILE: f"as {in_a_line(path.name, 100)} says"} | references
    if "name" in content:
        content.setdefault("title", content["name"])
    _blur(content)
    added = _sampling(content, content)
    content |= added
    if isinstance(content["sources"], dict):
        content["sources"] = content["sources"] | dict.fromkeys(added, _SAMPLING)
    if isinstance(content.get("bands"), list):
        content["bands"] = [
            _band(each, content, bool(added), path.parent) if isinstance(each, dict) else each
            for each in content["bands"]
        ]
    if isinstance(references, dict):
        content["references"] = references | {key: _REFERENCES[key] for key in _used(content) if key in _REFERENCES}
    return content


def _add_noise(bands, ratios):
    """Add the noise of bands of a table by name, each a ratio of signal to noise and the radiance where it holds."""
    if not isinstance(ratios, dict):
        raise ValueError(f"snr: it must have the names of bands, such as snr = {{ red = [200, 100] }}, got {ratios!r}")
    if unknown := set(ratios) - {band["name"] for band in bands}:
        known = ", ".join(band["name"] for band in bands)
        raise ValueError(f"snr: there is no band {', '.join(sorted(unknown))}, the table has {known}")
    for band in bands:
        if band["name"] in ratios:
            if np.shape(pair := ratios[band["name"]]) != (2,):
                raise ValueError(f"snr: {band['name']} needs a ratio and the radiance where it holds, got {pair}")
            band["snr"], band["snr_radiance"] = map(float, pair)


def _used(content):
    """Keys of references that an instrument and its bands cite as sources."""
    bands = content["bands"] if isinstance(content.get("bands"), list) else []
    tables = [content["sources"], *(band.get("sources") for band in bands if isinstance(band, dict))]
    return [key for table in tables if isinstance(table, dict) for key in table.values() if isinstance(key, str)]


def _blur(item):
    """Replace ``mtf_at_nyquist``, a number or one for each axis, by a Gaussian response of an instrument or a band."""
    transfer = item.pop("mtf_at_nyquist", None)
    if transfer is None:
        return
    if "lsf" in item:
        raise ValueError("mtf_at_nyquist and lsf both state the blur: give one of them")
    if isinstance(transfer, dict):
        item["lsf"] = {axis: {"kind": "gaussian", "mtf_at_nyquist": value} for axis, value in transfer.items()}
    else:
        item["lsf"] = {"kind": "gaussian", "mtf_at_nyquist": transfer}


def _sampling(item, content):
    """Missing interval, field of view and line spread of an instrument or a band, from its pixel."""
    gsd, altitude = item.get("gsd"), content.get("altitude")
    if "interval" in item or not all(isinstance(each, int | float) and each > 0 for each in (gsd, altitude)):
        return {}
    found = {"interval": gsd / altitude}
    found |= {} if "ifov" in item else {"ifov": gsd / altitude}
    return found | ({} if "lsf" in item or item is not content else {"lsf": {"kind": "boxcar"}})


def _band(given, content, sampled, folder):
    """Band with its missing values."""
    band, sources = dict(given), {}
    _blur(band)
    response = {key: band.pop(key) for key in _RESPONSE_KEYS if key in band}
    if response:
        band.setdefault("srf", response)
    srf = band.get("srf")
    if isinstance(srf, dict) and "table" in srf:
        band["srf"] = srf | {"folder": str(folder)}
    noise = {name: band.pop(key) for key, name in _NOISE_KEYS.items() if key in band}
    if noise:
        band.setdefault("noise", noise)
    if sampled:
        added = _sampling(band, content)
        band, sources = band | added, dict.fromkeys(added, _SAMPLING)
    derived = {}
    if not {"solar_irradiance", "full_scale_radiance"} <= set(band):
        irradiance = _irradiance(band.get("srf"))
        derived["solar_irradiance"] = irradiance, _SPECTRUM
        derived["full_scale_radiance"] = irradiance / np.pi, _WHITE
    derived["min_radiance"] = 0.0, _WHITE
    for number, (value, source) in derived.items():
        if number not in band:
            band[number], sources[number] = value, source
    own = band.get("sources", {})
    return band | {"sources": sources | own} if sources and isinstance(own, dict) else band


def _irradiance(srf):
    """Solar irradiance over the response [W m-2 um-1]; 1 if unreadable, which the reader of the file reports."""
    try:
        return solar_irradiance(_ADAPTER.validate_python(srf).read("band"))
    except (ValidationError, ValueError, TypeError, OSError):
        return 1.0


def _table(folder, name):
    """Bands of a CSV file, one dict for each row."""
    path = Path(folder) / name
    try:
        if Path(name).name != name or not os.path.isfile(path):
            raise FileNotFoundError
        table = files.read_csv(path, "bands", dtype={"name": str, "shape": str})
    except (OSError, ValueError) as error:
        reason = "no such file beside it" if isinstance(error, FileNotFoundError) else in_a_line(error, 150)
        raise ValueError(f"bands = {shown(name)}: {reason}; type a CSV file of bands, or [[bands]]") from None
    missing = {"name", "center", "width"} - set(table.columns)
    if missing and "wavelength" in table.columns:
        return _measured(table, f"bands = {shown(name)}")
    if missing:
        raise ValueError(f"bands = {shown(name)}: it lacks the columns {', '.join(sorted(missing))} [um]")
    return [{name: cell for name, cell in row.items() if not pd.isna(cell)} for row in table.to_dict("records")]


def _measured(table, what):
    """Bands of a table of responses by wavelength, each from the rows where it has one."""
    names = [column for column in table.columns if column != "wavelength"]
    if not names:
        raise ValueError(f"{what}: it has no column beside wavelength: type one column of responses for each band")
    for column in table.columns:
        if (first := column.rpartition(".")[0]) in names:
            raise ValueError(f"{what}: the column {first} occurs twice: type another name for one of them")
        numbers = pd.to_numeric(table[column], errors="coerce")
        if (wrong := numbers.isna() & table[column].notna()).any():
            raise ValueError(f"{what}: the column {column} must have numbers, got {table[column][wrong].iloc[0]!r}")
    if table["wavelength"].max() > LONGEST:
        largest = table["wavelength"].max()
        raise ValueError(f"{what}: wavelength {largest:g}: it is in um, this looks like nm: divide by 1000")
    found, table = [], table.sort_values("wavelength")
    for name in names:
        own = table[table[name].notna()]
        response = own[name].astype(float)
        if len(own) < 2 or not response.max() > 0:
            raise ValueError(f"{what}: the column {name} has no response above 0 at two wavelengths or more")
        found.append({"name": name, "srf": {"wavelength": own["wavelength"].tolist(), "response": response.tolist()}})
    return found
