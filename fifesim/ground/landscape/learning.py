"""Learning of a landscape from a map of leaf area and an elevation model."""

from typing import Any, NamedTuple

import numpy as np
from scipy import fft, ndimage, optimize, special, stats

from fifesim.ground.landscape.description import Beds, Described, Residual, TerrainResponse
from fifesim.ground.landscape.learned import GUST_LENGTHS, PROBABILITIES, place_between, scores, terrain_response
from fifesim.ground.terrain.forms import FORMS, land_forms

# Spacings of the isotropic fields. [cell of the map]
_SPACINGS = (0.5, 1, 2, 4, 8, 16, 32, 64)

# Spacings and heights of the fields that follow contours. [m]
_BENCHES = (
    (60.0, 1.2),
    (60.0, 2.5),
    (120.0, 1.2),
    (120.0, 2.5),
    (120.0, 5.0),
    (250.0, 2.5),
    (250.0, 5.0),
    (500.0, 5.0),
    (500.0, 10.0),
    (1000.0, 10.0),
)

LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)
"""Distances of pairs. [cell]"""

_SIDE = 64
"""Cells along the squares whose spectra are averaged."""

# Ground cells along a cell of the map.
_FINER = 3

# Penalties of the responses of the mean and of the logarithm of the variance, in cells of one node.
_RIDGE, _SPREAD_RIDGE = 100.0, 300.0

_BED_HEIGHT = 1.5  # m
_PROBABILITIES = np.r_[0.0, 0.002, 0.005, np.linspace(0.01, 0.99, 99), 0.995, 0.998, 1.0]
_STEPS = 6

# Largest factor between the statistics that are fitted and the statistics of the residual.
_CHANGE = 3.0

LEAST_CELLS = 2000

# Nodes of the slope at which the response to beds is known.
_STEEPNESS = [0, 1, -2, -1]

# Classes of pairs by their step in elevation.
_THIRDS = 3

# Squares that are left out together, and groups of squares. [m], [1]
_SQUARE, _GROUPS = 600.0, 5

# Width of the Gaussian windows in which variances at short distances are compared. [cell]
_WIDE = 8.0
# Least variance of a field.
_LEAST = 1e-4


def learn(lai, values, elevation, cell, origin, blur, noise, source):
    """
    Landscape learned from arrays.

    Parameters
    ----------
    lai : array, shape (y, x)
        NaN where unknown. [m2 m-2]
    values : array, shape (y, x)
        The map that leaf area was derived from, or leaf area, in any unit.
    elevation : array, shape (y, x), or None
        On the same cells. [m]
    cell : float
        Width of the square cells. [m]
    origin : (float, float)
        Northing and easting of the upper left corner. [m]
    blur : callable
        Modulation transfer of the map, ``blur(down, across)`` with arrays of frequencies. [m-1]
    noise : float
        Standard deviation of the noise of the map, in its unit.
    source : str

    Returns
    -------
    landscape : fifesim.ground.landscape.description.Described
    """
    known = np.isfinite(lai) if elevation is None else np.isfinite(lai) & np.isfinite(elevation)
    check_enough(known)
    image = _Image(cell, origin, blur, known, elevation, pair_orders(known, elevation), noise / values[known].std())
    still, forms = dict.fromkeys(GUST_LENGTHS, 0.0), None
    found = Described(source=source, cell=cell, gusts=still, level_gusts=still, scores=(-9.0, 9.0), lai=(0.0, 1.0))
    isotropic = [(float(spacing * cell), 0.0) for spacing in _SPACINGS]
    level, gusts = _residual(found, image._replace(elevation=None, orders=None), values, 0.0, isotropic, None)
    found = found.model_copy(update={"level": level, "level_gusts": gusts})
    if elevation is not None:
        forms = land_forms(np.where(known, elevation, np.nan), cell)
        terrain, beds, scale = _terrain(forms, rank_scores(values, known), known)
        share = explained(values, elevation, cell)
        found = found.model_copy(update={"terrain": terrain, "beds": beds, "log_scale": scale, "explained": share})
        mean = terrain_response(found, forms)[0]
        residual, gusts = _residual(found, image, values, mean, [*isotropic, *_BENCHES], forms)
        found = found.model_copy(update={"residual": residual, "gusts": gusts})
    nodes, leaves = _marginal(found, image, lai, forms)
    return found.model_copy(update={"scores": nodes, "lai": leaves})


def rank_scores(values, known):
    """Standard normal scores by rank, 0 where unknown. [1]"""
    out = np.zeros(values.shape)
    ranks = np.empty(np.count_nonzero(known))
    ranks[np.argsort(values[known], kind="stable")] = np.arange(ranks.size) + 0.5
    out[known] = special.ndtri(ranks / ranks.size)
    return out


def statistics(values, known, orders=None):
    """Half the mean square differences of pairs by distance, and by their step in elevation, and the mean spectrum."""
    found = []
    for number, (front, back) in enumerate(_pairs(values.shape)):
        squares = (values[front] - values[back])[known[front] & known[back]] ** 2 / 2
        parts = [squares] if orders is None else np.array_split(squares[orders[number]], _THIRDS)
        found.append([each.mean() for each in parts])
    # Both axes of each distance.
    by_lag = np.reshape(found, (-1, 2, len(found[0]))).mean(axis=1)
    return np.r_[np.ravel(by_lag), ring_spectrum(values, known)]


def pair_orders(known, elevation):
    """Orders of the pairs of each distance and axis by their step in elevation; None without elevation."""
    if elevation is None:
        return None
    steps = [
        np.abs(elevation[front] - elevation[back])[known[front] & known[back]] for front, back in _pairs(known.shape)
    ]
    return [np.argsort(each, kind="stable") for each in steps]


def _pairs(shape):
    """Slices of both cells of pairs, by distance and axis."""
    for lag in lags_of(shape):
        for axis in (0, 1):
            yield tuple((slice(None),) * axis + (part,) for part in (slice(lag, None), slice(None, -lag)))


def lags_of(shape):
    """Distances of which a map has many pairs. [cell]"""
    return [lag for lag in LAGS if lag <= min(shape) // 3]


def ring_spectrum(values, known):
    """Mean power of squares of `_SIDE` cells without unknown ones, in rings of frequency. [square of the unit]"""
    window = np.outer(np.hanning(_SIDE), np.hanning(_SIDE))
    powers = []
    for i in range(0, values.shape[0] - _SIDE + 1, _SIDE // 2):
        for j in range(0, values.shape[1] - _SIDE + 1, _SIDE // 2):
            part = slice(i, i + _SIDE), slice(j, j + _SIDE)
            if known[part].all():
                powers.append(np.abs(fft.fft2((values[part] - values[part].mean()) * window)) ** 2)
    if not powers:
        return np.zeros(0)
    ring = np.rint(np.hypot(*np.meshgrid(fft.fftfreq(_SIDE), fft.fftfreq(_SIDE))) * _SIDE).astype(int)
    return (np.bincount(ring.ravel(), np.mean(powers, axis=0).ravel()) / np.bincount(ring.ravel()))[1 : _SIDE // 2 + 1]


class _Image(NamedTuple):
    """Cells of the map, and how it sees the ground."""

    cell: float
    origin: tuple[float, float]
    blur: Any
    known: np.ndarray
    elevation: np.ndarray | None
    orders: list[np.ndarray] | None  # of pairs by their step in elevation
    noise: float  # standard deviations of the map

    def places(self):
        """Northing and easting of the ground cells."""
        step = self.cell / _FINER
        down, across = (np.arange(n * _FINER) * step + step / 2 for n in self.known.shape)
        return self.origin[0] - down, self.origin[1] + across

    def ground(self, values):
        """Values of the map between its centres, on the ground cells; the nearest known ones beyond."""
        nearest = ndimage.distance_transform_edt(~np.isfinite(values), return_distances=False, return_indices=True)
        filled = values[tuple(nearest)]
        return ndimage.zoom(filled, _FINER, order=1, grid_mode=True, mode="nearest")

    def seen(self, ground):
        """Map of the ground, without noise."""
        down, across = (
            fft.fftfreq(ground.shape[0], self.cell / _FINER),
            fft.rfftfreq(ground.shape[1], self.cell / _FINER),
        )
        transfer = self.blur(np.abs(down)[:, None], across[None])
        blurred = fft.irfft2(fft.rfft2(ground) * transfer, s=ground.shape)
        return blurred[_FINER // 2 :: _FINER, _FINER // 2 :: _FINER]

    def terrain(self, landscape, forms):
        """Elevation, and mean and spread of the response to it, on the ground cells; nothing on level ground."""
        return () if forms is None else tuple(map(self.ground, (self.elevation, *terrain_response(landscape, forms))))

    def simulated(self, landscape, seed, terrain):
        """Scores of the ground cells of a landscape."""
        return scores(landscape, *self.places(), seed, *terrain)


def check_enough(known, name="the map"):
    """Raise an error if too few cells are known."""
    if (count := int(np.count_nonzero(known))) < LEAST_CELLS:
        raise ValueError(
            f"{name} has {count} known cells, at least {LEAST_CELLS} are needed: give a larger or a finer map"
        )


def _columns(forms, known):
    """Nodes of the responses to forms and to beds, and the weights of all, shapes (cells, nodes)."""
    nodes, parts = {}, []
    for name in FORMS:
        values = forms[name][known]
        nodes[name] = np.unique(np.quantile(values, PROBABILITIES))
        nodes[name] = nodes[name] if nodes[name].size > 1 else nodes[name][0] + np.array([0.0, 1.0])
        parts.append(_hats(values, nodes[name]))
    height, slope = forms["elevation"][known], forms["slope_40"][known]
    low, high = np.quantile(height, (0.001, 0.999))
    beds = np.arange(low, high + _BED_HEIGHT, _BED_HEIGHT) if high > low else low + np.array([0.0, 1.0])
    both = _hats(height, beds)[:, :, None] * _hats(slope, nodes["slope_40"][_STEEPNESS])[:, None, :]
    return nodes, beds, np.hstack(parts), both.reshape(height.size, -1)


def explained(values, elevation, cell):
    """Share of the variance of normal scores that forms of the land explain in squares that were left out. [1]"""
    known = np.isfinite(values) & np.isfinite(elevation)
    check_enough(known)
    score = rank_scores(values, known)[known]
    _, _, additive, beds = _columns(land_forms(np.where(known, elevation, np.nan), cell), known)
    columns = np.hstack([additive, beds])
    row, column = (place // max(1, round(_SQUARE / cell)) for place in np.nonzero(known))
    _, square = np.unique(np.stack([row, column]), axis=1, return_inverse=True)
    group = np.random.default_rng(0).permutation(square.max() + 1)[square.ravel()] % _GROUPS
    if square.max() == 0:
        return np.nan
    left = 0.0
    for k in range(_GROUPS):
        out, mean = group == k, score[group != k].mean()
        fitted = columns[out] @ _ridge(columns[~out], score[~out] - mean, _RIDGE) + mean
        left += np.sum((score[out] - fitted) ** 2)
    return float(1 - left / np.sum((score - score.mean()) ** 2))


def _terrain(forms, score, known):
    """Responses of mean and spread to the forms of the land and to beds, and the scale of the spread."""
    nodes, beds, additive, both = _columns(forms, known)
    columns = np.hstack([additive, both])
    mean = _ridge(columns, score[known] - score[known].mean(), _RIDGE)
    rest = np.zeros(score.shape)
    rest[known] = score[known] - columns @ mean
    energy = _log_energy(rest, known)
    spread = _ridge(additive, energy - energy.mean(), _SPREAD_RIDGE) / 2
    ends = np.cumsum([each.size for each in nodes.values()])
    terrain = [
        TerrainResponse(form=name, nodes=_rounded(each), mean=_rounded(m), spread=_rounded(s))
        for (name, each), m, s in zip(
            nodes.items(), np.split(mean, ends)[:-1], np.split(spread, ends[:-1]), strict=True
        )
    ]
    table, slopes = mean[ends[-1] :].reshape(beds.size, -1), nodes["slope_40"][_STEEPNESS]
    scale = np.log(np.mean(np.exp(2 * additive @ spread))) / 2
    made = Beds(elevation=_rounded(beds), slope=_rounded(slopes), mean=[_rounded(row) for row in table])
    return tuple(terrain), made, float(f"{scale:.5g}")


def _rounded(values):
    return tuple(float(f"{value:.5g}") for value in values)


def _hats(values, nodes):
    """Weights of linear interpolation between nodes, shape (n, nodes)."""
    i, share = place_between(values, nodes)
    out = np.zeros((values.size, nodes.size))
    at = np.arange(values.size)
    out[at, i], out[at, i + 1] = 1 - share, share
    return out


def _ridge(columns, values, penalty):
    return np.linalg.solve(columns.T @ columns + penalty * np.eye(columns.shape[1]), columns.T @ values)


def _log_energy(rest, known, width=3.0):
    """Logarithm of the variance at short distances around each known cell, in a Gaussian window of some cells."""
    weight = np.maximum(ndimage.gaussian_filter(known.astype(float), 2), 0.1)
    short = np.where(known, rest - ndimage.gaussian_filter(rest, 2) / weight, 0.0)
    weight = np.maximum(ndimage.gaussian_filter(known.astype(float), width), 0.1)
    return np.log((ndimage.gaussian_filter(short**2, width) / weight)[known] + 1e-4)


def kurtosis(values, known):
    """Excess kurtosis of the differences between neighbours."""
    steps = [
        (values[1:] - values[:-1])[known[1:] & known[:-1]],
        (values[:, 1:] - values[:, :-1])[known[:, 1:] & known[:, :-1]],
    ]
    return float(np.mean([stats.kurtosis(each) for each in steps]))


def _statistics_of(kinds, landscape, image, forms):
    """Statistics of the map of each kind of field with variance 1, shape (statistics, kinds)."""
    plain = landscape.model_copy(update={"terrain": (), "beds": None, "log_scale": 0.0})
    table, terrain = [], image.terrain(plain, forms)
    for spacing, height in kinds:
        one = (Residual(spacing=spacing, variance=1.0, height=height),)
        field = plain.model_copy(update={"residual": one, "level": one})
        found = [image.seen(image.simulated(field, seed, terrain)) for seed in range(2)]
        table.append(np.mean([statistics(each, image.known, image.orders) for each in found], axis=0))
    return np.array(table).T


def _residual(landscape, image, values, mean, kinds, forms):
    """Random fields of the residual, and the standard deviations of their gusts; of level ground without forms."""
    names = ("level", "level_gusts") if forms is None else ("residual", "gusts")
    known, terrain = image.known, image.terrain(landscape, forms)
    table = _statistics_of(kinds, landscape, image, forms)
    score = rank_scores(values, known)
    rest = np.where(known, score - mean, 0.0)
    ordered = np.sort(values[known])
    white = np.random.default_rng(0).normal(size=values.shape) * image.noise
    wanted, first, offset = (statistics(each, known, image.orders) for each in (score, rest, white))
    target = first
    energy, tails = np.var(_log_energy(score, known, _WIDE)), kurtosis(values, known)
    wide = fine = 0.0
    best = np.inf, (), {}
    for step in range(_STEPS):
        variances = optimize.nnls(table / target[:, None], np.maximum(1 - offset / target, 0.0))[0]
        fields = [
            Residual(spacing=s, variance=float(f"{v:.4g}"), height=h)
            for (s, h), v in zip(kinds, variances, strict=True)
            if v > _LEAST
        ]
        gusts = {"broad": wide / 2, "medium": wide / 2, "fine": fine, "benches": wide / 2 if forms else 0.0}
        gusts = {name: float(f"{np.sqrt(variance):.3g}") for name, variance in gusts.items()}
        trial = landscape.model_copy(update=dict(zip(names, (tuple(fields), gusts), strict=True)))
        got, energies, heavy = [], [], []
        for seed in range(2):
            seen = np.where(known, image.seen(image.simulated(trial, 10 * step + seed, terrain)) + white, 0.0)
            drawn = rank_scores(seen, known)
            got.append(statistics(drawn, known, image.orders))
            energies.append(np.var(_log_energy(drawn, known, _WIDE)))
            mapped = np.zeros(values.shape)
            mapped[known] = np.interp(
                special.ndtr(drawn[known]), (np.arange(ordered.size) + 0.5) / ordered.size, ordered
            )
            heavy.append(kurtosis(mapped, known))
        misfit = np.sqrt(np.mean(np.log(np.mean(got, axis=0) / wanted) ** 2))
        misfit += abs(np.mean(energies) / energy - 1) + abs(np.log((3 + np.mean(heavy)) / (3 + tails)))
        best = min(best, (misfit, tuple(fields), gusts), key=lambda each: each[0])
        # Structure that no field has, such as white noise of the map, must not take over.
        change = np.clip(target * wanted / np.mean(got, axis=0) / first, 1 / _CHANGE, _CHANGE)
        target = first * change
        # With s the logarithm of the standard deviation, the logarithm of the variance has the variance 4 var s, and
        # normal deviates have the excess kurtosis 3 (exp(4 var s) - 1).
        more = max(wide + (energy - np.mean(energies)) / 4, 0.0) - wide
        tail = (np.log1p(max(tails, 0.0) / 3) - np.log1p(max(np.mean(heavy), 0.0) / 3)) / 4
        wide, fine = wide + more, max(fine + tail - more, 0.0)
    return best[1:]


def _marginal(landscape, image, lai, forms):
    """Nodes of scores and of leaf area, so that the map of simulated ground has the distribution of the real one."""
    terrain = image.terrain(landscape, forms)
    drawn = [image.simulated(landscape, seed, terrain) for seed in (101, 102)]
    inside = np.repeat(np.repeat(image.known, _FINER, 0), _FINER, 1)
    nodes = np.quantile(np.concatenate([each[inside] for each in drawn]), _PROBABILITIES)
    wanted = np.quantile(lai[image.known], _PROBABILITIES)
    values = wanted.copy()
    for _ in range(_STEPS):
        got = np.concatenate([image.seen(np.interp(each, nodes, values))[image.known] for each in drawn])
        found = np.quantile(got, _PROBABILITIES)
        values = np.maximum.accumulate(np.maximum(values + wanted - found, 0.0))
    return _rounded(nodes), _rounded(values)
