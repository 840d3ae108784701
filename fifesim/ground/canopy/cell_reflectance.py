"""Reflectance of cells whose leaves and crowns differ: from tables of what is the same in all of them."""

from functools import lru_cache

import numpy as np

from fifesim.ground.canopy.background import over_background, reflectance_factor
from fifesim.ground.canopy.crowns import (
    SHAPE,
    clumped,
    crown_shares,
    crown_terms,
    crowns_over_background,
    lai_in_crowns,
)
from fifesim.ground.canopy.foliage_interpolation import interpolate_crowned, interpolate_foliage
from fifesim.ground.canopy.foliage_table import crown_table, tabulate_foliage
from fifesim.ground.canopy.scene import cell_by_cell, check_cells, decay, leaves_of, sky_of

# Of the ground below, where a table of terms is tested.
_GROUNDS = (0.0, 0.5, 1.0)


def varied_reflectance(lai, background, scene):
    """
    Reflectance factor of cells whose dead share, dissociation or crown cover are arrays.

    Parameters
    ----------
    lai : array, shape (n,)
        [m2 m-2]
    background : array, shape (band, n) or (band, 1)
        [1]
    scene : Scene
        All else in it are numbers.

    Returns
    -------
    reflectance : array, shape (band, n)
        Within 1e-6 of that of `cell_by_cell`; which it is where the dissociation is an array, and where the leaf area
        index within crowns is above `foliage_table.LIMIT`. [1]

    Raises
    ------
    ValueError
        As `check_cells`.
    """
    if isinstance(scene.dissociation, np.ndarray):
        check_cells(lai, background, scene)
        return cell_by_cell(lai, background, scene)
    by_brown = isinstance(scene.brown, np.ndarray)
    # A table over the dead share is the same whatever that is.
    alike, brown = (scene._replace(brown=-1.0) if by_brown else scene), np.atleast_1d(scene.brown)
    if isinstance(scene.crown_cover, np.ndarray):
        table = _crown_terms_table(alike._replace(crown_cover=1.0, crown_shape=SHAPE), by_brown)
        crowns = _crown_table(scene.crown_shape, scene.sza, scene.vza, scene.raa)
        out, wrong = interpolate_crowned(table, crowns, lai, brown, scene.crown_cover, background)
    else:
        inside = lai if scene.crown_cover == 1 else lai_in_crowns(lai, scene.crown_cover)
        out, wrong = interpolate_foliage(_joined_table(alike), inside, brown, background)
    if wrong:
        check_cells(lai, background, scene)
    if np.fmax.reduce(out[0], initial=0.0) == np.inf:
        cells = np.flatnonzero(out[0] == np.inf)
        out[:, cells] = cell_by_cell(lai[cells], np.broadcast_to(background, out.shape)[:, cells], scene.part(cells))
    return out


_crown_table = lru_cache(maxsize=32)(crown_table)


@lru_cache(maxsize=32)
def _joined_table(scene):
    """Table of the terms of `over_background`, over leaf area within crowns and its dead share."""
    sky = sky_of(scene)

    def terms(lai, brown):
        c = leaves_of(lai, scene._replace(brown=brown))
        if scene.crown_cover != 1:
            c = clumped(c, crown_shares(scene.crown_cover, scene.crown_shape, scene.sza, scene.vza, scene.raa))
        alone = reflectance_factor(c.rso, c.rdo, sky)
        hot = (1 - sky) * (c.tsstoo - c.tss * c.too)
        through = reflectance_factor(c.tss + c.tsd, c.tdd, sky) * (c.too + c.tdo)
        columns = np.broadcast_arrays(alone, hot, through, c.rdd_below)
        return np.stack(columns, axis=1).reshape(-1, lai.size)

    def reflectances(values):
        alone, hot, through, rdd = values.reshape(-1, 4, values.shape[1]).swapaxes(0, 1)
        return np.stack([over_background(alone, hot, through, rdd, r) for r in _GROUNDS])

    return tabulate_foliage(terms, decay(scene), combine=reflectances)


@lru_cache(maxsize=32)
def _crown_terms_table(scene, by_brown):
    """Table of the terms of `crowns_over_background`."""
    sky = sky_of(scene)

    def terms(lai, brown):
        found = crown_terms(leaves_of(lai, scene._replace(brown=brown) if by_brown else scene), sky)
        return np.stack(np.broadcast_arrays(*found), axis=1).reshape(-1, lai.size)

    def reflectances(values):
        """Crowns without gaps have the largest errors, of all terms."""
        by_band = tuple(values.reshape(len(sky), -1, values.shape[1]).swapaxes(0, 1))
        over = [crowns_over_background(by_band, (1.0, 1.0, 1.0, 0.0, 1.0), r) for r in _GROUNDS]
        return np.concatenate([values, *over])

    return tabulate_foliage(terms, decay(scene), by_brown, reflectances)
