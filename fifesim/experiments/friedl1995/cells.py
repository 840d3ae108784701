"""Cells of the scenes of Friedl et al. (1995) as arrays, for tables of many."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fifesim.chain.kernels import Kernels
from fifesim.experiments.friedl1995.pixels import ground_of
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.landscape.field import periodic_field
from fifesim.ground.landscape.quantiles import rank_quantiles

# Larger fields are not kept. [cell]
_FEW = 2**18


class Cells(NamedTuple):
    """Cells of a scene: LAI and FPAR, shape (y, x), and what light the ground reflects, shape (band, y, x)."""

    lai: np.ndarray
    fpar: np.ndarray
    reflectance: np.ndarray


def cells_of(case, treatment, arp, seed, land=(None, None), kernels=None):
    """
    Cells of a scene, those of `ground_of` to the bit.

    Parameters
    ----------
    case, treatment, arp, seed, land
        As in `fifesim.experiments.friedl1995.pixels.ground_of`.
    kernels : fifesim.chain.kernels.Kernels, optional
        Of the case, to share what they keep.

    Returns
    -------
    cells : Cells
    """
    if land[0] is not None:
        ground = ground_of(case, treatment, arp, seed, land)
        return Cells(ground.lai.values, ground.fpar.values, ground.reflectance.values)
    kernels = Kernels(case.setup) if kernels is None else kernels
    lai = periodic_scene(case.densities[treatment], arp, seed, tuple(case.grid.shape))
    return Cells(lai, kernels.fpar(lai, case.common.ground.fpar_inf), kernels.reflectance(lai))


def periodic_scene(density, arp, seed, shape):
    """
    Leaf area with exactly the density, as `fifesim.lai_scene` makes it by the periodic method.

    Parameters
    ----------
    density
        As `fifesim.lai_distribution` takes it.
    arp : float
        [1]
    seed : int
    shape : (int, int)

    Returns
    -------
    lai : array, shape (y, x)
        [m2 m-2]
    """
    lai = np.empty(shape)
    order = (_kept_order if lai.size <= _FEW else _order)(seed, arp, shape)
    lai.ravel()[order] = rank_quantiles(lai_distribution(density), lai.size)
    return lai


def _order(seed, arp, shape):
    """Cells of a field from the least to the largest."""
    return np.argsort(periodic_field(seed, arp, shape), axis=None, kind="stable")


# The three treatments of a seed lie on one field, and so do the cases that change one number.
_kept_order = lru_cache(maxsize=8)(_order)
