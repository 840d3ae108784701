"""Light absorbed by the leaves and the ground of many cells, averaged over bands: by the model, or from tables."""

from typing import Literal, TypeAlias

import numpy as np

from fifesim.base.caches import cached
from fifesim.ground.canopy import interpolation
from fifesim.ground.canopy.layers import light_budget, light_terms
from fifesim.ground.canopy.reflectance_table import check_cells, decay, over_grounds, sky_of

# Absorbed by all or by green leaves, or the four parts of the light budget.
Part: TypeAlias = Literal["all", "green", "light"]

_BLOCK = 2**11  # cells at a time, so that intermediate results of all bands stay in the cache of the processor


def scene_light(lai, background, scene, weights, part):
    """
    Light budget of cells, averaged over bands.

    Parameters
    ----------
    lai : array, shape (...)
        At most `leaf_area.LARGEST_OF_MAPS`; NaN gives NaN. [m2 m-2]
    background : array, shape (band,) or (band, ...)
        [1]
    scene : reflectance_table.Scene
        Leaves, position of the sun, and diffuse fractions of the bands; its view has no effect.
    weights : tuple of float, length (band,)
        Share of each band in the light. [1]
    part : {"all", "green", "light"}
        Light absorbed by all leaves or by green ones, or all fields of `layers.LightBudget`.

    Returns
    -------
    light : array, shape (1, ...) or (4, ...)
        Within 1e-6 of the model. [1]

    Raises
    ------
    ValueError
        If a value is out of range.
    """
    uniform = background.ndim < 2
    if uniform and not scene.varies():
        check_cells(lai, background, scene)
        return interpolation.interpolate(_table(tuple(background.tolist()), scene, weights, part), lai)
    cells, lai = lai.shape, lai.reshape(-1)
    ground = np.broadcast_to(background[:, None] if uniform else background.reshape(len(weights), -1),
                             (len(weights), lai.size))  # fmt: skip
    # Tables have no axis for dissociation or crown cover, and no column for the ground.
    if part == "light" or isinstance(scene.dissociation, np.ndarray) or isinstance(scene.crown_cover, np.ndarray):
        check_cells(lai, ground, scene)
        return _by_model(lai, ground, scene, weights, part).reshape(-1, *cells)
    if isinstance(scene.brown, np.ndarray):
        table = _foliage_table(scene._replace(brown=-1.0), part)
        by_band, wrong = interpolation.interpolate_foliage(table, lai, scene.brown, ground)
        if wrong:
            check_cells(lai, ground, scene)
    else:
        check_cells(lai, ground, scene)
        by_band = interpolation.interpolate_over(_terms_table(scene, part), lai, ground)
    return (np.array(weights) @ by_band).reshape(1, *cells)


def _by_model(lai, ground, scene, weights, part):
    """Light of cells by the model, shape (1, n) or (4, n), one block of cells at a time."""
    blocks = [slice(start, start + _BLOCK) for start in range(0, lai.size, _BLOCK)]
    found = [_model_light(lai[each], ground[:, each], scene.part(each), weights, part) for each in blocks]
    return np.concatenate(found or [np.empty((4 if part == "light" else 1, 0))], axis=1)


def _model_light(lai, ground, scene, weights, part):
    """Light of cells, shape (1, n) or (4, n)."""
    own = scene
    budget = light_budget(
        lai, *(each for pair in _optics(own) for each in pair), ground, brown=own.brown, dissociation=own.dissociation,
        sza=own.sza, leaf_angles=own.leaf_angles, diffuse_fraction=sky_of(own), crown_cover=own.crown_cover,
    )  # fmt: skip
    by_part = {"all": [budget.green + budget.brown], "green": [budget.green], "light": budget}
    shape = len(weights), lai.size
    return np.stack([np.array(weights) @ np.broadcast_to(each, shape) for each in by_part[part]])


def _optics(scene):
    """Reflectance and transmittance of green and of dead leaves, shape (band, 1)."""
    pairs = [(scene.leaf_reflectance, scene.leaf_transmittance), (scene.brown_reflectance, scene.brown_transmittance)]
    green, dead = (None if None in pair else tuple(np.reshape(each, (-1, 1)) for each in pair) for pair in pairs)
    return green, green if dead is None else dead


@cached(32, "tables of absorbed light over one background")
def _table(background, scene, weights, part):
    """Table of the light of cells that differ only in leaf area."""
    ground = np.array(background)[:, None]
    return interpolation.tabulate(lambda lai: _model_light(lai, ground, scene, weights, part), _rate(scene))


@cached(8, "tables of absorbed light over any background")
def _terms_table(scene, part):
    """Table of terms that `over_background` combines to the light absorbed in each band."""
    return interpolation.tabulate(lambda lai: _terms(lai, scene.brown, scene, part), _rate(scene), over_grounds)


@cached(8, "tables of absorbed light by dead share over any background")
def _foliage_table(scene, part):
    """As `_terms_table`, over leaf area and dead share."""
    return interpolation.tabulate_foliage(
        lambda lai, brown: _terms(lai, brown, scene, part), _rate(scene), combine=over_grounds
    )


def _rate(scene):
    """Fastest decay of light with leaf area."""
    return decay(scene) / (scene.crown_cover or 1.0)


def _terms(lai, brown, scene, part):
    """Terms of `over_background` for the light absorbed in each band, shape (4 bands, n)."""
    found, _ = light_terms(
        lai, *_optics(scene), brown=brown, dissociation=scene.dissociation, sza=scene.sza,
        leaf_angles=scene.leaf_angles, diffuse_fraction=sky_of(scene), crown_cover=scene.crown_cover,
    )  # fmt: skip
    kinds = ("green",) if part == "green" else ("green", "brown")
    alone = sum(getattr(found, kind) for kind in kinds)
    through = found.down * sum(getattr(found, f"{kind}_below") for kind in kinds)
    columns = np.broadcast_arrays(alone, 0.0, through, found.rdd_below)
    return np.stack(columns, axis=1).reshape(-1, columns[0].shape[-1])
