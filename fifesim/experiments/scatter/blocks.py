"""What blocks of the truth hold, on the cells that lie in them."""

import numpy as np

from fifesim.rasters import grid as grids


def spread_out_means(means, cells):
    """
    Means of blocks over their cells.

    Parameters
    ----------
    means, cells : xarray.DataArray, dims (y, x)
        In memory.

    Returns
    -------
    spread : xarray.DataArray, dims (y, x)
        A cell of no block keeps its own, and one without data has none.
    """
    (rows, columns), inside = _places(cells, grids.geobox(means))
    spread = means.values[rows][:, columns]
    return cells.copy(data=np.where(inside & np.isfinite(spread) & np.isfinite(cells.values), spread, cells.values))


def middle_cells(cells, blocks):
    """
    The cell in the middle of each block over its cells.

    Parameters
    ----------
    cells : xarray.DataArray of int, dims (y, x)
        Codes, in memory.
    blocks : odc.geo.geobox.GeoBox

    Returns
    -------
    spread : xarray.DataArray of int, dims (y, x)
        A cell of no block keeps its own.
    """
    (rows, columns), inside = _places(cells, blocks)
    sizes = zip(grids.cell_size(blocks), grids.cell_size(grids.geobox(cells)), strict=True)
    down, across = (block / cell for block, cell in sizes)
    middle = cells.values[((rows + 0.5) * down).astype(int)][:, ((columns + 0.5) * across).astype(int)]
    return cells.copy(data=np.where(inside & (cells.values >= 0), middle, cells.values))


def _places(cells, blocks):
    """Row and column of the block of each cell, at most the last, and whether the cell lies in it."""
    sizes = zip(grids.cell_size(grids.geobox(cells)), grids.cell_size(blocks), cells.shape, strict=True)
    places = [np.floor((np.arange(count) + 0.5) * cell / block + 1e-9).astype(int) for cell, block, count in sizes]
    inside = [place < count for place, count in zip(places, blocks.shape, strict=True)]
    last = [np.minimum(place, count - 1) for place, count in zip(places, blocks.shape, strict=True)]
    return last, inside[0][:, None] & inside[1]
