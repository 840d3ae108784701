"""What gives the reflectance of cells of one canopy, and which rasters it takes."""

from functools import partial
from typing import NamedTuple

import numpy as np
import xarray as xr

from fifesim.base.geometry import relative_azimuth
from fifesim.ground.canopy.crowns import SHAPE
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.canopy.rasters import canopy_shares
from fifesim.ground.canopy.reflectance_table import canopy_reflectance, directional_reflectance
from fifesim.rasters import cf, directions

# Largest ratio of leaf size to canopy height. [1]
LARGEST_HOTSPOT = 10.0


class EvenCanopy(NamedTuple):
    """A canopy whose cells differ in their green leaf area alone."""

    lai: xr.DataArray
    parameters: dict
    """Of `ground.canopy.reflectance_table.even_table`, numbers and tuples."""


def even_canopy(
    lai, *, leaf_angles, hotspot, brown, crown_cover, soil_changes, exact, geometry, dissociation, brown_optics,
    crown_shape, **by_band,
):  # fmt: skip
    """
    A canopy whose reflectance is a function of leaf area alone, by its table.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
    leaf_angles, hotspot, brown, crown_cover, soil_changes, exact, geometry, dissociation, brown_optics, crown_shape
        As in `canopy_kernel`.
    **by_band
        Leaf reflectance, leaf transmittance, background and diffuse fraction.

    Returns
    -------
    canopy : EvenCanopy or None
        None where the cells differ otherwise, or the table is not used.
    """
    rasters = any(isinstance(each, xr.DataArray) for each in (brown, crown_cover, *by_band.values()))
    if rasters or brown != 0 or crown_cover != 1 or soil_changes is not None or exact or directions.varying(geometry):
        return None
    parameters = {name: tuple(map(float, values)) for name, values in by_band.items()}
    parameters |= {name: float(getattr(geometry, name)) for name in ("sza", "vza", "raa")}
    return EvenCanopy(lai, parameters | {"leaf_angles": leaf_angle_classes(leaf_angles), "hotspot": float(hotspot)})


def canopy_kernel(
    lai,
    bands,
    *,
    leaf_reflectance,
    leaf_transmittance,
    background,
    diffuse_fraction,
    geometry,
    leaf_angles="spherical",
    hotspot=0.0,
    brown=0.0,
    dissociation=0.0,
    brown_optics=None,
    crown_cover=1.0,
    crown_shape=SHAPE,
    soil_changes=None,
    exact=False,
):
    """
    Kernel of a canopy and the rasters that it takes, which may be evaluated on any of the cells.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        Whose CRS the rasters have where they lost theirs.
    bands : sequence of str
    leaf_reflectance, leaf_transmittance, background, diffuse_fraction, geometry
        As in `ground.canopy.raster.level_reflectance`, and the others too.
    soil_changes : (callable, sequence of xarray.DataArray), optional
        What makes the background of each cell of a dry one, from `ground.canopy.rasters.soils.soil_kernel`.

    Returns
    -------
    kernel : callable
        ``kernel(lai, *blocks)`` gives reflectance, shape (band, ...), from leaf area of shape (...) and blocks of the
        rasters, shape (..., [band]).
    rasters : list of xarray.DataArray

    Raises
    ------
    ValueError
        As in `ground.canopy.raster.level_reflectance`.
    """
    if not 0 <= hotspot <= LARGEST_HOTSPOT:
        raise ValueError(
            f"hotspot must be in [0, {LARGEST_HOTSPOT:g}], got {hotspot:g}: "
            "it is leaf size over canopy height, such as 0.1"
        )
    parameters = {"leaf_angles": leaf_angle_classes(leaf_angles), "hotspot": float(hotspot)}
    parameters["crown_shape"] = float(crown_shape)
    background = _per_band(_background_bands(background, bands))
    leaves = {"leaf_reflectance": leaf_reflectance, "leaf_transmittance": leaf_transmittance}
    if isinstance(brown, xr.DataArray) or brown != 0:
        leaves |= dict(zip(("brown_reflectance", "brown_transmittance"), brown_optics, strict=True))
    shares = {"brown": brown, "dissociation": dissociation, "crown_cover": crown_cover}
    shares = {name: canopy_shares.share(name, value, lai) for name, value in shares.items()}
    if directions.varying(geometry) or any(isinstance(each, xr.DataArray) for each in leaves.values()):
        kernel, rasters = canopy_shares.with_shares(partial(_by_cell, parameters, tuple(leaves)), shares)
        by_band = [_per_band(each) for each in (background, diffuse_fraction, *leaves.values())]
        return _over_soil(kernel, [*by_band[:2], *directions.angles(geometry), *by_band[2:], *rasters], soil_changes)
    parameters |= {name: tuple(map(float, values)) for name, values in leaves.items()}
    parameters |= {name: getattr(geometry, name) for name in ("sza", "vza", "raa")}
    parameters |= {"diffuse_fraction": tuple(map(float, diffuse_fraction)), "exact": exact}
    kernel, rasters = canopy_shares.with_shares(partial(_uniform, parameters), shares)
    return _over_soil(kernel, [background, *rasters], soil_changes)


def _over_soil(kernel, rasters, soil_changes):
    """Kernel whose background, its first raster, is made of the dry one."""
    if soil_changes is None:
        return kernel, rasters
    changed, changes = soil_changes
    return partial(_on_soil, kernel, changed, len(changes)), [*changes, *rasters]


def _on_soil(kernel, changed, count, lai, *blocks):
    changes, (background, *others) = blocks[:count], blocks[count:]
    return kernel(lai, changed(background, *changes), *others)


def _uniform(parameters, lai, background, **shares):
    """Reflectance below one sun, of leaves that are all alike."""
    # apply_ufunc hands the bands over as the last axis.
    bands_first = background.transpose(-1, *range(background.ndim - 1))
    return canopy_reflectance(check_map(lai), background=bands_first, **parameters, **shares)


def _by_cell(parameters, leaves, lai, ground, sky, sza, saa, vza, vaa, *optics, **shares):
    """Reflectance where the directions of sun or sensor, or the leaves, vary over the scene."""
    towards = {"sza": sza, "vza": vza, "raa": relative_azimuth(saa, vaa)}
    light = {"background": ground, "diffuse_fraction": sky, **towards}
    of_leaves = dict(zip(leaves, optics, strict=True))
    return directional_reflectance(check_map(lai), **of_leaves, **light, **parameters, **shares)


def _per_band(values):
    """A raster, or values of each band, without the names of the bands."""
    if isinstance(values, xr.DataArray):
        return values.drop_vars("band", errors="ignore")
    return xr.DataArray(np.asarray(values, float), dims="band")


def _background_bands(background, bands):
    """A background raster with one band for each of the canopy's; numbers stay."""
    if not isinstance(background, xr.DataArray):
        return background
    cf.check_units(background, "surface_reflectance")
    if "band" not in background.dims:
        return background.expand_dims(band=list(bands))
    known = background["band"].to_numpy().tolist()
    if missing := [name for name in bands if name not in known]:
        raise ValueError(f"the background lacks band {', '.join(missing)}, it has {', '.join(map(str, known))}")
    # As it is where it can be: what classes share is told by where it lies in memory.
    return background if known == list(bands) else background.sel(band=list(bands))
