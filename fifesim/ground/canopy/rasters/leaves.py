"""Leaves that differ from cell to cell, on labelled rasters: by their optics, or by what they are made of."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from fifesim.ground.canopy import optics
from fifesim.ground.canopy.leaf_table import leaf_means
from fifesim.ground.canopy.prospect import Leaf
from fifesim.ground.canopy.rasters.soils import spectrum_of
from fifesim.ground.canopy.spectrum import LeafSpectrum
from fifesim.rasters import chunks as chunking
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.layers import by_band, layers_of


def leaf_optics(bands, given, lai, *, exact=False):
    """
    Leaf reflectance and transmittance of bands, of all leaves or of those in each cell.

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band
    given
        As `ground.canopy.optics.leaf_optics` takes it, or a Dataset with ``wavelength`` [um], ``reflectance`` and
        ``transmittance`` [1]. In the place of a number there may be a raster over (y, x): in a `Leaf`, and in ``{band:
        (reflectance, transmittance)}``; or a pair of rasters over ([band], y, x).
    lai : xarray.DataArray, dims (y, x)
        Whose CRS the rasters have where they lost theirs.
    exact : bool, optional
        As in `ground.canopy.leaf_table.leaf_means`.

    Returns
    -------
    leaf_reflectance, leaf_transmittance : array, shape (band,), or xarray.DataArray, dims (band, y, x)
        [1]

    Raises
    ------
    ValueError
        If a band has no optics, they are outside their range, or rasters lie on different grids.

    See Also
    --------
    fifesim.ground.canopy.optics.leaf_optics, fifesim.ground.canopy.leaf_table.leaf_means
    """
    if isinstance(given, xr.Dataset):
        given = spectrum_of(given, "leaf_optics", LeafSpectrum)
    names = [band.name for band in bands]
    if isinstance(given, Leaf) and given.varying():
        return _of_contents(bands, given, lai, exact)
    if isinstance(given, Mapping):
        if any(_has_raster(pair) for pair in given.values()):
            pairs = [_pair(name, optics.of_band(given, name, "leaf optics")) for name in names]
            return tuple(_of_bands(names, each, lai) for each in zip(*pairs, strict=True))
    elif _has_raster(given):
        return tuple(
            by_band(dict(zip(names, layers_of(value, names, f"leaf {what}"), strict=True)), lai)
            for what, value in zip(("reflectance", "transmittance"), _pair("every band", given), strict=True)
        )
    return optics.leaf_optics(bands, given)


def brown_optics(bands, brown, given, lai, *, exact=False):
    """
    Optics of dead leaves, where there are any.

    Parameters
    ----------
    bands, lai, exact
        As in `leaf_optics`.
    brown : float or xarray.DataArray
        Dead share of the leaf area. [1]
    given : optional
        As in `leaf_optics`; dead tallgrass by default.

    Returns
    -------
    optics : (array, array) or None
        As of `leaf_optics`; None where no leaf is dead. [1]
    """
    if not isinstance(brown, xr.DataArray) and brown == 0:
        return None
    return leaf_optics(bands, optics.DEAD_LEAF if given is None else given, lai, exact=exact)


def _of_bands(names, values, lai):
    """Reflectances, or transmittances, of which some or none are rasters."""
    if _has_raster(values):
        return by_band(dict(zip(names, values, strict=True)), lai)
    return np.asarray(values, float)


def _has_raster(given):
    return any(isinstance(value, xr.DataArray) for value in (given if isinstance(given, tuple | list) else [given]))


def _pair(band, given):
    if not isinstance(given, tuple | list) or len(given) != 2:
        raise ValueError(
            f"leaf_optics of {band} are a pair (reflectance, transmittance), each a number or a raster, "
            f"got {type(given).__name__}"
        )
    return given


def _of_contents(bands, leaf, lai, exact):
    """Optics of leaves some of whose contents are rasters over (y, x)."""
    varying = leaf.varying()
    for name, value in varying.items():
        if not isinstance(value, xr.DataArray) or set(value.dims) != {"y", "x"}:
            got = f"dimensions {value.dims}" if isinstance(value, xr.DataArray) else type(value).__name__
            raise ValueError(f"Leaf: {name} must be a number, or a raster (xarray.DataArray) over (y, x), got {got}")

    def kernel(*contents):
        means = leaf_means(bands, replace(leaf, **dict(zip(varying, contents, strict=True))), exact)
        return means.reshape(2 * len(bands), *means.shape[2:])

    rasters = [with_crs_of(value, lai) for value in varying.values()]
    both = chunking.pointwise(kernel, *rasters, bands=2 * len(bands))
    return tuple(both.isel(band=slice(start, start + len(bands))) for start in (0, len(bands)))
