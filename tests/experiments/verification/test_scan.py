"""Checks of scans notice what is wrong."""

import pytest

from fifesim.experiments.verification import scan


@pytest.mark.parametrize(
    ("name", "wrong", "said"),
    [
        ("footprint_operator", lambda weights: 1.001 * weights, "second moments of a turned footprint"),
        ("apply_operator", lambda image: 1.001 * image, "pixel of a scan along the grid"),
        ("scan_geometry", lambda view: view.assign(vaa=view["vaa"] + 0.01), "view angles of a grid"),
        ("sense_swath", lambda image: image + 0.01, "plane in a scan"),
    ],
)
def test_what_is_wrong_is_named(exceeded, name, wrong, said):
    assert said in exceeded(scan, name, wrong)


def test_all_is_well(exceeded):
    assert exceeded(scan) == []
