"""Sums and means over rasters, bands and pixel footprints, and kernels by cover class."""

from itertools import product

import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks, no_compute
from odc.geo.geobox import GeoBox

import fifesim
from fifesim.base.footprints import Boxcar, regularize
from fifesim.grids import classes, reductions
from fifesim.grids import grid as grids
from fifesim.grids.classes import by_class, check_codes
from fifesim.grids.reductions import areas, combined, operators, regularized, resample, sums_by_block, sums_by_row

VALUES = np.random.default_rng(9).integers(0, 100, (23, 31)).astype(float)
RASTER = xr.DataArray(VALUES, dims=("y", "x"))


def count_and_total(one, other, power):
    """Row sums of ones and of one array minus a power of the other."""
    return np.stack([np.full(len(one), one.shape[1]), (one - other**power).sum(axis=1)], axis=1)


@pytest.mark.parametrize("cells", [1, 31 * 5, 2**22])
@pytest.mark.parametrize("chunks", [{}, ODD_CHUNKS, {"y": 1}, {"x": 1}])
def test_each_row_is_summed_as_a_whole(monkeypatch, cells, chunks):
    """The result does not depend on how many rows are read together; integers are exact."""
    monkeypatch.setattr("fifesim.grids.reductions._CELLS", cells)
    found = sums_by_row(count_and_total, in_chunks(RASTER, chunks), RASTER + 1, count=2, power=2)
    np.testing.assert_array_equal(found, count_and_total(VALUES, VALUES + 1, 2))


def margins_and_pairs(cells, margin):
    """Margin sizes, and the sum of products of inner cells with the neighbour below."""
    (above, below), (left, right) = margin
    padded = np.pad(cells, ((0, 1), (0, 0)))
    inside = slice(above, len(cells) - below), slice(left, cells.shape[1] - right)
    return np.array([above, below, left, right, np.sum((cells * padded[1:])[inside])])


@pytest.mark.parametrize("chunks", [{}, ODD_CHUNKS, {"y": 23, "x": 4}])
def test_sums_by_block_with_margins_give_the_total(chunks):
    """There are 3 rows and 4 columns of blocks; blocks at the raster edge lack the margin on that side."""
    data = in_chunks(RASTER, chunks).data
    found = sums_by_block(margins_and_pairs, data, (5,), 8, margin=(1, 2))
    pairs = np.sum(VALUES[:-1] * VALUES[1:])
    np.testing.assert_array_equal(found, [2 * 4, 2 * 4, 3 * 3 * 2, 3 * 3 * 2, pairs])
    np.testing.assert_array_equal(sums_by_block(margins_and_pairs, data, (5,), 99, margin=(1, 2)), [0, 0, 0, 0, pairs])


def test_block_sums_are_added_in_order():
    """Ones added singly to 1e16 are lost in rounding; ones summed beforehand are not."""
    data = np.array([[1e16, *[1.0] * 62, -1e16]])
    assert sums_by_block(lambda cells, margin: cells[0], data, (1,), 1).tolist() == [0.0]
    assert data.sum() != 0


CELLS = fifesim.grid_at("EPSG:26914", 705600.0, 4334000.0, 120.0, 90.0, 3.0)
# The pixels are not aligned with the cells, and taller than wide.
PIXELS = fifesim.grid_at("EPSG:26914", 705604.0, 4333991.5, 96.0, 75.0, (25.0, 16.0))


def raster(grid, *bands):
    values = np.random.default_rng(4).random((*bands, *grid.shape))
    raster = xr.DataArray(values, dims=("band", "y", "x")[-values.ndim :], name="cells", attrs={"units": "1"})
    return grids.place(raster, grid)


@pytest.fixture
def cells():
    return raster(CELLS)


def overlaps(cell_edges, pixel_edges):
    """Overlap length of each pixel with each cell, divided by the pixel length."""
    low = np.maximum(pixel_edges[:-1, None], cell_edges[:-1])
    high = np.minimum(pixel_edges[1:, None], cell_edges[1:])
    return np.maximum(high - low, 0) / np.diff(pixel_edges)[:, None]


def test_means_over_areas_are_sums_of_overlaps(cells):
    """Edges are measured southward and eastward from the corner of the cells."""
    rows = overlaps(3.0 * np.arange(31), 8.5 + 25.0 * np.arange(4))
    columns = overlaps(3.0 * np.arange(41), 4.0 + 16.0 * np.arange(7))
    found = regularized(cells, areas(PIXELS), PIXELS, min_valid=0.98)
    with no_compute():
        lazy = regularized(in_chunks(cells.rename(None), ODD_CHUNKS), areas(PIXELS), PIXELS, min_valid=0.98)
    assert lazy.name is None
    xr.testing.assert_identical(lazy.compute().rename("cells"), found)
    np.testing.assert_allclose(found, rows @ cells.values @ columns.T, rtol=1e-12)
    assert grids.same_grid(grids.geobox(found), PIXELS) and found.name == "cells" and found.attrs == {"units": "1"}


def test_shifts_go_southward_and_eastward(cells):
    """A shift by whole cells equals moving the pixels; a drift is one shift per line."""
    there = fifesim.grid_at("EPSG:26914", 705601.0, 4333985.5, 96.0, 75.0, (25.0, 16.0))
    moved = regularized(cells, areas(there), there, min_valid=0.0)
    shifted = regularized(cells, areas(PIXELS), PIXELS, shifts=(6.0, -3.0), min_valid=0.0)
    np.testing.assert_allclose(shifted, moved, rtol=1e-12)
    drift = regularized(cells, areas(PIXELS), PIXELS, shifts=(np.array([0.0, 6.0, 0.0]), 0.0), min_valid=0.0)
    south = regularized(cells, areas(PIXELS), PIXELS, shifts=(6.0, 0.0), min_valid=0.0)
    np.testing.assert_array_equal(drift[1], south[1])
    np.testing.assert_array_equal(drift[0], regularized(cells, areas(PIXELS), PIXELS, min_valid=0.0)[0])


SITE = fifesim.fife_site(30 / 9, window=((0, 36), (5, 50)))
ANYWHERE = [
    grids.aligned_grid(SITE, 30.0),
    fifesim.grid_at("EPSG:26914", 704950.0, 4334300.0, 400.0, 400.0, 23.0),
    fifesim.grid_at("EPSG:26914", 705001.0, 4334200.0, 60.0, 60.0, 1.7),
    GeoBox((3, 4), SITE.affine * SITE.affine.translation(900, 900), SITE.crs),
]


@pytest.mark.parametrize("pixels", ANYWHERE, ids=["aligned", "around", "finer", "elsewhere"])
@pytest.mark.parametrize("bands", [[], [2]], ids=str)
def test_resampling_gives_the_same_bits_in_any_chunks(pixels, bands):
    scene = raster(SITE, *bands).assign_coords(sza=28.5)
    scene[..., 10:12, 20:22] = np.nan
    rows, columns = operators((Boxcar(30.0), Boxcar(30.0)), SITE, pixels)
    whole = resample(rows, columns, scene, pixels)
    np.testing.assert_array_equal(whole, regularize(scene.values, rows, columns))
    assert grids.same_grid(grids.geobox(whole), pixels) and np.isnan(whole).all() == (pixels is ANYWHERE[-1])
    assert float(whole["sza"]) == 28.5
    for pieces in (ODD_CHUNKS, ODD_CHUNKS | {"band": 1}, {"y": 1, "x": 45}, {"y": 36, "x": 9}):
        with no_compute():
            lazy = resample(rows, columns, in_chunks(scene, pieces), pixels)
        assert lazy.chunks is not None
        xr.testing.assert_identical(lazy.compute(), whole)
    # Lazy arrays declare a dtype before they are computed.
    single = scene.astype(np.float32)
    lazy, eager = (resample(rows, columns, each, pixels) for each in (in_chunks(single, ODD_CHUNKS), single))
    assert lazy.dtype == lazy.compute().dtype == eager.dtype


WEIGHTS = np.array([[0.5, 0.25, 0.0, 0.0, 0.25], [0.0, 0.0, 2.0, -1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0]])


@pytest.fixture
def cube():
    values = np.random.Generator(np.random.Philox(3)).random((5, 6, 7))
    coords = {"wavelength": ("band", np.arange(5.0)), "sza": 30.0, "y": np.arange(6.0)}
    return xr.DataArray(values, dims=("band", "y", "x"), coords=coords, name="rho")


def test_combination_equals_the_matrix_product(cube):
    found = combined(cube, "band", WEIGHTS)
    np.testing.assert_allclose(found, np.einsum("bn,nyx->byx", WEIGHTS, cube), rtol=1e-15)
    assert found.dims == ("band", "y", "x") and found.name == "rho"
    assert set(found.coords) == {"sza", "y"}
    # Bands come before rows; the order of other dimensions is kept.
    xr.testing.assert_identical(combined(cube.transpose("y", "x", "band"), "band", WEIGHTS), found)
    assert combined(cube.isel(y=0).transpose("x", "band"), "band", WEIGHTS).dims == ("x", "band")
    seasons = cube.expand_dims(time=2).rename(band="wavelength_number")
    assert combined(seasons, "wavelength_number", WEIGHTS).dims == ("time", "band", "y", "x")


@pytest.mark.parametrize("in_turn", [0, reductions._IN_TURN])
@pytest.mark.parametrize("chunks", [(5, 6, 7), (1, 6, 7), (2, 4, 3), (3, 1, 1)])
def test_chunks_give_the_same_bits_and_stay_lazy(cube, chunks, in_turn, monkeypatch):
    monkeypatch.setattr(reductions, "_IN_TURN", in_turn)
    with no_compute():
        lazy = combined(cube.chunk(dict(zip(cube.dims, chunks, strict=True))), "band", WEIGHTS)
    xr.testing.assert_identical(lazy.compute(), combined(cube, "band", WEIGHTS))
    assert lazy.chunks[1:] == cube.chunk(dict(zip(cube.dims, chunks, strict=True))).chunks[1:]


def test_missing_samples_and_single_precision(cube):
    """A missing sample is missing only in sums with a weight for it; single precision is summed in double."""
    single = cube.astype(np.float32)
    exact = combined(single.astype(float), "band", WEIGHTS)
    xr.testing.assert_identical(combined(single, "band", WEIGHTS), exact.astype(np.float32))
    cube[2, 1, 1] = np.nan
    assert np.argwhere(np.isnan(combined(cube, "band", WEIGHTS).values)).tolist() == [[1, 1, 1]]


@pytest.fixture
def cover(lai):
    codes = np.random.default_rng(2).choice([-1, 1, 5, 9], lai.shape).astype(np.int16)
    return lai.copy(data=codes).rename("cover")


@pytest.fixture
def kernels(lai):
    by_band = xr.DataArray([1.0, 2.0], dims="band")
    shifted = (lai + 1).rename("shifted")
    rows = xr.DataArray(np.arange(lai.sizes["y"]) * 1.0, dims="y", coords={"y": lai.y})
    return {
        1: (lambda cells, bands: bands[:, None] * cells, [by_band]),
        5: (lambda cells, other: np.stack([cells - other, other]), [shifted]),
        9: (lambda cells, other, row, bands: np.stack([bands[0] * row, other]), [shifted, rows, by_band]),
    }


@pytest.mark.parametrize("at_once", [7, 2**17])
@pytest.mark.parametrize("chunks", [None, CHUNKS, ODD_CHUNKS], ids=str)
def test_each_class_has_the_values_of_its_kernel(monkeypatch, lai, cover, kernels, chunks, at_once):
    monkeypatch.setattr(classes, "_AT_ONCE", at_once)
    expected = np.full((2, *lai.shape), np.nan)
    values, rows = lai.values, np.broadcast_to(np.arange(lai.sizes["y"])[:, None], lai.shape)
    expected[:, cover == 1] = [values[cover == 1], 2 * values[cover == 1]]
    expected[:, cover == 5] = [(values - (values + 1))[cover == 5], (values + 1)[cover == 5]]
    expected[:, cover == 9] = [rows[cover == 9], (values + 1)[cover == 9]]
    if chunks:
        lai, cover = in_chunks(lai, chunks), in_chunks(cover, chunks)
    with no_compute():
        made = by_class(kernels, cover, lai, bands=2)
    assert (made.chunks is not None) == bool(chunks)
    np.testing.assert_array_equal(made, expected)


def test_code_without_a_kernel_raises_when_computed(lai, cover):
    lazy = by_class({1: (np.sqrt, []), 5: (np.sqrt, [])}, in_chunks(cover, CHUNKS), lai)
    with pytest.raises(ValueError, match="codes without a class: 9"):
        lazy.compute()


TABLE = (40, 0, 32764)


def test_known_codes_pass_in_any_number_type():
    """NaN and -1 have no class."""
    known = np.random.default_rng(1).choice(TABLE, 1000)
    for dtype in (np.int16, np.int64, float, np.uint16):
        np.testing.assert_array_equal(check_codes(known.astype(dtype), TABLE), known)
        assert check_codes(known.astype(dtype), TABLE).dtype == np.int16
    assert check_codes(np.array([np.nan, 40.0, -1.0]), TABLE).tolist() == [-1, 40, -1]


def test_unknown_codes_are_named_in_a_short_message():
    """As an index from the end of an array, -5 would be 32764."""
    for dtype, wrong in product((np.int16, np.int32, float), (-5, 7, 32765)):
        said = rf"codes without a class: {wrong}, in 2 of 3 cells. Classes are 40, 0, 32764"
        with pytest.raises(ValueError, match=said):
            check_codes(np.array([wrong, 40, wrong], dtype), TABLE)
    with pytest.raises(ValueError, match=r"codes without a class: 1\.5, in 1 of 1"):
        check_codes(np.array([1.5]), (1, 2))
    with pytest.raises(ValueError, match=r"1, 2, 3, 4, 5, 6, 7, 8, \.\.\., in") as caught:
        check_codes(np.arange(1, 1001), tuple(range(2000, 3000)))
    assert len(str(caught.value)) < 500
