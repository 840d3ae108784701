"""
Instruments by name, and from user-supplied files.

The descriptions are the files ``data/instruments/*.toml``; a new instrument is a new file.
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Literal

from pydantic import TypeAdapter, ValidationError

from fifesim.base import files
from fifesim.base.arguments import FilePath, Kind
from fifesim.base.caches import cached
from fifesim.base.files import in_a_line, read_toml
from fifesim.sensor.description.fields import errors_in_words, key, lookup
from fifesim.sensor.description.instrument_file import (
    Instrument,
    InstrumentBand,
    InstrumentLike,
    Noise,
    Product,
    Scan,
    ScanZone,
)
from fifesim.sensor.description.plausibility import check_instrument_units
from fifesim.sensor.description.short_file import NOISE_KEYS, RESPONSE_KEYS, completed
from fifesim.sensor.description.spatial_response import with_response

# Keys that are suggested for misspelt ones, including keys of short files.
_KEYS = {key.name for kind in (Instrument, InstrumentBand, Noise, Product, Scan, ScanZone) for key in fields(kind)}
_KEYS |= {*NOISE_KEYS, *RESPONSE_KEYS, "mtf_at_nyquist"}


def instrument(
    name: InstrumentLike,
    response: Annotated[
        Literal["system", "detector", "paper", "sharpest", "softest"],
        Kind("'system', 'detector', 'paper', 'sharpest' or 'softest'"),
    ]
    | None = None,
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
        found = name
    elif isinstance(name, Path) or (isinstance(name, str) and Path(name).suffix.lower() == ".toml"):
        path = Path(name).absolute()
        # A file that has changed is read again, with its tables; one that is not there is an error of reading.
        state = _state(path)
        tables = () if state is None else _tables(path, state)
        found = _read_again(path, (state, *map(_state, tables)))
    else:
        found = catalogued(name) if isinstance(name, str) else lookup(name, _catalogue(), "instrument")
    return found if response is None else with_response(found, response)


@cached(128, "instruments by name")
def catalogued(name):
    """Built-in instrument by name or alias."""
    # Most are called as their file is; to read all of them takes ten times as long.
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
    >>> from fifesim import instrument_names
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
    >>> [band.name for band in fifesim.read_instrument(path).bands]
    ['red', 'nir']
    """
    # Tables that it names lie beside it, wherever Python goes.
    path = Path(path).absolute()
    found = _parse(path)
    try:
        check_instrument_units(found)
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from None
    return found


def tables_of(path):
    """Paths of the tables that an instrument file names, in its folder."""
    bands, folder = read_toml(path).get("bands"), Path(path).absolute().parent
    if isinstance(bands, str):
        return (folder / bands,)
    responses = [band.get("srf") for band in bands if isinstance(band, dict)] if isinstance(bands, list) else []
    names = [each["table"] for each in responses if isinstance(each, dict) and isinstance(each.get("table"), str)]
    return tuple(folder / name for name in dict.fromkeys(names))


def noise_of(description, band):
    """Noise model of a band of an instrument."""
    if band.noise is None:
        known = [name for name in instrument_names() if any(each.noise for each in instrument(name).bands)]
        raise ValueError(
            f"the description of {description.name} has no noise for {band.name}: leave noise out, give "
            "noise_models=fifesim.NoiseModel(...), in a scenario [sensor.noise_model], or take an instrument that has "
            f"it, such as {', '.join(known)}"
        )
    return description.noise_model(band)


def _parse(path):
    try:
        content = read_toml(path)
    except FileNotFoundError:
        raise FileNotFoundError(f"there is no instrument file {in_a_line(str(path))}") from None
    try:
        return TypeAdapter(Instrument).validate_python(completed(content, path))
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


@cached(32, "own instrument files")
def _read_again(path, states):
    return read_instrument(path)


@cached(32, "spectral files of instruments")
def _tables(path, state):
    return tables_of(path)


def _state(path):
    """State by which a changed file is recognized, None if it is missing."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size
