"""What PROJ makes is kept by each thread for itself."""

from concurrent.futures import ThreadPoolExecutor

import pyproj
import pytest

from fifesim.grids import projection

UTM = "EPSG:26914"


@pytest.mark.parametrize(
    "make",
    [
        lambda: projection.transformer(UTM, 4326),
        lambda: projection.projection_of(UTM),
        lambda: projection.from_own_meridian(UTM),
    ],
)
def test_a_thread_makes_an_object_once_and_shares_it_with_no_other(make):
    mine = make()
    with ThreadPoolExecutor(1) as pool:
        other, again = (pool.submit(make).result() for _ in range(2))
    assert make() is mine and other is again and other is not mine


def test_objects_are_what_proj_makes():
    place = 708000.0, 4331000.0
    expected = pyproj.Transformer.from_crs(UTM, 4326, always_xy=True).transform(*place)
    assert projection.transformer(UTM, 4326).transform(*place) == expected
    found, expected = (each.get_factors(-96.5, 39.1) for each in (projection.projection_of(UTM), pyproj.Proj(UTM)))
    assert (found.meridian_convergence, found.meridional_scale) == (
        expected.meridian_convergence,
        expected.meridional_scale,
    )


def test_longitudes_count_from_the_meridian_of_the_crs():
    """That of Paris: NTF has its origin there."""
    assert "+pm" in pyproj.Proj("EPSG:27572").srs
    assert "+pm" not in projection.from_own_meridian("EPSG:27572").srs


def test_few_are_kept(monkeypatch):
    monkeypatch.setattr(projection, "_MOST", 2)
    with ThreadPoolExecutor(1) as pool:
        first, _, _, again = (
            pool.submit(projection.projection_of, f"EPSG:{code}").result() for code in (32601, 32602, 32603, 32601)
        )
    assert again is not first
