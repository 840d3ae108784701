"""Models of production, evaporation and albedo against tables from other programs, quadrature and limits."""

from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad

from fifesim.models import evaporation, production
from fifesim.models.production import (
    c4_canopy,
    c4_photosynthesis,
    canopy_photosynthesis,
    farquhar_canopy,
    two_leaves,
)
from fifesim.models.radiation import two_stream

DATA = Path(__file__).parents[1] / "data"


reference = evaporation.reference_evapotranspiration


def mod17(table):
    return {
        "tmin_scalar": production.ramp(table["tmin_c"], *production.TMIN_RAMP),
        "vpd_scalar": 1 - production.ramp(table["vpd_pa"], *production.VPD_RAMP),
        "gpp_g": production.light_use_gpp(*given(table, "tmin_c vpd_pa fpar par_mj")),
    }


def given(table, names):
    return [table[name].to_numpy() for name in names.split()]


def of_fields(function, names, column=None):
    """Function of a table, whose result is a column or a tuple of named columns."""
    if column:
        return lambda table: {column: function(*given(table, names))}
    return lambda table: function(*given(table, names))._asdict()


# Function that computes the columns of each table.
TABLES = {
    "mod17_grass": mod17,
    "penman_monteith": of_fields(evaporation.penman_monteith, "ta_k rh_percent pressure_pa lai fpar rn tmin_k"),
    "pt_jpl": of_fields(evaporation.pt_jpl, "ta_k rh_percent pressure_pa ndvi fapar_max lai rn g"),
    "sellers_two_stream": of_fields(two_stream, "leaf_reflectance leaf_transmittance chi sza lai ground"),
    "canopy_photosynthesis": of_fields(
        canopy_photosynthesis, "lai extinction par quantum_yield p_max", "canopy_quadrature"
    ),
    "reference_et_daily": of_fields(reference, "tmin tmax ea_kpa rs_mj u2 elevation latitude day_of_year", "eto_asce"),
}


@pytest.mark.parametrize("name", TABLES)
def test_results_agree_with_every_row_of_the_table(name):
    table = pd.read_csv(DATA / f"{name}.csv", comment="#")
    found = TABLES[name](table)
    assert len(table) >= 24
    for column, values in found.items():
        # Small numbers are limited by the last digit of the table.
        np.testing.assert_allclose(values, table[column], rtol=1e-6, atol=1e-12, err_msg=column)


def test_reference_evapotranspiration_agrees_with_fao_56():
    """Example 18, and its wind at 10 m by the logarithmic profile of Eq. 47."""
    uccle = (12.3, 21.5, 1.409, 22.07), (100.0, 50.8, 187)
    assert abs(reference(*uccle[0], 2.078, *uccle[1]) - 3.9) < 0.1
    wind = 2.078 * np.log(67.8 * 10 - 5.42) / np.log(67.8 * 2 - 5.42)
    at_10_m = reference(*uccle[0], wind, *uccle[1], wind_height=10.0)
    assert at_10_m == pytest.approx(reference(*uccle[0], 2.078, *uccle[1]), rel=1e-12)


def test_light_of_two_leaves_agrees_with_quadrature_over_depth():
    """
    Eqs. 20 of de Pury and Farquhar (1997) by quadrature; the sunlit fraction is the probability of no shading leaf.
    """
    lai, par, sky, sza = 3.5, 1500.0, 0.3, 40.0
    mu, sigma, below = np.cos(np.radians(sza)), 0.15, 0.036
    kb, kbs, kd = 0.5 / mu, 0.46 / mu, 0.719
    horizontal = (1 - np.sqrt(1 - sigma)) / (1 + np.sqrt(1 - sigma))
    above = 1 - np.exp(-2 * horizontal * kb / (1 + kb))
    beam, diffuse = par * (1 - sky), par * sky

    def absorbed(depth):
        total_beam = (1 - above) * beam * kbs * np.exp(-kbs * depth)
        from_sky = (1 - below) * diffuse * kd * np.exp(-kd * depth)
        scattered = total_beam - (1 - sigma) * beam * kb * np.exp(-kb * depth)
        return total_beam + from_sky, (1 - sigma) * beam * kb + from_sky + scattered

    both = quad(lambda depth: absorbed(depth)[0], 0, lai)[0]
    sun = quad(lambda depth: absorbed(depth)[1] * np.exp(-kb * depth), 0, lai)[0]
    capacity = quad(lambda depth: 60 * np.exp(-0.713 * depth / lai), 0, lai)[0]
    sunlit = quad(lambda depth: 60 * np.exp(-(0.713 / lai + kb) * depth), 0, lai)[0]
    leaves = two_leaves(lai, par, sky, sza, 60.0)
    np.testing.assert_allclose(leaves, [sun, both - sun, sunlit, capacity - sunlit], rtol=1e-10)


def test_photosynthesis_of_two_leaves_has_the_right_limits():
    lai, sza, ci = np.array([0.5, 3.0]), 30.0, 24.5
    leaves = two_leaves(lai, 1e-4, 0.2, sza, 60.0)
    light = leaves.light_sun + leaves.light_shade
    # At 25 degC the compensation point is 3.69 Pa, and half of the absorbed light drives electron transport.
    dim = light * 0.85 / 2 / 4 * (ci - 3.69) / (ci + 2 * 3.69)
    np.testing.assert_allclose(farquhar_canopy(lai, 1e-4, 0.2, sza, 298.15), dim, rtol=1e-6)
    capacity = leaves.capacity_sun + leaves.capacity_shade
    bright = capacity * (ci - 3.69) / (ci + 40.4 * (1 + 20.5 / 24.8))
    np.testing.assert_allclose(farquhar_canopy(lai, 1e6, 0.2, sza, 298.15), bright, rtol=1e-12)
    # At 35 degC the compensation point is 3.69 + 0.188 * 10 + 0.0036 * 10**2 Pa.
    np.testing.assert_allclose(farquhar_canopy(lai, 1000.0, 0.2, sza, 308.15, ci_pa=5.93), 0, rtol=0, atol=1e-9)
    # At high CO2, electron transport limits, with its maximum at the optimum temperature of the two energies.
    kelvin = np.linspace(295, 315, 2001)
    transport = farquhar_canopy(3.0, 1e9, 0.2, sza, kelvin, ci_pa=1e7)
    optimum = 220000 / (710 - 8.314 * np.log(37000 / (220000 - 37000)))
    assert abs(kelvin[transport.argmax()] - optimum) < 0.02


def test_c4_leaves_agree_with_an_independent_solution():
    """
    Roots of the quadratics of Collatz et al. (1992) by eigenvalues, with the temperature factors of CABLE and MOSES and
    the parameters of BioCro's c4photo (k 0.7, theta 0.83, beta 0.93, vmax 39).
    """
    for light, vmax, celsius, ci in product((0.0, 20.0, 400.0, 2000.0), (39.0, 15.0), (5.0, 25.0, 38.0), (2.0, 14.0)):
        factor = 2.0 ** (0.1 * celsius - 2.5)
        rubisco = vmax * factor / ((1 + np.exp(0.3 * (13.0 - celsius))) * (1 + np.exp(0.3 * (celsius - 36.0))))
        lit = min(np.roots([0.83, -(rubisco + 0.067 * light), rubisco * 0.067 * light]).real)
        carbon = 0.7e6 * (vmax / 39.0) * factor * ci / 101325
        expected = min(np.roots([0.93, -(lit + carbon), lit * carbon]).real)
        found = c4_photosynthesis(light, vmax, celsius + 273.15, ci)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
    # Dim light is used with the quantum yield, and the capacity of Collatz's maize at 25 degC is nearly reached.
    leaves = two_leaves(3.0, 1e-3, 0.2, 30.0, 39.0)
    dim = 0.067 * (leaves.light_sun + leaves.light_shade)
    assert c4_canopy(3.0, 1e-3, 0.2, 30.0, 298.15, ci_pa=1e4) == pytest.approx(dim, rel=1e-4)
    assert c4_photosynthesis(1e9, 39.0, 298.15, 1e9) == pytest.approx(39.0 / (1 + np.exp(-3.6)) / (1 + np.exp(-3.3)))


def test_two_stream_is_continuous_where_printed_solutions_divide_by_zero():
    """The extinction of the beam equals the eigenvalue at mu = 1 / (2 m)."""
    omega, back = 0.3, (0.3 + 0.1 / 4) / 2
    eigenvalue = np.sqrt((1 - omega) * (1 - omega + 2 * back))
    sza = np.degrees(np.arccos(0.5 / eigenvalue))
    around = two_stream(0.2, 0.1, 0.0, sza + np.array([-1e-4, 0, 1e-4]), 2.0, 0.1)
    for field in (around.albedo_beam, around.absorbed_beam):
        assert np.isfinite(field).all()
        np.testing.assert_allclose(field[1], (field[0] + field[2]) / 2, rtol=1e-9)
    energy = around.albedo_diffuse + around.absorbed_diffuse + 0.9 * around.ground_diffuse
    np.testing.assert_allclose(energy, 1, rtol=1e-12)


def test_missing_cells_stay_missing_and_bare_ground_has_no_flux():
    lai = np.array([np.nan, 0.0, 2.0])
    results = [
        canopy_photosynthesis(lai, 0.5, 1000.0, 0.05, 30.0),
        farquhar_canopy(lai, 1000.0, 0.2, 30.0, 298.0),
        c4_canopy(lai, 1000.0, 0.2, 30.0, 298.0),
        evaporation.penman_monteith(298.0, 50.0, 1e5, lai, 0.3 * lai, 400.0, 288.0).le,
        two_stream(0.1, 0.05, 0.0, 30.0, lai, 0.15).absorbed_beam,
    ]
    for result in results:
        assert np.isnan(result[0]) and abs(result[1]) < 1e-12 and result[2] > 0
