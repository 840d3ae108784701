"""Short instrument files: what a file leaves out is taken from the rest of it, and said so as the number's source."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import TypeAdapter, ValidationError

from fifesim.base.bands import solar_irradiance
from fifesim.base.foreign import check_regular, in_a_line, shown
from fifesim.sensor.description.band import BAND_NUMBERS, INSTRUMENT_NUMBERS, OPTIONAL_NUMBERS
from fifesim.sensor.description.spectral_response import SpectralResponse

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
_RESPONSE = ("center", "width", "shape")
_NOISE = {"snr": "snr", "snr_radiance": "radiance", "snr_shot": "shot"}

# Made once: making it takes longer than what it does.
_ADAPTER = TypeAdapter(SpectralResponse)


def completed(content, path):
    """
    Content of an instrument file with what a short one leaves out.

    Parameters
    ----------
    content : dict
        As TOML gives it. ``bands`` may be the name of a CSV file beside it, a row for each. A band may have ``center``,
        ``width`` [um] and ``shape`` instead of ``srf``, and ``snr`` at ``snr_radiance`` [W m-2 sr-1 um-1] instead of
        ``noise``.
    path : pathlib.Path
        Of the file.

    Returns
    -------
    content : dict
        With ``interval``, ``ifov`` and ``lsf`` by ``gsd`` and ``altitude``, ``solar_irradiance`` by the reference
        spectrum, ``full_scale_radiance`` and ``min_radiance`` of a white surface and of none, and a source for each of
        these; where the file has no ``sources``, its numbers have the file itself as source.

    Raises
    ------
    ValueError
        If there is no such CSV file, or it has no columns name, center and width.
    """
    content = dict(content)
    references = content.get("references", {})
    if isinstance(content.get("bands"), str):
        content["bands"] = _table(path.parent, content["bands"])
    if "sources" not in content:
        numbers = (*INSTRUMENT_NUMBERS, *BAND_NUMBERS, *OPTIONAL_NUMBERS)
        content["sources"] = dict.fromkeys(numbers, _FILE)
        references = {_FILE: f"as {in_a_line(path.name, 100)} says"} | references
    if "name" in content:
        content.setdefault("title", content["name"])
    added, sources = _sampling(content, content)
    content |= added
    if isinstance(content["sources"], dict):
        content["sources"] = content["sources"] | sources
    if isinstance(content.get("bands"), list):
        content["bands"] = [
            _band(each, content, bool(added), path.parent) if isinstance(each, dict) else each
            for each in content["bands"]
        ]
    if isinstance(references, dict):
        content["references"] = references | {key: _REFERENCES[key] for key in _used(content) if key in _REFERENCES}
    return content


def _used(content):
    """Keys of references that an instrument and its bands have as sources."""
    bands = content["bands"] if isinstance(content.get("bands"), list) else []
    tables = [content["sources"], *(band.get("sources") for band in bands if isinstance(band, dict))]
    return [key for table in tables if isinstance(table, dict) for key in table.values() if isinstance(key, str)]


def _sampling(item, content):
    """Interval, field of view and line spread of an instrument or a band, by its pixel, where it has none."""
    gsd, altitude = item.get("gsd"), content.get("altitude")
    if "interval" in item or not all(isinstance(each, int | float) and each > 0 for each in (gsd, altitude)):
        return {}, {}
    found = {"interval": gsd / altitude}
    found |= {} if "ifov" in item else {"ifov": gsd / altitude}
    found |= {} if "lsf" in item or item is not content else {"lsf": {"kind": "boxcar"}}
    return found, dict.fromkeys(found, _SAMPLING)


def _band(given, content, sampled, folder):
    """A band with what it leaves out."""
    band, sources = dict(given), {}
    response = {key: band.pop(key) for key in _RESPONSE if key in band}
    if response:
        band.setdefault("srf", response)
    noise = {name: band.pop(key) for key, name in _NOISE.items() if key in band}
    if noise:
        band.setdefault("noise", noise)
    if sampled:
        added, sources = _sampling(band, content)
        band |= added
    if not {"solar_irradiance", "full_scale_radiance"} <= set(band):
        irradiance = _irradiance(band, folder)
        taken = {"solar_irradiance": irradiance, "full_scale_radiance": irradiance / np.pi}
        taken = {key: value for key, value in taken.items() if key not in band}
        band |= taken
        sources |= {key: _SPECTRUM if key == "solar_irradiance" else _WHITE for key in taken}
    if "min_radiance" not in band:
        band["min_radiance"], sources["min_radiance"] = 0.0, _WHITE
    own = band.get("sources", {})
    return band | {"sources": sources | own} if sources and isinstance(own, dict) else band


def _irradiance(band, folder):
    """Of the sun over the response. One that cannot be read is told by who reads the whole file."""
    srf = band.get("srf")
    srf = srf | {"folder": str(folder)} if isinstance(srf, dict) and "table" in srf else srf
    try:
        return solar_irradiance(_ADAPTER.validate_python(srf).read("band"))
    except (ValidationError, ValueError, TypeError, OSError):
        return 1.0


def _table(folder, name):
    """Bands of a CSV file, each a dict of what its row has."""
    path = Path(folder) / name
    try:
        if Path(name).name != name or not os.path.isfile(path):
            raise FileNotFoundError
        check_regular(path)
        table = pd.read_csv(path, comment="#", skipinitialspace=True, dtype={"name": str, "shape": str})
    except (OSError, ValueError) as error:
        reason = "no such file beside it" if isinstance(error, FileNotFoundError) else in_a_line(error, 150)
        raise ValueError(f"bands = {shown(name)}: {reason}; type a CSV file of bands, or [[bands]]") from None
    missing = {"name", "center", "width"} - set(table.columns)
    if missing:
        raise ValueError(f"bands = {shown(name)}: it lacks the columns {', '.join(sorted(missing))} [um]")
    rows = ({key: value for key, value in row.items() if not pd.isna(value)} for row in table.to_dict("records"))
    return [
        {key: float(v) if isinstance(v, int) and key != "detectors" else v for key, v in row.items()} for row in rows
    ]
