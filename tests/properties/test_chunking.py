"""Images are identical to the bit in any chunks, and nothing is computed early."""

from itertools import pairwise

import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from lazy import in_chunks, no_compute

import fifesim

ROWS, COLUMNS = 45, 54
SITE = fifesim.fife_site(30 / 9, window=((90, 90 + ROWS), (180, 180 + COLUMNS)))
BANDS = ["TM3", "TM4"]


def image_of(lai):
    return fifesim.surface_reflectance(lai, bands=BANDS).fifesim.to_toa().fifesim.sense("TM")


LAI = fifesim.lai_scene(SITE, arp=0.15, seed=7)
IMAGE = image_of(LAI)


@st.composite
def pieces(draw, size, most):
    """Tuples of lengths that add up to `size`."""
    cuts = draw(st.lists(st.integers(1, size - 1), unique=True, max_size=most - 1))
    edges = [0, *sorted(cuts), size]
    return tuple(end - start for start, end in pairwise(edges))


@settings(max_examples=15)
@given(pieces(ROWS, 3), pieces(COLUMNS, 3))
def test_scene_and_image_are_the_same_in_any_chunks(rows, columns):
    with no_compute():
        lai = fifesim.lai_scene(SITE, arp=0.15, seed=7, chunks={"y": rows, "x": columns})
        image = image_of(lai)
    assert lai.chunks == (rows, columns)
    xr.testing.assert_identical(image.compute(), IMAGE)


@settings(max_examples=25)
@given(pieces(ROWS, 9), pieces(COLUMNS, 9), pieces(ROWS, 5), st.sampled_from([(2,), (1, 1)]))
def test_chunks_can_change_between_steps(rows, columns, later, bands):
    with no_compute():
        rho = fifesim.surface_reflectance(in_chunks(LAI, {"y": rows, "x": columns}), bands=BANDS)
        image = in_chunks(rho, {"y": later, "band": bands}).fifesim.to_toa().fifesim.sense("TM")
    xr.testing.assert_identical(image.compute(), IMAGE)
