"""Finished blocks of a run on disk, from which it can go on when it was stopped."""

import io
import os
import zlib
from pathlib import Path

import numpy as np

from fifesim.output.run.identity import NotThisRun
from fifesim.rasters.windows import array_from_windows

SUFFIX = ".npy"

# A block is followed by its checksum. [byte]
_CHECKSUM = 4


def save_block(folder, name, index, block):
    """
    Save a block; it is there when it is whole.

    Parameters
    ----------
    folder : pathlib.Path
    name : str
        Of the array.
    index : tuple of int
        Of the block.
    block : numpy.ndarray

    Raises
    ------
    OSError
        If it cannot be written; nothing is left of it.
    """
    path = _path(folder, name, index)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial_path = path.with_suffix(".partial")
    # numpy would not say why a file cannot be written.
    content = io.BytesIO()
    np.save(content, block)
    with content.getbuffer() as whole:
        checksum = _checksum(whole)
    content.write(checksum)
    try:
        partial_path.write_bytes(content.getbuffer())
        os.replace(partial_path, path)
    except OSError as error:
        partial_path.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from error


def saved_blocks(folder, name, array):
    """
    Which blocks of an array are saved.

    Parameters
    ----------
    folder : pathlib.Path
    name : str
    array : dask.array.Array
        The one that they are of.

    Returns
    -------
    indices : set of tuple of int
        Those whose file is as it was written, and of the block's shape and type.
    """
    return {index for index in np.ndindex(array.numblocks) if _is_whole(_path(folder, name, index), array, index)}


def saved_block(folder, name, index):
    """
    A block that was saved.

    Parameters
    ----------
    folder : pathlib.Path
    name : str
        Of the array.
    index : tuple of int
        Of the block.

    Returns
    -------
    block : numpy.ndarray

    Raises
    ------
    OSError
        If its file is not as it was written.
    """
    return _load(_path(folder, name, index))


def saved_array(folder, name, array):
    """
    An array whose blocks are read from disk.

    Parameters
    ----------
    folder : pathlib.Path
    name : str
    array : dask.array.Array, shape (..., y, x)
        The one that was saved, with one chunk along its leading axes.

    Returns
    -------
    array : dask.array.Array
        In chunks of whole rows, each of a row of blocks: far fewer tasks than blocks.
    """
    leading, (down, across) = array.shape[:-2], array.chunks[-2:]
    numbers = {start: number for number, start in enumerate(np.cumsum((0, *down)).tolist())}

    def row_of_blocks(number):
        paths = (_path(folder, name, (*(0 for _ in leading), number, column)) for column in range(len(across)))
        return np.concatenate([_load(path) for path in paths], axis=-1)

    return array_from_windows(
        row_of_blocks,
        [],
        (down, (sum(across),)),
        lambda rows, columns: ((numbers[rows.start],), ()),
        token=f"saved-{folder}-{name}",
        leading=leading,
        dtype=array.dtype,
    )


def has_blocks(unfinished, error):
    """
    Whether a run that an error stopped can go on: not with what can never end well, nor from nothing.

    Parameters
    ----------
    unfinished : pathlib.Path
        Its hidden folder.
    error : BaseException

    Returns
    -------
    answer : bool
    """
    hopeless = isinstance(error, ValueError | TypeError) and not isinstance(error, NotThisRun)
    return not hopeless and any((unfinished / "blocks").glob(f"*/*{SUFFIX}"))


def _path(folder, name, index):
    return Path(folder) / name / ("-".join(f"{number:05d}" for number in index) + SUFFIX)


def _checksum(content):
    return zlib.crc32(content).to_bytes(_CHECKSUM, "little")


def _load(path):
    """A block as it was written."""
    content = Path(path).read_bytes()
    if _checksum(content[:-_CHECKSUM]) != content[-_CHECKSUM:]:
        raise OSError(f"{path} is not what was written: a run with --resume makes it again")
    return np.load(io.BytesIO(content), allow_pickle=False)


def _is_whole(path, array, index):
    try:
        block = _load(path)
    except (OSError, ValueError, EOFError):
        return False
    shape = tuple(sizes[number] for sizes, number in zip(array.chunks, index, strict=True))
    return block.shape == shape and block.dtype == array.dtype
