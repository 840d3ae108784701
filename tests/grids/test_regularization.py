"""Operators from grid to grid against dense overlaps, and what moves with them."""

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute
from odc.geo.geobox import GeoBox

import fifesim
from fifesim.base.footprints import regularize
from fifesim.base.line_spread import Boxcar
from fifesim.grids import grid as grids
from fifesim.grids.reductions import areas, operators, regularized, resample

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


def raster(seed=0, bands=None):
    shape = tuple(SITE.shape) if bands is None else (bands, *SITE.shape)
    values = np.random.default_rng(seed).random(shape)
    return grids.place(xr.DataArray(values, dims=("band", "y", "x")[-len(shape) :], name=f"raster{seed}"), SITE)


SITE = fifesim.fife_site(30 / 9, window=((0, 36), (5, 50)))
ANYWHERE = [
    grids.aligned_grid(SITE, 30.0),
    fifesim.grid_at("EPSG:26914", 704950.0, 4334300.0, 400.0, 400.0, 23.0),
    fifesim.grid_at("EPSG:26914", 705001.0, 4334200.0, 60.0, 60.0, 1.7),
]


@pytest.mark.parametrize("pixels", ANYWHERE, ids=["aligned", "beyond-the-scene", "finer-than-cells"])
@pytest.mark.parametrize("bands", [None, 2])
def test_resampling_gives_the_same_bits_in_any_chunks(pixels, bands):
    scene = raster(bands=bands).assign_coords(sza=28.5)
    scene[..., 10:12, 20:22] = np.nan
    rows, columns = operators((Boxcar(30.0), Boxcar(30.0)), SITE, pixels)
    whole = resample(rows, columns, scene, pixels)
    np.testing.assert_array_equal(whole, regularize(scene.values, rows, columns))
    assert grids.same_grid(grids.geobox(whole), pixels)
    assert float(whole["sza"]) == 28.5
    for pieces in (ODD_CHUNKS, ODD_CHUNKS | {"band": 1}, {"y": 1, "x": 45}, {"y": 36, "x": 9}):
        with no_compute():
            lazy = resample(rows, columns, in_chunks(scene, pieces), pixels)
        assert lazy.chunks is not None
        xr.testing.assert_identical(lazy.compute(), whole)


def test_output_chunks_read_only_the_cells_that_they_need():
    """One bad chunk spoils the pixels over it and no others."""
    scene = in_chunks(raster(), {"y": 9, "x": 9})
    rows, columns = operators((Boxcar(30.0), Boxcar(30.0)), SITE, ANYWHERE[0])

    def spoil(block, block_info=None):
        if block_info[0]["chunk-location"] == (0, 0):
            raise RuntimeError("read")
        return block

    scene.data = scene.data.map_blocks(spoil, dtype=float)
    image = resample(rows, columns, scene, ANYWHERE[0])
    assert np.isfinite(image[2:, 2:].compute()).all()
    with pytest.raises(RuntimeError, match="read"):
        image[0, 0].compute()


def test_single_precision_stays_what_is_promised():
    """Lazy arrays promise a dtype before they are computed."""
    rows, columns = operators((Boxcar(30.0), Boxcar(30.0)), SITE, ANYWHERE[0])
    scene = raster().astype(np.float32)
    eager = resample(rows, columns, scene, ANYWHERE[0])
    lazy = resample(rows, columns, in_chunks(scene, ODD_CHUNKS), ANYWHERE[0])
    assert lazy.dtype == lazy.compute().dtype == eager.dtype


def test_grid_without_pixels_in_the_scene_is_all_missing():
    far = GeoBox((3, 4), SITE.affine * SITE.affine.translation(900, 900), SITE.crs)
    rows, columns = operators((Boxcar(30.0), Boxcar(30.0)), SITE, far)
    for scene in (raster(), in_chunks(raster(), ODD_CHUNKS)):
        assert np.isnan(resample(rows, columns, scene, far)).all()


def test_raster_without_a_name_gets_none_of_dasks():
    lazy = regularized(in_chunks(raster().rename(None), ODD_CHUNKS), areas(ANYWHERE[0]), ANYWHERE[0], min_valid=0.5)
    assert lazy.name is None
