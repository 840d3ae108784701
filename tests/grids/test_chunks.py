"""Kernels on dask arrays, their windows and classes, sums and means: the same bits, and nothing computed early."""

import gc
from itertools import product

import dask
import dask.array as da
import numpy as np
import pytest
import xarray as xr
from lazy import CHUNKS, ODD_CHUNKS, in_chunks, no_compute
from odc.geo.geobox import GeoBox

import fifesim
from fifesim.base.footprints import Boxcar, regularize
from fifesim.grids import chunks, classes, reductions, windows
from fifesim.grids import grid as grids
from fifesim.grids.chunks import all_apart, apart, by_band, layers_of
from fifesim.grids.classes import by_class, check_codes
from fifesim.grids.reductions import areas, combined, operators, regularized, resample, sums_by_block, sums_by_row
from fifesim.grids.windows import _ORIGINS, array_by_place, array_from_windows, gather, held, origin_of, with_origin

GRID = fifesim.fife_site(30 / 9, window=((0, 36), (5, 50)))
BANDS = xr.DataArray([1.0, 2.0, 3.0], dims="band")


def raster(grid=GRID, seed=0, bands=None):
    shape = tuple(grid.shape) if bands is None else (bands, *grid.shape)
    values = np.random.default_rng(seed).random(shape)
    return grids.place(xr.DataArray(values, dims=("band", "y", "x")[-len(shape) :], name=f"raster{seed}"), grid)


@pytest.mark.parametrize("pieces", [{}, ODD_CHUNKS, ODD_CHUNKS | {"band": 1}])
@pytest.mark.parametrize("plain_pieces", [{}, ODD_CHUNKS])
def test_kernels_may_read_and_create_bands(pieces, plain_pieces):
    """Rasters are in memory or lazy; a file opened lazily has one band per chunk."""
    plain, cube = in_chunks(raster(), plain_pieces), in_chunks(raster(seed=1, bands=3), pieces)
    with no_compute():
        made = chunks.pointwise(lambda a: np.stack([a, 2 * a]), plain, bands=2)
        sums = chunks.pointwise(lambda a, b, c: a + b * c, cube, plain, BANDS)
        both = chunks.pointwise(lambda a, b, c: np.moveaxis(a + b[..., None] * c, -1, 0), cube, plain, BANDS, bands=3)
        power = chunks.pointwise(lambda a, power: (9 * a**power).astype(np.uint8), plain, dtype=np.uint8, power=2)
    np.testing.assert_array_equal(made, np.stack([plain.values, 2 * plain.values]))
    np.testing.assert_array_equal(power, (9 * plain.values**2).astype(int))
    assert power.dtype == np.uint8 == power.compute().dtype and grids.same_grid(grids.geobox(power), GRID)
    for out in (sums, both):
        assert out.dims == ("band", "y", "x")
        np.testing.assert_array_equal(out, cube.values + plain.values * BANDS.values[:, None, None])


def test_only_rasters_on_the_same_cells_under_the_same_sun_are_combined():
    """xarray's own sum of rasters whose coordinates differ by rounding is empty, without a warning."""
    one, two, three = (raster(seed=seed).assign_coords(sza=float(sza)) for seed, sza in enumerate((20, 20, 30)))
    shifted = two.assign_coords(x=two["x"].values + 1e-7)
    np.testing.assert_array_equal(chunks.pointwise(np.add, one, shifted), one.values + two.values)
    other = raster(fifesim.fife_site(30 / 9, window=((0, 36), (6, 51))), seed=1)
    refused = {
        "'raster0' and 'raster1' have different grids": (one, other),
        "sza is 20 in 'raster0' and 30 in 'raster2'": (one, three),
        "sza is 20 in 'raster1' and 30 in 'raster2'": (one.drop_vars("sza"), two, three),
    }
    for message, arrays in refused.items():
        with pytest.raises(ValueError, match=message):
            chunks.pointwise(lambda *cells: cells[0], *arrays)


def test_entries_along_the_first_axis_are_views():
    whole = np.arange(24.0).reshape(2, 3, 4)
    for array in (da.from_array(whole, chunks=(2, 2, 4)), whole):
        np.testing.assert_array_equal(np.stack(chunks.along_first(array)), whole)
    assert np.shares_memory(chunks.along_first(whole)[1], whole)


POSITIONS = np.add.outer(1000.0 * np.arange(60), np.arange(80))


def counting_array(calls):
    """A lazy array of positions that records each block when it is computed."""

    def count(block, block_info):
        calls.append(block_info[0]["chunk-location"])
        return block

    return da.from_array(POSITIONS, chunks=(20, 30)).map_blocks(count, dtype=float, meta=np.empty((0, 0)))


def test_second_pass_starts_after_the_first_has_finished():
    """The mean needs all chunks; without a barrier, every chunk would stay in memory until the mean is known."""
    calls = []
    source = xr.DataArray(counting_array(calls), dims=("y", "x"))
    mean = source.data.mean()
    found = (chunks.second_pass(source, mean) - mean).compute(scheduler="sync")
    np.testing.assert_allclose(found, POSITIONS - POSITIONS.mean(), rtol=1e-12)
    assert len(calls) == 18 and sorted(calls[:9]) == sorted(calls[9:])


def rechunked_array():
    """An array rechunked and sampled by slices and lists; dask's own copy of its graph loses tasks."""
    source = da.from_array(np.arange(4800.0).reshape(60, 80), chunks=(20, 30)) + 1
    return source.rechunk((7, 80))[::3, [5, 2, 2, 70]].rechunk((4, 3))


@pytest.mark.parametrize("dtype", [float, np.float32, np.int16])
def test_separate_copy_has_the_values_of_the_array(dtype):
    """The copy shares no task with the array, and its task waits for no other: one thread is enough."""
    array = rechunked_array().astype(dtype)
    with no_compute():
        found = apart(array)
    assert (found.shape, found.dtype, found.numblocks) == (array.shape, dtype, (1, 1))
    assert not set(found.__dask_graph__()) & set(array.__dask_graph__())
    for scheduler in ("synchronous", "threads"):
        np.testing.assert_array_equal(found.compute(scheduler=scheduler, num_workers=1), array.compute())


def test_equal_arrays_have_equal_keys_and_shared_parts_are_computed_once():
    """Identical graphs become one task; different arrays have different keys."""
    calls = []
    array = counting_array(calls)
    one, other = apart(array), apart(array)
    assert one.name == other.name and one.name != apart(array + 1).name
    assert apart(rechunked_array()).name == apart(rechunked_array()).name
    dask.compute(one, other, scheduler="synchronous")
    assert len(calls) == 9
    found = dask.compute(*all_apart([array[::4, ::4], array.sum(axis=0)]), scheduler="synchronous")
    assert len(calls) == 18
    np.testing.assert_array_equal(found[0], POSITIONS[::4, ::4])
    np.testing.assert_array_equal(found[1], POSITIONS.sum(axis=0))
    # Each consumer gets a separate copy of the values.
    found = one.compute(scheduler="synchronous")
    found += 1
    np.testing.assert_array_equal(one.compute(scheduler="synchronous"), found - 1)


def test_layers_are_filled_in_order_and_selected_by_name(lai):
    layers = {"b": 0.5, "a": lai.transpose("x", "y")}
    out = by_band(layers, lai)
    assert out.dims == ("band", "y", "x") and out["band"].values.tolist() == ["b", "a"] and out.rio.crs == lai.rio.crs
    np.testing.assert_array_equal(out, [np.full(lai.shape, 0.5), lai])
    with no_compute():
        lazy = by_band({"b": 0.5, "a": in_chunks(lai, ODD_CHUNKS)}, lai)
    xr.testing.assert_equal(lazy.compute(), out)
    for found, expected in zip(layers_of(out, ["a", "b"], "soil"), (lai.values, 0.5), strict=True):
        np.testing.assert_array_equal(found, np.broadcast_to(expected, lai.shape))
    assert all(each.identical(lai) for each in layers_of(lai, ["a", "b"], "soil"))
    with pytest.raises(ValueError, match="the soil lacks band c, it has b, a"):
        layers_of(out, ["a", "c"], "soil")
    with pytest.raises(ValueError, match=r"a must be a number, or one raster .* got dimensions \('band', 'y', 'x'\)"):
        by_band({"a": out}, lai)


CELLS = np.arange(11.0 * 13).reshape(11, 13)


def mean_of_three(array, chunks):
    """Mean of each cell and its western and eastern neighbours; NaN if a neighbour lies outside."""

    def ask(rows, columns):
        return (), [(rows, slice(columns.start - 1, columns.stop + 1))]

    def kernel(window):
        return (window[:, :-2] + window[:, 1:-1] + window[:, 2:]) / 3

    return array_from_windows(kernel, [array], chunks, ask, token="mean-of-three")


@pytest.mark.parametrize("read", [-1, (3, 4), (11, 1)])
@pytest.mark.parametrize("made", [((11,), (13,)), ((2, 9), (5, 5, 3))])
def test_windows_are_assembled_from_any_chunks(read, made):
    by_place = array_by_place(
        lambda row, column, shape: CELLS[row:, column:][: shape[0], : shape[1]], ((11,), (7, 6)), token="c"
    )
    for source in (da.from_array(CELLS, chunks=read), by_place):
        found = mean_of_three(source, made)
        assert found.chunks == made
        np.testing.assert_array_equal(found.compute()[:, 1:-1], CELLS[:, 1:-1])
        assert np.isnan(found.compute()[:, [0, -1]]).all()


def test_gathered_window_is_missing_beyond_the_array():
    found = gather(CELLS, (slice(-1, 2), slice(11, 15)))
    np.testing.assert_array_equal(found[1:, :2], CELLS[:2, 11:])
    assert np.isnan(found[0]).all() and np.isnan(found[:, 2:]).all()


def test_block_split_at_seams_is_identical():
    """A block split at seams reads only its margins from other chunks."""
    cells = np.random.default_rng(3).random((2, 30, 40))
    array = da.from_array(cells, chunks=(2, 10, 10))

    def kernel(window):
        return window[:, :-2, :-2] + window[:, 2:, 2:]

    def ask(rows, columns):
        return (), [tuple(slice(each.start, each.stop + 2) for each in (rows, columns))]

    made = ((8, 10, 10), (8, 10, 20))
    options = {"token": "parts", "leading": (2,), "seams": ([10, 20], [10, 20, 30])}
    found = array_from_windows(kernel, [array], made, ask, **options)
    np.testing.assert_array_equal(found.compute(scheduler="synchronous"), cells[:, :-2, :-2] + cells[:, 2:, 2:])


def test_dataset_of_an_array_and_its_derivative_is_computed():
    """Without `held`, dask fuses the two arrays and no longer finds the first."""
    image = held(da.from_array(CELLS, chunks=5) + 1.0)
    dataset = xr.Dataset({"image": (("y", "x"), image), "index": (("y", "x"), image * 2)})
    found = dask.compute(dataset)[0]
    np.testing.assert_array_equal(found["image"], CELLS + 1)
    np.testing.assert_array_equal(found["index"], 2 * CELLS + 2)
    assert held(CELLS) is CELLS


def position_cells(row, column, shape):
    """Kernel whose cell values encode their location."""
    return 1000.0 * (row + np.arange(shape[0]))[:, None] + column + np.arange(shape[1])


@pytest.mark.parametrize("pieces", [None, "auto", 17, {"y": 5, "x": 8}, {"y": 5}, {"x": -1}, {"y": (30, 6), "x": 45}])
def test_tiles_depend_on_their_location(pieces):
    with no_compute():
        out = windows.tiles(position_cells, GRID, pieces, tile=8)
    assert (out.chunks is None) == (pieces is None)
    np.testing.assert_array_equal(out, position_cells(0, 0, tuple(GRID.shape)))
    with pytest.raises(ValueError, match="chunks name the dimensions y and x, got band"):
        windows.tiles(position_cells, GRID, {"band": 1}, tile=8)


@pytest.mark.parametrize("tile", [8, 1008])
def test_chunks_and_parts_end_at_tile_boundaries(monkeypatch, tile):
    """Each chunk holds two tiles of 8 cells; the lattice starts at the origin of the CRS."""
    monkeypatch.setattr(windows, "_ROWS", 3)
    asked, step, lattice = [], 16 if tile == 8 else tile, grids.lattice_position(GRID)
    for first, sizes in zip(lattice, windows.tiles(position_cells, GRID, "auto", tile=tile).chunks, strict=True):
        assert ((first + np.cumsum(sizes)[:-1]) % step == 0).all() and (len(sizes) > 1) == (tile == 8)

    def kernel(row, column, shape, block):
        asked.append((row, column, shape))
        return position_cells(row, column, shape) + block

    other = np.random.default_rng(1).random(tuple(GRID.shape))
    out = windows.part_by_part(kernel, GRID, other, tile=tile)
    np.testing.assert_array_equal(out, position_cells(0, 0, tuple(GRID.shape)) + other)
    grids.check_grid(grids.geobox(out))
    for row, column, (rows, columns) in asked:
        assert rows <= 3
        for first, size, start in zip((row, column), (rows, columns), lattice, strict=True):
            assert (start + first) // step == (start + first + size - 1) // step


@pytest.mark.parametrize("tile", [None, 8])
def test_kernel_gets_the_location_of_its_block(monkeypatch, tile):
    monkeypatch.setattr(windows, "_ROWS", 3)
    array = windows.tiles(position_cells, GRID, tile=8)

    def kernel(block, starts):
        return block - position_cells(*starts, block.shape)

    assert (windows.located(kernel, array, tile=tile) == 0).all()
    assert (windows.located(kernel, array.chunk({"y": 5, "x": 8}), tile=tile) == 0).all()


def test_origin_is_kept_with_unchanged_values_and_released_with_its_raster():
    made = with_origin(xr.DataArray(da.zeros((4, 6), chunks=2), dims=("y", "x")), "leaves")
    assert origin_of(made) == "leaves" and origin_of(made.compute()) is None
    assert origin_of(made.assign_coords(sza=30.0).rename("other")) == "leaves"
    assert origin_of(made + 1) is None and origin_of(made[1:]) is None and origin_of(made.persist()) is None
    key = id(made.data.dask), made.data.name
    assert key in _ORIGINS
    del made
    gc.collect()
    assert key not in _ORIGINS


VALUES = np.random.default_rng(9).integers(0, 100, (23, 31)).astype(float)
WHOLE = xr.DataArray(VALUES, dims=("y", "x"))


def count_and_total(one, other, power):
    """Row sums of ones and of one array minus a power of the other."""
    return np.stack([np.full(len(one), one.shape[1]), (one - other**power).sum(axis=1)], axis=1)


@pytest.mark.parametrize("cells", [1, 31 * 5, 2**22])
@pytest.mark.parametrize("chunks", [{}, ODD_CHUNKS, {"y": 1}, {"x": 1}])
def test_each_row_is_summed_as_a_whole(monkeypatch, cells, chunks):
    """The result does not depend on how many rows are read together; integers are exact."""
    monkeypatch.setattr("fifesim.grids.reductions._CELLS", cells)
    found = sums_by_row(count_and_total, in_chunks(WHOLE, chunks), WHOLE + 1, count=2, power=2)
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
    data = in_chunks(WHOLE, chunks).data
    found = sums_by_block(margins_and_pairs, data, (5,), 8, margin=(1, 2))
    pairs = np.sum(VALUES[:-1] * VALUES[1:])
    np.testing.assert_array_equal(found, [2 * 4, 2 * 4, 3 * 3 * 2, 3 * 3 * 2, pairs])
    np.testing.assert_array_equal(sums_by_block(margins_and_pairs, data, (5,), 99, margin=(1, 2)), [0, 0, 0, 0, pairs])


def test_block_sums_are_added_in_order():
    """Ones added singly to 1e16 are lost in rounding; ones summed beforehand are not."""
    data = np.array([[1e16, *[1.0] * 62, -1e16]])
    assert sums_by_block(lambda cells, margin: cells[0], data, (1,), 1).tolist() == [0.0]


FINE = fifesim.grid_at("EPSG:26914", 705600.0, 4334000.0, 120.0, 90.0, 3.0)
# The pixels are not aligned with the cells, and taller than wide.
PIXELS = fifesim.grid_at("EPSG:26914", 705604.0, 4333991.5, 96.0, 75.0, (25.0, 16.0))


@pytest.fixture
def cells():
    return raster(FINE).rename("cells").assign_attrs(units="1")


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


ANYWHERE = [
    grids.aligned_grid(GRID, 30.0),
    fifesim.grid_at("EPSG:26914", 704950.0, 4334300.0, 400.0, 400.0, 23.0),
    fifesim.grid_at("EPSG:26914", 705001.0, 4334200.0, 60.0, 60.0, 1.7),
    GeoBox((3, 4), GRID.affine * GRID.affine.translation(900, 900), GRID.crs),
]


@pytest.mark.parametrize("pixels", ANYWHERE, ids=["aligned", "around", "finer", "elsewhere"])
@pytest.mark.parametrize("bands", [None, 2])
def test_resampling_gives_the_same_bits_in_any_chunks(pixels, bands):
    scene = raster(bands=bands).assign_coords(sza=28.5)
    scene[..., 10:12, 20:22] = np.nan
    rows, columns = operators((Boxcar(30.0), Boxcar(30.0)), GRID, pixels)
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


def test_classes_with_the_same_kernel_are_evaluated_together(lai):
    """The third class and cells without a class may be absent."""
    for codes in ([1, 5], [-1, 1, 5], [1, 5, 9], [-1, 1, 5, 9]):
        calls = []
        both = (lambda cells, calls=calls: calls.append(cells.size) or np.sqrt(cells), [])
        cover = lai.copy(data=np.random.default_rng(3).choice(codes, lai.shape).astype(np.int16))
        made = by_class({1: both, 5: both, 9: (np.negative, [])}, cover, lai)
        np.testing.assert_array_equal(made, np.where(cover == 9, -lai, np.where(cover == -1, np.nan, np.sqrt(lai))))
        assert calls == [int(cover.isin([1, 5]).sum())]


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
