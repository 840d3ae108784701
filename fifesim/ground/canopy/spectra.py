"""Spectra of leaves and of what lies below them, mixed and averaged over bands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from fifesim.base import datasets
from fifesim.base.annotations import NumberOrArray
from fifesim.base.bands import solar_spectrum
from fifesim.base.kinds import described
from fifesim.base.spelling import closest
from fifesim.ground.canopy.spectrum import Spectrum, read_spectrum

SHADE = "shade"
"""Part of a mixture that reflects nothing."""

# Decimal fractions may miss 1 by rounding.
_WHOLE = 1e-6


@dataclass(frozen=True)
class Background:
    """
    What lies below a canopy, a mixture of spectra.

    Parameters
    ----------
    fractions : mapping of str to float
        Share of the ground of each spectrum, by its name in ``data/ground_spectra.csv``, or by the path of a CSV file
        of your own with columns ``wavelength`` [um] and ``reflectance`` [1]; ``"shade"`` reflects nothing. They add up
        to 1. [1]

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
        return [(_spectrum(name), value) for name, value in self.fractions.items() if name != SHADE and value > 0]


def check_shares(names, shares):
    """
    Refuse shares of a mixture that are no fractions, or do not add up to 1; NaN passes.

    Parameters
    ----------
    names : sequence of str
    shares : sequence of array, shape (...)
        One for each name. [1]

    Raises
    ------
    ValueError
        If one is outside 0 to 1, or the sum is not 1.

    Examples
    --------
    >>> check_shares(["soil_dry", "shade"], [0.25, 0.75])
    """
    for name, share in zip(names, shares, strict=True):
        wrong = np.ravel(share)[np.ravel((np.asarray(share) < 0) | (np.asarray(share) > 1))]
        if wrong.size:
            raise ValueError(f"Background: the fraction of {name!r} must be in [0, 1], got {wrong[0]:g}")
    total = np.ravel(sum(np.asarray(share, float) for share in shares))
    wrong = total[np.abs(total - 1) > _WHOLE]
    if wrong.size:
        raise ValueError(
            f"Background: the fractions must add up to 1, got {wrong[0]:g}: what reflects nothing is {SHADE!r}"
        )


def spectrum_names():
    """
    Names of the spectra that a background may be mixed from.

    Returns
    -------
    names : tuple of str

    Examples
    --------
    >>> "soil_dry" in spectrum_names()
    True
    """
    return _spectrum_names()


@lru_cache(maxsize=1)
def _spectrum_names():
    return (*datasets.table("ground_spectra.csv").columns.drop("wavelength"), SHADE)


def is_mixture(given):
    """
    Whether a mapping names spectra, and not bands.

    Parameters
    ----------
    given : object

    Returns
    -------
    answer : bool

    Examples
    --------
    >>> is_mixture({"soil_dry": 1.0}), is_mixture({"TM3": 0.2})
    (True, False)
    """
    names = spectrum_names()
    return isinstance(given, Mapping) and bool(given) and all(str(name) in names or _is_file(name) for name in given)


def band_means(bands, wavelength, values):
    """
    Means of spectra over the response of bands, weighted by the extraterrestrial sun.

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band
    wavelength : array, shape (n,)
        Increasing, and covering the bands. [um]
    values : array, shape (..., n)

    Returns
    -------
    means : array, shape (..., band)

    Raises
    ------
    ValueError
        If the spectrum does not cover a band.

    Examples
    --------
    >>> from fifesim.base.bands import Band
    >>> band_means([Band("red", (0.6, 0.65, 0.7), (0, 1, 0))], [0.5, 0.8], [0.3, 0.3]).round(12).tolist()
    [0.3]
    """
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


@lru_cache(maxsize=32)
def _nodes(wavelength):
    """Wavelengths of a spectrum (its bytes) and of the sun, sunlight there, and their places in the spectrum."""
    wavelength = np.frombuffer(wavelength)
    sun_wavelength, sun = solar_spectrum()
    inside = (sun_wavelength > wavelength[0]) & (sun_wavelength < wavelength[-1])
    nodes = np.union1d(wavelength, sun_wavelength[inside])
    weight = np.interp(nodes, sun_wavelength, sun)
    index = np.clip(np.searchsorted(wavelength, nodes, side="right") - 1, 0, wavelength.size - 2)
    return nodes, weight, index, (nodes - wavelength[index]) / (wavelength[index + 1] - wavelength[index])


def background_means(bands, given):
    """
    Reflectance of a background in bands.

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band
    given : Background or Spectrum

    Returns
    -------
    reflectance : array, shape (band,)
        [1]

    Raises
    ------
    ValueError
        If a spectrum does not cover a band.

    Examples
    --------
    >>> from fifesim.base.bands import Band
    >>> red = Band("red", (0.6, 0.65, 0.7), (0, 1, 0))
    >>> half = background_means([red], Background({"soil_dry": 0.5, "shade": 0.5}))
    >>> bool(abs(2 * half - background_means([red], Background({"soil_dry": 1.0}))) < 1e-15)
    True
    """
    parts = [(given, 1.0)] if isinstance(given, Spectrum) else given.spectra()
    means = [share * band_means(bands, part.wavelength, part.reflectance) for part, share in parts]
    return np.sum([np.zeros(len(bands)), *means], axis=0)


def did_you_mean(name, allowed):
    """
    Nearest of some names, in the words that follow one that is none of them.

    Parameters
    ----------
    name : object
        Taken as text.
    allowed : iterable

    Returns
    -------
    hint : str
        A full stop if nothing is near.

    Examples
    --------
    >>> did_you_mean("TM33", ["TM3", "TM4"])
    ", did you mean 'TM3'?"
    """
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


@lru_cache(maxsize=16)
def _known_spectrum(name):
    table = datasets.table("ground_spectra.csv")
    return Spectrum(table["wavelength"], table[name])
