"""Compilation of kernels, and their arguments as arrays."""

from functools import partial
from typing import Any

import numba
import numpy as np
import pandas as pd
from numba.extending import register_jitable

# Divided as numpy does: a check of each divisor for 0 would keep a loop from taking several cells at once. Allocate
# arrays, reshape and sort outside of kernels: numba compiles these operations anew for each kernel.
compiled: Any = partial(numba.njit, nogil=True, cache=True, error_model="numpy", no_cfunc_wrapper=True)
"""Decorator of a kernel, which is compiled for each type of its arguments when it is first called."""

jitable: Any = register_jitable(no_cfunc_wrapper=True)
"""Decorator of a function that kernels call too, compiled as a part of them."""


def read_only(values):
    """Contiguous, read-only view of an array, so that a kernel is compiled once for arrays of either kind."""
    view = np.ascontiguousarray(values).view()
    view.flags.writeable = False
    return view


def numbers(values):
    """Values as an array of floating-point numbers; complex ones, whose imaginary part is a derivative, stay."""
    return np.asarray(values, complex if np.iscomplexobj(values) else float)


def as_rows(*given):
    """Common shape of some arguments, and their values as rows of one array, shape (argument, n)."""
    given = [np.asarray(each) for each in given]
    shape = np.broadcast_shapes(*(each.shape for each in given))
    rows = np.empty((len(given), *shape), np.result_type(float, *given))
    for number, each in enumerate(given):
        rows[number] = each
    return shape, rows.reshape(len(given), -1)


def distinct_columns(rows):
    """Place of the first of each kind of equal columns, and the kind of each column."""
    kind = np.zeros(rows.shape[1], np.int64)
    for row in rows:
        codes, values = pd.factorize(row, use_na_sentinel=False)
        kind = pd.factorize(kind * len(values) + codes)[0]
    first = np.zeros(kind.max(initial=-1) + 1, np.int64)
    first[kind[::-1]] = np.arange(kind.size)[::-1]
    return first, kind
