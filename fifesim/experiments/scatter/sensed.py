"""What the sensor makes of cells, with each of its stages at work or ideal."""

from itertools import product

import numpy as np
import xarray as xr

from fifesim.analysis import indices
from fifesim.base.footprints import regularize
from fifesim.chain.arrays import shared_operators
from fifesim.rasters import grid as grids
from fifesim.rasters.regularization import areas
from fifesim.sensor.response import calibration
from fifesim.sensor.response.rasters.noise import noisy


def images_of(scene, cells, switches):
    """
    NDVI with the stages of the sensor at work or ideal.

    Parameters
    ----------
    scene : object
        With ``setup``, ``bands``, ``grid``, ``blocks``, ``image`` and ``shape``, as `stages` makes it.
    cells : array, shape (3, y, x)
        Red, near infrared and NDVI of the cells. [1]
    switches : sequence of five tuples of bool
        States of NDVI scaling, point spread, registration, quantisation and noise; True is at work.

    Returns
    -------
    ndvi : array, shape (one axis for each of them, y, x)
        [1]
    """
    scaling, spread, registration, quantisation, noise = switches
    found = np.empty((*map(len, switches), *scene.shape))
    for (i, blurred), (j, displaced) in product(enumerate(spread), enumerate(registration)):
        means = _means(scene, cells, blurred, displaced)
        red, nir, of_cells = means
        of_means = indices.normalized_difference(nir, red)
        for (k, counts), (m, grains) in product(enumerate(quantisation), enumerate(noise)):
            recorded = _recorded(scene, means[:2], counts, grains)
            for n, of_reflectance in enumerate(scaling):
                # What the detector did stays as it is.
                found[n, i, j, k, m] = recorded if of_reflectance else of_cells + (recorded - of_means)
    return found


def _means(scene, cells, blurred, displaced):
    """Means over footprints, shape (3, y, x)."""
    red, nir = scene.bands
    setup, grid = scene.setup, scene.grid
    box = scene.image if displaced else scene.blocks
    sizes = grids.cell_size(box)
    shifts = [offset * size for offset, size in zip(setup.offset, sizes, strict=True)] if displaced else (0.0, 0.0)
    rows, columns = scene.shape
    means = np.empty((len(cells), rows, columns))
    for layer, band in enumerate((red, nir, red)):
        spreads = setup.instrument.line_spreads(band) if blurred else areas(scene.blocks)
        along = shared_operators(spreads, grid, box[:rows, :columns], tuple(map(float, shifts)))
        means[layer] = regularize(cells[layer], *along, min_valid=setup.min_valid)
    return means


def _recorded(scene, means, counts, grains):
    """NDVI of what the detectors record of the mean reflectances."""
    setup, geometry, bands = scene.setup, scene.setup.geometry, scene.bands
    known = [(band.full_scale_radiance, band.min_radiance, band.solar_irradiance) for band in bands]
    full_scale, lowest, irradiance = np.array(known).T[..., None, None]
    distance = geometry.earth_sun_distance
    radiance = calibration.reflectance_to_radiance(means, irradiance, geometry.mu_s, distance)
    if grains:
        plain, first = xr.DataArray(radiance, dims=("band", "y", "x")), grids.lattice_position(scene.image)
        said = setup.noise, setup.seed, first, setup.noise_models
        radiance = noisy(plain, setup.instrument, bands, *said).values
    if counts:
        gain, offset = calibration.gain_offset(full_scale, lowest, setup.instrument.bits)
        compression = np.array([band.compressed_count(setup.instrument.bits) for band in bands])[:, None, None]
        dn = calibration.radiance_to_dn(radiance, gain, offset, setup.instrument.bits, compression)
        radiance = calibration.dn_to_radiance(dn, gain, offset, compression)
    red, nir = calibration.radiance_to_reflectance(radiance, irradiance, geometry.mu_s, distance)
    return indices.normalized_difference(nir, red)
