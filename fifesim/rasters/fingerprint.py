"""Values of a few cells of a file, by which changed values and exchanged bands are found when it is read again."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, model_validator
from rasterio.windows import Window

# Largest number of rows, and of columns, whose cells are kept.
_LINES = 8

# Tolerance for the centre of a cell. [cell]
_POSITION = 1e-3

_Places = Annotated[list[float], Field(max_length=_LINES)]


class Fingerprint(BaseModel, extra="forbid"):
    """
    Values of cells on a regular sub-lattice of a file.

    Parameters
    ----------
    size : (float, float)
        Size of a cell, down and across. [m]
    y, x : list of float
        Centres of the rows and columns. [m]
    values : list, shape (band, y, x)
        None where a cell is NaN.
    """

    size: tuple[float, float]
    y: _Places
    x: _Places
    values: list[list[list[float | None]]]

    @model_validator(mode="after")
    def _fits(self):
        if {(len(rows), *map(len, rows)) for rows in self.values} != {(len(self.y), *[len(self.x)] * len(self.y))}:
            raise ValueError("values of other rows and columns")
        return self


@dataclass(frozen=True)
class Located:
    """Cells of a fingerprint that a file still has: rows and columns, and their values by the bands of the file."""

    rows: np.ndarray
    columns: np.ndarray
    values: np.ndarray  # shape (band, row, column), NaN where a cell has no data


def fingerprint_of(source):
    """
    Fingerprint of an open file.

    Parameters
    ----------
    source : rasterio.io.DatasetReader

    Returns
    -------
    fingerprint : dict
        JSON holds it, and `Fingerprint` validates it.
    """
    rows, columns = (_spread(size) for size in source.shape)
    cells = np.array([[source.read(window=Window(column, row, 1, 1))[:, 0, 0] for column in columns] for row in rows])
    values = np.moveaxis(cells, -1, 0).astype(object)
    values[values != values] = None
    a = source.transform
    return {
        "size": [-a.e, a.a],
        "y": [a.f + (row + 0.5) * a.e for row in rows],
        "x": [a.c + (column + 0.5) * a.a for column in columns],
        "values": values.tolist(),
    }


def _spread(size):
    """Up to so many rows or columns, spread evenly."""
    return np.unique(((np.arange(_LINES) + 0.5) / _LINES * size).astype(int)).tolist()


def located(fingerprint, order, source):
    """
    Cells of a fingerprint that an open file has.

    Parameters
    ----------
    fingerprint : Fingerprint
    order : sequence of int
        Number, in the fingerprint, of each band of the file.
    source : rasterio.io.DatasetReader

    Returns
    -------
    cells : Located or None
        None if the file has other cells, as after resampling.
    """
    values = np.array(fingerprint.values, float)
    a = source.transform
    if not np.allclose(fingerprint.size, (-a.e, a.a), rtol=1e-6, atol=0):
        return None
    rows = (np.array(fingerprint.y) - a.f) / a.e - 0.5
    columns = (np.array(fingerprint.x) - a.c) / a.a - 0.5
    if (
        np.max(np.abs(rows - np.rint(rows)), initial=0) + np.max(np.abs(columns - np.rint(columns)), initial=0)
        > _POSITION
    ):
        return None
    rows, columns = np.rint(rows).astype(int), np.rint(columns).astype(int)
    inside = [(at >= 0) & (at < size) for at, size in zip((rows, columns), source.shape, strict=True)]
    values = values[list(order)][:, inside[0]][:, :, inside[1]]
    return Located(rows[inside[0]], columns[inside[1]], values)


def changed_cell(cells, block, corner, marks):
    """
    First cell of a block whose value differs from the fingerprint.

    Parameters
    ----------
    cells : Located
    block : array, shape (band, y, x)
        Values of a part of the file.
    corner : (int, int, int)
        First band, row and column of the block in the file.
    marks : sequence of float
        Values that stand for no data, in addition to NaN. Data may be masked after the file was written, but not made.

    Returns
    -------
    change : (int, float, float) or None
        Band of the file, value that is there, and value that was written.
    """
    first, top, left = corner
    here = [
        (start <= at) & (at < start + size)
        for at, start, size in ((cells.rows, top, block.shape[1]), (cells.columns, left, block.shape[2]))
    ]
    if not (here[0].any() and here[1].any()):
        return None
    at = np.ix_(range(block.shape[0]), cells.rows[here[0]] - top, cells.columns[here[1]] - left)
    written = cells.values[first : first + block.shape[0]][:, here[0]][:, :, here[1]]
    found = block[at].astype(float)
    tolerance = 2 * np.finfo(block.dtype).eps * np.abs(written) if block.dtype.kind == "f" else 0.0
    # A comparison with NaN, which stands for no data, is false.
    changed = ~(np.isnan(found) | np.isin(found, marks)) & ~(np.abs(found - written) <= tolerance)
    if not changed.any():
        return None
    band, row, column = np.argwhere(changed)[0]
    return first + int(band), float(found[band, row, column]), float(written[band, row, column])
