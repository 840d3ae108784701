"""Canopies of a scene as they are given: by the call, by classes of cover and by cells; and the defaults among them."""

from numbers import Number
from types import MappingProxyType

from fifesim.base.warned import warn
from fifesim.ground.canopy.description import is_raster

_TALLGRASS = {"background": "soil and litter", "brown_leaf": "dead leaves", "leaf_optics": "green leaves"}
"""Optics that are those of FIFE's tallgrass by default."""

_CURES = {
    "background": "give background={'soil_dry': 1.0} or your own ([ground.background_spectra] of a scenario)",
    "brown_leaf": "give brown_leaf=fifesim.Leaf(...) ([ground.brown_leaf])",
    "leaf_optics": "give leaf_optics=fifesim.Leaf(...) ([ground.leaf])",
}


def stands_of(classes, canopy, cells=MappingProxyType({})):
    """
    Canopies of a scene by codes of its classes; None is the code without classes.

    Parameters
    ----------
    classes : sequence of CoverClass
        Fields that their canopies leave open are those of `canopy`.
    canopy : Canopy
    cells : mapping of str to xarray.DataArray or float, optional
        Properties of the canopy by cell, which have precedence.

    Returns
    -------
    stands : dict of int to Canopy
    """
    if not classes:
        return {None: canopy.replace(**cells)}
    return {kind.code: kind.canopy.over(canopy).replace(**cells) for kind in classes}


def warn_of_tallgrass(scene, classes, canopy, cells=MappingProxyType({})):
    """
    Warn if optics of FIFE's tallgrass, the defaults, are taken for a scene from elsewhere.

    Parameters
    ----------
    scene : str
        Name of the scene, for the message.
    classes, canopy, cells
        As in `stands_of`.

    Warns
    -----
    UserWarning
        If leaves, background or dead leaves are not given.
    """
    bare = {kind.code for kind in classes if isinstance(kind.lai, Number) and kind.lai == 0}
    stands = stands_of(classes, canopy, cells)
    taken = {name for code, stand in stands.items() for name in _defaults(stand, has_leaves=code not in bare)}
    if taken:
        warn(
            f"nothing says what grows on {scene}: FIFE's tallgrass is taken for "
            f"{', '.join(_TALLGRASS[name] for name in sorted(taken))}; "
            f"{'; '.join(_CURES[name] for name in sorted(taken))}"
        )


def _defaults(stand, has_leaves):
    """Names of the optics that a stand leaves to the defaults."""
    dead = is_raster(stand.brown) or stand.brown != 0
    needed = {"background": True, "leaf_optics": has_leaves, "brown_leaf": has_leaves and dead}
    return [name for name, need in needed.items() if need and getattr(stand, name) is None]
