"""Canopies of several classes in one scene, on labelled rasters."""

import numpy as np

from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.raster import checked_scene, labelled
from fifesim.ground.canopy.rasters.evaluation import canopy_kernel
from fifesim.ground.landscape.rasters.evaluation import by_class


def reflectance_of_classes(lai, cover, canopies, *, bands, wavelengths, geometry, diffuse_fraction, exact, **said):
    """
    Reflectance factor of canopies of several classes over their backgrounds, for flat ground.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    cover : xarray.DataArray, dims (y, x)
        Codes; -1 and NaN give NaN.
    canopies : dict of int to dict
        Of each code, what `ground.canopy.rasters.evaluation.canopy_kernel` takes of a canopy.
    bands, wavelengths, geometry, diffuse_fraction, exact
        As in `ground.canopy.raster.level_reflectance`.
    **said : str or number
        Further attributes.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        The same bits as of each class alone. [1]

    Raises
    ------
    ValueError
        As in `ground.canopy.raster.level_reflectance`; when computed, if a cell has another code.

    See Also
    --------
    fifesim.ground.canopy.raster.level_reflectance
    """
    lai = checked_scene(lai)
    light = {"geometry": geometry, "diffuse_fraction": diffuse_fraction, "exact": exact}
    kernels, distinct = {}, []
    for code, canopy in canopies.items():
        alike = [kernel for other, kernel in distinct if _same(canopy, other)]
        kernels[code] = alike[0] if alike else canopy_kernel(lai, bands, **canopy, **light)
        distinct.append((canopy, kernels[code]))
    out = by_class(kernels, cover, lai, bands=len(bands))
    angles = dict.fromkeys(str(leaf_angle_classes(each.get("leaf_angles", "spherical"))) for each in canopies.values())
    said = {"leaf_angles": " and ".join(angles), "background": "by class", **said}
    return labelled(out, lai, bands, wavelengths, geometry, **said)


def _same(one, other):
    """Whether two descriptions of a canopy are known to be the same; of rasters, those that are one object."""
    if one is other:
        return True
    if isinstance(one, dict):
        return isinstance(other, dict) and one.keys() == other.keys() and all(_same(one[k], other[k]) for k in one)
    if isinstance(one, tuple | list):
        return isinstance(other, tuple | list) and len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and np.array_equal(one, other)
    return isinstance(one, str | float | int) and isinstance(other, str | float | int) and one == other
