"""Library of modelled land spectra: canopies of many leaves over many soils."""

import numpy as np

from fifesim.base import files
from fifesim.base.caches import cached
from fifesim.base.lattice import generator
from fifesim.ground.canopy.layers import mixed
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.ground.canopy.sail_model import reflectance_factor, sail, with_background

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
