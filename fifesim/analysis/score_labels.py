"""Scores of labelled estimates with uncertainty, by group, with standard errors over landscapes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial, reduce
from typing import Annotated

import numpy as np
import xarray as xr
from scipy import stats

from fifesim.analysis import scores
from fifesim.analysis.regression import totals
from fifesim.analysis.regression_labels import check_same_quantity, matched, sound_cells
from fifesim.base.arguments import RASTER, Kind, Pairing, described, is_a
from fifesim.base.messages import warn
from fifesim.grids.inputs import MASKS_TOO
from fifesim.grids.reductions import computed, sums_by_row

_BINS = 10
_LANDSCAPE = "landscape"

_DECILES = 10

# Largest number of pixels from which the edges of deciles are computed, so that memory does not grow with the map.
_SUBSET = 1_000_000

# Standard errors from which `score` warns of deciles, and misses that do not matter: share of the RMSE, and of pixels.
_SURE, _SMALL_BIAS, _SMALL_MISS = 3.0, 0.2, 0.04

# Sums of a group that precede the sums of levels: count, error, squared error, CRPS.
_FIXED = 4

By = Annotated[
    xr.DataArray | Sequence[float],
    Kind(
        "a raster of classes, or the edges of bins of the true value, such as [0, 1, 2, 4]",
        lambda by: is_a(by, "DataArray") or (isinstance(by, Sequence | np.ndarray) and not isinstance(by, str)),
        dimensions=0,
    ),
]


def score(
    estimate: Annotated[xr.DataArray | xr.Dataset, MASKS_TOO],
    truth: Annotated[xr.DataArray, RASTER._replace(dimensions=0, numbers=MASKS_TOO.numbers)],
    by: By | None = None,
    *,
    landscape: str = _LANDSCAPE,
    pair: Pairing = "coordinates",
) -> xr.Dataset:
    """
    Score an estimate and its uncertainty against the truth; computes.

    Parameters
    ----------
    estimate : xarray.Dataset or xarray.DataArray
        A map; or a Dataset with a variable named like the truth and any of: ``sd``, its standard deviation; ``low`` and
        ``high``, the ends of central intervals, with a dimension or coordinate ``level``. The name of the variable may
        come first, as in ``lai_sd``. An ensemble has a dimension ``member``. Mask pixels that must not count, for
        instance with ``estimate.where(estimate.flag == 0)``. A raster of bool is a mask, for instance of clouds; its
        truth is another mask, or the share of each pixel, 0 to 1.
    truth : xarray.DataArray, dims (y, x), or any that the estimate has
        In the unit of the estimate.
    by : xarray.DataArray or sequence of float, optional
        Groups that are scored one by one: a raster of classes, dims of the truth or some of them, or edges of bins of
        the true value.
    landscape : str, optional
        Dimension or coordinate of the truth that counts independent landscapes. Standard errors are computed over
        landscapes, and NaN with fewer than two.
    pair : {"coordinates", "index"}, optional
        How maps over (y, x) are paired, as in `regress`.

    Returns
    -------
    scores : xarray.Dataset
        ``n``, number of pixels; ``bias`` and ``rmse`` in the unit of the estimate; ``bias_se``, standard error of the
        bias; ``slope`` of truth on estimate, which is 1 for an estimate that is the expected truth. If the estimate has
        intervals, by ``level``: ``coverage``, the share of true values inside, its standard error ``coverage_se``, the
        mean ``width``, and ``interval_score``. With ``sd`` or members: ``crps``, of a normal distribution or of the
        ensemble, and ``pit``, the density of the probability integral transform in ten bins, which is 1 for a
        calibrated estimate. For a mask, ``n``, ``omission``, the share of the true area that it lacks, and
        ``commission``, the share of it that is wrong. With ``by``, a first dimension of that name. Without,
        ``bias_by_estimate`` and ``coverage_by_estimate`` for each ``decile`` of the estimate, 1 to 10,
        ``bias_by_truth`` and ``coverage_by_truth`` for each decile of the truth, and their standard errors, whose names
        end in ``_se``.

    Warns
    -----
    UserWarning
        If the bias or the coverage of a decile of the estimate misses by more than 0.2 of the RMSE or 0.04, and by more
        than three standard errors over landscapes.

    Raises
    ------
    ValueError
        If estimate and truth are different quantities, do not overlap, or the Dataset lacks the variable.

    Notes
    -----
    A pixel counts if truth, estimate and every given limit and spread are known. A lazy estimate is computed twice.

    The bias by decile of the truth is not zero for a good estimate, which is nearer to the mean of its prior.

    References
    ----------
    [GneitingRaftery2007]_

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> import xarray as xr
    >>> rng = np.random.default_rng(1)
    >>> truth = xr.DataArray(rng.normal(2, 1, (20, 500)), dims=("landscape", "pixel"), name="lai")
    >>> guess = truth + rng.normal(0, 0.3, truth.shape)
    >>> found = fifesim.score(xr.Dataset({"lai": guess, "sd": 0.3 + 0 * guess}), truth)
    >>> round(float(found.rmse), 1), bool(abs(found.pit - 1).max() < 0.2)
    (0.3, True)
    """
    if isinstance(estimate, xr.DataArray) and estimate.dtype.kind == "b":
        return _mask_scores(estimate, truth, by, pair)
    if truth.dtype.kind == "b":
        raise ValueError("the truth is a mask and the estimate is not: give a mask, such as estimate > 0.5")
    given = _parts(estimate, truth)
    check_same_quantity(given["value"], truth, ("estimate", "truth"))
    unit = truth.attrs.get("units", given["value"].attrs.get("units", "1"))
    given, truth = _paired(given, truth, pair)
    group, labels = _groups(by, truth)
    values, levels = _pixel_scores(given, truth)
    kinds = [(group, len(labels))]
    if by is None:
        kinds += [(each, _DECILES) for each in _deciles(values["error"] + truth, truth)]
    sums, *by_decile = _sums_by_landscape(values, kinds, truth, landscape, len(levels))
    if not sums[..., 0].sum():
        raise ValueError(
            "no pixel has both an estimate and a true value: do the rasters overlap, and is any pixel not flagged?"
        )
    found = _dataset(sums, levels, "crps" in values, unit)
    if "width" in found and bool((found["width"].fillna(0) == 0).all("group").any()):
        raise ValueError("low and high of a level are equal in every pixel: give both ends of the intervals")
    if by is not None:
        return found.assign_coords(group=labels).rename(group=_group_name(by, truth, found))
    found = found.isel(group=0).merge(_decile_scores(by_decile, levels, unit))
    _warn_of_deciles(found, truth.name or "truth", np.count_nonzero(by_decile[0][..., 0], axis=0))
    return found


def _mask_scores(mask, truth, by, pair):
    """Number of pixels, omission and commission of a mask, by group."""
    given, truth = _paired({"value": mask.astype(float)}, truth.astype(float), pair)
    group, labels = _groups(by, truth)
    detected, true, number = (each.transpose(*truth.dims).values for each in computed(given["value"], truth, group))
    if np.any((true < 0) | (true > 1)):
        raise ValueError(f"the truth of a mask is a share from 0 to 1, got {np.nanmin(true):g} to {np.nanmax(true):g}")
    found = np.array([scores.mask_errors(detected[number == at], true[number == at]) for at in range(len(labels))])
    n = [int(np.sum((number == at) & ~np.isnan(detected + true))) for at in range(len(labels))]
    if not sum(n):
        raise ValueError("no pixel has both an estimate and a true value: do the rasters overlap?")
    words = {"omission": "share of the true area that the mask lacks", "commission": "share of the mask that is wrong"}
    columns = [("n", n, "number of pixels"), *zip(words, found.T, words.values(), strict=True)]
    out = xr.Dataset({name: ("group", each, {"long_name": text, "units": "1"}) for name, each, text in columns})
    if by is None:
        return out.isel(group=0)
    return out.assign_coords(group=labels).rename(group=_group_name(by, truth, out))


def _group_name(by, truth, found):
    """Name of the dimension of groups, other than those of the scores, such as ``slope``."""
    name = str(by.name or "group") if isinstance(by, xr.DataArray) else f"{truth.name or 'truth'}_bin"
    return f"{name}_group" if name in found else name


def _parts(estimate, truth):
    """Value, spread, limits and members of an estimate by role."""
    if isinstance(estimate, xr.DataArray):
        return {"value": estimate}
    name = truth.name if truth.name in estimate.data_vars else None
    others = [each for each in estimate.data_vars if str(each).split("_")[-1] not in ("sd", "low", "high", "flag")]
    if name is None and len(others) == 1:
        name = others[0]
    if name is None:
        raise ValueError(
            f"estimate must have a variable {truth.name or 'of one name'}, as the truth is called, it has "
            f"{', '.join(map(str, estimate.data_vars))}: select one, or rename the truth"
        )
    found = {"value": estimate[name]}
    for role in ("sd", "low", "high"):
        own = next((each for each in (f"{name}_{role}", role) if each in estimate.data_vars), None)
        if own is not None:
            found[role] = estimate[own]
    if ("low" in found) != ("high" in found):
        raise ValueError("an interval has two ends: give both low and high")
    if "low" in found and "level" not in found["low"].coords:
        raise ValueError(
            "low and high need a coordinate level, the share of true values that they shall contain: type for instance "
            "estimate.assign_coords(level=0.95)"
        )
    return found


def _paired(given, truth, pair):
    """Rasters over (y, x) cut to their common pixels; arrays over other dimensions must have the same labels."""
    if set(truth.dims) == {"y", "x"}:
        cut, true = {}, truth
        for role, each in given.items():
            over = [dim for dim in each.dims if dim not in ("y", "x")]
            if len(over) > 1:
                raise ValueError(f"{each.name or role} has dimensions {each.dims}, the truth {truth.dims}: select one")
            layers = [each] if not over else [each.isel({over[0]: at}) for at in range(each.sizes[over[0]])]
            pairs = [matched(layer, truth, pair) for layer in layers]
            true = pairs[0][1]
            places = {axis: true[axis] for axis in ("y", "x") if axis in true.coords}
            layers = [layer.drop_vars(["y", "x"], errors="ignore").assign_coords(places) for layer, _ in pairs]
            cut[role] = layers[0] if not over else xr.concat(layers, each[over[0]]).transpose(over[0], "y", "x")
        return cut, true
    try:
        truth, *aligned = xr.align(sound_cells(truth), *given.values(), join="exact")
    except ValueError as error:
        raise ValueError(f"estimate and truth have different labels: {str(error).splitlines()[0]}") from None
    for role, each in zip(given, aligned, strict=True):
        if set(each.dims) - {"level", "member"} != set(truth.dims):
            raise ValueError(f"{role} of the estimate has dimensions {each.dims}, the truth {truth.dims}")
    return dict(zip(given, aligned, strict=True)), truth


def _groups(by, truth):
    """Number of the group of each pixel, NaN for none, and labels of the groups."""
    if by is None:
        return xr.zeros_like(truth, dtype=float), [0]
    if isinstance(by, xr.DataArray):
        try:
            by = xr.align(by, truth, join="exact")[0]
            by = by.broadcast_like(truth) if set(by.dims) <= set(truth.dims) else by
        except ValueError:
            raise ValueError("by must lie on the grid of the truth, its coordinates differ: bring it there") from None
        if set(by.dims) != set(truth.dims) or any(by.sizes[dim] != truth.sizes[dim] for dim in truth.dims):
            raise ValueError(f"by has sizes {dict(by.sizes)}, the truth {dict(truth.sizes)}: bring it onto its grid")
        by = by.transpose(*truth.dims)
        values = computed(by)[0].values
        known = values[values == values] if values.dtype.kind == "f" else values
        labels = np.unique(known)
        number = np.searchsorted(labels, values).astype(float)
        if values.dtype.kind == "f":
            number[np.isnan(values)] = np.nan
        return truth.copy(data=number), labels
    edges = np.asarray(by, float)
    if edges.ndim != 1 or edges.size < 2 or not np.all(np.diff(edges) > 0):
        raise ValueError(f"by must be increasing edges of bins, such as [0, 1, 2, 4], got {described(by)}")
    number = xr.apply_ufunc(partial(_bin, edges=edges), truth, dask="parallelized", output_dtypes=[float])
    return number, 0.5 * (edges[1:] + edges[:-1])


def _bin(values, edges):
    """Number of the bin of each value, the upper edge of the last one included; NaN outside."""
    number = np.where(values == edges[-1], edges.size - 2, np.searchsorted(edges, values, side="right") - 1.0)
    return np.where((number >= 0) & (number < edges.size - 1), number, np.nan)


def _deciles(*rasters):
    """Numbers of the deciles of rasters, 0 to 9, whose edges are from a regular subset of the pixels; computes."""
    dims = rasters[0].dims[-2:]
    step = int(np.ceil((rasters[0].size / _SUBSET) ** (1 / len(dims))))
    some = [each.isel({dim: slice(None, None, step) for dim in dims}).transpose(*rasters[0].dims) for each in rasters]
    values = np.stack([np.asarray(each, float).ravel() for each in computed(*some)])
    values = values[:, np.isfinite(values).all(axis=0)]
    if not values.size:
        return [xr.zeros_like(each, dtype=float) for each in rasters]
    inner = np.arange(1, _DECILES) / _DECILES
    edges = [np.array([-np.inf, *np.quantile(each, inner), np.inf]) for each in values]
    return [
        xr.apply_ufunc(partial(_bin, edges=own), each, dask="parallelized", output_dtypes=[float])
        for each, own in zip(rasters, edges, strict=True)
    ]


def _of_normal(function, value, sd, truth):
    """Score of a normal distribution, whose standard deviation is checked."""
    if np.any(sd < 0):
        raise ValueError(f"sd must not be negative, got {np.nanmin(sd):g}: it is a standard deviation")
    return function(value, sd, truth)


def _pixel_scores(given, truth):
    """Values of each pixel that are summed, by name, and the levels of the intervals."""
    value, values = given["value"], {}

    def each_pixel(function, *arrays, core=()):
        return xr.apply_ufunc(
            function, *arrays, input_core_dims=[list(core), *[[]] * (len(arrays) - 1)], dask="parallelized",
            output_dtypes=[float], dask_gufunc_kwargs={"allow_rechunk": True},
        )  # fmt: skip

    if "member" in value.dims:
        values["error"] = each_pixel(_mean_of_members, value, core=("member",)) - truth
        values["crps"] = each_pixel(scores.ensemble_crps, value, truth, core=("member",))
        values["pit"] = each_pixel(scores.ensemble_pit, value, truth, core=("member",))
    else:
        values["error"] = value - truth
        if "sd" in given:
            values["crps"] = each_pixel(partial(_of_normal, scores.normal_crps), value, given["sd"], truth)
            values["pit"] = each_pixel(partial(_of_normal, scores.normal_pit), value, given["sd"], truth)
    levels = np.atleast_1d(given["low"]["level"].values) if "low" in given else np.array([])
    if np.any((levels <= 0) | (levels >= 1)):
        raise ValueError(f"level must be between 0 and 1, got {levels.tolist()}: 0.95 holds 95 % of true values")
    for number, level in enumerate(levels.tolist()):
        low, high = (
            each.isel(level=number) if "level" in each.dims else each for each in (given["low"], given["high"])
        )
        inside = ((low <= truth) & (truth <= high)).astype(float)
        values[f"inside {number}"] = inside.where(low.notnull() & high.notnull())
        values[f"width {number}"] = high - low
        values[f"score {number}"] = each_pixel(partial(scores.interval_score, level=level), low, high, truth)
    middle = values["error"].astype(float) + truth
    values |= {"value": middle, "square": middle**2, "product": middle * values["error"]}
    return {name: each.drop_vars(set(each.coords) - set(each.dims)) for name, each in values.items()}, levels


def _mean_of_members(members):
    """Mean over the last axis, added in order, because numpy's order depends on the memory layout."""
    return reduce(np.add, np.moveaxis(members, -1, 0)) / members.shape[-1]


def _sums_by_landscape(values, kinds, truth, landscape, levels):
    """Sums of each landscape and group, shape (landscapes, groups, sums), for each kind of group."""
    if landscape in truth.dims:
        parts = [{landscape: slice(at, at + 1)} for at in range(truth.sizes[landscape])]
    elif landscape in truth.coords and truth[landscape].ndim == 1:
        dim, labels = truth[landscape].dims[0], truth[landscape].values
        parts = [{dim: np.flatnonzero(labels == each)} for each in np.unique(labels)]
    elif landscape == _LANDSCAPE:
        parts = [{}]
    else:
        raise ValueError(
            f"landscape: the truth has no dimension or coordinate {landscape!r}, it has {list(truth.coords)}"
        )
    pit = values.get("pit", xr.full_like(truth, np.nan, dtype=float))
    others = [each for name, each in values.items() if name != "pit"]
    names, groups = [name for name in values if name != "pit"], [count for _, count in kinds]
    kept = [names.index(f"inside {number}") for number in range(levels)]
    widths = [len(others) + 2 + _BINS] + [3 + levels] * (len(kinds) - 1)
    ends = np.cumsum([count * width for count, width in zip(groups, widths, strict=True)])
    found = []
    for part in parts:
        cells = [
            _as_rows(each.transpose(*truth.dims).isel(part)) for each in (*(kind for kind, _ in kinds), pit, *others)
        ]
        kernel = scores.sums_by_group_and_decile
        found.append(totals(sums_by_row(kernel, *cells, count=ends[-1], groups=groups, bins=_BINS, kept=kept)))
    split = np.split(np.array(found), ends[:-1], axis=1)
    return [each.reshape(len(parts), count, -1) for each, count in zip(split, groups, strict=True)]


def _as_rows(array):
    """Array of two dimensions with the cells of any."""
    data = array.data.reshape(-1, array.shape[-1]) if array.ndim > 1 else array.data.reshape(1, -1)
    return xr.DataArray(data, dims=("y", "x"))


def _dataset(sums, levels, is_probabilistic, unit):
    """Scores from sums, shape (landscapes, groups, sums)."""
    count, total = sums[..., 0], sums.sum(axis=0)
    n = total[:, 0]
    at = _FIXED if is_probabilistic else _FIXED - 1
    by_level = sums[..., at : at + 3 * len(levels)].reshape(*count.shape, len(levels), 3)
    pixels = np.broadcast_to(count[..., None], by_level.shape[:-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        found = [
            ("n", n.astype(int), "number of pixels", "1"),
            ("bias", total[:, 1] / n, "mean of estimate less truth", unit),
            ("bias_se", scores.ratio_error(sums[..., 1], count), "standard error of the bias over landscapes", unit),
            ("rmse", np.sqrt(total[:, 2] / n), "root mean square error", unit),
            (
                "slope",
                _slope(n, total[:, 1], *total[:, at + 3 * len(levels) :][:, :3].T),
                "slope of truth on estimate",
                "1",
            ),
        ]
        if is_probabilistic:
            bins = total[:, -_BINS:]
            density = bins * _BINS / bins.sum(axis=1, keepdims=True)
            found += [
                ("crps", total[:, _FIXED - 1] / n, "continuous ranked probability score", unit),
                ("pit", density, "density of the probability integral transform", "1"),
            ]
        if len(levels):
            inside, width, penalty = np.moveaxis(by_level.sum(axis=0) / n[:, None, None], -1, 0)
            error = scores.ratio_error(by_level[..., 0], pixels)
            found += [
                ("coverage", inside, "share of true values in the interval", "1"),
                ("coverage_se", error, "standard error of the coverage over landscapes", "1"),
                ("width", width, "mean width of the interval", unit),
                ("interval_score", penalty, "interval score", unit),
            ]
    coords = {"level": levels} if len(levels) else {}
    coords |= {"pit_bin": (np.arange(_BINS) + 0.5) / _BINS} if is_probabilistic else {}
    axes = {"pit": ("group", "pit_bin")}
    return xr.Dataset(
        {
            name: (axes.get(name, ("group", "level")[: values.ndim]), values, {"long_name": words, "units": units})
            for name, values, words, units in found
        },
        coords,
    )


def _slope(n, error, value, square, product):
    """Slope of truth on estimate from sums of error, estimate, its square and its product with the error."""
    variance = square - value**2 / n
    return np.where(variance > 1e-12 * square, 1 - (product - value * error / n) / variance, np.nan)


def _decile_scores(by_decile, levels, unit):
    """Bias and coverage by decile of estimate and truth, from sums of shape (landscapes, deciles, sums)."""
    found, coords = {}, {"decile": np.arange(1, _DECILES + 1)} | ({"level": levels} if len(levels) else {})
    for kind, sums in zip(("estimate", "truth"), by_decile, strict=True):
        count, error, inside = sums[..., 0], sums[..., 1], sums[..., 3:]
        pixels = np.broadcast_to(count[..., None], inside.shape)
        for name, parts, own, units in (("bias", error, count, unit), ("coverage", inside, pixels, "1")):
            if not parts.size:
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                values = parts.sum(axis=0) / own.sum(axis=0)
            dims, words = ("decile", "level")[: values.ndim], f"{name} by decile of the {kind}"
            found[f"{name}_by_{kind}"] = dims, values, {"long_name": words, "units": units}
            words = f"standard error of the {words} over landscapes"
            found[f"{name}_by_{kind}_se"] = dims, scores.ratio_error(parts, own), {"long_name": words, "units": units}
    return xr.Dataset(found, coords)


def _warn_of_deciles(found, name, landscapes):
    """Warn of deciles of the estimate whose bias or coverage is significantly wrong."""
    wrong, texts = xr.zeros_like(found["decile"], dtype=bool), []
    parts = [("bias", found["bias_by_estimate"], found["bias_by_estimate_se"], 0.0, _SMALL_BIAS * float(found["rmse"]))]
    if "coverage_by_estimate" in found:
        parts += [
            (
                f"coverage of the {100 * level:g} % interval",
                *(each.isel(level=at) for each in shares),
                level,
                _SMALL_MISS,
            )
            for shares in [(found["coverage_by_estimate"], found["coverage_by_estimate_se"])]
            for at, level in enumerate(found["level"].values.tolist())
        ]
    # As rare as three standard errors in all comparisons together. Student's t, because standard errors over few
    # landscapes are uncertain themselves.
    share = stats.norm.sf(_SURE) / (_DECILES * len(parts))
    sure = xr.DataArray(stats.t.isf(share, np.maximum(landscapes - 1, 1)), dims="decile")
    for words, values, error, expected, small in parts:
        miss = np.abs(values - expected)
        bad = (miss > sure * error) & (miss > small)
        if bad.any():
            at = int(np.nanargmax(miss.where(bad).values))
            texts.append(f"{words} {float(values[at]):.3g} ± {float(error[at]):.2g} in decile {at + 1}")
        wrong |= bad
    if texts:
        warn(
            f"the estimate of {name} is wrong in {int(wrong.sum())} of {_DECILES} deciles of the estimate: "
            f"{', '.join(texts)}; see bias_by_estimate and coverage_by_estimate, and calibrate the method or train it "
            "on landscapes like these"
        )
