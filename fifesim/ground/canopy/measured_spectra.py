"""Measured spectra of leaves and backgrounds: their checks and gaps, and files of users and spectral libraries."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, fields
from itertools import pairwise

import numpy as np

from fifesim.base.bands import PER_MICROMETRE, check_micrometres, without_noise
from fifesim.base.files import in_a_line, read_bounded, reading
from fifesim.base.messages import warn

# Wider gaps are not interpolated: absorption features of leaves and soils are as narrow as 50 nm. [um]
WIDEST_GAP = 0.02

# Largest share of a band's response in a gap, where reflectance is off by at most this share. [1]
_IN_A_GAP = 1e-3


@dataclass(frozen=True)
class Spectrum:
    """Reflectance spectrum: wavelengths in order [um], and reflectance [1], NaN where deleted; each of shape (n,)."""

    wavelength: tuple = field(repr=False)
    reflectance: tuple = field(repr=False)
    gaps: tuple = field(default=(), repr=False, kw_only=True)  # wavelengths on both sides of each wide gap [um]

    def __post_init__(self):
        wavelength, shapes = np.asarray(self.wavelength, float), {np.shape(each) for each in self.values()}
        if wavelength.ndim != 1 or wavelength.size < 2 or shapes != {wavelength.shape}:
            raise ValueError("a spectrum needs two wavelengths or more, and one value for each")
        values = np.array([np.asarray(each, float) for each in self.values()])
        if wavelength[0] > wavelength[-1]:
            wavelength, values = wavelength[::-1], values[:, ::-1]
        if not np.all(np.diff(wavelength) > 0):
            raise ValueError("the wavelengths of a spectrum must increase or decrease, and none be missing: sort them")
        check_micrometres("wavelengths", wavelength)
        known = np.flatnonzero(~np.isnan(values).any(axis=0))
        if known.size < 2:
            raise ValueError("fewer than two wavelengths of the spectrum have values: the others are deleted")
        deleted = [wavelength[[low, high]].tolist() for low, high in pairwise(known) if high > low + 1]
        wavelength, values = wavelength[known], values[:, known]
        gaps = ((low, high) for low, high in deleted if high - low > WIDEST_GAP)
        own = {"wavelength": tuple(wavelength.tolist()), "gaps": (*self.gaps, *gaps)}
        for name, each in zip(self.names(), values, strict=True):
            own[name] = tuple(_reflected(name, each, wavelength).tolist())
        for name, each in own.items():
            object.__setattr__(self, name, each)

    @classmethod
    def names(cls):
        """Names of the quantities by wavelength."""
        return tuple(each.name for each in fields(cls) if each.name not in ("wavelength", "gaps"))

    def values(self):
        """Values of the quantities by wavelength, each of shape (n,). [1]"""
        return tuple(getattr(self, name) for name in self.names())

    def check_gaps(self, bands):
        """Raise ValueError if a band lies in a wide gap."""
        for band in bands if self.gaps else ():
            fine = np.linspace(*band.limits, 2001)
            for low, high in self.gaps:
                share = float(band.mean((fine > low) & (fine < high), fine))
                if share > _IN_A_GAP:
                    raise ValueError(
                        f"band {band.name} lies by {share:.1%} in a gap of the spectrum, whose points from {low:g} to "
                        f"{high:g} um are deleted: leave the band out with bands=, or fill the gap (gaps up to "
                        f"{WIDEST_GAP:g} um are interpolated)"
                    )


def _reflected(name, values, wavelength):
    """Reflectance or transmittance without noise outside of 0 to 1; ValueError for values farther outside."""
    values = without_noise(f"the {name} of a spectrum", values, wavelength, highest=1.0)
    wrong = (values < 0) | (values > 1)
    if wrong.any():
        if np.median(values) > 1:
            remedy = "give a fraction, not percent"
        else:
            remedy = "if it marks a missing value, write nan or leave the cell empty"
        raise ValueError(
            f"the {name} of a spectrum must be in [0, 1], got {values[wrong][0]:g} at {wavelength[wrong][0]:g} um: "
            f"{remedy}"
        )
    return values


@dataclass(frozen=True)
class LeafSpectrum(Spectrum):
    """Spectra of reflectance and transmittance of a leaf [1]; together at most 1."""

    transmittance: tuple = field(repr=False)

    def __post_init__(self):
        super().__post_init__()
        total = np.add(self.reflectance, self.transmittance)
        if np.max(total) > 1 + 1e-12:
            raise ValueError(
                f"leaf reflectance and transmittance add up to {np.max(total):g} at "
                f"{self.wavelength[np.argmax(total)]:g} um: the sum must not exceed 1, the rest is absorbed"
            )


PER_FRACTION = dict.fromkeys(("", "1", "-", "fraction", "ratio", "unitless"), 1.0) | dict.fromkeys(
    ("%", "percent", "percentage", "pct"), 100.0
)
"""Spellings of units of reflectance, in lower case, and how many of them are 1."""

_LARGEST = 20_000_000  # size of a file [byte]
_SEPARATORS = ("\t", ";", ",", None)
_COLUMN = re.compile(r"(wavelength|reflectance|transmittance)s?[\s_.(\[]*([^)\]]*)[)\]]?", re.IGNORECASE)
_KEY = re.compile(r"\s*([xy]) units?\s*:(.*)", re.IGNORECASE)

# Libraries mark deleted points by -1.23e34 (USGS), -999 or the like; noise of percent is smaller.
_DELETED = (-9.0, 1e6)


def read_spectrum(path, kind=Spectrum):
    """Read a spectrum from a text file: CSV, or a spectral library with wavelengths in the same file."""
    # The header names the columns, such as wavelength_nm,reflectance (%), possibly below other text, or has the lines
    # "X Units:" and "Y Units:" of ECOSTRESS. Without units, wavelengths are in um and values are fractions.
    name = in_a_line(str(path), 200)
    lines = _lines(path, name)
    for separator in _SEPARATORS:
        fields = [_fields(line, separator) for line in lines]
        numbers = [_numbers(each) for each in fields]
        starts = [row for row, (one, two) in enumerate(pairwise(numbers)) if one and two and len(one) == len(two) > 1]
        if starts:
            break
    else:
        raise ValueError(f"cannot read the spectrum {name}: {_without_table(numbers)}")
    width = len(numbers[starts[0]])
    start = next(row for row, each in enumerate(numbers) if each and len(each) == width)
    if start and len(fields[start - 1]) == width and _numbers(fields[start - 1][:1]):
        start -= 1
    for line, row in zip(lines[start:], numbers[start:], strict=True):
        if row is None or len(row) != width:
            raise ValueError(
                f"cannot read the spectrum {name}: the line {in_a_line(line, 60)!r} has not {width} numbers; write "
                "decimals with a point"
            )
    columns = _columns(lines[:start], separator, width)
    wanted = ("wavelength", *kind.names())
    missing = [each for each in wanted if [column for column, _ in columns].count(each) != 1]
    if missing:
        header = in_a_line(" | ".join(lines[:start][-3:]), 150) or "no such line"
        raise ValueError(
            f"{name} has no column {' nor '.join(missing)}, or several: a line above the numbers must name each of "
            f"their {width} columns, such as wavelength_nm or 'wavelength (um)', and {' and '.join(kind.names())}, "
            f"with (%) if in percent; it has {header}"
        )
    found, table = dict.fromkeys(wanted), np.array(numbers[start:])
    for place, (column, per_unit) in enumerate(columns):
        if column in found:
            found[column] = _in_units(name, column, table[:, place], per_unit, library=start > 1)
    try:
        return kind(**found)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _lines(path, name):
    """Lines of a text file that are not empty, without comments."""
    with reading("the spectrum", path):
        content = read_bounded(path, _LARGEST, "a spectrum")
    if b"\0" in content:
        raise ValueError(f"cannot read the spectrum {name}: it is no text; export it as CSV in UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Units in old files; numbers are the same in both.
        text = content.decode("latin-1")
    return [line for line in (each.partition("#")[0].rstrip() for each in text.splitlines()) if line.strip()]


def _fields(line, separator):
    return [each.strip().strip("\"'") for each in (line.strip(" ").split(separator) if separator else line.split())]


def _numbers(fields):
    """Numbers in a line, NaN for empty fields; None if it has other text or no number."""
    try:
        numbers = [float(each) if each and each.upper() != "NA" else np.nan for each in fields]
    except ValueError:
        return None
    return numbers if any(fields) else None


def _without_table(numbers):
    """Reason and remedy for a file without rows of two numbers."""
    alone = sum(each is not None and len(each) == 1 for each in numbers)
    if alone < 2:
        return (
            "it has no rows of numbers below a line such as wavelength,reflectance; write CSV in UTF-8, and decimals "
            "with a point"
        )
    return (
        f"it has {alone} values without wavelengths, as files of the USGS library, which has the wavelengths in "
        "another file; write both as the columns wavelength and reflectance of one file, or give "
        "xarray.Dataset({'reflectance': ('wavelength', values)}, {'wavelength': wavelengths})"
    )


def _columns(header, separator, width):
    """Quantity of each column, empty if it is another, and how many of its unit are 1 um or 1."""
    stated = dict(match.groups() for match in map(_KEY.fullmatch, header) if match)
    stated = {axis.lower(): text for axis, text in stated.items()}
    if {"x", "y"} <= stated.keys():
        return [_column(stated["x"]), _column(stated["y"]), *[("", 1.0)] * (width - 2)]
    for line in reversed(header):
        ways = [_fields(line, separator)]
        if separator is None:
            # Names of several words, and units in brackets after a blank.
            ways += [re.split(pattern, line.strip()) for pattern in (r"\s{2,}|\t", r"\s+(?![(\[])")]
        for names in ways:
            columns = [_column(each) for each in names]
            if len(names) == width and "wavelength" in dict(columns):
                return columns
    return []


def _column(text):
    """Quantity that a column name or an axis states, empty if it is another, and how many of its unit are 1."""
    match = _COLUMN.fullmatch(text.strip())
    quantity, unit = (match[1].lower(), match[2].strip().lower()) if match else ("", "")
    known = {"": 1.0, **PER_MICROMETRE} if quantity == "wavelength" else PER_FRACTION
    return (quantity, known[unit]) if unit in known else ("", 1.0)


def _in_units(name, quantity, values, per_unit, library):
    """Values of a column in um or as a fraction; files with other lines of text mark deleted points by numbers."""
    if quantity == "wavelength":
        return values / per_unit
    if library:
        values = np.where((values <= _DELETED[0]) | (values >= _DELETED[1]), np.nan, values)
    if per_unit > 1 and not np.nanmax(values, initial=0.0) > 1:
        warn(
            f"{name} states percent, and its largest {quantity} is {np.nanmax(values, initial=0.0):g} %: if this is a "
            "fraction, correct the unit in its header"
        )
    return values / per_unit
