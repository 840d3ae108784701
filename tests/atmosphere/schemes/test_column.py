"""Layers of an atmosphere, and light straight through them."""

import numpy as np
import pytest

from fifesim.atmosphere.schemes.column import mixed_column

TAU_MOLECULES, TAU_AEROSOL, ALBEDO = 0.15, 0.4, 0.9
MU = np.array([0.2, 0.7, 1.0])


@pytest.fixture
def column():
    """With a forward peak of .7 to the 16th."""
    return mixed_column(TAU_MOLECULES, TAU_AEROSOL, ALBEDO, 0.7 ** np.arange(40.0), 16, 50)


def test_layers_hold_all_that_scatters(column):
    peak = 0.7**16
    assert column.molecules.sum() * column.depth == pytest.approx(TAU_MOLECULES, rel=1e-12)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)
    np.testing.assert_allclose(column.aerosol, column.aerosol_once * (1 - peak), rtol=1e-12)
    assert 50 * column.depth == pytest.approx(TAU_MOLECULES + TAU_AEROSOL * (1 - ALBEDO * peak), rel=1e-12)


def test_aerosol_above_an_altitude_is_the_fourth_power_of_the_molecules(column):
    """Scale heights of 2 and 8 km."""
    molecules, aerosol = (np.cumsum(part) / part.sum() for part in (column.molecules, column.aerosol))
    np.testing.assert_allclose(aerosol, molecules**4, rtol=1e-12)


def test_light_of_all_layers_is_that_of_the_whole(column):
    tau = 50 * column.depth
    np.testing.assert_allclose(column.escape(MU).sum(axis=1), 1 - np.exp(-tau / MU), rtol=1e-12)
    np.testing.assert_allclose(
        column.layer_mean(MU).sum(axis=0) * column.depth, MU * (1 - np.exp(-tau / MU)), rtol=1e-12
    )
    through, averaged = column.steps(MU)
    np.testing.assert_allclose(through**50, np.exp(-tau / MU), rtol=1e-12)
    np.testing.assert_allclose((1 - averaged * column.depth / MU), through, rtol=1e-12)


def test_only_low_modes_of_molecules_are_polarized(column):
    assert [column.polarizes(mode) for mode in (0, 2, 3)] == [True, True, False]


def test_mixing_of_intensity_is_the_mean_of_the_phase_functions(column):
    mixed = column.mixing(0, 3)[:, 2, 0, 0]
    expected = column.molecules * column.molecules_expansion[2, 0] + column.aerosol * column.aerosol_expansion[2, 0]
    np.testing.assert_allclose(mixed, expected, rtol=1e-12)
    np.testing.assert_array_equal(column.mixing(0, 1)[..., 0, 0], column.mixing(0, 3)[..., 0, 0])
    np.testing.assert_array_equal(column.mixing(0, 3), column.mixing(0, 3).swapaxes(2, 3))


def test_sunlight_on_both_ways_is_its_integral_over_the_depth(column):
    tau = 50 * column.depth
    up, down = (column.both_ways(0.7, MU, at_ground=at_ground).sum(axis=0) for at_ground in (False, True))
    slant = 1 / 0.7 + 1 / MU
    np.testing.assert_allclose(up, (1 - np.exp(-tau * slant)) / slant, rtol=1e-12)
    slant = (1 / MU - 1 / 0.7)[[0, 2]]
    expected = (np.exp(-tau / 0.7) - np.exp(-tau / MU[[0, 2]])) / slant
    np.testing.assert_allclose(down[[0, 2]], expected, rtol=1e-12)
    assert down[1] == pytest.approx(tau * np.exp(-tau / 0.7), rel=1e-12)
