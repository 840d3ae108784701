"""
Quintic B-splines of elevation and of noise, and the filling of gaps before they are fitted.

A spline that interpolates a lattice recovers a surface whose wavelengths are above five lattice cells within 1e-3 of
its amplitude, and a plane exactly. Its value at a point depends on lattice values d cells away as :math:`0.431^d`, so
that a margin of `MARGIN` cells makes it a local operation.
"""

from functools import partial

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import linalg

from fifesim.base.arrays import compiled, jitable
from fifesim.base.caches import cached
from fifesim.base.lattice import assemble, generator

# Quintic: a wave of five cells is recovered within 5e-4 of its amplitude, by degree 3 within 3e-3. The larger pole of
# the prefilter is -0.4306.
DEGREE = 5
SPLINE_MARGIN = 32

# Lattice cells around positions that hold all that a spline there is made of, and more.
SPLINE_REACH = 8


def spline_coefficients(values):
    """Coefficients of the quintic B-spline that interpolates a lattice, mirrored at the borders."""
    return ndimage.spline_filter(values, order=DEGREE, output=np.float64, mode="mirror")


@jitable
def _weights(share, out):
    """Fill in the six nonzero quintic B-splines at a share of a cell past the third of their lattice points."""
    t = share
    s = 1.0 - t
    out[0] = s * ((s * s) * (s * s)) / 120.0
    out[5] = t * ((t * t) * (t * t)) / 120.0
    out[1] = (26.0 + t * (-50.0 + t * (20.0 + t * (20.0 + t * (-20.0 + 5.0 * t))))) / 120.0
    out[4] = (26.0 + s * (-50.0 + s * (20.0 + s * (20.0 + s * (-20.0 + 5.0 * s))))) / 120.0
    out[2] = (66.0 + t * t * (-60.0 + t * t * (30.0 - 10.0 * t))) / 120.0
    out[3] = (66.0 + s * s * (-60.0 + s * s * (30.0 - 10.0 * s))) / 120.0


def spline_grid(coefficients, rows, columns):
    """Values of a spline on a grid parallel to its lattice, shape (rows, columns)."""
    # Positions are at least two lattice cells inside; 0 is the centre of the first cell.
    first, weights = np.empty(columns.size, np.int64), np.empty((columns.size, 6))
    lines, out = np.empty((coefficients.shape[0], columns.size)), np.empty((rows.size, columns.size))
    positions = np.ascontiguousarray(rows, float), np.ascontiguousarray(columns, float)
    _spline_grid(np.ascontiguousarray(coefficients), *positions, first, weights, lines, out)
    return out


@compiled
def _spline_grid(coefficients, rows, columns, first, weights, lines, out):
    """Interpolate all rows of coefficients to columns, into ``lines``, and these to rows."""
    for j in range(columns.size):
        first[j] = int(np.floor(columns[j])) - 2
        _weights(columns[j] - np.floor(columns[j]), weights[j])
    for i in range(lines.shape[0]):
        for j in range(columns.size):
            k, w = first[j], weights[j]
            c = coefficients[i, k : k + 6]
            lines[i, j] = w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3] + w[4] * c[4] + w[5] * c[5]
    w = np.empty(6)
    for i in range(rows.size):
        k, values = int(np.floor(rows[i])) - 2, out[i]
        _weights(rows[i] - np.floor(rows[i]), w)
        a, b, c, d, e, f = lines[k], lines[k + 1], lines[k + 2], lines[k + 3], lines[k + 4], lines[k + 5]
        u, v, x, y, z, q = w[0], w[1], w[2], w[3], w[4], w[5]
        for j in range(columns.size):
            values[j] = u * a[j] + v * b[j] + x * c[j] + y * d[j] + z * e[j] + q * f[j]


def spline_points(coefficients, rows, columns):
    """Values of a spline at points, shape (y, x)."""
    # Positions are at least two lattice cells inside; 0 is the centre of the first cell.
    out = np.empty(rows.shape)
    points = (np.ascontiguousarray(each).reshape(-1) for each in (rows, columns))
    _spline_points(np.ascontiguousarray(coefficients), *points, np.empty((2, 6)), out.reshape(-1))
    return out


@compiled
def _spline_points(coefficients, rows, columns, weights, out):
    for i in range(out.size):
        row, column = np.floor(rows[i]), np.floor(columns[i])
        _weights(rows[i] - row, weights[0])
        _weights(columns[i] - column, weights[1])
        total = 0.0
        for k in range(6):
            line = 0.0
            for m in range(6):
                line += weights[1, m] * coefficients[int(row) - 2 + k, int(column) - 2 + m]
            total += weights[0, k] * line
        out[i] = total


def spline_of_tiles(make_tile, tile, rows, columns):
    """Values on a grid of an unbounded spline with coefficients in fixed tiles, shape (rows, columns)."""
    # The same in every window, if whole cells can be subtracted from the positions without rounding.
    row, column = int(np.floor(rows[0])) - SPLINE_REACH, int(np.floor(columns[0])) - SPLINE_REACH
    shape = int(np.floor(rows[-1])) + SPLINE_REACH - row, int(np.floor(columns[-1])) + SPLINE_REACH - column
    return spline_grid(assemble(make_tile, tile, row, column, shape), rows - row, columns - column)


# Standard deviation of a quintic spline of white noise, the value at 0 of the B-spline of degree 11.
_DEVIATION = 0.3939255651755652

# Noise is drawn in blocks of this size. [lattice node]
_BLOCK = 64


def smooth_noise(seed, stream, step, south, east):
    """Gaussian noise of unit variance by place, without wavelengths much below two steps, shape (y, x). [1]"""
    return spline_of_tiles(partial(_block, seed, stream), _BLOCK, south / step, east / step) / _DEVIATION


def noise_square(drawn, spacing, count):
    """Smooth noise on a square of nodes, from a generator, shape (count, count). [1]"""
    positions = 3 + np.arange(count) * spacing
    size = int(positions[-1]) + 5
    return spline_grid(drawn.standard_normal((size, size)), positions, positions) / _DEVIATION


@cached(256, "noise of hills")
def _block(seed, stream, block_row, block_column):
    """White noise of one lattice block, whose place is the upper half of the Philox counter."""
    return generator(seed, stream, (0, 0, block_row, block_column)).standard_normal((_BLOCK, _BLOCK))


def extend(values, rings, rest=True):
    """Extrapolate a surface past its edge, ring by ring of cells, along lines and diagonals; a plane stays a plane."""
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values
    rows, columns = values.shape
    padded = np.pad(values, 2, constant_values=np.nan)
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]

    def shifted(down, across):
        return padded[2 + down : 2 + down + rows, 2 + across : 2 + across + columns]

    for _ in range(rings):
        total, count = np.zeros(values.shape), np.zeros(values.shape)
        for down, across in steps:
            line = 2 * shifted(down, across) - shifted(2 * down, 2 * across)
            found = np.isfinite(line)
            total += np.where(found, line, 0.0)
            count += found
        inside = padded[2:-2, 2:-2]
        new = ~np.isfinite(inside) & (count > 0)
        if not new.any():
            break
        inside[new] = total[new] / count[new]
    filled = padded[2:-2, 2:-2]
    return np.where(np.isfinite(filled), filled, values[known].mean()) if rest else filled


def fill_gaps(values, distance):
    """Fill holes by the surface of least bending, and extrapolate past the edge; a plane stays a plane."""
    # NaN remains farther from known values than `distance`, and in larger holes except for their rim. Gaps at the
    # border are past the edge.
    unknown = np.isnan(values)
    if unknown.all() or not unknown.any():
        return values
    tall, wide = (2 * size + 1 for size in distance)
    labels, _ = ndimage.label(unknown, structure=np.ones((3, 3)))
    out = values.copy()
    for number, (down, across) in enumerate(ndimage.find_objects(labels), start=1):
        inside = min(down.start, across.start) > 0 and down.stop < values.shape[0] and across.stop < values.shape[1]
        if inside and down.stop - down.start <= tall and across.stop - across.start <= wide:
            around = tuple(slice(max(part.start - 4, 0), part.stop + 4) for part in (down, across))
            hole = labels[around] == number
            out[around][hole] = _least_bending(values[around], hole)
    near = ndimage.distance_transform_edt(unknown, sampling=[1 / size for size in distance]) <= 1
    rings = int(np.ceil(max(distance)))
    # Farther out nothing is carried.
    around = tuple(
        slice(max(part.start - rings, 0), part.stop + rings) for part in ndimage.find_objects((~unknown).astype(int))[0]
    )
    carried = extend(values[around], rings, rest=False)
    out[around] = np.where(np.isnan(out[around]) & near[around], carried, out[around])
    return out


def _least_bending(values, hole):
    """Values in a hole that minimize the sum of squared second differences; other unknown cells are left out."""
    index, usable = np.arange(values.size).reshape(values.shape), (np.isfinite(values) | hole).ravel()
    along = [(index[:, :-2], index[:, 1:-1], index[:, 2:]), (index[:-2], index[1:-1], index[2:])]
    lines = np.concatenate([np.reshape(triple, (3, -1)) for triple in along], axis=1)
    corners = np.reshape((index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]), (4, -1))
    # The mixed derivative counts twice in the bending energy.
    mixed = _weighted_sums(corners, np.sqrt(2.0) * np.array([1.0, -1.0, -1.0, 1.0]), usable)
    bending = sparse.vstack([_weighted_sums(lines, [1.0, -2.0, 1.0], usable), mixed]).tocsc()
    unknown = np.flatnonzero(hole)
    fixed = np.where(hole, 0.0, np.where(np.isfinite(values), values, 0.0)).ravel()
    inner = bending[:, unknown]
    return linalg.spsolve((inner.T @ inner).tocsc(), -(inner.T @ (bending @ fixed)))


def _weighted_sums(cells, weights, usable):
    """Matrix of weighted sums over a few cells each, shape (sums, cells), for sums with usable cells only."""
    cells = cells[:, usable[cells].all(axis=0)]
    number = np.arange(cells.shape[1])
    entries = np.repeat(weights, number.size), (np.tile(number, len(weights)), cells.ravel())
    return sparse.csr_array(entries, shape=(number.size, usable.size))


def block_means(values, down, across):
    """Means of blocks of cells, NaN where a cell is, shape (rows / down, columns / across)."""
    rows, columns = values.shape
    return values.reshape(rows // down, down, columns // across, across).mean(axis=(1, 3))
