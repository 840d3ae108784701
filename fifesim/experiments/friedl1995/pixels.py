"""Ground and pixels of the scenes of Friedl et al. (1995)."""

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from fifesim.analysis.rasters.means import aggregate
from fifesim.chain import steps as chain
from fifesim.chain.setup import Setup, image_of, reflectance_of
from fifesim.ground.canopy import raster as canopy
from fifesim.ground.landscape.raster import lai_scene


@dataclass(frozen=True, eq=False)
class Ground:
    """
    Ground of a scene, and the light above it.

    Parameters
    ----------
    setup : fifesim.chain.setup.Setup
        With the elevation.
    lai, fpar : xarray.DataArray, dims (y, x)
    reflectance, toa : xarray.DataArray, dims (band, y, x)
        At the ground and at the top of the atmosphere. [1]
    """

    setup: Setup
    lai: xr.DataArray
    fpar: xr.DataArray
    reflectance: xr.DataArray
    toa: xr.DataArray


def ground_of(case, treatment, arp, seed, land=(None, None)):
    """
    Ground of a scene, by the paper's own route: one Fourier transform of the scene, and exact ranks.

    Parameters
    ----------
    case : Case
    treatment : str
    arp : float
        [1]
    seed : int
    land : (xarray.DataArray, xarray.DataArray), optional
        From `Case.land`; level by default.

    Returns
    -------
    ground : Ground
    """
    keys, (dem, horizon) = case.common.ground, land
    setup = replace(case.setup, dem=dem, horizon=horizon)
    lai = lai_scene(case.grid, case.densities[treatment], arp=arp, seed=seed, method=keys.method)
    fpar = canopy.fpar(lai, setup.canopy, geometry=setup.geometry, fpar_inf=keys.fpar_inf)
    reflectance = reflectance_of(setup, lai).compute()
    return Ground(setup, lai, fpar, reflectance, chain.to_toa(reflectance, instrument=setup.instrument))


def scene_image(case, ground):
    """
    What the instrument of a case records of the ground of a scene.

    Parameters
    ----------
    case : Case
        Of the same ground, sun and bands.
    ground : Ground

    Returns
    -------
    image : xarray.DataArray of unsigned integers, dims (band, y, x)
    """
    return image_of(case.setup, ground.reflectance)


def block_means(case, ground, array):
    """
    Means over the blocks of the truth.

    Parameters
    ----------
    case : Case
    ground : Ground
    array : xarray.DataArray, dims (..., y, x)
        By cells.

    Returns
    -------
    means : xarray.DataArray, dims (..., y, x)
    """
    return aggregate(array, case.pixel, min_valid=ground.setup.min_valid)


def pixel_values(truth, *images):
    """
    Pixels of several rasters paired by row and column, without those where one has no data.

    Parameters
    ----------
    truth, *images : xarray.DataArray, dims (y, x)

    Returns
    -------
    values : array, shape (rasters, pixels)
    """
    return paired(*(raster.values for raster in (truth, *images)))


def paired(*arrays):
    """
    Pixels of several arrays paired by row and column, without those where one has no data.

    Parameters
    ----------
    *arrays : array, shape (y, x)
        The larger ones are cut.

    Returns
    -------
    values : array, shape (arrays, pixels)
    """
    rows, columns = (min(sizes) for sizes in zip(*(each.shape for each in arrays), strict=True))
    values = np.stack([each[:rows, :columns].ravel() for each in arrays])
    return values[:, np.isfinite(values).all(axis=0)]
