"""Lazy arrays that are computed by themselves."""

import dask
import dask.array as da


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
    values = dask.delayed(_computed)(_Sealed(array), dask_key_name=f"apart-{array.name}")
    return da.from_delayed(values, array.shape, dtype=array.dtype)


class _Sealed:
    """An array that dask hands over as it is: of a dataclass it would look at the fields."""

    def __init__(self, array):
        self.array = array

    def __dask_tokenize__(self):
        return self.array.name


def _computed(sealed):
    # The thread that runs this is one of the scheduler's: another scheduler in it would wait for itself.
    return sealed.array.compute(scheduler="synchronous")
