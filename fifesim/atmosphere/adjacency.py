"""
Adjacency effect: the environment function, and exact sums of the surroundings of each cell by blocks.

The mean reflectance around a target varies slowly. It is computed at the centres of the blocks, with the point spread
of `adjacency.environment`. The ground outside of the scene is given by `surroundings`; cells that are NaN are left out.

Blocks are counted from the origin of the CRS, as cells are.
"""

from typing import NamedTuple

import numpy as np
from scipy import fft

from fifesim.base.arrays import compiled
from fifesim.base.footprints import Boxcar, axis_operator, regularize

# Nodes of the Gauss-Legendre rule along the edges of cells, and how many rows and columns of cells around the centre
# have the finer one. The flux through an edge varies over a length of its distance from the centre.
_FINE_NODES, _COARSE_NODES = 24, 3
_FINE_CELLS = 8


class Scatterers(NamedTuple):
    """Quantity of the molecules and of the aerosol, which scatter light into the view."""

    molecules: object
    aerosol: object


def environment_function(radius, vza=0.0):
    r"""
    Share of the environment's light that leaves the ground within a distance of the target.

    .. math::

        F_R &= 1 - 0.930 \, e^{-0.080 r} - 0.070 \, e^{-1.10 r} \\
        F_A &= 1 - 0.448 \, e^{-0.27 r} - 0.552 \, e^{-2.83 r} \\
        F_R' &= F_R \left[ 1 + L (1 - F_R) \right] \\
        F_A' &= F_A \left[ 1 + a + b F_A - (a + b) F_A^2 \right]

    with r in km, :math:`L = \ln \mu_v`, :math:`a = 1.3347 L + 0.57757 L^2` and :math:`b = -1.479 L - 1.5275 L^2`.

    Parameters
    ----------
    radius : array
        Horizontal distance, r. [m]
    vza : float or array, broadcastable, optional
        [degree]

    Returns
    -------
    molecules, aerosol : array, shape of the broadcast inputs
        :math:`F_R'` and :math:`F_A'`, from 0 at the target to 1. [1]

    Notes
    -----
    Fits to Monte Carlo runs for molecules with a scale height of 8 km and aerosol with 2 km, seen from space. The
    correction for the view keeps the symmetry around the target. Above 68 degrees the molecular function falls below
    zero near the target, where it is taken as zero.

    References
    ----------
    [Tanre1981]_ for nadir; [Vermote1997]_ for the view angle
    """
    r = np.asarray(radius, float) / 1000  # the fits are in km
    molecules = -0.930 * np.expm1(-0.080 * r) - 0.070 * np.expm1(-1.10 * r)
    aerosol = -0.448 * np.expm1(-0.27 * r) - 0.552 * np.expm1(-2.83 * r)
    log_mu_v = np.log(np.cos(np.radians(np.asarray(vza, float))))
    a = (1.3347 + 0.57757 * log_mu_v) * log_mu_v
    b = (-1.479 - 1.5275 * log_mu_v) * log_mu_v
    molecules = molecules * (1 + log_mu_v * (1 - molecules))
    aerosol = aerosol * (1 + a + aerosol * (b - (a + b) * aerosol))
    return Scatterers(np.maximum(molecules, 0.0), aerosol)


def environment_weights(diffuse_up_molecules, diffuse_up_aerosol):
    r"""
    Shares of molecules and aerosol in the light that is scattered into the view.

    Parameters
    ----------
    diffuse_up_molecules, diffuse_up_aerosol : array, broadcastable
        Diffuse transmittance from the ground to the sensor of either alone. [1]

    Returns
    -------
    molecules, aerosol : array, shape of the broadcast inputs
        They sum to 1, or are both 0 where nothing scatters. [1]

    References
    ----------
    [Vermote1997]_
    """
    total = np.add(diffuse_up_molecules, diffuse_up_aerosol, dtype=float)
    total = np.where(total > 0, total, 1.0)
    return Scatterers(diffuse_up_molecules / total, diffuse_up_aerosol / total)


def mixed_environment_function(radius, vza, diffuse_up_molecules, diffuse_up_aerosol):
    r"""
    Environment function of the mixture of molecules and aerosol.

    .. math:: F = \frac{t_R F_R' + t_A F_A'}{t_R + t_A}

    Parameters
    ----------
    radius : array
        Horizontal distance from the target. [m]
    vza : float or array, broadcastable
        [degree]
    diffuse_up_molecules, diffuse_up_aerosol : array, broadcastable
        Diffuse transmittance from the ground to the sensor of either alone, :math:`t_R` and :math:`t_A`. [1]

    Returns
    -------
    share : array, shape of the broadcast inputs
        1 where nothing scatters. [1]

    References
    ----------
    [Vermote1997]_
    """
    weights = environment_weights(diffuse_up_molecules, diffuse_up_aerosol)
    # The rest of the light comes from the target itself.
    return _weighted(weights, environment_function(radius, vza)) + (1 - weights.molecules - weights.aerosol)


def _weighted(weights, functions):
    return weights.molecules * functions.molecules + weights.aerosol * functions.aerosol


def point_spread(shape, cell, vza, weight_molecules, weight_aerosol):
    r"""
    Weights of the cells of a grid in the environment of the centre of one.

    The density around the target is :math:`F'(r) / 2 \pi r`. It is the divergence of the field
    :math:`F(r) / 2 \pi r` that points outward, so that the weight of a cell is the flux of this field out of it,

    .. math:: w = \oint \frac{F(r)}{2 \pi r^2} \, d \; ds

    with d the distance of an edge's line from the target: integrals of smooth functions, also around the target itself,
    where the density has no bound.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns from the cell of the target on, in one quadrant; the other quadrants are symmetric.
    cell : (float, float)
        Size of the cells, down and across. [m]
    vza : float
        [degree]
    weight_molecules, weight_aerosol : float
        Shares of the two, as `environment_weights` gives them. [1]

    Returns
    -------
    weights : array, shape (rows, columns)
        Over the whole plane they sum to 1. [1]

    References
    ----------
    [Tanre1981]_
    """
    weights = Scatterers(weight_molecules, weight_aerosol)
    scattered = _flux_differences(shape, cell, vza, weights, _COARSE_NODES)
    rows, columns = (min(size, _FINE_CELLS) for size in shape)
    scattered[:rows, :columns] = _flux_differences((rows, columns), cell, vza, weights, _FINE_NODES)
    scattered[0, 0] += 1 - weight_molecules - weight_aerosol
    return scattered


def _flux_differences(shape, cell, vza, weights, nodes):
    """Flux into each cell of a grid, from the flux through its lower and right edges."""
    (rows, columns), (down, across) = shape, cell
    y, x = down * np.arange(rows)[:, None], across * np.arange(columns)
    lower = _edge_flux(y + down / 2, x, across, vza, weights, nodes)
    right = _edge_flux(x + across / 2, y, down, vza, weights, nodes)
    vertical = np.diff(lower, axis=0, prepend=-lower[:1])
    return vertical + np.diff(right, axis=1, prepend=-right[:, :1])


def _edge_flux(distance, middle, length, vza, weights, nodes):
    """Flux through edges at a distance from the target, by the position of their middle along the edge line. [1]"""
    distance, middle = np.broadcast_arrays(distance, middle)
    node, weight = (values[:, None] for values in np.polynomial.legendre.leggauss(nodes))
    flux = np.empty(distance.shape)
    # By rows, which fit in the processor cache: a scene of 185 km has ten million blocks.
    for row in range(len(flux)):
        r_squared = distance[row] ** 2 + (middle[row] + node * length / 2) ** 2
        scattered = _weighted(weights, environment_function(np.sqrt(r_squared), vza))
        flux[row] = (weight * scattered / r_squared).sum(axis=0) * distance[row]
    return flux * length / (4 * np.pi)


_CONVERGED = 1e-12  # of the environment's reflectance
_ITERATIONS = 3000
_DUST = 1e-9  # a block's share of missing cells is at least one cell's, or rounding


class BlockSpread(NamedTuple):
    """Convolution that spreads a field on blocks around the blocks of the scene and one more on either side."""

    spectrum: np.ndarray  # of the point spread, shape of a real transform
    margin: tuple[int, int]  # blocks of the field around the scene, above as below and left as right
    inside: np.ndarray  # share of each block that lies in the scene, shape (y, x) of the scene's blocks [1]

    def __call__(self, field):
        """Mean around each block of the scene and a ring, from a field on the blocks and the margin."""
        size = 2 * (self.spectrum.shape[1] - 1)
        spectrum = fft.rfft2(field, (self.spectrum.shape[0], size))
        spectrum *= self.spectrum
        around = fft.irfft2(spectrum, (self.spectrum.shape[0], size), overwrite_x=True)
        window = (slice(m - 1, m + n + 1) for m, n in zip(self.margin, self.inside.shape, strict=True))
        return around[tuple(window)]


def spread_over(along_y, along_x, cell, margin, vza, weight_molecules, weight_aerosol):
    """Point spread over the blocks of a scene and its margin, as a Spread."""
    block = tuple(along.cells * size for along, size in zip((along_y, along_x), cell, strict=True))
    # Padding: the farthest blocks must not interact through the periodic boundary.
    half = [fft.next_fast_len(along.count + m + 1) for along, m in zip((along_y, along_x), margin, strict=True)]
    quadrant = point_spread([size + 1 for size in half], block, vza, weight_molecules, weight_aerosol)
    # The cosine transform is the real transform of the quadrant and its mirror images.
    spectrum = fft.dctn(quadrant, type=1, overwrite_x=True)
    spectrum = np.concatenate([spectrum, spectrum[-2:0:-1]])
    return BlockSpread(spectrum, margin, np.multiply.outer(along_y.inside, along_x.inside))


def block_environment(sums, surroundings, spread):
    r"""
    Mean reflectance around each block.

    .. math::

        \langle \rho \rangle = \rho_\mathrm{out}
            + \frac{K * \left[ m (\rho - \rho_\mathrm{out}) \right]}{1 - K * (i - m)}

    with K the point spread, i what lies inside of the scene and m what of it is valid.

    Parameters
    ----------
    sums : array, shape (2, 1, 1, y, x)
        Sums of the reflectance of the scene, from `block_sums`.
    surroundings : None, float or array, shape (y, x) with the margins
        :math:`\rho_\mathrm{out}`: the mean of the scene, a number, or block values with their mean beyond them. [1]
    spread : Spread

    Returns
    -------
    environment : array, shape (y + 2, x + 2)
        NaN if there is no valid cell to tell :math:`\rho_\mathrm{out}`. [1]

    References
    ----------
    [Tanre1981]_; [Knutsson1993]_, normalized convolution
    """
    valid = sums[1, 0, 0]
    return _around(sums[0, 0, 0], valid, surroundings, spread, _known_share(valid, spread))


def _known_share(valid, spread):
    """Valid share of the environment, 1 where nothing is missing."""
    hole = spread.inside - valid
    hole[hole < _DUST] = 0.0
    return 1 - spread(_padded(spread, hole)) if hole.any() else 1.0


def _padded(spread, field):
    """Field on the blocks of the scene, padded with zeros on the margin."""
    return np.pad(field, [(size, size) for size in spread.margin])


def _around(total, valid, surroundings, spread, known):
    number = valid.sum()
    if surroundings is None:
        far = total.sum() / number if number else np.nan
    elif np.ndim(surroundings):
        found = ~np.isnan(surroundings)
        far = surroundings[found].mean() if found.any() else np.nan
    else:
        far = surroundings
    field = _padded(spread, total - valid * far)
    if np.ndim(surroundings):
        field += (1 - _padded(spread, spread.inside)) * np.where(found, surroundings - far, 0.0)
    return far + spread(field) / known


def environment_of_target(moments, surroundings, spread, terms):
    """Mean surface reflectance around each block from apparent reflectance, shape (y + 2, x + 2), within 1e-12."""
    # Cell reflectance depends on the environment at the cells, and the environment on cell reflectance. Both are
    # linear, and the sums over blocks follow without loss; the system is solved by damped iteration.
    path, down, direct, diffuse, albedo, gas = terms
    total, valid = moments.sum(axis=(1, 2))
    bare = (total / gas - path * valid) / (down * direct)
    slope = moments[0] * (albedo / (down * direct * gas))
    slope += moments[1] * ((diffuse - albedo * path / down) / direct)
    # The operator's eigenvalues lie between 1 and this above it.
    largest = np.divide(slope.sum(axis=(0, 1)), valid, out=np.zeros_like(valid), where=valid > 0).max(initial=0.0)
    known = _known_share(valid, spread)
    around = np.zeros([size + 2 for size in valid.shape])
    for _ in range(_ITERATIONS):
        change = _around(bare - _weighted_blocks(slope, around), valid, surroundings, spread, known) - around
        around += change / (1 + largest / 2)
        if not np.max(np.abs(change)) > _CONVERGED:
            return around
    raise RuntimeError(
        f"the environment did not converge in {_ITERATIONS} steps: of the light of a target {direct:g} comes to the "
        "sensor unscattered, which is too little to tell it; use a clearer atmosphere"
    )


def _weighted_blocks(slope, around):
    """Sums over cells of moments times the values interpolated from the blocks."""
    rows, columns = slope.shape[2:]
    return sum(slope[k, m] * around[k : k + rows, m : m + columns] for k, m in np.ndindex(slope.shape[:2]))


BLOCK = 60.0  # size of the blocks, as far as whole cells go [m]

# Sums are taken in whole numbers of this part of one, which do not depend on their order as long as none overflows: a
# block's is at most the largest value that counts.
_UNIT, _LARGEST = 2.0**52, 1000.0


class Blocks(NamedTuple):
    """Blocks of cells along one axis, counted from the origin of the CRS, as cells are."""

    cells: int  # in a block
    offset: int  # of the scene's first cell in its block
    n_cells: int  # of the scene

    @property
    def count(self):
        """Number of blocks that the scene touches."""
        return -(-(self.offset + self.n_cells) // self.cells)

    @property
    def edges(self):
        """First cell of each block in the scene, and the cell after its last, shape (count,) each."""
        start = np.arange(self.count) * self.cells - self.offset
        return np.maximum(start, 0), np.minimum(start + self.cells, self.n_cells)

    def pieces(self, chunks):
        """Cut the blocks at the chunk ends; return the pieces and their number in each chunk."""
        ends = np.cumsum(chunks)
        start = np.union1d(self.edges[0], ends[:-1])
        sizes = np.diff(np.searchsorted(start, [0, *ends]))
        return Pieces(start, np.append(start[1:], self.n_cells), self), tuple(sizes.tolist())

    @property
    def inside(self):
        """Share of each block inside the scene, shape (count,). [1]"""
        start, stop = self.edges
        return (stop - start) / self.cells

    @property
    def interpolation(self):
        """Interpolation operator to cells from blocks, with one more block on either side."""
        # The overlap of a block's width around a cell with the blocks is the weight of linear interpolation.
        blocks = {"cell_origin": -self.cells, "cell_size": self.cells, "n_cells": self.count + 2}
        cells = {"pixel_origin": self.offset, "pixel_size": 1, "n_pixels": self.n_cells}
        return axis_operator(Boxcar(float(self.cells)), **blocks, **cells)

    @property
    def interpolation_weights(self):
        """Linear weights of the previous, current and next block by the place of a cell, shape (cells, 3)."""
        place = (np.arange(self.cells) + 0.5) / self.cells - 0.5
        return np.stack([np.maximum(-place, 0), 1 - np.abs(place), np.maximum(place, 0)], axis=-1)


class Pieces(NamedTuple):
    """Parts of blocks along one axis, shape (n,)."""

    start: np.ndarray  # first cell
    stop: np.ndarray  # behind the last cell
    blocks: Blocks

    @property
    def first(self):
        """First piece of each block, shape (count,)."""
        return np.searchsorted(self.start, self.blocks.edges[0])


def blocks_along(position, cell_size, n_cells):
    """Blocks of a scene along one axis, aligned with the origin of the CRS."""
    cells = max(1, round(BLOCK / cell_size))
    return Blocks(cells, position % cells, n_cells)


def block_sums(rows, columns, values, *, along_y, along_x, linear=False):
    """Integer sums over valid cells of pieces of blocks, and counts, as shares of the cells of a whole block."""
    # With `linear`, cells are weighted by the linear interpolation from the block before, itself and the block behind.
    down, across = _cells_of(along_y, rows, linear), _cells_of(along_x, columns, linear)
    size = down.weights.shape[1], across.weights.shape[1], rows.stop - rows.start, columns.stop - columns.start
    sums = np.zeros((*values.shape[:-2], 2, *size), np.int64)
    dtype = np.float32 if values.dtype == np.float32 else np.float64
    for layer in np.ndindex(values.shape[:-2]):
        _add_moments(np.ascontiguousarray(values[layer], dtype), down, across, sums[layer])
    return sums


def whole_blocks(sums, along_y, along_x):
    """Join the pieces of blocks into whole blocks, identical to the bit for any cuts."""
    first_row, first_column = along_y.first, along_x.first
    whole = np.empty((*sums.shape[:-2], first_row.size, first_column.size))
    for layer in np.ndindex(sums.shape[:-2]):
        lines = np.add.reduceat(sums[layer], first_row, axis=0)
        whole[layer] = np.add.reduceat(lines, first_column, axis=1) / _UNIT
    return whole


class _Cells(NamedTuple):
    """Cell range along one axis of pieces of blocks."""

    piece: np.ndarray  # of each cell
    place: np.ndarray  # of each cell in its block
    weights: np.ndarray  # by place, shape (cells, 1 or 3) [1]


def _cells_of(along, pieces, linear):
    cells = np.arange(along.start[pieces.start], along.stop[pieces.stop - 1])
    piece = np.searchsorted(along.start[pieces], cells, side="right") - 1
    size = along.blocks.cells
    weights = along.blocks.interpolation_weights / size if linear else np.full((size, 1), 1 / size)
    return _Cells(piece, (cells + along.blocks.offset) % size, weights)


@compiled
def _add_moments(values, down, across, sums):
    """Add sums and counts of each piece in integers, whose sum does not depend on the order."""
    for k in range(down.weights.shape[1]):
        for m in range(across.weights.shape[1]):
            for i in range(values.shape[0]):
                row, j = down.piece[i], 0
                if down.weights[down.place[i], k] == 0:
                    continue
                while j < values.shape[1]:
                    column, total, count = across.piece[j], np.int64(0), np.int64(0)
                    while j < values.shape[1] and across.piece[j] == column:
                        value = np.float64(values[i, j])
                        weight = down.weights[down.place[i], k] * across.weights[across.place[j], m] * _UNIT
                        if not np.isnan(value):
                            total += np.int64(np.rint(weight * min(max(value, -_LARGEST), _LARGEST)))
                            count += np.int64(np.rint(weight))
                        j += 1
                    sums[0, k, m, row, column] += total
                    sums[1, k, m, row, column] += count


def on_cells(rows, columns, around, *, along_y, along_x):
    """Interpolate linearly from blocks to cells."""
    return regularize(around, along_y[rows], along_x[columns], min_valid=0.0)
