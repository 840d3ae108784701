"""Composites: of the dates of a cell, the one to keep."""

import numpy as np


def date_of_maximum(index):
    """
    Which date has the largest value of an index.

    Parameters
    ----------
    index : array, shape (..., date)
        Such as NDVI; NaN where a date has no data.

    Returns
    -------
    chosen : array of int, shape (...)
        The first of equal ones; -1 where no date has data.

    Notes
    -----
    Of n values with independent normal errors of deviation s the largest is above their mean by the expected maximum
    of n normal numbers: 0.56 s for 2 dates, 1.16 s for 5. A composite of NDVI is therefore high, the more so the more
    dates it has.

    References
    ----------
    [Holben1986]_

    Examples
    --------
    >>> date_of_maximum([[0.2, 0.5, 0.4], [np.nan, -0.1, np.nan], [np.nan] * 3]).tolist()
    [1, 1, -1]
    """
    index = np.asarray(index, float)
    known = ~np.isnan(index)
    largest = np.argmax(np.where(known, index, -np.inf), axis=-1)
    # A cell whose values are all minus infinity has data as well.
    first = np.argmax(known, axis=-1)
    found = np.take_along_axis(known, largest[..., None], axis=-1)[..., 0]
    return np.where(known.any(axis=-1), np.where(found, largest, first), -1)


def values_of_date(values, chosen, missing):
    """
    Values of the date that is kept.

    Parameters
    ----------
    values : array, shape (..., date)
    chosen : array of int, shape of the values' leading dimensions, or of the last of them
        From `date_of_maximum`.
    missing : number
        Where no date is kept, in the type of the values.

    Returns
    -------
    kept : array, shape (...)

    Examples
    --------
    >>> values_of_date(np.array([[1, 2, 3], [4, 5, 6]]), np.array([2, -1]), 0).tolist()
    [3, 0]
    """
    places = np.broadcast_to(np.maximum(chosen, 0), values.shape[:-1])[..., None]
    kept = np.take_along_axis(values, places, axis=-1)[..., 0]
    return np.where(chosen < 0, np.asarray(missing, values.dtype), kept)
