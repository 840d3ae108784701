"""The environment function and the apparent reflectance of a target in its environment."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import dblquad, quad

from fifesim.atmosphere.adjacency import (
    environment_function,
    environment_weights,
    mixed_environment_function,
    point_spread,
)
from fifesim.atmosphere.coupling import TargetTerms, inhomogeneous_reflectance

SIXS = pd.read_csv(Path(__file__).parents[2] / "data" / "sixs_adjacency.csv", comment="#")


def sixs_terms():
    return TargetTerms(
        SIXS["path_reflectance_with_gas"] / SIXS["gas_transmittance"],
        SIXS["transmittance_down"],
        SIXS["direct_transmittance_up"],
        SIXS["transmittance_up"] - SIXS["direct_transmittance_up"],
        SIXS["spherical_albedo"],
        SIXS["gas_transmittance"],
    )


def sixs_mixed():
    up = SIXS["diffuse_up_molecules"], SIXS["diffuse_up_aerosol"]
    return mixed_environment_function(1000 * SIXS["radius"], SIXS["vza"], *up)


# Printed by 6SV1.1 at nadir: radius [km], molecules, aerosol.
@pytest.mark.parametrize(
    "radius, molecules, aerosol",
    [(0.056, 0.008338936, 0.08762389), (0.0702464, 0.01041698, 0.1079337), (28.52195, 0.9050426, 0.9997973)],
)
def test_environment_function_is_that_of_6s_at_nadir(radius, molecules, aerosol):
    """6S computes in single precision."""
    assert environment_function(1000 * radius) == pytest.approx((molecules, aerosol), abs=2e-7)


def test_environment_function_is_that_of_6s_at_other_angles():
    """Single precision, and seven digits printed."""
    molecules, aerosol = environment_function(1000 * SIXS["radius"], SIXS["vza"])
    np.testing.assert_allclose(molecules, SIXS["environment_function_molecules"], rtol=0, atol=2e-7)
    np.testing.assert_allclose(aerosol, SIXS["environment_function_aerosol"], rtol=0, atol=2e-7)


def test_mixed_environment_function_agrees_with_6s():
    """The rows hold means over the band of the transmittances that 6S mixes with: 1.2e-3 at most in 244 cases."""
    np.testing.assert_allclose(sixs_mixed(), SIXS["environment_function"], rtol=0, atol=1.5e-3)


def test_apparent_reflectance_of_a_target_agrees_with_6s():
    """Means over the band for the sum over wavelengths: 2.1e-4 at most in 244 cases. The effect itself reaches 0.11."""
    share = sixs_mixed()
    around = share * SIXS["target_reflectance"] + (1 - share) * SIXS["environment_reflectance"]
    toa = inhomogeneous_reflectance(SIXS["target_reflectance"], around, sixs_terms())
    np.testing.assert_allclose(toa, SIXS["toa_reflectance"], rtol=0, atol=3e-4)


@pytest.mark.parametrize("vza", [0.0, 20.0, 40.0, 60.0, 70.0])
def test_environment_function_grows_from_0_to_1(vza):
    for share in environment_function(np.geomspace(1.0, 1e6, 400), vza):
        assert np.all(np.diff(share) >= 0)
        assert 0 <= share[0] < 2e-3
        assert share[-1] == pytest.approx(1.0, abs=1e-12)
    assert np.array_equal(environment_function(0.0, vza), (0.0, 0.0))


def test_where_nothing_scatters_the_target_is_its_own_environment():
    assert environment_weights(0.0, 0.0) == (0.0, 0.0)
    assert mixed_environment_function(10.0, 0.0, 0.0, 0.0) == 1.0
    np.testing.assert_array_equal(point_spread((2, 2), (60, 60), 0.0, 0.0, 0.0), [[1, 0], [0, 0]])


def density(distance, vza):
    """Of the aerosol, by central differences of its environment function. [m-2]"""
    step = 1e-3 * distance
    low, high = (environment_function(distance + sign * step, vza)[1] for sign in (-1, 1))
    return float(high - low) / (2 * step) / (2 * np.pi * distance)


@pytest.mark.parametrize("vza", [0.0, 40.0])
@pytest.mark.parametrize("row, column", [(0, 1), (3, 2), (9, 0), (12, 30)])
def test_weight_of_a_cell_is_the_integral_of_the_density(row, column, vza):
    """The difference quotient is good to 1e-6; cells beyond the eighth have the coarser rule."""
    down, across = 60.0, 75.0
    weight = point_spread((13, 31), (down, across), vza, 0.0, 1.0)[row, column]
    limits = [(column - 0.5) * across, (column + 0.5) * across, (row - 0.5) * down, (row + 0.5) * down]
    brute, _ = dblquad(lambda y, x: density(np.hypot(x, y), vza), *limits, epsabs=1e-12, epsrel=1e-7)
    assert weight == pytest.approx(brute, rel=1e-5)


def test_weight_of_the_target_itself_is_the_mean_of_its_edge():
    """Around the centre, by angle: the share within the distance of the cell's edge."""
    down, across = 60.0, 75.0

    def edge(angle):
        distance = min(down / 2 / abs(np.sin(angle)), across / 2 / abs(np.cos(angle)))
        return float(environment_function(distance, 30.0)[0])

    corner = np.arctan2(down, across)
    quarter = quad(edge, 1e-12, corner)[0] + quad(edge, corner, np.pi / 2 - 1e-12)[0]
    assert point_spread((1, 1), (down, across), 30.0, 1.0, 0.0)[0, 0] == pytest.approx(quarter * 2 / np.pi, rel=1e-9)


def test_weights_of_the_plane_sum_to_one():
    """All but what lies beyond 400 km: a molecule's share of e^-32."""
    weights = point_spread((400, 400), (1000.0, 1000.0), 0.0, 1.0, 0.0)
    whole = 4 * weights.sum() - 2 * weights[0].sum() - 2 * weights[:, 0].sum() + weights[0, 0]
    assert whole == pytest.approx(1.0, abs=1e-8)
    assert weights.min() > -1e-17


@pytest.mark.parametrize("vza", [-1.0, 90.0, np.nan])
def test_view_from_below_is_refused(vza):
    with pytest.raises(ValueError, match="vza must be from 0 to below 90 degrees"):
        environment_function(1.0, vza)
