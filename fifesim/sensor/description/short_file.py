"""Short instrument files: missing values are derived from the rest of the file, with this as their source."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import TypeAdapter, ValidationError

from fifesim.base.bands import solar_irradiance
from fifesim.base.files import check_regular, in_a_line, shown
from fifesim.sensor.description.instrument_file import BAND_NUMBERS, INSTRUMENT_NUMBERS, OPTIONAL_NUMBERS
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
# Keys of a band that belong to its noise, with their names there, and those that make its response.
NOISE_KEYS = {
    "snr": "snr", "snr_radiance": "radiance", "snr_shot": "shot",
    "high_snr": "high_snr", "high_snr_radiance": "high_radiance",
}  # fmt: skip
RESPONSE_KEYS = ("center", "width", "shape")

# Made once: making it takes longer than what it does.
_ADAPTER: TypeAdapter = TypeAdapter(SpectralResponse)


def completed(content, path):
    """Content of a short instrument file, completed by derived values."""
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
    response = {key: band.pop(key) for key in RESPONSE_KEYS if key in band}
    if response:
        band.setdefault("srf", response)
    srf = band.get("srf")
    if isinstance(srf, dict) and "table" in srf:
        band["srf"] = srf | {"folder": str(folder)}
    noise = {name: band.pop(key) for key, name in NOISE_KEYS.items() if key in band}
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
    for key, (value, source) in derived.items():
        if key not in band:
            band[key], sources[key] = value, source
    own = band.get("sources", {})
    return band | {"sources": sources | own} if sources and isinstance(own, dict) else band


def _irradiance(srf):
    """Solar irradiance over the response [W m-2 um-1], None if unreadable, which the reader of the file reports."""
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
