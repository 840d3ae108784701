"""Landscapes: Datasets of what a ground scene is made of, on one grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from numbers import Number
from typing import Annotated, TypeAlias

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.annotations import Chunks, FilePath, WholeNumber
from fifesim.base.kinds import ANYTHING, UNCHECKED, described, is_path
from fifesim.base.seeds import check_seed
from fifesim.ground.canopy.soil import check_brightness
from fifesim.ground.landscape.autoregression import check_arp
from fifesim.ground.landscape.classes import CoverClass, class_table, fife_classes
from fifesim.ground.landscape.compression import numbers_of
from fifesim.ground.landscape.cover import Patches
from fifesim.ground.landscape.distribution import lai_distribution
from fifesim.ground.landscape.drawn import Field
from fifesim.ground.landscape.field import TILE, streaming_field
from fifesim.ground.landscape.quantiles import NODES, quantile_map_of_classes, quantile_table
from fifesim.ground.landscape.raster import lai_window
from fifesim.ground.landscape.rasters.cover import classes_of, cover_map, drawn_cover
from fifesim.ground.landscape.rasters.drawn import drawn_fields
from fifesim.rasters import cf, places
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import FileOrRaster
from fifesim.rasters.directions import Directions
from fifesim.rasters.packed import unpacked
from fifesim.rasters.sites import is_fife, made_on_site
from fifesim.rasters.warp import file_onto_grid, raster_onto_grid

# The functions that take these name what they need in their own messages.
GroundProperty: TypeAlias = Annotated[FilePath | xr.DataArray | Field | float, ANYTHING]
Cover: TypeAlias = Annotated[Patches | FilePath | xr.DataArray, UNCHECKED]
Classes: TypeAlias = Annotated[CoverClass | Sequence[CoverClass] | Mapping[str, CoverClass], UNCHECKED]

FIFE_PASTURES = Patches("pastures", 1200.0)
"""Of the default landscape: rectangles of 144 ha on average, as large as ranches of the Flint Hills fence them."""

_REFERENCE = "Friedl et al. (1995), doi:10.1016/0034-4257(95)00156-5"


def landscape(
    grid: GeoBox,
    *,
    cover: Cover | None = None,
    classes: Classes | None = None,
    lai: FileOrRaster | None = None,
    arp: float = 0.15,
    brown: GroundProperty | None = None,
    crown_cover: GroundProperty | None = None,
    soil: GroundProperty | None = None,
    moisture: GroundProperty | None = None,
    covary: Mapping[str, float] | None = None,
    dem: xr.DataArray | None = None,
    reference: Mapping[str, xr.DataArray] | None = None,
    geometry: Directions | None = None,
    seed: WholeNumber = 0,
    chunks: Chunks | None = None,
    allow_remote: bool = False,
) -> xr.Dataset:
    """
    A landscape: leaf area and classes of cover, and what else a ground scene is made of, on one grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of ground cells, in a projected CRS.
    cover : Patches, str, path or xarray.DataArray, optional
        How the classes lie: patches that are drawn, or a map of whole numbers, a raster file or what rioxarray has
        opened, in any CRS; cells no larger than the map's have its nearest class, larger ones the most frequent. By
        default one class is everywhere, and FIFE's three treatments lie in pastures.
    classes : CoverClass, sequence of CoverClass, or mapping of str to CoverClass, optional
        What the classes are; by default those that a raster of cover carries, or `fife_classes` of what is drawn.
    lai : xarray.DataArray, str or path, optional
        Your own leaf area, as `open_lai` takes it, in the place of the classes' distributions. [m2 m-2]
    arp : float, optional
        Autoregressive parameter of the classes that say none, in [0, 0.2498]. [1]
    brown, crown_cover, soil, moisture : float, Field, xarray.DataArray, str or path, optional
        Share of dead leaf area, share of the ground below crowns, brightness of the soil and its moisture, as
        `surface_reflectance` takes them, in the place of the classes': a number, a `Field` that is drawn, or a map. [1]
    covary : dict of str to float, optional
        Correlations of leaf area with ``elevation``, ``wetness``, ``illumination`` and ``slope``, and with what is
        drawn, such as ``{"wetness": 0.5, "soil": -0.4}``: those of standard normal scores at the same cell. [1]
    dem : xarray.DataArray, dims (y, x), optional
        Elevation on the grid, where ``covary`` names something of it. [m]
    reference : dict of str to xarray.DataArray, optional
        As in `correlated_fields`: the same of a larger ground, of which the grid is a window.
    geometry : Geometry, optional
        Of the sun, where ``covary`` names the illumination.
    seed : int, optional
        In [0, 2**63).
    chunks : mapping or int or "auto", optional
        Makes the landscape lazy.
    allow_remote : bool, optional
        Take addresses, and formats that lead to other files: only for what you trust.

    Returns
    -------
    land : xarray.Dataset
        ``lai`` [m2 m-2] and ``cover``, codes of classes by ``flag_values`` and ``flag_meanings`` with -1 for no data,
        over (y, x), and the others where they are given. ``land.fifesim.surface_reflectance(instrument)`` takes it.

    Raises
    ------
    ValueError
        If the grid, arp, seed, a class or its share is not one allowed, correlations cannot be, a deviation is too
        large, a map is not usable, or a class has no leaf area; of a lazy map when it computes, if it has a code
        without a class.
    TypeError
        If an argument is of another kind.

    Notes
    -----
    Every variable is a function of the seed and of place: a window is a slice of the whole, and chunks change nothing.
    Leaf area of all classes comes from one white noise, filtered with each class's arp and mapped to its distribution.
    A fence is so a change of density and of texture on ground that goes on: dense spots of one treatment are dense
    spots of the other, as deep soil is on both sides of a fence, and landscapes of one seed differ by their classes
    and not by chance.

    References
    ----------
    [Friedl1995]_, Fig. 2

    See Also
    --------
    fifesim.ground.landscape.cover.patch_classes, fifesim.ground.landscape.field.streaming_field

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> land = fifesim.landscape(grid, soil=fifesim.Field(sd=0.03, arp=0.24), seed=7)
    >>> sorted(land.data_vars)
    ['cover', 'lai', 'soil']
    >>> land.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"]).dims
    ('band', 'y', 'x')
    """
    grid = grids.check_grid(grid)
    check_arp(arp)
    seed = check_seed(seed)
    given = {"brown": brown, "crown_cover": crown_cover, "soil": soil, "moisture": moisture}
    given = {name: each.mean if isinstance(each, Field) and not each.sd else each for name, each in given.items()}
    drawn = {name: each for name, each in given.items() if isinstance(each, Field)}
    options = {"seed": seed, "dem": dem, "reference": reference, "geometry": geometry, "chunks": chunks}
    if covary and lai is not None:
        raise ValueError("lai is a map, which goes with the ground as it does: leave covary out, or the map")
    variables = {
        name: _property(name, each, grid, chunks, allow_remote)
        for name, each in given.items()
        if each is not None and name not in drawn
    }
    if classes is not None or cover is not None or lai is None:
        table = class_table(_default_classes(cover) if classes is None else classes)
        variables["cover"] = _cover(grid, cover, table, seed, chunks, allow_remote)
    arps = [arp if lai is not None or each.arp is None else each.arp for each in (table if lai is None else [None])]
    scores, made = drawn_fields(grid, drawn, covary, arps, **options)
    if lai is None:
        variables["lai"] = _lai(grid, variables["cover"], table, arp, seed, scores)
    else:
        variables["lai"] = _own_lai(lai, grid, chunks, allow_remote)
    variables |= made
    order = [name for name in ("lai", "cover", *given) if name in variables]
    site = {key: variables["lai"].attrs[key] for key in ("site",) if key in variables["lai"].attrs}
    return xr.Dataset({name: variables[name] for name in order}, attrs=site)


def _own_lai(lai, grid, chunks, allow_remote):
    """Leaf area of a user; a scene that was made on the FIFE site stays one."""
    found = lai_window(lai, grid, chunks, allow_remote=allow_remote)
    made = made_on_site(grid) if isinstance(lai, xr.DataArray) and is_fife(lai) else {}
    return found.assign_attrs(made)


def _default_classes(cover):
    """Classes of a cover where none are given: its own, or FIFE's where it is drawn."""
    if cover is None or isinstance(cover, Patches):
        return fife_classes()
    if isinstance(cover, xr.DataArray) and "classes" in cover.attrs:
        return classes_of(cover)
    raise ValueError("a map of cover needs classes=, such as [fifesim.CoverClass('grass', lai=1.2, code=1), ...]")


def _cover(grid, cover, table, seed, chunks, allow_remote):
    """Codes of the classes."""
    if cover is None:
        if len(table) > 1 and [each.name for each in table] != list(fife_classes()):
            raise ValueError(
                f"nothing says how the {len(table)} classes lie: give cover= a map of their codes, or for instance "
                'fifesim.Patches("voronoi", size=300)'
            )
        cover = FIFE_PASTURES
    if isinstance(cover, Patches):
        return drawn_cover(grid, cover, table, seed, chunks)
    if not (isinstance(cover, xr.DataArray) or is_path(cover)):
        raise TypeError(f"cover must be a fifesim.Patches, the path of a map or a raster, got {described(cover)}")
    return cover_map(cover, grid, table, chunks, allow_remote=allow_remote)


def _lai(grid, cover, table, arp, seed, scores):
    """Leaf area of each class, from its own distribution and arp; of scores by arp where it goes with the ground."""
    lacking = [each.name for each in table if each.lai is None]
    if lacking:
        raise ValueError(
            f"class {', '.join(lacking[:8])} has no leaf area: type CoverClass(..., lai='burned-grazed'), or a number "
            "where it is uniform, or give landscape(lai=) a raster"
        )
    codes = tuple(each.code for each in table)
    # The last is of cells without a class.
    tables = np.stack([*(_quantiles(each.lai) for each in table), np.full(NODES, np.nan)])
    arps = [arp if each.arp is None else each.arp for each in table]
    # What streaming_field refuses is known before anything lazy is built.
    for of_class in arps:
        streaming_field(seed, of_class, 0, 0, (0, 0))
    plain = cover.copy(deep=False)
    plain.attrs = {}
    if scores:
        kernel = partial(_leaf_area_of_scores, codes, tables, arps, tuple(scores))
        lai = grids.place(chunking.pointwise(kernel, plain, *scores.values()), grid)
    else:
        kernel = partial(_leaf_area, codes, tables, arps, seed, grids.lattice_position(grid))
        lai = grids.place(places.located(kernel, plain, tile=TILE), grid)
    history = "\n".join([cover.attrs["history"], f"landscape: leaf area of {len(table)} classes, seed {seed}"])
    made = {"arp": float(arp), "rng_seed": str(seed), "lai_distribution": "by class"} | made_on_site(grid)
    return cf.label(lai, "lai", history=history, **made, method="streaming", references=_REFERENCE)


def _quantiles(lai):
    """Quantiles of a distribution; of a number that all cells have, it alone."""
    if isinstance(lai, Number):
        return np.full(NODES, float(lai))
    return quantile_table(lai_distribution(lai))


def _leaf_area(codes, tables, arps, seed, lattice, cover, starts):
    """Leaf area of a block of codes that begins at some row and column of the grid."""
    row, column = (first + start for first, start in zip(lattice, starts, strict=True))
    return _of_fields(codes, tables, arps, cover, lambda arp: streaming_field(seed, arp, row, column, cover.shape))


def _leaf_area_of_scores(codes, tables, arps, scored, cover, *scores):
    """Leaf area of cells from the standard normal scores of each arp."""
    return _of_fields(codes, tables, arps, cover, dict(zip(scored, scores, strict=True)).__getitem__)


def _of_fields(codes, tables, arps, cover, field_of):
    """Leaf area of cells; ``field_of(arp)`` gives standard normal deviates, and is asked where a class needs them."""
    numbers, present = numbers_of(cover, codes)
    varies = (tables[:-1, 0] != tables[:-1, -1]) & present[:-1]
    needed = list(dict.fromkeys(arp for arp, each in zip(arps, varies, strict=True) if each))
    field = field_of(needed[0]) if needed else np.zeros(cover.shape)
    for other in needed[1:]:
        mine = np.array([*(arp == other for arp in arps), False])
        field = np.where(mine[numbers], field_of(other), field)
    return quantile_map_of_classes(field, numbers, tables)


def _property(name, given, grid, chunks, allow_remote):
    """A number, or a raster on the grid, of a property."""
    check = _check_soil if name == "soil" else partial(_check_share, name)
    if isinstance(given, Number):
        return cf.label(xr.DataArray(check(float(given))), name, history=f"landscape: {name} {given:g}")
    if isinstance(given, xr.DataArray):
        found = raster_onto_grid(unpacked(given), grid, chunks)
    elif is_path(given):
        found = file_onto_grid(given, grid, chunks, allow_remote)
    else:
        raise TypeError(
            f"{name} must be a number, a fifesim.Field, the path of a raster or an xarray.DataArray, got "
            f"{described(given)}"
        )
    shares = grids.place(chunking.pointwise(check, found), grid)
    return cf.label(shares, name, history=f"landscape: {name} of a raster")


def _check_soil(values):
    """Refuse what is no brightness of a soil; NaN passes."""
    check_brightness(np.asarray(values))
    return values


def _check_share(name, values):
    """Refuse what is no share; NaN passes."""
    wrong = (np.asarray(values) < 0) | (np.asarray(values) > 1)
    if wrong.any():
        raise ValueError(f"{name} must be in [0, 1], got {np.asarray(values)[wrong].flat[0]:g}: it is a share")
    return values
