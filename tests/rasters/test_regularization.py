"""Operators from grid to grid against dense overlaps, and what moves with them."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute

import fifesim
from fifesim.base.footprints import Boxcar
from fifesim.rasters import grid as grids
from fifesim.rasters.regularization import areas, operators, regularized

CELLS = fifesim.grid_at("EPSG:26914", 705600.0, 4334000.0, 120.0, 90.0, 3.0)
# Off the lattice of the cells, and higher than wide.
PIXELS = fifesim.grid_at("EPSG:26914", 705604.0, 4333991.5, 96.0, 75.0, (25.0, 16.0))


@pytest.fixture
def cells():
    values = np.random.default_rng(4).random(tuple(CELLS.shape))
    return grids.place(xr.DataArray(values, dims=("y", "x"), name="cells", attrs={"units": "1"}), CELLS)


def overlaps(cell_edges, pixel_edges):
    """Lengths that each pixel and each cell share, over the length of the pixel."""
    low = np.maximum(pixel_edges[:-1, None], cell_edges[:-1])
    high = np.minimum(pixel_edges[1:, None], cell_edges[1:])
    return np.maximum(high - low, 0) / np.diff(pixel_edges)[:, None]


def test_means_over_areas_are_sums_of_overlaps(cells):
    """Edges counted southward and eastward from the corner of the cells."""
    rows = overlaps(3.0 * np.arange(31), 8.5 + 25.0 * np.arange(4))
    columns = overlaps(3.0 * np.arange(41), 4.0 + 16.0 * np.arange(7))
    found = regularized(cells, areas(PIXELS), PIXELS, min_valid=0.98)
    np.testing.assert_allclose(found, rows @ cells.values @ columns.T, rtol=1e-12)
    assert grids.same_grid(grids.geobox(found), PIXELS) and found.name == "cells" and found.attrs == {"units": "1"}


def test_shifts_go_southward_and_eastward(cells):
    """Pixels that lie elsewhere by whole cells see what others see there; a drift is one shift for each."""
    there = fifesim.grid_at("EPSG:26914", 705601.0, 4333985.5, 96.0, 75.0, (25.0, 16.0))
    moved = regularized(cells, areas(there), there, min_valid=0.0)
    shifted = regularized(cells, areas(PIXELS), PIXELS, shifts=(6.0, -3.0), min_valid=0.0)
    np.testing.assert_allclose(shifted, moved, rtol=1e-12)
    drift = regularized(cells, areas(PIXELS), PIXELS, shifts=(np.array([0.0, 6.0, 0.0]), 0.0), min_valid=0.0)
    south = regularized(cells, areas(PIXELS), PIXELS, shifts=(6.0, 0.0), min_valid=0.0)
    np.testing.assert_array_equal(drift[1], south[1])
    np.testing.assert_array_equal(drift[0], regularized(cells, areas(PIXELS), PIXELS, min_valid=0.0)[0])


def test_spreads_stand_down_and_across():
    rows, columns = operators((Boxcar(9.0), Boxcar(30.0)), CELLS, PIXELS)
    assert len(rows) == 3 and len(columns) == 6
    assert rows.count.max() == 4 and columns.count.max() == 11


def test_chunks_change_no_bit(cells):
    with no_compute():
        lazy = regularized(in_chunks(cells, ODD_CHUNKS), areas(PIXELS), PIXELS, min_valid=0.5)
    xr.testing.assert_identical(lazy.compute(), regularized(cells, areas(PIXELS), PIXELS, min_valid=0.5))
