"""
Means of ground cells over the footprints of pixels, for any ratio of sizes and any offset.

A footprint is the product of one line spread function per axis. A line spread function (lsf) is any object with
``half_width`` [m], outside of which it is zero, and ``cumulative(x)``, its integral from there up to the distance x [m]
from the pixel centre, 0 to 1. The weight of a cell from a to b is exactly ``cumulative(b) - cumulative(a)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from fifesim.base.arguments import Kind, MinValid, Numbers, Range, check, check_number, kind_of
from fifesim.base.arrays import compiled, jitable

# Rounding of positions leaves weights of about 1e-16 in cells that only touch the footprint: dropped, because
# they would pass on NaN and widen the window.
_DUST = 1e-12


@dataclass(frozen=True, eq=False)
class AxisOperator:
    """
    Weights of the cells along one axis in each pixel.

    A slice of pixels, ``operator[i0:i1]``, needs only the cells of its ``window``.

    Parameters
    ----------
    start : array of int, shape (n_pixels,)
        First cell of each pixel, counted from the first cell of the scene.
    count : array of int, shape (n_pixels,)
        Number of cells, 0 where the pixel lies outside the scene.
    weights : array, shape (n_pixels, k)
        Weights of the cells from ``start`` on, zero from ``count`` on. [1]
    share : array, shape (n_pixels,)
        Sum of the weights: the share of the footprint inside the scene. [1]
    window : slice
        Cells that the operator is applied to.
    """

    start: np.ndarray
    count: np.ndarray
    weights: np.ndarray
    share: np.ndarray
    window: slice

    def __len__(self):
        return len(self.start)

    def __getitem__(self, pixels):
        """Operator of a slice of pixels, whose window holds the cells that they need, and at least one."""
        if not isinstance(pixels, slice) or pixels.step not in (None, 1):
            raise TypeError(f"an axis operator is cut by a slice of step 1, got {pixels!r}")
        start, count = self.start[pixels], self.count[pixels]
        inside = count > 0
        if inside.any():
            window = slice(int(start[inside].min()), int((start + count)[inside].max()))
        else:
            window = slice(self.window.start, self.window.start + 1)
        return AxisOperator(start, count, self.weights[pixels], self.share[pixels], window)


def axis_operator(lsf, *, cell_origin, cell_size, n_cells, pixel_origin, pixel_size, n_pixels, shift=0.0):
    r"""
    Weights of ground cells in sensor pixels along one axis.

    .. math:: w_{ij} = C(x_{j+1} - X_i) - C(x_j - X_i)

    with :math:`X_i` the centre of pixel i, :math:`x_j` the edges of the cells and C the cumulative line
    spread function. Sizes and offsets may have any ratio. Cells that the scene lacks lose their weight.

    Parameters
    ----------
    lsf : line spread function
        Object with ``half_width`` and ``cumulative``.
    cell_origin, pixel_origin : float
        Outer edge of the first cell and of the first pixel. [m]
    cell_size, pixel_size : float
        Both negative where the coordinate decreases with the index, as rows do on a north-up grid. [m]
    n_cells, n_pixels : int
        Numbers of cells and of pixels.
    shift : float or array, shape (n_pixels,), optional
        Distance from where a pixel should lie to where it does, positive toward higher indices. [m]

    Returns
    -------
    operator : AxisOperator

    Raises
    ------
    ValueError
        If a size is zero or the two have opposite signs, or there is no cell or no pixel.

    References
    ----------
    [Friedl1995]_, Eq. 3, the sensor's part along one axis

    Examples
    --------
    A pixel of two and a half cells:

    >>> from fifesim.base.footprints import Boxcar
    >>> operator = axis_operator(Boxcar(5.0), cell_origin=0, cell_size=2, n_cells=5,
    ...                          pixel_origin=0, pixel_size=5, n_pixels=2)
    >>> operator.weights[0].round(3).tolist(), operator.start[0].item()
    ([0.4, 0.4, 0.2, 0.0], 0)
    """
    if not cell_size * pixel_size > 0:
        raise ValueError(
            f"cell_size and pixel_size must have the same sign, got {cell_size} and {pixel_size}: "
            "give both negative for rows of a north-up grid"
        )
    if n_cells < 1 or n_pixels < 1:
        raise ValueError(f"n_cells and n_pixels must be at least 1, got {n_cells} and {n_pixels}")
    # Distances are taken from the scene's edge: coordinates of millions of metres would cost digits.
    center = np.sign(cell_size) * (pixel_origin - cell_origin) + (np.arange(n_pixels) + 0.5) * abs(pixel_size)
    center = center + np.asarray(shift, float)
    size = abs(cell_size)
    first = np.floor((center - lsf.half_width) / size).astype(np.int64)
    steps = np.arange(int(np.ceil(2 * lsf.half_width / size)) + 2)
    weights = np.diff(lsf.cumulative((first[:, None] + steps) * size - center[:, None]), axis=1)
    index = first[:, None] + steps[:-1]
    return _trim(first, np.where((index >= 0) & (index < n_cells), weights, 0.0), n_cells)


def _trim(first, weights, n_cells):
    """Operator whose pixels begin and end with a cell of nonzero weight."""
    k = weights.shape[1]
    used = np.abs(weights) > _DUST
    begin = used.argmax(axis=1)
    count = np.where(used.any(axis=1), k - used[:, ::-1].argmax(axis=1) - begin, 0)
    position = np.arange(k)
    moved = np.take_along_axis(weights, np.minimum(begin[:, None] + position, k - 1), axis=1)
    moved = np.where(position < count[:, None], moved, 0.0)
    start = np.clip(first + begin, 0, n_cells - 1)
    return AxisOperator(start, count, moved, moved.sum(axis=1), slice(0, n_cells))


def regularize(values, rows, columns, *, min_valid=0.98):
    r"""
    Means over the footprints of a sensor's pixels.

    .. math::

        L_{ij} = \sum_{kl} w_{ik} w_{jl} \, v_{kl} \Big/ \sum_{kl} w_{ik} w_{jl}

    with both sums over the valid cells. A pixel whose footprint holds no NaN takes the separable form, and
    only the others the sum over both axes. The value of a pixel therefore depends only on its
    footprint: the same bits come out of any window.

    Parameters
    ----------
    values : array, shape (..., y, x)
        Values of the cells of ``rows.window`` and ``columns.window``; NaN where they are missing.
    rows, columns : AxisOperator
        Operators of the two axes, from `axis_operator` or slices of them.
    min_valid : float, optional
        Smallest share of the footprint's weight that valid cells must hold. Cells that the scene does not
        have are not valid. [1]

    Returns
    -------
    means : array, shape (..., len(rows), len(columns))
        NaN below ``min_valid``. float32 for float32 values, else float64; sums are always taken in float64.

    Raises
    ------
    ValueError
        If the values do not have the shape of the windows, or ``min_valid`` is not in [0, 1].

    References
    ----------
    [Friedl1995]_, Eq. 3, without the atmosphere's point spread; [Knutsson1993]_, normalized convolution

    Examples
    --------
    A constant scene stays constant, and a pixel that mostly lies outside is missing:

    >>> from fifesim.base.footprints import Boxcar
    >>> axis = axis_operator(Boxcar(9.0), cell_origin=0, cell_size=3, n_cells=6,
    ...                      pixel_origin=0, pixel_size=9, n_pixels=3)
    >>> regularize(np.full((6, 6), 0.25), axis, axis).round(12)[0].tolist()
    [0.25, 0.25, nan]
    """
    values = np.asarray(values)
    dtype = np.float32 if values.dtype == np.float32 else np.float64
    wanted = rows.window.stop - rows.window.start, columns.window.stop - columns.window.start
    if values.shape[-2:] != wanted:
        raise ValueError(
            f"the operators want {wanted} cells along (y, x), the values have shape {values.shape}: "
            "cut them with rows.window and columns.window"
        )
    check("min_valid", min_valid, kind_of(MinValid))
    means = np.empty((*values.shape[:-2], len(rows), len(columns)), dtype)
    down, across = (
        _Axis(axis.start - axis.window.start, axis.count, axis.weights, axis.share) for axis in (rows, columns)
    )
    for layer in np.ndindex(values.shape[:-2]):
        _regularize(*_rows_of(values[layer], dtype), down, across, min_valid, means[layer])
    return means


class _Axis(NamedTuple):
    """Operator of one axis in the form of the kernel, with first cells counted from the given window."""

    start: np.ndarray
    count: np.ndarray
    weights: np.ndarray
    share: np.ndarray


def _rows_of(cells, dtype):
    """Cells as a flat array, the distance between rows, and the row length; a contiguous part is not copied."""
    inside = cells.dtype == dtype and cells.size and cells.strides[1] == cells.itemsize
    if not inside or cells.strides[0] < cells.shape[1] * cells.itemsize or cells.strides[0] % cells.itemsize:
        cells = np.ascontiguousarray(cells, dtype)
        return cells.reshape(-1), cells.shape[1], cells.shape[1]
    apart = cells.strides[0] // cells.itemsize
    size = (cells.shape[0] - 1) * apart + cells.shape[1]
    return np.lib.stride_tricks.as_strided(cells, (size,), cells.strides[1:]), apart, cells.shape[1]


@compiled
def _regularize(values, apart, length, rows, columns, min_valid, out):
    line = np.empty(length)
    for i in range(out.shape[0]):
        top, height = rows.start[i], rows.count[i]
        # Rows first: this sum runs along contiguous memory, and leaves one line for the sum over columns.
        line[:] = 0.0
        for k in range(height):
            weight, first = rows.weights[i, k], (top + k) * apart
            cells = values[first : first + length]
            for x in range(length):
                line[x] += weight * cells[x]
        for j in range(out.shape[1]):
            left, width = columns.start[j], columns.count[j]
            total = 0.0
            for k in range(width):
                total += columns.weights[j, k] * line[left + k]
            share = rows.share[i] * columns.share[j]
            if np.isnan(total):
                first = top * apart + left
                total, share = _sum_valid(values[first:], apart, rows.weights[i, :height], columns.weights[j, :width])
            # The slack is rounding: a whole footprint sums to 1 within 1e-15 and must pass min_valid = 1.
            out[i, j] = total / share if share > 0 and share >= min_valid - 1e-9 else np.nan


@jitable
def _sum_valid(values, apart, y_weights, x_weights):
    total, share = 0.0, 0.0
    for y in range(y_weights.size):
        for x in range(x_weights.size):
            value = values[y * apart + x]
            if not np.isnan(value):
                weight = y_weights[y] * x_weights[x]
                total += weight * value
                share += weight
    return total, share


class Transfer:
    """Transfer function of a part of an instrument; subclasses give the formula, ``_mtf(frequency)``."""

    _mtf: Callable

    def mtf(self, frequency: Numbers) -> np.ndarray:
        """Modulation transfer function at spatial frequencies [cycles m-1], negative where contrast is reversed. [1]"""
        return self._mtf(np.asarray(frequency, float))


class LineSpread(Transfer):
    """Line spread function by the distance from the pixel centre."""

    # Subclasses give `half_width`, beyond which it is zero [m], and the formulas `_cumulative(x)` and
    # `_mtf(frequency)`.

    half_width: float
    _cumulative: Callable

    def cumulative(self, x: Numbers) -> np.ndarray:
        """Share of the response before a distance [m] from the pixel centre. [1]"""
        return self._cumulative(np.asarray(x, float))


# Any object with the two members of a line spread function.
Spread: TypeAlias = Annotated[
    LineSpread,
    Kind(
        "a line spread function, such as fifesim.instrument('TM').line_spread",
        lambda value: hasattr(value, "half_width"),
    ),
]


@dataclass(frozen=True)
class FiniteSpread(LineSpread):
    """
    Line spread function that ends at half of its width on either side.

    Parameters
    ----------
    width : float
        Width W of the support. [m]

    Raises
    ------
    ValueError
        If the width is not positive.
    """

    width: float

    def __post_init__(self):
        check_number("width of a line spread function", self.width, Range("m", 0, np.inf, ends="()"))

    @property
    def half_width(self):
        """Half of the width. [m]"""
        return self.width / 2


@dataclass(frozen=True)
class Boxcar(FiniteSpread):
    r"""
    Uniform line spread function of width W, whose footprint mean is the true areal mean.

    .. math:: C(x) = \frac{1}{2} + \frac{x}{W}, \quad |x| \le \frac{W}{2}; \qquad
        M(f) = \mathrm{sinc}(f W), \quad \mathrm{sinc}\,t = \frac{\sin \pi t}{\pi t}

    Examples
    --------
    >>> float(Boxcar(30.0).cumulative(-7.5))
    0.25
    """

    def _cumulative(self, x):
        return np.clip(0.5 + x / self.width, 0.0, 1.0)

    def _mtf(self, frequency):
        return np.sinc(frequency * self.width)
