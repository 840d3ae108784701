"""
Correlated fields: correlations between fields and with the ground, by a Gaussian copula.

Each field is standard normal: the sum of a part that follows the ground, and noise of the autoregressive process.
Mapped to the quantiles of any distribution, fields keep the correlation of their ranks.
"""

import zlib
from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np
from scipy import special, stats

from fifesim.base.arguments import Range, check, kind_of
from fifesim.base.arrays import compiled
from fifesim.base.lattice import check_seed, generator
from fifesim.ground.landscape.autoregression import field_variance


class Impossible(Exception):
    """Correlations that no set of fields can have."""


def pairs_of(correlations, fields, ground=()):
    """Correlations by pairs, each once and with a field first."""
    known = [*fields, *ground]
    pairs = {}
    for one, other, r in flat(correlations or {}):
        for name in (one, other):
            if name not in known:
                raise ValueError(f"correlations name {name!r}, there are {', '.join(map(repr, known))}")
        if one == other or not {one, other} & set(fields):
            raise ValueError(
                f"a correlation is of two fields, or of a field with the ground, got {one!r} with {other!r}: fields "
                f"are {', '.join(fields)}; how the ground correlates with itself is known"
            )
        if one not in fields:
            one, other = other, one
        if (one, other) in pairs or (other, one) in pairs:
            raise ValueError(f"the correlation of {one!r} with {other!r} is given twice: give it once")
        pairs[one, other] = _correlation(one, other, r)
    return pairs


def flat(correlations):
    """Iterate over the correlations one by one."""
    if not isinstance(correlations, Mapping):
        raise TypeError(f"correlations are {{(name, name): number}}, got {type(correlations).__name__}")
    for key, value in correlations.items():
        if isinstance(value, Mapping):
            yield from ((key, other, r) for other, r in value.items())
        elif isinstance(key, tuple) and len(key) == 2:
            yield *key, value
        else:
            raise TypeError(f"correlations are {{(name, name): number}}, got the key {key!r}: name the other one too")


def _correlation(one, other, r):
    check(f"the correlation of {one} with {other}", r, kind_of(Annotated[float, Range("1", -1, 1)]))
    return float(r)


def largest_share(attempt):
    """Largest factor, in [0, 1), by which all correlations can be multiplied so that fields exist."""
    low, high = 0.0, 1.0
    for _ in range(20):
        middle = (low + high) / 2
        try:
            attempt(middle)
        except Impossible:
            high = middle
        else:
            low = middle
    return low


def refused(correlations, share, reason):
    """Message for impossible correlations, which names the nearest possible ones."""
    requested = ", ".join(f"{one}-{other} {r:g}" for (one, other), r in correlations.items())
    # Cut, not rounded, to hundredths, so that the values in the message are allowed.
    near = ", ".join(f"{one}-{other} {np.trunc(100 * share * r) / 100:g}" for (one, other), r in correlations.items())
    return f"correlations {requested} cannot be: {reason}. The nearest allowed in their proportion are {near}"


# Nodes of a table; values between two nodes are interpolated.
_NODES = 2049

# Starting points of searches; with this number most searches end at once, and the table stays in the cache.
_STARTS = 32768

# Share of the spacing of the starting points.
_ROUNDING = 1e-6

# Values that are processed together, so that they stay in the nearest cache.
_RUN = 1024


class Scores(NamedTuple):
    """Standard normal scores of values by their ranks in a sample."""

    values: np.ndarray
    scores: np.ndarray
    slopes: np.ndarray  # of the lines between them
    starts: np.ndarray  # which of the values is the last below each of evenly spaced ones, from which a search goes on
    steps: int  # the most that a search goes on


def score_table(sample):
    """Table of the standard normal scores of a sample, mean 0 and deviation 1; ties share their mean rank."""
    values, counts = np.unique(sample, return_counts=True)
    if values.size < 2:
        raise ValueError("is the same everywhere: nothing can follow it")
    scores = stats.norm.ppf((np.cumsum(counts) - counts / 2) / counts.sum())
    mean = np.average(scores, weights=counts)
    scores = (scores - mean) / np.sqrt(np.average((scores - mean) ** 2, weights=counts))
    kept = np.unique(np.linspace(0, values.size - 1, _NODES).round().astype(int))
    values, scores = values[kept], scores[kept]
    even, rounding = np.linspace(values[0], values[-1], _STARTS, retstep=True)
    # By rounding, a value at a node may be assigned to a neighbouring interval.
    first, last = (
        np.clip(np.searchsorted(values, even + aside * rounding, side="right") - 1, 0, values.size - 2)
        for aside in (-_ROUNDING, 1 + _ROUNDING)
    )
    return Scores(values, scores, np.diff(scores) / np.diff(values), first.astype(np.int32), int(np.max(last - first)))


def normal_scores(values, scores):
    """Scores of values by a table, constant beyond its ends. [1]"""
    out = np.zeros(np.size(values))
    add_scores(values, scores, 1.0, out)
    return out.reshape(np.shape(values))


def add_scores(values, scores, weight, out):
    """Add the weighted scores of values to an array in place."""
    _lookup(np.ascontiguousarray(values, float).ravel(), *scores, float(weight), out)


@compiled
def _lookup(values, nodes, scores, slopes, starts, steps, weight, out):
    """Add the weighted scores of values, linear between nodes."""
    lowest, highest, last = nodes[0], nodes[-1], np.uint32(nodes.size - 2)
    per_start = (starts.size - 1) / (highest - lowest)
    inside, at = np.empty(_RUN), np.empty(_RUN, np.uint32)
    for first in range(0, values.size, _RUN):
        cells, to = values[first : first + _RUN], out[first : first + _RUN]
        # Without branches, so that the loops are done for several values at once.
        for i in range(cells.size):
            inside[i] = min(max(cells[i], lowest), highest) if cells[i] == cells[i] else lowest
            at[i] = np.uint32((inside[i] - lowest) * per_start)
        for i in range(cells.size):
            at[i] = starts[at[i]]
        for _ in range(steps):
            for i in range(cells.size):
                up = np.uint32(at[i] + 1)
                at[i] = min(up, last) if inside[i] >= nodes[up] else at[i]
        for i in range(cells.size):
            k = at[i]
            score = scores[k] + (inside[i] - nodes[k]) * slopes[k]
            to[i] = to[i] + weight * score if cells[i] == cells[i] else np.nan


# First of the streams of random numbers that are named after fields.
_STREAM = 2**50

# Ranks of a sum of several ground properties change its correlations a little; the weights are corrected at most this
# many times, until the correlations are this close.
_ROUNDS = 30
_CLOSE = 1e-4

# Cells that are processed together, so that intermediate arrays stay in the cache.
_AT_ONCE = 2**16

# Largest accepted difference from a requested correlation. [1]
_APART = 0.01


class GroundPart(NamedTuple):
    """The part of a field that follows the ground."""

    covariates: tuple[str, ...]
    weights: np.ndarray
    scores: Scores
    share: float  # standard deviation of the part. [1]


class Copula(NamedTuple):
    """Weights that combine ground, noises and coarser fields to correlated fields."""

    covariates: dict[str, Scores]
    ground: dict[str, GroundPart]
    noise: dict[str, dict[str, float]]  # for each field the weights of the noises, by the fields that they belong to
    # For each field that has part in them, the weights of independent fields on coarser lattices, by their names.
    coarse: dict[str, dict[str, float]]


def field_seed(seed, name):
    """Seed of the noise of a field; "lai" has the seed of the landscape."""
    seed = check_seed(seed)
    if name == "lai":
        return seed
    return int(generator(seed, _STREAM + zlib.crc32(name.encode())).integers(2**63))


def cross_correlation(arp, other):
    r"""
    Correlation of two autoregressive fields of the same noise.

    .. math::

        \kappa = \frac{1}{4 \pi^2 \sigma_a \sigma_b} \iint H_a H_b \, du \, dv
            = \frac{a \, g(a) - b \, g(b)}{(a - b) \, \sigma_a \sigma_b}, \quad g(a) = \frac{2}{\pi} K(4 a)

    with K the complete elliptic integral of the first kind.

    Parameters
    ----------
    arp, other : float
        a and b. [1]

    Returns
    -------
    correlation : float
        1 for equal ones; the most by which fields of these arps can correlate. [1]
    """
    variances = field_variance(arp) * field_variance(other)
    if abs(arp - other) < 1e-7:
        return 1.0
    one, two = (a * 2 / np.pi * special.ellipk((4 * a) ** 2) for a in (arp, other))
    return float((one - two) / (arp - other) / np.sqrt(variances))


def copula(arps, correlations, samples=None, coarser=()):
    """Weights for fields with the requested correlations."""
    # Properties of the ground that are not named for a field have no part in it, and correlate with it only through the
    # named ones. Fields whose pair is not named share only the ground.
    samples = {} if samples is None else _complete(samples)
    tables = {}
    for name, values in samples.items():
        try:
            tables[name] = score_table(values)
        except ValueError as error:
            raise ValueError(f"{name} {error}") from None
    scores = {name: normal_scores(values, tables[name]) for name, values in samples.items()}
    try:
        ground, noise, coarse = _parts(arps, correlations, scores, coarser)
    except Impossible as reason:
        few = {name: each[:: max(1, each.size // 4096)] for name, each in scores.items()}
        share = largest_share(
            lambda part: _parts(arps, {pair: part * r for pair, r in correlations.items()}, few, coarser)
        )
        raise ValueError(refused(correlations, share, str(reason))) from None
    return Copula(tables, ground, noise, coarse)


def _complete(samples):
    """Ground at the places where all of its properties are known."""
    known = np.all([np.isfinite(each) for each in samples.values()], axis=0)
    if not known.any():
        raise ValueError(f"{', '.join(samples)}: nowhere are all known, there is nothing to follow")
    return {name: np.asarray(each, float)[known] for name, each in samples.items()}


def _parts(arps, correlations, scores, coarser):
    """Part of each field that follows the ground, and weights of the noises and of the fields on coarser lattices."""
    ground, signals = {}, {}
    for name in arps:
        requested = {other: r for (one, other), r in correlations.items() if one == name and other in scores}
        if requested:
            ground[name], signals[name] = _follow(name, requested, scores)
    names, coarse = [name for name in arps if name not in coarser], [name for name in arps if name in coarser]
    pairs = {pair: r for pair, r in correlations.items() if set(pair) <= set(arps)}
    shares = {pair: _left(*pair, r, arps, coarser, ground, signals) for pair, r in pairs.items()}
    known = _known(coarse, names, shares)
    needed = np.eye(len(names))
    for (one, other), (left, most) in shares.items():
        if one in names and other in names:
            i, j = names.index(one), names.index(other)
            needed[i, j] = needed[j, i] = _noise_correlation(one, other, left, most, known, arps)
    _check_matrix(needed)
    noise = _weights(names, names, needed) | {name: {name: 1.0} for name in coarse}
    return ground, noise, {name: each for name, each in known.items() if each}


def _left(one, other, r, arps, coarser, ground, signals):
    """Covariance of two fields that is not due to the ground, and its largest possible value."""
    shared = float(np.mean(signals[one] * signals[other])) if one in signals and other in signals else 0.0
    rests = [1 - ground[name].share ** 2 if name in ground else 1.0 for name in (one, other)]
    alike = 1.0 if {one, other} & set(coarser) else cross_correlation(arps[one], arps[other])
    most = alike * np.sqrt(rests[0] * rests[1])
    if abs(r - shared) > most * (1 + 1e-9):
        reasons = [f"by their arps {arps[one]:g} and {arps[other]:g}"] if alike < 1 else []
        reasons += ["what follows the ground"] if min(rests) < 1 else []
        span = f"{shared - most:.2f} to {shared + most:.2f}"
        raise Impossible(f"{one} and {other} can have {span}, {' and '.join(reasons)}")
    return r - shared, most


def _known(coarse, names, shares):
    """Weights of independent fields on coarser lattices, in these fields and in the others."""
    every = [*coarse, *names]
    matrix = np.eye(len(every))
    for (one, other), (left, most) in shares.items():
        if {one, other} & set(coarse):
            i, j = every.index(one), every.index(other)
            matrix[i, j] = matrix[j, i] = left / most if most > 0 else 0.0
    _check_matrix(matrix[: len(coarse), : len(coarse)])
    for i in range(len(coarse), len(every)):
        # Each other field separately, because their remaining correlation depends on their noises.
        _check_matrix(matrix[np.ix_([*range(len(coarse)), i], [*range(len(coarse)), i])])
    return _weights(every, coarse, matrix)


def _noise_correlation(one, other, left, most, known, arps):
    """Correlation of the noises of two fields on the lattice of the ground."""
    through = sum(weight * known[other].get(name, 0.0) for name, weight in known[one].items())
    if not known[one] and not known[other]:
        return left / most if most > 0 else 0.0
    alike = cross_correlation(arps[one], arps[other])
    rests = [np.sqrt(max(1 - sum(w**2 for w in known[name].values()), 0.0)) for name in (one, other)]
    wanted, room = left * alike / most - through if most > 0 else 0.0, alike * rests[0] * rests[1]
    if abs(wanted) > room + 1e-9:
        raise Impossible(f"{one} and {other} go too closely with the same fields of coarser lattices")
    return wanted / room if room > 0 else 0.0


def _check_matrix(matrix):
    if len(matrix) and np.linalg.eigvalsh(matrix)[0] < -1e-9:
        raise Impossible("no correlation matrix has them together; pairs of fields that are not named count as 0")


def _weights(names, sources, matrix):
    """Weights of independent fields, the sources, in fields that correlate as in a matrix."""
    weights = _lower(matrix)
    return {
        name: {source: float(weights[i, j]) for j, source in enumerate(sources[: i + 1]) if weights[i, j]}
        for i, name in enumerate(names)
    }


def _follow(name, requested, scores):
    """Part of a field that follows the ground, and its values over the sample."""
    known = np.stack([scores[each] for each in requested])
    between = np.atleast_2d(np.corrcoef(known))
    wanted = np.array(list(requested.values()))
    if not wanted.any():
        return GroundPart(tuple(requested), wanted, score_table(np.array([-1.0, 1.0])), 0.0), np.zeros(known.shape[1])
    best, target, step = None, wanted, 1.0
    for _ in range(_ROUNDS):
        weights = np.linalg.lstsq(between, target, rcond=1e-9)[0]
        share = np.sqrt(max(float(target @ weights), 0.0))
        if share > 1 + 1e-9 or np.abs(between @ weights - target).max() > 1e-6:
            raise Impossible(
                f"{name} cannot follow all of {', '.join(requested)} so closely, which correlate themselves"
            )
        table = score_table(weights @ known)
        signal = share * normal_scores(weights @ known, table)
        missed = wanted - np.mean(signal * known, axis=1)
        if best is None or np.abs(missed).max() < np.abs(best[0]).max():
            best = missed, target, GroundPart(tuple(requested), weights, table, min(share, 1.0)), signal
        else:
            step /= 2
        if np.abs(best[0]).max() < _CLOSE or len(requested) == 1:
            break
        target = best[1] + step * best[0]
    missed, _, ground, signal = best
    if np.abs(missed).max() > _APART and len(requested) > 1:
        raise Impossible(f"no sum of {', '.join(requested)} has such ranks that {name} follows each of them")
    return ground, signal


def _lower(matrix):
    """Lower triangle that turns independent into correlated noise; the matrix may be singular."""
    out = np.zeros_like(matrix)
    for i in range(len(matrix)):
        for j in range(i + 1):
            rest = matrix[i, j] - out[i, :j] @ out[j, :j]
            if i == j:
                out[i, i] = np.sqrt(max(rest, 0.0))
            elif out[j, j] > 1e-9:
                out[i, j] = rest / out[j, j]
    return out


def correlated(ground, noise, scores, covariates):
    r"""
    Field as the sum of a part R s that follows the ground, a GroundPart, and noise n of the field's own arp. [1]
    :math:`z = R \, s + \sqrt{1 - R^2} \, n`. Standard normal over the places that the ground was sampled at; NaN where
    the ground is. `scores` and `covariates` are the score tables and the values of the ground by name.
    """
    shape = np.shape(noise)
    noise, field = np.ravel(noise), np.empty(np.size(noise))
    known = [np.ravel(covariates[each]) for each in ground.covariates]
    for start in range(0, noise.size, _AT_ONCE):
        cells = slice(start, start + _AT_ONCE)
        signal = np.zeros(noise[cells].size)
        for weight, name, values in zip(ground.weights, ground.covariates, known, strict=True):
            add_scores(values[cells], scores[name], weight, signal)
        np.multiply(noise[cells], np.sqrt(1 - ground.share**2), out=field[cells])
        add_scores(signal, ground.scores, ground.share, field[cells])
    return field.reshape(shape)
