"""Tables over leaf area and its dead share: exact functions on nodes, cubic splines between them."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from fifesim.ground.canopy.crowns import crown_shares

LIMIT = 50.0
"""Largest leaf area index in a table [m2 m-2]; canopies beyond are evaluated one by one."""

TOLERANCE = 4e-7
"""Of each of two axes; together, and with the rounding of single precision, within 1e-6 [1]."""

_COARSEST = 33, 33
_FINEST = 2**20  # nodes in all

_LINE = 64  # of a processor's cache [byte]

TERMS = 8
"""Columns of `FoliageTable` for each band where crowns differ from cell to cell."""


class FoliageTable(NamedTuple):
    r"""
    Tensor product of uniform cubic B-splines.

    The axes are :math:`1 - 1 / \sqrt{1 + a L}` with the rate a; and :math:`q / (1 + q)` with
    :math:`q^2 = f_B / (1 - f_B)`, on which a thin layer above or below a thick one has no steep side. Where the dead
    share is one number, its axis has one node.
    """

    rate: float
    steps: np.ndarray
    """Intervals per unit of each axis."""
    coefficients: np.ndarray
    """Shape (L, fB, column), in single precision."""


def tabulate_foliage(function, rate, by_brown=True, combine=None, tolerance=TOLERANCE):
    """
    Table of smooth functions of leaf area and dead share, as fine as it must be.

    Each axis is refined until the spline meets the function halfway between its nodes.

    Parameters
    ----------
    function : callable
        Of LAI and dead share, each of shape (n,), to values, shape (column, n).
    rate : float
        Largest decay rate of the functions. [1]
    by_brown : bool, optional
        Whether the table has an axis of the dead share.
    combine : callable, optional
        Of the values, shape (column, n), to that which must meet the tolerance; the values by default.
    tolerance : float, optional

    Returns
    -------
    table : FoliageTable

    Raises
    ------
    ValueError
        If no table fine enough is found.

    Examples
    --------
    >>> table = tabulate_foliage(lambda lai, brown: np.exp(-lai)[None], 1.0, by_brown=False)
    >>> table.coefficients.shape[1:]
    (1, 1)
    """
    combine = combine or (lambda values: values)
    # Fewest nodes, for the slow decay of dense canopies too, which is of the order of 1.
    rate = 0.3 * float(np.sqrt(rate))
    axes = [np.linspace(0, 1, _COARSEST[0]), np.linspace(0, 1, _COARSEST[1]) if by_brown else np.zeros(1)]

    def on(nodes):
        position, odds = (each.ravel() for each in np.meshgrid(*nodes, indexing="ij"))
        values = function(_lai(position, rate), odds**2 / (odds**2 + (1 - odds) ** 2))
        return np.moveaxis(values.reshape(-1, *map(len, nodes)), 0, -1)

    def columns(values):
        return combine(values.reshape(-1, values.shape[-1]).T)

    values, waiting = on(axes), [axis for axis, nodes in enumerate(axes) if len(nodes) > 1]
    while waiting and values.size // values.shape[-1] <= _FINEST:
        axis = waiting.pop(0)
        between = (axes[axis][1:] + axes[axis][:-1]) / 2
        exact = on([between if number == axis else nodes for number, nodes in enumerate(axes)])
        found = CubicSpline(axes[axis], values, axis=axis)(between)
        if np.abs(columns(found) - columns(exact)).max() >= tolerance:
            values = np.insert(values, np.arange(1, len(axes[axis])), exact, axis=axis)
            axes[axis] = np.linspace(0, 1, values.shape[axis])
            waiting.append(axis)
    if waiting:
        raise ValueError(f"no table of {_FINEST} nodes reaches {tolerance:g}: use exact=True")
    for axis in range(2):
        values = _uniform_splines(values, axis)
    steps = np.array([(len(axes[0]) - 1) / _length(rate), len(axes[1]) - 1])
    return FoliageTable(rate, steps, _aligned(values))


def _aligned(values):
    """Values in single precision that begin where a line of the cache does, so that no load of several takes two."""
    size = 4 * values.size
    memory = np.empty(size + _LINE, np.uint8)
    start = -memory.ctypes.data % _LINE
    out = memory[start : start + size].view(np.float32).reshape(values.shape)
    out[...] = values
    return out


def _lai(position, rate):
    # Rounding must not lead past the last node.
    return np.minimum((1 / (1 - position * _length(rate)) ** 2 - 1) / rate, LIMIT)


def _length(rate):
    return 1 - 1 / np.sqrt(1 + rate * LIMIT)


def _uniform_splines(values, axis):
    """
    Coefficients of uniform B-splines, two more than there are nodes, times 6: the weights are without that divisor.

    With unit steps a spline is s = (c_-1 + 4 c_0 + c_1) / 6 and s'' = c_-1 - 2 c_0 + c_1 at its nodes.
    """
    if values.shape[axis] == 1:
        return values
    values = np.moveaxis(values, axis, 0)
    nodes = np.arange(len(values))
    curvature = CubicSpline(nodes, values, axis=0)(nodes, 2)
    inner = values - curvature / 6
    first = curvature[0] + 2 * inner[0] - inner[1]
    last = curvature[-1] + 2 * inner[-1] - inner[-2]
    return np.moveaxis(np.concatenate([first[None], inner, last[None]]), 0, axis) / 6


def crown_table(crown_shape, sza, vza, raa):
    """
    Table of `crown_shares` over the crown cover: of sun, view, apart and lit.

    The axis is the fourth root of the gaps, on which no power of them has a corner.

    Parameters
    ----------
    crown_shape, sza, vza, raa : float
        [1], [degree]

    Returns
    -------
    coefficients : array, shape (n, 4)
        Of uniform B-splines.

    Raises
    ------
    ValueError
        If no table fine enough is found.
    """

    def shares(root):
        found = crown_shares(1 - root**4, crown_shape, sza, vza, raa)
        return np.stack([found.sun, found.view, found.apart, found.lit], axis=-1)

    root = np.linspace(0, 1, 65)
    while len(root) < _FINEST:
        between, values = (root[1:] + root[:-1]) / 2, shares(root)
        if np.abs(CubicSpline(root, values)(between) - shares(between)).max() < TOLERANCE / 30:
            return np.ascontiguousarray(_uniform_splines(values, 0))
        root = np.linspace(0, 1, 2 * len(root) - 1)
    raise ValueError(f"no table of {_FINEST} crown covers is fine enough: use exact=True")
