"""Coordinate operations of known accuracy."""

import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc
import pyproj
import pytest

from fifesim.rasters import projection, sites

FIFE = (-96.63, 38.98, -96.45, 39.13)


def test_nad27_goes_to_nad83_by_a_route_of_known_accuracy():
    """
    FIFE's corner by the NADCON grids is 704968 E 4334211 N.

    Two Helmert operations to WGS 84 (EPSG:1173, of metres) stand in for them and are 2 m off at most there.
    """
    pipeline, accuracy = projection.operation("EPSG:26714", "EPSG:26914", FIFE)
    east, north = pyproj.Transformer.from_pipeline(pipeline).transform(705000.0, 4334000.0)
    assert np.hypot(east - 704968, north - 4334211) < 2.0
    assert 0 < accuracy <= 15


def test_direct_operation_would_be_a_ballpark_a_pixel_off():
    """Without grid files PROJ's own choice passes latitude and longitude unchanged, and says so nowhere but here."""
    direct = pyproj.transformer.TransformerGroup(26714, 26914).transformers[0]
    if "Ballpark" not in direct.description:
        pytest.skip("PROJ has its grid files here")
    east, north = direct.transform(705000.0, 4334000.0)
    assert 25 < np.hypot(east - 704968, north - 4334211) < 35
    pipeline, _ = projection.operation("EPSG:26714", "EPSG:26914", FIFE)
    assert "helmert" in pipeline


def test_operation_runs_in_both_directions():
    forth, _ = projection.operation("EPSG:26714", "EPSG:26914", FIFE)
    back, _ = projection.operation("EPSG:26914", "EPSG:26714", FIFE)
    there = pyproj.Transformer.from_pipeline(forth).transform(705000.0, 4334000.0)
    again = pyproj.Transformer.from_pipeline(back).transform(*there)
    np.testing.assert_allclose(again, (705000.0, 4334000.0), rtol=0, atol=1e-3)


def test_same_crs_needs_no_operation():
    assert projection.operation("EPSG:26914", pyproj.CRS("EPSG:26914").to_wkt()) == (None, 0.0)


def test_convergence_of_a_utm_zone_is_positive_east_of_its_meridian():
    """Sine of the latitude times the distance from the central meridian."""
    expected = np.sin(np.radians(39.06)) * (99 - 96.54)
    assert projection.convergence(sites.fife_site(30)) == pytest.approx(expected, rel=0.01)
