"""Landscapes as labelled rasters: cover, leaf area and properties on one grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from numbers import Number
from typing import Annotated, TypeAlias

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import ANYTHING, UNCHECKED, Chunks, FilePath, Kind, WholeNumber, described, is_path
from fifesim.base.lattice import check_seed
from fifesim.grids import cf, windows
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.classes import NO_CLASS, check_codes, numbers_of
from fifesim.grids.inputs import FileOrRaster
from fifesim.grids.sites import is_fife, made_on_site, on_fife_site
from fifesim.grids.source import open_source
from fifesim.grids.warp import onto_grid
from fifesim.ground.canopy.leaf_area import check_share
from fifesim.ground.canopy.soil import check_brightness
from fifesim.ground.landscape import distribution
from fifesim.ground.landscape.autoregression import FIELD_TILE, check_arp, check_streaming_arp, streaming_field
from fifesim.ground.landscape.classes import CoverClass, Field, class_table, fife_classes, read_table, table_text
from fifesim.ground.landscape.cover import Patches, patch_classes
from fifesim.ground.landscape.field_labels import drawn_field
from fifesim.ground.landscape.lai_labels import lai_window
from fifesim.ground.landscape.learned_labels import Landscape
from fifesim.ground.terrain.elevation_labels import flint_hills

# Chunk size for "auto" is a multiple of this. [cell]
_TILE = 1008


def drawn_cover(grid, patches, table, seed, chunks=None):
    """Class codes of a landscape in patches, dims (y, x), int16."""
    cell = min(grids.cell_size(grid))
    if patches.size < cell:
        raise ValueError(
            f"the size of patches must be at least a cell of {cell:g} m, got {patches.size:g} m: "
            "give it in metres, not km"
        )
    shares = patches.shares_of([each.name for each in table])
    codes = np.array([each.code for each in table], np.int16)
    northing, easting = (grids.coordinates(grid)[axis].values for axis in ("y", "x"))

    def cells(row, column, shape):
        place = northing[row : row + shape[0]], easting[column : column + shape[1]]
        return patch_classes(patches, shares, seed, *place, codes)

    history = f"landscape: {patches.pattern} of {patches.size:g} m, seed {seed}"
    cover = windows.tiles(cells, grid, chunks, tile=_TILE, dtype=np.int16)
    return _labelled(cover, table, history, rng_seed=str(seed), **made_on_site(grid))


def cover_map(path_or_raster, grid, table, chunks=None, *, allow_remote=False):
    """Class codes of a user-supplied map on a grid, dims (y, x), int16, -1 where the map has no data."""
    source = open_source(path_or_raster, "cover", allow_remote)
    found = onto_grid(source, grid, chunks, classes=True)
    codes = tuple(each.code for each in table)
    cover = grids.place(chunking.pointwise(check_codes, found, dtype=np.int16, table=codes), grid)
    if cover.chunks is None and not (cover.values != NO_CLASS).any():
        raise ValueError(
            f"the map of cover {source.name} has no data on the grid, which spans {grids.extent(grid)}: look at its "
            "nodata value with gdalinfo -stats"
        )
    return _labelled(cover, table, f"landscape: cover of {source.name}")


def classes_of(cover):
    """Table of the classes in the attributes of a raster of cover."""
    if "classes" not in cover.attrs:
        raise ValueError(
            "the classes of the cover are unknown: make the landscape with fifesim.landscape(grid, "
            "cover=raster, classes=...)"
        )
    return read_table(cover.attrs["classes"])


def _labelled(cover, table, history, **provenance):
    flags = {"flag_values": np.array([each.code for each in table], np.int16)}
    flags |= {"flag_meanings": " ".join(each.name for each in table), "_FillValue": np.int16(NO_CLASS)}
    return cf.label(cover, "cover", history=history, classes=table_text(table), **flags, **provenance)


# Type errors of these are raised with more detail by the functions that use them.
GroundProperty: TypeAlias = Annotated[FilePath | xr.DataArray | Field | float, ANYTHING]
LearnedLandscape: TypeAlias = Annotated[
    FilePath | Landscape, Kind("a fifesim.ground.Landscape, its .json file, or 'konza'")
]
Cover: TypeAlias = Annotated[Patches | FilePath | xr.DataArray, UNCHECKED]
Classes: TypeAlias = Annotated[CoverClass | Sequence[CoverClass] | Mapping[str, CoverClass], UNCHECKED]

# Pasture layout of the default landscape: rectangles of 144 ha on average, typical of ranches in the Flint Hills.
FIFE_PASTURES = Patches("pastures", 1200.0)

_REFERENCE = "Friedl et al. (1995), doi:10.1016/0034-4257(95)00156-5"


def landscape(
    grid: GeoBox,
    *,
    learned: LearnedLandscape | None = None,
    cover: Cover | None = None,
    classes: Classes | None = None,
    lai: FileOrRaster | None = None,
    arp: float | None = None,
    brown: GroundProperty | None = None,
    crown_cover: GroundProperty | None = None,
    soil: GroundProperty | None = None,
    moisture: GroundProperty | None = None,
    dem: xr.DataArray | None = None,
    seed: WholeNumber = 0,
    chunks: Chunks | None = None,
    allow_remote: bool = False,
) -> xr.Dataset:
    """
    Create a landscape: leaf area, land cover classes and other ground properties on one grid.

    By default, leaf area is simulated by a landscape learned from Konza Prairie; ``cover``, ``classes``, ``lai`` or
    ``arp`` replace it.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Grid of the ground cells, in a projected CRS.
    learned : Landscape, str or path, optional
        Learned landscape, its file, or "konza".
    cover : Patches, "pastures", str, path or xarray.DataArray, optional
        Layout of the classes: random patches, or a map of integer codes in any CRS, as a raster file or an array. Cells
        no larger than the map cells take the nearest class, larger cells the most frequent one. "pastures" are the
        three treatments of FIFE between fences. By default a single class covers the grid.
    classes : CoverClass, sequence of CoverClass, or mapping of str to CoverClass, optional
        Properties of the classes; by default from the attributes of a cover raster, or `fife_classes` for random
        patches.
    lai : xarray.DataArray, str or path, optional
        Leaf area map as in `open_lai`, instead of the distributions of the classes. [m2 m-2]
    arp : float, optional
        Autoregressive parameter of classes without one, in [0, 0.2498]; by default 0.15. [1]
    brown, crown_cover, soil, moisture : float, Field, xarray.DataArray, str or path, optional
        Dead fraction of the leaf area, crown cover, soil brightness and soil moisture, as in `surface_reflectance`: a
        number, a `Field` for a random field, or a map. They replace the values of the classes. [1]
    dem : xarray.DataArray, dims (y, x), optional
        Elevation on the grid, or on the grid `Landscape.around`, which a learned landscape follows. By default
        `flint_hills` of the same seed on the FIFE site, and level ground elsewhere. [m]
    seed : int, optional
        Seed of the random fields, in [0, 2**63).
    chunks : mapping or int or "auto", optional
        Chunks of a lazy landscape; in memory by default.
    allow_remote : bool, optional
        Also open remote files and formats that refer to other files. Use this only for trusted files.

    Returns
    -------
    land : xarray.Dataset
        ``lai`` [m2 m-2] and ``cover``, class codes with ``flag_values`` and ``flag_meanings`` and -1 for no data, over
        (y, x), and the other properties if given. Pass it on with ``land.fifesim.surface_reflectance(instrument)``.

    Raises
    ------
    ValueError
        If the grid, arp, seed, a class or its area fraction is invalid; a standard deviation is too large; a map is
        invalid; or a class has no leaf area. A lazy map with a code without a class raises when it is computed.
    TypeError
        If an argument has the wrong type.

    Notes
    -----
    All variables depend only on seed and position, so a window equals a slice of the whole, for any chunks. All classes
    share one noise field: patterns continue across their borders, where only distribution and texture change.

    References
    ----------
    [Friedl1995]_, Fig. 2

    See Also
    --------
    fifesim.lai_scene, fifesim.learn_landscape, fifesim.CoverClass

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> land = fifesim.landscape(grid, seed=7)
    >>> sorted(land.data_vars)
    ['brown', 'lai', 'moisture', 'soil']
    >>> land.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"]).dims
    ('band', 'y', 'x')
    """
    grid = grids.check_grid(grid)
    seed = check_seed(seed)
    cover = FIFE_PASTURES if isinstance(cover, str) and cover == "pastures" else cover
    others = {"cover": cover, "classes": classes, "lai": lai, "arp": arp}
    others = [name for name, each in others.items() if each is not None]
    if learned is not None and others:
        raise ValueError(
            f"learned and {', '.join(others)} are given: a learned landscape has its own leaf area: remove one of them"
        )
    given = {"brown": brown, "crown_cover": crown_cover, "soil": soil, "moisture": moisture}
    given = {name: each.mean if isinstance(each, Field) and not each.sd else each for name, each in given.items()}
    drawn = {name: each for name, each in given.items() if isinstance(each, Field)}
    variables = {
        name: _property(name, each, grid, chunks, allow_remote)
        for name, each in given.items()
        if each is not None and name not in drawn
    }
    arp = 0.15 if arp is None else arp
    check_arp(arp)
    table: tuple[CoverClass, ...] = ()
    if classes is not None or cover is not None or (others and lai is None):
        table = class_table(_default_classes(cover) if classes is None else classes)
        variables["cover"] = _cover(grid, cover, table, seed, chunks, allow_remote)
    made = {name: drawn_field(name, each, grid, seed, chunks) for name, each in drawn.items()}
    if not others:
        variables = _learned(grid, learned, dem, seed, chunks) | variables
    elif lai is None:
        variables["lai"] = _lai(grid, variables["cover"], table, arp, seed)
    else:
        variables["lai"] = lai_window(lai, grid, chunks, allow_remote=allow_remote)
        if isinstance(lai, xr.DataArray) and is_fife(lai):
            variables["lai"] = variables["lai"].assign_attrs(made_on_site(grid))
    variables |= made
    order = [name for name in ("lai", "cover", *given) if name in variables]
    # Functions that get the leaf area alone warn of the properties that they do not see.
    if beside := [name for name in order[1:] if name != "cover" or any(each.canopy.given for each in table)]:
        variables["lai"].attrs["landscape"] = ", ".join(beside)
    site = {key: variables["lai"].attrs[key] for key in ("site",) if key in variables["lai"].attrs}
    return xr.Dataset({name: variables[name] for name in order}, attrs=site)


def _learned(grid, learned, dem, seed, chunks):
    """Variables of a learned landscape, on synthetic hills if it is on the FIFE site and its elevation is unknown."""
    land = learned if isinstance(learned, Landscape) else Landscape.read("konza" if learned is None else learned)
    if dem is None and on_fife_site(grid):
        dem = flint_hills(land.around(grid), seed, chunks=chunks)
    return dict(land.simulate(grid, dem, seed=seed, chunks=chunks).data_vars)


def _default_classes(cover):
    """Default classes of a cover: from its attributes, or the classes of FIFE for patches."""
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
                f"the layout of the {len(table)} classes is unknown: give cover= a map of their codes, or for instance "
                'fifesim.ground.Patches("voronoi", size=300)'
            )
        cover = FIFE_PASTURES
    if isinstance(cover, Patches):
        return drawn_cover(grid, cover, table, seed, chunks)
    if not (isinstance(cover, xr.DataArray) or is_path(cover)):
        raise TypeError(
            f"cover must be a fifesim.ground.Patches, the path of a map or a raster, got {described(cover)}"
        )
    cover = cover.rename("cover") if isinstance(cover, xr.DataArray) else cover
    return cover_map(cover, grid, table, chunks, allow_remote=allow_remote)


def _lai(grid, cover, table, arp, seed):
    """Leaf area of each class from its distribution and arp."""
    lacking = [each.name for each in table if each.lai is None]
    if lacking:
        raise ValueError(
            f"class {', '.join(lacking[:8])} has no leaf area: type CoverClass(..., lai='burned-grazed'), or a number "
            "where it is uniform, or give landscape(lai=) a raster"
        )
    codes = tuple(each.code for each in table)
    # The last entry is for cells without a class.
    tables = np.stack([*(_quantiles(each.lai) for each in table), np.full(distribution.QUANTILE_NODES, np.nan)])
    arps = [arp if each.arp is None else each.arp for each in table]
    # Errors are raised before anything lazy is built.
    for of_class in arps:
        check_streaming_arp(of_class)
    plain = cover.copy(deep=False)
    plain.attrs = {}
    kernel = partial(_leaf_area, codes, tables, arps, seed, grids.lattice_position(grid))
    lai = grids.place(windows.located(kernel, plain, tile=FIELD_TILE), grid)
    history = "\n".join([cover.attrs["history"], f"landscape: leaf area of {len(table)} classes, seed {seed}"])
    made = {"arp": float(arp), "rng_seed": str(seed), "lai_distribution": "by class"} | made_on_site(grid)
    return cf.label(lai, "lai", history=history, **made, method="streaming", references=_REFERENCE)


def _quantiles(lai):
    """Quantiles of a distribution; a single number is repeated."""
    if isinstance(lai, Number):
        return np.full(distribution.QUANTILE_NODES, float(lai))
    return distribution.quantile_table(distribution.lai_distribution(lai))


def _leaf_area(codes, tables, arps, seed, lattice, cover, starts):
    """Leaf area of a block of codes that begins at a row and column of the grid."""
    row, column = (first + start for first, start in zip(lattice, starts, strict=True))

    numbers, present = numbers_of(cover, codes)
    varies = (tables[:-1, 0] != tables[:-1, -1]) & present[:-1]
    needed = list(dict.fromkeys(arp for arp, each in zip(arps, varies, strict=True) if each))
    place = row, column, cover.shape
    field = streaming_field(seed, needed[0], *place) if needed else np.zeros(cover.shape)
    for other in needed[1:]:
        mine = np.array([*(arp == other for arp in arps), False])
        field = np.where(mine[numbers], streaming_field(seed, other, *place), field)
    return distribution.quantile_map_of_classes(field, numbers, tables)


def _property(name, given, grid, chunks, allow_remote):
    """Property as a number or a raster on the grid."""
    check = check_brightness if name == "soil" else partial(check_share, name)
    if isinstance(given, Number):
        return cf.label(xr.DataArray(check(float(given))), name, history=f"landscape: {name} {given:g}")
    if not (isinstance(given, xr.DataArray) or is_path(given)):
        raise TypeError(
            f"{name} must be a number, a fifesim.ground.Field, the path of a raster or an xarray.DataArray, got "
            f"{described(given)}"
        )
    source = open_source(given.rename(name) if isinstance(given, xr.DataArray) else given, name, allow_remote)
    found = onto_grid(source, grid, chunks)
    shares = grids.place(chunking.pointwise(check, found), grid)
    return cf.label(shares, name, history=f"landscape: {name} of a raster")
