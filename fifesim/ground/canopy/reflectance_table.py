"""Canopy reflectance of many cells: SAIL once per scene, then a table over leaf area index."""

from functools import lru_cache

import numpy as np

from fifesim.ground.canopy.background import over_background, reflectance_factor
from fifesim.ground.canopy.cell_reflectance import varied_reflectance
from fifesim.ground.canopy.crowns import SHAPE
from fifesim.ground.canopy.lai_table import interpolate, interpolate_over, tabulate
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.optics import check_background, check_leaf_optics
from fifesim.ground.canopy.ranges import check_share
from fifesim.ground.canopy.scene import Scene, canopy_of, cell_by_cell, check_cells, decay, reflectance_of, sky_of


def canopy_reflectance(
    lai,
    leaf_reflectance,
    leaf_transmittance,
    background,
    *,
    sza,
    vza=0.0,
    raa=0.0,
    leaf_angles="spherical",
    hotspot=0.0,
    diffuse_fraction=0.0,
    brown=0.0,
    dissociation=0.0,
    brown_reflectance=None,
    brown_transmittance=None,
    crown_cover=1.0,
    crown_shape=SHAPE,
    exact=False,
):
    r"""
    Reflectance factor of a canopy over its background, for every cell and band.

    .. math:: \rho = (1 - f) \, r_{so}^* + f \, r_{do}^*

    Parameters
    ----------
    lai : array
        Leaf area index. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance : array, shape (band,)
        [1]
    background : float, or array of shape (band,), (band,) + lai.shape or broadcastable
        One dimension is bands, more are cells; NaN gives NaN. [1]
    sza, vza, raa : float
        [degree]
    leaf_angles : optional
        Whatever `leaf_angle_classes` accepts.
    hotspot : float, optional
        Ratio of leaf size to canopy height; 0 for none. [1]
    diffuse_fraction : float or array, shape (band,), optional
        Share of skylight in the irradiance. [1]
    brown, dissociation : float, or array broadcastable to lai.shape, optional
        Dead share of the leaf area, and how far it lies below the rest, as in `two_layers`; NaN gives NaN. [1]
    brown_reflectance, brown_transmittance : array, shape (band,), optional
        Of dead leaves; those of the others by default. [1]
    crown_cover : float, or array broadcastable to lai.shape, optional
        Share of the ground below crowns, which hold all leaves; NaN gives NaN. [1]
    crown_shape : float, optional
        Crown diameter over height. [1]
    exact : bool, optional
        Compute each cell instead of interpolating.

    Returns
    -------
    reflectance : array, shape (band,) + lai.shape
        Within 1e-6 of the exact values. [1]

    Raises
    ------
    ValueError
        If leaf area index, leaf optics, background or shares are outside their range.

    Notes
    -----
    Where the background is a number, its reflectance with the canopy is tabulated; where it is a raster, the layer's
    reflectances and transmittances are, and each cell combines its own.

    References
    ----------
    [Verhoef2007]_; [VerhoefBach2007]_

    Examples
    --------
    Without leaves the background is seen as it is:

    >>> float(canopy_reflectance(0.0, [0.07], [0.04], 0.15, sza=30)[0])
    0.15
    """
    lai, background = np.asarray(lai, float), np.asarray(background, float)
    bands = np.broadcast_shapes((1,), *(np.shape(v) for v in (leaf_reflectance, leaf_transmittance, diffuse_fraction)))
    uniform = background.ndim < 2
    if uniform:
        bands = np.broadcast_shapes(bands, background.shape)
    leaves = map(_numbers, (leaf_reflectance, leaf_transmittance, diffuse_fraction))
    dead = tuple(map(_numbers, (brown_reflectance, brown_transmittance)))
    scene = _even(*leaves, bands, float(sza), float(vza), float(raa), leaf_angle_classes(leaf_angles), float(hotspot))
    scene = scene._replace(**_kinds(lai, brown, dissociation, dead, bands), **_crowns(lai, crown_cover, crown_shape))
    if not (exact or scene.varies()):
        check_cells(lai, background, scene)
        if uniform:
            return interpolate(_surface_table(_per_band(background, bands), scene), lai)
        return interpolate_over(_layer_table(scene), lai, background)
    if uniform:
        ground = np.broadcast_to(background, bands)[:, None]
    else:
        ground = np.broadcast_to(background, bands + lai.shape).reshape(*bands, -1)
    kernel = _exact_reflectance if exact else varied_reflectance
    return kernel(lai.reshape(-1), ground, scene).reshape(bands + lai.shape)


def even_table(
    leaf_reflectance,
    leaf_transmittance,
    background,
    *,
    sza,
    vza,
    raa,
    leaf_angles,
    hotspot,
    diffuse_fraction,
):
    """
    Table by which `canopy_reflectance` interpolates where cells differ in their green leaf area alone.

    Parameters
    ----------
    leaf_reflectance, leaf_transmittance, background, diffuse_fraction : array, shape (band,)
        [1]
    sza, vza, raa, leaf_angles, hotspot
        As in `canopy_reflectance`.

    Returns
    -------
    table : fifesim.ground.canopy.lai_table.LaiTable
        A column for each band.

    Raises
    ------
    ValueError
        As in `canopy_reflectance`.
    """
    check_background(background)
    bands = np.shape(leaf_reflectance)
    leaves = map(_numbers, (leaf_reflectance, leaf_transmittance, diffuse_fraction))
    scene = _even(*leaves, bands, float(sza), float(vza), float(raa), leaf_angle_classes(leaf_angles), float(hotspot))
    return _surface_table(_per_band(background, bands), scene)


def directional_reflectance(
    lai,
    leaf_reflectance,
    leaf_transmittance,
    background,
    *,
    sza,
    vza,
    raa,
    leaf_angles,
    hotspot,
    diffuse_fraction,
    brown=0.0,
    dissociation=0.0,
    brown_reflectance=None,
    brown_transmittance=None,
    crown_cover=1.0,
    crown_shape=SHAPE,
):
    r"""
    Reflectance factor of a canopy where the directions of sun and view, or the leaves, differ from cell to cell.

    Parameters
    ----------
    lai : array, shape (...)
        NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance : array, shape (band,) or (..., band)
        NaN gives NaN. [1]
    background, diffuse_fraction : array, broadcastable to (..., band)
        [1]
    sza, vza, raa : array, broadcastable to (...)
        NaN gives NaN. [degree]
    leaf_angles, hotspot, brown, dissociation, crown_cover, crown_shape
        As in `canopy_reflectance`.
    brown_reflectance, brown_transmittance : array, shape (band,) or (..., band), optional
        Of dead leaves. [1]

    Returns
    -------
    reflectance : array, shape (band, ...)
        SAIL at every cell. [1]

    Raises
    ------
    ValueError
        As `canopy_reflectance`, or if a zenith angle is not below 90 degrees.

    References
    ----------
    [Verhoef2007]_
    """
    leaf_reflectance, leaf_transmittance = _leaves_by_cell(leaf_reflectance, leaf_transmittance, np.shape(lai))
    for name, angle in (("sza", np.asarray(sza, float)), ("vza", np.asarray(vza, float))):
        wrong = angle[(angle < 0) | (angle >= 90)]
        if wrong.size:
            raise ValueError(f"{name} must be in [0, 90) degrees in every cell, got {wrong[0]:g}")
    cells, bands = np.shape(lai), len(leaf_reflectance)
    lai = np.asarray(lai, float).reshape(-1)
    if np.ndim(sza) or np.ndim(vza) or np.ndim(raa):
        sza, vza, raa = (np.broadcast_to(np.asarray(v, float), cells).reshape(-1) for v in (sza, vza, raa))
    ground, sky = (
        np.broadcast_to(np.asarray(v, float), (*cells, bands)).reshape(-1, bands).T
        for v in (background, diffuse_fraction)
    )
    missing = np.isnan(sza + vza + raa)
    sza, vza, raa = (np.where(missing, 0.0, angle) for angle in (sza, vza, raa))
    leaves = leaf_angle_classes(leaf_angles)
    scene = Scene(leaf_reflectance, leaf_transmittance, sky, sza, vza, raa, leaves, hotspot)
    kinds = _kinds(lai.reshape(cells), brown, dissociation, (brown_reflectance, brown_transmittance))
    scene = scene._replace(**kinds, **_crowns(lai.reshape(cells), crown_cover, crown_shape))
    out = _exact_reflectance(lai, ground, scene)
    out[:, np.broadcast_to(missing, lai.shape)] = np.nan
    return out.reshape(bands, *cells)


@lru_cache(maxsize=32)
def _even(reflectance, transmittance, sky, bands, sza, vza, raa, leaf_angles, hotspot):
    """Scene of green leaves whose optics, directions and angles are the same in all cells."""
    check_leaf_optics(reflectance, transmittance)
    optics = (_per_band(each, bands) for each in (reflectance, transmittance, sky))
    return Scene(*optics, sza, vza, raa, leaf_angles, hotspot)


@lru_cache(maxsize=32)
def _dead(reflectance, transmittance, bands):
    """Optics of dead leaves that are the same in all cells."""
    check_leaf_optics(reflectance, transmittance)
    return _per_band(reflectance, bands), _per_band(transmittance, bands)


def _numbers(values):
    """Numbers that a cache can look up; of optics that are not given, None."""
    return None if values is None else tuple(np.ravel(values).tolist())


def _exact_reflectance(lai, background, scene):
    """Reflectance factor of cells by the models themselves, once they are checked."""
    check_cells(lai, background, scene)
    return cell_by_cell(lai, background, scene)


def _leaves_by_cell(reflectance, transmittance, cells):
    """Leaf optics of cells, shape (band, n), or (band, 1) where they are the same."""
    rho, tau = np.broadcast_arrays(np.asarray(reflectance, float), np.asarray(transmittance, float))
    known = ~np.isnan(rho + tau) if rho.ndim > 1 else ...
    check_leaf_optics(rho[known], tau[known])
    if rho.ndim == 1:
        return rho[:, None], tau[:, None]
    shape = *cells, rho.shape[-1]
    return tuple(np.ascontiguousarray(np.broadcast_to(each, shape).reshape(-1, shape[-1]).T) for each in (rho, tau))


def _kinds(lai, brown, dissociation, dead, bands=None):
    """What a scene has of dead leaves; optics of all of them by band, unless it is cells that have theirs."""
    if not np.ndim(brown) and brown == 0:
        return {}
    if any(optics is None for optics in dead):
        raise ValueError("brown leaves need optics of their own: give brown_reflectance and brown_transmittance")
    check_share("dissociation", dissociation)
    dead = _leaves_by_cell(*dead, lai.shape) if bands is None else _dead(*dead, bands)
    optics = dict(zip(("brown_reflectance", "brown_transmittance"), dead, strict=True))
    return {"brown": _of_cells(brown, lai), "dissociation": _of_cells(dissociation, lai)} | optics


def _crowns(lai, crown_cover, crown_shape):
    """What a scene has of crowns."""
    if not np.ndim(crown_cover) and crown_cover == 1:
        return {}
    if not 0 <= crown_shape < np.inf:
        raise ValueError(f"crown_shape must be at least 0, got {crown_shape:g}: it is crown diameter over height")
    return {"crown_cover": _of_cells(crown_cover, lai), "crown_shape": float(crown_shape)}


def _of_cells(value, lai):
    """A number, or values of cells, shape (n,)."""
    return np.broadcast_to(np.asarray(value, float), lai.shape).reshape(-1) if np.ndim(value) else float(value)


def _per_band(values, bands):
    """Values of each band as a tuple, which a cache can look up."""
    return tuple(np.broadcast_to(np.asarray(values, float), bands).tolist())


@lru_cache(maxsize=32)
def _surface_table(background, scene):
    """Table of the reflectance of each band."""
    ground = np.array(background)[:, None]
    return tabulate(lambda lai: reflectance_of(lai, ground, scene), decay(scene) / (scene.crown_cover or 1.0))


@lru_cache(maxsize=32)
def _layer_table(scene):
    """Table of the terms of `interpolate_over`; the reflectance must hold for every background."""

    def terms(lai):
        c, sky = canopy_of(lai, scene), sky_of(scene)
        alone = reflectance_factor(c.rso, c.rdo, sky)
        hot = (1 - sky) * (c.tsstoo - c.tss * c.too)
        through = reflectance_factor(c.tss + c.tsd, c.tdd, sky) * (c.too + c.tdo)
        columns = np.broadcast_arrays(alone, hot, through, c.rdd_below)
        return np.stack(columns, axis=1).reshape(-1, lai.size)

    def reflectances(values):
        alone, hot, through, rdd = values.reshape(-1, 4, values.shape[1]).swapaxes(0, 1)
        return np.stack([over_background(alone, hot, through, rdd, r) for r in (0.0, 0.5, 1.0)])

    return tabulate(terms, decay(scene) / (scene.crown_cover or 1.0), reflectances)
