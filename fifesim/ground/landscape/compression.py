"""Cells of a raster by their class, so that each class computes its own alone."""

from functools import lru_cache

import numpy as np
from numba import njit

NO_CLASS = -1
"""Code of cells without a class."""


def check_codes(codes, table):
    """
    Codes of classes, as whole numbers.

    Parameters
    ----------
    codes : array
        NaN, and -1, are no class.
    table : sequence of int
        Codes that there are.

    Returns
    -------
    codes : array of int16, shape of the codes
        -1 where there is no class.

    Raises
    ------
    ValueError
        If a cell has another code, or a fraction.

    Examples
    --------
    >>> check_codes(np.array([1.0, np.nan, 7.0]), (1, 7)).tolist()
    [1, -1, 7]
    """
    codes = np.asarray(codes)
    if codes.dtype == np.int16 and not _others(codes.ravel(), _numbers(tuple(table))):
        return codes
    if codes.dtype.kind == "f":
        codes = np.where(np.isnan(codes), NO_CLASS, codes)
    wrong = ~np.isin(codes, [NO_CLASS, *table])
    if wrong.any():
        values, counts = np.unique(codes[wrong], return_counts=True)
        most = values[np.argsort(-counts, kind="stable")][:8]
        named = ", ".join(f"{value:g}" for value in sorted(most.tolist())) + (", ..." if values.size > 8 else "")
        raise ValueError(
            f"the map of cover has codes without a class: {named}, in {wrong.sum()} of {codes.size} cells. There are "
            f"{_listed(table)}: give each a CoverClass(..., code=), or mask it with .where"
        )
    return codes.astype(np.int16)


def _listed(table):
    return ", ".join(map(str, table[:12])) + (", ..." if len(table) > 12 else "")


def cells_by_class(codes, table):
    """
    Cells of each class.

    Parameters
    ----------
    codes : array of int16, shape (n,)
    table : sequence of int
        Codes of the classes.

    Returns
    -------
    cells : list of array of int, one for each class
        Indices of its cells, rising.

    Examples
    --------
    >>> [cells.tolist() for cells in cells_by_class(np.array([2, 5, 2, -1], np.int16), (5, 2))]
    [[1], [0, 2]]
    """
    order, ends = _sorted(np.asarray(codes, np.int16), _numbers(tuple(table)), len(table))
    return np.split(order[: ends[-1]], ends[:-1]) if len(table) else []


def numbers_of(codes, table):
    """
    Places of the codes of cells in a table.

    Parameters
    ----------
    codes : array of int16, shape (...)
    table : sequence of int, length n
        Codes of the classes.

    Returns
    -------
    numbers : array of int16, shape (...)
        From 0 on, n where a code is in no table.
    present : array of bool, shape (n + 1,)
        Which of the classes there are, and whether cells of none.

    Examples
    --------
    >>> numbers, present = numbers_of(np.array([2, 5, 2, -1], np.int16), (5, 2, 7))
    >>> numbers.tolist(), present.tolist()
    ([1, 0, 1, 3], [True, True, False, True])
    """
    codes, present = np.ascontiguousarray(codes, np.int16), np.zeros(len(table) + 1, bool)
    numbers = np.empty(codes.shape, np.int16)
    _look_up(codes.reshape(-1), _numbers(tuple(table)), numbers.reshape(-1), present)
    return numbers, present


@lru_cache(maxsize=16)
def _numbers(table):
    """Place of each code in a table, the number of its codes for all others; -1 is the last, beyond the codes."""
    numbers = np.full(2**15 + 1, len(table), np.int16)
    numbers[list(table)] = np.arange(len(table))
    return numbers


@njit(nogil=True, cache=True)
def _others(codes, numbers):
    """How many codes are in no table, but for -1."""
    count, none = 0, numbers[-1]
    for i in range(codes.size):
        count += (codes[i] < NO_CLASS) | ((codes[i] >= 0) & (numbers[codes[i]] == none))
    return count


@njit(nogil=True, cache=True)
def _look_up(codes, numbers, out, present):
    for i in range(codes.size):
        out[i] = numbers[codes[i]]
        present[out[i]] = True


@njit(nogil=True, cache=True)
def _sorted(codes, numbers, classes):
    """Cells in the order of their classes, and where each class ends; those of no class come last."""
    counts = np.zeros(classes + 1, np.int64)
    for i in range(codes.size):
        counts[numbers[codes[i]]] += 1
    ends = np.cumsum(counts)
    place = ends - counts
    order = np.empty(codes.size, np.int64)
    for i in range(codes.size):
        number = numbers[codes[i]]
        order[place[number]] = i
        place[number] += 1
    return order, ends[:-1].copy()
