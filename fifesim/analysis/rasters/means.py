"""True means of labelled rasters over blocks of ground."""

from fifesim.analysis.rasters.pairs import sound_cells
from fifesim.rasters import grid as grids
from fifesim.rasters.dates import by_date
from fifesim.rasters.regularization import areas, regularized


@by_date
def aggregate(array, pixel=30.0, *, min_valid=0.98, lsf=None):
    """
    Means over square blocks of ground: the truth that a pixel is compared with.

    Parameters
    ----------
    array : xarray.DataArray, dims (..., y, x)
    pixel : float, optional
        Size of the blocks, any multiple of the cell or not. [m]
    min_valid : float, optional
        Share of its area that a block needs on valid cells; below it is NaN. [1]
    lsf : line spread function, optional
        As `fifesim.base.footprints` has it, to weight the cells about each block's middle; all within the block count
        the same by default.

    Returns
    -------
    means : xarray.DataArray, dims (..., y, x)
        On the grid of whole blocks from the upper left corner.

    Raises
    ------
    ValueError
        If the array has no grid, no block fits, or a cell holds a fill value.
    TypeError
        If the size is no number.

    See Also
    --------
    fifesim.base.footprints.regularize
    """
    array = sound_cells(array)
    blocks = grids.aligned(grids.geobox(array), pixel)
    spreads = areas(blocks) if lsf is None else (lsf, lsf)
    means = regularized(array, spreads, blocks, min_valid=min_valid)
    history = "\n".join(filter(None, [array.attrs.get("history", ""), f"aggregate: means over {pixel:g} m"]))
    means.attrs = dict(array.attrs) | {"history": history}
    return means
