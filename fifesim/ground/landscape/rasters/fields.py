"""Fields that correlate, on labelled rasters."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.annotations import Chunks, WholeNumber
from fifesim.base.arguments import check
from fifesim.base.kinds import NUMBER, Kind
from fifesim.base.seeds import check_seed
from fifesim.ground.landscape.coarse_lattice import check_coarser, coarse_field
from fifesim.ground.landscape.correlations import flat, pairs_of
from fifesim.ground.landscape.covariance import Copula, correlated, field_seed
from fifesim.ground.landscape.field import TILE, mixed_field
from fifesim.ground.landscape.rasters.following import copulas
from fifesim.ground.terrain.rasters.drainage import wetness
from fifesim.ground.terrain.rasters.light import illumination
from fifesim.ground.terrain.rasters.slopes import slope
from fifesim.rasters import cf, places
from fifesim.rasters import chunks as chunking
from fifesim.rasters import grid as grids
from fifesim.rasters.crs import with_crs_of
from fifesim.rasters.sites import made_on_site

_ARPS = Kind(
    "a number for each field, such as {'lai': 0.15, 'soil': 0.24}",
    lambda arps: all(isinstance(name, str) and NUMBER.fits(arp) for name, arp in arps.items()),
)

OF_ELEVATION = ("elevation", "wetness", "illumination", "slope")
"""What correlations may name of a landscape's elevation."""


def correlated_fields(
    grid: GeoBox,
    arps: Mapping[str, float],
    correlations: Mapping | None = None,
    *,
    coarser: Mapping[str, int] | None = None,
    seed: WholeNumber = 0,
    covariates: Mapping[str, xr.DataArray] | None = None,
    reference: Mapping[str, xr.DataArray] | None = None,
    chunks: Chunks | None = None,
) -> dict[str, xr.DataArray]:
    """
    Standard normal fields that correlate with each other and with the ground.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Of ground cells, in a projected CRS.
    arps : dict of str to float
        Autoregressive parameter of each field, by its name, in [0, 0.2498]. [1]
    correlations : mapping, optional
        ``{("lai", "soil"): -0.4, ("lai", "elevation"): 0.3}``, or by name, ``{"lai": {"soil": -0.4}}``. [1]
    coarser : dict of str to int, optional
        Ground cells along a side of a cell of a field's own lattice, where it varies on a coarser one. [1]
    seed : int, optional
        In [0, 2**63). The field "lai" is that of `fifesim.lai_scene`; each other name has noise of its own.
    covariates : dict of str to xarray.DataArray, dims (y, x), optional
        Properties of the ground on the cells of the grid.
    reference : dict of str to xarray.DataArray, dims (y, x), optional
        The same properties over all of a landscape, of which the grid is a window, in cells of any size. By default
        ranks are those on the grid.
    chunks : mapping or int or "auto", optional
        Makes the fields lazy, as they are without where a covariate is.

    Returns
    -------
    fields : dict of str to xarray.DataArray, dims (y, x)
        Each the same to the bit in any chunks, and in any window of the ground that has its ``reference``; without
        covariates functions of seed and place. [1]

    Raises
    ------
    ValueError
        If correlations cannot be, with the nearest that can; where the ground is lazy, when it computes. If names are
        unknown, an arp or the seed is out of range, or rasters lie on other grids.
    TypeError
        If correlations are no mapping of pairs to numbers, or the seed is no whole number.

    Notes
    -----
    Correlations are those of standard normal scores at the same cell. The scores of the ground are by rank among at
    most 256 x 256 evenly spaced cells; where it is lazy, these are computed apart, so that none waits in memory.

    See Also
    --------
    fifesim.ground.landscape.covariance.copula, fifesim.ground.landscape.covariance.correlated

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> pairs = {("lai", "soil"): -0.4}
    >>> fields = fifesim.correlated_fields(grid, {"lai": 0.15, "soil": 0.15}, pairs, seed=7)
    >>> lai, soil = (fields[name].values.ravel() for name in ("lai", "soil"))
    >>> bool(-0.5 < np.corrcoef(lai, soil)[0, 1] < -0.3)
    True
    """
    options = {"coarser": coarser, "seed": seed, "covariates": covariates, "reference": reference, "chunks": chunks}
    return _fields(grid, arps, correlations, **options)


def _fields(grid, arps, correlations, *, coarser, seed, covariates, reference, chunks, values=None, wanted=None):
    """The same, or some of them; where ``values`` have a function of a name, with what this makes of the cells."""
    grids.check_grid(grid)
    seed = check_seed(seed)
    for name, arp in arps.items():
        check("arps", {name: arp}, _ARPS)
    coarser = _lattices(arps, coarser)
    pairs = pairs_of(correlations, list(arps), list(covariates or {}))
    covariates = {name: each for name, each in (covariates or {}).items() if any(name in pair for pair in pairs)}
    covariates = {name: _on_grid(name, each, grid) for name, each in covariates.items()}
    like = next((each.data for each in covariates.values() if each.chunks is not None), None)
    chunks = dict(zip("yx", like.chunks, strict=True)) if chunks is None and like is not None else chunks
    parts = copulas(arps, pairs, covariates, reference, tuple(name for name in arps if coarser[name] > 1))
    streams = {each: (field_seed(seed, each), arps[each], coarser[each]) for each in arps}
    fields = {}
    for name in arps if wanted is None else wanted:
        ground = {other: covariates[other] for other in covariates if (name, other) in pairs}
        field = _field(grid, name, streams, parts[name], ground, chunks, (values or {}).get(name, lambda cells: cells))
        said = f"correlated_fields: {name}, arp {arps[name]:g}, seed {seed}"
        said += f", {coarser[name]} x {coarser[name]} cells" if coarser[name] > 1 else ""
        said += "".join(f", {one}-{other} {r:g}" for (one, other), r in pairs.items() if name in (one, other))
        made = {"arp": float(arps[name]), "rng_seed": str(seed), **made_on_site(grid)}
        fields[name] = cf.label(grids.place(field, grid), "normal_score", history=said, **made).rename(name)
    return fields


def landscape_fields(
    grid,
    arps,
    covary=None,
    *,
    coarser=None,
    seed=0,
    dem=None,
    covariates=None,
    reference=None,
    geometry=None,
    time=None,
    chunks=None,
    values=None,
    wanted=None,
):
    """
    Fields of a landscape, some of which follow its elevation.

    Parameters
    ----------
    grid, arps, coarser, seed, reference, chunks
        As in `correlated_fields`.
    covary : mapping, optional
        Of the field "lai", ``{"elevation": 0.3, "soil": -0.4}``, or correlations as in `correlated_fields`. [1]
    dem : xarray.DataArray, dims (y, x), optional
        Of which the names in `OF_ELEVATION` come. [m]
    covariates : dict of str to xarray.DataArray, dims (y, x), optional
        Other properties of the ground, or one's own of these names.
    geometry, time : optional
        Of the sun, as in `fifesim.illumination`.
    values : dict of str to callable, optional
        Of fields by name, ``values[name](cells)`` gives those of a block, which it may change, in the place of its own.
    wanted : sequence of str, optional
        The fields that are made.

    Returns
    -------
    fields : dict of str to xarray.DataArray, dims (y, x)
        Standard normal, but for those with ``values``. [1]

    Raises
    ------
    ValueError
        As in `correlated_fields`, or if a name of the elevation's is given without one.
    TypeError
        As in `correlated_fields`.
    """
    covariates = dict(covariates or {})
    plain = isinstance(covary, Mapping) and {name: r for name, r in covary.items() if isinstance(name, str)}
    of_lai = {name: r for name, r in (plain or {}).items() if not isinstance(r, Mapping)}
    correlations = {name: r for name, r in covary.items() if name not in of_lai} if of_lai else covary
    if of_lai:
        correlations = correlations | {("lai", name): r for name, r in of_lai.items()}
    asked = {name for one, other, _ in flat(correlations or {}) for name in (one, other)} - set(arps) - set(covariates)
    of_dem = [name for name in OF_ELEVATION if name in asked]
    if of_dem and dem is None:
        raise ValueError(f"covary names {', '.join(of_dem)}, which the elevation tells: give dem=")
    if of_dem:
        covariates |= of_elevation(dem, of_dem, geometry=geometry, time=time)
    options = {"coarser": coarser, "seed": seed, "covariates": covariates, "reference": reference, "chunks": chunks}
    return _fields(grid, arps, correlations, values=values, wanted=wanted, **options)


def of_elevation(dem, names, *, geometry=None, time=None):
    """
    Properties of the ground that fields may follow.

    Parameters
    ----------
    dem : xarray.DataArray, dims (y, x)
        [m]
    names : sequence of str
        Of `OF_ELEVATION`.
    geometry, time : optional
        Of the sun, as in `fifesim.illumination`.

    Returns
    -------
    covariates : dict of str to xarray.DataArray, dims (y, x)
        Lazy where the elevation is.

    Raises
    ------
    ValueError
        If a name is none of them.
    """
    make = {
        "elevation": lambda: dem,
        "wetness": lambda: wetness(dem),
        "illumination": lambda: illumination(dem, geometry, time=time),
        "slope": lambda: slope(dem),
    }
    unknown = [name for name in names if name not in make]
    if unknown:
        raise ValueError(f"an elevation model says nothing of {', '.join(unknown)}: it has {', '.join(make)}")
    return {name: make[name]() for name in names}


def _on_grid(name, raster, grid):
    """A covariate on the cells of the grid."""
    cells = grids.place(xr.DataArray(np.broadcast_to(0.0, grid.shape), dims=("y", "x")), grid)
    raster = with_crs_of(raster.transpose("y", "x"), cells)
    if not grids.same_grid(grids.geobox(raster), grid):
        raise ValueError(
            f"{name} lies on another grid, {grids.in_words(grids.geobox(raster))}, than the fields, "
            f"{grids.in_words(grid)}: bring it onto theirs first"
        )
    return grids.place(xr.DataArray(raster.data, dims=("y", "x"), name=name), grid)


def _lattices(arps, coarser):
    """Ground cells along a side of a cell of each field's lattice."""
    unknown = set(coarser or {}) - set(arps)
    if unknown:
        raise ValueError(f"coarser names {', '.join(sorted(unknown))}, there are {', '.join(map(repr, arps))}")
    return {name: check_coarser((coarser or {}).get(name, 1)) for name in arps}


def _field(grid, name, streams, parts, ground, chunks, values):
    """One field, of the noises that are in it and of the ground that it follows; streams are seeds, arps and sizes."""
    # Kernels hold names, not rasters: what they hold goes with them into each worker.
    lattice, followed = grids.lattice_position(grid), tuple(ground)

    def cells(made, row, column, shape, *layers):
        found = _noise(name, streams, made, (lattice[0] + row, lattice[1] + column), shape)
        if layers:
            found = correlated(made.ground[name], found, made.covariates, dict(zip(followed, layers, strict=True)))
        return values(found)

    if isinstance(parts, Copula):
        layers = [each.values for each in ground.values()] if chunks is None else []
        # A first window raises what is refused before anything lazy is built.
        cells(parts, 0, 0, (0, 0))
        if chunks is None:
            return places.part_by_part(partial(cells, parts), grid, *layers, tile=TILE)
        if not ground:
            return places.tiles(partial(cells, parts), grid, chunks, tile=TILE)

    def kernel(rows, columns, *layers, made=None):
        if made is None:
            *layers, last = layers
            made = last.item()
        return cells(made, int(rows.flat[0]), int(columns.flat[0]), (rows.size, columns.size), *layers)

    at = [xr.DataArray(np.arange(size), dims=axis) for axis, size in zip("yx", grid.shape, strict=True)]
    if chunks is not None:
        sizes = places.chunk_sizes(grid, chunks, tile=TILE)
        at = [each.chunk({axis: part}) for each, axis, part in zip(at, "yx", sizes, strict=True)]
    if isinstance(parts, Copula):
        return chunking.pointwise(kernel, *at, *ground.values(), made=parts)
    return chunking.pointwise(kernel, *at, *ground.values(), parts)


def _noise(name, streams, made, start, shape):
    """What of a field does not follow the ground: standard normal."""
    _, arp, size = streams[name]
    known = made.coarse.get(name, {})
    if size > 1:
        return _of_coarse(known, streams, start, shape)
    weights = {streams[other][0]: weight for other, weight in made.noise[name].items()}
    own = mixed_field(weights, arp, *start, shape)
    if known:
        own *= np.sqrt(max(1.0 - sum(weight**2 for weight in known.values()), 0.0))
        own += _of_coarse(known, streams, start, shape)
    return own


def _of_coarse(weights, streams, start, shape):
    """Sum of independent fields on coarser lattices."""
    total = None
    for other, weight in weights.items():
        seed, arp, size = streams[other]
        field = coarse_field(seed, arp, size, *start, shape)
        if weight != 1.0:
            field *= weight
        total = field if total is None else np.add(total, field, out=total)
    return total
