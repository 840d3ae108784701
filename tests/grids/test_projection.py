"""Coordinate operations of known accuracy, and thread-local PROJ objects."""

import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import odc.geo.xr  # noqa: F401  registers .odc
import pyproj
import pytest

import fifesim
from fifesim.grids import projection, sites
from fifesim.grids.grid import check_grid, grid_at

FIFE = (-96.63, 38.98, -96.45, 39.13)


def test_nad27_is_transformed_to_nad83_with_known_accuracy():
    """
    By the NADCON grids, the corner of FIFE is at 704968 E 4334211 N.

    Two Helmert operations to WGS 84 (EPSG:1173, accurate to metres) replace the grids and differ by at most 2 m there.
    """
    pipeline = projection.operation("EPSG:26714", "EPSG:26914", FIFE)
    east, north = pyproj.Transformer.from_pipeline(pipeline).transform(705000.0, 4334000.0)
    assert np.hypot(east - 704968, north - 4334211) < 2.0
    back = projection.operation("EPSG:26914", "EPSG:26714", FIFE)
    again = pyproj.Transformer.from_pipeline(back).transform(east, north)
    np.testing.assert_allclose(again, (705000.0, 4334000.0), rtol=0, atol=1e-3)


def test_direct_ballpark_operation_would_be_one_pixel_off():
    """Without grid files, PROJ silently passes latitude and longitude unchanged."""
    direct = pyproj.transformer.TransformerGroup(26714, 26914).transformers[0]
    if "Ballpark" not in direct.description:
        pytest.skip("PROJ has its grid files here")
    east, north = direct.transform(705000.0, 4334000.0)
    assert 25 < np.hypot(east - 704968, north - 4334211) < 35
    pipeline = projection.operation("EPSG:26714", "EPSG:26914", FIFE)
    assert "helmert" in pipeline


def test_convergence_of_a_utm_zone_is_positive_east_of_its_meridian():
    """Convergence is approximately sin(latitude) times the difference from the central meridian."""
    expected = np.sin(np.radians(39.06)) * (99 - 96.54)
    assert projection.convergence(sites.fife_site(30)) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("crs", ["EPSG:3031", "EPSG:3413", "EPSG:5041", "EPSG:5042", "EPSG:32661", "EPSG:26914"])
def test_points_are_transformed_easting_first(crs):
    """Both axes of a polar CRS may point north or south, and some give northing first."""
    latitude = -72.0 if crs in ("EPSG:3031", "EPSG:5042") else 72.0
    pipeline = projection.operation(crs, "EPSG:4326")
    expected = pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(-95.0, latitude)
    back = projection.carry(pipeline, crs, "EPSG:4326", *expected)
    np.testing.assert_allclose(back, (-95.0, latitude), rtol=0, atol=1e-5)


@pytest.mark.parametrize(("crs", "latitude"), [("EPSG:3031", -72.0), ("EPSG:3413", 71.0), ("EPSG:5041", 85.0)])
def test_convergence_of_a_polar_grid_is_where_true_north_is(crs, latitude):
    """The reference is a small step toward the pole in grid coordinates."""
    to_plane = pyproj.Transformer.from_crs(4326, crs, always_xy=True)
    (west, north), (x, y) = to_plane.transform(30.0, latitude), to_plane.transform(30.0, latitude + 1e-4)
    grid = grid_at(crs, west - 50, north + 50, 100, 100, 10)
    east_of_grid_north = np.degrees(np.arctan2(x - west, y - north))
    assert projection.convergence(grid) == pytest.approx(-east_of_grid_north, abs=0.01)


NO_METRES = [
    ("EPSG:3031", 0.0, 3.5e6, "scale of EPSG:3031 is 1.050 .* such as EPSG:32731"),
    ("EPSG:3413", 0.0, -3.5e6, "scale of EPSG:3413 is 1.047 .* such as EPSG:32623"),
    ("EPSG:3857", -10.75e6, 4.7e6, "scale of EPSG:3857 is 1.284 .* such as EPSG:32614"),
    ("EPSG:3857", 17e6, -4.7e6, "such as EPSG:32756"),
    ("EPSG:3857", 0.0, 19.4e6, "such as EPSG:5041"),  # 84.5 degrees north
    ("EPSG:6933", -9.26e6, 4.6e6, "scale of EPSG:6933 is 1.1"),
    ("EPSG:3857", 1e8, 0.0, r"west = 100000000, north = 0: the grid is outside .* -20037508 to 20037508 E"),
    ("EPSG:26914", float("nan"), 4e6, "outside the area of EPSG:26914"),
    ("EPSG:2053", 0.0, 0.0, "axes of the CRS must point east and north, the axes of EPSG:2053 point"),
    ("EPSG:2277", 0.0, 0.0, "must be in metres, EPSG:2277 is in US survey foot"),
    ("EPSG:4978", 0.0, 0.0, "must be projected, EPSG:4978 is not"),
    ("EPSG:5703", 0.0, 0.0, "must be projected"),
    ("", 0.0, 0.0, "crs = '': PROJ knows no such"),
    ("[" * 10_000, 0.0, 0.0, "PROJ knows no such"),
    (None, 0.0, 0.0, "crs = None: PROJ knows no such"),
]


@pytest.mark.parametrize(("crs", "west", "north", "said"), NO_METRES)
def test_coordinates_that_are_not_ground_metres_are_rejected(crs, west, north, said):
    with pytest.raises(ValueError, match=said) as caught:
        grid_at(crs, west, north, 90.0, 90.0, 10.0)
    assert len(str(caught.value)) < 300 and str(caught.value).isprintable()


def test_projections_that_preserve_distances_are_accepted_without_heights():
    taken = [
        ("EPSG:3031", 0, 0), ("EPSG:3413", 0, -2e6), ("EPSG:5042", 2e6, 2e6), ("EPSG:32661", 2e6, 2e6),
        ("EPSG:3857", -10.75e6, 0), ("EPSG:3035", 4.3e6, 3.2e6), ("EPSG:2193", 1.6e6, 5.2e6),
        # These CRS count longitude from Paris and from Ferro.
        ("EPSG:27572", 6e5, 2.2e6), ("EPSG:31281", 12674, 5206730),
    ]  # fmt: skip
    for crs, west, north in taken:
        affine = grid_at(crs, west, north, 90.0, 90.0, 10.0).affine
        assert (affine.c, affine.f) == (west, north)
    assert projection.horizontal("EPSG:26914+5703") == projection.horizontal("EPSG:26914") == "EPSG:26914"
    assert projection.horizontal(pyproj.CRS("EPSG:7415").to_wkt()) == "EPSG:28992"
    assert projection.operation("EPSG:26914", pyproj.CRS("EPSG:26914").to_wkt()) is None


def test_scale_error_above_one_percent_gives_one_warning_per_location():
    """Web Mercator stretches by the secant of the latitude: 1 % at 8 degrees from the equator."""
    mercator = {"crs": "EPSG:3857", "width": 300.0, "height": 300.0, "cell": 30.0}
    with pytest.warns(UserWarning, match=r"of EPSG:3857 is 1.02 near .* 30 m is 29.\d m on the ground.*EPSG:32735"):
        grid = grid_at(west=28.2e5 * 1.113, north=-1.2e6, **mercator)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        grid_at(west=28.2e5 * 1.113 + 30, north=-1.2e6, **mercator)
        check_grid(grid)
        grid_at(west=28.2e5 * 1.113, north=-0.5e6, **mercator)


def test_projection_is_made_once_per_thread_and_not_shared():
    mine = projection.projection_of("EPSG:26914")
    with ThreadPoolExecutor(1) as pool:
        other, again = (pool.submit(projection.projection_of, "EPSG:26914").result() for _ in range(2))
    assert projection.projection_of("EPSG:26914") is mine and other is again and other is not mine


def test_prime_meridian_of_the_crs_is_optional():
    """The prime meridian of NTF is Paris."""
    assert "+pm" in projection.projection_of("EPSG:27572").srs
    assert "+pm" not in projection.projection_of("EPSG:27572", own_meridian=True).srs


def test_grid_description_has_crs_latitude_and_longitude():
    grid = fifesim.grid_at("EPSG:32735", 620000.0, 7220000.0, 300.0, 200.0, 10.0)
    said = "620000 to 620300 E and 7219800 to 7220000 N in EPSG:32735 (latitude -25.13, longitude 28.19)"
    assert projection.lies_in_words(grid.affine, grid.shape, grid.crs) == said
    # Location given in the paper.
    assert projection.middle(sites.fife_site(30)) == pytest.approx((-96.54, 39.06), abs=0.02)
