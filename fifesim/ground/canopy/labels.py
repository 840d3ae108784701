"""Reflectance and absorption of canopies on labelled rasters."""

from functools import partial
from operator import attrgetter
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import xarray as xr

from fifesim.base.geometry import Geometry, relative_azimuth
from fifesim.grids import cf, directions
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.classes import by_class
from fifesim.grids.grid import north_up, with_crs_of
from fifesim.grids.windows import with_origin
from fifesim.ground.canopy import layers
from fifesim.ground.canopy.crowns import SHAPE, check_crowns, crown_shares, lai_in_crowns
from fifesim.ground.canopy.description import Canopy
from fifesim.ground.canopy.leaf_area import check_map, warn_of_integers, warn_of_large
from fifesim.ground.canopy.properties import NUMERIC_PROPERTIES
from fifesim.ground.canopy.reflectance_table import (
    Scene,
    directional_reflectance,
    scene_light,
    scene_reflectance,
    uniform_scene,
    with_shares,
)

CELL_SHARES = ("brown", "dissociation", "crown_cover")  # properties that may vary by cell in SAIL


class BandCanopy(NamedTuple):
    """Canopy with its optics in each band."""

    canopy: Canopy
    leaf: tuple  # reflectance and transmittance, shape (band,), or rasters over (band, y, x). [1]
    dead: tuple | None  # the same of dead leaves; None without any
    background: np.ndarray | xr.DataArray  # shape (band,), or a raster over ([band], y, x). [1]
    soil_changes: tuple | None = None  # kernel that makes the background of each cell from a dry one, and its rasters


class Light(NamedTuple):
    """Directions of sun and view, and the diffuse fraction of each band."""

    geometry: Geometry | xr.Dataset
    diffuse_fraction: np.ndarray | xr.DataArray


class EvenCanopy(NamedTuple):
    """Canopy whose cells differ only in green leaf area."""

    lai: xr.DataArray
    background: tuple
    scene: Scene


def even_canopy(lai, stand, light, exact):
    """EvenCanopy of a scene, or None where other properties vary or no table is used."""
    own = stand.canopy
    by_band = (*stand.leaf, stand.background, light.diffuse_fraction)
    rasters = [each for each in (own.brown, own.crown_cover, *by_band) if isinstance(each, xr.DataArray)]
    varies = rasters or directions.varying(light.geometry)
    if varies or own.brown != 0 or own.crown_cover != 1 or stand.soil_changes is not None or exact:
        return None
    return EvenCanopy(lai, tuple(map(float, stand.background)), _uniform_scene(stand, light))


def canopy_kernel(lai, bands, stand, light, exact=False):
    """Kernel of canopy reflectance, ``kernel(lai, *blocks)`` of shape (band, ...) [1], and its raster arguments."""
    leaves = stand.leaf + (stand.dead or ())
    if not directions.varying(light.geometry) and xr.DataArray not in map(type, leaves):
        return uniform_kernel(partial(scene_reflectance, exact=exact), lai, bands, stand, light)
    if stand.canopy.model != "sail":
        raise ValueError(
            f"model={stand.canopy.model!r} needs one direction of sun and view, and the same leaves in all cells: use "
            "model='sail', or numbers for the angles and leaf optics"
        )
    varying, numbers = shares_of(stand.canopy, CELL_SHARES, lai)
    by_band = [_per_band(each) for each in (light.diffuse_fraction, *leaves)]
    rasters = [_per_band(stand.background, bands), by_band[0], *directions.angles(light.geometry), *by_band[1:]]
    own = stand.canopy
    kernel = partial(_by_cell, own.leaf_angles, own.hotspot, own.crown_shape, tuple(varying), numbers)
    rasters += varying.values()
    return (kernel, rasters) if stand.soil_changes is None else _with_soil(kernel, rasters, *stand.soil_changes)


def light_kernel(lai, bands, stand, light, weights, part):
    """Kernel of the light absorbed in bands, ``kernel(lai, *blocks)`` of shape (k, ...) [1], and its rasters."""
    if stand.canopy.model != "sail":
        raise ValueError(f"absorbed light is computed by SAIL, got model={stand.canopy.model!r}: use method='beer'")
    if xr.DataArray in map(type, stand.leaf + (stand.dead or ())):
        raise ValueError(
            "leaf optics vary by cell, absorbed light needs the same leaves in all cells of a class: use "
            "method='beer', or give leaf_optics of numbers"
        )
    return uniform_kernel(partial(scene_light, weights=weights, part=part), lai, bands, stand, light)


def uniform_kernel(evaluate, lai, bands, stand, light):
    """Kernel and rasters of a function of leaf area, background and Scene with the same leaves and directions."""
    varying, numbers = shares_of(stand.canopy, CELL_SHARES, lai)
    kernel = partial(_uniform, evaluate, _uniform_scene(stand, light), tuple(varying), numbers)
    rasters = [_per_band(stand.background, bands), *varying.values()]
    return (kernel, rasters) if stand.soil_changes is None else _with_soil(kernel, rasters, *stand.soil_changes)


def _with_soil(kernel, rasters, changed, changes):
    """Kernel and rasters, with the background of each cell changed first."""
    return partial(_on_soil, kernel, changed, len(changes)), [*changes, *rasters]


def shares_of(canopy, names, lai):
    """Properties of a canopy as rasters, dims (y, x) from north to south, and as numbers."""
    varying, numbers = {}, {}
    for name in names:
        given = getattr(canopy, name)
        if not isinstance(given, xr.DataArray):
            numbers[name] = float(given)
            continue
        cf.check_units(given, name)
        raster = with_crs_of(north_up(given), lai).rename(name)
        varying[name] = raster.drop_vars(set(raster.coords) - {"y", "x", "spatial_ref"})
    return varying, numbers


def _uniform_scene(stand, light):
    own, at = stand.canopy, light.geometry
    angles, towards = own.leaf_angle_distribution, (at.sza, at.vza, at.raa)
    given = stand.leaf, light.diffuse_fraction, towards, angles, own.hotspot, stand.dead, own.crown_shape
    return uniform_scene(*given)._replace(model=own.model)


def _on_soil(kernel, changed, count, lai, *blocks):
    """Reflectance over a background that is first changed from the dry one."""
    changes, (background, *others) = blocks[:count], blocks[count:]
    return kernel(lai, changed(background, *changes), *others)


def _uniform(evaluate, scene, varying, numbers, lai, background, *shares):
    """Result for one direction of sun and view, and the same leaf optics in all cells."""
    # apply_ufunc hands the bands over as the last axis.
    bands_first = background.transpose(-1, *range(background.ndim - 1))
    lai = check_map(lai)
    scene = with_shares(scene, lai.shape, **numbers, **dict(zip(varying, shares, strict=True)))
    return evaluate(lai, bands_first, scene)


def _by_cell(
    leaf_angles, hotspot, crown_shape, varying, numbers, lai, ground, sky, sza, saa, vza, vaa, *optics
):  # fmt: skip
    """Reflectance where the directions of sun or view, or the leaves, vary from cell to cell."""
    count = len(optics) - len(varying)
    leaf, dead = optics[:2], optics[2:count] or None
    by_name = numbers | dict(zip(varying, optics[count:], strict=True))
    shares = [by_name[name] for name in CELL_SHARES]
    towards = sza, vza, relative_azimuth(saa, vaa)
    lai = check_map(lai)
    return directional_reflectance(lai, leaf, ground, sky, towards, leaf_angles, hotspot, dead, crown_shape, shares)


def shares_in_words(canopy, names=CELL_SHARES):
    """Text of the shares that differ from the defaults, for the history, ending in a comma and a space if not empty."""
    texts = []
    for name in names:
        value = getattr(canopy, name)
        if isinstance(value, xr.DataArray):
            texts.append(f"{name} by cell, ")
        elif value != NUMERIC_PROPERTIES[name].default:
            texts.append(f"{name} {value:g}, ")
    return "".join(texts)


def _per_band(values, bands=None):
    """Raster, or values of each band as one, without band names; backgrounds in the order of some bands."""
    if not isinstance(values, xr.DataArray):
        return xr.Variable("band", np.asarray(values, float))
    values = values if bands is None else _background_bands(values, bands)
    return values.drop_vars("band", errors="ignore")


def _background_bands(background, bands):
    """Background with one band for each band of the canopy."""
    cf.check_units(background, "surface_reflectance")
    if "band" not in background.dims:
        return background.expand_dims(band=list(bands))
    known = background["band"].to_numpy().tolist()
    if missing := [name for name in bands if name not in known]:
        raise ValueError(f"the background lacks band {', '.join(missing)}, it has {', '.join(map(str, known))}")
    # Not copied if possible: classes share the backgrounds that share memory.
    return background if known == list(bands) else background.sel(band=list(bands))


ABSORBING = ("leaf_angles", *CELL_SHARES)  # properties of the canopy that the light absorbed by its leaves depends on


def level_reflectance(lai, bands, stand, light, exact=False, attrs=MappingProxyType({})):
    """Reflectance factor of a canopy over its background on flat ground, dims (band, y, x). [1]"""
    lai = checked_scene(lai)
    kernel, rasters = canopy_kernel(lai, list(map(attrgetter("name"), bands)), stand, light, exact)
    varies = directions.varying(light.geometry)
    cells = lai.drop_vars(varies, errors="ignore") if varies else lai
    out = chunking.pointwise(kernel, cells, *rasters, bands=len(bands))
    below = stand.background
    below = "raster" if isinstance(below, xr.DataArray) else ",".join(map("{:g}".format, below))
    attrs = {"background": below} | dict(attrs)
    shares, angles = shares_in_words(stand.canopy), stand.canopy.leaf_angle_distribution.name
    out = _labelled(out, lai, bands, light.geometry, angles, shares, attrs, _NAMES[stand.canopy.model])
    return out if isinstance(out.data, np.ndarray) else with_origin(out, even_canopy(lai, stand, light, exact))


def reflectance_of_classes(lai, cover, bands, stands, light, exact=False, attrs=MappingProxyType({})):
    """Reflectance factor of several classes on flat ground, dims (band, y, x), with the bits of each class. [1]"""
    lai = checked_scene(lai)
    kernels, distinct = {}, []
    for code, stand in stands.items():
        alike = [kernel for other, kernel in distinct if _same(stand, other)]
        kernels[code] = alike[0] if alike else canopy_kernel(lai, [band.name for band in bands], stand, light, exact)
        distinct.append((stand, kernels[code]))
    out = by_class(kernels, cover, lai, bands=len(bands))
    angles = dict.fromkeys(each.canopy.leaf_angle_distribution.name for each in stands.values())
    models = " and ".join(dict.fromkeys(_NAMES[each.canopy.model] for each in stands.values()))
    attrs = {"background": "by class"} | dict(attrs)
    return _labelled(out, lai, bands, light.geometry, " and ".join(angles), "", attrs, models)


def same_properties(one, other, names):
    """Whether two canopies agree in some properties."""
    return all(_same(getattr(one, name), getattr(other, name)) for name in names)


def _same(one, other):
    """Whether two values are known to be equal; rasters must be identical objects."""
    if one is other:
        return True
    if isinstance(one, Canopy) and isinstance(other, Canopy):
        return same_properties(one, other, ("model", "hotspot", "crown_shape", *ABSORBING))
    if isinstance(one, tuple | list):
        return isinstance(other, tuple | list) and len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and np.array_equal(one, other)
    return isinstance(one, str | float | int) and isinstance(other, str | float | int) and one == other


_NAMES = {"sail": "SAIL", "discrete-ordinates": "discrete ordinates"}  # names of the models in a history


def _labelled(reflectance, lai, bands, geometry, angles, shares, attrs, model):
    """Reflectance of a scene with its bands, grid, directions and attributes."""
    names, wavelengths = zip(*map(attrgetter("name", "wavelength"), bands), strict=True)
    coordinates = cf.band_coordinates(band=names, wavelength=wavelengths) | directions.coordinates_of(geometry)
    out = grids.place(reflectance, grids.geobox(lai), coordinates)
    zeniths = []
    for name in ("sza", "vza"):
        angle = getattr(geometry, name)
        zeniths.append(f"{name} varying" if np.ndim(angle) else f"{name} {angle:.2f}")
    history = f"surface_reflectance: {model}, {angles} leaves, {shares}{', '.join(zeniths)}"
    return cf.label(out, "surface_reflectance", source=lai, history=history, leaf_angles=angles, **attrs)


def canopy_fpar(lai, canopy, *, geometry=None, time=None, fpar_inf=layers.FPAR_INF, leaves="all"):
    """Labelled FPAR of a canopy or its green leaves, dims (y, x), [Friedl1995]_, Eq. 6. [1]"""
    geometry = directions.given_geometry(geometry, lai, time)
    if "sza" in directions.varying(geometry):
        directions.uniform_geometry(geometry, "fpar")
    lai = checked_scene(lai)
    kernel, rasters = fpar_kernel(lai, canopy, geometry, fpar_inf, leaves)
    out = grids.place(chunking.pointwise(kernel, lai, *rasters), grids.geobox(lai))
    of = "" if leaves == "all" else "green leaves, "
    extinction = layers.extinction_coefficient(float(geometry.sza), canopy.leaf_angles)
    shares = shares_in_words(canopy, _absorbing(leaves))
    history = f"fpar: Beer's law, {of}{shares}K {float(extinction):.4f}, limit {fpar_inf:g}"
    return cf.label(out, "green_fpar" if leaves == "green" else "fpar", source=lai, history=history)


def fpar_kernel(lai, canopy, geometry, fpar_inf=layers.FPAR_INF, leaves="all"):
    """Kernel of the fraction absorbed by a canopy, ``kernel(lai, *blocks)``, and its raster arguments. [1]"""
    sza = float(geometry.sza)
    extinction = float(layers.extinction_coefficient(sza, canopy.leaf_angles))
    varying, numbers = shares_of(canopy, _absorbing(leaves), lai)
    return partial(_fpar, extinction, fpar_inf, sza, tuple(varying), numbers), list(varying.values())


def _absorbing(leaves):
    """Properties on which absorption by all or by green leaves depends."""
    return CELL_SHARES if leaves == "green" else ("crown_cover",)


def _fpar(extinction, fpar_inf, sza, varying, numbers, lai, *blocks):
    """FPAR of cells whose shares are numbers or blocks of the rasters that vary."""
    shares = numbers | dict(zip(varying, blocks, strict=True))
    lai, cover = check_map(lai), shares["crown_cover"]
    is_closed = not isinstance(cover, np.ndarray) and cover == 1
    if not is_closed:
        check_crowns(lai, cover)
    inside = lai if is_closed else lai_in_crowns(lai, cover)
    if "brown" in shares:
        absorbed = layers.green_fpar(inside, extinction, shares["brown"], shares["dissociation"], fpar_inf)
    else:
        absorbed = layers.beer_fpar(inside, extinction, fpar_inf)
    return absorbed if is_closed else crown_shares(cover, SHAPE, sza, 0.0, 0.0).sun * absorbed


def checked_scene(lai):
    """Check the unit, dimensions and grid of a leaf area raster, dims (y, x). [m2 m-2]"""
    cf.check_quantity(lai, "lai")
    if set(lai.dims) != {"y", "x"}:
        raise ValueError(f"leaf area index has dimensions (y, x), got {lai.dims}: select one layer with .isel or .sel")
    grids.geobox(lai)
    cf.check_words(str(lai.name or "the raster"), (lai.name, lai.attrs.get("long_name")), "lai")
    if isinstance(lai.data, np.ndarray) and lai.size:
        if not np.isfinite(lai.values).any():
            raise ValueError(
                "all cells of the leaf area index are NaN: check the nodata value and the extent of the map"
            )
        # Scenes and maps made by fifesim have this attribute and were checked when they were made.
        if "lai_distribution" not in lai.attrs:
            warn_of_large(lai.values)
    if lai.dtype.kind in "iu":
        warn_of_integers(lai.name or "the raster")
    return lai
