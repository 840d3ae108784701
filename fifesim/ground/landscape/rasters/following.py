"""How fields on labelled rasters go with the ground: what is known of it, and which of them wait for it."""

import dask
import dask.array as da
import numpy as np
import xarray as xr

from fifesim.ground.landscape.covariance import Copula, copula
from fifesim.rasters.sampling import all_apart

# The ground is known by at most so many rows and columns of it, evenly spaced.
SAMPLED = 256


def copulas(arps, pairs, covariates, reference, coarser):
    """
    For each field how it and those before it are put together.

    Parameters
    ----------
    arps : dict of str to float
        Of the fields. [1]
    pairs : dict of (str, str) to float
        Correlations, from `fifesim.ground.landscape.correlations.pairs_of`. [1]
    covariates : dict of str to xarray.DataArray, dims (y, x)
        The ground that is in them.
    reference : dict of str to xarray.DataArray, dims (y, x), or None
        As in `fifesim.correlated_fields`.
    coarser : tuple of str
        Names of the fields that vary on a coarser lattice.

    Returns
    -------
    copulas : dict of str to fifesim.ground.landscape.covariance.Copula, or xarray.DataArray of one, without dimensions
        Lazy arrays where the ground is lazy; fields that come before the first that follows it need not wait for it.

    Raises
    ------
    ValueError
        As in `fifesim.correlated_fields`.
    """
    whole = _copula(arps, pairs, covariates, reference, coarser)
    if isinstance(whole, Copula):
        return dict.fromkeys(arps, whole)
    order = [*coarser, *(name for name in arps if name not in coarser)]
    follows = [any((name, other) in pairs for other in covariates) for name in order]
    alone = {name: arps[name] for name in order[: follows.index(True)]}
    among = {pair: r for pair, r in pairs.items() if set(pair) <= set(alone)}
    part = copula(alone, among, {}, tuple(name for name in coarser if name in alone))
    return dict.fromkeys(arps, whole) | dict.fromkeys(alone, part)


def _copula(arps, pairs, covariates, reference, coarser):
    """How the fields are put together; where the ground is lazy, as a lazy array without dimensions."""
    known = covariates if reference is None else {name: _referred(reference, name) for name in covariates}
    sizes = {each.shape for each in known.values()}
    if len(sizes) > 1:
        raise ValueError(f"the rasters of reference have different sizes, {sizes}: take all on one grid")

    def found(*samples):
        sampled = {name: each.ravel() for name, each in zip(known, samples, strict=True)}
        return copula(arps, pairs, sampled, coarser)

    def boxed(*samples):
        out = np.empty((), object)
        out[()] = found(*samples)
        return out

    arrays = [each.data for each in known.values()]
    samples = [_evenly(each) for each in arrays]
    lazy = [each for each in samples if isinstance(each, da.Array)]
    found_apart = dict(zip(map(id, lazy), all_apart(lazy) if lazy else [], strict=True))
    samples = [found_apart.get(id(each), each) for each in samples]
    if not any(isinstance(each, da.Array) for each in arrays):
        return found(*samples)
    return xr.DataArray(da.from_delayed(dask.delayed(boxed)(*samples), (), dtype=object))


def _referred(reference, name):
    if name not in reference:
        raise ValueError(f"reference has no {name!r}, it has {', '.join(map(str, reference))}: give all that is named")
    return reference[name].transpose("y", "x")


def _evenly(array):
    steps = (max(1, -(-size // SAMPLED)) for size in array.shape)
    rows, columns = (slice(None, None, step) for step in steps)
    return array[rows, columns]
