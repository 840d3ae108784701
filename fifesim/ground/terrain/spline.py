"""
Elevation onto finer cells by quintic B-splines: smooth to the fourth derivative, free of the source's facets.

A spline that interpolates a lattice recovers a surface whose wavelengths are above five lattice cells within 1e-3 of
its amplitude, and a plane exactly. What it gives at a point depends on lattice values d cells away as 0.431**d, so that
a margin of `MARGIN` cells makes it a local operation.
"""

import numba
import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import linalg

# Quintic: a wave of five cells is recovered within 5e-4 of its amplitude, by degree 3 within 3e-3. The larger pole of
# the prefilter is -0.4306.
DEGREE = 5
MARGIN = 32

# Metres in one unit of elevation, by the names that files use. NIST SP 811, App. B.8: the two feet differ by 2e-6.
METRES = {"m": 1.0, "ft": 0.3048, "us-ft": 1200.0 / 3937.0, "km": 1000.0, "dm": 0.1, "cm": 0.01, "mm": 0.001}
_NAMES = {
    "m": ("metre", "metres", "meter", "meters"),
    "ft": ("foot", "feet", "international foot", "foot (international)"),
    "us-ft": ("us survey foot", "us survey feet", "survey foot", "ftus", "us_survey_foot", "foot_us", "us foot"),
    "km": ("kilometre", "kilometer"),
    "dm": ("decimetre", "decimeter"),
    "cm": ("centimetre", "centimeter"),
    "mm": ("millimetre", "millimeter"),
}

# Above this share of neighbours that are equal, whole numbers are terraces: their risers show in slope and aspect.
TERRACES = 0.25


def metres_per_unit(name):
    """
    Metres in a unit of elevation.

    Parameters
    ----------
    name : str
        As files and coordinate reference systems spell it, such as ``"ft"`` or ``"US survey foot"``.

    Returns
    -------
    metres : float
        [m]

    Raises
    ------
    ValueError
        If the unit is not known.

    Examples
    --------
    >>> metres_per_unit("Foot")
    0.3048
    """
    plain = str(name).strip().lower()
    for unit, metres in METRES.items():
        if plain == unit or plain in _NAMES.get(unit, ()):
            return metres
    raise ValueError(f"vertical units must be one of {', '.join(METRES)}, got {name!r}")


def spline_coefficients(values):
    """
    Coefficients of the quintic B-spline that interpolates a lattice.

    Parameters
    ----------
    values : array, shape (rows, columns)
        Without NaN. Mirrored at the borders, which tells within `MARGIN` cells of them.

    Returns
    -------
    coefficients : array, shape (rows, columns)
    """
    return ndimage.spline_filter(values, order=DEGREE, output=np.float64, mode="mirror")


@numba.njit(nogil=True, cache=True)
def _weights(share, out):
    """The six quintic B-splines that are not zero at a share of a cell past the third of their lattice points."""
    t = share
    s = 1.0 - t
    out[0] = s**5 / 120.0
    out[5] = t**5 / 120.0
    out[1] = (26.0 + t * (-50.0 + t * (20.0 + t * (20.0 + t * (-20.0 + 5.0 * t))))) / 120.0
    out[4] = (26.0 + s * (-50.0 + s * (20.0 + s * (20.0 + s * (-20.0 + 5.0 * s))))) / 120.0
    out[2] = (66.0 + t * t * (-60.0 + t * t * (30.0 - 10.0 * t))) / 120.0
    out[3] = (66.0 + s * s * (-60.0 + s * s * (30.0 - 10.0 * s))) / 120.0


@numba.njit(nogil=True, cache=True)
def spline_grid(coefficients, rows, columns):
    """
    Values of a spline on a grid that is parallel to its lattice.

    Parameters
    ----------
    coefficients : array, shape (m, n)
    rows, columns : array, shape (rows,), (columns,)
        Positions, at least two lattice cells inside; 0 is the centre of the first cell. [cell]

    Returns
    -------
    values : array, shape (rows, columns)
    """
    across = np.empty((coefficients.shape[0], columns.size))
    weights = np.empty(6)
    for j in range(columns.size):
        first = int(np.floor(columns[j])) - 2
        _weights(columns[j] - np.floor(columns[j]), weights)
        for i in range(coefficients.shape[0]):
            total = 0.0
            for k in range(6):
                total += weights[k] * coefficients[i, first + k]
            across[i, j] = total
    out = np.empty((rows.size, columns.size))
    for i in range(rows.size):
        first = int(np.floor(rows[i])) - 2
        _weights(rows[i] - np.floor(rows[i]), weights)
        for j in range(columns.size):
            total = 0.0
            for k in range(6):
                total += weights[k] * across[first + k, j]
            out[i, j] = total
    return out


@numba.njit(nogil=True, cache=True)
def spline_points(coefficients, rows, columns):
    """
    Values of a spline at points.

    Parameters
    ----------
    coefficients : array, shape (m, n)
    rows, columns : array, shape (y, x)
        Positions, at least two lattice cells inside; 0 is the centre of the first cell. [cell]

    Returns
    -------
    values : array, shape (y, x)
    """
    out = np.empty(rows.shape)
    down, across = np.empty(6), np.empty(6)
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            row, column = np.floor(rows[i, j]), np.floor(columns[i, j])
            _weights(rows[i, j] - row, down)
            _weights(columns[i, j] - column, across)
            total = 0.0
            for k in range(6):
                line = 0.0
                for m in range(6):
                    line += across[m] * coefficients[int(row) - 2 + k, int(column) - 2 + m]
                total += down[k] * line
            out[i, j] = total
    return out


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
    carried = extend(values, int(np.ceil(max(distance))), rest=False)
    return np.where(np.isnan(out) & near, carried, out)


def _least_bending(values, hole):
    """Values in a hole that make the sum of squared second differences least; other unknown cells take no part."""
    rows, columns = values.shape
    index = np.arange(values.size).reshape(values.shape)
    triples = [
        (index[:, :-2], index[:, 1:-1], index[:, 2:], 1.0),
        (index[:-2], index[1:-1], index[2:], 1.0),
    ]
    lines = [np.stack([a.ravel(), b.ravel(), c.ravel()]) for a, b, c, _ in triples]
    first, middle, last = np.concatenate(lines, axis=1)
    usable = np.isfinite(values).ravel() | hole.ravel()
    keep = usable[first] & usable[middle] & usable[last]
    first, middle, last = first[keep], middle[keep], last[keep]
    number = np.arange(first.size)
    second = sparse.csr_array(
        (
            np.repeat([1.0, -2.0, 1.0], first.size),
            (np.tile(number, 3), np.concatenate([first, middle, last])),
        ),
        shape=(first.size, rows * columns),
    )
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    flat = [corner.ravel() for corner in corners]
    keep = np.logical_and.reduce([usable[corner] for corner in flat])
    flat = [corner[keep] for corner in flat]
    number = np.arange(keep.sum())
    # The mixed derivative counts twice in the bending energy.
    mixed = sparse.csr_array(
        (
            np.repeat(np.sqrt(2.0) * np.array([1.0, -1.0, -1.0, 1.0]), number.size),
            (np.tile(number, 4), np.concatenate(flat)),
        ),
        shape=(number.size, rows * columns),
    )
    bending = sparse.vstack([second, mixed]).tocsc()
    unknown = np.flatnonzero(hole)
    fixed = np.where(hole, 0.0, np.where(np.isfinite(values), values, 0.0)).ravel()
    inner = bending[:, unknown]
    return linalg.spsolve((inner.T @ inner).tocsc(), -(inner.T @ (bending @ fixed)))


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


def terrace_step(values):
    """
    Vertical resolution of elevations that are whole numbers and lie in terraces.

    Parameters
    ----------
    values : array, shape (rows, columns)
        NaN where unknown.

    Returns
    -------
    step : int or None
        Greatest common divisor of the differences, where more than a quarter of the neighbours are equal and some are
        not; None for elevations without terraces. [unit of the values]
    """
    differences = np.concatenate([np.diff(values, axis=axis).ravel() for axis in (0, 1)])
    differences = differences[np.isfinite(differences)]
    known = values[np.isfinite(values)]
    if not known.size or not differences.any() or np.any(known != np.rint(known)):
        return None
    equal = np.mean(differences == 0)
    return int(np.gcd.reduce(np.abs(differences).astype(np.int64))) if equal > TERRACES else None
