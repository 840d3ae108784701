"""Canopy and air in one pass: what is seen of leaf area from above the atmosphere."""

from functools import partial

import numpy as np
from numba import njit

from fifesim.atmosphere.schemes.coupling import apparent_reflectance, apparent_reflectance_of_cell
from fifesim.ground.canopy.lai_table import RUN, places_of, value_at
from fifesim.ground.canopy.leaf_area import LARGEST_OF_MAPS, check_map
from fifesim.ground.canopy.rasters.evaluation import EvenCanopy
from fifesim.ground.canopy.reflectance_table import scene_reflectance, surface_table
from fifesim.rasters import chunks as chunking
from fifesim.rasters.origins import origin_of


def seen_through_air(reflectance):
    """
    What makes a lazy reflectance together with the light of it that leaves the atmosphere.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        From `fifesim.surface_reflectance`.

    Returns
    -------
    made : callable or None
        ``made(terms)`` gives the reflectance at the top of the atmosphere, dims (band, y, x), lazy, to the bit that of
        the two steps. None where cells differ in more than their leaf area, or the reflectance is in memory.
    """
    canopy = origin_of(reflectance)
    if not isinstance(canopy, EvenCanopy):
        return None

    def made(terms):
        by_band = {name: tuple(map(float, values)) for name, values in terms.uniform.items()}
        kernel = partial(seen_reflectance, background=canopy.background, scene=canopy.scene, terms=by_band)
        return chunking.pointwise(kernel, canopy.lai, bands=reflectance.sizes["band"])

    return made


def seen_reflectance(lai, *, background, scene, terms):
    """
    Apparent reflectance of a canopy at the top of the atmosphere, by a table of its reflectance.

    Parameters
    ----------
    lai : array, shape (y, x)
        NaN gives NaN. [m2 m-2]
    background : tuple of float, shape (band,)
        [1]
    scene : fifesim.ground.canopy.reflectance_table.Scene
        Of numbers.
    terms : dict
        What `fifesim.atmosphere.schemes.coupling.apparent_reflectance` takes, each a value for each band. [1]

    Returns
    -------
    toa : array, shape (band, y, x)
        To the bit that of the two functions, one after the other. [1]

    Raises
    ------
    ValueError
        As they do.
    """
    cells, table = np.ascontiguousarray(lai, float), surface_table(background, scene)
    out = np.empty((table.coefficients.shape[1], cells.size))
    if _seen(cells.reshape(-1), table, np.array(list(terms.values())), out):
        # The functions themselves say what is wrong.
        ground = scene_reflectance(check_map(lai), np.array(background), scene)
        return apparent_reflectance(ground, **{name: np.array(each)[:, None, None] for name, each in terms.items()})
    return out.reshape(-1, *cells.shape)


# Where no light comes through, division by zero is no error but what numpy makes of it.
@njit(nogil=True, cache=True, error_model="numpy")
def _seen(lai, table, terms, out):
    """Fill in what is seen; whether there is a leaf area, or a reflectance, that is to be refused."""
    interval, share, ground = np.empty(RUN, np.int64), np.empty(RUN), np.empty(RUN)
    refused = False
    for first in range(0, lai.size, RUN):
        cells = lai[first : first + RUN]
        places_of(cells, table, interval, share)
        for k in range(cells.size):
            refused |= (cells[k] < 0) | (cells[k] > LARGEST_OF_MAPS)
        for band in range(out.shape[0]):
            for k in range(cells.size):
                ground[k] = value_at(table, interval[k], band, share[k])
            path, down, up = terms[0, band], terms[1, band], terms[2, band]
            albedo, gas, seen = terms[3, band], terms[4, band], out[band, first : first + RUN]
            for k in range(cells.size):
                toa = apparent_reflectance_of_cell(ground[k], ground[k], path, down, up, albedo, gas)
                refused |= np.isinf(toa)
                seen[k] = toa
    return refused
