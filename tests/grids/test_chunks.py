"""Kernels on dask arrays and windows of them: the same bits, nothing computed early, rasters on one grid only."""

import gc

import dask
import dask.array as da
import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute

import fifesim
from fifesim.grids import chunks, windows
from fifesim.grids import grid as grids
from fifesim.grids.chunks import all_apart, apart, by_band, layers_of
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


def test_numbers_fill_layers_and_order_is_kept(lai):
    out = by_band({"b": 0.5, "a": lai.transpose("x", "y")}, lai)
    assert out.dims == ("band", "y", "x") and out["band"].values.tolist() == ["b", "a"]
    np.testing.assert_array_equal(out[0], np.full(lai.shape, 0.5))
    np.testing.assert_array_equal(out[1], lai)
    assert out.rio.crs == lai.rio.crs
    with no_compute():
        lazy = by_band({"b": 0.5, "a": in_chunks(lai, ODD_CHUNKS)}, lai)
    xr.testing.assert_equal(lazy.compute(), out)


def test_layers_are_selected_by_name_or_shared(lai):
    both = by_band({"b": lai + 1, "a": lai}, lai)
    assert [float(each[0, 0] - lai[0, 0]) for each in layers_of(both, ["a", "b"], "soil")] == [0, 1]
    assert all(each.identical(lai) for each in layers_of(lai, ["a", "b"], "soil"))
    with pytest.raises(ValueError, match="the soil lacks band c, it has b, a"):
        layers_of(both, ["a", "c"], "soil")
    with pytest.raises(ValueError, match=r"the soil is a raster .* got float"):
        layers_of(0.5, ["a"], "soil")
    with pytest.raises(ValueError, match=r"a must be a number, or one raster .* got dimensions \('band', 'y', 'x'\)"):
        by_band({"a": both}, lai)


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
