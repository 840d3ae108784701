"""Canopies of several classes in one scene, on labelled rasters."""

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
    kernels = {code: canopy_kernel(lai, bands, **canopy, **light) for code, canopy in canopies.items()}
    out = by_class(kernels, cover, lai, bands=len(bands))
    angles = dict.fromkeys(str(leaf_angle_classes(each.get("leaf_angles", "spherical"))) for each in canopies.values())
    said = {"leaf_angles": " and ".join(angles), "background": "by class", **said}
    return labelled(out, lai, bands, wavelengths, geometry, **said)
