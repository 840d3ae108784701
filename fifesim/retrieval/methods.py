"""Methods of retrieval on arrays of pixels: fit to training pixels, and estimates."""

from typing import NamedTuple

import numpy as np
from scipy import stats

from fifesim.analysis import regression
from fifesim.analysis.indices import normalized_difference
from fifesim.base.geometry import relative_azimuth
from fifesim.retrieval.inversion import (
    DRAWN_STATES,
    TABLE_ANGLES,
    axes_of,
    interpolated,
    optimal_estimation,
    simulated_tables,
    table_posterior,
)
from fifesim.retrieval.networks import Network, network, train_quantiles


class TrainingPixels(NamedTuple):
    """Training pixels."""

    reflectance: np.ndarray
    """Shape (n, bands)."""
    angles: np.ndarray
    """Zenith angles of sun and view and the relative azimuth, shape (n, 3). [degree]"""
    truth: np.ndarray
    """Shape (n, quantities)."""
    chip: np.ndarray
    """Number of the chip, shape (n,)."""
    landscape: np.ndarray
    """Number of the landscape, shape (n,)."""


class Estimates(NamedTuple):
    """Estimates by pixel and quantity."""

    median: np.ndarray
    """Shape (n, quantities)."""
    sd: np.ndarray
    """Shape (n, quantities)."""
    quantiles: np.ndarray
    """Shape (n, quantities, probabilities)."""
    converged: np.ndarray | bool = True
    """Shape (n,), or True for methods without iterations."""
    diagnostics: tuple[np.ndarray, ...] = ()
    """Layers of the method, each of shape (n,)."""


def probabilities_of(levels):
    """Increasing probabilities of the ends of central intervals, with the median in their middle."""
    tails = np.sort((1 - np.asarray(levels, float)) / 2)
    return np.concatenate([tails, [0.5], 1 - tails[::-1]])


# Line on NDVI: the parameters of fifesim.analysis.regression.Regression for each quantity.
_LINE = ("slope", "intercept", "r2", "n", "residual_deviation", "x_mean", "x_sum_of_squares")


def fit_line(pixels, red_and_near_infrared):
    """Table of a line on NDVI for each quantity."""
    red, near = red_and_near_infrared
    ndvi = normalized_difference(pixels.reflectance[:, near], pixels.reflectance[:, red])
    fits = []
    for values in pixels.truth.T:
        sums = regression.row_sums(values[None], ndvi[None], values.mean(), ndvi.mean())
        fits.append(regression.fit(sums, values.mean(), ndvi.mean()))
    return {"line": np.array([[getattr(fit, name) for name in _LINE] for fit in fits]), "bands": np.array([red, near])}


def by_line(tables, reflectance, angles, levels):
    """Prediction and prediction intervals of a line on NDVI."""
    red, near = tables["bands"].astype(int)
    ndvi = normalized_difference(reflectance[:, near], reflectance[:, red])
    middle, spread, quantiles = [], [], []
    for row in tables["line"]:
        fit = regression.Regression(**dict(zip(_LINE, row, strict=True)))
        middle.append(fit.predict(ndvi))
        ends = {level: fit.prediction_interval(ndvi, level) for level in levels}
        quantiles.append([*(ends[each][0] for each in sorted(levels, reverse=True)), middle[-1]])
        quantiles[-1] += [ends[each][1] for each in sorted(levels)]
        low, high = fit.prediction_interval(ndvi, 0.5)
        spread.append((high - low) / (2 * stats.norm.ppf(0.75)))
    return Estimates(np.stack(middle, 1), np.stack(spread, 1), np.moveaxis(np.array(quantiles), 2, 0))


# Minimum number of pixels of a chip to estimate the error within it, and maximum number of members.
_FEWEST_PIXELS = 9
_MEMBERS = 20_000

# Uncertainty of the angles of a member, where they vary. [degree]
_ANGLE = 2.0


def fit_lookup(pixels, levels, seed):
    """Members of a lookup table, and the inverse square root of the covariance of their error."""
    # Within a chip, atmosphere, leaves and soil are the same. The reflectance of a member is a parabola in the first
    # quantity, fitted to the pixels of its chip. The rest is noise, blur, registration and other effects of the chain,
    # whose covariance is pooled over all chips.
    fitted, total, freedom = np.empty_like(pixels.reflectance), 0.0, 0
    order = np.argsort(pixels.chip, kind="stable")
    for at in np.split(order, np.flatnonzero(np.diff(pixels.chip[order])) + 1):
        if len(at) < _FEWEST_PIXELS:
            raise ValueError(
                f"lookup needs chips of at least {_FEWEST_PIXELS} pixels, got one of {len(at)}: its error is estimated "
                "from the pixels of each chip; use larger chips"
            )
        first = pixels.truth[at, 0]
        design = np.vander((first - first.mean()) / (first.std() or 1.0), 3)
        fitted[at] = design @ np.linalg.lstsq(design, pixels.reflectance[at], rcond=None)[0]
        rest = pixels.reflectance[at] - fitted[at]
        total, freedom = total + rest.T @ rest, freedom + len(at) - 3
    values, vectors = np.linalg.eigh(total / freedom)
    # Bands that are nearly equal keep their noise.
    scale = vectors / np.sqrt(np.maximum(values, 1e-6 * values.max()))
    chosen = np.random.default_rng(seed).permutation(len(fitted))[:_MEMBERS]
    varies = np.ptp(pixels.angles, axis=0) > _ANGLE
    members = np.hstack([fitted[chosen] @ scale, pixels.angles[chosen][:, varies] / _ANGLE])
    return {"members": members, "states": pixels.truth[chosen], "scale": scale, "varies": varies}


def by_lookup(tables, reflectance, angles, levels):
    """Posterior of the members of a lookup table."""
    measured = np.hstack([reflectance @ tables["scale"], angles[:, tables["varies"].astype(bool)] / _ANGLE])
    wanted = probabilities_of(levels)
    _, sd, quantiles, _ = table_posterior(measured, tables["members"], tables["states"], wanted)
    return Estimates(quantiles[..., len(levels)], sd, quantiles)


def fit_quantiles(pixels, levels, seed):
    """Weights of a network that gives quantiles."""
    inputs = _inputs(pixels.reflectance, pixels.angles)
    mean, spread = inputs.mean(0), inputs.std(0)
    spread = np.where(spread > 1e-6, spread, np.inf)
    centre, scale = pixels.truth.mean(0), pixels.truth.std(0)
    scale = np.where(scale > 0, scale, 1.0)
    layers = train_quantiles((inputs - mean) / spread, (pixels.truth - centre) / scale, probabilities_of(levels), seed)
    found = {"input_mean": mean, "input_spread": spread, "centre": centre, "scale": scale}
    for number, (weight, bias) in enumerate(zip(layers.weights, layers.biases, strict=True)):
        found |= {f"weight{number}": weight, f"bias{number}": bias}
    return found


def _inputs(reflectance, angles):
    """Inputs of a network: reflectance and cosines of angles."""
    return np.hstack([reflectance, np.cos(np.radians(angles))])


def by_quantiles(tables, reflectance, angles, levels):
    """Quantiles of a network."""
    inputs = (_inputs(reflectance, angles) - tables["input_mean"]) / tables["input_spread"]
    names = sorted(name for name in tables if name.startswith("weight"))
    layers = Network(
        tuple(tables[name] for name in names), tuple(tables[name.replace("weight", "bias")] for name in names)
    )
    wanted = probabilities_of(levels)
    outputs = network(inputs, layers).reshape(len(inputs), -1, len(wanted))
    quantiles = np.sort(outputs, axis=-1) * tables["scale"][:, None] + tables["centre"][:, None]
    # Standard deviation of a normal distribution with the interval whose level is nearest to 68 %.
    at = int(np.argmin(np.abs(np.asarray(levels) - 0.68)))
    level = sorted(levels, reverse=True).index(levels[at])
    width = quantiles[..., len(wanted) - 1 - level] - quantiles[..., level]
    return Estimates(quantiles[..., len(levels)], width / (2 * stats.norm.ppf((1 + levels[at]) / 2)), quantiles)


def fit_optimal_estimation(pixels, study, states, level, bands, quantities):
    """Tables of reflectance and quantities, covariances of prior and error, and the remainder of each quantity."""
    # The unknowns are the truth of the pixels, and the quantities follow them.
    unknowns = len(states)
    true, wanted = pixels.truth[:, :unknowns], pixels.truth[:, unknowns:]
    axes, angles = axes_of(true, states, pixels.angles), pixels.angles.mean(0)
    light, values = simulated_tables(study, level, bands, quantities, axes, angles)
    found = {f"axis_{name}": np.array(ends) for name, ends in axes.items()}
    modelled = np.empty_like(pixels.reflectance)
    for part in _parts(len(modelled)):
        modelled[part] = interpolated(light, _axes(found), true[part], _given(found, pixels.angles[part]))[0]
    # Noise, blur, registration, variation within pixels and properties that are not unknowns. Blur mixes a pixel with
    # its neighbours, so that the error decreases with the state.
    rest = pixels.reflectance - modelled
    light[(0,) * len(axes)] += rest.mean(0)
    whole = np.cov(np.hstack([true, rest]).T)
    found |= {"reflectance": light, "quantities": values, "prior_mean": true.mean(0)}
    found |= {"prior_covariance": whole[:unknowns, :unknowns], "cross_covariance": whole[:unknowns, unknowns:]}
    found |= {"error_covariance": whole[unknowns:, unknowns:] + 1e-10 * np.eye(rest.shape[1])}
    some = slice(None, None, -(-len(true) // _MEMBERS))
    return found | _remainder(found, pixels.reflectance[some], pixels.angles[some], wanted[some])


def _remainder(tables, reflectance, angles, truth):
    """Regression of the truth less the table on state and misfit, and error by decile of the estimate."""
    values, sd, inputs, *_ = _solved(tables, reflectance, angles)
    found = {"remainder": np.linalg.lstsq(inputs, truth - values, rcond=None)[0]}
    values += inputs @ found["remainder"]
    parts = [np.array_split(order, _DECILES) for order in np.argsort(values, axis=0, kind="stable").T]

    def by_decile(each, power=1):
        means = [[np.mean(own[at] ** power) for at in part] for own, part in zip(each.T, parts, strict=True)]
        return np.array(means).T ** (1 / power)

    found |= {"decile": by_decile(values), "offset": by_decile(truth - values)}
    spread = by_decile((truth - values - _at_decile(found, "offset", values)) / sd, power=2)
    return found | {"spread": np.maximum(spread, 1e-6)}


_DECILES = 10


def _at_decile(tables, name, values):
    """Values of a table between the deciles of the estimate, and those of the outermost deciles beyond."""
    columns = zip(values.T, tables["decile"].T, tables[name].T, strict=True)
    return np.stack([np.interp(*each) for each in columns], axis=1)


def by_optimal_estimation(tables, reflectance, angles, levels):
    """Estimate with the remainder of each quantity, and its normal distribution with the spread of its decile."""
    values, sd, inputs, converged, layers = _solved(tables, reflectance, angles)
    values += inputs @ tables["remainder"]
    median, sd = values + _at_decile(tables, "offset", values), sd * _at_decile(tables, "spread", values)
    score = stats.norm.ppf(probabilities_of(levels))
    return Estimates(median, sd, median[..., None] + sd[..., None] * score, converged, tuple(layers.T))


def _solved(tables, reflectance, angles):
    """Quantities of the most probable state, their posterior deviation, inputs of the remainder and diagnostics."""
    axes, prior, unknowns, parts = _axes(tables), tables["prior_mean"], len(tables["prior_mean"]), []
    # The linear estimate about the prior as the first guess saves a step.
    light, slope = interpolated(tables["reflectance"], axes, prior[None], axes[None, unknowns:].mean(-1))
    both = slope[0] @ tables["prior_covariance"] + tables["cross_covariance"].T
    whole = both @ slope[0].T + slope[0] @ tables["cross_covariance"] + tables["error_covariance"]
    first = prior + (reflectance - light) @ np.linalg.solve(whole, both)
    for part in _parts(len(reflectance)):
        given = _given(tables, angles[part])

        def forward(states, pixels, given=given):
            return interpolated(tables["reflectance"], axes, states, given[pixels])

        found = optimal_estimation(
            reflectance[part],
            forward,
            prior,
            tables["prior_covariance"],
            tables["error_covariance"],
            cross_covariance=tables["cross_covariance"],
            limits=tuple(axes[:unknowns].T),
            first=first[part],
        )
        values, slope = interpolated(tables["quantities"], axes, found.state, given)
        sd = np.sqrt(np.einsum("nqk,nkl,nql->nq", slope, found.covariance, slope))
        inputs = np.column_stack([np.ones(len(values)), found.state - prior, found.misfit])
        kernel = np.diagonal(found.averaging_kernel, axis1=1, axis2=2)
        layers = np.column_stack([found.degrees_of_freedom, found.chi_square, kernel])
        parts.append((values, sd, inputs, found.converged, layers))
    return [np.concatenate(each) for each in zip(*parts, strict=True)]


def diagnostics_of(tables):
    """Names of the diagnostics of a method."""
    if "prior_mean" not in tables:
        return ()
    kernels = (f"averaging_kernel_{name}" for name in _names(tables)[: len(tables["prior_mean"])])
    return "degrees_of_freedom", "chi_square", *kernels


# Pixels whose tables are contracted at once, so that they stay in the cache of the processor.
_AT_ONCE = 512


def _parts(count):
    """Slices of pixels."""
    return [slice(start, start + _AT_ONCE) for start in range(0, count, _AT_ONCE)]


def _names(tables):
    """Names of the axes of the tables, in order."""
    return [name for name in ("lai", *DRAWN_STATES, *TABLE_ANGLES) if f"axis_{name}" in tables]


def _axes(tables):
    """Lowest and highest value along each axis, shape (axes, 2)."""
    return np.stack([tables[f"axis_{name}"] for name in _names(tables)])


def _given(tables, angles):
    """Angles along axes of the tables, shape (n, axes)."""
    names = _names(tables)
    return angles[:, [at for at, name in enumerate(TABLE_ANGLES) if name in names]]


# Shape of each table by method. A figure is a length, and a letter one that is the same in all tables: b of bands, i of
# inputs, q of quantities, l of levels, o of outputs, m of measurements.
_SHAPES = {
    "": "prior_range:2q angle_range:23 stretch:ql domain_mean:b domain_scale:bb domain_radius:",
    "line": "line:q7 bands:2",
    "lookup": "members:km states:kq scale:bb varies:3",
    "quantiles": "input_mean:i input_spread:i centre:q scale:q weight0:ih bias0:h weight1:hg bias1:g weight2:go "
    "bias2:o",
    "optimal-estimation": "error_covariance:bb cross_covariance:ub prior_mean:u prior_covariance:uu remainder:rq "
    "decile:dq offset:dq spread:dq",
}

# Lowest and highest value of tables.
_POSITIVE = np.nextafter(0, 1), np.inf
_RANGES = {"prior_range:2q": (0, 20), "angle_range:23": (0, 180), "stretch:ql": (0, np.inf)}
_RANGES |= {"domain_radius:": (0, np.inf), "varies:3": (0, 1), "input_spread:i": _POSITIVE, "scale:q": _POSITIVE}
_RANGES |= {"spread:dq": _POSITIVE}

# Columns of the table of a line: number of pixels, residual deviation and sum of squares.
_NOT_NEGATIVE = [_LINE.index(name) for name in ("n", "residual_deviation", "x_sum_of_squares")]


def check_tables(method, tables, bands, quantities, levels):
    """Raise ValueError for tables of a file that are missing or unknown, or whose shape or values are impossible."""
    wanted = f"{_SHAPES['']} {_SHAPES[method]}".split()
    if method == "optimal-estimation":
        nodes = "ABCDEFGHI"[: len(axes := _names(tables))]
        wanted += [*(f"axis_{name}:2" for name in axes), f"reflectance:{nodes}b", f"quantities:{nodes}q"]
    if odd := sorted({each.partition(":")[0] for each in wanted} ^ tables.keys()):
        raise ValueError(f"the table {odd[0]} is {'unknown' if odd[0] in tables else 'missing'}")
    sizes = {"b": bands, "i": bands + 3, "q": quantities, "l": levels, "o": quantities * (2 * levels + 1)}
    sizes["m"] = bands + np.count_nonzero(tables.get("varies"))
    sizes["r"] = 1 + bands + np.size(tables.get("prior_mean"))
    for each in wanted:
        name, _, shape = each.partition(":")
        values, (lowest, highest) = tables[name], _RANGES.get(each, (-np.inf, np.inf))
        ends = zip(shape, values.shape, strict=False)
        known = (int(end) if end.isdigit() else sizes.setdefault(end, size) for end, size in ends)
        if values.ndim != len(shape) or values.shape != tuple(known) or values.dtype != float:
            raise ValueError(f"the table {name} has the shape {values.shape} and the type {values.dtype}")
        # An input that does not vary has an infinite spread.
        is_known = np.isfinite(values) | (name == "input_spread")
        if not (is_known & (values >= lowest) & (values <= highest)).all():
            raise ValueError(f"the table {name} has values that are not finite or out of range")
        if (name.startswith("axis_") or name.endswith(("_range", "decile"))) and (np.diff(values, axis=0) < 0).any():
            raise ValueError(f"the table {name} has an upper end below the lower end")
    if method == "line" and not (
        ((tables["bands"] >= 0) & (tables["bands"] < bands)).all() and (tables["line"][:, _NOT_NEGATIVE] >= 0).all()
    ):
        raise ValueError("the tables line and bands have values out of range")


FITS = {"lookup": fit_lookup, "quantiles": fit_quantiles}
"""Functions that fit a method to training pixels alone, by its name."""

ESTIMATORS = {
    "line": by_line,
    "lookup": by_lookup,
    "quantiles": by_quantiles,
    "optimal-estimation": by_optimal_estimation,
}
"""Functions that estimate with the tables of a method, by its name."""


def stretch_factors(estimates, truth, landscape, levels):
    """
    Factors on both halves of each interval, by which it holds its share of unseen landscapes.

    Parameters
    ----------
    estimates : Estimates
        Estimates of pixels that were not used to fit the method.
    truth : array, shape (n, quantities)
    landscape : array, shape (n,)
        Every landscape has the same weight.
    levels : sequence of float

    Returns
    -------
    factors : array, shape (quantities, levels)

    References
    ----------
    Conformalised quantile regression, [RomanoPattersonCandes2019]_, relative to the half-widths
    """
    _, number, count = np.unique(landscape, return_inverse=True, return_counts=True)
    weight = 1 / count[number]
    found = np.empty((truth.shape[1], len(levels)))
    for kind in range(truth.shape[1]):
        for at, level in enumerate(levels):
            low, high = ends_of(estimates.quantiles, levels, level)
            low, high = (estimates.median - low)[:, kind], (high - estimates.median)[:, kind]
            error = truth[:, kind] - estimates.median[:, kind]
            half = np.maximum(np.where(error < 0, low, high), 1e-9)
            share = np.abs(error) / half
            order = np.argsort(share, kind="stable")
            reached = np.cumsum(weight[order]) / weight.sum()
            found[kind, at] = share[order][min(np.searchsorted(reached, level), len(order) - 1)]
    return found


def ends_of(quantiles, levels, level):
    """Ends of the interval of a level, shapes (n, quantities)."""
    at = sorted(levels, reverse=True).index(level)
    return quantiles[..., at], quantiles[..., quantiles.shape[-1] - 1 - at]


def domain_of(reflectance):
    """Mean, inverse square root of the covariance and largest Mahalanobis distance of the training spectra."""
    # One in a thousand training pixels is farther away.
    mean = reflectance.mean(0)
    values, vectors = np.linalg.eigh(np.atleast_2d(np.cov(reflectance.T)))
    scale = vectors / np.sqrt(np.maximum(values, 1e-8 * values.max()))
    distance = np.sqrt((((reflectance - mean) @ scale) ** 2).sum(1))
    return {"domain_mean": mean, "domain_scale": scale, "domain_radius": np.array(np.quantile(distance, 0.999))}


def is_outside(tables, reflectance):
    """Whether spectra are outside of the training spectra."""
    distance = (((reflectance - tables["domain_mean"]) @ tables["domain_scale"]) ** 2).sum(1)
    return np.sqrt(distance) > tables["domain_radius"]


# Below this zenith angle of the view, its azimuth has no effect. [degree]
_NADIR = 0.5


def angles_of(sza, saa, vza, vaa):
    """Zenith angles of sun and view and relative azimuth, which is 0 near nadir, shape (..., 3). [degree]"""
    return np.stack([sza, vza, np.where(np.asarray(vza) < _NADIR, 0.0, relative_azimuth(saa, vaa))], axis=-1)
