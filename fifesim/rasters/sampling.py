"""Lazy arrays that are computed by themselves."""

from concurrent.futures import Future
from threading import Lock

import dask
import dask.array as da

# So many arrays of at most so many values are kept for who asks again, 32 MB: a property of the ground that is sampled
# may be made of samples itself.
_KEPT, _FEW = 8, 2**19


def apart(array):
    """
    A lazy array whose values come from one task, which shares nothing with the tasks of other arrays.

    Blocks of a raster that is sampled as a whole would else wait in memory for the last of them, where they are used
    beside it. (dask's own copies of a graph lack tasks where an array was rechunked.)

    Parameters
    ----------
    array : dask.array.Array
        As small as what may be in memory.

    Returns
    -------
    array : dask.array.Array
        In one chunk.
    """
    return all_apart([array])[0]


def all_apart(arrays):
    """
    The same of several arrays in one task, which makes once what more than one of them needs.

    Parameters
    ----------
    arrays : sequence of dask.array.Array

    Returns
    -------
    arrays : list of dask.array.Array
    """
    names = "-".join(array.name for array in arrays)
    values = dask.delayed(_computed)(_Sealed(tuple(arrays), names), dask_key_name=f"apart-{names}")
    return [da.from_delayed(values[i], each.shape, dtype=each.dtype) for i, each in enumerate(arrays)]


class _Sealed:
    """Arrays that dask hands over as they are: of a dataclass it would look at the fields."""

    def __init__(self, arrays, name):
        self.arrays, self.name = arrays, name

    def __dask_tokenize__(self):
        return self.name


_known, _asked = {}, Lock()


def _computed(sealed):
    """Values of arrays, made once by all threads of a process."""
    if sum(array.size for array in sealed.arrays) > _FEW:
        return _made(sealed)
    with _asked:
        found = _known.get(sealed.name)
        if mine := found is None:
            found = _known[sealed.name] = Future()
            for name in list(_known)[:-_KEPT]:
                del _known[name]
    if mine:
        try:
            found.set_result(_made(sealed))
        except BaseException as error:
            with _asked:
                _known.pop(sealed.name, None)
            found.set_exception(error)
    return tuple(each.copy() for each in found.result())


def _made(sealed):
    # The thread that runs this is one of the scheduler's: another scheduler in it would wait for itself.
    return dask.compute(*sealed.arrays, scheduler="synchronous")
