"""Landscapes in the chain: what a Dataset says of the ground, each class with its own canopy, and its true means."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Annotated, Literal, NamedTuple

import numpy as np
import xarray as xr

from fifesim.analysis.rasters import means
from fifesim.base.annotations import Metres, Time
from fifesim.base.line_spread import Spread
from fifesim.chain.stands import of_class, stands_of
from fifesim.ground.canopy import absorption
from fifesim.ground.canopy import raster as ground
from fifesim.ground.canopy.annotations import LeafAngles
from fifesim.ground.canopy.crowns import SHAPE
from fifesim.ground.canopy.optics import DEAD_LEAF
from fifesim.ground.canopy.rasters import leaves, soils
from fifesim.ground.canopy.rasters.classes import reflectance_of_classes
from fifesim.ground.landscape.classes import CoverClass
from fifesim.ground.landscape.compression import NO_CLASS
from fifesim.ground.landscape.rasters.cover import classes_of
from fifesim.ground.landscape.rasters.evaluation import by_class
from fifesim.rasters import cf
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import MASKS_TOO, NumberOrRaster, Raster, RasterOrDataset
from fifesim.rasters.axes import north_up
from fifesim.rasters.dates import by_date
from fifesim.rasters.directions import Directions

_DEFAULTS = {"leaf_optics": None, "background": None, "leaf_angles": "spherical", "hotspot": 0.0}
_DEFAULTS |= {"brown": 0.0, "dissociation": 0.0, "brown_leaf": None, "crown_cover": 1.0, "crown_shape": SHAPE}
_DEFAULTS |= {"soil": None, "moisture": None}
"""Of what a canopy is told, where nothing is said."""

_RESOLVED = ("leaf_optics", "background", "brown_leaf", "soil", "moisture")
"""What is resolved into numbers of each band, or what makes them."""

_OF_CELLS = ("brown", "dissociation", "crown_cover", "soil", "moisture")
"""Variables of a landscape that say what its canopy is in each cell."""


class Land(NamedTuple):
    """A scene: leaf area; codes of its classes and what they are; and what else its cells say."""

    lai: xr.DataArray
    cover: xr.DataArray | None = None
    classes: tuple[CoverClass, ...] = ()
    cells: Mapping = MappingProxyType({})


def land_of(scene):
    """
    Parts of a scene.

    Parameters
    ----------
    scene : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area, or a landscape that has it as ``lai``.

    Returns
    -------
    land : Land

    Raises
    ------
    ValueError
        If the Dataset has no ``lai``, or its ``cover`` does not say its classes.
    """
    if not isinstance(scene, xr.Dataset):
        return Land(scene)
    if "lai" not in scene.data_vars:
        raise ValueError(
            f"a landscape has a variable lai, this Dataset has {', '.join(map(str, scene.data_vars)) or 'none'}: "
            "make it with fifesim.landscape(grid, ...), or rename one with .rename(LAI='lai')"
        )
    cells = {name: scene[name] for name in _OF_CELLS if name in scene.data_vars}
    cells = {name: each if each.ndim else float(each) for name, each in cells.items()}
    if "cover" not in scene.data_vars:
        return Land(scene["lai"], cells=cells)
    return Land(scene["lai"], north_up(scene["cover"]), classes_of(scene["cover"]), cells)


def canopies_of(land, bands, canopy, exact=False):
    """
    Canopies of a scene by their numbers in each band.

    Parameters
    ----------
    land : Land
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    canopy : dict of str
        What `fifesim.surface_reflectance` was told of the canopy, by the names of its arguments.
    exact : bool, optional
        As in `fifesim.surface_reflectance`.

    Returns
    -------
    canopies : dict of int to dict
        By codes of the classes, None where there are none: what `ground.canopy.rasters.evaluation.canopy_kernel` takes.

    Raises
    ------
    ValueError
        As in `fifesim.surface_reflectance`; if an argument is given that all classes say themselves.
    """
    optics = _Optics(tuple(band.response for band in bands), land.lai, exact)
    _check_used(land, canopy)
    return {code: optics.of(stand) for code, stand in stands_of(land.classes, canopy, land.cells).items()}


def level_reflectance(land, bands, canopies, **scene):
    """
    Reflectance factor of the canopies of a scene, for flat ground.

    Parameters
    ----------
    land : Land
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    canopies : dict
        From `canopies_of`.
    **scene
        What `ground.canopy.raster.level_reflectance` takes besides.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        As in `fifesim.surface_reflectance`.
    """
    named = {"bands": [band.name for band in bands], "wavelengths": [band.wavelength for band in bands]}
    if land.cover is None:
        return ground.level_reflectance(land.lai, **canopies[None], **named, **scene)
    return reflectance_of_classes(land.lai, land.cover, canopies, **named, **scene)


class _Optics:
    """Canopies by their numbers in each band; what several have is looked up once."""

    def __init__(self, responses, lai, exact):
        self._responses, self._lai, self._exact = responses, lai, exact
        self._known = {}

    def of(self, canopy):
        """What `ground.canopy.raster.canopy_kernel` takes of a canopy."""
        leaf = self._once("leaf_optics", leaves.leaf_optics, canopy["leaf_optics"], exact=self._exact)
        below = self._once("background", soils.background, canopy["background"])
        dead = None
        if isinstance(canopy["brown"], xr.DataArray) or canopy["brown"] != 0:
            given = DEAD_LEAF if canopy["brown_leaf"] is None else canopy["brown_leaf"]
            dead = self._once("leaf_optics", leaves.leaf_optics, given, exact=self._exact)
        others = {name: value for name, value in canopy.items() if name not in _RESOLVED}
        by_band = {"leaf_reflectance": leaf[0], "leaf_transmittance": leaf[1], "brown_optics": dead}
        return {**by_band, **self._below(below, canopy["soil"], canopy["moisture"]), **others}

    def _below(self, dry, soil, moisture):
        """Background, and what makes that of each cell of it."""
        if any(isinstance(each, xr.DataArray) for each in (soil, moisture)):
            key = "soil", id(soil), id(moisture)
            if key not in self._known:
                self._known[key] = soils.soil_kernel(self._responses, self._lai, soil, moisture)
            return {"background": dry, "soil_changes": self._known[key]}
        return {"background": soils.as_it_lies(self._responses, dry, self._lai, soil, moisture)}

    def _once(self, name, function, given, **options):
        # What is given is kept beside, so that its identity stays its own.
        key = name, id(given)
        if key not in self._known:
            self._known[key] = given, function(self._responses, given, self._lai, **options)
        return self._known[key][1]


def _check_used(land, canopy):
    """Refuse an argument that would change nothing."""
    for name, value in canopy.items():
        default = _DEFAULTS[name]
        if value is default or (isinstance(value, str | int | float) and value == default):
            continue
        if name in land.cells:
            raise ValueError(f"{name} is given, and the landscape has a variable {name}: leave out one of the two")
        if land.classes and all(of_class(each, name) is not None for each in land.classes):
            raise ValueError(
                f"{name} is given, and all classes of the landscape say theirs: leave it out, or out of the classes"
            )


@by_date
def fpar(
    lai: RasterOrDataset,
    *,
    geometry: Directions | None = None,
    time: Time | None = None,
    leaf_angles: LeafAngles = "spherical",
    fpar_inf: float = absorption.FPAR_INF,
    leaves: Literal["all", "green"] = "all",
    brown: NumberOrRaster = 0.0,
    dissociation: NumberOrRaster = 0.0,
    crown_cover: NumberOrRaster = 1.0,
) -> xr.DataArray:
    """
    Fraction of photosynthetically active radiation that a canopy absorbs, or its green leaves.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape that has it as ``lai``. [m2 m-2]
    geometry : fifesim.base.geometry.Geometry, optional
        The sun's; by default that which the array carries, else at its time and place.
    time : str or datetime, optional
        In the place of ``geometry``.
    leaf_angles : optional
        As `ground.canopy.leaf_angles.leaf_angle_classes` takes them.
    fpar_inf : float, optional
        Of an infinitely thick canopy. [1]
    leaves : {"all", "green"}, optional
        Which leaves absorb it: all of them, dead ones too, or those alone that can use it.
    brown, dissociation, crown_cover : float or xarray.DataArray, dims (y, x), optional
        As in `surface_reflectance`. [1]

    Returns
    -------
    fpar : xarray.DataArray, dims (y, x)
        [1]

    Raises
    ------
    ValueError
        If LAI is negative, or a share outside 0 to 1.

    Notes
    -----
    Both kinds of leaf absorb alike here, as in Eq. 6. SAIL's own shares, of each wavelength, are in
    `ground.canopy.light_sharing`.

    References
    ----------
    [Friedl1995]_, Eq. 6

    See Also
    --------
    fifesim.ground.canopy.absorption.fpar, fifesim.ground.canopy.absorption.green_fpar

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> round(float(lai.fifesim.fpar().mean()), 2)
    0.3
    """
    land = land_of(lai)
    said = {"geometry": geometry, "time": time, "fpar_inf": fpar_inf, "leaves": leaves}
    canopy = {"leaf_angles": leaf_angles, "brown": brown, "dissociation": dissociation, "crown_cover": crown_cover}
    _check_used(land, canopy)
    if land.cover is None:
        return ground.fpar(land.lai, **said, **stands_of((), canopy, land.cells)[None])
    told = stands_of(land.classes, canopy, land.cells)
    # Of classes with the same canopy once.
    made = {repr(each): ground.fpar(land.lai, **said, **each) for each in {repr(v): v for v in told.values()}.values()}
    taken = {text: (np.positive, [each]) for text, each in made.items()}
    kernels = {code: taken[repr(each)] for code, each in told.items()}
    out = grids.place(by_class(kernels, land.cover), grids.geobox(land.lai))
    history = next(iter(made.values())).attrs["history"].splitlines()[-1] if len(made) == 1 else "fpar: by class"
    return cf.label(out, "green_fpar" if leaves == "green" else "fpar", source=land.lai, history=history)


def aggregate(
    array: Annotated[Raster, MASKS_TOO], pixel: Metres = 30.0, *, min_valid: float = 0.98, lsf: Spread | None = None
) -> Raster:
    """
    Means over square blocks of ground: the truth that a pixel is compared with.

    Parameters
    ----------
    array : xarray.DataArray, dims (..., y, x), or xarray.Dataset
        Of a landscape, ``brown`` is that of the leaf area of a block, and the codes of ``cover`` are counted.
    pixel : float, optional
        Size of the blocks, any multiple of the cell or not. [m]
    min_valid : float, optional
        Share of its area that a block needs on valid cells; below it is NaN. [1]
    lsf : line spread function, optional
        As `fifesim.base.footprints` has it, to weight the cells about each block's middle; all within the block count
        the same by default.

    Returns
    -------
    means : xarray.DataArray, dims (..., y, x), or xarray.Dataset
        On the grid of whole blocks from the upper left corner. Of a landscape, ``class_share`` over (class, y, x) is in
        the place of ``cover``.

    Raises
    ------
    ValueError
        If the array has no grid, or no block fits.
    TypeError
        If the size is no number.

    See Also
    --------
    fifesim.base.footprints.regularize

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> lai.fifesim.aggregate(30).shape
    (10, 10)
    """
    mean = partial(means.aggregate, pixel=pixel, min_valid=min_valid, lsf=lsf)
    if not isinstance(array, xr.Dataset):
        return mean(array)
    by_cell = {name: each for name, each in array.data_vars.items() if {"y", "x"} <= set(each.dims)}
    kept = {name: each for name, each in array.data_vars.items() if name != "cover"}
    out = {name: mean(each) if name in by_cell else each for name, each in kept.items()}
    if "brown" in by_cell and "lai" in by_cell:
        dead = mean(array["lai"] * array["brown"]) / out["lai"]
        out["brown"] = out["brown"].copy(data=dead.where(out["lai"] != 0, 0.0).data)
    if "cover" in by_cell:
        out["class_share"] = _class_shares(array["cover"], mean)
    return xr.Dataset(out, attrs=array.attrs)


def _class_shares(cover, mean):
    """Share of the ground of each class."""
    table = classes_of(cover)
    known = cover.where(cover != NO_CLASS)
    shares = [mean((known == each.code).where(known.notnull())) for each in table]
    names = xr.Variable("class", [each.name for each in table])
    out = xr.concat(shares, dim=names, coords="minimal", compat="override", combine_attrs="override")
    out = grids.place(out, grids.geobox(shares[0]))
    return cf.label(out, "class_share", source=cover, history="aggregate: shares of classes")
