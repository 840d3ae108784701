"""Leaf optics of many leaves in bands: PROSPECT once per kind of leaf, or a table over the one content that varies."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from fifesim.ground.canopy.prospect import CONTENTS, LARGEST_STRUCTURE, leaf_spectrum
from fifesim.ground.canopy.spectra import band_means

_BLOCK = 2**8  # leaves at a time, to bound memory: a spectrum has up to 2101 values

TOLERANCE = 1e-8
"""Of leaf reflectance and transmittance from a table [1]."""

_COARSEST, _FINEST = 64, 2**12


def leaf_means(bands, leaf, exact=False):
    """
    Reflectance and transmittance in bands of leaves that differ.

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band
    leaf : Leaf
        Some of it arrays that broadcast to shape (...). NaN gives NaN.
    exact : bool, optional
        Compute each kind of leaf where a table of one content would do.

    Returns
    -------
    means : array, shape (2, band, ...)
        Reflectance, then transmittance. Within `TOLERANCE` where one content alone varies, else exact. [1]

    Raises
    ------
    ValueError
        If the spectrum does not cover a band.

    Examples
    --------
    More chlorophyll, darker red:

    >>> from fifesim.base.bands import Band
    >>> from fifesim.ground.canopy.prospect import Leaf
    >>> red = Band("red", (0.6, 0.65, 0.7), (0, 1, 0))
    >>> sparse, dense = leaf_means([red], Leaf(chlorophyll=np.array([20.0, 60.0])))[0, 0]
    >>> bool(dense < sparse)
    True
    """
    bands, varying = tuple(bands), leaf.varying()
    names, arrays = list(varying), np.broadcast_arrays(*(np.asarray(v, float) for v in varying.values()))
    cells = np.stack([each.reshape(-1) for each in arrays])
    if len(names) == 1 and not exact:
        low, high = _range(names[0])
        table = _table(bands, names[0], replace(leaf, **{names[0]: low}))
        means = table(np.cbrt((cells[0] - low) / (high - low))).T.reshape(2, len(bands), -1)
        # By the error of the table leaves without absorption could give more than they get.
        means[1] = np.minimum(means[1], 1 - means[0])
    else:
        means = _each_kind(bands, leaf, names, cells)
    return means.reshape(2, len(bands), *arrays[0].shape)


def _each_kind(bands, leaf, names, cells):
    """Means of leaves, shape (2, band, n), from what varies, shape (name, n); each kind of leaf is computed once."""
    means = np.full((2, len(bands), cells.shape[1]), np.nan)
    known = ~np.isnan(cells).any(axis=0)
    kinds, index = np.unique(cells[:, known], axis=1, return_inverse=True)
    of_kinds = np.empty((2, len(bands), kinds.shape[1]))
    for start in range(0, kinds.shape[1], _BLOCK):
        block = slice(start, start + _BLOCK)
        part = dict(zip(names, kinds[:, block], strict=True))
        of_kinds[..., block] = np.moveaxis(_means(bands, replace(leaf, **part)), -1, 1)
    means[..., known] = of_kinds[..., index.reshape(-1)]
    return means


def _means(bands, leaf):
    """Reflectance and transmittance of each leaf in each band, shape (2, n, band)."""
    limits = min(band.limits[0] for band in bands), max(band.limits[1] for band in bands)
    wavelength, *spectra = leaf_spectrum(leaf, limits)
    return band_means(bands, wavelength, np.stack(spectra))


@lru_cache(maxsize=32)
def _table(bands, name, leaf):
    """
    Cubic spline of both in each band over the cube root of one content, from its least to its largest.

    Light decays fast with the first pigment, and k^2 E1(k) has no third derivative at 0: the cube root has both smooth.
    Nodes are doubled until the spline through every second one meets the others within the tolerance; the error falls
    with the fourth power of the step, that of the table is some sixteen times smaller.
    """
    low, high = _range(name)

    def exact(position):
        means = _means(bands, replace(leaf, **{name: np.minimum(low + (high - low) * position**3, high)}))
        return np.moveaxis(means, 1, 0).reshape(len(position), -1)

    position = np.linspace(0, 1, _COARSEST + 1)
    values = exact(position)
    while len(position) <= _FINEST:
        between = (position[1:] + position[:-1]) / 2
        found, meant = CubicSpline(position, values)(between), exact(between)
        values = np.insert(values, np.arange(1, len(values)), meant, axis=0)
        position = np.linspace(0, 1, len(values))
        if np.abs(found - meant).max() < TOLERANCE:
            return CubicSpline(position, values)
    raise ValueError(f"no table of {_FINEST} leaves reaches {TOLERANCE:g}: use exact=True")


def _range(name):
    """Least and largest value of what a leaf is made of."""
    return (1.0, LARGEST_STRUCTURE) if name == "structure" else (0.0, CONTENTS[name][1])
