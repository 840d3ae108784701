"""Spectral responses of instrument files: in pyrsr, in a table in its folder, as lists, or by width."""

import os
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pandas as pd
from pydantic import Discriminator, Field, Tag
from pydantic.dataclasses import dataclass
from pyrsr.rsr import RSR_reader

from fifesim.base import files
from fifesim.base.bands import Band
from fifesim.base.caches import cached
from fifesim.base.files import check_regular, shown
from fifesim.sensor.description.fields import CONFIG, Name, Number, Positive

# All bands lie between 100 nm and 100 um.
LONGEST = 100.0

# A Gaussian ends 1.5 of its widths from its centre, where it is 0.2 % of its maximum; it has so many wavelengths.
_REACH, _NODES = 1.5, 121


class NamedResponse:
    """Relative spectral response by name; subclasses find it, ``_read(name)``."""

    @cached(512, "spectral responses")
    def read(self, name):
        """Response, for a band of a given name."""
        return self._read(name)


@dataclass(frozen=True, config=CONFIG)
class PyrsrResponse(NamedResponse):
    """Relative spectral response among those that pyrsr distributes, such as "Landsat-5", "TM", "3"."""

    satellite: Name
    sensor: Name
    band: Name

    def _read(self, name):
        try:
            table = RSR_reader(self.satellite, self.sensor, LayerBandsAssignment=[self.band])[self.band]
        except (KeyError, FileNotFoundError, ValueError, NotADirectoryError):
            raise ValueError(
                f"srf: pyrsr has no response of {self.satellite} {self.sensor} {self.band}: write it out as "
                "srf = { wavelength = [...], response = [...] } or name a table"
            ) from None
        # pyrsr holds some sensors in nanometres and others in micrometres.
        wavelength = table[:, 0] / 1000 if table[-1, 0] > LONGEST else table[:, 0]
        # Measured responses scatter around zero outside of the band.
        return Band(name, wavelength, np.maximum(table[:, 1], 0))


@dataclass(frozen=True, config=CONFIG)
class ResponseTable(NamedResponse):
    """Relative spectral response in a CSV table with columns satellite, band, wavelength [um] and response."""

    table: Name  # file in the folder of the instrument file or in the data folder, such as "avhrr_response.csv"
    satellite: Name
    band: Name
    folder: str = ""  # of the instrument file; the reader of the file fills it in

    def _read(self, name):
        beside = Path(self.folder) / self.table
        try:
            # The operating system rejects names that are too long.
            path = beside if self.folder and os.path.isfile(beside) else files.path(self.table)
            check_regular(path)
        except (OSError, ValueError):
            raise ValueError(
                f"srf.table = {shown(self.table)}: no such file beside the instrument file or in the data folder"
            ) from None
        table = pd.read_csv(path, comment="#", dtype={"satellite": str, "band": str})
        missing = {"satellite", "band", "wavelength", "response"} - set(table.columns)
        if missing:
            raise ValueError(f"srf.table: {self.table} lacks the columns {', '.join(sorted(missing))}")
        rows = table[(table["satellite"] == self.satellite) & (table["band"] == self.band)]
        if rows.empty:
            known = ", ".join(sorted(set(table["satellite"] + " " + table["band"])))
            raise ValueError(
                f"srf.table: {self.table} has no {self.satellite} {self.band}: it has {known or 'no rows'}"
            )
        return ResponseList(tuple(rows["wavelength"].astype(float)), tuple(rows["response"].astype(float))).read(name)


@dataclass(frozen=True, config=CONFIG)
class ResponseList(NamedResponse):
    """Relative spectral response written out in the file."""

    wavelength: Annotated[tuple[Number, ...], Field(min_length=2)]  # increasing [um]
    response: Annotated[tuple[Number, ...], Field(min_length=2)]  # [1]

    def _read(self, name):
        if max(self.wavelength) > LONGEST:
            raise ValueError(
                f"srf.wavelength = {max(self.wavelength):g}: wavelengths are in um, these look like nm: divide by 1000"
            )
        return Band(name, self.wavelength, self.response)


@dataclass(frozen=True, config=CONFIG)
class CenteredResponse(NamedResponse):
    """Relative spectral response by its centre and width."""

    center: Positive  # [um]
    width: Positive  # full width at half of the maximum [um]
    shape: Literal["gaussian", "boxcar"] = "gaussian"

    def __post_init__(self):
        if self.center > LONGEST:
            raise ValueError(f"center = {self.center:g}: wavelengths are in um, this looks like nm: divide by 1000")
        if self.width >= self.center / _REACH:
            raise ValueError(
                f"width = {self.width:g}: it is in um, and too wide for center = {self.center:g}; divide nm by 1000"
            )

    def _read(self, name):
        if self.shape == "boxcar":
            half, edge = self.width / 2, self.width * 1e-6
            at = np.array([-half - edge, -half + edge, half - edge, half + edge])
            return Band(name, self.center + at, (0.0, 1.0, 1.0, 0.0))
        at = np.linspace(-_REACH, _REACH, _NODES)
        response = 0.5 ** (4 * at**2)
        response[[0, -1]] = 0.0
        return Band(name, self.center + at * self.width, response)


def _kind(value):
    keys = set(value if isinstance(value, dict) else getattr(value, "__dict__", ()))
    if keys & {"center", "width"}:
        return "centered"
    return "table" if "table" in keys else "listed" if keys & {"wavelength", "response"} else "pyrsr"


SpectralResponse = Annotated[
    Annotated[PyrsrResponse, Tag("pyrsr")]
    | Annotated[ResponseTable, Tag("table")]
    | Annotated[ResponseList, Tag("listed")]
    | Annotated[CenteredResponse, Tag("centered")],
    Discriminator(_kind),
]


def half_peak(response):
    """Limits of a band: first and last tabulated wavelength with at least half of the maximum response. [um]"""
    half = max(response.response) / 2
    above = [w for w, r in zip(response.wavelength, response.response, strict=True) if r >= half]
    return above[0], above[-1]
