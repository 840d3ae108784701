"""Library of modelled land spectra: canopies of many leaves over many backgrounds."""

import numpy as np

from fifesim.base import files
from fifesim.base.caches import cached
from fifesim.base.lattice import generator
from fifesim.ground.canopy.prospect import Leaf, leaf_spectrum
from fifesim.ground.canopy.sail_model import reflectance_factor, sail, with_background

# Number of leaves, and of canopies per leaf.
LEAVES = 60
CANOPIES = 8

# Step through PROSPECT's wavelengths (1 nm); band means change by at most 1e-4.
_STRIDE = 5

# Uniform ranges of leaf contents as in `Leaf`, chosen to be wide and not fitted to data.
_STRUCTURE = (1.2, 2.5)
_CHLOROPHYLL = (5.0, 80.0)
_CAROTENOIDS = (0.15, 0.35)  # over chlorophyll
_WATER = (0.004, 0.030)
_DRY_MATTER = (0.002, 0.018)
_ANTHOCYANINS = 4.0  # at most, in three of ten leaves

# Mean of the leaf area index, which is exponential and cut off; and ranges of sun and sky.
_MEAN_LAI, _COVERED = 1.5, 0.97
_SZA = (20.0, 60.0)
_SKYLIGHT = 0.3
_LEAF_ANGLES = ("planophile", "spherical", "erectophile", "plagiophile")

# Ground brightness relative to the mixed spectra.
_BRIGHTNESS = (0.3, 1.1)

# Random number stream of the library.
_STREAM = 2


@cached(128, "library of canopy spectra")
def library_spectra():
    """Wavelengths [um], shape (n,), and spectra of canopies by PROSPECT-D and SAIL, shape (spectrum, n)."""
    # Leaf contents are uniform in wide ranges, brown pigments mostly few. Leaf area is exponential with mean 1.5: a
    # quarter of the spectra has an NDVI below 0.5.
    ground = files.table("ground_spectra.csv")
    found = []
    for number in range(LEAVES):
        random = generator(0, _STREAM, (0, number, 0, 0))
        wavelength, leaf_reflectance, leaf_transmittance = leaf_spectrum(_leaf(random))
        kept = slice(0, np.searchsorted(wavelength, ground["wavelength"].iloc[-1], side="right"), _STRIDE)
        below = _ground(random, ground, wavelength[kept])
        lai = -_MEAN_LAI * np.log(1 - _COVERED * random.random(CANOPIES))
        canopy = sail(
            lai[:, None],
            leaf_reflectance[kept],
            leaf_transmittance[kept],
            sza=_uniform(random, _SZA),
            leaf_angles=_LEAF_ANGLES[random.integers(len(_LEAF_ANGLES))],
        )
        surface = with_background(canopy, below)
        found.append(reflectance_factor(surface.rso, surface.rdo, _SKYLIGHT * random.random()))
    wavelength, reflectance = wavelength[kept], np.concatenate(found)
    for each in (wavelength, reflectance):
        each.flags.writeable = False
    return wavelength, reflectance


def _uniform(random, limits):
    return limits[0] + (limits[1] - limits[0]) * random.random()


def _leaf(random):
    """Random leaf from the ranges of its contents."""
    chlorophyll = _uniform(random, _CHLOROPHYLL)
    return Leaf(
        structure=_uniform(random, _STRUCTURE),
        chlorophyll=chlorophyll,
        carotenoids=chlorophyll * _uniform(random, _CAROTENOIDS),
        anthocyanins=_ANTHOCYANINS * random.random() * (random.random() < 0.3),
        brown=random.random() ** 2,
        water=_uniform(random, _WATER),
        dry_matter=_uniform(random, _DRY_MATTER),
    )


def _ground(random, table, wavelength):
    """Random mixtures of background spectra, one for each canopy."""
    names = table.columns.drop("wavelength")
    shares = random.dirichlet(np.full(len(names), 0.7), CANOPIES)
    bright = _BRIGHTNESS[0] + (_BRIGHTNESS[1] - _BRIGHTNESS[0]) * random.random((CANOPIES, 1))
    spectra = np.stack([np.interp(wavelength, table["wavelength"], table[name]) for name in names])
    return bright * np.sum(shares[:, :, None] * spectra, axis=1)
