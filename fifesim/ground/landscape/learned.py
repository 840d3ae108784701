"""Leaf area of a learned landscape: its response to the terrain, and residual fields by place."""

import numpy as np
from scipy.interpolate import BSpline

from fifesim.base.arrays import compiled, jitable
from fifesim.ground.landscape.autoregression import white_noise
from fifesim.ground.landscape.covariance import field_seed

GUST_LENGTHS = {"broad": 300.0, "medium": 100.0, "fine": 25.0, "benches": 200.0}
"""Spacing of the random fields that change the standard deviation of the residual from place to place. [m]"""

FINE = 40.0
"""Spacing up to which the fields of the residual follow the fine gusts. [m]"""

_TAPS = 4  # of a cubic spline


def terrain_response(landscape, forms):
    """Mean score and logarithm of the standard deviation of the residual by the forms of the land, 0 where unknown."""
    mean, spread = (np.zeros(forms["elevation"].shape) for _ in range(2))
    for each in landscape.terrain:
        form = forms[each.form]
        mean += np.interp(form, each.nodes, each.mean)
        spread += np.interp(form, each.nodes, each.spread)
    beds = landscape.beds
    if beds is not None:
        mean += _between(forms["elevation"], beds.elevation, forms["slope_40"], beds.slope, np.array(beds.mean))
    known = np.isfinite(forms["elevation"])
    return np.where(known, mean, 0.0), np.where(known, spread, 0.0)


def _between(one, rows, other, columns, table):
    """Bilinear interpolation of a table, constant beyond its edges."""
    (i, u), (j, v) = (_node(np.nan_to_num(x), np.asarray(nodes)) for x, nodes in ((one, rows), (other, columns)))
    low, high = ((1 - v) * table[i + k, j] + v * table[i + k, j + 1] for k in (0, 1))
    return (1 - u) * low + u * high


def _node(x, nodes):
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
    drawn = {
        name: deviation * spline_noise(field_seed(seed, f"gust {name}"), GUST_LENGTHS[name], northing, easting)
        for name, deviation in gusts.items()
        if deviation
    }
    broad = spread + sum(drawn.get(name, 0.0) for name in ("broad", "medium"))
    # The mean of exp(2 g) for a normal g of variance s**2 is exp(2 s**2): the variance of the residual stays the same.
    scale = (0.0 if elevation is None else landscape.log_scale) + gusts["broad"] ** 2 + gusts["medium"] ** 2
    fine, coarse, benches = (0.0 for _ in range(3))
    for k, field in enumerate(landscape.level if elevation is None else landscape.residual):
        name, deviation = (
            field_seed(seed, f"residual {k}"),
            np.sqrt(field.variance * variance_kept(field.spacing, cell)),
        )
        if field.height:
            benches = benches + deviation * bench_noise(name, field.spacing, field.height, northing, easting, elevation)
        elif field.spacing <= FINE:
            fine = fine + deviation * spline_noise(name, field.spacing, northing, easting)
        else:
            coarse = coarse + deviation * spline_noise(name, field.spacing, northing, easting)
    total = mean + coarse * np.exp(broad - scale)
    broad = broad + drawn.get("fine", 0.0)
    scale += gusts["fine"] ** 2
    total = total + fine * np.exp(broad - scale)
    if np.ndim(benches):
        total = total + benches * np.exp(broad + drawn.get("benches", 0.0) - scale - gusts["benches"] ** 2)
    return np.where(np.isnan(elevation), np.nan, total) if elevation is not None else total


def leaf_area(landscape, scores):
    """Leaf area of scores, constant beyond the nodes; NaN stays. [m2 m-2]"""
    return np.interp(scores, landscape.scores, landscape.lai)


def variance_kept(spacing, cell):
    """Share of the variance of `spline_noise` that remains in means over cells. [1]"""
    if not cell:
        return 1.0
    lags = (np.arange(200) + 0.5) / 200
    # The autocorrelation of cubic splines with random coefficients is the spline of degree seven.
    spline = BSpline.basis_element(np.arange(9.0) - 4, extrapolate=False)
    along = np.mean(2 * (1 - lags) * np.nan_to_num(spline(lags * cell / spacing))) / float(spline(0.0))
    return along**2


def spline_noise(seed, spacing, northing, easting):
    """Standard normal field by place: a uniform cubic B-spline with random coefficients on a lattice."""
    (i, down), (j, across) = (_weights(place, spacing) for place in (-northing, easting))
    lattice = white_noise(seed, i[0], j[0], (i[-1] - i[0] + _TAPS, j[-1] - j[0] + _TAPS))
    out = np.empty((i.size, j.size))
    _expand(lattice, i - i[0], down, j - j[0], across, np.empty(lattice.shape[1]), out)
    return out


def bench_noise(seed, spacing, height, northing, easting, elevation):
    """Standard normal field by place and elevation, so that it follows contours; NaN where elevation is."""
    (i, down), (j, across) = (_weights(place, spacing) for place in (-northing, easting))
    lowest, highest = np.nanmin(elevation, initial=np.inf), np.nanmax(elevation, initial=-np.inf)
    out = np.full((i.size, j.size), np.nan)
    if not lowest <= highest:
        return out
    first, last = int(np.floor(lowest / height)), int(np.floor(highest / height))
    shape = (i[-1] - i[0] + _TAPS, j[-1] - j[0] + _TAPS)
    beds = np.stack([white_noise((seed + bed) % 2**63, i[0], j[0], shape) for bed in range(first, last + _TAPS)])
    _expand_beds(beds, first, height, elevation, i - i[0], down, j - j[0], across, np.empty(beds.shape[::2]), out)
    return out


def _weights(place, spacing):
    """First lattice row of each place and weights of the four, scaled to variance 1; places ascend."""
    first = np.floor(place / spacing)
    t = place / spacing - first
    weights = np.stack([_cubic(t, tap) for tap in range(_TAPS)], axis=1)
    return first.astype(np.int64), weights / np.sqrt(np.sum(weights**2, axis=1, keepdims=True))


@compiled
def _expand(lattice, rows, down, columns, across, line, out):
    """Interpolate a lattice to cells; ``line`` is memory."""
    for a in range(rows.size):
        for k in range(line.size):
            line[k] = 0.0
            for p in range(_TAPS):
                line[k] += down[a, p] * lattice[rows[a] + p, k]
        for b in range(columns.size):
            c = columns[b]
            out[a, b] = (
                across[b, 0] * line[c]
                + across[b, 1] * line[c + 1]
                + across[b, 2] * line[c + 2]
                + across[b, 3] * line[c + 3]
            )


@jitable
def _cubic(t, tap):
    """Weight of one of the four lattice nodes around a place in a uniform cubic B-spline, times six."""
    if tap == 0:
        return (1 - t) ** 3
    if tap == 1:
        return 3 * t**3 - 6 * t**2 + 4
    if tap == 2:
        return -3 * t**3 + 3 * t**2 + 3 * t + 1
    return t**3


@compiled
def _expand_beds(beds, first, height, elevation, rows, down, columns, across, lines, out):
    """Interpolate lattices of successive beds to cells by place and elevation; ``lines`` is memory."""
    for a in range(rows.size):
        for bed in range(beds.shape[0]):
            for k in range(beds.shape[2]):
                lines[bed, k] = 0.0
                for p in range(_TAPS):
                    lines[bed, k] += down[a, p] * beds[bed, rows[a] + p, k]
        for b in range(columns.size):
            if np.isnan(elevation[a, b]):
                continue
            place = elevation[a, b] / height
            bed = int(np.floor(place))
            t = place - bed
            total, square = 0.0, 0.0
            for q in range(_TAPS):
                weight = _cubic(t, q)
                along = 0.0
                for p in range(_TAPS):
                    along += across[b, p] * lines[bed - first + q, columns[b] + p]
                total += weight * along
                square += weight**2
            out[a, b] = total / np.sqrt(square)
