"""Optics of the molecules of the air."""

import numpy as np
import pytest

from fifesim.atmosphere.gases import DEPOLARIZATION, rayleigh_cross_section, rayleigh_phase, refractive_index


def test_rayleigh_optical_depth_of_hydrostatic_air_is_the_published_one():
    """.0973 at .55 um and 1013.25 hPa (Bucholtz 1995, Teillet 1990), which differ by 0.5 % among authors."""
    molecules_above = 101325 / 9.80665 / 0.028964 * 6.02214e23
    assert rayleigh_cross_section(0.55) * molecules_above == pytest.approx(0.0973, rel=6e-3)


def test_rayleigh_phase_has_mean_one():
    nodes, weights = np.polynomial.legendre.leggauss(4)
    assert rayleigh_phase(nodes) @ weights / 2 == pytest.approx(1, rel=1e-14)


def test_light_at_right_angles_is_half_that_straight_on_but_for_depolarization():
    """(1 + d) / 2, from (1 + d) + (1 - d) cos2."""
    assert rayleigh_phase(0.0) / rayleigh_phase(1.0) == pytest.approx((1 + DEPOLARIZATION) / 2, rel=1e-12)
    assert rayleigh_phase(-0.3) == rayleigh_phase(0.3)


def test_air_at_the_sodium_lines_has_the_index_of_the_handbooks():
    """1.000277 at 15 degrees."""
    assert refractive_index(0.5893) - 1 == pytest.approx(2.77e-4, abs=5e-7)


def test_cross_section_falls_with_the_fourth_power_times_that_of_the_index():
    ratio = rayleigh_cross_section(0.4) / rayleigh_cross_section(0.8)
    slope = ((refractive_index(0.4) - 1) / (refractive_index(0.8) - 1)) ** 2
    assert ratio == pytest.approx(16 * slope, rel=1e-4)


def test_depolarization_of_zero_is_that_of_dipoles():
    assert rayleigh_phase(0.0, depolarization=0.0) == 0.75
    king = (6 + 3 * DEPOLARIZATION) / (6 - 7 * DEPOLARIZATION)
    assert rayleigh_cross_section(0.5) == pytest.approx(king * rayleigh_cross_section(0.5, 0.0), rel=1e-12)
