"""Checks pass, and see the kernels that production calls."""

import numpy as np
import pytest
from broken import exceeded, notices

from fifesim.analysis import regression, scaling
from fifesim.atmosphere import adjacency, column, successive_orders
from fifesim.base.line_spread import Boxcar
from fifesim.experiments.verification import (
    analysis,
    areas,
    atmosphere,
    benchmarks,
    canopy,
    landscape,
    scan,
    scattering,
    sensor,
    terrain,
)
from fifesim.ground.canopy import interpolation, layers, sail_model
from fifesim.ground.landscape import autoregression
from fifesim.ground.terrain import flint_hills, horizon, lit_slopes, slope, spline
from fifesim.sensor.response import calibration
from fifesim.sensor.response import scan as track
from fifesim.sensor.response.spatial import CosineSpread, GaussianSpread

# Many cases of successive orders, whose engine has tests of its own.
SLOW = (atmosphere._light, atmosphere._successive_orders, canopy._foliage_tables)


@pytest.mark.parametrize("check", [check for checks in areas.AREAS.values() for check in checks if check not in SLOW])
def test_all_is_well(check):
    assert exceeded(check) == []


@pytest.mark.parametrize(
    ("owner", "kernel", "check"),
    [
        (regression, "increment_sums", analysis._increments),
        (scaling, "lag_sums", analysis._lags),
        (scaling, "ndvi_hessian", analysis._scales),
        (scaling, "sample_density", analysis._densities),
        (scaling, "shapley", analysis._causes),
        (sail_model, "_chains", canopy._chains),
        (interpolation, "_interpolate", canopy._tables),
        (interpolation, "_interpolate_over", canopy._tables),
        (canopy, "directional_reflectance", canopy._tables),
        (canopy, "over_background", canopy._orders),
        (interpolation, "_foliage", canopy._foliage_tables),
        (interpolation, "_crowned", canopy._foliage_tables),
        (layers, "bidirectional_gap", canopy._other_layers),
        (canopy, "crowns_over_background", canopy._crowns),
        (canopy, "light_budget", canopy._energy),
        (landscape, "philox", landscape._generator),
        (autoregression, "_fill", landscape._white_noise),
        (landscape, "streaming_field", landscape._tiles),
        (landscape, "quantile_map", landscape._quantiles),
        (landscape, "rank_map", landscape._quantiles),
        (landscape, "periodic_field", landscape._equation),
        (Boxcar, "_cumulative", sensor._shapes),
        (CosineSpread, "_mtf", sensor._shapes),
        (GaussianSpread, "_cumulative", sensor._shapes),
        (sensor, "regularize", sensor._impulse),
        (sensor, "regularize", sensor._wave),
        (calibration, "gain_offset", sensor._counts),
        (calibration, "radiance_to_dn", sensor._counts),
        (sensor, "line_noise", sensor._detectors),
        (track, "view_from_ground", scan._lines_of_sight),
        (track, "growth", scan._lines_of_sight),
        (track, "place_of", scan._places),
        (track, "ground_of_detector", scan._sweeps),
        (scan, "apply_operator", scan._straight),
        (slope, "_gradient", terrain._slopes),
        (horizon, "_sky_vector", terrain._any_sky),
        (horizon, "horizon_tangent", terrain._horizons),
        (lit_slopes, "_slope_light", terrain._light),
        (lit_slopes, "_slope_factors", terrain._light),
        (spline, "spline_grid", terrain._upsampling),
        (spline, "spline_points", terrain._upsampling),
        (spline, "extend", terrain._unknown_cells),
        (spline, "_least_bending", terrain._unknown_cells),
        (flint_hills, "least_ways", terrain._ways),
        (flint_hills, "erode", terrain._erosion),
        (flint_hills, "hypsometry", terrain._hills),
    ],
)
def test_production_kernels_are_checked(monkeypatch, owner, kernel, check):
    assert notices(check, monkeypatch, owner, kernel)


@pytest.mark.parametrize(
    ("owner", "name", "factor", "check", "what"),
    [
        (adjacency, "point_spread", 1.01, scattering._point_spread, "point spread of the environment"),
        (adjacency, "on_cells", 1.01, scattering._direct_sums, "environment of cells"),
        (adjacency, "whole_blocks", 1.01, scattering._direct_sums, "environment of cells"),
        (adjacency, "block_environment", 1.01, scattering._direct_sums, "environment of cells"),
        (
            adjacency,
            "environment_of_target",
            1.01,
            scattering._there_and_back,
            "scene with adjacency, there and back",
        ),
        (column, "rayleigh_expansion", [1, 1, 1, -1], scattering._expansions, "series of the scattering matrix of"),
        (column, "matrix_moments", [1, 1, 1, -1], scattering._expansions, "moments of the scattering matrix of"),
        (successive_orders, "_scattered", 1.01, scattering._polarized, ""),
        (successive_orders, "_sum_orders", 1.01, scattering._polarized, ""),
        (successive_orders, "_rescattered", 1.01, scattering._polarized, ""),
        (successive_orders, "leaving_light", 1.01, scattering._polarized, ""),
        (successive_orders, "once_scattered", 1.01, scattering._polarized, ""),
        (successive_orders, "_from_ground", 1.001, benchmarks._molecules, ""),
        (successive_orders, "_rescattered", 1.001, benchmarks._molecules, ""),
        (successive_orders, "fluxes", 1.001, benchmarks._molecules, ""),
        (scattering, "once_on_nodes", -1.0, scattering._once, "light that the aerosol scatters once"),
        (scattering, "once_on_nodes", np.nan, scattering._once, "light that the aerosol scatters once"),
        # The plane of scattering, turned in one of two places: in what is scattered once.
        (successive_orders, "_rotation", np.array([1, -1])[:, None, None], benchmarks._iprt, "IPRT A1b, Q and U"),
        (successive_orders, "_rotation", np.array([-1, 1])[:, None, None], benchmarks._iprt, "IPRT A1b, Q and U"),
    ],
)
def test_a_percent_or_a_sign_in_scattering_is_noticed(monkeypatch, owner, name, factor, check, what):
    right = getattr(owner, name)

    def wrong(*given, **options):
        found = right(*given, **options)
        return (factor * found[0], found[1]) if isinstance(found, tuple) else factor * np.asarray(found)

    monkeypatch.setattr(owner, name, wrong)
    assert any(each.startswith(what) for each in exceeded(check))


@pytest.mark.parametrize("turned", [(1, 0), (0, 2), (2, -2)])
def test_turned_wigner_functions_are_noticed(monkeypatch, turned):
    right = column.wigner

    def wigner(order, spin, cosine, count):
        return right(order, spin, cosine, count) * (-1 if (order, spin) == turned else 1)

    monkeypatch.setattr(column, "wigner", wigner)
    assert "Wigner functions" in exceeded(scattering._wigner_functions)


def test_surroundings_elsewhere_are_noticed(monkeypatch):
    """By one block."""
    right = adjacency.block_environment

    def shifted(sums, surroundings, spread):
        return right(sums, np.roll(surroundings, 1, axis=1) if np.ndim(surroundings) else surroundings, spread)

    monkeypatch.setattr(adjacency, "block_environment", shifted)
    assert exceeded(scattering._part_of_a_scene) == ["environment of a part of a scene"]


def test_a_turned_sum_over_blocks_is_noticed(monkeypatch):
    right = adjacency._add_moments
    monkeypatch.setattr(adjacency, "_add_moments", lambda values, *given: right(-values, *given))
    assert exceeded(scattering._direct_sums) == ["environment of cells"]
