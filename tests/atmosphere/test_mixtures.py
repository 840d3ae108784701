"""Aerosol components compared with their source tables, and names of mixtures."""

import numpy as np
import pytest

from fifesim.atmosphere.mixtures import (
    COMPONENTS,
    canonical,
    cross_sections,
    mixture,
    phase,
)
from fifesim.base import files


def rows_of(name, component):
    return files.table(name).query("component == @component").drop(columns="component")


@pytest.mark.parametrize("component", COMPONENTS)
def test_cross_sections_are_power_laws_through_the_table(component):
    wavelength, extinction, scattering, directed = rows_of("aerosol_optics.csv", component).to_numpy(float).T
    found = cross_sections(component, wavelength)
    np.testing.assert_allclose(found, [extinction, scattering, directed], rtol=1e-12)
    between, _, _ = cross_sections(component, np.sqrt(wavelength[1:] * wavelength[:-1]))
    np.testing.assert_allclose(between, np.sqrt(extinction[1:] * extinction[:-1]), rtol=1e-12)


@pytest.mark.parametrize("component", COMPONENTS)
def test_phase_and_polarization_pass_through_the_tables(component):
    """One factor per wavelength normalizes the mean to 1: 0.2 %, since the table is piecewise linear in angle."""
    wavelength = rows_of("aerosol_optics.csv", component).iloc[:, 0].to_numpy(float)
    table, degree = rows_of("aerosol_phase.csv", component), rows_of("aerosol_polarization.csv", component)
    cosine = np.cos(np.radians(table["angle"].to_numpy()))[:, None]
    tabulated = table.drop(columns="angle").to_numpy(float)
    found = phase(component, cosine, wavelength)
    # At 0 and 180 degrees the cosine determines the angle only to 1e-6.
    scale = (found / tabulated)[1:-1]
    np.testing.assert_allclose(scale, np.broadcast_to(scale[:1], scale.shape), rtol=1e-6)
    np.testing.assert_allclose(scale[0], 1, atol=2e-3)
    ratio = phase(component, cosine, wavelength, polarized=True) / found
    np.testing.assert_allclose(ratio, degree.drop(columns="angle").to_numpy(float), atol=1e-6)


# ------------------------------------------------------------------------------------------ names


@pytest.mark.parametrize(
    "aerosol, name",
    [
        ("urban", "urban"),
        ({"soot": 0.01, "dust": 0.7, "water_soluble": 0.29}, "continental"),
        ("oceanic:0.95+water_soluble:0.05", "maritime"),
        ({"water_soluble": 0.5, "dust": 0.5, "soot": 0}, "dust:0.5+water_soluble:0.5"),
        (" soot : 0.25 + dust:0.75", "dust:0.75+soot:0.25"),
        ({"oceanic": 1}, "oceanic:1"),
    ],
)
def test_equivalent_aerosols_have_one_canonical_name(aerosol, name):
    assert canonical(aerosol) == name
    assert canonical(canonical(aerosol)) == name
    assert mixture(canonical(aerosol)) == mixture(aerosol)


@pytest.mark.parametrize(
    "aerosol, message",
    [
        ("continentl", "aerosol must be one of .*, got 'continentl': type aerosol='continental'"),
        ("dust", "such as dust:1 or .*type aerosol='dust:1'"),
        ("sulphate", "a mixture of dust, water_soluble, oceanic, soot.*got 'sulphate'$"),
        ("sand:1", "got 'sand' in 'sand:1'$"),
        ({"dusk": 1.0}, "component must be one of .*, got 'dusk' .*: type 'dust'"),
        ("dust:1.5+soot:-0.5", "fraction of soot must be from 0 to 1, got -0.5"),
        ({"dust": float("nan"), "soot": 1}, "fraction of dust must be from 0 to 1, got nan"),
        ("dust:2+soot:2", "must add up to 1, got 4 .*: type aerosol='dust:0.5[+]soot:0.5'"),
        ({}, "must add up to 1, got 0"),
        ("dust:half", "a number after a colon, got 'dust:half'"),
        ("dust:0.5+dust:0.5", "each component once, got 'dust' twice"),
    ],
)
def test_invalid_mixture_raises_a_specific_message(aerosol, message):
    with pytest.raises(ValueError, match=message):
        mixture(aerosol)


@pytest.mark.parametrize("aerosol", [3.0, None, {"dust": "1"}, {"dust": True}])
def test_aerosol_of_wrong_type_raises(aerosol):
    with pytest.raises(TypeError, match="aerosol"):
        canonical(aerosol)
