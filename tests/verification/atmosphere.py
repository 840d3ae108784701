"""
Checks of the atmosphere against tables of 6SV1.1 for the bands of Landsat TM, and of its engines against each other.
"""

from functools import partial
from itertools import product

import numpy as np
import pandas as pd

from fifesim.atmosphere.coupling import (
    BandTerms,
    TargetTerms,
    apparent_reflectance,
    corrected_reflectance,
    inhomogeneous_reflectance,
    target_reflectance,
)
from fifesim.atmosphere.engines import band_terms, scattering
from fifesim.atmosphere.lookup import varying_diffuse_fraction, varying_reflectance
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import Band
from fifesim.base.geometry import relative_azimuth
from fifesim.sensor.description.instruments import instrument
from verification import tables
from verification.deviations import Deviation, largest, rms_percent

_deviation = partial(Deviation, "atmosphere", source="6SV1.1")

_VISIBLE = ("TM1", "TM2", "TM3", "TM4")
_BANDS = (*_VISIBLE, "TM5", "TM7")
_CASE = ["profile", "aerosol", "visibility", "altitude", "sza", "vza", "raa"]

# Accuracy of the closed forms, which lack polarization and joint scattering by molecules and aerosol (in the blue).
_FIFE_BOUNDS = (0.007, 0.004, 0.0025, 0.002, 0.001, 0.001)
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
        yield _deviation(f"{name.replace('_', ' ')} of the profiles", worst, 1.0, "%")


def _optical_depths():
    table = tables.table("sixs_molecules.csv")
    found = [
        float(Atmosphere(profile=row.profile, altitude=row.altitude).rayleigh_optical_depth(row.wavelength))
        for row in table.itertuples()
    ]
    worst = 100 * largest(found, table["optical_depth"], relative=True)
    yield _deviation("optical depth of the molecules", worst, 1.0, "%")
    for aerosol, rows in tables.table("sixs_aerosol.csv").groupby("aerosol"):
        found = Atmosphere(aerosol=aerosol, aot=1.0).aerosol_optical_depth(rows["wavelength"].to_numpy())
        worst = 100 * largest(found, rows["relative_optical_depth"], relative=True)
        yield _deviation(f"optical depth of {aerosol} aerosol", worst, 1.0, "%")
    table = tables.table("sixs_visibility.csv")
    found = [Atmosphere(visibility=visibility).aot for visibility in table["visibility"]]
    yield _deviation("optical thickness by visibility", 100 * largest(found, table["aot"], relative=True), 1.0, "%")


def _five_s_at_fife():
    table = tables.table("sixs_fife.csv")
    found = apparent_reflectance(table["surface_reflectance"].to_numpy(), **_terms(table, "5S").uniform)
    for band, bound in zip(_BANDS, _FIFE_BOUNDS, strict=True):
        rows = (table["band"] == band).to_numpy()
        worst = largest(found[rows], table["toa_reflectance"][rows])
        yield _deviation(f"5S, FIFE case, {band}", worst, bound, "1")


def _five_s():
    table = tables.table("sixs_grid.csv")
    terms = _terms(table, "5S")
    found, expected = apparent_reflectance(0.3, **terms.uniform), table["toa_reflectance"].to_numpy()
    # The closed forms are best in clear air, below a high sun and near nadir.
    clear = ((table["visibility"] >= 23) & (table["sza"] <= 45) & (table["vza"] <= 20)).to_numpy()
    for band, bound in zip(_BANDS, _CLEAR_BOUNDS, strict=True):
        rows = (table["band"] == band).to_numpy() & clear
        yield _deviation(f"5S, clear and high sun, {band}, rms", rms_percent(found[rows], expected[rows]), bound, "%")
    for band in _BANDS:
        rows = (table["band"] == band).to_numpy()
        percent = rms_percent(found[rows], expected[rows])
        yield _deviation(f"5S, every aerosol and angle, {band}, rms", percent, _ALL_BOUND, "%")
    for band in _BANDS:
        rows = (table["band"] == band).to_numpy()
        worst = largest(terms.gas_transmittance[rows], table["gas_transmittance"][rows])
        yield _deviation(f"gases, {band}, two-way transmittance", worst, 0.002, "1")


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
        yield _deviation(f"successive orders, {band}, {name}, rms", percent, bound, "%")


def _light():
    """Check the parts of the transmittances; 5S adds the albedos of molecules and aerosol, an error of 0.05 in haze."""
    table = tables.table("sixs_adjacency.csv")
    hazy = table[table["visibility"] == 10]
    names = ("transmittance_down", "direct_transmittance_up", "diffuse_up_molecules", "diffuse_up_aerosol")
    for engine, albedo, bound in (("5S", 0.05, 0.004), ("successive-orders", 0.002, 0.0015)):
        terms = _terms(hazy, engine)
        worst = np.max([largest(getattr(terms, name), hazy[name]) for name in names])
        yield _deviation(f"{engine}, transmittances in haze", worst, bound, "1")
        worst = largest(terms.spherical_albedo, hazy["spherical_albedo"])
        yield _deviation(f"{engine}, spherical albedo in haze", worst, albedo, "1")


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
        yield _deviation(f"{engine}, sunbeam", worst, 1e-12, "1", source="Bouguer's law")
    terms = band_terms(Atmosphere(visibility=10.0), [Band("green", (0.55, 0.56), (1, 1))], sza, 0.0, 0.0)
    beam = terms.transmittance_down * (1 - terms.diffuse_fraction)
    worst = largest(beam, terms.direct_transmittance_down)
    yield _deviation("sunbeam and skylight", worst, 1e-12, "1", source="theory")


def _there_and_back():
    reflectance = np.linspace(-0.02, 1.0, 52)
    # Path reflectance, transmittance down and up, spherical albedo, and transmittance of the gases.
    terms = 0.11, 0.8, 0.87, 0.19, 0.93
    back = corrected_reflectance(apparent_reflectance(reflectance, *terms), *terms)
    yield _deviation("reflectance there and back", largest(back, reflectance), 1e-12, "1", source="theory")
    around, terms = reflectance[:, None], TargetTerms(0.11, 0.8, 0.6, 0.27, 0.19, 0.93)
    back = target_reflectance(inhomogeneous_reflectance(reflectance, around, terms), around, terms)
    worst = largest(back, np.broadcast_to(reflectance, back.shape))
    yield _deviation("target there and back", worst, 1e-12, "1", source="theory")


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
        yield _deviation(what, worst, bound, "1", source="terms of each cell")
        yield _deviation(f"{what}, there and back", largest(back, cells), 1e-12, "1", source="theory")
    suns = np.array([3.3, 28.7, 51.1, 74.0])
    expected = [band_terms(air, bands, sun, 0.0, 0.0).diffuse_fraction for sun in suns]
    worst = largest(varying_diffuse_fraction(suns, atmosphere=air, bands=bands).T, expected)
    yield _deviation("share of skylight by cell", worst, 1e-4, "1", source="terms of each cell")


def _one_cell(air, bands, reflectance, altitude, sza, saa, vza, vaa):
    terms = band_terms(air.above(altitude), bands, sza, vza, relative_azimuth(saa, vaa))
    return apparent_reflectance(reflectance, **terms.uniform)


CHECKS = (
    _columns,
    _optical_depths,
    _light,
    _sunbeam,
    _there_and_back,
    _varying,
    _five_s_at_fife,
    _five_s,
    _successive_orders,
)
