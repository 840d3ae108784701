"""Landscapes in the chain: what a Dataset says of the ground, and each class with its own canopy."""

from typing import NamedTuple

import xarray as xr

from fifesim.ground.canopy import raster as ground
from fifesim.ground.canopy.rasters import leaves, soils
from fifesim.ground.canopy.rasters.classes import reflectance_of_classes
from fifesim.ground.landscape.classes import CoverClass
from fifesim.ground.landscape.rasters.cover import classes_of
from fifesim.rasters.axes import north_up

_DEFAULTS = {"leaf_optics": None, "background": None, "leaf_angles": "spherical", "hotspot": 0.0}
"""Of what a canopy is told, where nothing is said."""

_OF_CLASS = {"leaf_optics": "leaf"}
"""What `surface_reflectance` and `CoverClass` call by different names."""


class Land(NamedTuple):
    """A scene: leaf area, and where it has classes, their codes and what they are."""

    lai: xr.DataArray
    cover: xr.DataArray | None = None
    classes: tuple[CoverClass, ...] = ()


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
    lai = scene["lai"]
    if "cover" not in scene.data_vars:
        return Land(lai)
    return Land(lai, north_up(scene["cover"]), classes_of(scene["cover"]))


def level_reflectance(land, bands, canopy, *, exact, **scene):
    """
    Reflectance factor of the canopies of a scene, for flat ground.

    Parameters
    ----------
    land : Land
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    canopy : dict of str
        What `fifesim.surface_reflectance` was told of the canopy, by the names of its arguments.
    exact : bool
    **scene
        What `ground.canopy.raster.level_reflectance` takes besides.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        As in `fifesim.surface_reflectance`; if an argument is given that all classes say themselves.
    """
    responses = tuple(band.response for band in bands)
    named = {"bands": [band.name for band in bands], "wavelengths": [band.wavelength for band in bands]}
    if land.cover is None:
        told = _resolved(canopy, responses, land.lai, exact)
        return ground.level_reflectance(land.lai, **told, **named, exact=exact, **scene)
    _check_used(land.classes, canopy)
    canopies = {each.code: _resolved(_told(each, canopy), responses, land.lai, exact) for each in land.classes}
    return reflectance_of_classes(land.lai, land.cover, canopies, **named, exact=exact, **scene)


def _told(kind, canopy):
    """What is said of the canopy of a class: by itself, else by the call."""
    own = {name: getattr(kind, _OF_CLASS.get(name, name)) for name in canopy}
    return {name: canopy[name] if own[name] is None else own[name] for name in canopy}


def _resolved(canopy, responses, lai, exact):
    """A canopy by its numbers in each band."""
    reflectance, transmittance = leaves.leaf_optics(responses, canopy["leaf_optics"], lai, exact=exact)
    background = soils.background(responses, canopy["background"], lai)
    others = {name: value for name, value in canopy.items() if name not in ("leaf_optics", "background")}
    return {"leaf_reflectance": reflectance, "leaf_transmittance": transmittance, "background": background, **others}


def _check_used(classes, canopy):
    """Refuse an argument that would change nothing."""
    for name, value in canopy.items():
        default = _DEFAULTS[name]
        given = value is not default and not (isinstance(value, str | int | float) and value == default)
        if given and all(getattr(each, _OF_CLASS.get(name, name)) is not None for each in classes):
            raise ValueError(
                f"{name} is given, and all classes of the landscape say theirs: leave it out, or out of the classes"
            )
