"""Landscapes: canopies of all classes and cells, apparent reflectance in one pass, and block means."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from numbers import Number
from types import MappingProxyType
from typing import Annotated, NamedTuple

import numpy as np
import xarray as xr

from fifesim.analysis import scaling_labels
from fifesim.atmosphere.coupling import apparent_reflectance, apparent_reflectance_of_cell
from fifesim.base.arguments import Metres
from fifesim.base.arrays import compiled
from fifesim.base.footprints import Spread
from fifesim.base.messages import warn
from fifesim.chain import coupled_ground
from fifesim.grids import cf
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.classes import NO_CLASS
from fifesim.grids.grid import north_up
from fifesim.grids.inputs import MASKS_TOO, Raster
from fifesim.grids.windows import origin_of
from fifesim.ground.canopy import optics_labels
from fifesim.ground.canopy.interpolation import RUN, table_places, value_at
from fifesim.ground.canopy.labels import BandCanopy, EvenCanopy, even_canopy
from fifesim.ground.canopy.leaf_area import LARGEST_OF_MAPS, check_map
from fifesim.ground.canopy.optics import DEAD_LEAF
from fifesim.ground.canopy.properties import NUMERIC_PROPERTIES, PROPERTIES
from fifesim.ground.canopy.reflectance_table import scene_reflectance, surface_table
from fifesim.ground.canopy.sail_model import upright_reflectance
from fifesim.ground.landscape.classes import CoverClass
from fifesim.ground.landscape.labels import classes_of
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain.lit_slopes import slope_light

_TALLGRASS = {"background": "soil and litter", "brown_leaf": "dead leaves", "leaf_optics": "green leaves"}
"""Optics with FIFE's tallgrass as default."""

_CURES = {
    "background": "give background={'soil_dry': 1.0} or other spectra ([ground.background_spectra] of a scenario)",
    "brown_leaf": "give brown_leaf=fifesim.Leaf(...) ([ground.brown_leaf])",
    "leaf_optics": "give leaf_optics=fifesim.Leaf(...) ([ground.leaf])",
}


def stands_of(classes, canopy, cells=MappingProxyType({})):
    """Canopies of a scene by class code; the code is None without classes."""
    if not classes:
        return {None: canopy.replace(**cells) if cells else canopy}
    return {kind.code: kind.canopy.over(canopy).replace(**cells) for kind in classes}


def warn_of_tallgrass(scene, classes, canopy, cells=MappingProxyType({})):
    """Warn if the default optics of FIFE's tallgrass are used for a scene at another site."""
    bare = {kind.code for kind in classes if isinstance(kind.lai, Number) and kind.lai == 0}
    taken = set()
    for code, stand in stands_of(classes, canopy, cells).items():
        dead = isinstance(stand.brown, xr.DataArray) or stand.brown != 0
        needed = {"background": True, "leaf_optics": code not in bare, "brown_leaf": dead and code not in bare}
        taken |= {name for name, is_needed in needed.items() if is_needed and getattr(stand, name) is None}
    if taken:
        warn(
            f"the vegetation of {scene} is unknown: using FIFE's tallgrass for "
            f"{', '.join(_TALLGRASS[name] for name in sorted(taken))}; "
            f"{'; '.join(_CURES[name] for name in sorted(taken))}"
        )


def seen_through_air(reflectance, coupling="lambert", *air):
    """Function that computes the top-of-atmosphere reflectance of a lazy surface reflectance in one pass, or None."""
    # None if cells differ in more than leaf area and background. Results are identical to the two separate steps.
    canopy = origin_of(reflectance)
    if coupling != "lambert":
        if not isinstance(canopy, EvenCanopy):
            raise ValueError(
                f"coupling={coupling!r} needs the ground in more than one direction, the raster holds one reflectance "
                "factor: give surface_reflectance(..., streams='directional'), or take coupling='lambert'"
            )
        return lambda terms: coupled_ground.toa_of_canopy(canopy, coupling, *air)
    if not isinstance(canopy, EvenCanopy):
        return None

    def made(terms):
        by_band = {name: tuple(map(float, values)) for name, values in terms.uniform.items()}
        kernel = partial(seen_reflectance, background=canopy.background, scene=canopy.scene, terms=by_band)
        return chunking.pointwise(kernel, canopy.lai, bands=reflectance.sizes["band"])

    return made


def seen_reflectance(lai, *, background, scene, terms):
    """Apparent reflectance of a canopy at the top of the atmosphere, from its table, shape (band, y, x). [1]"""
    cells, table = np.ascontiguousarray(lai, float), surface_table(background, scene)
    out = np.empty((table.coefficients.shape[1], cells.size))
    if _seen(cells.reshape(-1), table, np.array(list(terms.values())), out):
        # These functions raise a specific error.
        ground = scene_reflectance(check_map(lai), np.array(background), scene)
        return apparent_reflectance(ground, **{name: np.array(each)[:, None, None] for name, each in terms.items()})
    return out.reshape(-1, *cells.shape)


# Without transmitted light, division by zero gives infinity as in numpy.
@compiled
def _seen(lai, table, terms, out):
    """Fill in the apparent reflectance; return whether any leaf area or reflectance is invalid."""
    interval, share, ground = np.empty(RUN, np.int64), np.empty(RUN), np.empty(RUN)
    refused = False
    for first in range(0, lai.size, RUN):
        cells = lai[first : first + RUN]
        table_places(cells, table, interval, share)
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


def upright_plants(level, land, canopies, light, sun):
    """Reflectance of upright plants on the slopes of a Sunlight, dims (band, y, x), with the cells of each class."""
    data, cells = None, land.lai.transpose("y", "x")
    for code, stand in canopies.items():
        even = even_canopy(land.lai, stand, light, False)
        if even is None or even.scene.model != "sail":
            raise ValueError(
                "slopes='upright' needs cells of a class that differ in leaf area only, and SAIL: leave out dead "
                "leaves, crowns and rasters of the canopy, or take slopes='kt'"
            )
        own = cells if land.cover is None else cells.where(land.cover.transpose("y", "x") == code)
        given = sun.dem, sun.horizon, sun.geometry, own
        found = terrain_labels.on_slopes(partial(_upright, even), *given, leading=(level.sizes["band"],))
        data = found if data is None else np.where(np.isnan(data), found, data)
    return terrain_labels.labelled_slopes(data, level, sun, "terrain: upright plants (SAIL on slopes)")


# Cells of upright plants at once, so that intermediate results stay in the processor cache.
_AT_ONCE = 2**14


def _upright(canopy, lai, elevation, sky, cell, seen):
    """Reflectance of upright plants in cells, shape (band, rows, columns). [1]"""
    light, scene = slope_light(elevation, sky, cell, seen), canopy.scene
    known = ~np.isnan(check_map(lai) + light.cosine)
    bands = [np.array(each)[:, None] for each in (scene.leaf_reflectance, scene.leaf_transmittance, canopy.background)]
    given = {name: getattr(scene, name) for name in ("sza", "vza", "raa", "leaf_angles", "hotspot")}
    given["diffuse_fraction"] = np.array(scene.sky)[:, None]
    cells = lai, light.cosine, light.mu_s_local, light.upwelling * seen.mu_v, light.sky_view
    cells = [each[known] for each in cells]
    found = np.empty((len(scene.sky), cells[0].size))
    for start in range(0, cells[0].size, _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        area, cosine, sun, view, sky_view = (each[part] for each in cells)
        found[:, part] = upright_reflectance(
            area, *bands, **given, cosine=cosine, mu_s_local=sun, mu_v_local=view, sky_view=sky_view
        )
    out = np.full((len(found), *lai.shape), np.nan)
    out[:, known] = found
    return out


class Land(NamedTuple):
    """Parts of a scene: leaf area, codes and descriptions of its classes, and other properties of its cells."""

    lai: xr.DataArray
    cover: xr.DataArray | None = None
    classes: tuple[CoverClass, ...] = ()
    cells: Mapping = MappingProxyType({})


def land_of(scene):
    """Split a scene into its parts; the leaf area of a landscape, taken from its Dataset, causes a warning."""
    if not isinstance(scene, xr.Dataset):
        if others := scene.attrs.get("landscape"):
            warn(
                f"{scene.name or 'the raster'} is leaf area of a landscape with {others}, which this call leaves out: "
                "call the method of the Dataset, such as land.fifesim.surface_reflectance(instrument), or, if only "
                "leaf area is to vary, remove .attrs['landscape']"
            )
            scene = scene.copy(deep=False)
            del scene.attrs["landscape"]
        return Land(scene)
    if "lai" not in scene.data_vars:
        raise ValueError(
            f"a landscape needs a variable lai, this Dataset has {', '.join(map(str, scene.data_vars)) or 'none'}: "
            "make it with fifesim.landscape(grid, ...), or rename one with .rename(LAI='lai')"
        )
    cells = {name: scene[name] for name in NUMERIC_PROPERTIES if name in scene.data_vars}
    cells = {name: each if each.ndim else float(each) for name, each in cells.items()}
    if "cover" not in scene.data_vars:
        return Land(scene["lai"], cells=cells)
    return Land(scene["lai"], north_up(scene["cover"]), classes_of(scene["cover"]), cells)


def canopies_of(land, responses, canopy, exact=False):
    """Canopies of a scene with their optics for spectral responses, by class code, which is None without classes."""
    check_used(land, canopy)
    known, found, leaf_optics = {}, {}, partial(optics_labels.leaf_optics, exact=exact)

    def once(name, make, given):
        # Stands share optics. Keep the argument as well, so that its id is not reused.
        if (name, id(given)) not in known:
            known[name, id(given)] = given, make(responses, given, land.lai)
        return known[name, id(given)][1]

    for code, stand in stands_of(land.classes, canopy, land.cells).items():
        leaf, dead, changed = once("leaf_optics", leaf_optics, stand.leaf_optics), None, None
        below = once("background", optics_labels.background, stand.background)
        if isinstance(stand.brown, xr.DataArray) or stand.brown != 0:
            dead = once("leaf_optics", leaf_optics, DEAD_LEAF if stand.brown_leaf is None else stand.brown_leaf)
        changes = optics_labels.changes_of(stand)
        if xr.DataArray in map(type, changes.values()):
            key = *changes, *map(id, changes.values())
            if key not in known:
                known[key] = optics_labels.soil_kernel(responses, land.lai, **changes)
            changed = known[key]
        elif changes:
            below = optics_labels.as_it_lies(responses, below, land.lai, **changes)
        found[code] = BandCanopy(stand, leaf, dead, below, changed)
    return found


def check_used(land, canopy):
    """Raise ValueError if a given property would have no effect."""
    for name in canopy.given:
        value, default = getattr(canopy, name), PROPERTIES[name].default
        if isinstance(value, str | int | float) and value == default:
            continue
        if name in land.cells:
            raise ValueError(f"{name} is given and also a variable of the landscape: remove one of them")
        if land.classes and all(name in each.canopy.given for each in land.classes):
            raise ValueError(f"{name} is given and also defined by all classes of the landscape: remove one of them")


def aggregate(
    array: Annotated[Raster, MASKS_TOO], pixel: Metres = 30.0, *, min_valid: float = 0.98, lsf: Spread | None = None
) -> Raster:
    """
    Means over square blocks of ground, the truth for comparison with pixels.

    Parameters
    ----------
    array : xarray.DataArray, dims (..., y, x), or xarray.Dataset
        In a landscape, ``brown`` is weighted by leaf area, and the codes of ``cover`` are counted.
    pixel : float, optional
        Size of the blocks; it need not be a multiple of the cell size. [m]
    min_valid : float, optional
        Minimum fraction of the block area on valid cells; below it the result is NaN. [1]
    lsf : line spread function, optional
        Weights of the cells around the block centre, from `fifesim.base.footprints`; by default uniform within the
        block.

    Returns
    -------
    means : xarray.DataArray, dims (..., y, x), or xarray.Dataset
        On a grid of whole blocks from the upper left corner. In a landscape, ``class_share`` over (class, y, x)
        replaces ``cover``.

    Raises
    ------
    ValueError
        If the array has no grid, or no block fits.
    TypeError
        If the size is not a number.

    Warns
    -----
    UserWarning
        If whole blocks do not fill the raster.

    See Also
    --------
    fifesim.sense, fifesim.regress

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> lai.fifesim.aggregate(30).shape
    (10, 10)
    """
    if isinstance(array, xr.Dataset):
        return xr.Dataset(block_averages(array.data_vars, pixel, min_valid, lsf), attrs=array.attrs)
    means = scaling_labels.aggregate_blocks(array, pixel, min_valid=min_valid, lsf=lsf)
    cells = grids.geobox(north_up(array))
    cure = "choose a pixel that divides the raster, or crop the raster with .isel"
    grids.whole_shape(np.multiply(cells.shape, grids.cell_size(cells)), (pixel, pixel), cure)
    return means


def block_averages(rasters, pixel, min_valid, lsf=None):
    """Means of the rasters of a landscape by name, as `aggregate` of a Dataset, whose assembly takes longer."""
    by_cell = {name: each for name, each in rasters.items() if {"y", "x"} <= set(each.dims)}
    kept = {name: each for name, each in rasters.items() if name != "cover"}
    mean = partial(aggregate, pixel=pixel, min_valid=min_valid, lsf=lsf)
    out = {name: mean(each) if name in by_cell else each for name, each in kept.items()}
    if "brown" in by_cell and "lai" in by_cell:
        dead = mean(rasters["lai"] * rasters["brown"]) / out["lai"]
        out["brown"] = out["brown"].copy(data=dead.where(out["lai"] != 0, 0.0).data)
    if "cover" in by_cell:
        out["class_share"] = _class_shares(rasters["cover"], mean)
    return out


def _class_shares(cover, mean):
    """Area share of each class."""
    table = classes_of(cover)
    known = cover.where(cover != NO_CLASS)
    shares = [mean((known == each.code).where(known.notnull())) for each in table]
    names = xr.Variable("class", [each.name for each in table])
    out = xr.concat(shares, dim=names, coords="minimal", compat="override", combine_attrs="override")
    out = grids.place(out, grids.geobox(shares[0]))
    return cf.label(out, "class_share", source=cover, history="aggregate: shares of classes")
