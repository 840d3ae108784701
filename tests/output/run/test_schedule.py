"""Blocks in order: the numbers of dask's own scheduler, and little that waits."""

import dask.array as da
import numpy as np
import pytest
import xarray as xr
from dask.core import get_dependencies

from fifesim import fife_site
from fifesim.base.footprints import Boxcar, axis_operator
from fifesim.output.run.schedule import ordered_blocks, run_on_threads
from fifesim.rasters import grid as grids
from fifesim.rasters.chunks import neighbourhood, tiles
from fifesim.rasters.regularization import resample


def places(row, column, shape):
    return np.arange(row, row + shape[0])[:, None] * 1000.0 + np.arange(column, column + shape[1])


def means(side, chunk):
    """Smoothed places, averaged over pixels of 3.1 cells."""
    grid = fife_site(30 / 9, window=((0, side), (0, side)))
    array = neighbourhood(lambda block: block[1:-1, 1:-1] + block[:-2, 2:], tiles(places, grid, chunk, tile=8), 1)
    array = grids.place(array, grid)
    cell = 30 / 9
    axis = axis_operator(
        Boxcar(3.3 * cell), cell_origin=0, cell_size=cell, n_cells=side, pixel_origin=0, pixel_size=3.1 * cell,
        n_pixels=side // 4,
    )  # fmt: skip
    return resample(axis, axis, array, grids.aligned(grid, 4 * cell)).data


def wanted(array, name="means"):
    return [(name, index) for index in np.ndindex(array.numblocks)]


@pytest.mark.parametrize("threads", [1, 3])
def test_blocks_are_those_of_dask(threads):
    array, found = means(96, 17), {}
    run_on_threads(
        *ordered_blocks({"means": array}, wanted(array)),
        lambda name, index, block: found.update({index: block}),
        threads,
    )
    for index, block in found.items():
        np.testing.assert_array_equal(block, array.blocks[index].compute(scheduler="sync"))
    assert len(found) == array.npartitions


def test_only_what_is_wanted_is_computed():
    array = means(96, 17)
    all_of_it = ordered_blocks({"means": array}, wanted(array))[0]
    one = ordered_blocks({"means": array}, [("means", (2, 3))])[0]
    assert len(one) < len(all_of_it) / 6


def test_what_waits_does_not_grow_with_the_rows():
    """Chunks whole in memory at once, when tasks run one after the other in their order."""

    def most(rows):
        source = da.ones((rows * 10, 200), chunks=10).map_blocks(lambda block: block + 1, name=f"source{rows}")
        grid = fife_site(30 / 9, window=((0, rows * 10), (0, 200)))
        raster = grids.place(xr.DataArray(source, dims=("y", "x")), grid)
        axes = [
            axis_operator(
                Boxcar(3.5), cell_origin=0, cell_size=1, n_cells=size, pixel_origin=0, pixel_size=3, n_pixels=size // 3
            )
            for size in raster.shape
        ]
        array = resample(*axes, raster, grids.aligned(grid, 10.0)).data
        graph, _, order = ordered_blocks({"a": array}, wanted(array, "a"))
        last = {}
        for key in graph:
            for need in get_dependencies(graph, key):
                last[need] = max(last.get(need, 0), order[key])
        whole = [key for key in graph if isinstance(key, tuple) and len(key) == 3 and key in last]
        whole = [key for key in whole if "windows" not in str(key[0]) and "cut" not in str(key[0])]
        alive = np.zeros(len(graph) + 1, int)
        for key in whole:
            alive[order[key] : last[key] + 1] += 1
        return alive.max()

    assert most(40) == most(10) <= 3


def test_an_error_of_a_task_is_raised_as_it_is():
    def broken(block):
        raise OSError("no such cells")

    array = da.ones((4, 4), chunks=2).map_blocks(broken, dtype=float, meta=np.empty((0, 0)))
    with pytest.raises(OSError, match="no such cells"):
        run_on_threads(*ordered_blocks({"a": array}, wanted(array, "a")), lambda *block: None, 2)
