"""Grids as the rasters that lie on them tell them: by the centres of their cells."""

from functools import lru_cache

import numpy as np
from affine import Affine
from odc.geo.geobox import GeoBox

from fifesim.base.lattice import centres, whole_cells


def centres_of(grid):
    """
    Places of the centres of cells.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    northing, easting : array, shape (rows,), (columns,)
        [m]
    """
    a = grid.affine
    return centres(a.f, a.e, np.arange(grid.shape.y)), centres(a.c, a.a, np.arange(grid.shape.x))


def on_lattice(grid):
    """
    The grid with its origin on the lattice, and its CRS by authority where that says the same.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    grid : odc.geo.geobox.GeoBox
    """
    a = grid.affine
    (column, x_offset), (row, y_offset) = whole_cells(a.c, a.a), whole_cells(a.f, a.e)
    west, north = column * a.a + x_offset, row * a.e + y_offset
    crs = f"EPSG:{grid.crs.epsg}" if grid.crs and grid.crs.epsg else grid.crs
    return GeoBox(grid.shape, Affine(a.a, a.b, west, a.d, a.e, north), crs)


# The steps of a scene ask for the same.
@lru_cache(maxsize=64)
def as_carried(grid):
    """
    A grid as a raster that is put on it tells it, by its coordinates: origins differ in their last digits.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        That passes `fifesim.rasters.grid.check_grid`.

    Returns
    -------
    grid : odc.geo.geobox.GeoBox
        To the bit what `fifesim.rasters.grid.geobox` finds on an array after `fifesim.rasters.grid.place`.
    """
    a = grid.affine
    west, north = _edge(a.c, a.a, grid.shape.x), _edge(a.f, a.e, grid.shape.y)
    return on_lattice(GeoBox(grid.shape, Affine(a.a, a.b, west, a.d, a.e, north), grid.crs))


def _edge(origin, cell, size):
    """Outer edge of an axis, from the centres of its first cell and its last."""
    first, last = centres(origin, cell, np.array([0, size - 1])).tolist()
    step = (last - first) / (size - 1) if size > 1 else cell
    return first - step / 2
