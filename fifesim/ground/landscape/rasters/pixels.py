"""How the pixels of a map lie on the lattice of cells, and which of them a tile of cells reads."""

from math import lcm
from typing import NamedTuple

import dask.array as da
import numpy as np

from fifesim.rasters import grid as grids
from fifesim.rasters import projection

# Cells along a fixed tile, and pixels at least.
_TILE, _FEWEST_PIXELS = 504, 8

MARGIN = 12
"""Pixels read around a tile: the weight of one beyond them is below 3e-5."""

# By so many cells the corners of pixels may lie beside those of cells.
_OFF = 1e-2

_CURE = "make the grid from the map: lai.odc.geobox.zoom_out(1 / 3) has 3 x 3 cells a pixel"


class PixelLattice(NamedTuple):
    """Pixels of a map among the cells of a grid; places count from the origin of the CRS, southward and eastward."""

    ratio: tuple[int, int]  # cells in a pixel
    pixel: tuple[int, int]  # place of the map's first pixel
    cell: tuple[int, int]  # place of the grid's first cell, counted from the corner of the pixel at 0
    shift: tuple[int, int]  # place of that corner among the cells

    @property
    def tile(self):
        """Edge of a tile. [cell]"""
        step = lcm(*self.ratio)
        return max(_TILE // step, -(-_FEWEST_PIXELS * max(self.ratio) // step)) * step

    @property
    def pixels(self):
        """Pixels in a tile, down and across."""
        return tuple(self.tile // number for number in self.ratio)

    def tiles(self, cells, axis):
        """
        Tiles that some cells of the grid touch.

        Parameters
        ----------
        cells : slice
            Rows or columns of the grid.
        axis : int
            0 for rows.

        Returns
        -------
        tiles : range
        """
        start, stop = (self.cell[axis] + end for end in (cells.start, cells.stop))
        return range(start // self.tile, -(-stop // self.tile))

    def window(self, tiles, axis):
        """
        Pixels of the map that some tiles read.

        Parameters
        ----------
        tiles : range
        axis : int

        Returns
        -------
        pixels : slice
            May begin and end beyond the map.
        """
        size, first = self.pixels[axis], self.pixel[axis]
        return slice(tiles.start * size - MARGIN - first, tiles.stop * size + MARGIN - first)


class PixelReads(NamedTuple):
    """What each chunk of cells reads of a map: the pixels of its tiles, and around."""

    array: np.ndarray | da.Array  # shape (y, x)
    lattice: PixelLattice

    def window(self, rows, columns):
        """
        Pixels that some cells of the grid read.

        Parameters
        ----------
        rows, columns : slice

        Returns
        -------
        rows, columns : slice
        """
        lattice = self.lattice
        return tuple(lattice.window(lattice.tiles(each, axis), axis) for axis, each in enumerate((rows, columns)))


def pixel_lattice(pixels, grid):
    """
    How the pixels of a map lie among the cells of a grid.

    Parameters
    ----------
    pixels : xarray.DataArray, dims (y, x)
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    lattice : PixelLattice

    Raises
    ------
    ValueError
        If the CRS is another, a pixel is no whole number of cells, its corners are none of cells, or the two do not
        overlap.
    """
    source = grids.geobox(pixels)
    if source.crs != grid.crs:
        raise ValueError(
            f"the map is in {projection.name_of(source.crs.proj)} and the grid in {projection.name_of(grid.crs.proj)}: "
            f"{_CURE}; or bring the map to pixels in the grid's CRS first, with .rio.reproject"
        )
    ratio = _cells_in_a_pixel(source, grid)
    first = _corner(source, grid)
    ends = tuple(start + size * number for start, size, number in zip(first, source.shape, ratio, strict=True))
    if not all(start < cells and end > 0 for start, end, cells in zip(first, ends, grid.shape, strict=True)):
        raise ValueError(
            f"the map does not overlap the grid, which spans {grids.extent(grid)}: it spans {grids.extent(source)}; "
            f"{_CURE}"
        )
    pixel = grids.lattice_position(source)
    cell = tuple(place * number - start for place, number, start in zip(pixel, ratio, first, strict=True))
    shift = tuple(place - start for place, start in zip(grids.lattice_position(grid), cell, strict=True))
    return PixelLattice(ratio, pixel, cell, shift)


def _cells_in_a_pixel(source, grid):
    a, b = source.affine, grid.affine
    ratio = a.e / b.e, a.a / b.a
    whole = tuple(max(round(each), 1) for each in ratio)
    drift = [abs(each - near) * size for each, near, size in zip(ratio, whole, source.shape, strict=True)]
    if max(drift) > _OFF or whole == (1, 1):
        raise ValueError(
            f"the map has pixels of {-a.e:g} x {a.a:g} m and the grid cells of {-b.e:g} x {b.a:g} m: a pixel must be "
            f"a whole number of cells, 2 or more; {_CURE}"
        )
    return whole


def _corner(source, grid):
    """Row and column of the grid at which the map begins."""
    a, b = source.affine, grid.affine
    corner = (a.f - b.f) / b.e, (a.c - b.c) / b.a
    off = [abs(each - round(each)) for each in corner]
    if max(off) > _OFF:
        raise ValueError(
            f"the corners of the map's pixels lie {off[0]:.2f} rows and {off[1]:.2f} columns of cells beside those of "
            f"the grid's cells: {_CURE}"
        )
    return tuple(map(round, corner))
