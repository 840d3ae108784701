"""How a kernel meets dask: the same bits, nothing early, and only rasters that lie on each other."""

from typing import NamedTuple

import dask
import dask.array as da
import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, in_chunks, no_compute

import fifesim
from fifesim.grids import chunks
from fifesim.grids import grid as grids

GRID = fifesim.fife_site(30 / 9, window=((0, 36), (5, 50)))
BANDS = xr.DataArray([1.0, 2.0, 3.0], dims="band")


def raster(grid=GRID, seed=0, bands=None):
    shape = tuple(grid.shape) if bands is None else (bands, *grid.shape)
    values = np.random.default_rng(seed).random(shape)
    return grids.place(xr.DataArray(values, dims=("band", "y", "x")[-len(shape) :], name=f"raster{seed}"), grid)


def test_kernel_sees_numbers_and_the_result_keeps_the_grid(array_type):
    one, two = array_type(raster(seed=1)), array_type(raster(seed=2))
    with no_compute():
        out = chunks.pointwise(lambda a, b, power: a + b**power, one, two, power=2)
    np.testing.assert_array_equal(out, one.values + two.values**2)
    assert grids.same_grid(grids.geobox(out), GRID)


def test_values_along_band_meet_rasters(array_type):
    cube = array_type(raster(bands=3))
    with no_compute():
        out = chunks.pointwise(np.multiply, cube, BANDS)
    assert out.dims == ("band", "y", "x")
    np.testing.assert_array_equal(out, cube.values * BANDS.values[:, None, None])


def test_kernel_may_make_bands(array_type):
    plain = array_type(raster())
    with no_compute():
        out = chunks.pointwise(lambda a: np.stack([a, 2 * a]), plain, bands=2)
    assert out.dims == ("band", "y", "x")
    np.testing.assert_array_equal(out, np.stack([plain.values, 2 * plain.values]))


@pytest.mark.parametrize("pieces", [{}, ODD_CHUNKS, ODD_CHUNKS | {"band": 1}])
def test_kernel_that_makes_bands_gets_those_of_its_inputs_together(pieces):
    """A file opened lazily has one band a chunk."""
    plain, cube = in_chunks(raster(), pieces), in_chunks(raster(seed=1, bands=3), pieces)
    with no_compute():
        out = chunks.pointwise(lambda a, b: np.moveaxis(a[..., None] - b, -1, 0), plain, cube, bands=3)
    np.testing.assert_array_equal(out, plain.values - cube.values)


@pytest.mark.parametrize("pieces", [ODD_CHUNKS, ODD_CHUNKS | {"band": 1}])
def test_what_is_in_memory_meets_what_is_lazy(pieces):
    plain, cube = raster(), in_chunks(raster(seed=1, bands=3), pieces)
    with no_compute():
        sums = chunks.pointwise(lambda a, b, c: a + b * c, cube, plain, BANDS)
        made = chunks.pointwise(lambda a, b, c: np.moveaxis(a + b[..., None] * c, -1, 0), cube, plain, BANDS, bands=3)
    for out in (sums, made):
        np.testing.assert_array_equal(out, cube.values + plain.values * BANDS.values[:, None, None])


def test_blocks_along_bands_are_not_copied():
    """Blocks that dask puts together along an axis are copied, one too."""
    made, seen = [], []

    def source(block):
        made.append(block + 1)
        return made[-1]

    def kernel(cells, weights):
        seen.append(cells)
        return np.moveaxis(cells * weights, -1, 0)

    cube = in_chunks(raster(bands=3), {"band": 3, "y": 20, "x": 25})
    cube = cube.copy(data=cube.data.map_blocks(source, meta=cube.data._meta))
    out = chunks.pointwise(kernel, cube, BANDS, bands=3)
    first, *_ = chunks.along_first(cube.data)
    entries = first.map_blocks(lambda entry: seen.append(entry) or entry, meta=first._meta)
    dask.compute(out, entries, scheduler="synchronous")
    assert len(seen) == 2 * cube.data.npartitions
    assert all(any(np.shares_memory(block, each) for each in made) for block in seen)


def test_dtype_is_known_before_anything_is_computed():
    out = chunks.pointwise(lambda a: (a * 9).astype(np.uint8), in_chunks(raster(), ODD_CHUNKS), dtype=np.uint8)
    assert out.dtype == np.uint8 == out.compute().dtype


def test_rasters_on_other_grids_are_refused():
    other = raster(fifesim.fife_site(30 / 9, window=((0, 36), (6, 51))), seed=1)
    with pytest.raises(ValueError, match="'raster0' and 'raster1' have different grids"):
        chunks.pointwise(np.add, raster(), other)


def test_rasters_whose_coordinates_differ_by_rounding_are_combined():
    """xarray's own sum of these is empty, and silent."""
    one, two = raster(), raster(seed=1)
    shifted = two.assign_coords(x=two["x"].values + 1e-7)
    np.testing.assert_array_equal(chunks.pointwise(np.add, one, shifted), one.values + two.values)


def test_rasters_seen_under_other_suns_are_refused():
    suns = [raster(seed=seed).assign_coords(sza=float(sza)) for seed, sza in enumerate((20, 20, 30))]
    chunks.pointwise(np.add, *suns[:2])
    with pytest.raises(ValueError, match="sza is 20 in 'raster0' and 30 in 'raster2'"):
        chunks.pointwise(np.add, suns[0], suns[2])
    with pytest.raises(ValueError, match="sza is 20 in 'raster1' and 30 in 'raster2'"):
        chunks.pointwise(lambda a, b, c: a, suns[0].drop_vars("sza"), *suns[1:])


class Seen(NamedTuple):
    """Cells that lie one further down the diagonal for each row of the result."""

    array: object

    def window(self, rows, columns):
        return slice(rows.start, rows.stop), slice(columns.start + rows.start, columns.stop + rows.stop - 1)


def diagonals(rows, columns, cells):
    width = columns.stop - columns.start
    return np.stack([line[k : k + width] for k, line in enumerate(cells)])


@pytest.mark.parametrize("size", [1, 4, 99])
def test_blocks_read_windows_of_any_shape(array_type, size):
    """Lazy where an array is, in the fixed blocks; what a block reads need not go by rows and columns."""
    cells = array_type(raster())
    with no_compute():
        found = chunks.in_blocks(diagonals, [Seen(cells.data)], (30, 12), size)
    if cells.chunks is not None:
        assert found.chunks[1] == tuple([size] * (12 // size) + [12 % size] * bool(12 % size))
    expected = [cells.values[k, k : k + 12] for k in range(30)]
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("lazy", [True, False])
def test_entries_along_the_first_axis_are_views(lazy):
    whole = np.arange(24.0).reshape(2, 3, 4)
    array = da.from_array(whole, chunks=(2, 2, 4)) if lazy else whole
    found = chunks.along_first(array)
    np.testing.assert_array_equal(np.stack(found), whole)
    if lazy:
        assert found[1].chunks == ((2, 1), (4,)) and found[1].dtype == whole.dtype
        blocks = dask.get(dict(found[1].dask), [(found[1].name, 0, 0)])
        assert blocks[0].base is not None
    else:
        assert np.shares_memory(found[1], whole)
