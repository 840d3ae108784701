"""Leaf area of a learned landscape: its response to the terrain, and residual fields by place."""

import numpy as np
from scipy import special
from scipy.interpolate import BSpline

from fifesim.base.arrays import compiled, jitable
from fifesim.ground.landscape.autoregression import field_seed, white_noise

PROBABILITIES = (0.005, *np.linspace(0.03, 0.97, 8).tolist(), 0.995)
"""Probabilities of the quantiles of a form of the land that are the nodes of its response."""

GUST_LENGTHS = {"broad": 300.0, "medium": 100.0, "fine": 25.0, "benches": 200.0}
"""Spacing of the random fields that change the standard deviation of the residual from place to place. [m]"""

FINE = 40.0
"""Spacing up to which the fields of the residual follow the fine gusts. [m]"""

_STRATA = 5  # of places with equal broad gusts, in covariances

_TAPS = 4  # of a cubic spline

_BINS = 2048  # of a table, for the search of nodes


def terrain_response(landscape, forms):
    """Mean score and logarithm of the standard deviation of the residual by the forms of the land, 0 where unknown."""
    both = np.zeros((2, *forms["elevation"].shape))
    for each in landscape.terrain:
        _add_table(forms[each.form], each.nodes, (each.mean, each.spread), both)
    mean, spread = both
    beds = landscape.beds
    if beds is not None:
        mean += _between(forms["elevation"], beds.elevation, forms["slope_40"], beds.slope, np.array(beds.mean))
    both[:, ~np.isfinite(forms["elevation"])] = 0.0
    return mean, spread


def _add_table(x, nodes, columns, out):
    """Add columns of a table that is linear between nodes and constant beyond them, shape (columns, ...)."""
    nodes, columns = np.array(nodes), np.array(columns)
    scale = _BINS / (nodes[-1] - nodes[0])
    # The last node at or below the lower edge of each bin, from which the search begins.
    first = np.searchsorted(nodes, nodes[0] + np.arange(_BINS + 1) / scale * (1 - 1e-12), side="right") - 1
    first = np.clip(first, 0, nodes.size - 2)
    _look_up(np.ravel(x), nodes, 1 / np.diff(nodes), scale, first, columns, out.reshape(len(columns), -1))


@compiled
def _look_up(x, nodes, inverse, scale, first, columns, out):
    """Add values between nodes; NaN stays."""
    low, high, last = nodes[0], nodes[-1], nodes.size - 2
    for n in range(x.size):
        value = min(max(x[n], low), high)
        k = first[int((value - low) * scale)] if value == value else 0
        while k < last and value >= nodes[k + 1]:
            k += 1
        t = min((value - nodes[k]) * inverse[k], 1.0)
        for m in range(columns.shape[0]):
            out[m, n] += (1 - t) * columns[m, k] + t * columns[m, k + 1]


def _between(one, rows, other, columns, table):
    """Bilinear interpolation of a table, constant beyond its edges."""
    (i, u), (j, v) = (
        place_between(np.nan_to_num(x), np.asarray(nodes)) for x, nodes in ((one, rows), (other, columns))
    )
    low, high = ((1 - v) * table[i + k, j] + v * table[i + k, j + 1] for k in (0, 1))
    return (1 - u) * low + u * high


def place_between(x, nodes):
    """Last node at or below each place, and the share of the way to the next."""
    x = np.clip(x, nodes[0], nodes[-1])
    i = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
    return i, (x - nodes[i]) / (nodes[i + 1] - nodes[i])


def scores(landscape, northing, easting, seed, elevation=None, mean=0.0, spread=0.0, cell=0.0):
    """
    Scores of cells, which the landscape maps to leaf area.

    Parameters
    ----------
    landscape : fifesim.ground.landscape.description.Described
    northing, easting : arrays, shapes (y,) and (x,)
        Centres of cells. [m]
    seed : int
    elevation : array, shape (y, x), optional
        Without it the ground is level. [m]
    mean, spread : array, shape (y, x), or float
        As from `terrain_response`. [1]
    cell : float
        Width of cells over which fields are averaged. [m]

    Returns
    -------
    scores : array, shape (y, x)
        NaN where elevation is. [1]
    """
    gusts = landscape.level_gusts if elevation is None else landscape.gusts
    shape = northing.size, easting.size
    fine, coarse, benches = (np.zeros(shape) for _ in range(3))
    broad = np.full(shape, spread)

    place = northing, easting
    for k, field in enumerate(landscape.level if elevation is None else landscape.residual):
        stream = field_seed(seed, f"residual {k}")
        deviation = np.sqrt(field.variance * variance_kept(field.spacing, cell))
        if field.height:
            bench_noise(stream, field.spacing, field.height, northing, easting, elevation, deviation, benches)
        else:
            spline_noise(stream, field.spacing, northing, easting, deviation, fine if field.spacing <= FINE else coarse)
    _add_gusts("broad", gusts, seed, place, broad)
    _add_gusts("medium", gusts, seed, place, broad)
    # The mean of exp(2 g) for a normal g of variance s**2 is exp(2 s**2): the variance of the residual stays the same.
    scale = (0.0 if elevation is None else landscape.log_scale) + gusts["broad"] ** 2 + gusts["medium"] ** 2
    coarse *= np.exp(broad - scale)
    _add_gusts("fine", gusts, seed, place, broad)
    scale += gusts["fine"] ** 2
    fine *= np.exp(broad - scale)
    _add_gusts("benches", gusts, seed, place, broad)
    benches *= np.exp(broad - (scale + gusts["benches"] ** 2))
    total = coarse + fine + mean + benches
    return total if elevation is None else np.where(np.isnan(elevation), np.nan, total)


def correlation_of_scores(landscape, cell):
    """Correlation of scores of level ground at lags of rows and columns of cells, where broad gusts are equal."""
    count = int(np.ceil(4 * max(each.spacing for each in landscape.level) / cell)) + 1
    lags, total = np.arange(count) * cell, np.zeros((count, count))
    gust = spline_correlation(lags / GUST_LENGTHS["fine"])
    # The correlation of exp(g) for a normal gust g of standard deviation s is exp(-s**2 (1 - r)).
    fine = np.exp(-(landscape.level_gusts["fine"] ** 2) * (1 - gust[:, None] * gust))
    for each in landscape.level:
        along = spline_correlation(lags / each.spacing)
        variance = each.variance * variance_kept(each.spacing, cell)
        total += variance * along[:, None] * along * (fine if each.spacing <= FINE else 1.0)
    return total / total[0, 0]


def scores_of(landscape, deviates, cell):
    """Scores of level ground at normal deviates, shape (stratum, deviate), and shares of strata."""
    # Broad gusts are equal in a stratum. In each stratum, fine gusts make scores a mixture of normals.
    gusts = landscape.level_gusts
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    kept = {each.spacing: each.variance * variance_kept(each.spacing, cell) for each in landscape.level}
    smooth = sum(variance for spacing, variance in kept.items() if spacing > FINE)
    fine = np.exp(2 * (gusts["fine"] * nodes - gusts["fine"] ** 2))
    deviation = np.sqrt(smooth + (sum(kept.values()) - smooth) * fine)
    below = np.linspace(-60.0, 0.0, 6001)
    normal = special.ndtri(weights @ special.ndtr(below / deviation[:, None]) / weights.sum())
    known = normal > -8.5
    scores = np.sign(deviates) * -np.interp(-np.abs(deviates), normal[known], below[known])
    broad = np.hypot(gusts["broad"], gusts["medium"])
    nodes, weights = np.polynomial.hermite_e.hermegauss(_STRATA)
    return np.exp(broad * nodes - broad**2)[:, None] * scores, weights / weights.sum()


def _add_gusts(name, gusts, seed, place, out):
    """Add the logarithm by which the residual is stronger or weaker in places."""
    if gusts[name]:
        spline_noise(field_seed(seed, f"gust {name}"), GUST_LENGTHS[name], *place, gusts[name], out)


def leaf_area(landscape, scores):
    """Leaf area of scores, constant beyond the nodes; NaN stays. [m2 m-2]"""
    out = np.zeros(np.shape(scores))
    _add_table(scores, landscape.scores, (landscape.lai,), out)
    return out


def property_response(landscape, name, forms):
    """Part of the score of a property that follows forms of the land."""
    out = np.zeros((1, *forms["elevation"].shape))
    for each in landscape.terrain:
        if weight := landscape.properties[name].forms.get(each.form):
            # The nodes are quantiles.
            normal = weight * special.ndtri(PROBABILITIES)
            _add_table(forms[each.form], each.nodes, (normal,), out)
    return np.nan_to_num(out[0])


def property_scores(landscape, name, northing, easting, seed, residual, response=None, cell=0.0):
    """Scores of a property, standard normal for small cells, from the residual of leaf area; level without response."""
    given = landscape.properties[name]
    fields = landscape.level if response is None else landscape.residual
    out = given.leaf_area / np.sqrt(sum(each.variance for each in fields)) * residual
    out += 0.0 if response is None else response
    for k, spacing in enumerate(given.spacings):
        variance = given.own(response is not None) / len(given.spacings) * variance_kept(spacing, cell)
        stream = field_seed(seed, f"property {name} {k}")
        spline_noise(stream, spacing, northing, easting, np.sqrt(variance), out)
    return out


def variance_kept(spacing, cell):
    """Share of the variance of `spline_noise` that remains in means over cells. [1]"""
    if not cell:
        return 1.0
    lags = (np.arange(200) + 0.5) / 200
    return np.mean(2 * (1 - lags) * spline_correlation(lags * cell / spacing)) ** 2


def spline_correlation(lags):
    """Autocorrelation of `spline_noise` along an axis at lags over its spacing. [1]"""
    # For cubic splines with random coefficients, it is the spline of degree seven.
    spline = BSpline.basis_element(np.arange(9.0) - 4, extrapolate=False)
    return np.nan_to_num(spline(lags)) / float(spline(0.0))


def spline_noise(seed, spacing, northing, easting, deviation=1.0, out=None):
    """Normal field by place, added to ``out``: a uniform cubic B-spline with random coefficients on a lattice."""
    (i, down), (j, across) = (_weights(place, spacing) for place in (-northing, easting))
    lattice = white_noise(seed, i[0], j[0], (i[-1] - i[0] + _TAPS, j[-1] - j[0] + _TAPS))
    out = np.zeros((i.size, j.size)) if out is None else out
    _expand(lattice, i - i[0], deviation * down, j - j[0], across, np.empty(lattice.shape[1]), out)
    return out


def bench_noise(seed, spacing, height, northing, easting, elevation, deviation=1.0, out=None):
    """Normal field by place and elevation, added to ``out``, so that it follows contours; NaN where elevation is."""
    (i, down), (j, across) = (_weights(place, spacing) for place in (-northing, easting))
    out = np.zeros((i.size, j.size)) if out is None else out
    out[np.isnan(elevation)] = np.nan
    lowest, highest = np.nanmin(elevation, 1, initial=np.inf), np.nanmax(elevation, 1, initial=-np.inf)
    if not min(lowest) <= max(highest):
        return out
    first, last = int(np.floor(min(lowest) / height)), int(np.floor(max(highest) / height))
    shape = (i[-1] - i[0] + _TAPS, j[-1] - j[0] + _TAPS)
    noise = [white_noise((seed + bed) % 2**63, i[0], j[0], shape) for bed in range(first, last + _TAPS)]
    beds = np.stack(noise, axis=-1)
    lines = np.empty(beds.shape[1:])
    _expand_beds(
        beds, first, height, elevation, lowest, highest, i - i[0], deviation * down, j - j[0], across, lines, out
    )
    return out


def _weights(place, spacing):
    """First lattice row of each place and weights of the four, scaled to variance 1; places ascend."""
    first = np.floor(place / spacing)
    weights = np.stack([_cubic(place / spacing - first, tap) for tap in range(_TAPS)], axis=1)
    return first.astype(np.int64), weights / np.sqrt(np.sum(weights**2, axis=1, keepdims=True))


@compiled
def _expand(lattice, rows, down, columns, across, line, out):
    """Add the interpolation of a lattice to cells; ``line`` is memory."""
    for a in range(rows.size):
        for k in range(line.size):
            line[k] = 0.0
            for p in range(_TAPS):
                line[k] += down[a, p] * lattice[rows[a] + p, k]
        for b in range(columns.size):
            c = columns[b]
            out[a, b] += _weighted(across[b], line[c], line[c + 1], line[c + 2], line[c + 3])


@jitable
def _weighted(weights, a, b, c, d):
    """Sum of four values with their weights."""
    return weights[0] * a + weights[1] * b + weights[2] * c + weights[3] * d


@jitable
def _cubic(t, tap):
    """Weight of one of the four lattice nodes around a place in a uniform cubic B-spline, times six."""
    cube = t * t * t
    if tap == 0:
        return (1 - t) * (1 - t) * (1 - t)
    if tap == 1:
        return 3 * cube - 6 * (t * t) + 4
    if tap == 2:
        return -3 * cube + 3 * (t * t) + 3 * t + 1
    return cube


@compiled
def _expand_beds(beds, first, height, elevation, lowest, highest, rows, down, columns, across, lines, out):
    """Add the interpolation of lattices of successive beds by place and elevation; ``lines`` is memory."""
    for a in range(rows.size):
        if not lowest[a] <= highest[a]:
            continue
        start, stop = int(np.floor(lowest[a] / height)) - first, int(np.floor(highest[a] / height)) - first + _TAPS
        near, into = beds[rows[a] : rows[a] + _TAPS, :, start:stop], lines[:, start:stop]
        for k in range(into.shape[0]):
            for bed in range(into.shape[1]):
                into[k, bed] = _weighted(down[a], near[0, k, bed], near[1, k, bed], near[2, k, bed], near[3, k, bed])
        for b in range(columns.size):
            if np.isnan(elevation[a, b]):
                continue
            place = elevation[a, b] / height
            bed = int(np.floor(place)) - first
            t = place - np.floor(place)
            around = lines[columns[b] : columns[b] + _TAPS, bed : bed + _TAPS]
            total, square = 0.0, 0.0
            for q in range(_TAPS):
                weight = _cubic(t, q)
                total += weight * _weighted(across[b], around[0, q], around[1, q], around[2, q], around[3, q])
                square += weight**2
            out[a, b] += total / np.sqrt(square)
