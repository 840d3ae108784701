"""Layers of an atmosphere, and light straight through them."""

import numpy as np
import pytest

from fifesim.atmosphere.column import mixed_column
from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance

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


@pytest.mark.parametrize("scale_height", [0.3, 3.0, 8.0])
def test_aerosol_above_an_altitude_is_a_power_by_the_scale_heights(scale_height):
    column = mixed_column(TAU_MOLECULES, TAU_AEROSOL, ALBEDO, 0.7 ** np.arange(40.0), 16, 50, vertical=scale_height)
    molecules, aerosol = (np.cumsum(part) / part.sum() for part in (column.molecules, column.aerosol))
    np.testing.assert_allclose(aerosol, molecules ** (8 / scale_height), rtol=1e-10, atol=1e-12)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)


def test_even_layer_lies_between_its_edges():
    """Molecules above 3 km are exp(-3/8), and all of the aerosol lies below; the layer that holds an edge has both."""
    column = mixed_column(TAU_MOLECULES, TAU_AEROSOL, ALBEDO, 0.7 ** np.arange(40.0), 16, 400, vertical=(1.0, 3.0))
    above = np.cumsum(column.molecules) / column.molecules.sum()
    particles = np.cumsum(column.aerosol) / column.aerosol.sum()
    altitude = -8 * np.log(above)
    expected = np.clip((3 - altitude) / 2, 0, 1)
    np.testing.assert_allclose(particles[altitude < 20], expected[altitude < 20], atol=1e-4)
    assert column.aerosol_once.sum() * column.depth == pytest.approx(TAU_AEROSOL * ALBEDO, rel=1e-12)
    extinction = column.molecules + column.aerosol_once / ALBEDO * (1 - ALBEDO * 0.7**16)
    np.testing.assert_allclose(extinction, 1, rtol=1e-3)


def test_soot_above_the_molecules_dims_their_light_and_below_it_does_not():
    """
    What absorbs and does not scatter multiplies what passes it: exact at all orders. Half a percent of the molecules
    lie above 42 km.
    """
    soot = 0.3, 0.0, [1.0]
    views = 40.0, [25.0], [60.0]
    molecules = path_reflectance(0.3, 0.0, 0.0, [1.0], [[0.0]], *views)[0, 0]
    mu_s, mu_v = np.cos(np.radians([40.0, 25.0]))
    high, low = (
        path_reflectance(0.3, *soot, [[1.0]], *views, vertical=layer)[0, 0] for layer in ((42.0, 50.0), (0.0, 0.01))
    )
    assert high == pytest.approx(molecules * np.exp(-0.3 * (1 / mu_s + 1 / mu_v)), rel=4e-3)
    assert low == pytest.approx(molecules, rel=1e-3)
    clear, _ = flux_transmittance(0.3, 0.0, 0.0, [1.0], [40.0])
    dimmed, _ = flux_transmittance(0.3, *soot, [40.0], vertical=(42.0, 50.0))
    assert dimmed[0] == pytest.approx(clear[0] * np.exp(-0.3 / mu_s), rel=4e-3)


def test_sunlight_on_both_ways_is_its_integral_over_the_depth(column):
    tau = 50 * column.depth
    up, down = (column.both_ways(0.7, MU, at_ground=at_ground).sum(axis=0) for at_ground in (False, True))
    slant = 1 / 0.7 + 1 / MU
    np.testing.assert_allclose(up, (1 - np.exp(-tau * slant)) / slant, rtol=1e-12)
    slant = (1 / MU - 1 / 0.7)[[0, 2]]
    expected = (np.exp(-tau / 0.7) - np.exp(-tau / MU[[0, 2]])) / slant
    np.testing.assert_allclose(down[[0, 2]], expected, rtol=1e-12)
    assert down[1] == pytest.approx(tau * np.exp(-tau / 0.7), rel=1e-12)
