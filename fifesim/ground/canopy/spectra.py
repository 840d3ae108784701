"""Spectra of leaves and backgrounds: CSV files, mixtures and means over bands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from fifesim.base import files
from fifesim.base.arguments import NumberOrArray, described
from fifesim.base.bands import solar_spectrum
from fifesim.base.caches import cached
from fifesim.base.files import read_csv
from fifesim.base.messages import closest


@dataclass(frozen=True)
class Spectrum:
    """
    Reflectance spectrum.

    Parameters
    ----------
    wavelength : sequence of float, shape (n,)
        Increasing. [um]
    reflectance : sequence of float, shape (n,)
        [1]

    Raises
    ------
    ValueError
        If the wavelengths do not increase or are not in micrometres, or a reflectance is outside 0 to 1.
    """

    wavelength: tuple = field(repr=False)
    reflectance: tuple = field(repr=False)

    def __post_init__(self):
        wavelength, shapes = np.asarray(self.wavelength, float), {np.shape(each) for each in self.values()}
        if wavelength.ndim != 1 or wavelength.size < 2 or shapes != {wavelength.shape}:
            raise ValueError("a spectrum needs two wavelengths or more, and one value for each")
        if not np.all(np.diff(wavelength) > 0):
            raise ValueError("the wavelengths of a spectrum must increase, and none be missing: sort them")
        if wavelength[-1] > 100:
            raise ValueError(f"wavelengths are in um, got {wavelength[-1]:g}: divide nanometres by 1000")
        if wavelength[-1] < 0.1:
            raise ValueError(f"wavelengths are in um, the largest is {wavelength[-1]:g}: convert them to micrometres")
        object.__setattr__(self, "wavelength", tuple(wavelength.tolist()))
        for name, values in zip(self.names(), self.values(), strict=True):
            values = np.asarray(values, float)
            wrong = ~((values >= 0) & (values <= 1))
            if wrong.any():
                raise ValueError(
                    f"the {name} of a spectrum must be in [0, 1], got {values[wrong][0]:g} at "
                    f"{wavelength[wrong][0]:g} um: give a fraction, not percent"
                )
            object.__setattr__(self, name, tuple(values.tolist()))

    @classmethod
    def names(cls):
        """Names of the quantities by wavelength."""
        return tuple(each.name for each in fields(cls) if each.name != "wavelength")

    def values(self):
        """Values of the quantities by wavelength, each of shape (n,). [1]"""
        return tuple(getattr(self, name) for name in self.names())


@dataclass(frozen=True)
class LeafSpectrum(Spectrum):
    """
    Reflectance and transmittance spectra of a leaf.

    Parameters
    ----------
    wavelength, reflectance
        As in `Spectrum`.
    transmittance : sequence of float, shape (n,)
        [1]

    Raises
    ------
    ValueError
        As in `Spectrum`, or if reflectance and transmittance add up to more than 1.
    """

    transmittance: tuple = field(repr=False)

    def __post_init__(self):
        super().__post_init__()
        total = np.add(self.reflectance, self.transmittance)
        if np.max(total) > 1 + 1e-12:
            raise ValueError(
                f"leaf reflectance and transmittance add up to {np.max(total):g} at "
                f"{self.wavelength[np.argmax(total)]:g} um: the sum must not exceed 1, the rest is absorbed"
            )


def read_spectrum(path, kind=Spectrum):
    """Read a spectrum from a CSV file with columns wavelength [um], reflectance and, for a leaf, transmittance."""
    table = read_csv(path, "the spectrum")
    columns = [str(column).strip().lower() for column in table.columns]
    wanted = ("wavelength", *kind.names())
    missing = [name for name in wanted if columns.count(name) != 1]
    if missing:
        raise ValueError(
            f"{path} has no column {' nor '.join(missing)}, or several: its first line must name wavelength [um] and "
            f"{' and '.join(kind.names())} [1], it has {', '.join(map(str, table.columns))}"
        )
    try:
        return kind(*(table.iloc[:, columns.index(name)] for name in wanted))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


SHADE = "shade"
"""Part of a mixture that reflects nothing."""

# Tolerance for the sum of fractions. [1]
_WHOLE = 1e-6


@dataclass(frozen=True)
class Background:
    """
    Background of a canopy as a mixture of spectra.

    Parameters
    ----------
    fractions : mapping of str to float
        Ground fraction of each spectrum, which sum to 1. Keys are names in ``data/ground_spectra.csv``, paths of CSV
        files with columns ``wavelength`` [um] and ``reflectance`` [1], or ``"shade"``, which reflects nothing. [1]

    Raises
    ------
    ValueError
        If a spectrum is unknown, or the fractions are negative or do not add up to 1.

    Examples
    --------
    >>> from fifesim import Background
    >>> Background({"soil_dry": 0.6, "dead_grass": 0.4}).fractions["soil_dry"]
    0.6
    """

    fractions: Mapping[str, NumberOrArray]

    def __post_init__(self):
        if not isinstance(self.fractions, Mapping):
            raise TypeError(f"Background takes fractions as {{spectrum: fraction}}, got {described(self.fractions)}")
        fractions = {str(name): _share(name, value) for name, value in self.fractions.items()}
        names = spectrum_names()
        for name, value in fractions.items():
            if name not in names and not _is_file(name):
                raise ValueError(
                    f"Background: no spectrum {name!r}{did_you_mean(name, names)} There are {', '.join(names)}, "
                    "or the path of a .csv file"
                )
            if np.isnan(value):
                raise ValueError(f"Background: the fraction of {name!r} must be in [0, 1], got nan")
        check_shares(tuple(fractions), tuple(fractions.values()))
        object.__setattr__(self, "fractions", fractions)

    def spectra(self) -> list[tuple[Spectrum, NumberOrArray]]:
        """Spectrum and share of each part that reflects, a list of (Spectrum, float)."""
        return [
            (_spectrum(name), value) for name, value in self.fractions.items() if name != SHADE and np.greater(value, 0)
        ]


def check_shares(names, shares):
    """Raise ValueError if shares of a mixture are not fractions or do not add up to 1; NaN passes."""
    for name, share in zip(names, shares, strict=True):
        wrong = np.ravel(share)[np.ravel((np.asarray(share) < 0) | (np.asarray(share) > 1))]
        if wrong.size:
            raise ValueError(f"Background: the fraction of {name!r} must be in [0, 1], got {wrong[0]:g}")
    total = np.ravel(sum(np.asarray(share, float) for share in shares))
    wrong = total[np.abs(total - 1) > _WHOLE]
    if wrong.size:
        raise ValueError(
            f"Background: the fractions must add up to 1, got {wrong[0]:g}: the part without reflection is {SHADE!r}"
        )


@cached(1, "names of ground spectra")
def spectrum_names():
    """Names of the spectra from which a background can be mixed."""
    return (*files.table("ground_spectra.csv").columns.drop("wavelength"), SHADE)


def is_mixture(given):
    """Whether the keys of a mapping are spectra rather than bands."""
    names = spectrum_names()
    return isinstance(given, Mapping) and bool(given) and all(str(name) in names or _is_file(name) for name in given)


def band_means(bands, wavelength, values):
    """Means of spectra over the response of bands, weighted by extraterrestrial sunlight, shape (..., band)."""
    wavelength, values = np.asarray(wavelength, float), np.asarray(values, float)
    for band in bands:
        if band.limits[0] < wavelength[0] or band.limits[1] > wavelength[-1]:
            raise ValueError(
                f"no leaf or background spectrum for band {band.name}, {band.limits[0]:g} to {band.limits[1]:g} um: it "
                f"has {wavelength[0]:g} to {wavelength[-1]:g} um; give leaf_optics= and background= by band, or "
                "bands= without it"
            )
    nodes, weight, index, share = _nodes(wavelength.tobytes())
    fine = values[..., index] * (1 - share) + values[..., index + 1] * share
    return np.stack([band.mean(fine, nodes, weight) for band in bands], axis=-1)


@cached(32, "wavelengths and sunlight of a spectrum")
def _nodes(wavelength):
    """Union of the wavelengths of a spectrum (its bytes) and sunlight, sunlight there, and places in the spectrum."""
    wavelength = np.frombuffer(wavelength)
    sun_wavelength, sun = solar_spectrum()
    inside = (sun_wavelength > wavelength[0]) & (sun_wavelength < wavelength[-1])
    nodes = np.union1d(wavelength, sun_wavelength[inside])
    weight = np.interp(nodes, sun_wavelength, sun)
    index = np.clip(np.searchsorted(wavelength, nodes, side="right") - 1, 0, wavelength.size - 2)
    return nodes, weight, index, (nodes - wavelength[index]) / (wavelength[index + 1] - wavelength[index])


def background_means(bands, given):
    """Reflectance of a background in bands, shape (band,). [1]"""
    parts = [(given, 1.0)] if isinstance(given, Spectrum) else given.spectra()
    means = [share * band_means(bands, part.wavelength, part.reflectance) for part, share in parts]
    return np.sum([np.zeros(len(bands)), *means], axis=0)


def did_you_mean(name, allowed):
    """Suggestion of the nearest name, as the end of a sentence."""
    near = closest(name, allowed)
    return f", did you mean {near!r}?" if near else "."


def _share(name, value):
    try:
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(
            f"Background: the fraction of {name!r} must be a number, got {described(value)}: rasters of fractions are "
            "background={spectrum: raster, ...}"
        ) from None


def _is_file(name):
    return Path(str(name)).suffix.lower() == ".csv"


def _spectrum(name):
    return read_spectrum(name) if _is_file(name) else _known_spectrum(name)


@cached(16, "ground spectra")
def _known_spectrum(name):
    table = files.table("ground_spectra.csv")
    return Spectrum(table["wavelength"], table[name])
