"""Checks of the atmosphere: 6SV1.1 for the bands of Landsat TM, theory, and light from outside of a pixel."""

from functools import partial
from itertools import product

import numpy as np
import pandas as pd
import xarray as xr
from numpy.polynomial.legendre import leggauss
from scipy.integrate import quad

from fifesim.atmosphere import adjacency, adjacency_labels
from fifesim.atmosphere.aerosols import aerosol_optics, aerosol_phase
from fifesim.atmosphere.coupling import (
    BandTerms,
    TargetTerms,
    apparent_reflectance,
    corrected_reflectance,
    inhomogeneous_reflectance,
    target_reflectance,
)
from fifesim.atmosphere.engines import band_terms, scattering
from fifesim.atmosphere.lookup import once_reflectance, scattered_once, varying_diffuse_fraction, varying_reflectance
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band
from fifesim.base.geometry import relative_azimuth, scattering_angle_cosine
from fifesim.grids import grid as grids
from fifesim.sensor.description.instruments import instrument
from verification import tables
from verification.tables import Deviation, largest, rms_percent

_deviation = partial(Deviation, "atmosphere")
_from_6s = partial(_deviation, source="6SV1.1")

_VISIBLE = ("TM1", "TM2", "TM3", "TM4")
_BANDS = (*_VISIBLE, "TM5", "TM7")
_CASE = ["profile", "aerosol", "visibility", "altitude", "sza", "vza", "raa"]

_CLEAR_BOUNDS = (1.8, 1.2, 0.9, 0.8, 0.6, 0.5)
_ALL_BOUND = 3.2


def _terms(table, engine):
    """Terms of the coupling equation for the band of each row."""
    responses = {band.name: band.response for band in instrument("TM").bands}
    parts = []
    for (profile, aerosol, visibility, altitude, *angles), rows in table.groupby(_CASE):
        atmosphere = Atmosphere(
            profile=profile, aerosol=aerosol, visibility=visibility, altitude=altitude, engine=engine
        )
        names = rows["band"].unique()
        terms = band_terms(atmosphere, [responses[name] for name in names], *angles)
        each = np.array([list(names).index(name) for name in rows["band"]])
        parts.append(pd.DataFrame({name: values[each] for name, values in terms._asdict().items()}, index=rows.index))
    found = pd.concat(parts).loc[table.index]
    return BandTerms(*(found[name].to_numpy() for name in BandTerms._fields))


def _columns():
    table = tables.table("sixs_columns.csv")
    atmospheres = [Atmosphere(profile=row.profile, altitude=row.altitude) for row in table.itertuples()]
    for name in ("pressure", "water_vapour", "ozone"):
        found = [getattr(atmosphere, name) for atmosphere in atmospheres]
        worst = 100 * largest(found, table[name], relative=True)
        yield _from_6s(f"{name.replace('_', ' ')} of the profiles", worst, 1.0, "%")


def _optical_depths():
    table = tables.table("sixs_molecules.csv")
    found = [
        float(Atmosphere(profile=row.profile, altitude=row.altitude).rayleigh_optical_depth(row.wavelength))
        for row in table.itertuples()
    ]
    worst = 100 * largest(found, table["optical_depth"], relative=True)
    yield _from_6s("optical depth of the molecules", worst, 1.0, "%")
    for aerosol, rows in tables.table("sixs_aerosol.csv").groupby("aerosol"):
        found = Atmosphere(aerosol=aerosol, aot=1.0).aerosol_optical_depth(rows["wavelength"].to_numpy())
        worst = 100 * largest(found, rows["relative_optical_depth"], relative=True)
        yield _from_6s(f"optical depth of {aerosol} aerosol", worst, 1.0, "%")
    table = tables.table("sixs_visibility.csv")
    found = [Atmosphere(visibility=visibility).aot for visibility in table["visibility"]]
    yield _from_6s("optical thickness by visibility", 100 * largest(found, table["aot"], relative=True), 1.0, "%")


def _five_s():
    table = tables.table("sixs_grid.csv")
    terms = _terms(table, "5S")
    found, expected = apparent_reflectance(0.3, **terms.uniform), table["toa_reflectance"].to_numpy()
    # The closed forms are best in clear air, below a high sun and near nadir.
    clear = ((table["visibility"] >= 23) & (table["sza"] <= 45) & (table["vza"] <= 20)).to_numpy()
    for band, bound in zip(_BANDS, _CLEAR_BOUNDS, strict=True):
        rows = (table["band"] == band).to_numpy()
        percent = rms_percent(found[rows & clear], expected[rows & clear])
        yield _from_6s(f"5S, clear and high sun, {band}, rms", percent, bound, "%")
        percent = rms_percent(found[rows], expected[rows])
        yield _from_6s(f"5S, every aerosol and angle, {band}, rms", percent, _ALL_BOUND, "%")
        worst = largest(terms.gas_transmittance[rows], table["gas_transmittance"][rows])
        yield _from_6s(f"gases, {band}, two-way transmittance", worst, 0.002, "1")


def _successive_orders():
    table = tables.table("sixs_grid.csv")
    rows = table[table["band"].isin(_VISIBLE)]
    terms = _terms(rows, "successive-orders")
    found = {
        "path": (terms.path_reflectance * terms.gas_transmittance, 1.0),
        "toa": (apparent_reflectance(0.3, **terms.uniform), 0.3),
    }
    for (name, (values, bound)), band in product(found.items(), _VISIBLE):
        of_band = (rows["band"] == band).to_numpy()
        percent = rms_percent(values[of_band], rows[f"{name}_reflectance"][of_band])
        yield _from_6s(f"successive orders, {band}, {name}, rms", percent, bound, "%")


def _sunbeam():
    """Check that direct light falls off with the total optical depth, and that the rest is skylight."""
    wavelength, sza, vza = np.array([0.47, 0.86]), 50.0, np.array([0.0, 30.0])
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))[:, None]
    for engine in ("5S", "successive-orders"):
        air = Atmosphere(visibility=10.0, engine=engine)
        light = scattering(air, wavelength, sza, vza, np.zeros(1))
        depth = air.rayleigh_optical_depth(wavelength) + air.aerosol_optical_depth(wavelength)
        down, up = largest(light.direct_transmittance_down, np.exp(-depth / mu_s)), light.direct_transmittance_up[:, 0]
        worst = np.max([down, largest(up, np.exp(-depth / mu_v)), largest(light.optical_depth, depth)])
        yield _from_6s(f"{engine}, sunbeam", worst, 1e-12, "1", source="Bouguer's law")
    terms = band_terms(Atmosphere(visibility=10.0), [Band("green", (0.55, 0.56), (1, 1))], sza, 0.0, 0.0)
    beam = terms.transmittance_down * (1 - terms.diffuse_fraction)
    worst = largest(beam, terms.direct_transmittance_down)
    yield _from_6s("sunbeam and skylight", worst, 1e-12, "1", source="theory")


def _there_and_back():
    reflectance = np.linspace(-0.02, 1.0, 52)
    # Path reflectance, transmittance down and up, spherical albedo, and transmittance of the gases.
    terms = 0.11, 0.8, 0.87, 0.19, 0.93
    back = corrected_reflectance(apparent_reflectance(reflectance, *terms), *terms)
    yield _from_6s("reflectance there and back", largest(back, reflectance), 1e-12, "1", source="theory")
    around, terms = reflectance[:, None], TargetTerms(0.11, 0.8, 0.6, 0.27, 0.19, 0.93)
    back = target_reflectance(inhomogeneous_reflectance(reflectance, around, terms), around, terms)
    worst = largest(back, np.broadcast_to(reflectance, back.shape))
    yield _from_6s("target there and back", worst, 1e-12, "1", source="theory")


def _varying():
    """Check interpolation in varying geometry."""
    # Cubics in the angles: 3e-5, and 0 at their nodes; the sun by a spline: 4e-5 where it is low.
    bands = tuple(band.response for band in instrument("TM").select(["TM1", "TM3"]))
    air = Atmosphere(visibility=23.0)
    ground = np.array([[0.05, 0.4], [0.3, 0.1], [0.2, 0.6], [0.5, 0.02]])
    # Altitude [km], and zenith and azimuth of the sun and of the view [degree] of the cells.
    suns, views = ([72.6, 73.9, 74.6, 73.1], [10.0, 80.0, 300.0, 120.0]), ([3.0, 20.0, 44.0, 61.0], [70.0] * 4)
    between = [3.05, 3.6, 3.7, 3.9], *suns, *views
    ends = [4.0, 3.5], [75.0, 72.5], [180.0, 40.0], [75.0, 0.0], [0.0, 40.0]
    for what, bound, places in (
        ("geometry by cell", 5e-5, np.array(between)),
        ("geometry at the ends of tables", 1e-12, np.array(ends)),
    ):
        cells = ground[: places.shape[1]]
        found = varying_reflectance(cells, *places, atmosphere=air, bands=bands).T
        back = varying_reflectance(found, *places, atmosphere=air, bands=bands, to_surface=True).T
        worst = largest(found, [_one_cell(air, bands, *cell) for cell in zip(cells, *places, strict=True)])
        yield _from_6s(what, worst, bound, "1", source="terms of each cell")
        yield _from_6s(f"{what}, there and back", largest(back, cells), 1e-12, "1", source="theory")
    suns = np.array([3.3, 28.7, 51.1, 74.0])
    expected = [band_terms(air, bands, sun, 0.0, 0.0).diffuse_fraction for sun in suns]
    worst = largest(varying_diffuse_fraction(suns, atmosphere=air, bands=bands).T, expected)
    yield _from_6s("share of skylight by cell", worst, 1e-4, "1", source="terms of each cell")


def _one_cell(air, bands, reflectance, altitude, sza, saa, vza, vaa):
    terms = band_terms(air.above(altitude), bands, sza, vza, relative_azimuth(saa, vaa))
    return apparent_reflectance(reflectance, **terms.uniform)


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


_PATH_WEIGHTS = 0.3, 0.6  # of molecules and aerosol; a tenth is from the target itself


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


def _scene_and_back():
    """Check that simulation and correction are inverse; the environment is solved to 1e-12."""
    scene, worst = _scene(), 0.0
    bands = instrument("TM").select(["TM1"])
    terms = band_terms(Atmosphere(visibility=10.0), [band.response for band in bands], 40.0, 30.0, 60.0)
    for surroundings in (None, 0.3):
        toa = adjacency_labels.apparent_reflectance_of_scene(scene, terms, 30.0, surroundings)
        back = adjacency_labels.corrected_reflectance_of_scene(toa, terms, 30.0, surroundings)
        worst = np.maximum(worst, largest(back.fillna(-1.0), scene.fillna(-1.0)))
    yield _deviation("scene with adjacency, there and back", worst, 1e-10, "1", "theory")


CHECKS = (
    _once, _columns, _optical_depths, _sunbeam, _there_and_back, _varying, _five_s,
    _successive_orders, _point_spread, _direct_sums, _part_of_a_scene, _scene_and_back,
)  # fmt: skip
