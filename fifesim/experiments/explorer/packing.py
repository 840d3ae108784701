"""Arrays as text within a page."""

import base64
import zlib

import numpy as np

# As a page reads them: bytes, pairs of bytes with all low ones first, and numbers of four or eight bytes.
_KINDS = {np.dtype("u1"): "u1", np.dtype("u2"): "u2", np.dtype("f4"): "f4", np.dtype("f8"): "f8"}
_ALIGNED = 8
# Of steps: 0 is kept for what has no data.
_LEVELS = {"u1": 254, "u2": 65534}


def packed(arrays):
    """
    Arrays as one text.

    Parameters
    ----------
    arrays : mapping of str to array
        Unsigned integers of 8 or 16 bits, or floats of 32 or 64.

    Returns
    -------
    text : str
        Base64 of a zlib stream, of which every array begins at a multiple of eight bytes.
    places : dict of str to dict
        ``kind``, ``shape`` and ``start`` [byte] of each.

    Raises
    ------
    ValueError
        If an array is of another type.

    Examples
    --------
    >>> packed({"a": np.zeros(3, np.uint8), "b": np.ones((2, 1))})[1]["b"]
    {'kind': 'f8', 'shape': [2, 1], 'start': 8}
    """
    whole, places = bytearray(), {}
    for name, array in arrays.items():
        if array.dtype not in _KINDS:
            raise ValueError(f"{name} is of type {array.dtype}: packed takes uint8, uint16, float32 or float64")
        kind = _KINDS[array.dtype]
        places[name] = {"kind": kind, "shape": list(array.shape), "start": len(whole)}
        little = np.ascontiguousarray(array).astype(f"<{kind}").tobytes()
        # High bytes beside each other are nearly all alike.
        whole += little[::2] + little[1::2] if kind == "u2" else little
        whole += bytes(-len(whole) % _ALIGNED)
    return base64.b64encode(zlib.compress(bytes(whole), 9)).decode("ascii"), places


def stepped(values, kind):
    """
    Values in equal steps.

    Parameters
    ----------
    values : array
        NaN where there are none.
    kind : {"u1", "u2"}

    Returns
    -------
    codes : array, shape of values
        0 where there is no value, else :math:`1 + (v - v_{min}) / s`, rounded.
    low, step : float
        :math:`v_{min}` and s.

    Examples
    --------
    >>> codes, low, step = stepped(np.array([0.0, 127.0, 254.0, np.nan]), "u1")
    >>> codes.tolist(), low, step
    ([1, 128, 255, 0], 0.0, 1.0)
    """
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    step = (high - low) / _LEVELS[kind] or 1.0
    codes = np.where(np.isfinite(values), 1 + np.rint((values - low) / step), 0)
    return codes.astype(kind), low, step
