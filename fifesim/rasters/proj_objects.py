"""Objects of PROJ: each takes a millisecond to make and belongs to the thread that made it, which keeps it."""

import re
import threading

import pyproj

_OWN = threading.local()

# More coordinate reference systems than anybody works in at once.
_MOST = 32


def transformer(source, target):
    """
    What turns coordinates of one CRS into those of another, easting or longitude first.

    Parameters
    ----------
    source, target : str, int or pyproj.CRS

    Returns
    -------
    transformer : pyproj.Transformer
        For this thread.
    """
    return _kept((source, target), lambda: pyproj.Transformer.from_crs(source, target, always_xy=True))


def projection_of(crs):
    """
    The projection of a CRS, with its factors of scale and its convergence.

    Parameters
    ----------
    crs : str or pyproj.CRS

    Returns
    -------
    projection : pyproj.Proj
        For this thread.
    """
    return _kept(crs, lambda: pyproj.Proj(crs))


def from_own_meridian(crs):
    """
    The same with longitudes from the CRS's own prime meridian: factors take none other into account.

    Parameters
    ----------
    crs : str or pyproj.CRS

    Returns
    -------
    projection : pyproj.Proj
        For this thread.
    """
    return _kept((crs, "own"), lambda: pyproj.Proj(re.sub(r"\+pm=\S+", "", pyproj.Proj(crs).srs)))


def _kept(key, make):
    known = _OWN.__dict__.setdefault("kept", {})
    found = known.get(key)
    if found is None:
        if len(known) >= _MOST:
            known.clear()
        found = known[key] = make()
    return found
