"""
The environment of every cell of a scene, on a coarse grid of blocks of cells.

The mean of the ground around a target varies slowly. It is computed for the centres of blocks of about 60 m, with the
point spread of `fifesim.atmosphere.adjacency`, and interpolated linearly to the cells. Outside of the scene lies what
its surroundings are said to be; cells that are NaN are left out.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import fft

from fifesim.atmosphere import adjacency
from fifesim.footprints import Boxcar, axis_operator, regularize

BLOCK = 60.0  # size of the blocks, as far as whole cells go [m]

_CONVERGED = 1e-12  # of the environment's reflectance
_ITERATIONS = 3000
_DUST = 1e-9  # a block's share of missing cells is at least one cell's, or rounding


class Blocks(NamedTuple):
    """Blocks of cells along one axis, counted from the origin of the CRS as cells are."""

    cells: int  # in a block
    offset: int  # of the scene's first cell in its block
    n_cells: int  # of the scene

    @property
    def count(self):
        """Number of blocks that the scene touches."""
        return -(-(self.offset + self.n_cells) // self.cells)

    @property
    def edges(self):
        """First cell of each block in the scene and behind its last, shape (count,) each."""
        start = np.arange(self.count) * self.cells - self.offset
        return np.maximum(start, 0), np.minimum(start + self.cells, self.n_cells)

    @property
    def inside(self):
        """Share of each block that lies in the scene, shape (count,). [1]"""
        start, stop = self.edges
        return (stop - start) / self.cells

    @property
    def interpolation(self):
        """Operator from blocks, with one more on either side, to cells."""
        # The overlap of a block's width around a cell with the blocks is the weight of linear interpolation.
        return axis_operator(
            Boxcar(float(self.cells)),
            cell_origin=-self.cells,
            cell_size=self.cells,
            n_cells=self.count + 2,
            pixel_origin=self.offset,
            pixel_size=1,
            n_pixels=self.n_cells,
        )

    @property
    def interpolation_weights(self):
        """Weights of the block before, the own one and that behind, by the cell's place in it, shape (cells, 3)."""
        place = (np.arange(self.cells) + 0.5) / self.cells - 0.5
        return np.stack([np.maximum(-place, 0), 1 - np.abs(place), np.maximum(place, 0)], axis=-1)


def blocks_along(position, cell_size, n_cells):
    """
    Blocks of a scene along one axis.

    Parameters
    ----------
    position : int
        Of the scene's first cell, counted from the origin of the CRS.
    cell_size : float
        [m]
    n_cells : int

    Returns
    -------
    blocks : Blocks

    Examples
    --------
    >>> blocks = blocks_along(19, 30 / 9, 40)
    >>> blocks.cells, blocks.offset, blocks.count
    (18, 1, 3)
    """
    cells = max(1, round(BLOCK / cell_size))
    return Blocks(cells, position % cells, n_cells)


def block_sums(rows, columns, values, *, along_y, along_x):
    """
    Sums over the valid cells of blocks, and their number, both as shares of a whole block's cells.

    Parameters
    ----------
    rows, columns : slice
        Of the blocks.
    values : array, shape (y, x)
        Their cells, NaN where they are missing.
    along_y, along_x : Blocks

    Returns
    -------
    sums : array, shape (2, 1, 1, rows, columns)
        Of the values, and of 1.
    """
    weights = (np.full((along.cells, 1), 1 / along.cells) for along in (along_y, along_x))
    return _moments(rows, columns, values, along_y, along_x, *weights)


def block_moments(rows, columns, values, *, along_y, along_x):
    """
    The sums of `block_sums`, with cells weighted as they interpolate between each pair of blocks.

    Parameters
    ----------
    rows, columns : slice
        Of the blocks.
    values : array, shape (y, x)
        Their cells, NaN where they are missing.
    along_y, along_x : Blocks

    Returns
    -------
    moments : array, shape (2, 3, 3, rows, columns)
        Of the values, and of 1; by the block before, the own one and that behind, along y and along x.
    """
    weights = (along.interpolation_weights / along.cells for along in (along_y, along_x))
    return _moments(rows, columns, values, along_y, along_x, *weights)


def _moments(rows, columns, values, along_y, along_x, y_weights, x_weights):
    sums = np.zeros((2, y_weights.shape[1], x_weights.shape[1], rows.stop - rows.start, columns.stop - columns.start))
    # Place of the first cell in its block: only the scene's first block may lack its own first cells.
    y_place, x_place = (
        along.offset if blocks.start == 0 else 0 for along, blocks in ((along_y, rows), (along_x, columns))
    )
    dtype = np.float32 if values.dtype == np.float32 else np.float64
    _add_moments(np.ascontiguousarray(values, dtype), y_place, x_place, y_weights, x_weights, sums)
    return sums


@njit(nogil=True, cache=True)
def _add_moments(values, y_place, x_place, y_weights, x_weights, sums):
    down, across = y_weights.shape[0], x_weights.shape[0]
    for i in range(values.shape[0]):
        row, y = divmod(y_place + i, down)
        line = np.zeros((2, x_weights.shape[1], sums.shape[4]))
        for j in range(values.shape[1]):
            value = np.float64(values[i, j])
            if not np.isnan(value):
                column, x = divmod(x_place + j, across)
                for k in range(x_weights.shape[1]):
                    line[0, k, column] += x_weights[x, k] * value
                    line[1, k, column] += x_weights[x, k]
        for k in range(y_weights.shape[1]):
            for part in range(2):
                sums[part, k, :, row] += y_weights[y, k] * line[part]


class Spread(NamedTuple):
    """What carries a field on blocks to its mean around those of the scene, and one more on either side."""

    spectrum: np.ndarray  # of the point spread, shape of a real transform
    margin: tuple[int, int]  # blocks of the field around the scene, above as below and left as right
    inside: np.ndarray  # share of each block that lies in the scene, shape (y, x) of the scene's blocks [1]

    def __call__(self, field):
        """Mean around each block of the scene and a ring, from a field on the scene's blocks and the margin."""
        size = 2 * (self.spectrum.shape[1] - 1)
        spectrum = fft.rfft2(field, (self.spectrum.shape[0], size))
        spectrum *= self.spectrum
        around = fft.irfft2(spectrum, (self.spectrum.shape[0], size), overwrite_x=True)
        window = (slice(m - 1, m + n + 1) for m, n in zip(self.margin, self.inside.shape, strict=True))
        return around[tuple(window)]

    def padded(self, field):
        """Field on the scene's blocks with zeros around."""
        return np.pad(field, [(size, size) for size in self.margin])


def spread_over(along_y, along_x, cell, margin, vza, weight_molecules, weight_aerosol):
    """
    Point spread over the blocks of a scene.

    Parameters
    ----------
    along_y, along_x : Blocks
    cell : (float, float)
        Size of the scene's cells, down and across. [m]
    margin : (int, int)
        Blocks around the scene on which the field is known, at least 1.
    vza : float
        [degree]
    weight_molecules, weight_aerosol : float
        As `adjacency.environment_weights` gives them. [1]

    Returns
    -------
    spread : Spread
    """
    block = tuple(along.cells * size for along, size in zip((along_y, along_x), cell, strict=True))
    # Half the transform: the farthest blocks that see each other must not do so around the back.
    half = [fft.next_fast_len(along.count + m + 1) for along, m in zip((along_y, along_x), margin, strict=True)]
    quadrant = adjacency.point_spread([size + 1 for size in half], block, vza, weight_molecules, weight_aerosol)
    # The cosine transform is the real transform of the quadrant and its mirror images.
    spectrum = fft.dctn(quadrant, type=1, overwrite_x=True)
    spectrum = np.concatenate([spectrum, spectrum[-2:0:-1]])
    return Spread(spectrum, margin, np.multiply.outer(along_y.inside, along_x.inside))


def environment(sums, surroundings, spread):
    r"""
    Mean reflectance around each block.

    .. math::

        \langle \rho \rangle = \rho_{out} + \frac{K * \left[ m (\rho - \rho_{out}) \right]}{1 - K * (i - m)}

    with K the point spread, i what lies inside of the scene and m what of it is valid.

    Parameters
    ----------
    sums : array, shape (2, 1, 1, y, x)
        Of the scene's reflectance, from `block_sums`.
    surroundings : None, float or array, shape (y, x) with the margins
        :math:`\rho_{out}`: the scene's mean, a number, or that of the blocks with their mean beyond them. [1]
    spread : Spread

    Returns
    -------
    environment : array, shape (y + 2, x + 2)
        NaN if there is no valid cell to tell :math:`\rho_{out}`. [1]

    References
    ----------
    [Tanre1981]_; [Knutsson1993]_, normalized convolution
    """
    valid = sums[1, 0, 0]
    return _around(sums[0, 0, 0], valid, surroundings, spread, _known_share(valid, spread))


def _known_share(valid, spread):
    """Share of the environment that is not missing, 1 where none is."""
    hole = spread.inside - valid
    hole[hole < _DUST] = 0.0
    return 1 - spread(spread.padded(hole)) if hole.any() else 1.0


def _around(total, valid, surroundings, spread, known):
    number = valid.sum()
    if surroundings is None:
        far = total.sum() / number if number else np.nan
    elif np.ndim(surroundings):
        found = ~np.isnan(surroundings)
        far = surroundings[found].mean() if found.any() else np.nan
    else:
        far = surroundings
    field = spread.padded(total - valid * far)
    if np.ndim(surroundings):
        field += (1 - spread.padded(spread.inside)) * np.where(found, surroundings - far, 0.0)
    return far + spread(field) / known


def environment_of_target(moments, surroundings, spread, factors):
    r"""
    Mean reflectance around each block, from apparent reflectance.

    The reflectance of the cells follows from the environment's at the cells, and this from that. Both are linear, and
    the block sums of the one follow from the other at the blocks without loss. This is solved by damped iteration.

    Parameters
    ----------
    moments : array, shape (2, 3, 3, y, x)
        Of the apparent reflectance, from `block_moments`.
    surroundings : None, float or array
        As in `environment`. [1]
    spread : Spread
    factors : sequence of float
        Those of `adjacency.target_reflectance` from path_reflectance on. [1]

    Returns
    -------
    environment : array, shape (y + 2, x + 2)
        That of which `adjacency.target_reflectance` makes a scene with this environment, within 1e-12. [1]

    Raises
    ------
    RuntimeError
        If the iteration does not converge, for want of direct light.
    """
    path, down, direct, diffuse, albedo, gas = factors
    valid = moments[1].sum(axis=(0, 1))
    ground = moments[0] / gas - path * moments[1]
    bare = ground.sum(axis=(0, 1)) / (down * direct)
    slope = (albedo / down * ground + diffuse * moments[1]) / direct
    # The operator's eigenvalues lie between 1 and this above it.
    largest = np.divide(slope.sum(axis=(0, 1)), valid, out=np.zeros_like(valid), where=valid > 0).max(initial=0.0)
    known = _known_share(valid, spread)
    around = np.zeros([size + 2 for size in valid.shape])
    for _ in range(_ITERATIONS):
        change = _around(bare - _weighted(slope, around), valid, surroundings, spread, known) - around
        around += change / (1 + largest / 2)
        if not np.max(np.abs(change)) > _CONVERGED:
            return around
    raise RuntimeError(
        f"the environment did not converge in {_ITERATIONS} steps: of the light of a target {direct:g} comes to the "
        "sensor unscattered, which is too little to tell it; use a clearer atmosphere"
    )


def _weighted(slope, around):
    """Sums over cells of what is interpolated from blocks, times the moments in these."""
    rows, columns = slope.shape[2:]
    return sum(
        slope[k, m] * around[k : k + rows, m : m + columns]
        for k in range(slope.shape[0])
        for m in range(slope.shape[1])
    )


def on_cells(rows, columns, around, *, along_y, along_x):
    """
    Interpolate linearly from blocks to cells.

    Parameters
    ----------
    rows, columns : slice
        Of the cells.
    around : array, shape (..., y, x)
        At the centres of the blocks that these need.
    along_y, along_x : AxisOperator
        `Blocks.interpolation`.

    Returns
    -------
    cells : array, shape (..., rows, columns)
    """
    return regularize(around, along_y[rows], along_x[columns], min_valid=0.0)
