"""Spectra of leaves and backgrounds: mixtures, means over bands, and a library of land spectra."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifesim.base import files
from fifesim.base.arguments import NumberOrArray, described
from fifesim.base.bands import solar_spectrum
from fifesim.base.caches import cached
from fifesim.base.lattice import generator
from fifesim.base.messages import closest
from fifesim.ground.canopy.layers import mixed
from fifesim.ground.canopy.measured_spectra import Spectrum, read_spectrum
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.ground.canopy.sail_model import reflectance_factor, sail, with_background

# Paths of spectra have these, or exist.
_SUFFIXES = (".csv", ".txt", ".tsv", ".asc", ".tab", ".dat")

SHADE = "shade"  # part of a mixture that reflects nothing

# Tolerance for the sum of fractions. [1]
_WHOLE = 1e-6


@dataclass(frozen=True)
class Background:
    """
    Background of a canopy as a mixture of spectra.

    Parameters
    ----------
    fractions : mapping of str to float
        Ground fraction of each spectrum, which sum to 1. Keys are names in ``data/ground_spectra.csv``, paths of
        text files with columns ``wavelength`` and ``reflectance`` (CSV, or a spectral library such as ECOSTRESS), or
        ``"shade"``, which reflects nothing. [1]

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
            if name not in names and not is_file(name):
                raise ValueError(
                    f"Background: no spectrum {name!r}{did_you_mean(name, names)} There are {', '.join(names)}, "
                    "or the path of a file, .csv or .txt, with the columns wavelength and reflectance"
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
    return isinstance(given, Mapping) and bool(given) and all(str(name) in names or is_file(name) for name in given)


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
    for part, _ in parts:
        part.check_gaps(bands)
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


def is_file(name):
    """Whether a name is the path of a spectrum."""
    return Path(str(name)).suffix.lower() in _SUFFIXES or os.path.isfile(name)


def _spectrum(name):
    return _known_spectrum(name) if name in spectrum_names() else read_spectrum(name)


@cached(16, "ground spectra")
def _known_spectrum(name):
    table = files.table("ground_spectra.csv")
    return Spectrum(table["wavelength"], table[name])


# Number of leaves, and of spectra with each; the first of them is bare ground.
LEAVES = 600
SPECTRA = 8

# Step through PROSPECT's wavelengths (1 nm); band means change by at most 1e-4.
_STRIDE = 5

# Uniform ranges of leaves: wide, and fitted to nothing. Units as in `Leaf`.
_STRUCTURE = (1.0, 3.0)
_CHLOROPHYLL = (5.0, 90.0)
_CAROTENOIDS = (0.15, 0.35)  # over chlorophyll
_WATER = (0.002, 0.040)
_DRY_MATTER = (0.002, 0.020)
_ANTHOCYANINS, _RED_LEAVES = 8.0, 0.3  # at most, and share of the leaves that have any
_BROWN_LEAVES = 0.5  # share of the leaves with brown pigments, whose square root is uniform

# Dead leaves, which are mixed into half of the canopies.
_DEAD_CHLOROPHYLL, _DEAD_CAROTENOIDS = 10.0, 8.0  # at most
_DEAD_BROWN = (0.2, 2.0)
_DEAD_WATER = (0.0005, 0.005)
_WITH_DEAD = 0.5

# Mean of the leaf area index, which is exponential and cut off; and ranges of sun and sky.
_MEAN_LAI, _COVERED = 4.0, 0.85
_SZA = (15.0, 65.0)
_SKYLIGHT = 0.3
_LEAF_ANGLES = ("planophile", "spherical", "erectophile", "plagiophile", "uniform", "extremophile")

# Brightness of the ground over that of the measured spectra, which are of dry soil.
_BRIGHTNESS = (0.4, 1.1)

# Stream of random numbers of the library.
_STREAM = 2


@cached(128, "library of land spectra")
def library_spectra():
    """Wavelengths [um], shape (n,), and land spectra by PROSPECT-D, SAIL and soils, shape (leaf, spectrum, n). [1]"""
    random = generator(0, _STREAM)
    ground = files.table("library_ground.csv")
    wavelength, *green = leaf_spectrum(_leaves(random))
    _, *dead = leaf_spectrum(_dead_leaves(random))
    kept = slice(0, np.searchsorted(wavelength, ground["wavelength"].iloc[-1], side="right"), _STRIDE)
    wavelength = wavelength[kept]
    shares = random.random((LEAVES, SPECTRA)) ** 2 * (random.random((LEAVES, 1)) < _WITH_DEAD)
    leaves = mixed(*([optics[:, None, kept] for optics in each] for each in (green, dead)), shares[..., None])
    below = _ground(random, ground, wavelength)
    lai = -_MEAN_LAI * np.log(1 - _COVERED * random.random((LEAVES, SPECTRA)))
    lai[:, 0] = 0.0
    sza, skylight = _uniform(random, _SZA), _SKYLIGHT * random.random(LEAVES)
    angles = random.integers(len(_LEAF_ANGLES), size=LEAVES)
    spectra = np.empty((LEAVES, SPECTRA, wavelength.size))
    for number, name in enumerate(_LEAF_ANGLES):
        chosen = angles == number
        optics = [each[chosen] for each in leaves]
        canopy = sail(lai[chosen][..., None], *optics, sza=sza[chosen][:, None, None], leaf_angles=name)
        surface = with_background(canopy, below[chosen])
        spectra[chosen] = reflectance_factor(surface.rso, surface.rdo, skylight[chosen][:, None, None])
    for each in (wavelength, spectra):
        each.flags.writeable = False
    return wavelength, spectra


def _uniform(random, limits):
    """A uniform deviate for each leaf."""
    return limits[0] + (limits[1] - limits[0]) * random.random(LEAVES)


def _leaves(random):
    """Random leaves, from green to brown."""
    chlorophyll = _uniform(random, _CHLOROPHYLL)
    return Leaf(
        structure=_uniform(random, _STRUCTURE),
        chlorophyll=chlorophyll,
        carotenoids=chlorophyll * _uniform(random, _CAROTENOIDS),
        anthocyanins=_ANTHOCYANINS * random.random(LEAVES) * (random.random(LEAVES) < _RED_LEAVES),
        brown=random.random(LEAVES) ** 2 * (random.random(LEAVES) < _BROWN_LEAVES),
        water=_uniform(random, _WATER),
        dry_matter=_uniform(random, _DRY_MATTER),
    )


def _dead_leaves(random):
    """Random dead leaves, which are dry, with brown and few other pigments."""
    return Leaf(
        structure=_uniform(random, _STRUCTURE),
        chlorophyll=_DEAD_CHLOROPHYLL * random.random(LEAVES) ** 2,
        carotenoids=_DEAD_CAROTENOIDS * random.random(LEAVES),
        brown=_uniform(random, _DEAD_BROWN),
        water=_uniform(random, _DEAD_WATER),
        dry_matter=_uniform(random, _DRY_MATTER),
    )


def _ground(random, table, wavelength):
    """Ground of each spectrum: a measured spectrum alone where it is bare, else a mixture of two. [1]"""
    names = table.columns.drop("wavelength")
    measured = np.stack([np.interp(wavelength, table["wavelength"], table[name]) for name in names])
    one, other = random.integers(len(names), size=(2, LEAVES, SPECTRA))
    share = random.random((LEAVES, SPECTRA, 1))
    share[:, 0] = 1.0
    bright = _BRIGHTNESS[0] + (_BRIGHTNESS[1] - _BRIGHTNESS[0]) * random.random((LEAVES, SPECTRA, 1))
    return bright * (share * measured[one] + (1 - share) * measured[other])
