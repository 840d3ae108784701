"""Gaps of elevation: a surface carried on past its edge, holes filled by least bending, and means of blocks."""

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import linalg


def extend(values, rings, rest=True):
    """
    Carry a surface past its edge, ring by ring of cells, along the lines and diagonals that lead out of it.

    A plane goes on as a plane.

    Parameters
    ----------
    values : array, shape (rows, columns)
        NaN where unknown.
    rings : int
    rest : bool, optional
        What lies farther out takes the mean of all values: past `MARGIN` rings nothing depends on it.

    Returns
    -------
    values : array, shape (rows, columns)
        Without NaN, unless all is or the rest is left.
    """
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
    """
    Fill holes by the surface of least bending, and carry the surface on past its edge. A plane stays a plane.

    Parameters
    ----------
    values : array, shape (rows, columns)
        NaN where unknown. What touches the border is no hole but past the edge.
    distance : (float, float)
        From known values, down and across. Holes up to twice as tall and wide are filled. [cell]

    Returns
    -------
    values : array, shape (rows, columns)
        NaN farther from known values, and in larger holes but for their edge.
    """
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
    around = tuple(slice(max(part.start - rings, 0), part.stop + rings) for part in _box(~unknown))
    carried = extend(values[around], rings, rest=False)
    out[around] = np.where(np.isnan(out[around]) & near[around], carried, out[around])
    return out


def _box(found):
    """Slices of rows and columns around all that is true."""
    return tuple(slice(int(axis.min()), int(axis.max()) + 1) for axis in np.nonzero(found))


def _least_bending(values, hole):
    """Values in a hole that make the sum of squared second differences least; other unknown cells take no part."""
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
    """Matrix of weighted sums over a few cells each, shape (weights, sums); only those whose cells are all usable."""
    cells = cells[:, usable[cells].all(axis=0)]
    number = np.arange(cells.shape[1])
    entries = np.repeat(weights, number.size), (np.tile(number, len(weights)), cells.ravel())
    return sparse.csr_array(entries, shape=(number.size, usable.size))


def block_means(values, down, across):
    """
    Means of blocks of cells.

    Parameters
    ----------
    values : array, shape (rows, columns)
        Of whole blocks.
    down, across : int
        Size of a block. [cell]

    Returns
    -------
    means : array, shape (rows / down, columns / across)
        NaN where a cell of the block is.
    """
    rows, columns = values.shape
    return values.reshape(rows // down, down, columns // across, across).mean(axis=(1, 3))
