"""Frequency distributions of leaf area index, and the mapping of Gaussian fields to them (Fig. 2, step 5)."""

from __future__ import annotations

import re
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import optimize, special, stats

from fifesim.base import files
from fifesim.base.arguments import FrozenDistribution, LaiDistribution
from fifesim.base.arrays import compiled, read_only
from fifesim.base.caches import cached
from fifesim.base.files import in_a_line, read_csv
from fifesim.ground.canopy.leaf_area import LARGEST_OF_MAPS

# Distances from values to samples per batch, 1 MB.
_RUN_OF_KERNELS = 2**17

# A support that starts at zero may start this far below it.
_ROUNDING = 1e-12


def treatments() -> list[str]:
    """
    Names of the tabulated LAI distributions.

    Returns
    -------
    names : list of str

    Examples
    --------
    >>> from fifesim.ground import treatments
    >>> treatments()
    ['burned-grazed', 'burned-ungrazed', 'unburned-ungrazed']
    """
    return [*_tabulated()]


@cached(1, "names of LAI distributions")
def _tabulated():
    return tuple(files.table("lai_distributions.csv")["treatment"])


def lai_distribution(source: LaiDistribution) -> FrozenDistribution:
    """
    A frequency distribution of leaf area index.

    Parameters
    ----------
    source : str, path or frozen scipy distribution
        Name from `treatments`; a CSV file of samples from 0 to 20, in the column ``lai`` or the only column; or a
        frozen continuous distribution from `scipy.stats` without negative values.

    Returns
    -------
    distribution : frozen scipy distribution
        Of LAI. [m2 m-2]

    Raises
    ------
    ValueError
        If the name is unknown, the file has no valid samples, or LAI could be negative.
    TypeError
        If the source has another type.

    References
    ----------
    [Friedl1995]_, Fig. 3

    Examples
    --------
    >>> from fifesim.ground import lai_distribution
    >>> from scipy import stats
    >>> round(float(lai_distribution(stats.gamma(4, scale=0.4)).mean()), 2)
    1.6
    """
    if hasattr(source, "ppf") and hasattr(source, "support"):
        if hasattr(getattr(source, "dist", source), "pmf"):
            raise ValueError(f"leaf area index is continuous, got the discrete distribution {source.dist.name!r}")
        low = source.support()[0]
        if low < -_ROUNDING:
            raise ValueError(
                f"leaf area index cannot be negative, got a distribution from {low:g} up: "
                "truncate it at zero, for instance scipy.stats.truncnorm"
            )
        return source  # type: ignore[return-value]
    if not isinstance(source, str | Path):
        raise TypeError(f"an LAI distribution is a name, a CSV file or a frozen scipy distribution, got {type(source)}")
    if str(source) in _tabulated():
        return _treatment(str(source))
    if Path(source).suffix.lower() == ".csv":
        return _density_of(read_samples(source).tobytes())
    near = get_close_matches(str(source), treatments(), n=1, cutoff=0.3)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise ValueError(
        f"unknown LAI distribution {str(source)!r}: {hint}allowed are {', '.join(treatments())}, or a .csv of samples"
    )


def read_samples(path):
    """Read LAI samples from a CSV file with a column ``lai`` or a single column, shape (n,). [m2 m-2]"""
    table = read_csv(path, "the LAI samples")
    cells = table.iloc[:, _lai_column(table.columns, path)]
    samples = pd.to_numeric(cells, errors="coerce")
    # A comparison with NaN is false, so that text counts as wrong; empty cells were NaN before.
    wrong = cells.notna() & ~((samples >= 0) & (samples <= LARGEST_OF_MAPS))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(
            f"{path}, line {_line_of(path, row)}: {in_a_line(str(cells.iloc[row]), 60)!r} is not a leaf area index, "
            f"which is a number from 0 to {LARGEST_OF_MAPS:g} m2 m-2: multiply scaled values by their scale, write "
            "decimals with a point, and leave the cell empty if the sample is missing"
        )
    samples = samples.dropna().to_numpy(float)
    if samples.size < 5:
        raise ValueError(f"{path} holds {samples.size} LAI samples, at least 5 are needed for a density")
    return samples


def _lai_column(names, path):
    """Position of the LAI column."""
    # pandas numbers columns of the same name: lai, lai.1
    plain = [re.sub(r"\.\d+$", "", str(name)).strip().lower() for name in names]
    found = [position for position, name in enumerate(plain) if name == "lai"] or list(range(len(plain)))
    if len(found) > 1:
        raise ValueError(
            f"{path} needs a column 'lai', it has {', '.join(map(str, names))}: name the column of LAI samples lai, "
            "and no other column"
        )
    try:
        float(names[found[0]])
    except ValueError:
        return found[0]
    raise ValueError(f"{path} begins with the number {names[found[0]]}: type lai as its first line")


def _line_of(path, row):
    """Line number in a CSV file of a row of its table, from 1."""
    with open(path, encoding="utf-8") as file:
        lines = [number for number, line in enumerate(file, 1) if line.partition("#")[0].strip()]
    return lines[row + 1]


def kernel_density(samples):
    """
    Gaussian kernel density of LAI samples with Scott's bandwidth, reflected at zero, so that there is no mass below it.
    [Silverman1986]_, Section 2.10 (reflection at a boundary)
    """
    samples = np.asarray(samples, float)
    bandwidth = np.std(samples, ddof=1) * samples.size ** (-1 / 5)
    if not bandwidth > 0:
        raise ValueError(f"all {samples.size} LAI samples are {samples[0]:g}: a density needs some spread")
    return _ReflectedKernels(samples, bandwidth).freeze()


# Return the same object for the same samples, because tables are cached by distribution.
@cached(64, "kernel densities of LAI samples")
def _density_of(samples):
    return kernel_density(np.frombuffer(samples))


class _ReflectedKernels(stats.rv_continuous):
    """Mixture of normals at the samples and at their mirror images, restricted to positive values."""

    def __init__(self, samples, bandwidth):
        # Beyond seven bandwidths from the largest sample, a kernel has a probability of 1e-12.
        super().__init__(a=0.0, b=float(samples.max() + 7 * bandwidth), name="reflected_kernels")
        self._samples, self._bandwidth = samples, bandwidth

    def _updated_ctor_param(self):
        return {"samples": self._samples, "bandwidth": self._bandwidth}

    def _pdf(self, x):
        z, mirrored = self._distances(x)
        return np.mean(stats.norm.pdf(z) + stats.norm.pdf(mirrored), axis=-1) / self._bandwidth

    def _cdf(self, x):
        # As norm.cdf, without its checks of arguments.
        z, mirrored = self._distances(x)
        return np.mean(special.ndtr(z) + special.ndtr(mirrored) - 1.0, axis=-1)

    def _sf(self, x):
        z, mirrored = self._distances(x)
        return np.mean(special.ndtr(-z) + special.ndtr(-mirrored), axis=-1)

    def _ppf(self, q):
        nodes, below, _ = self._tables
        return np.interp(q, below, nodes)

    def _isf(self, q):
        nodes, _, above = self._tables
        return np.interp(-q, -above, nodes)

    @cached_property
    def _tables(self):
        """Probability below and above evenly spaced values, 1/8192 of the support apart."""
        nodes = np.linspace(self.a, self.b, 2**13 + 1)
        # A few nodes at a time, so that the distances to all samples stay in the cache of the processor.
        parts = np.array_split(nodes, -(-nodes.size * self._samples.size // _RUN_OF_KERNELS))
        return nodes, *(np.concatenate([each(part) for part in parts]) for each in (self._cdf, self._sf))

    def _distances(self, x):
        x = np.asarray(x)[..., None]
        return (x - self._samples) / self._bandwidth, (x + self._samples) / self._bandwidth


@cached(128, "LAI distributions of treatments")
def _treatment(name):
    row = files.table("lai_distributions.csv").set_index("treatment").loc[name]
    return truncated_normal(row["mean"], row["standard_deviation"], row["lower"], row["upper"])


def truncated_normal(mean, standard_deviation, lower, upper):
    """Normal distribution truncated at two bounds, with a given mean and standard deviation after truncation."""

    def frozen(parameters):
        location, scale = parameters[0], np.exp(parameters[1])
        return stats.truncnorm((lower - location) / scale, (upper - location) / scale, location, scale)

    def misfit(parameters):
        distribution = frozen(parameters)
        return distribution.mean() - mean, distribution.std() - standard_deviation

    solution = optimize.root(misfit, (mean, np.log(standard_deviation)), tol=1e-13)
    if np.max(np.abs(misfit(solution.x))) > 1e-9:
        raise ValueError(
            f"no normal truncated to [{lower:g}, {upper:g}] has mean {mean:g} and deviation {standard_deviation:g}"
        )
    return frozen(solution.x)


# Quantiles are tabulated for normal deviates from -8.5 to 8.5, which excludes a probability of 2e-17. The error of
# linear interpolation is step**2 / 8 = 1.3e-7 times the curvature of the quantile function.
_REACH = 8.5
QUANTILE_NODES = 2**14 + 1

# Cells per batch, to stay in the L1 cache.
_RUN = 1024

# Largest number of cells for which quantiles of ranks are cached, 2 MB.
_FEW = 2**18


def quantile_deviates():
    """Standard normal deviates of the nodes of a `quantile_table`."""
    return np.linspace(-_REACH, _REACH, QUANTILE_NODES)


# Building a table takes some hundredths of a second. Distributions of treatments and fractions are cached objects.
@cached(64, "quantile tables of distributions")
def quantile_table(distribution):
    """Quantiles of a distribution at standard normal deviates from -8.5 to 8.5, shape (16385,), cached."""
    deviates = quantile_deviates()
    lower = distribution.ppf(stats.norm.cdf(deviates[deviates <= 0]))
    # The upper half goes by survival functions, which keep their digits in the tail.
    upper = distribution.isf(stats.norm.sf(deviates[deviates > 0]))
    return np.maximum.accumulate(np.concatenate([[0.0], lower, upper]))[1:]


def quantile_map(field, table, out=None):
    """
    Map a standard normal field to the distribution of a `quantile_table`; NaN stays NaN, and `out` may be the field.
    [Friedl1995]_, Fig. 2, step 5, for an unbounded field: ranks refer to the ensemble.
    """
    cells = np.ascontiguousarray(field, float)
    out = np.empty(cells.shape) if out is None else out
    no_classes = np.empty(0, np.int16), read_only(table[None]), np.empty(0, bool)
    _map(cells.reshape(-1), *no_classes, out.reshape(-1))
    return out


def quantile_map_of_classes(field, numbers, tables):
    """Map a standard normal field to distributions that differ by class, shape (y, x)."""
    cells, out = np.ascontiguousarray(field, float), np.empty(np.shape(field))
    same = tables[:, 0] == tables[:, -1]
    _map(cells.reshape(-1), numbers.reshape(-1), read_only(tables), same, out.reshape(-1))
    return out


@compiled
def _map(field, numbers, tables, same, out):
    """Fill in quantiles from the table of the class of each cell, or from the only table."""
    at, share = np.empty(_RUN, np.uint32), np.empty(_RUN)
    flat, size, by_class = tables.reshape(-1), tables.shape[1], numbers.size > 0
    per_deviate, last = (size - 1) / (2.0 * _REACH), np.uint32(size - 2)
    for first in range(0, field.size, _RUN):
        cells, values = field[first : first + _RUN], out[first : first + _RUN]
        # Without branches, so that the loops are vectorized.
        for i in range(cells.size):
            position = (cells[i] + _REACH) * per_deviate
            known = position == position
            inside = min(max(position, 0.0), last + 1.0) if known else 0.0
            at[i] = min(np.uint32(inside), last)
            share[i] = inside - at[i] if known else np.nan
        if by_class:
            of_cells = numbers[first : first + _RUN]
            for i in range(cells.size):
                number = np.uint32(of_cells[i])
                share[i] = 0.0 if same[number] else share[i]
                at[i] += number * np.uint32(size)
        for i in range(cells.size):
            k = np.uint64(at[i])
            values[i] = flat[k] * (1.0 - share[i]) + flat[k + np.uint64(1)] * share[i]


def rank_map(field, distribution):
    """Map a field to quantiles (rank + 1/2) / n of a distribution, [Friedl1995]_, Fig. 2, step 5."""
    values = np.empty(field.size)
    values[np.argsort(field, axis=None, kind="stable")] = rank_quantiles(distribution, field.size)
    return values.reshape(field.shape)


def rank_quantiles(distribution, count):
    """Quantiles of a distribution at (rank + 1/2) / count, shape (count,), cached for small counts."""
    return (_kept_quantiles if count <= _FEW else _kept_quantiles.__wrapped__)(distribution, count)


@cached(16, "quantiles of ranks")
def _kept_quantiles(distribution, count):
    return distribution.ppf((np.arange(count) + 0.5) / count)
