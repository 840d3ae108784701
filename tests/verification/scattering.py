"""Checks of scattering and of the adjacency effect: closed forms, quadratures and published tables."""

from functools import partial

import numpy as np
import xarray as xr
from numpy.polynomial.legendre import leggauss, legval, legvander
from scipy.integrate import quad

from fifesim.atmosphere import adjacency, adjacency_labels
from fifesim.atmosphere import column as phase_expansion
from fifesim.atmosphere.aerosols import aerosol_optics, aerosol_phase
from fifesim.atmosphere.coupling import BandTerms, TargetTerms, inhomogeneous_reflectance
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.gases import DEPOLARIZATION, rayleigh_phase
from fifesim.atmosphere.lookup import once_reflectance, scattered_once
from fifesim.atmosphere.models import Atmosphere
from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance
from fifesim.base.geometry import scattering_angle_cosine
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument
from verification import tables
from verification.deviations import Deviation, largest

_deviation = partial(Deviation, "atmosphere")

_COSINE, _WEIGHTS = leggauss(40)
_SINE = np.sqrt(1 - _COSINE**2)

# Moments of Rayleigh's scattering matrix without depolarization.
_PURE_RAYLEIGH = np.array([[1, 0, 0, 0], [0, 0, 0, 0], [0.1, 0.6, 0, np.sqrt(6) / 10]])


def _wigner_functions():
    """Check Wigner functions: known for the lowest degree, and orthogonal for one order and spin."""
    lowest = {
        (0, 0): np.ones_like(_COSINE),
        (1, 0): -_SINE / np.sqrt(2),
        (0, 2): np.sqrt(6) / 4 * _SINE**2,
        (1, 2): _SINE * (1 + _COSINE) / 2,
        (2, 2): ((1 + _COSINE) / 2) ** 2,
        (2, -2): ((1 - _COSINE) / 2) ** 2,
    }
    degrees, worst = np.arange(24), 0.0
    for (order, spin), expected in lowest.items():
        found, first = phase_expansion.wigner(order, spin, _COSINE, degrees.size), max(order, abs(spin))
        norm = np.diag(2 / (2 * degrees + 1) * (degrees >= first))
        worst = np.max([worst, largest(found[first], expected), largest((found * _WEIGHTS) @ found.T, norm)])
    found = phase_expansion.wigner(0, 0, _COSINE, degrees.size).T
    worst = np.maximum(worst, largest(found, legvander(_COSINE, degrees[-1])))
    yield _deviation("Wigner functions", worst, 1e-12, "1", "closed forms, orthogonality")


def _expansions():
    """Check the expansion of the scattering matrix of molecules, a polynomial of the second degree in the cosine."""
    anisotropy = 2 * (1 - DEPOLARIZATION) / (2 + DEPOLARIZATION)
    phase, crossed = rayleigh_phase(_COSINE), -0.75 * anisotropy * _SINE**2
    expansion = phase_expansion.rayleigh_expansion(4)
    beta, alpha, zeta, gamma = expansion.T
    linear, polarizing = (phase_expansion.wigner(order, 2, _COSINE, 4) for order in (2, 0))
    found = legval(_COSINE, beta), (alpha + zeta) @ linear, -gamma @ polarizing
    worst = largest(found, [phase, 0.75 * anisotropy * (1 + _COSINE) ** 2, crossed])
    yield _deviation("series of the scattering matrix of molecules", worst, 1e-12, "1", "Rayleigh")
    moments = phase_expansion.matrix_moments(phase, -crossed / phase, _COSINE, _WEIGHTS, 4)
    # Both of the linear ones are taken from F11.
    from_phase = linear @ (_WEIGHTS * phase) / 2
    orders = 2 * np.arange(4) + 1
    worst = largest(moments.T, [beta / orders, from_phase, from_phase, gamma / orders])
    yield _deviation("moments of the scattering matrix of molecules", worst, 1e-12, "1", "Rayleigh")
    asymmetry, orders = 0.7, np.arange(12)
    moments = np.outer(asymmetry ** np.arange(40.0), [1.0, 0.5, 0.25, 0.0])
    expansion, peak = phase_expansion.truncated_expansion(moments, orders.size)
    forward = np.outer(orders >= 0, [1, 0, 0, 0]) + np.outer(orders >= 2, [0, 1, 1, 0])
    expected = (2 * orders[:, None] + 1) * (moments[: orders.size] - asymmetry**12 * forward) / (1 - asymmetry**12)
    worst = np.maximum(largest(expansion, expected), largest(peak, asymmetry**12))
    yield _deviation("series without the forward peak", worst, 1e-12, "1", "Henyey and Greenstein")


def _polarized():
    """Check polarized light of molecules."""
    # 60 layers of constant source are good to 5e-4 at a grazing view, and to 1e-3 in the contribution of bright ground
    # there.
    table = tables.table("polarized_molecules.csv")
    mu_s = table["mu_s"][0]
    black, bright = table[table["ground"] == 0], table[table["ground"] > 0]
    found = mu_s * _reflectance(black, mu_s, 0.5, 1.0, _PURE_RAYLEIGH, lambda cosine: 0.75 * (1 + cosine**2))
    worst = 100 * largest(found, black["intensity"], relative=True)
    yield _deviation("polarized light of molecules", worst, 0.05, "%", "Natraj et al. (2009)")
    zenith = np.degrees(np.arccos([mu_s, *bright["mu_v"]]))
    transmittance, albedo = flux_transmittance(0.0, 0.5, 1.0, _PURE_RAYLEIGH, zenith)
    ground = bright["ground"].to_numpy()
    found = mu_s * ground * transmittance[0] * transmittance[1:] / (1 - ground * albedo)
    dark = black.set_index(["mu_v", "raa"])["intensity"].loc[list(zip(bright["mu_v"], bright["raa"], strict=True))]
    added = bright["intensity"].to_numpy() - dark.to_numpy()
    worst = 100 * largest(found, added, relative=True)
    yield _deviation("and over bright ground", worst, 0.12, "%", "Natraj et al. (2009)")
    series = tables.table("spheres_expansion.csv")
    coefficients = series[["beta", "alpha", "zeta", "gamma"]].to_numpy()
    moments = coefficients / (2 * series["order"].to_numpy()[:, None] + 1)
    table = tables.table("spheres_radiance.csv")
    found = 0.6 * _reflectance(table, 0.6, 1.0, 0.973527, moments, lambda cosine: legval(cosine, coefficients[:, 0]))
    yield _deviation("polarized light of spheres", largest(found, table["intensity"]), 6e-5, "1", "Siewert (2000)")


def _reflectance(table, mu_s, tau, albedo, moments, phase):
    """Reflectance of one layer of particles at the view of each row. [1]"""
    (mu_v, views), (raa, azimuths) = (np.unique(table[name], return_inverse=True) for name in ("mu_v", "raa"))
    sza, vza = np.degrees(np.arccos(mu_s)), np.degrees(np.arccos(mu_v))
    cosine = scattering_angle_cosine(sza, vza[:, None], raa)
    return path_reflectance(0.0, tau, albedo, moments, phase(cosine), sza, vza, raa)[views, azimuths]


def _once():
    """Check single scattering, exact backscatter included; the phase function is tabulated at 0.25 degrees."""
    band, worst = instrument("TM").select(["TM3"])[0].response, 0.0
    at = np.array([band.center])
    cases = ("5S", (40.0, 25.0, 130.0)), ("successive-orders", (55.0, 40.0, 20.0)), ("5S", (35.0, 35.0, 0.0))
    for engine, angles in cases:
        air = Atmosphere(visibility=10.0, altitude=0.0, engine=engine)
        found = once_reflectance(*angles, scattered_once(air, (band,)))
        mu_s, mu_v = np.cos(np.radians(angles[:2]))
        # The closed forms neglect molecules above the aerosol.
        above = 0.0 if engine == "5S" else float(air.rayleigh_optical_depth(at)[0])
        depth, (_, albedo, _) = float(air.aerosol_optical_depth(at)[0]), aerosol_optics(air.aerosol, at)
        reached, _ = quad(_both_ways, above, above + depth, args=(mu_s, mu_v))
        phase = aerosol_phase(air.aerosol, scattering_angle_cosine(*angles), at)
        worst = np.maximum(worst, largest(found, albedo * phase / (4 * mu_s * mu_v) * reached, relative=True))
    yield _deviation("light that the aerosol scatters once", 100 * worst, 0.01, "%", "quadrature over its depth")


def _both_ways(depth, mu_s, mu_v):
    return np.exp(-depth / mu_s) * np.exp(-depth / mu_v)


CHECKS = (_wigner_functions, _expansions, _polarized, _once)


_PATH_WEIGHTS = 0.3, 0.6  # of molecules and aerosol; a tenth is from the target itself


def _functions():
    """Check the environment function against the published one and against 6S, the latter by its transmittances."""
    nadir = tables.table("sixs_environment.csv")
    found = adjacency.environment_function(1000 * nadir["radius"].to_numpy())
    worst = largest(found, nadir[["molecules", "aerosol"]].to_numpy().T)
    yield _deviation("environment function, nadir", worst, 1e-6, "1", "6SV1.1")
    table = {name: column.to_numpy() for name, column in tables.table("sixs_adjacency.csv").items()}
    up = table["diffuse_up_molecules"], table["diffuse_up_aerosol"]
    share = adjacency.mixed_environment_function(1000 * table["radius"], table["vza"], *up)
    without_scattering = largest(adjacency.mixed_environment_function(60.0, 0.0, 0.0, 0.0), 1.0)
    worst = np.maximum(largest(share, table["environment_function"]), without_scattering)
    yield _deviation("environment function, mixed", worst, 0.002, "1", "6SV1.1")
    around = share * table["target_reflectance"] + (1 - share) * table["environment_reflectance"]
    table["path_reflectance"] = table["path_reflectance"] / table["gas_transmittance"]
    terms = TargetTerms(*(table[name] for name in TargetTerms._fields))
    found = inhomogeneous_reflectance(table["target_reflectance"], around, terms)
    worst = largest(found, table["toa_reflectance"])
    yield _deviation("round target, apparent reflectance", worst, 0.002, "1", "6SV1.1")


def _density(radius):
    """Density of the environment at nadir: derivative of the published function over the circumference. [m-2]"""
    r = radius / 1000
    molecules = 0.930 * 0.080 * np.exp(-0.080 * r) + 0.070 * 1.10 * np.exp(-1.10 * r)
    aerosol = 0.448 * 0.27 * np.exp(-0.27 * r) + 0.552 * 2.83 * np.exp(-2.83 * r)
    return (_PATH_WEIGHTS[0] * molecules + _PATH_WEIGHTS[1] * aerosol) / 1000 / (2 * np.pi * radius)


def _point_spread():
    """Check the point spread by quadrature; the cell of the target is integrated by angle."""
    # Beyond the eighth cell, edges have fewer nodes.
    (down, across), (nodes, weights) = (60.0, 75.0), leggauss(40)
    found = adjacency.point_spread((13, 31), (down, across), 0.0, *_PATH_WEIGHTS)
    worst = 0.0
    for row, column in ((0, 1), (1, 0), (1, 1), (3, 2), (9, 0), (12, 30)):
        radius = np.hypot(((row + nodes / 2) * down)[:, None], (column + nodes / 2) * across)
        expected = weights @ _density(radius) @ weights * down * across / 4
        worst = np.maximum(worst, largest(found[row, column], expected, relative=True))
    own, corner = 1 - sum(_PATH_WEIGHTS), np.arctan2(down, across)
    for low, high, edge in ((0, corner, lambda a: across / np.cos(a)), (corner, np.pi / 2, lambda a: down / np.sin(a))):
        molecules, aerosol = adjacency.environment_function(edge(low + (high - low) * (nodes + 1) / 2) / 2)
        own += weights @ (_PATH_WEIGHTS[0] * molecules + _PATH_WEIGHTS[1] * aerosol) * (high - low) / np.pi
    worst = np.maximum(worst, largest(found[0, 0], own, relative=True))
    yield _deviation("point spread of the environment", worst, 1e-7, "1", "Tanre et al. (1981), quadrature")


def _raster(values, cell, west=700_020.0, north=4_330_020.0):
    """Labelled raster in UTM; 60 m are a block, and 699 960 and 4 330 020 are whole multiples of it."""
    grid = grids.grid_at("EPSG:26914", west, north, values.shape[-1] * cell, values.shape[-2] * cell, cell)
    return grids.place(xr.DataArray(values, dims=("band", "y", "x"), name="surface_reflectance"), grid)


def _scene():
    """Raster of 19 x 23 cells of 20 m with a hole, which starts inside a block of 3 x 3 cells."""
    values = np.random.default_rng(1).random((1, 19, 23)) * 0.6
    values[0, 4:9, 10:14] = np.nan
    return _raster(values, 20.0, west=700_000.0, north=4_330_000.0)


def _direct_sums():
    scene, far, vza = _scene(), 0.2, 40.0
    found = adjacency_labels.environment(scene.chunk(y=8, x=10), *_PATH_WEIGHTS, vza, surroundings=far)[0]
    first = grids.lattice_position(grids.geobox(scene))
    places = [start + np.arange(size) for start, size in zip(first, scene.shape[1:], strict=True)]
    rows, columns = (np.arange(place[0] // 3 - 1, place[-1] // 3 + 2) for place in places)
    spread = adjacency.point_spread((30, 30), (60.0, 60.0), vza, *_PATH_WEIGHTS)
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
    """Check that a part of a scene, with the rest as surroundings, has the environment of the whole."""
    whole = _raster(np.random.default_rng(2).random((1, 60, 72)) * 0.6, 20.0, west=699_960.0)
    far, inside = float(whole.mean()), {"y": slice(21, 45), "x": slice(12, 54)}
    expected = adjacency_labels.environment(whole, *_PATH_WEIGHTS, 0.0, surroundings=far).isel(inside)
    found = adjacency_labels.environment(whole.isel(inside), *_PATH_WEIGHTS, 0.0, surroundings=whole)
    yield _deviation("environment of a part of a scene", largest(found, expected), 1e-12, "1", "that of the whole")


def _discs():
    """Check discs against 6S by its transmittances; the middle of each disc is the centre of a block of 60 m."""
    table = tables.table("sixs_adjacency.csv").query("0.3 <= radius <= 1.5").iloc[::5]
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
        found = adjacency_labels.apparent_reflectance_of_scene(disc, terms, row.vza, row.environment_reflectance)
        worst = np.maximum(worst, abs(float(found[0, half, half]) - row.toa_reflectance))
    yield _deviation("middle of a disc of cells", worst, 0.001, "1", "6SV1.1")


def _there_and_back():
    """Check that simulation and correction are inverse; the environment is solved to 1e-12."""
    scene, worst = _scene(), 0.0
    bands = instrument("TM").select(["TM1"])
    terms = band_terms(Atmosphere(visibility=10.0), [band.response for band in bands], 40.0, 30.0, 60.0)
    for surroundings in (None, 0.3):
        toa = adjacency_labels.apparent_reflectance_of_scene(scene, terms, 30.0, surroundings)
        back = adjacency_labels.corrected_reflectance_of_scene(toa, terms, 30.0, surroundings)
        worst = np.maximum(worst, largest(back.fillna(-1.0), scene.fillna(-1.0)))
    yield _deviation("scene with adjacency, there and back", worst, 1e-10, "1", "theory")


ADJACENCY_CHECKS = (_functions, _point_spread, _direct_sums, _part_of_a_scene, _discs, _there_and_back)
