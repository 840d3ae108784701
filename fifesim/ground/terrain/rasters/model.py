"""An elevation model under a grid: the source cells that a tile reads, their means and gaps, and the spline."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fifesim.base.lattice import KeptTiles, assemble
from fifesim.ground.terrain.gaps import block_means, extend, fill_gaps
from fifesim.ground.terrain.rasters.source import Placement, open_source, placement
from fifesim.ground.terrain.spline import MARGIN, spline_coefficients, spline_grid, spline_points
from fifesim.rasters import grid as grids

# Elevations are made in fixed tiles of this size. [cell]
TILE = 504

# Filling goes outward ring by ring. [source cell]
_MOST_FILLED = 250


@dataclass(frozen=True, eq=False)
class Model:
    """Where a source lies under a grid, how many of its cells are averaged, and how far gaps are filled."""

    place: Placement
    blocks: tuple[int, int]  # source cells down and across that are averaged
    fill: tuple[float, float]  # distance from known elevation [source cell]
    resolution: float  # [m]

    @property
    def source(self):
        """What the elevations are read from."""
        return self.place.source

    def reading(self, cells, origin=(0, 0)):
        """
        The same model, whose source holds other cells.

        Parameters
        ----------
        cells : numpy.ndarray or None
            A window of the source.
        origin : (int, int), optional
            Row and column of its first cell.

        Returns
        -------
        model : Model
        """
        source = replace(self.source, cells=cells, origin=origin)
        return replace(self, place=replace(self.place, source=source))

    def elevation(self, make_tile, first_row, first_column, shape):
        """
        Elevation from a row and column of the grid on.

        Parameters
        ----------
        make_tile : callable
            Of `tiles`.
        first_row, first_column : int
        shape : (int, int)
            Rows and columns.

        Returns
        -------
        elevation : array, shape (rows, columns)
            NaN where unknown. [m]
        """
        row, column = grids.lattice_position(self.place.grid)
        return assemble(make_tile, TILE, row + first_row, column + first_column, shape)

    def tiles(self):
        """The function that makes a tile, which keeps the last ones."""
        return KeptTiles(partial(self._tile, *grids.lattice_position(self.place.grid)))

    def window(self, rows, columns):
        """
        Source cells that positions need, in whole blocks.

        Parameters
        ----------
        rows, columns : array
            As of `Placement.positions`. [source cell]

        Returns
        -------
        top, left, height, width : int
            First row and column, and size.
        """
        found = []
        parts = zip((rows, columns), self.blocks, self.fill, self.source.shape, strict=True)
        for positions, count, fill, size in parts:
            low, high = ((edge + 0.5) / count - 0.5 for edge in (positions.min(), positions.max()))
            # A hole, and the cells around it that shape what fills it, must be seen whole.
            around = MARGIN + int(np.ceil((2 * fill + 6) / count) if fill else 0)
            # Beyond its margin the model says nothing.
            first = max(int(np.floor(low)) - 2, -around) - around
            last = min(int(np.floor(high)) + 4, -(-size // count) + around) + around
            found.append((first * count, max(last - first, 0) * count))
        (top, height), (left, width) = found
        return top, left, height, width

    def read(self, top, left, height, width):
        """
        Source cells with their gaps filled.

        Parameters
        ----------
        top, left, height, width : int
            As of `window`.

        Returns
        -------
        values : array, shape (height, width)
            NaN where unknown. [m]
        """
        values = self.source.read(top, left, height, width)
        return fill_gaps(values, self.fill) if any(self.fill) else values

    def tile_window(self, rows, columns):
        """
        Source cells that all tiles of a part of the grid read.

        Parameters
        ----------
        rows, columns : slice
            Of the grid.

        Returns
        -------
        rows, columns : slice
            Of the source.
        """
        outline = []
        for first, part in zip(grids.lattice_position(self.place.grid), (rows, columns), strict=True):
            low, high = (first + part.start) // TILE * TILE, -(-(first + part.stop) // TILE) * TILE - 1
            outline.append(np.linspace(low - first, high - first, 17).round().astype(int))
        top, left, height, width = self.window(*self.place.positions(*outline))
        # A curved edge may bulge between the points of the outline.
        return tuple(
            slice(min(max(start - 2, 0), size), max(min(start + length + 2, size), 0))
            for start, length, size in zip((top, left), (height, width), self.source.shape, strict=True)
        )

    def _tile(self, row, column, tile_row, tile_column):
        down, across = self.blocks
        cells = np.arange(TILE)
        rows, columns = self.place.positions(tile_row * TILE - row + cells, tile_column * TILE - column + cells)
        top, left, height, width = self.window(rows, columns)
        values = self.read(top, left, height, width)
        known = np.isfinite(values)
        if not known.any():
            return np.full((TILE, TILE), np.nan)
        found = looked_up(known, rows - top, columns - left)
        # Places past the window are unknown; they are moved into it to be passed over.
        rows = rows.clip(top + 3 * down, top + height - 4 * down)
        columns = columns.clip(left + 3 * across, left + width - 4 * across)
        if down > 1 or across > 1:
            values = block_means(extend(values, 2 * max(self.blocks), rest=False), down, across)
        coefficients = spline_coefficients(extend(values, MARGIN))
        in_blocks = (rows - top + 0.5) / down - 0.5, (columns - left + 0.5) / across - 0.5
        if self.place.parallel:
            out = spline_grid(coefficients, *(axis.ravel() for axis in in_blocks))
        else:
            out = spline_points(coefficients, *in_blocks)
        return np.where(found, out, np.nan)


def model_under(grid, raster, fill, vertical_units, allow_remote=False):
    """
    Elevation model under a grid.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
    raster : str, path or xarray.DataArray
    fill : float or None
        Distance from known elevation up to which gaps are filled. [m]
    vertical_units : str or None
        Wins over what the raster says.
    allow_remote : bool, optional
        As of `fifesim.rasters.opening.raster_file`.

    Returns
    -------
    model : Model

    Raises
    ------
    ValueError
        If the distance is not one, or the raster or its place are not known.
    """
    grids.check_grid(grid)
    if fill is not None and (isinstance(fill, bool) or not fill > 0):
        raise ValueError(f"fill is a distance from known elevation, above 0 m, got {fill!r}: give for instance fill=60")
    place = placement(open_source(raster, vertical_units, allow_remote), grid)
    sizes = place.cell_size()
    most = round(_MOST_FILLED * min(sizes), 6)
    if (fill or 0) > most:
        raise ValueError(
            f"fill={fill:g} is more than {_MOST_FILLED} cells of {place.source.name}, of {min(sizes):.3g} m: give at "
            f"most fill={most:g}"
        )
    blocks = tuple(max(1, round(float(np.mean(grids.cell_size(grid))) / size)) for size in sizes)
    resolution = round(float(np.mean([count * size for count, size in zip(blocks, sizes, strict=True)])), 6)
    return Model(place, blocks, tuple((fill or 0) / size for size in sizes), resolution)


def looked_up(known, rows, columns):
    """
    Whether the cells are known in which places lie.

    Parameters
    ----------
    known : array of bool, shape (m, n)
    rows, columns : array
        Positions that broadcast against each other. [cell]

    Returns
    -------
    found : array of bool
        False beyond all cells.
    """
    if not known.size:
        return np.zeros(np.broadcast_shapes(rows.shape, columns.shape), bool)
    row, column = np.rint(rows).astype(int), np.rint(columns).astype(int)
    inside = (row >= 0) & (row < known.shape[0]) & (column >= 0) & (column < known.shape[1])
    return inside & known[row.clip(0, known.shape[0] - 1), column.clip(0, known.shape[1] - 1)]
