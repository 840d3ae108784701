"""
Reflectance of a canopy and absorbed light in many cells: from the models, or interpolated in tables.
"""

from functools import partial
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from fifesim.base.caches import cached
from fifesim.ground.canopy import interpolation
from fifesim.ground.canopy.crowns import (
    SHAPE,
    check_crowns,
    clumped,
    crown_shares,
    crown_terms,
    crowns_over_background,
    lai_in_crowns,
)
from fifesim.ground.canopy.layers import extinction_coefficient, light_budget, light_terms, two_layers
from fifesim.ground.canopy.leaf_angles import LeafAngles, leaf_angle_classes
from fifesim.ground.canopy.leaf_area import check_lai, check_share
from fifesim.ground.canopy.leaf_transfer import discrete_ordinates
from fifesim.ground.canopy.optics import check_background, check_leaf_optics
from fifesim.ground.canopy.sail_model import over_background, reflectance_factor, sail, with_background

_BLOCK = 2**13  # cells at a time, so that intermediate results stay in the cache of the processor

# Background reflectances for which a table of terms is tested.
_GROUNDS = (0.0, 0.5, 1.0)


def canopy_reflectance(
    lai, leaf_reflectance, leaf_transmittance, background, *, sza, vza=0.0, raa=0.0, leaf_angles="spherical",
    hotspot=0.0, diffuse_fraction=0.0, dead=None, crown_shape=SHAPE, exact=False, **shares,
):  # fmt: skip
    """
    Reflectance factor of a canopy over its background for every cell and band, shape (band,) + lai.shape, within 1e-6.
    [1] Leaf optics and those of dead leaves, a pair, have shape (band,); a background of one dimension is bands, more
    are cells. Shares are those of `with_shares`. NaN gives NaN. [Verhoef2007]_; [VerhoefBach2007]_
    """
    lai, background = np.asarray(lai, float), np.asarray(background, float)
    leaf = leaf_reflectance, leaf_transmittance
    bands = np.broadcast_shapes(*map(np.shape, (*leaf, diffuse_fraction)), background.shape[: background.ndim < 2])
    for optics in (leaf, dead or leaf):
        check_leaf_optics(*optics)
    angles = leaf_angle_classes(leaf_angles)
    scene = uniform_scene(leaf, diffuse_fraction, (sza, vza, raa), angles, hotspot, dead, crown_shape, bands)
    scene = with_shares(scene, lai.shape, **shares)
    check_cells(lai.reshape(-1), background, scene)
    return scene_reflectance(lai, background, scene, exact)


def scene_reflectance(lai, background, scene, exact=False):
    """Reflectance of cells, shape (band,) + lai.shape, from valid leaf area of any shape, a background and a Scene."""
    bands, cells = len(scene.leaf_reflectance), lai.shape
    uniform = background.ndim < 2
    if not (exact or scene.varies()):
        check_share("background reflectance", background)
        if scene.crown_cover != 1:
            check_crowns(lai, scene.crown_cover)
        if uniform:
            return interpolation.interpolate(surface_table(_per_band(background, (bands,)), scene), lai)
        return interpolation.interpolate_over(_layer_table(scene), lai, background)
    ground = np.broadcast_to(background, (bands,) if uniform else (bands, *cells)).reshape(bands, -1)
    if exact:
        check_cells(lai.reshape(-1), ground, scene)
    kernel = cell_by_cell if exact else varied_reflectance
    return kernel(lai.reshape(-1), ground, scene).reshape(bands, *cells)


def uniform_scene(leaf, sky, directions, leaf_angles, hotspot, dead=None, crown_shape=SHAPE, bands=(1,)):
    """Scene without gaps or dead leaves, with the same valid optics in all cells."""
    bands = np.broadcast_shapes(bands, (1,), *map(np.shape, (*leaf, sky)))
    by_band = partial(_per_band, bands=bands)
    optics, of_dead = map(by_band, (*leaf, sky)), (None, None) if dead is None else map(by_band, dead)
    angles = map(float, directions)
    return Scene(*optics, *angles, leaf_angles, float(hotspot), *of_dead, crown_shape=float(crown_shape))


def with_shares(scene, cells, brown=0.0, dissociation=0.0, crown_cover=1.0):
    """Scene with dead leaves and crowns, by numbers or arrays that broadcast to the cells."""
    if not np.ndim(brown) and brown == 0:
        brown, dissociation = 0.0, 0.0
    elif scene.brown_reflectance is None:
        raise ValueError("brown leaves need optics of their own: give brown_reflectance and brown_transmittance")
    check_share("dissociation", dissociation)
    shares = {"brown": brown, "dissociation": dissociation, "crown_cover": crown_cover}
    for name, share in shares.items():
        by_cell = np.ndim(share) > 0
        shares[name] = np.broadcast_to(np.asarray(share, float), cells).reshape(-1) if by_cell else float(share)
    return scene._replace(**shares)


def directional_reflectance(
    lai, leaf, background, sky, directions, leaf_angles, hotspot, dead=None, crown_shape=SHAPE, shares=(0.0, 0.0, 1.0)
):
    """
    Reflectance factor where directions or leaves vary from cell to cell, SAIL at every cell, shape (band, ...). [1]
    Leaves are pairs of shape (band,) or (..., band), background and sky broadcast to (..., band); the three directions
    (sza, vza, raa) [degree] and the three shares (brown, dissociation, crown cover) broadcast to (...). NaN gives NaN.
    """
    leaf, (sza, vza, raa) = _leaves_by_cell(*leaf, np.shape(lai)), directions
    for name, angle in (("sza", np.asarray(sza, float)), ("vza", np.asarray(vza, float))):
        wrong = angle[(angle < 0) | (angle >= 90)]
        if wrong.size:
            raise ValueError(f"{name} must be in [0, 90) degrees in every cell, got {wrong[0]:g}")
    cells, bands = np.shape(lai), len(leaf[0])
    lai = np.asarray(lai, float).reshape(-1)
    if np.ndim(sza) or np.ndim(vza) or np.ndim(raa):
        sza, vza, raa = (np.broadcast_to(np.asarray(v, float), cells).reshape(-1) for v in (sza, vza, raa))
    ground, sky = (
        np.broadcast_to(np.asarray(v, float), (*cells, bands)).reshape(-1, bands).T for v in (background, sky)
    )
    missing = np.isnan(sza + vza + raa)
    sza, vza, raa = (np.where(missing, 0.0, angle) for angle in (sza, vza, raa))
    dead = (None, None) if dead is None else _leaves_by_cell(*dead, cells)
    scene = Scene(*leaf, sky, sza, vza, raa, leaf_angle_classes(leaf_angles), hotspot, *dead)
    scene = with_shares(scene, cells, *shares)._replace(crown_shape=float(crown_shape))
    check_cells(lai, ground, scene)
    out = cell_by_cell(lai, ground, scene)
    out[:, np.broadcast_to(missing, lai.shape)] = np.nan
    return out.reshape(bands, *cells)


def _leaves_by_cell(reflectance, transmittance, cells):
    """Leaf optics of cells, shape (band, n), or (band, 1) where they are equal."""
    rho, tau = np.broadcast_arrays(np.asarray(reflectance, float), np.asarray(transmittance, float))
    known = ~np.isnan(rho + tau) if rho.ndim > 1 else ...
    check_leaf_optics(rho[known], tau[known])
    if rho.ndim == 1:
        return rho[:, None], tau[:, None]
    shape = *cells, rho.shape[-1]
    return tuple(np.ascontiguousarray(np.broadcast_to(each, shape).reshape(-1, shape[-1]).T) for each in (rho, tau))


def _per_band(values, bands):
    """Values of each band as a tuple, for the key of a cache."""
    return tuple(np.broadcast_to(np.asarray(values, float), bands).tolist())


@cached(32, "reflectance tables over one background")
def surface_table(background, scene):
    """Table of the reflectance of each band over leaf area, for a scene of numbers and a background for each band."""
    check_background(background)
    ground = np.array(background)[:, None]
    return interpolation.tabulate(
        lambda lai: model_reflectance(lai, ground, scene), decay(scene) / (scene.crown_cover or 1.0)
    )


@cached(32, "reflectance tables over any background")
def _layer_table(scene):
    """Table of the terms of `interpolate_over`, accurate for every background."""
    sky = sky_of(scene)
    rate = decay(scene) / (scene.crown_cover or 1.0)
    return interpolation.tabulate(lambda lai: _layer_terms(cell_canopy(lai, scene), sky), rate, over_grounds)


def _layer_terms(canopy, sky):
    """Terms of `over_background` for each band: reflected above, hot spot, transmitted, reflected below."""
    c = canopy
    alone = reflectance_factor(c.rso, c.rdo, sky)
    hot = (1 - sky) * (c.tsstoo - c.tss * c.too)
    through = reflectance_factor(c.tss + c.tsd, c.tdd, sky) * (c.too + c.tdo)
    columns = np.broadcast_arrays(alone, hot, through, c.rdd_below)
    return np.stack(columns, axis=1).reshape(-1, columns[0].shape[-1])


def over_grounds(values):
    """Reflectances over the backgrounds for which a table of `_layer_terms` is tested."""
    terms = values.reshape(-1, 4, values.shape[1]).swapaxes(0, 1)
    return np.stack([over_background(*terms, r) for r in _GROUNDS])


class Scene(NamedTuple):
    """Leaves, canopy structure and directions; optics and sky are tuples over bands, or of shape (band, 1 or n)."""

    leaf_reflectance: tuple | np.ndarray
    leaf_transmittance: tuple | np.ndarray
    sky: tuple | np.ndarray
    sza: float | np.ndarray
    vza: float | np.ndarray
    raa: float | np.ndarray
    leaf_angles: LeafAngles
    hotspot: float
    brown_reflectance: tuple | np.ndarray | None = None
    brown_transmittance: tuple | np.ndarray | None = None
    brown: float | np.ndarray = 0.0
    dissociation: float | np.ndarray = 0.0
    crown_cover: float | np.ndarray = 1.0
    crown_shape: float = SHAPE
    model: str = "sail"

    def varies(self):
        """Whether leaves or crowns vary from cell to cell."""
        return np.ndarray in {type(self.brown), type(self.dissociation), type(self.crown_cover)}

    def part(self, cells):
        """Scene of some cells, which are the last axis of its arrays."""
        by_cell = {name: v for name, v in self._asdict().items() if isinstance(v, np.ndarray) and v.shape[-1:] > (1,)}
        return self._replace(**{name: values[..., cells] for name, values in by_cell.items()})


def cell_canopy(lai, scene):
    """Reflectances and transmittances of the canopy in cells, shape (band, n). [1]"""
    if _is(scene.crown_cover, 1):
        return leaves_of(lai, scene)
    shares = crown_shares(scene.crown_cover, scene.crown_shape, scene.sza, scene.vza, scene.raa)
    return clumped(leaves_of(lai_in_crowns(lai, scene.crown_cover), scene), shares)


def leaves_of(lai, scene):
    """Reflectances and transmittances of leaves without gaps between crowns, from leaf area within crowns."""
    given = {name: getattr(scene, name) for name in ("sza", "vza", "raa", "leaf_angles", "hotspot")}
    leaf = _by_band(scene.leaf_reflectance), _by_band(scene.leaf_transmittance)
    if scene.model != "sail":
        return _exact_leaves(lai, leaf, scene, given)
    if _is(scene.brown, 0):
        return sail(lai, *leaf, **given)
    dead = _by_band(scene.brown_reflectance), _by_band(scene.brown_transmittance)
    return two_layers(lai, *leaf, *dead, brown=scene.brown, dissociation=scene.dissociation, **given)


def _exact_leaves(lai, leaf, scene, given):
    """Leaves by discrete ordinates; dead leaves are mixed with green ones."""
    if any(np.ndim(given[name]) for name in ("sza", "vza", "raa")):
        raise ValueError(
            "model='discrete-ordinates' needs one direction of sun and view, not angles by cell or the directions of "
            "the sky: use model='sail'"
        )
    if isinstance(scene.brown, np.ndarray) or (scene.brown != 0 and not _is(scene.dissociation, 0)):
        raise ValueError(
            "model='discrete-ordinates' needs one share of dead leaves without dissociation: use model='sail'"
        )
    if scene.brown != 0:
        dead = _by_band(scene.brown_reflectance), _by_band(scene.brown_transmittance)
        leaf = [(1 - scene.brown) * green + scene.brown * other for green, other in zip(leaf, dead, strict=True)]
    return discrete_ordinates(lai, *leaf, **given)


def sky_of(scene):
    """Diffuse fraction, shape (band, 1) or (band, n). [1]"""
    return _by_band(scene.sky)


def model_reflectance(lai, background, scene):
    """Reflectance factor of cells by the models, shape (band, n). [1]"""
    surface = with_background(cell_canopy(lai, scene), background)
    return reflectance_factor(surface.rso, surface.rdo, sky_of(scene))


def cell_by_cell(lai, background, scene):
    """Reflectance factor of cells by the models."""
    return _by_block(model_reflectance, lai, background, scene, _BLOCK)


def _by_block(model, lai, background, scene, size):
    """Result of a model, shape (k, n), from one block of cells at a time."""
    background = np.broadcast_to(background, (len(background), lai.size))
    blocks = [slice(start, start + size) for start in range(0, max(lai.size, 1), size)]
    return np.concatenate([model(lai[each], background[:, each], scene.part(each)) for each in blocks], axis=1)


def check_cells(lai, background, scene):
    """Raise ValueError if leaf area, background, dead share or crown cover are out of range; NaN passes."""
    check_lai(lai)
    check_background(background)
    check_share("brown", scene.brown)
    if not _is(scene.crown_cover, 1):
        check_crowns(lai, scene.crown_cover)


def decay(scene):
    """Fastest decay with leaf area within crowns: direct beam and view together, or diffuse light."""
    down, up = (extinction_coefficient(angle, scene.leaf_angles) for angle in (scene.sza, scene.vza))
    return max(1.0, down + up)


def _is(value, number):
    return not isinstance(value, np.ndarray) and value == number


def _by_band(values):
    """Values as an array of shape (band, 1) or (band, n)."""
    return np.reshape(values, (len(values), -1))


def varied_reflectance(lai, background, scene):
    """Reflectance factor for varying brown, dissociation or crown cover, shape (band, n), within 1e-6. [1]"""
    # By the models where the dissociation is an array, and where leaf area within crowns is beyond the tables.
    if isinstance(scene.dissociation, np.ndarray):
        check_cells(lai, background, scene)
        return cell_by_cell(lai, background, scene)
    by_brown = isinstance(scene.brown, np.ndarray)
    # A table over the dead share is the same whatever that is.
    alike, brown = (scene._replace(brown=-1.0) if by_brown else scene), np.atleast_1d(scene.brown)
    if isinstance(scene.crown_cover, np.ndarray):
        table = _crown_terms_table(alike._replace(crown_cover=1.0, crown_shape=SHAPE), by_brown)
        crowns = _crown_table(scene.crown_shape, scene.sza, scene.vza, scene.raa)
        out, wrong = interpolation.interpolate_crowned(table, crowns, lai, brown, scene.crown_cover, background)
    else:
        inside = lai if scene.crown_cover == 1 else lai_in_crowns(lai, scene.crown_cover)
        out, wrong = interpolation.interpolate_foliage(_joined_table(alike), inside, brown, background)
    if wrong:
        check_cells(lai, background, scene)
    if np.fmax.reduce(out[0], initial=0.0) == np.inf:
        cells = np.flatnonzero(out[0] == np.inf)
        out[:, cells] = cell_by_cell(lai[cells], np.broadcast_to(background, out.shape)[:, cells], scene.part(cells))
    return out


_crown_table = cached(32, "reflectance tables of crowns")(interpolation.crown_table)


@cached(32, "reflectance tables by dead share")
def _joined_table(scene):
    """Table of the terms of `over_background` over leaf area within crowns and dead share."""
    sky = sky_of(scene)

    def terms(lai, brown):
        c = leaves_of(lai, scene._replace(brown=brown))
        if scene.crown_cover != 1:
            c = clumped(c, crown_shares(scene.crown_cover, scene.crown_shape, scene.sza, scene.vza, scene.raa))
        return _layer_terms(c, sky)

    return interpolation.tabulate_foliage(terms, decay(scene), combine=over_grounds)


@cached(32, "reflectance tables of crowns over any background")
def _crown_terms_table(scene, by_brown):
    """Table of the terms of `crowns_over_background`."""
    sky = sky_of(scene)

    def terms(lai, brown):
        found = crown_terms(leaves_of(lai, scene._replace(brown=brown) if by_brown else scene), sky)
        return np.stack(np.broadcast_arrays(*found), axis=1).reshape(-1, lai.size)

    def reflectances(values):
        """Reflectances for which a table of crown terms is tested; crowns without gaps have the largest errors."""
        by_band = tuple(values.reshape(len(sky), -1, values.shape[1]).swapaxes(0, 1))
        over = [crowns_over_background(by_band, (1.0, 1.0, 1.0, 0.0, 1.0), r) for r in _GROUNDS]
        return np.concatenate([values, *over])

    return interpolation.tabulate_foliage(terms, decay(scene), by_brown, reflectances)


# Absorbed by all or by green leaves, or the four parts of the light budget.
Part: TypeAlias = Literal["all", "green", "light"]

_LIGHT_BLOCK = 2**11  # cells at a time, so that intermediate results of all bands stay in the cache of the processor


def scene_light(lai, background, scene, weights, part):
    """Light budget of cells averaged over bands, shape (1, ...) or (4, ...), within 1e-6 of the model. [1]"""
    uniform = background.ndim < 2
    if uniform and not scene.varies():
        check_cells(lai, background, scene)
        return interpolation.interpolate(_light_table(tuple(background.tolist()), scene, weights, part), lai)
    cells, lai = lai.shape, lai.reshape(-1)
    ground = np.broadcast_to(background[:, None] if uniform else background.reshape(len(weights), -1),
                             (len(weights), lai.size))  # fmt: skip
    # Tables have no axis for dissociation or crown cover, and no column for the ground.
    if part == "light" or isinstance(scene.dissociation, np.ndarray) or isinstance(scene.crown_cover, np.ndarray):
        check_cells(lai, ground, scene)
        light = _by_block(lambda *some: _model_light(*some, weights, part), lai, ground, scene, _LIGHT_BLOCK)
        return light.reshape(-1, *cells)
    if isinstance(scene.brown, np.ndarray):
        table = _light_foliage_table(scene._replace(brown=-1.0), part)
        by_band, wrong = interpolation.interpolate_foliage(table, lai, scene.brown, ground)
        if wrong:
            check_cells(lai, ground, scene)
    else:
        check_cells(lai, ground, scene)
        by_band = interpolation.interpolate_over(_light_terms_table(scene, part), lai, ground)
    return (np.array(weights) @ by_band).reshape(1, *cells)


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
def _light_table(background, scene, weights, part):
    """Table of the light of cells that differ only in leaf area."""
    ground = np.array(background)[:, None]
    return interpolation.tabulate(lambda lai: _model_light(lai, ground, scene, weights, part), _rate(scene))


@cached(8, "tables of absorbed light over any background")
def _light_terms_table(scene, part):
    """Table of terms that `over_background` combines to the light absorbed in each band."""
    return interpolation.tabulate(lambda lai: _light_terms(lai, scene.brown, scene, part), _rate(scene), over_grounds)


@cached(8, "tables of absorbed light by dead share over any background")
def _light_foliage_table(scene, part):
    """As `_light_terms_table`, over leaf area and dead share."""
    return interpolation.tabulate_foliage(
        lambda lai, brown: _light_terms(lai, brown, scene, part), _rate(scene), combine=over_grounds
    )


def _rate(scene):
    """Fastest decay of light with leaf area."""
    return decay(scene) / (scene.crown_cover or 1.0)


def _light_terms(lai, brown, scene, part):
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
