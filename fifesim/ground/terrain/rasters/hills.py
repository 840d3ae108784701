"""The synthetic Flint Hills on a labelled raster."""

from __future__ import annotations

import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.annotations import Chunks, WholeNumber
from fifesim.base.seeds import check_seed
from fifesim.ground.terrain.flint_hills import elevation
from fifesim.rasters import cf, places
from fifesim.rasters import grid as grids
from fifesim.rasters.sites import made_on_site

# Chunks of "auto" are of some of these. [cell]
_TILE = 504

# Coarser cells lose the valleys. [m]
_LARGEST_CELL = 100.0

_REFERENCE = "terrain after the statistics of Kings Creek, Konza Prairie (USGS 3DEP)"


def flint_hills(grid: GeoBox, seed: WholeNumber = 0, *, chunks: Chunks | None = None) -> xr.DataArray:
    """
    Synthetic elevation model of the dissected Flint Hills.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of ground cells.
    seed : int, optional
        In [0, 2**63).
    chunks : mapping or int or "auto", optional
        Makes the result lazy.

    Returns
    -------
    dem : xarray.DataArray, dims (y, x)
        A function of the seed and of easting and northing: a window is a slice of the whole, chunks change nothing, and
        other cells show the same hills. [m]

    Raises
    ------
    ValueError
        If the grid or the seed is not one allowed, or cells are larger than 100 m, which lose the valleys.
    TypeError
        If the seed is no whole number.

    See Also
    --------
    fifesim.ground.terrain.flint_hills.elevation

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> dem.shape, dem.attrs["units"]
    ((90, 90), 'm')
    """
    grids.check_grid(grid)
    seed = check_seed(seed)
    if max(grids.cell_size(grid)) > _LARGEST_CELL:
        raise ValueError(
            f"cells must be at most {_LARGEST_CELL:g} m for the valleys to show, got "
            f"{max(grids.cell_size(grid)):g} m: make the terrain on smaller cells and .coarsen() it"
        )
    northing, easting = (grids.coordinates(grid)[axis].values for axis in ("y", "x"))

    def cells(row, column, shape):
        return elevation(seed, northing[row : row + shape[0]], easting[column : column + shape[1]])

    dem = places.tiles(cells, grid, chunks, tile=_TILE)
    made = {"rng_seed": str(seed), "source_resolution": 30.0, "references": _REFERENCE} | made_on_site(grid)
    return cf.label(dem, "dem", history=f"flint_hills: seed {seed}", **made)
