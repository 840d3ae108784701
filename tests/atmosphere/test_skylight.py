"""Coupling of an atmosphere with a non-Lambertian surface: exact solutions, energy conservation, reciprocity."""

from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.polynomial.legendre import leggauss
from verification.benchmarks import _between

import fifesim
from fifesim.atmosphere.column import matrix_moments
from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.skylight import GroundStreams, atmospheric_sky, directional_coupling, ground_streams, mixed_sky
from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance
from fifesim.base.geometry import scattering_angle_cosine
from fifesim.base.surface_kernels import RPV

DATA = Path(__file__).parents[1] / "data"
AIR = fifesim.Atmosphere(visibility=15)


@cache
def sky(sza):
    return atmospheric_sky(AIR, 0.66, sza)


def test_four_stream_coupling_solves_the_flux_equations():
    t = pd.read_csv(DATA / "four_stream.csv", comment="#")
    ground = GroundStreams(t.rso, t.rdo, t.rdo, t.rsd, t.rdd, t.rdd, t.rsd, t.rdd, t.rdd)
    found = directional_coupling(ground, t.tss, t.tsd, t.too, t.tdo, t.spherical_albedo, t.path)
    np.testing.assert_allclose(found, t.toa, rtol=0, atol=1e-12)


def test_equal_reflectances_give_the_lambertian_result():
    rng = np.random.default_rng(5)
    r, tss, tsd, too, tdo, albedo, path, gas = rng.uniform(0.05, 0.45, (8, 50))
    expected = apparent_reflectance(r, path, tss + tsd, too + tdo, albedo, gas)
    air = tss, tsd, too, tdo, albedo, path, gas
    np.testing.assert_allclose(directional_coupling(GroundStreams(*[r] * 9), *air), expected, rtol=1e-12)


def test_sky_streams_equal_sums_over_a_fine_grid():
    """The reflectance of the ground varies with both zenith angles and the azimuth."""
    own, other = sky(35.0), sky(50.0)

    def ground(sza, vza, raa):
        s, v = np.radians(sza), np.radians(vza)
        return 0.2 + 0.1 * np.cos(s) * np.cos(v) + 0.05 * np.sin(s) * np.sin(v) * np.cos(np.radians(raa))

    def means(sky):
        """Mean cosine, and mean horizontal component away from the sun, of skylight."""
        zenith = np.radians(sky.zenith)[:, None]
        return (sky.light * np.cos(zenith)).sum(), (sky.light * np.sin(zenith) * np.cos(np.radians(sky.azimuth))).sum()

    found = ground_streams(ground, own, other, 35.0, 50.0, 110.0)
    for weights, direct in ((own.light, found.sky_view), (own.returned, found.air_view)):
        at = own.zenith[:, None], np.concatenate([own.azimuth, -own.azimuth])
        w = np.concatenate([weights, weights], axis=1) / 2
        assert direct == pytest.approx((w * ground(at[0], 50.0, at[1] - 110.0)).sum(), rel=1e-12)
    (upward, along), (away, turned) = means(own), means(other)
    expected = 0.2 + 0.1 * upward * away + 0.05 * along * turned * np.cos(np.radians(110.0))
    assert found.sky_sky == pytest.approx(expected, rel=2e-4)


def test_white_ground_below_conservative_atmosphere_returns_all_light():
    """The ground reflects all light from each direction, mostly near the incident zenith angle."""
    tau, sza = 0.3, 35.0

    def white(sza, vza, raa):
        return 1 + 0.4 * (3 * np.cos(np.radians(sza)) - 2) * (3 * np.cos(np.radians(vza)) - 2)

    points, weights = leggauss(12)
    mu = (points + 1) / 2
    views, share = np.degrees(np.arccos(mu)), mu * weights

    def none(cosine):
        return np.zeros((2, *cosine.shape))

    exact = {"tolerance": 1e-8}
    total, albedo = flux_transmittance(tau, 0.0, 0.0, [1.0], [sza, *views], **exact)
    own = mixed_sky(tau, 0.0, 0.0, [1.0], none, sza)
    up = 0.0
    azimuths = 180 * (np.arange(4) + 0.5) / 4
    for view, each, through in zip(views, share, total[1:], strict=True):
        air = tau, 0.0, 0.0, [1.0], np.zeros((1, 4)), sza, [view], azimuths
        path = path_reflectance(*air, **exact).mean()
        streams = ground_streams(white, own, mixed_sky(tau, 0.0, 0.0, [1.0], none, view), sza, view, 90.0)
        direct, seen = np.exp(-tau / np.cos(np.radians([sza, view])))
        up += each * directional_coupling(streams, direct, total[0] - direct, seen, through - seen, albedo, path)
    assert up == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("case", "molecules", "depth", "albedo", "aerosol"),
    [("rpv_ec2s", 0.045159, 0.1413536, 0.96821, "continental"), ("rpv_0d6s", 0.0, 0.54222, 0.93635, "desert")],
)
def test_directional_coupling_agrees_with_eradiate(case, molecules, depth, albedo, aerosol):
    """
    Every eighth view of RAMI4ATM agrees within the noise.

    Only the first case has gases; optical depths and single scattering albedo are at 664.6 nm.
    """
    table, phases = (pd.read_csv(DATA / f"rami4atm_{name}.csv", comment="#") for name in ("toa", "phase"))
    table, (knots, phase) = table.query("case == @case").iloc[3::8], phases[["cosine", aerosol]].to_numpy().T
    nodes, weights = _between(knots, 4)
    moments = matrix_moments(np.interp(nodes, knots, phase), np.zeros(nodes.size), nodes, weights, 48)
    options, sza = {"depolarization": 0.0, "vertical": (0.0, 2.0)}, 30.0
    air, scalar = (molecules, depth, albedo, moments[:, 0]), options | {"polarized": False}
    ground = RPV(0.017051, 0.95, -0.1, 0.017051).reflectance

    def optics(cosine):
        return np.stack([np.interp(cosine, knots, phase), 0 * cosine])

    def sky_at(zenith):
        return mixed_sky(*air[:3], moments, optics, zenith, **options)

    def reflectance(vza, raa):
        seen = optics(scattering_angle_cosine(sza, np.array([[vza]]), np.array([raa])))[0]
        path = path_reflectance(*air, seen, sza, [vza], [raa], **scalar)[0, 0]
        (down, up), spherical = flux_transmittance(*air, [sza, vza], **scalar)
        mu = np.cos(np.radians([sza, vza]))
        direct, out = np.exp(-(molecules + depth) / mu)
        streams = ground_streams(ground, sky_at(sza), sky_at(vza), sza, vza, raa)
        gases = np.exp(-0.0201 * (1 / mu).sum()) if molecules else 1.0
        return gases * directional_coupling(streams, direct, down - direct, out, up - out, spherical, path)

    found = np.array([reflectance(abs(float(row.vza)), float(row.raa)) for row in table.itertuples()])
    away, noise = 100 * (found / table["brf"].to_numpy() - 1), 100 * (table["sd"] / table["brf"]).to_numpy()
    assert np.sqrt((away**2).mean()) < 1.5 * np.sqrt((noise**2).mean())
    assert abs(away.mean()) < max(0.3, 3 * np.sqrt((noise**2).sum()) / noise.size)
