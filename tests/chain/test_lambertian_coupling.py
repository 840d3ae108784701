"""Errors of the equation for a Lambertian surface over canopies, which pages of the documentation state."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.polynomial.legendre import leggauss
from odc.geo.xr import wrap_xr
from oracles_atmosphere import Air, Ground, coupled_reflectance, mixed_stokes
from verification import benchmarks, tables

import fifesim
from fifesim.atmosphere.column import matrix_moments
from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.engines import band_terms, whole_scattering
from fifesim.atmosphere.skylight import atmospheric_sky, directional_coupling, ground_streams
from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance, stokes_reflectance
from fifesim.base.geometry import scattering_angle_cosine
from fifesim.ground.canopy.sail_model import sail, with_background

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "developers" / "physics_checks.md").read_text(encoding="utf-8")
TEXT, SUMMARY = (" ".join(text.split()) for text in (PAGE, (ROOT / "docs" / "physics.md").read_text(encoding="utf-8")))

# Leaf reflectance, transmittance and background of the paper, at the centre of the band [um].
BANDS = {"TM3": (0.66, 0.07, 0.04, 0.15), "TM4": (0.83, 0.45, 0.42, 0.19)}
LAI = (0.25, 0.74, 2.0, 6.0)


def air_of(visibility, wavelength, sza, vza, raa):
    air, at = fifesim.Atmosphere(visibility=visibility), np.array([wavelength])
    terms = whole_scattering(air, at, sza, np.array([vza]), np.array([raa]))
    path, down, up, albedo = (float(np.squeeze(each)) for each in terms)
    tau = float(air.rayleigh_optical_depth(at)[0] + air.aerosol_optical_depth(at)[0])
    direct = (np.exp(-tau / np.cos(np.radians(zenith))) for zenith in (sza, vza))
    sky = cache(lambda *given: mixed_stokes(air, at, *map(np.array, given), at_ground=True)[0, ..., 0])
    return Air(path, down, up, *direct, albedo, lambda sun, *place: sky(sun, *map(tuple, place)))


def canopy(lai, leaf_reflectance, leaf_transmittance, background, hotspot=0.0):
    def seen(sza, vza, raa):
        leaves = sail(lai, leaf_reflectance, leaf_transmittance, sza=sza, vza=vza, raa=raa, hotspot=hotspot)
        return with_background(leaves, background)

    return Ground(
        lambda sza, vza, raa: seen(sza, vza, raa).rso,
        lambda vza: seen(30.0, vza, 0.0).rdo,
        lambda sza: seen(sza, 0.0, 0.0).rsd,
        float(seen(30.0, 0.0, 0.0).rdd),
    )


def lambertian(air, ground, sza, vza, raa):
    """The equation of a Lambertian surface with one reflectance factor for sunlight and isotropic skylight."""
    mixed = (1 - air.skylight) * ground.directional(sza, vza, raa) + air.skylight * ground.of_skylight(vza)
    return np.squeeze(apparent_reflectance(mixed, air.path, air.down, air.up, air.albedo))


def errors(visibility, sza, vza=0.0, raa=0.0, lais=LAI, hotspot=0.0):
    """Error in percent of apparent reflectance by band and leaf area, and the error of NDVI by leaf area."""
    found = []
    for wavelength, *optics in BANDS.values():
        air = air_of(visibility, wavelength, sza, vza, raa)
        grounds = [canopy(lai, *optics, hotspot=hotspot) for lai in lais]
        found.append([[f(air, ground, sza, vza, raa) for f in (lambertian, coupled_reflectance)] for ground in grounds])
    percent = 100 * (np.divide(*np.moveaxis(found, -1, 0)) - 1)
    red, infrared = np.array(found)
    ndvi = (infrared - red) / (infrared + red)
    return percent, ndvi[:, 0] - ndvi[:, 1]


# Ground of RAMI4ATM.
RPV = fifesim.ground.RPV(0.017051, 0.95, -0.1, 0.017051)


@cache
def rpv_ground():
    """Surface of RAMI4ATM; hemispherical factors by quadrature, equal in both directions."""
    points, weights = leggauss(48)
    mu, share = (points + 1) / 2, (points + 1) * weights / 2  # 2 mu dmu
    zeniths, azimuths = np.degrees(np.arccos(mu)), np.arange(1.0, 180, 2)

    def mean(zenith):
        angles = np.atleast_1d(zenith)[:, None, None]
        return np.squeeze(RPV.reflectance(zeniths[:, None], angles, azimuths).mean(axis=-1) @ share)

    return Ground(RPV.reflectance, mean, mean, float(mean(zeniths) @ share))


def rami_air(vza, raa):
    """Molecules and aerosol of the reference, with aerosol evenly distributed below 2 km."""
    knots, phase = tables.table("rami4atm_phase.csv")[["scattering_cosine", "phase"]].to_numpy().T
    nodes, weights = benchmarks._between(knots, 4)
    moments = matrix_moments(np.interp(nodes, knots, phase), np.zeros(nodes.size), nodes, weights, 48)
    matter, sun = (benchmarks.RAMI_MOLECULES, benchmarks.RAMI_AEROSOL, benchmarks.RAMI_ALBEDO), benchmarks.RAMI_SZA
    options, scalar = {"depolarization": 0.0, "vertical": (0.0, 2.0)}, {"polarized": False}

    def seen(zenith, views, azimuths, way=1):
        return np.interp(way * scattering_angle_cosine(zenith, np.asarray(views)[:, None], azimuths), knots, phase)

    def sky(zenith, views, azimuths):
        found = seen(zenith, views, azimuths, -1)
        return stokes_reflectance(
            *matter, moments, found, 0 * found, zenith, views, azimuths, at_ground=True, **options
        )[0]

    path = path_reflectance(
        *matter, moments[:, 0], seen(sun, [vza], np.array([raa])), sun, [vza], [raa], **options, **scalar
    )
    (down, up), albedo = flux_transmittance(*matter, moments[:, 0], [sun, vza], **options, **scalar)
    return Air(path[0, 0], down, up, *np.exp(-sum(matter[:2]) / np.cos(np.radians([sun, vza]))), albedo, sky)


def over_rpv(step=1):
    """Views within 61 degrees, reflectance by Eradiate without gases, its noise, and the equation relative to it."""
    table = pd.read_csv(ROOT / "tests" / "data" / "rami4atm_rpv.csv", comment="#").query("abs(vza) <= 61").iloc[::step]
    expected = table["reflectance"].to_numpy() / np.exp(-benchmarks.RAMI_GASES * benchmarks._air_mass(table))
    views = [(abs(float(vza)), 0.0 if vza > 0 else 180.0) for vza in table["vza"]]
    equation = [float(lambertian(rami_air(*view), rpv_ground(), benchmarks.RAMI_SZA, *view)) for view in views]
    return views, expected, table["sd"].to_numpy() / expected, equation / expected


def numbers(text):
    """Numbers printed on a page, with a typographic minus."""
    return [float(each.replace("−", "-").replace("+", "")) for each in re.findall(r"[−+]?\d+(?:\.\d+)?", text)]


ROWS = re.findall(r"^\| (\d+) km \| ([\d.]+)° \| (.+?) \| (.+?) \| (.+?) \|$", PAGE, re.MULTILINE)


def test_production_uses_one_reflectance_factor_for_sunlight_and_skylight():
    """`surface_reflectance` and `to_toa` agree with `lambertian`, band by band."""
    air = fifesim.Atmosphere(visibility=15)
    grid = fifesim.grid_at("EPSG:26914", west=705000, north=4334000, width=20, height=20, cell=10)
    lai = wrap_xr(np.full((2, 2), 0.74), grid)
    geometry = fifesim.Geometry(sza=45.0, saa=180.0, vza=0.0, vaa=0.0)
    case = {"geometry": geometry, "atmosphere": air}
    leaves, soil = ({name: each[part] for name, each in BANDS.items()} for part in (slice(1, 3), 3))
    grass = fifesim.Canopy(leaf_optics=leaves, background=soil)
    rho = lai.fifesim.surface_reflectance("TM", bands=list(BANDS), canopy=grass, exact=True, **case)
    toa = rho.fifesim.to_toa(**case)
    for name, (_, *leaf) in BANDS.items():
        (band,) = fifesim.instrument("TM").select([name])
        terms = band_terms(air, [band.response], 45.0, 0.0, 180.0)
        down, up, albedo = terms.transmittance_down, terms.transmittance_up, terms.spherical_albedo
        above = Air(terms.path_reflectance, down, up, (1 - terms.diffuse_fraction) * down, None, albedo, None)
        expected = terms.gas_transmittance[0] * lambertian(above, canopy(0.74, *leaf), 45.0, 0.0, 180.0)
        assert float(toa.sel(band=name)[0, 0]) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]}-{row[1]}")
def test_errors_at_nadir_match_the_table(row):
    visibility, sza, *printed = row
    found, ndvi = errors(float(visibility), float(sza))
    for text, values, digit in zip(printed, (*found, ndvi), (0.1, 0.1, 0.001), strict=True):
        np.testing.assert_allclose(numbers(text), [values.min(), values.max()], rtol=0, atol=0.6 * digit)


def test_errors_at_nadir_of_the_physics_page_are_those_of_the_table():
    text = re.search(r"at nadir is at most ([\d.]+) %, in haze .+? ([\d.]+) %, and ([\d.]+) in NDVI", SUMMARY)
    largest = {row[:2]: [np.abs(numbers(each)).max() for each in row[2:]] for row in ROWS}
    clear, hazy = largest["45", "28.5"], largest["15", "60"]
    assert [float(each) for each in text.groups()] == [max(clear[:2]), max(hazy[:2]), hazy[2]]


def test_errors_in_the_hot_spot_match_the_pages():
    text = re.search(
        r"the equation is ([\d.]+) to ([\d.]+) % too bright at 45 km and ([\d.]+) to ([\d.]+) % at 15 km", TEXT
    )
    beside = float(re.search(r"6° away the error is at most ([\d.]+) %", TEXT)[1])
    found, around = [], []
    for visibility in (45.0, 15.0):
        case = {"lais": (0.74, 3.0), "hotspot": 0.05}
        inside = errors(visibility, 30.0, 30.0, **case)[0]
        found += [inside.min(), inside.max()]
        around.append(np.abs(errors(visibility, 30.0, 36.0, **case)[0]).max())
    np.testing.assert_allclose([float(each) for each in text.groups()], found, rtol=0, atol=0.06)
    summary = re.search(r"In the hot spot, the equation is ([\d.]+) to ([\d.]+) % too bright", SUMMARY)
    np.testing.assert_allclose([float(each) for each in summary.groups()], [min(found), max(found)], rtol=0, atol=0.06)
    assert max(around) == pytest.approx(beside, abs=0.06)


@pytest.mark.slow
def test_integration_agrees_with_eradiate_and_the_equation_is_biased():
    """Mean over every sixth view of an RPV surface."""
    views, expected, noise, equation = over_rpv(6)
    sun, bound = benchmarks.RAMI_SZA, 3 * np.sqrt(np.sum(noise**2)) / len(views)
    exact = [float(coupled_reflectance(rami_air(*view), rpv_ground(), sun, *view)) for view in views]
    assert abs(np.mean(exact / expected - 1)) < bound < np.mean(equation - 1)


@pytest.mark.slow
def test_errors_compared_with_eradiate_match_the_page():
    text = re.search(r"is ([\d.]+) % too bright there on average .+ and ([\d.]+) % within 8° of the hot spot", TEXT)
    views, *_, equation = over_rpv()
    near = [raa == 0 and abs(vza - benchmarks.RAMI_SZA) <= 8 for vza, raa in views]
    found = 100 * (equation - 1)
    np.testing.assert_allclose([float(each) for each in text.groups()], [found.mean(), found[near].mean()], atol=0.06)


def test_equation_is_exact_for_lambertian_ground():
    """The equation is exact for Lambertian ground; quadrature of the sky is accurate to 1e-3 of the skylight."""
    air = air_of(15, 0.66, 45.0, 30.0, 0.0)
    even = Ground(
        lambda sza, vza, raa: 0.3 + 0 * (sza + vza + raa),
        lambda vza: 0.3 + 0 * vza,
        lambda sza: 0.3 + 0 * sza,
        0.3,
    )
    found = coupled_reflectance(air, even, 45.0, 30.0, 0.0)
    assert found == pytest.approx(air.over_lambertian(0.3), rel=1e-9)


@pytest.mark.parametrize(("visibility", "sza", "vza"), [(45.0, 28.5, 0.0), (10.0, 60.0, 0.0), (10.0, 60.0, 45.0)])
def test_directional_coupling_agrees_with_the_sum_over_the_sky(visibility, sza, vza):
    """A canopy with a hot spot, in both bands and in NDVI."""
    air, found = fifesim.Atmosphere(visibility=visibility), []
    for wavelength, *optics in BANDS.values():
        above = air_of(visibility, wavelength, sza, vza, 0.0)
        exact = coupled_reflectance(above, canopy(1.0, *optics, hotspot=0.05), sza, vza, 0.0)
        *leaf, soil = optics

        def surface(s, v, a, leaf=leaf, soil=soil):
            return with_background(sail(1.0, *leaf, sza=s, vza=v, raa=a, hotspot=0.05), soil)

        skies = (atmospheric_sky(air, wavelength, zenith) for zenith in (sza, vza))
        streams = ground_streams(surface, *skies, sza, vza, 0.0)
        direct, out = above.direct_down, above.direct_up
        through = direct, above.down - direct, out, above.up - out, above.albedo, above.path
        found.append((float(np.squeeze(exact)), float(directional_coupling(streams, *through))))
    red, infrared = np.array(found)
    for exact, coupled in (red, infrared):
        assert coupled == pytest.approx(exact, rel=1e-3)
    assert np.subtract(*(infrared - red) / (infrared + red)) == pytest.approx(0, abs=5e-4)
