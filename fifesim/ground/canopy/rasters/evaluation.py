"""Reflectance of canopies on labelled rasters: the kernel of a canopy and the rasters that it takes."""

from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr

from fifesim.base.geometry import Geometry, relative_azimuth
from fifesim.ground.canopy.description import Canopy, is_raster
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.canopy.properties import NUMBERS
from fifesim.ground.canopy.reflectance_table import (
    Scene,
    directional_reflectance,
    scene_reflectance,
    uniform_scene,
    with_shares,
)
from fifesim.rasters import cf, directions
from fifesim.rasters.axes import north_up
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.packed import unpacked

SHARES = ("brown", "dissociation", "crown_cover")
"""Properties that SAIL takes by cell."""


class BandCanopy(NamedTuple):
    """A canopy with its optics in each band."""

    canopy: Canopy
    leaf: tuple
    """Reflectance and transmittance, shape (band,), or rasters over (band, y, x). [1]"""
    dead: tuple | None
    """The same of dead leaves; None without any."""
    background: np.ndarray | xr.DataArray
    """Shape (band,), or a raster over ([band], y, x). [1]"""
    soil_changes: tuple | None = None
    """Kernel that makes the background of each cell from a dry one, and its rasters."""


class Light(NamedTuple):
    """Directions of sun and view, and the diffuse fraction of each band."""

    geometry: Geometry | xr.Dataset
    diffuse_fraction: np.ndarray | xr.DataArray


class EvenCanopy(NamedTuple):
    """A canopy whose cells differ only in their green leaf area."""

    lai: xr.DataArray
    background: tuple
    scene: Scene


def even_canopy(lai, stand, light, exact):
    """An EvenCanopy, or None where cells differ otherwise or no table is used."""
    own = stand.canopy
    by_band = (*stand.leaf, stand.background, light.diffuse_fraction)
    rasters = any(map(is_raster, (own.brown, own.crown_cover, *by_band)))
    if rasters or own.brown != 0 or own.crown_cover != 1 or stand.soil_changes is not None or exact:
        return None
    if directions.varying(light.geometry):
        return None
    return EvenCanopy(lai, tuple(map(float, stand.background)), _uniform_scene(stand, light))


def canopy_kernel(lai, bands, stand, light, exact=False):
    """
    Kernel of a canopy and the rasters that it takes.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or None
        Its CRS is that of rasters that lost theirs.
    bands : sequence of str
    stand : BandCanopy
    light : Light
    exact : bool, optional
        Evaluate SAIL at every cell instead of interpolating a table.

    Returns
    -------
    kernel : callable
        ``kernel(lai, *blocks)`` gives reflectance, shape (band, ...), from leaf area of shape (...) and blocks of the
        rasters, shape (..., [band]).
    rasters : list of xarray.DataArray

    Raises
    ------
    ValueError
        If the optics, the background or a share are out of their range.
    """
    varying, numbers = shares_of(stand.canopy, SHARES, lai)
    background = _per_band(_background_bands(stand.background, bands))
    leaves = stand.leaf + (stand.dead or ())
    if directions.varying(light.geometry) or any(map(is_raster, leaves)):
        by_band = [_per_band(each) for each in (light.diffuse_fraction, *leaves)]
        rasters = [background, by_band[0], *directions.angles(light.geometry), *by_band[1:]]
        own = stand.canopy
        kernel = partial(_by_cell, own.leaf_angles, own.hotspot, own.crown_shape, tuple(varying), numbers)
    else:
        rasters = [background]
        kernel = partial(_uniform, _uniform_scene(stand, light), tuple(varying), numbers, exact)
    rasters += varying.values()
    if stand.soil_changes is None:
        return kernel, rasters
    changed, changes = stand.soil_changes
    return partial(_on_soil, kernel, changed, len(changes)), [*changes, *rasters]


def shares_of(canopy, names, lai):
    """
    Properties of a canopy as a kernel takes them.

    Parameters
    ----------
    canopy : Canopy
    names : sequence of str
    lai : xarray.DataArray, dims (y, x), or None
        Its CRS is that of rasters that lost theirs.

    Returns
    -------
    varying : dict of str to xarray.DataArray, dims (y, x)
        Rasters, rows from north to south, without coordinates other than y and x.
    numbers : dict of str to float

    Raises
    ------
    ValueError
        If a raster has other units.
    """
    varying, numbers = {}, {}
    for name in names:
        given = getattr(canopy, name)
        if not is_raster(given):
            numbers[name] = float(given)
            continue
        cf.check_units(given, name)
        raster = unpacked(with_crs_of(north_up(given), lai)).rename(name)
        varying[name] = raster.drop_vars(set(raster.coords) - {"y", "x", "spatial_ref"})
    return varying, numbers


def _uniform_scene(stand, light):
    own, at = stand.canopy, light.geometry
    towards = at.sza, at.vza, at.raa
    return uniform_scene(
        stand.leaf, light.diffuse_fraction, towards, own.leaf_angles, own.hotspot, stand.dead, own.crown_shape
    )


def _on_soil(kernel, changed, count, lai, *blocks):
    """Reflectance over a background that a kernel makes from the dry one."""
    changes, (background, *others) = blocks[:count], blocks[count:]
    return kernel(lai, changed(background, *changes), *others)


def _uniform(scene, varying, numbers, exact, lai, background, *shares):
    """Reflectance below one sun, of leaves that are all alike."""
    # apply_ufunc hands the bands over as the last axis.
    bands_first = background.transpose(-1, *range(background.ndim - 1))
    lai = check_map(lai)
    scene = with_shares(scene, lai.shape, **numbers, **dict(zip(varying, shares, strict=True)))
    return scene_reflectance(lai, bands_first, scene, exact)


def _by_cell(
    leaf_angles, hotspot, crown_shape, varying, numbers, lai, ground, sky, sza, saa, vza, vaa, *optics
):  # fmt: skip
    """Reflectance where the directions of sun or view, or the leaves, vary over the scene."""
    count = len(optics) - len(varying)
    dead = optics[2:count] or (None, None)
    return directional_reflectance(
        check_map(lai),
        *optics[:2],
        ground,
        sza=sza,
        vza=vza,
        raa=relative_azimuth(saa, vaa),
        leaf_angles=leaf_angles,
        hotspot=hotspot,
        diffuse_fraction=sky,
        brown_reflectance=dead[0],
        brown_transmittance=dead[1],
        crown_shape=crown_shape,
        **numbers,
        **dict(zip(varying, optics[count:], strict=True)),
    )


def in_words(canopy, names=SHARES):
    """Shares that are not the defaults, for a line of the history; ends in a comma and a space if not empty."""
    texts = []
    for name in names:
        value = getattr(canopy, name)
        if is_raster(value):
            texts.append(f"{name} by cell, ")
        elif value != NUMBERS[name].default:
            texts.append(f"{name} {value:g}, ")
    return "".join(texts)


def _per_band(values):
    """A raster, or values of each band, without the names of the bands."""
    if is_raster(values):
        return values.drop_vars("band", errors="ignore")
    return xr.DataArray(np.asarray(values, float), dims="band")


def _background_bands(background, bands):
    """A background raster with one band for each of the canopy's; numbers stay."""
    if not is_raster(background):
        return background
    cf.check_units(background, "surface_reflectance")
    if "band" not in background.dims:
        return background.expand_dims(band=list(bands))
    known = background["band"].to_numpy().tolist()
    if missing := [name for name in bands if name not in known]:
        raise ValueError(f"the background lacks band {', '.join(missing)}, it has {', '.join(map(str, known))}")
    # As it is where it can be: what classes share is told by where it lies in memory.
    return background if known == list(bands) else background.sel(band=list(bands))
