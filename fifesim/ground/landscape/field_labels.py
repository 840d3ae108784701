"""Correlated fields on labelled rasters: leaf area and properties that vary with the terrain."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import dask
import dask.array as da
import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.arguments import NUMBER, Chunks, Kind, WholeNumber, check
from fifesim.base.lattice import check_seed
from fifesim.grids import cf, windows
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.chunks import all_apart
from fifesim.grids.grid import with_crs_of
from fifesim.grids.sites import made_on_site
from fifesim.ground.landscape.autoregression import FIELD_TILE, check_coarser, coarse_field, mixed_field
from fifesim.ground.landscape.classes import SHARES
from fifesim.ground.landscape.covariance import Copula, copula, correlated, field_seed, flat, pairs_of
from fifesim.ground.landscape.distribution import quantile_map, quantile_table
from fifesim.ground.terrain.labels import illumination, slope, wetness

# Maximum number of evenly spaced rows and columns at which ground properties are sampled.
SAMPLED = 256


def copulas(arps, pairs, covariates, reference, coarser):
    """Copula of each field with the fields before it; lazy where the ground is lazy."""
    # Lazy fields that do not depend on the ground do not wait for it.
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
    """Copula of the fields; where the ground is lazy, a lazy array without dimensions."""
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

    samples = [_evenly(raster.data) for raster in known.values()]
    lazy = [sample for sample in samples if isinstance(sample, da.Array)]
    if not lazy:
        return found(*samples)
    apart = iter(all_apart(lazy))
    samples = [next(apart) if isinstance(sample, da.Array) else sample for sample in samples]
    return xr.DataArray(da.from_delayed(dask.delayed(boxed)(*samples), (), dtype=object))


def _referred(reference, name):
    if name not in reference:
        raise ValueError(f"reference has no {name!r}, it has {', '.join(map(str, reference))}: give all that is named")
    return reference[name].transpose("y", "x")


def _evenly(array):
    return array[tuple(slice(None, None, max(1, -(-size // SAMPLED))) for size in array.shape)]


_ARPS = Kind(
    "a number for each field, such as {'lai': 0.15, 'soil': 0.24}",
    lambda arps: all(isinstance(name, str) and NUMBER.fits(arp) for name, arp in arps.items()),  # type: ignore[misc]
)

OF_ELEVATION = ("elevation", "wetness", "illumination", "slope")  # terrain properties that correlations may name


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
    Simulate standard normal fields that correlate with each other and with ground properties.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox
        Grid of the ground cells, in a projected CRS.
    arps : dict of str to float
        Autoregressive parameter of each field, by its name, in [0, 0.2498]. [1]
    correlations : mapping, optional
        ``{("lai", "soil"): -0.4, ("lai", "elevation"): 0.3}``, or by name, ``{"lai": {"soil": -0.4}}``. [1]
    coarser : dict of str to int, optional
        Ground cells per lattice cell along each side, for fields on a coarser lattice. [1]
    seed : int, optional
        Seed, in [0, 2**63). The field "lai" equals the field of `fifesim.lai_scene`; every other name has independent
        noise.
    covariates : dict of str to xarray.DataArray, dims (y, x), optional
        Ground properties on the cells of the grid.
    reference : dict of str to xarray.DataArray, dims (y, x), optional
        The same properties for a larger area that contains the grid, with cells of any size. Ranks refer to this area;
        by default to the grid.
    chunks : mapping or int or "auto", optional
        Chunks of lazy fields. Fields are also lazy if a covariate is.

    Returns
    -------
    fields : dict of str to xarray.DataArray, dims (y, x)
        Identical for any chunks, and in any window with the same ``reference``. Without covariates, fields depend only
        on seed and position. [1]

    Raises
    ------
    ValueError
        If correlations are impossible; the message gives the closest feasible value, for lazy ground when it is
        computed. If names are unknown, an arp or the seed is out of range, or rasters have different grids.
    TypeError
        If `correlations` does not map pairs to numbers, or the seed is not an integer.

    Notes
    -----
    Correlations refer to standard normal scores of the same cell. Scores of ground properties are computed from ranks
    among at most 256 x 256 evenly spaced cells. For a lazy ground, these cells are computed separately to limit memory.

    See Also
    --------
    fifesim.ground.landscape.covariance.copula, fifesim.ground.landscape.covariance.correlated

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> pairs = {("lai", "soil"): -0.4}
    >>> fields = fifesim.ground.correlated_fields(grid, {"lai": 0.15, "soil": 0.15}, pairs, seed=7)
    >>> lai, soil = (fields[name].values.ravel() for name in ("lai", "soil"))
    >>> bool(-0.5 < np.corrcoef(lai, soil)[0, 1] < -0.3)
    True
    """
    return _fields(grid, arps, correlations, coarser, seed, covariates, reference, chunks)


def _fields(grid, arps, correlations, coarser, seed, covariates, reference, chunks, values=None, wanted=None):
    """Fields as in `correlated_fields`, only the wanted ones, each mapped by the function of its name in ``values``."""
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
        history = f"correlated_fields: {name}, arp {arps[name]:g}, seed {seed}"
        history += f", {coarser[name]} x {coarser[name]} cells" if coarser[name] > 1 else ""
        history += "".join(f", {one}-{other} {r:g}" for (one, other), r in pairs.items() if name in (one, other))
        made = {"arp": float(arps[name]), "rng_seed": str(seed), **made_on_site(grid)}
        fields[name] = cf.label(grids.place(field, grid), "normal_score", history=history, **made).rename(name)
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
    chunks=None,
    values=None,
    wanted=None,
):
    """Fields of a landscape that may follow its elevation, dims (y, x), standard normal without ``values``. [1]"""
    covariates = dict(covariates or {})
    plain = isinstance(covary, Mapping) and {name: r for name, r in covary.items() if isinstance(name, str)}
    of_lai = {name: r for name, r in (plain or {}).items() if not isinstance(r, Mapping)}
    correlations = {name: r for name, r in covary.items() if name not in of_lai} if of_lai else covary
    if of_lai:
        correlations = correlations | {("lai", name): r for name, r in of_lai.items()}
    named = {name for one, other, _ in flat(correlations or {}) for name in (one, other)} - set(arps) - set(covariates)
    of_dem = [name for name in OF_ELEVATION if name in named]
    if of_dem and dem is None:
        raise ValueError(f"covary names {', '.join(of_dem)}, which needs an elevation: give dem=")
    if of_dem:
        covariates |= of_elevation(dem, of_dem, geometry=geometry)
    return _fields(grid, arps, correlations, coarser, seed, covariates, reference, chunks, values, wanted)


def of_elevation(dem, names, *, geometry=None):
    """Ground properties with which fields may correlate, dims (y, x), lazy if the elevation is."""
    make = {
        "elevation": lambda: dem,
        "wetness": lambda: wetness(dem),
        "illumination": lambda: illumination(dem, geometry),
        "slope": lambda: slope(dem),
    }
    unknown = [name for name in names if name not in make]
    if unknown:
        raise ValueError(f"{', '.join(unknown)} cannot be computed from an elevation model: use {', '.join(make)}")
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
    """Size of the lattice cells of each field, in ground cells."""
    unknown = set(coarser or {}) - set(arps)
    if unknown:
        raise ValueError(f"coarser names {', '.join(sorted(unknown))}, there are {', '.join(map(repr, arps))}")
    return {name: check_coarser((coarser or {}).get(name, 1)) for name in arps}


def _field(grid, name, streams, parts, ground, chunks, values):
    """One field from its noises and the correlated ground; streams are seeds, arps and sizes."""
    # Kernels refer to names, not rasters, because they are copied to each worker.
    lattice, followed = grids.lattice_position(grid), tuple(ground)

    def cells(made, row, column, shape, *layers):
        found = _noise(name, streams, made, (lattice[0] + row, lattice[1] + column), shape)
        if layers:
            found = correlated(made.ground[name], found, made.covariates, dict(zip(followed, layers, strict=True)))
        return values(found)

    if isinstance(parts, Copula):
        layers = [each.values for each in ground.values()] if chunks is None else []
        # A first window raises errors before anything lazy is built.
        cells(parts, 0, 0, (0, 0))
        if chunks is None:
            return windows.part_by_part(partial(cells, parts), grid, *layers, tile=FIELD_TILE)
        if not ground:
            return windows.tiles(partial(cells, parts), grid, chunks, tile=FIELD_TILE)

    def kernel(rows, columns, *layers, made=None):
        if made is None:
            *layers, last = layers
            made = last.item()
        return cells(made, int(rows.flat[0]), int(columns.flat[0]), (rows.size, columns.size), *layers)

    at = [xr.DataArray(np.arange(size), dims=axis) for axis, size in zip("yx", grid.shape, strict=True)]
    if chunks is not None:
        sizes = windows.chunk_sizes(grid, chunks, tile=FIELD_TILE)
        at = [each.chunk({axis: part}) for each, axis, part in zip(at, "yx", sizes, strict=True)]
    if isinstance(parts, Copula):
        return chunking.pointwise(kernel, *at, *ground.values(), made=parts)
    return chunking.pointwise(kernel, *at, *ground.values(), parts)


def _noise(name, streams, made, start, shape):
    """Part of a field that is independent of the ground, standard normal."""
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


def drawn_fields(grid, drawn, covary, arps, *, dem=None, geometry=None, seed=0, reference=None, chunks=None):
    """Standard normal fields of a landscape: leaf area scores by arp, and properties by name, dims (y, x)."""
    for name in set(covary or {}) & {"soil", *SHARES} - set(drawn):
        raise ValueError(
            f"covary names {name}, which is no random field: give {name}=fifesim.ground.Field(mean=..., sd=...), or "
            "remove it"
        )
    # Properties of the elevation are computed once for all fields.
    named = [name for name in OF_ELEVATION if name in (covary or {}) and dem is not None]
    fields = partial(
        landscape_fields,
        grid,
        coarser={name: each.coarser for name, each in drawn.items()},
        seed=seed,
        covariates=of_elevation(dem, named, geometry=geometry),
        reference=reference,
        chunks=chunks,
        dem=dem,
        geometry=geometry,
        values={name: values_of(name, each) for name, each in drawn.items()},
    )
    others = {name: each.arp for name, each in drawn.items()}
    if not covary:
        made = [fields(others)] if others else [{}]
    else:
        # Leaf area comes last: it includes noise of the other fields, which do not change.
        made = [
            fields({**others, "lai": arp}, covary, wanted=["lai"] if number else None)
            for number, arp in enumerate(dict.fromkeys(arps))
        ]
    leaf_area = {arp: fields["lai"] for arp, fields in zip(dict.fromkeys(arps), made, strict=False) if covary}
    return leaf_area, {name: labelled(name, each, made[0][name]) for name, each in drawn.items()}


def values_of(name, given):
    """Function that maps standard normal scores to a property in place."""
    if name in SHARES:
        return partial(_share, quantile_table(given.distribution(name)))
    return partial(_normal, given.mean, given.sd)


def _share(table, scores):
    return quantile_map(scores, table, out=scores)


def _normal(mean, deviation, scores):
    scores *= deviation
    if mean:
        scores += mean
    return scores


def labelled(name, given, values):
    """Raster of a property that varies as a random field."""
    spread = "by quantiles" if name in SHARES else f"standard deviation {given.sd:g}"
    return cf.label(values, name, source=values, history=f"{name}: {spread}")
