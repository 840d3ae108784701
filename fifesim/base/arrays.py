"""Compilation of kernels, and their arguments as arrays."""

import hashlib
import io
from contextlib import contextmanager
from functools import partial
from glob import escape
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pandas as pd
from numba.core.caching import IndexDataCacheFile
from numba.extending import register_jitable

from fifesim.base.messages import warn


class _CheckedFiles(IndexDataCacheFile):
    """Files of a compiled kernel that end with a SHA-256, because numba runs what it reads."""

    def load(self, key):
        """Load a compiled kernel, None if there is none that is intact."""
        with self._warned_of():
            pattern = f"{escape(self._index_name.removesuffix('.nbi'))}*.nb?"
            for path in Path(self._cache_path).glob(pattern):
                content = path.read_bytes()
                if hashlib.sha256(content[:-32]).digest() != content[-32:]:
                    path.unlink()
                    _warn_of_cache(self._cache_path, "damaged files are removed")
            return super().load(key)

    def save(self, key, data):
        """Save a compiled kernel if the disk takes it."""
        with self._warned_of():
            super().save(key, data)

    @contextmanager
    def _warned_of(self):
        try:
            yield
        except OSError as error:
            _warn_of_cache(self._cache_path, error.strerror)

    @contextmanager
    def _open_for_write(self, filepath):
        content = io.BytesIO()
        with super()._open_for_write(filepath) as file:
            yield content
            file.write(content.getvalue() + hashlib.sha256(content.getvalue()).digest())


_warned: set[str] = set()


def _warn_of_cache(folder, reason):
    """Warn once for each reason that kernels cannot be loaded or saved."""
    if reason not in _warned:
        _warned.add(reason)
        warn(
            f"compiled kernels in {folder} cannot be used ({reason}), so that kernels are compiled again, which takes "
            "up to a minute: name another folder in the variable NUMBA_CACHE_DIR if it persists"
        )


def compiled(function: Any = None, **options: Any) -> Any:
    """Decorator of a kernel, which is compiled for each type of its arguments when it is first called."""
    if function is None:
        return partial(compiled, **options)
    # Divided as numpy does: a check of each divisor for 0 would keep a loop from taking several cells at once. Allocate
    # arrays, reshape and sort outside of kernels: numba compiles these operations anew for each kernel.
    options |= {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    try:
        kernel = numba.njit(function, cache=True, **options)
    except RuntimeError:
        _warn_of_cache(Path(__file__).parents[1], "no folder can be written")
        return numba.njit(function, **options)
    # Without compilation, a kernel is a plain function.
    if cache := getattr(kernel, "_cache", None):
        name, stamp = f"{cache._impl.filename_base}.sha256", cache._impl.locator.get_source_stamp()
        cache._cache_file = _CheckedFiles(cache.cache_path, name, stamp)
    return kernel


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
