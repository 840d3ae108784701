from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fifesim.atmosphere import mixtures
from fifesim.atmosphere.aerosols import aerosol_optics, aerosol_phase, aerosol_polarization, phase_moments
from fifesim.atmosphere.mixtures import COMPONENTS, MODELS

DATA = Path(__file__).parents[2] / "data"
OPTICS = pd.read_csv(DATA / "sixs_aerosol_optics.csv", comment="#")
PHASE = pd.read_csv(DATA / "sixs_aerosol_phase.csv", comment="#")
MOMENTS = pd.read_csv(DATA / "mie_moments.csv", comment="#")
WAVELENGTH = np.array([0.35, 0.4, 0.4777, 0.55, 0.86, 1.0, 1.65, 2.25, 3.0, 3.75])


def of_6s(table, name):
    rows = table[table["aerosol"] == name]
    assert len(rows) > 3
    return rows


@pytest.mark.parametrize("name", ["continental", "urban", "dust", "water_soluble", "soot"])
def test_optics_agree_with_6s(name):
    """The same micro-physics, two Mie codes: 0.1 %; asymmetry .002, in dust .02, as 6S takes it from 83 angles."""
    rows = of_6s(OPTICS, name)
    aerosol = name if name in MODELS else f"{name}:1"
    extinction, albedo, asymmetry = aerosol_optics(aerosol, rows["wavelength"])
    np.testing.assert_allclose(extinction, rows["extinction"], rtol=1.1e-3)
    np.testing.assert_allclose(albedo, rows["single_scattering_albedo"], rtol=1e-3)
    np.testing.assert_allclose(asymmetry, rows["asymmetry"], atol=0.02 if name == "dust" else 2e-3)


@pytest.mark.parametrize("aerosol, depth, albedo", [("dust:1", 0.41095, 0.88356), ("continental", 0.07207, 0.8518)])
def test_optics_at_the_last_wavelength_agree_with_6s(aerosol, depth, albedo):
    """As 6SV1.1 prints them at 3.75 um, where the depth at .55 um is .5."""
    found, of_light, _ = aerosol_optics(aerosol, 3.75)
    assert found == pytest.approx(depth / 0.5, rel=2e-3)
    assert of_light == pytest.approx(albedo, rel=1e-3)


@pytest.mark.parametrize("aerosol", ["maritime", "oceanic"])
def test_sea_salt_agrees_with_6s(aerosol):
    """1.2 %, asymmetry .01. From 1.54 to 2.25 um albedo is no check: the imaginary index was retrieved from it."""
    rows = of_6s(OPTICS, aerosol)
    extinction, albedo, asymmetry = aerosol_optics(aerosol if aerosol in MODELS else "oceanic:1", rows["wavelength"])
    np.testing.assert_allclose(extinction, rows["extinction"], rtol=0.012)
    np.testing.assert_allclose(albedo, rows["single_scattering_albedo"], rtol=0.01)
    np.testing.assert_allclose(asymmetry, rows["asymmetry"], atol=0.01)


@pytest.mark.parametrize("aerosol", ["continental", "urban"])
def test_phase_function_agrees_with_6s(aerosol):
    """1 %, of which most is straight back; it is .2 % rms."""
    rows = of_6s(PHASE, aerosol)
    ratio = aerosol_phase(aerosol, rows["cosine"], rows["wavelength"]) / rows["phase"]
    np.testing.assert_allclose(ratio, 1, atol=0.01)


def test_phase_function_of_sea_salt_agrees_with_6s_in_the_visible():
    """5 % short of the glory, which turns on the third digit of the refractive index."""
    rows = of_6s(PHASE, "maritime").query("wavelength < 1 and -0.95 < cosine < 0.95")
    assert len(rows) > 10
    ratio = aerosol_phase("maritime", rows["cosine"], rows["wavelength"]) / rows["phase"]
    np.testing.assert_allclose(ratio, 1, atol=0.05)


@pytest.mark.parametrize("aerosol", [*MODELS, *(f"{name}:1" for name in COMPONENTS)])
def test_mean_of_the_phase_function_is_one(aerosol):
    """At and between the tabulated wavelengths, by a quadrature of its own; 1e-4 for the kinks between angles."""
    edges = np.radians(np.concatenate([np.arange(0, 10, 0.05), np.arange(10, 180.1, 0.5)]))
    points, weights = np.polynomial.legendre.leggauss(3)
    angle = (edges[:-1, None] + np.diff(edges)[:, None] * (1 + points) / 2).ravel()
    weights = (np.diff(edges)[:, None] / 2 * weights).ravel() * np.sin(angle) / 2
    phase = aerosol_phase(aerosol, np.cos(angle), WAVELENGTH[:, None])
    np.testing.assert_allclose(phase @ weights, 1, rtol=1e-4)


@pytest.mark.parametrize("aerosol", [*MODELS, *(f"{name}:1" for name in COMPONENTS)])
def test_second_moment_is_the_asymmetry(aerosol):
    """The one from the table by angle, the other from Mie's coefficients: 1e-4."""
    moments = phase_moments(aerosol, WAVELENGTH, 2)
    np.testing.assert_allclose(moments[:, 0], 1, rtol=1e-12)
    np.testing.assert_allclose(moments[:, 1], aerosol_optics(aerosol, WAVELENGTH)[2], atol=1e-4)


def test_moments_are_those_of_mie_theory():
    """Up to the 80th, 1e-3: dust at 0.35 um has a forward peak of half a degree."""
    for (name, wavelength), rows in MOMENTS.groupby(["component", "wavelength"]):
        moments = phase_moments(f"{name}:1", wavelength, 81)[0]
        np.testing.assert_allclose(moments[rows["order"]], rows["moment"], atol=1e-3, err_msg=name)


def test_moments_give_the_phase_function_back():
    """Soot has few: the series of 60 converges to the interpolation between angles."""
    cosine = np.linspace(-1, 1, 50)
    moments = phase_moments("soot:1", [0.55], 60)[0]
    series = np.polynomial.legendre.legval(cosine, (2 * np.arange(60) + 1) * moments)
    np.testing.assert_allclose(series, aerosol_phase("soot:1", cosine, 0.55), rtol=1e-3)


def test_small_particles_polarize_like_molecules():
    """
    Soot at 3.75 um is near Rayleigh's limit, (1 - cos2) / (1 + cos2).

    The next order in the size is odd in the cosine and drops out of the mean of both sides: 1 % for what is left.
    """
    cosine = np.linspace(0, 1, 21)
    both = (aerosol_polarization("soot:1", cosine, 3.75) + aerosol_polarization("soot:1", -cosine, 3.75)) / 2
    np.testing.assert_allclose(both, (1 - cosine**2) / (1 + cosine**2), atol=0.01)


def test_polarization_is_a_degree():
    degree = aerosol_polarization("continental", np.linspace(-1, 1, 181), WAVELENGTH[:, None])
    assert np.all(np.abs(degree) <= 1)
    assert 0.1 < degree[3, 90] < 0.6


@pytest.mark.parametrize(
    "wavelength, extinction, albedo, asymmetry",
    [
        (0.412, 1.314896, 0.9007282, 0.6673747),
        (0.59, 0.9291308, 0.8918457, 0.6551756),
        (0.86, 0.6012269, 0.8576384, 0.6478144),
        (1.95, 0.2710073, 0.6822487, 0.7730598),
    ],
)
def test_continental_aerosol_agrees_with_6s(wavelength, extinction, albedo, asymmetry):
    """Same micro-physics, other Mie code: .1 %, .0004 and, as 6S integrates a coarse phase function, .002."""
    ours = aerosol_optics("continental", wavelength)
    assert ours[0] == pytest.approx(extinction, rel=1e-3)
    assert ours[1] == pytest.approx(albedo, abs=4e-4)
    assert ours[2] == pytest.approx(asymmetry, abs=2e-3)


@pytest.mark.parametrize("wavelength", [0.4, 0.55, 0.86, 2.25])
def test_aerosol_phase_has_mean_one_and_its_asymmetry(wavelength):
    """To 4e-3: the table is linear between half a degree in the forward peak."""
    angle = np.linspace(0, np.pi, 20001)
    phase = aerosol_phase("continental", np.cos(angle), wavelength)
    assert np.trapezoid(phase * np.sin(angle), angle) / 2 == pytest.approx(1, abs=4e-3)
    first = np.trapezoid(phase * np.sin(angle) * np.cos(angle), angle) / 2
    assert first == pytest.approx(float(aerosol_optics("continental", wavelength)[2]), abs=4e-3)


def test_inputs_broadcast():
    assert aerosol_phase("urban", np.zeros((3, 1)), WAVELENGTH).shape == (3, WAVELENGTH.size)
    assert aerosol_polarization("urban", 0.5, WAVELENGTH).shape == WAVELENGTH.shape
    assert phase_moments("urban", WAVELENGTH, 7).shape == (WAVELENGTH.size, 7)


def test_a_mixture_scatters_as_its_parts():
    """Half the volume of each: cross sections add, whatever the number of particles."""
    parts = np.array([mixtures.cross_sections(name, WAVELENGTH) for name in ("dust", "soot")]).mean(axis=0)
    _, albedo, asymmetry = aerosol_optics("dust:0.5+soot:0.5", WAVELENGTH)
    np.testing.assert_allclose(albedo, parts[1] / parts[0], rtol=1e-12)
    np.testing.assert_allclose(asymmetry, parts[2] / parts[1], rtol=1e-12)


def test_missing_wavelength_stays_missing():
    extinction, albedo, asymmetry = aerosol_optics("urban", [0.5, np.nan])
    assert np.isnan([extinction[1], albedo[1], asymmetry[1], aerosol_phase("urban", 0.0, np.nan)]).all()
    assert not np.isnan([extinction[0], albedo[0], asymmetry[0]]).any()
    assert np.isnan(aerosol_phase("urban", np.nan, 0.5))


@pytest.mark.parametrize("wavelength", [0.3, 4.0, 550.0])
def test_wavelength_outside_the_tables_is_refused(wavelength):
    calls = (
        lambda: aerosol_optics("urban", wavelength),
        lambda: aerosol_phase("urban", 0.0, [0.5, wavelength]),
        lambda: aerosol_polarization("urban", 0.0, wavelength),
        lambda: phase_moments("urban", wavelength, 3),
    )
    for call in calls:
        with pytest.raises(ValueError, match=f"wavelength must be from 0.35 to 3.75 um, got {wavelength:g}"):
            call()
