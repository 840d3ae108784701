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
from fifesim.chain.stands import stands_of
from fifesim.ground.canopy import absorption
from fifesim.ground.canopy import raster as ground
from fifesim.ground.canopy.description import TALLGRASS, Canopy, is_raster
from fifesim.ground.canopy.optics import DEAD_LEAF
from fifesim.ground.canopy.properties import NUMBERS, PROPERTIES
from fifesim.ground.canopy.rasters import leaves, soils
from fifesim.ground.canopy.rasters.evaluation import BandCanopy
from fifesim.ground.landscape.classes import CoverClass
from fifesim.ground.landscape.compression import NO_CLASS
from fifesim.ground.landscape.rasters.cover import classes_of
from fifesim.ground.landscape.rasters.evaluation import by_class
from fifesim.rasters import cf
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import MASKS_TOO, Raster, RasterOrDataset
from fifesim.rasters.axes import north_up
from fifesim.rasters.dates import by_date
from fifesim.rasters.directions import Directions


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
    cells = {name: scene[name] for name in NUMBERS if name in scene.data_vars}
    cells = {name: each if each.ndim else float(each) for name, each in cells.items()}
    if "cover" not in scene.data_vars:
        return Land(scene["lai"], cells=cells)
    return Land(scene["lai"], north_up(scene["cover"]), classes_of(scene["cover"]), cells)


def canopies_of(land, bands, canopy, exact=False):
    """
    Canopies of a scene with their optics in each band.

    Parameters
    ----------
    land : Land
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    canopy : Canopy
        For what neither cells nor classes have.
    exact : bool, optional
        As in `fifesim.surface_reflectance`.

    Returns
    -------
    canopies : dict of int to fifesim.ground.canopy.rasters.evaluation.BandCanopy
        By codes of the classes; None is the code without classes.

    Raises
    ------
    ValueError
        As in `fifesim.surface_reflectance`; if a property is given that all classes have.
    """
    optics = _Optics(tuple(band.response for band in bands), land.lai, exact)
    _check_used(land, canopy)
    return {code: optics.of(stand) for code, stand in stands_of(land.classes, canopy, land.cells).items()}


def level_reflectance(land, bands, canopies, light, **options):
    """
    Reflectance factor of the canopies of a scene, for flat ground.

    Parameters
    ----------
    land : Land
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    canopies : dict
        From `canopies_of`.
    light : fifesim.ground.canopy.rasters.evaluation.Light
    **options
        ``exact`` and attributes, as in `fifesim.ground.canopy.raster.level_reflectance`.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        As in `fifesim.surface_reflectance`.
    """
    if land.cover is None:
        return ground.level_reflectance(land.lai, bands, canopies[None], light, **options)
    return ground.reflectance_of_classes(land.lai, land.cover, bands, canopies, light, **options)


class _Optics:
    """Canopies by their numbers in each band; what several have is looked up once."""

    def __init__(self, responses, lai, exact):
        self._responses, self._lai, self._exact = responses, lai, exact
        self._known = {}

    def of(self, canopy):
        """Canopy with its optics in each band."""
        leaf = self._once("leaf_optics", leaves.leaf_optics, canopy.leaf_optics, exact=self._exact)
        below = self._once("background", soils.background, canopy.background)
        dead = None
        if is_raster(canopy.brown) or canopy.brown != 0:
            given = DEAD_LEAF if canopy.brown_leaf is None else canopy.brown_leaf
            dead = self._once("leaf_optics", leaves.leaf_optics, given, exact=self._exact)
        soil, moisture = soils.changes_of(canopy)
        if not any(map(is_raster, (soil, moisture))):
            return BandCanopy(canopy, leaf, dead, soils.as_it_lies(self._responses, below, self._lai, soil, moisture))
        key = "soil", id(soil), id(moisture)
        if key not in self._known:
            self._known[key] = soils.soil_kernel(self._responses, self._lai, soil, moisture)
        return BandCanopy(canopy, leaf, dead, below, self._known[key])

    def _once(self, name, function, given, **options):
        # What is given is kept beside, so that its identity stays its own.
        key = name, id(given)
        if key not in self._known:
            self._known[key] = given, function(self._responses, given, self._lai, **options)
        return self._known[key][1]


def _check_used(land, canopy):
    """Raise ValueError if a property is given that would change nothing."""
    for name in canopy.given:
        value, default = getattr(canopy, name), PROPERTIES[name].default
        if isinstance(value, str | int | float) and value == default:
            continue
        if name in land.cells:
            raise ValueError(f"{name} is given, and the landscape has a variable {name}: leave out one of the two")
        if land.classes and all(name in each.canopy.given for each in land.classes):
            raise ValueError(
                f"{name} is given, and all classes of the landscape have their own: leave it out, or out of the classes"
            )


@by_date
def fpar(
    lai: RasterOrDataset,
    *,
    canopy: Canopy | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    fpar_inf: float = absorption.FPAR_INF,
    leaves: Literal["all", "green"] = "all",
) -> xr.DataArray:
    """
    Fraction of photosynthetically active radiation that a canopy absorbs, or its green leaves.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape that has it as ``lai``. [m2 m-2]
    canopy : Canopy, optional
        Its leaf angles, crown cover, and dead leaves; properties that the landscape has are not given here.
    geometry : fifesim.base.geometry.Geometry, optional
        The sun's; by default that which the array carries, else at its time and place.
    time : str or datetime, optional
        In the place of ``geometry``.
    fpar_inf : float, optional
        Of an infinitely thick canopy. [1]
    leaves : {"all", "green"}, optional
        Which leaves absorb it: all of them, dead ones too, or those alone that can use it.

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
    land, canopy = land_of(lai), canopy or TALLGRASS
    light = {"geometry": geometry, "time": time, "fpar_inf": fpar_inf, "leaves": leaves}
    _check_used(land, canopy)
    stands = stands_of(land.classes, canopy, land.cells)
    if land.cover is None:
        return ground.fpar(land.lai, stands[None], **light)
    # Classes whose canopies absorb alike are computed once.
    kernels, known = {}, []
    for code, stand in stands.items():
        alike = [kernel for other, kernel in known if ground.same_properties(stand, other, ground.ABSORBING)]
        kernels[code] = alike[0] if alike else (np.positive, [ground.fpar(land.lai, stand, **light)])
        known.append((stand, kernels[code]))
    distinct = list({id(kernel): kernel for kernel in kernels.values()}.values())
    out = grids.place(by_class(kernels, land.cover), grids.geobox(land.lai))
    history = distinct[0][1][0].attrs["history"].splitlines()[-1] if len(distinct) == 1 else "fpar: by class"
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
