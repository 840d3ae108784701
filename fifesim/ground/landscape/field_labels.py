"""Ground properties that vary as random fields, on labelled rasters."""

from __future__ import annotations

from functools import partial

from fifesim.grids import cf, windows
from fifesim.grids import grid as grids
from fifesim.grids.sites import made_on_site
from fifesim.ground.landscape.autoregression import FIELD_TILE, field_seed, streaming_field
from fifesim.ground.landscape.classes import SHARES
from fifesim.ground.landscape.distribution import quantile_map, quantile_table


def drawn_field(name, given, grid, seed=0, chunks=None):
    """Property that varies as a random field of its own noise, dims (y, x)."""
    kernel = partial(
        _cells, field_seed(seed, name), given.arp, grids.lattice_position(grid), property_values(name, given)
    )
    # Chunks and the field are checked before anything lazy is built.
    kernel(0, 0, (0, 0))
    field = windows.tiles(kernel, grid, chunks, tile=FIELD_TILE)
    return labelled_property(name, given, field).assign_attrs(
        arp=float(given.arp), rng_seed=str(seed), **made_on_site(grid)
    )


def _cells(seed, arp, lattice, values, row, column, shape):
    return values(streaming_field(seed, arp, lattice[0] + row, lattice[1] + column, shape))


def property_values(name, given):
    """Function that maps standard normal scores to a property in place."""
    if name in SHARES:
        return partial(_share, quantile_table(given.distribution(name)))
    return partial(_normal, given.mean, given.sd)


def _share(table, scores):
    return quantile_map(scores, table, out=scores)


def _normal(mean, deviation, scores):
    scores *= deviation
    if mean:
        scores += mean
    return scores


def labelled_property(name, given, values):
    """Raster of a property that varies as a random field."""
    spread = "by quantiles" if name in SHARES else f"standard deviation {given.sd:g}"
    return cf.label(values, name, source=values, history=f"{name}: {spread}")
