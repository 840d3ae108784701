"""Canopies of several classes in one scene, on labelled rasters: each is evaluated on its own cells alone."""

from functools import partial

import numpy as np

from fifesim.base.geometry import ANGLES
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes
from fifesim.ground.canopy.raster import canopy_kernel, checked_scene, labelled
from fifesim.ground.landscape.compression import cells_by_class, check_codes
from fifesim.rasters import chunks as chunking


def reflectance_of_classes(
    lai, cover, canopies, *, bands, wavelengths, geometry, diffuse_fraction, exact, **provenance
):
    """
    Reflectance factor of canopies of several classes over their backgrounds, for flat ground.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x)
        [m2 m-2]
    cover : xarray.DataArray, dims (y, x)
        Codes; -1 and NaN give NaN.
    canopies : dict of int to dict
        Of each code, what `ground.canopy.raster.canopy_kernel` takes of a canopy.
    bands, wavelengths, geometry, diffuse_fraction, exact, **provenance
        As in `ground.canopy.raster.level_reflectance`.

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
    rasters, parts = [], []
    for canopy in canopies.values():
        kernel, taken = canopy_kernel(bands, **canopy, **light)
        parts.append((kernel, tuple(_index(rasters, each) for each in taken)))
    banded = tuple("band" in each.dims for each in rasters)
    kernel = partial(_of_classes, tuple(canopies), tuple(parts), banded, len(bands))
    plain = [each.drop_vars(ANGLES, errors="ignore") for each in (lai, cover)]
    out = chunking.pointwise(kernel, *plain, *rasters, bands=len(bands))
    angles = dict.fromkeys(str(leaf_angle_classes(each.get("leaf_angles", "spherical"))) for each in canopies.values())
    said = {"leaf_angles": " and ".join(angles), "background": "by class"}
    return labelled(out, lai, bands, wavelengths, geometry, **said, **provenance)


def _index(rasters, wanted):
    """Place of a raster among others, of which it becomes one; what classes share is there once."""
    for index, each in enumerate(rasters):
        if _same(each, wanted):
            return index
    rasters.append(wanted)
    return len(rasters) - 1


def _same(one, other):
    """Whether two rasters are known to be the same without a look at their cells."""
    if one.dims != other.dims or one.shape != other.shape:
        return False
    if one.chunks is not None and other.chunks is not None:
        return one.data.name == other.data.name
    return one.variable is other.variable or (one.ndim < 2 and one.equals(other))


def _of_classes(codes, parts, banded, bands, lai, cover, *blocks):
    """Reflectance of a block of cells: those of each class are put together, evaluated and put back."""
    shape = np.broadcast_shapes(lai.shape, cover.shape)
    lai, cover = (np.broadcast_to(each, shape).ravel() for each in (lai, cover))
    blocks = [_flat(block, has_bands, shape) for block, has_bands in zip(blocks, banded, strict=True)]
    out = np.full((bands, lai.size), np.nan)
    for cells, (kernel, taken) in zip(cells_by_class(check_codes(cover, codes), codes), parts, strict=True):
        if cells.size:
            read = (block[cells] if varies else block for block, varies in (blocks[index] for index in taken))
            out[:, cells] = kernel(lai[cells], *read)
    return out.reshape(bands, *shape)


def _flat(block, has_bands, shape):
    """A block by cells, shape (n, [band]), and whether it is by cells at all."""
    if block.ndim == int(has_bands):
        return block, False
    end = block.shape[-1:] if has_bands else ()
    return np.broadcast_to(block, shape + end).reshape(-1, *end), True
