"""Digital numbers: which values an instrument can record."""

import numpy as np


def check_counts(dn, largest, cure):
    """
    Raise ValueError where a value cannot be a digital number.

    Parameters
    ----------
    dn : array
        NaN is no data. [1]
    largest : int
        Largest digital number.
    cure : str
        Remedy, for the message.

    Raises
    ------
    ValueError
        If a value is negative, fractional or above ``largest``.

    Examples
    --------
    >>> check_counts([12.0, float("nan"), 255.0], 255, "type nodata=")
    >>> check_counts([12.5], 255, "type nodata=")
    Traceback (most recent call last):
    ValueError: a digital number of 12.5 is not a whole number from 0 to 255: type nodata=
    """
    dn = np.asarray(dn)
    wrong = (dn < 0) | (dn > largest)
    if dn.dtype.kind == "f":
        wrong |= (dn != np.rint(dn)) & ~np.isnan(dn)
    if np.any(wrong):
        raise ValueError(f"a digital number of {dn[wrong].flat[0]:g} is not a whole number from 0 to {largest}: {cure}")


def counts(dn, nodata, largest, cure, saturated=None):
    """
    Digital numbers as images store them: whole numbers, and 0 where there are no data.

    Parameters
    ----------
    dn : array
        Whole numbers of any type; NaN is no data. [1]
    nodata : float
        Digital number that stands for no data.
    largest : int
        Largest digital number.
    cure : str
        Remedy, for the message of `check_counts`.
    saturated : int, optional
        Digital number of saturated pixels, which become no data.

    Returns
    -------
    dn : array of uint8 up to 255, else of uint16

    Raises
    ------
    ValueError
        As in `check_counts`.

    Examples
    --------
    >>> counts([12.0, float("nan"), -9999.0, 255.0], -9999, 255, "type nodata=", saturated=255).tolist()
    [12, 0, 0, 0]
    """
    dn = np.asarray(dn)
    missing = (dn == nodata) | (np.isnan(dn) if dn.dtype.kind == "f" else False)
    kept = np.where(missing, 0, dn)
    check_counts(kept, largest, cure)
    if saturated is not None:
        kept = np.where(kept == saturated, 0, kept)
    return kept.astype(np.uint8 if largest < 256 else np.uint16)
