"""Checks of the atmosphere beside tables of 6SV1.1, band by band of Landsat TM."""

from functools import partial
from itertools import product

import numpy as np
import pandas as pd

from fifesim.atmosphere.adjacency import environment as adjacency
from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.schemes.coupling import apparent_reflectance, inhomogeneous_reflectance
from fifesim.atmosphere.schemes.engines import band_terms
from fifesim.atmosphere.schemes.terms import BandTerms
from fifesim.base import datasets
from fifesim.experiments.verification.deviations import Deviation, largest, rms_percent
from fifesim.sensor.description.instruments import instrument

_deviation = partial(Deviation, "atmosphere", source="6SV1.1")

_VISIBLE = ("TM1", "TM2", "TM3", "TM4")
_BANDS = (*_VISIBLE, "TM5", "TM7")
_CASE = ["profile", "aerosol", "visibility", "altitude", "sza", "vza", "raa"]

# What closed forms reach: blue lacks polarization, and what molecules and aerosol scatter together.
_FIFE_BOUNDS = (0.007, 0.004, 0.0025, 0.002, 0.001, 0.001)
_CLEAR_BOUNDS = (1.8, 1.2, 0.9, 0.8, 0.6, 0.5)
_ALL_BOUND = 3.2


def _terms(table, engine):
    """Terms of the band of each row."""
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


def _clear(table):
    """Where the closed forms are meant to hold best."""
    return ((table["visibility"] >= 23) & (table["sza"] <= 45) & (table["vza"] <= 20)).to_numpy()


def _columns():
    table = datasets.table("verification/sixs_columns.csv")
    atmospheres = [Atmosphere(profile=row.profile, altitude=row.altitude) for row in table.itertuples()]
    for name in ("pressure", "water_vapour", "ozone"):
        found = [getattr(atmosphere, name) for atmosphere in atmospheres]
        worst = 100 * largest(found, table[name], relative=True)
        yield _deviation(f"{name.replace('_', ' ')} of the profiles", worst, 1.0, "%")


def _optical_depths():
    table = datasets.table("verification/sixs_molecules.csv")
    found = [
        float(Atmosphere(profile=row.profile, altitude=row.altitude).rayleigh_optical_depth(row.wavelength))
        for row in table.itertuples()
    ]
    worst = 100 * largest(found, table["optical_depth"], relative=True)
    yield _deviation("optical depth of the molecules", worst, 1.0, "%")
    for aerosol, rows in datasets.table("verification/sixs_aerosol.csv").groupby("aerosol"):
        found = Atmosphere(aerosol=aerosol, aot=1.0).aerosol_optical_depth(rows["wavelength"].to_numpy())
        worst = 100 * largest(found, rows["relative_optical_depth"], relative=True)
        yield _deviation(f"optical depth of {aerosol} aerosol", worst, 1.0, "%")
    table = datasets.table("verification/sixs_visibility.csv")
    found = [Atmosphere(visibility=visibility).aot for visibility in table["visibility"]]
    yield _deviation("optical thickness by visibility", 100 * largest(found, table["aot"], relative=True), 1.0, "%")


def _five_s_at_fife():
    table = datasets.table("verification/sixs_fife.csv")
    found = apparent_reflectance(table["surface_reflectance"].to_numpy(), **_terms(table, "5S").uniform)
    for band, bound in zip(_BANDS, _FIFE_BOUNDS, strict=True):
        rows = (table["band"] == band).to_numpy()
        worst = largest(found[rows], table["toa_reflectance"][rows])
        yield _deviation(f"5S, FIFE case, {band}", worst, bound, "1")


def _five_s():
    table = datasets.table("verification/sixs_grid.csv")
    terms = _terms(table, "5S")
    found, expected = apparent_reflectance(0.3, **terms.uniform), table["toa_reflectance"].to_numpy()
    clear = _clear(table)
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
    """Without polarization 6S is not always consistent in itself, and the table has less cases."""
    for engine, name, said in (
        ("successive-orders-scalar", "sixs_scalar", "scalar"),
        ("successive-orders", "sixs_grid", "polarized"),
    ):
        table = datasets.table(f"verification/{name}.csv")
        rows = table[table["band"].isin(_VISIBLE)]
        terms = _terms(rows, engine)
        found = {
            "path": (terms.path_reflectance * terms.gas_transmittance, 1.0),
            "toa": (apparent_reflectance(0.3, **terms.uniform), 0.3),
        }
        for (name, (values, bound)), band in product(found.items(), _VISIBLE):
            of_band = (rows["band"] == band).to_numpy()
            percent = rms_percent(values[of_band], rows[f"{name}_reflectance"][of_band])
            yield _deviation(f"successive orders, {said}, {band}, {name}, rms", percent, bound, "%")


def _adjacency():
    """The second and third by the transmittances of 6S: band means for its sum over wavelengths."""
    nadir = datasets.table("verification/sixs_environment.csv")
    found = adjacency.environment_function(1000 * nadir["radius"].to_numpy())
    worst = largest(found, nadir[["molecules", "aerosol"]].to_numpy().T)
    yield _deviation("environment function, nadir", worst, 1e-6, "1")
    table = {name: column.to_numpy() for name, column in datasets.table("verification/sixs_adjacency.csv").items()}
    up = table["diffuse_up_molecules"], table["diffuse_up_aerosol"]
    share = adjacency.mixed_environment_function(1000 * table["radius"], table["vza"], *up)
    yield _deviation("environment function, mixed", largest(share, table["environment_function"]), 0.002, "1")
    around = share * table["target_reflectance"] + (1 - share) * table["environment_reflectance"]
    gas = table["gas_transmittance"]
    names = "transmittance_down", "direct_transmittance_up", "diffuse_transmittance_up", "spherical_albedo"
    factors = table["path_reflectance"] / gas, *(table[name] for name in names), gas
    found = inhomogeneous_reflectance(table["target_reflectance"], around, *factors)
    worst = largest(found, table["toa_reflectance"])
    yield _deviation("round target, apparent reflectance", worst, 0.002, "1")


CHECKS = (_columns, _optical_depths, _adjacency, _five_s_at_fife, _five_s, _successive_orders)
