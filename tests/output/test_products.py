"""Products of a run and the order of their computation."""

import numpy as np
import pytest

from fifesim.output import products
from fifesim.scenario.scenario import parse_scenario
from fifesim.scenario.simulation import simulate


@pytest.fixture(scope="module")
def simulated_tree():
    scenario = parse_scenario({"grid": {"width": 900, "height": 600}, "terrain": {"dem": "flat"}})
    return simulate(scenario.complete(), chunks={"y": 90, "x": 135})


def test_each_block_is_listed_once(simulated_tree):
    found, lai = products.products_of(simulated_tree, scene=True), simulated_tree["scene"]["lai"]
    wanted = products.wanted_blocks(found, lai)
    assert len(wanted) == len(set(wanted)) == sum(raster.data.npartitions for raster in found.values())
    cells = {f"scene-{name}" for name in simulated_tree["scene"].data_vars}
    assert (
        {name for name, _ in wanted}
        == set(found)
        == {"image", "lai", "fpar", "green_fpar", "soil", "brown", "moisture", "detail"} | cells
    )


def test_blocks_of_a_raster_have_one_size_and_all_bands(simulated_tree):
    """Chunks of Zarr are of one size; only the last may be smaller."""
    for raster in products.products_of(simulated_tree, scene=True).values():
        *bands, rows, columns = raster.chunks
        assert all(len(each) == 1 for each in bands)
        assert all(set(sizes[:-1]) <= {sizes[0]} and sizes[-1] <= sizes[0] for sizes in (rows, columns))


def test_blocks_are_ordered_by_the_scene_chunk_below_them(simulated_tree):
    """The scene chunk below a block is located by comparing the centres of blocks and cells."""
    found, lai = products.products_of(simulated_tree), simulated_tree["scene"]["lai"]
    places = []
    for name, index in products.wanted_blocks(found, lai):
        raster, place = found[name], []
        for axis, cells, north_up in (("y", lai.chunks[0], -1), ("x", lai.chunks[1], 1)):
            sizes = raster.chunksizes[axis]
            start = sum(sizes[: index[raster.dims.index(axis)]])
            block = raster[axis].values[start : start + sizes[index[raster.dims.index(axis)]]]
            before = np.sum(north_up * lai[axis].values < north_up * block.mean())
            place.append(int(np.searchsorted(np.cumsum(cells), before, side="right")))
        places.append(tuple(place))
    assert places == sorted(places)
    assert len(set(places)) == lai.data.npartitions == 4


def test_detail_shows_the_cells_in_the_middle_of_the_scene(simulated_tree):
    detail, scene = products.products_of(simulated_tree)["detail"], simulated_tree["scene"]["lai"]
    assert detail.shape == (144, 144)
    assert abs(float(detail["x"].mean() - scene["x"].mean())) <= 15
