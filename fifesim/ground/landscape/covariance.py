"""
Fields that correlate with each other and with the ground: a Gaussian copula.

Each field is standard normal: a part that follows the ground, and noise of the autoregressive process. What it becomes
by the quantiles of any distribution keeps the correlation of ranks.
"""

import zlib
from typing import NamedTuple

import numpy as np
from scipy import special

from fifesim.base.seeds import check_seed, generator
from fifesim.ground.landscape.autoregression import field_variance
from fifesim.ground.landscape.correlations import Impossible, largest_share, refused
from fifesim.ground.landscape.scores import Scores, add_scores, normal_scores, score_table

# First of the streams of random numbers that are named after fields.
_STREAM = 2**50

# The ranks of what several properties of the ground make together bend it a little; the weights are mended
# at most so often, until correlations are so close.
_ROUNDS = 30
_CLOSE = 1e-4

# Cells at once, of which all that is between stays in a processor's cache.
_AT_ONCE = 2**16

# What is left of a correlation may be so far from what is asked.
_APART = 0.01


class Ground(NamedTuple):
    """The part of a field that follows the ground."""

    covariates: tuple[str, ...]
    weights: np.ndarray
    scores: Scores
    share: float
    """Standard deviation of the part. [1]"""


class Copula(NamedTuple):
    """How fields are put together."""

    covariates: dict[str, Scores]
    ground: dict[str, Ground]
    noise: dict[str, dict[str, float]]
    """For each field the weights of the noises, by the fields that they belong to."""
    coarse: dict[str, dict[str, float]]
    """For each field that has part in them, the weights of independent fields on coarser lattices, by their names."""


def field_seed(seed, name):
    """
    Seed of the noise of a field.

    Parameters
    ----------
    seed : int
        Of the landscape, in [0, 2**63).
    name : str
        Of the field: "lai" has the seed itself, each other a stream of its own.

    Returns
    -------
    seed : int

    Examples
    --------
    >>> field_seed(7, "lai"), field_seed(7, "soil") == field_seed(7, "brown")
    (7, False)
    """
    seed = check_seed(seed)
    if name == "lai":
        return seed
    return int(generator(seed, _STREAM + zlib.crc32(name.encode())).integers(2**63))


def cross_correlation(arp, other):
    r"""
    Correlation of two autoregressive fields that are made of the same noise.

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

    Examples
    --------
    >>> cross_correlation(0.2, 0.2), round(cross_correlation(0.05, 0.24), 3)
    (1.0, 0.63)
    """
    variances = field_variance(arp) * field_variance(other)
    if abs(arp - other) < 1e-7:
        return 1.0
    one, two = (a * 2 / np.pi * special.ellipk((4 * a) ** 2) for a in (arp, other))
    return float((one - two) / (arp - other) / np.sqrt(variances))


def copula(arps, correlations, samples=None, coarser=()):
    """
    How fields are put together so that they correlate as asked.

    Parameters
    ----------
    arps : dict of str to float
        Of the fields. [1]
    correlations : dict of (str, str) to float
        Of pairs of fields, and of fields with properties of the ground, as
        `fifesim.ground.landscape.correlations.pairs_of` gives them. [1]
    samples : dict of str to array, shape (n,), optional
        The ground at some places.
    coarser : collection of str, optional
        Names of the fields that vary on a coarser lattice.

    Returns
    -------
    copula : Copula

    Raises
    ------
    ValueError
        If no fields correlate like that; the message tells the nearest in the same proportion.

    Notes
    -----
    Properties of the ground that a field's correlations do not name have no part in it, and correlate with it by those
    that they name. Fields whose pair is not named share nothing but the ground.

    Where fields have different arps, their noises correlate more than the fields: by the inverse of
    `cross_correlation`. Fields on coarser lattices share no noise with others. They come first, and are given to those
    as what is known: these have a part of their texture then, and may correlate by any number.
    """
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
    """The ground at the places where all of it is known."""
    known = np.all([np.isfinite(each) for each in samples.values()], axis=0)
    if not known.any():
        raise ValueError(f"{', '.join(samples)}: nowhere are all known, there is nothing to follow")
    return {name: np.asarray(each, float)[known] for name, each in samples.items()}


def _parts(arps, correlations, scores, coarser):
    """What of each field follows the ground; weights of the noises, and of the fields on coarser lattices."""
    ground, signals = {}, {}
    for name in arps:
        asked = {other: r for (one, other), r in correlations.items() if one == name and other in scores}
        if asked:
            ground[name], signals[name] = _follow(name, asked, scores)
    names, coarse = [name for name in arps if name not in coarser], [name for name in arps if name in coarser]
    pairs = {pair: r for pair, r in correlations.items() if set(pair) <= set(arps)}
    shares = {pair: _left(*pair, r, arps, coarser, ground, signals) for pair, r in pairs.items()}
    known = _known(coarse, names, shares)
    needed = np.eye(len(names))
    for (one, other), (left, most) in shares.items():
        if one in names and other in names:
            i, j = names.index(one), names.index(other)
            needed[i, j] = needed[j, i] = _noise_correlation(one, other, left, most, known, arps)
    noise = _weights(names, needed) | {name: {name: 1.0} for name in coarse}
    return ground, noise, {name: each for name, each in known.items() if each}


def _left(one, other, r, arps, coarser, ground, signals):
    """What of the covariance of two fields does not come of the ground, and the most that it can be."""
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
    """Weights of independent fields on coarser lattices, in those themselves and in the others."""
    every = [*coarse, *names]
    matrix = np.eye(len(every))
    for (one, other), (left, most) in shares.items():
        if {one, other} & set(coarse):
            i, j = every.index(one), every.index(other)
            matrix[i, j] = matrix[j, i] = left / most if most > 0 else 0.0
    within = matrix[: len(coarse), : len(coarse)]
    _check_matrix(within)
    for i in range(len(coarse), len(every)):
        # Each of the others by itself: what they share beside this is a matter of their noises.
        _check_matrix(matrix[np.ix_([*range(len(coarse)), i], [*range(len(coarse)), i])])
    weights = _lower(matrix)
    return {
        name: {coarse[j]: float(weights[i, j]) for j in range(min(i + 1, len(coarse))) if weights[i, j]}
        for i, name in enumerate(every)
    }


def _noise_correlation(one, other, left, most, known, arps):
    """Correlation of the noises of two fields on the ground's own lattice."""
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
    if np.linalg.eigvalsh(matrix)[0] < -1e-9 if len(matrix) else False:
        raise Impossible("no correlation matrix has them together; pairs of fields that are not named count as 0")


def _weights(names, needed):
    """Weights of the noises of fields."""
    _check_matrix(needed)
    weights = _lower(needed)
    return {
        name: {names[j]: float(weights[i, j]) for j in range(i + 1) if weights[i, j]} for i, name in enumerate(names)
    }


def _follow(name, asked, scores):
    """The part of a field that follows the ground, and its values over the sample."""
    known = np.stack([scores[each] for each in asked])
    between = np.atleast_2d(np.corrcoef(known))
    wanted = np.array(list(asked.values()))
    if not wanted.any():
        return Ground(tuple(asked), wanted, score_table(np.array([-1.0, 1.0])), 0.0), np.zeros(known.shape[1])
    best, target, step = None, wanted, 1.0
    for _ in range(_ROUNDS):
        weights = np.linalg.lstsq(between, target, rcond=1e-9)[0]
        share = np.sqrt(max(float(target @ weights), 0.0))
        if share > 1 + 1e-9 or np.abs(between @ weights - target).max() > 1e-6:
            raise Impossible(f"{name} cannot follow all of {', '.join(asked)} so closely, which correlate themselves")
        table = score_table(weights @ known)
        signal = share * normal_scores(weights @ known, table)
        missed = wanted - np.mean(signal * known, axis=1)
        if best is None or np.abs(missed).max() < np.abs(best[0]).max():
            best = missed, target, Ground(tuple(asked), weights, table, min(share, 1.0)), signal
        else:
            step /= 2
        if np.abs(best[0]).max() < _CLOSE or len(asked) == 1:
            break
        target = best[1] + step * best[0]
    missed, _, ground, signal = best
    if np.abs(missed).max() > _APART and len(asked) > 1:
        raise Impossible(f"no sum of {', '.join(asked)} has such ranks that {name} follows each of them")
    return ground, signal


def _lower(matrix):
    """Lower triangle whose rows make correlated noise of independent ones; the matrix may be singular."""
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
    A field: what follows the ground, and noise.

    .. math:: z = R \, s + \sqrt{1 - R^2} \, n

    Parameters
    ----------
    ground : Ground
        Of the field.
    noise : array, shape (y, x)
        Standard normal field :math:`n` of the field's own arp.
    scores : dict of str to fifesim.ground.landscape.scores.Scores
        Of the ground.
    covariates : dict of str to array, shape (y, x)
        The ground.

    Returns
    -------
    field : array, shape (y, x)
        Standard normal over the places that the ground was sampled at; NaN where the ground is. [1]
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
