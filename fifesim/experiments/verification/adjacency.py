"""Checks of the adjacency effect: the published environment function, targets of 6SV1.1, and what theory knows."""

from functools import partial

import numpy as np
import xarray as xr
from numpy.polynomial.legendre import leggauss

from fifesim.atmosphere.adjacency import environment as adjacency
from fifesim.atmosphere.adjacency import raster as adjacency_raster
from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.schemes.coupling import TargetTerms, inhomogeneous_reflectance
from fifesim.atmosphere.schemes.engines import band_terms
from fifesim.atmosphere.schemes.terms import BandTerms
from fifesim.base import datasets
from fifesim.experiments.verification.deviations import Deviation, largest
from fifesim.rasters import grid as grids
from fifesim.sensor.description.instruments import instrument

_deviation = partial(Deviation, "atmosphere")

_WEIGHTS = 0.3, 0.6  # of molecules and aerosol; a tenth is the target's own


def _functions():
    """The second and third by the transmittances of 6S: band means for its sum over wavelengths."""
    nadir = datasets.table("verification/sixs_environment.csv")
    found = adjacency.environment_function(1000 * nadir["radius"].to_numpy())
    worst = largest(found, nadir[["molecules", "aerosol"]].to_numpy().T)
    yield _deviation("environment function, nadir", worst, 1e-6, "1", "6SV1.1")
    table = {name: column.to_numpy() for name, column in datasets.table("verification/sixs_adjacency.csv").items()}
    up = table["diffuse_up_molecules"], table["diffuse_up_aerosol"]
    share = adjacency.mixed_environment_function(1000 * table["radius"], table["vza"], *up)
    worst = np.maximum(
        largest(share, table["environment_function"]),
        largest(adjacency.mixed_environment_function(60.0, 0.0, 0.0, 0.0), 1.0),  # nothing scatters
    )
    yield _deviation("environment function, mixed", worst, 0.002, "1", "6SV1.1")
    around = share * table["target_reflectance"] + (1 - share) * table["environment_reflectance"]
    table["path_reflectance"] = table["path_reflectance"] / table["gas_transmittance"]
    terms = TargetTerms(*(table[name] for name in TargetTerms._fields))
    found = inhomogeneous_reflectance(table["target_reflectance"], around, terms)
    worst = largest(found, table["toa_reflectance"])
    yield _deviation("round target, apparent reflectance", worst, 0.002, "1", "6SV1.1")


def _density(radius):
    """Of the environment's light at nadir, the published function's derivative over the circle. [m-2]"""
    r = radius / 1000
    molecules = 0.930 * 0.080 * np.exp(-0.080 * r) + 0.070 * 1.10 * np.exp(-1.10 * r)
    aerosol = 0.448 * 0.27 * np.exp(-0.27 * r) + 0.552 * 2.83 * np.exp(-2.83 * r)
    return (_WEIGHTS[0] * molecules + _WEIGHTS[1] * aerosol) / 1000 / (2 * np.pi * radius)


def _point_spread():
    """Beyond the eighth cell edges have fewer nodes. What lies in the target's own cell is integrated by angle."""
    (down, across), (nodes, weights) = (60.0, 75.0), leggauss(40)
    found = adjacency.point_spread((13, 31), (down, across), 0.0, *_WEIGHTS)
    worst = 0.0
    for row, column in ((0, 1), (1, 0), (1, 1), (3, 2), (9, 0), (12, 30)):
        radius = np.hypot(((row + nodes / 2) * down)[:, None], (column + nodes / 2) * across)
        expected = weights @ _density(radius) @ weights * down * across / 4
        worst = np.maximum(worst, largest(found[row, column], expected, relative=True))
    own, corner = 1 - sum(_WEIGHTS), np.arctan2(down, across)
    for low, high, edge in ((0, corner, lambda a: across / np.cos(a)), (corner, np.pi / 2, lambda a: down / np.sin(a))):
        molecules, aerosol = adjacency.environment_function(edge(low + (high - low) * (nodes + 1) / 2) / 2)
        own += weights @ (_WEIGHTS[0] * molecules + _WEIGHTS[1] * aerosol) * (high - low) / np.pi
    worst = np.maximum(worst, largest(found[0, 0], own, relative=True))
    yield _deviation("point spread of the environment", worst, 1e-7, "1", "Tanre et al. (1981), quadrature")


def _raster(values, cell, west=700_020.0, north=4_330_020.0):
    """In UTM; 60 m are a block, and 699 960 and 4 330 020 are whole numbers of it."""
    grid = grids.grid_at("EPSG:26914", west, north, values.shape[-1] * cell, values.shape[-2] * cell, cell)
    return grids.place(xr.DataArray(values, dims=("band", "y", "x"), name="surface_reflectance"), grid)


def _scene():
    """19 x 23 cells of 20 m, which begin within a block of 3 x 3, with a hole."""
    values = np.random.default_rng(1).random((1, 19, 23)) * 0.6
    values[0, 4:9, 10:14] = np.nan
    return _raster(values, 20.0, west=700_000.0, north=4_330_000.0)


def _direct_sums():
    scene, far, vza = _scene(), 0.2, 40.0
    found = adjacency_raster.environment(scene.chunk(y=8, x=10), *_WEIGHTS, vza, surroundings=far)[0]
    first = grids.lattice_position(grids.geobox(scene))
    places = [start + np.arange(size) for start, size in zip(first, scene.shape[1:], strict=True)]
    rows, columns = (np.arange(place[0] // 3 - 1, place[-1] // 3 + 2) for place in places)
    spread = adjacency.point_spread((30, 30), (60.0, 60.0), vza, *_WEIGHTS)
    total, missing = np.zeros((rows.size, columns.size)), np.zeros((rows.size, columns.size))
    for (i, j), value in np.ndenumerate(scene.values[0]):
        seen = spread[np.abs(rows - places[0][i] // 3)[:, None], np.abs(columns - places[1][j] // 3)] / 9
        total += 0.0 if np.isnan(value) else seen * (value - far)
        missing += seen * np.isnan(value)
    around = far + total / (1 - missing)
    # Linear between the middles of blocks.
    down = np.array([np.interp((places[0] - 1) / 3, rows, each) for each in around.T])
    expected = np.array([np.interp((places[1] - 1) / 3, columns, each) for each in down.T])
    yield _deviation("environment of cells", largest(found, expected), 1e-12, "1", "sum over cells one by one")


def _part_of_a_scene():
    """The rest of it as surroundings is what it is within."""
    whole = _raster(np.random.default_rng(2).random((1, 60, 72)) * 0.6, 20.0, west=699_960.0)
    far, inside = float(whole.mean()), {"y": slice(21, 45), "x": slice(12, 54)}
    expected = adjacency_raster.environment(whole, *_WEIGHTS, 0.0, surroundings=far).isel(inside)
    found = adjacency_raster.environment(whole.isel(inside), *_WEIGHTS, 0.0, surroundings=whole)
    yield _deviation("environment of a part of a scene", largest(found, expected), 1e-12, "1", "that of the whole")


def _discs():
    """Transmittances of 6S; the ground is spread over blocks of 60 m, the disc's middle being that of one."""
    table = datasets.table("verification/sixs_adjacency.csv").query("0.3 <= radius <= 1.5").iloc[::5]
    worst = 0.0
    for row in table.itertuples():
        half = int(row.radius * 1000 / 20) + 7
        centre = np.arange(-half, half + 1) * 20.0
        inside = np.hypot(centre[:, None], centre) < 1000 * row.radius
        values = np.where(inside, row.target_reflectance, row.environment_reflectance)[None]
        disc = _raster(values, 20.0, west=700_050.0 - 20.0 * half - 10.0, north=4_330_050.0 + 20.0 * half + 10.0)
        terms = BandTerms(**{name: np.array([getattr(row, name, np.nan)]) for name in BandTerms._fields})
        terms = terms._replace(
            path_reflectance=terms.path_reflectance / terms.gas_transmittance,
            transmittance_up=terms.direct_transmittance_up + row.diffuse_transmittance_up,
        )
        found = adjacency_raster.apparent_reflectance_of_scene(disc, terms, row.vza, row.environment_reflectance)
        worst = np.maximum(worst, abs(float(found[0, half, half]) - row.toa_reflectance))
    yield _deviation("middle of a disc of cells", worst, 0.001, "1", "6SV1.1")


def _there_and_back():
    """The environment is solved to 1e-12."""
    scene, worst = _scene(), 0.0
    bands = instrument("TM").select(["TM1"])
    terms = band_terms(Atmosphere(visibility=10.0), [band.response for band in bands], 40.0, 30.0, 60.0)
    for surroundings in (None, 0.3):
        toa = adjacency_raster.apparent_reflectance_of_scene(scene, terms, 30.0, surroundings)
        back = adjacency_raster.corrected_reflectance_of_scene(toa, terms, 30.0, surroundings)
        worst = np.maximum(worst, largest(back.fillna(-1.0), scene.fillna(-1.0)))
    yield _deviation("scene with adjacency, there and back", worst, 1e-10, "1", "theory")


CHECKS = (_functions, _point_spread, _direct_sums, _part_of_a_scene, _discs, _there_and_back)
