"""Frequency distributions of leaf area index."""

from __future__ import annotations

import re
from difflib import get_close_matches
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import optimize, stats

from fifesim.base import datasets
from fifesim.base.annotations import Distribution, LaiDistribution
from fifesim.base.foreign import in_a_line, read_csv
from fifesim.ground.canopy.leaf_area import LARGEST_OF_MAPS

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
    >>> from fifesim import treatments
    >>> treatments()
    ['burned-grazed', 'burned-ungrazed', 'unburned-ungrazed']
    """
    return list(_treatments())


@lru_cache(maxsize=1)
def _treatments():
    return tuple(datasets.table("lai_distributions.csv")["treatment"].tolist())


def lai_distribution(source: LaiDistribution) -> Distribution:
    """
    A frequency distribution of leaf area index.

    Parameters
    ----------
    source : str, path or frozen scipy distribution
        A treatment of `treatments`, a CSV file whose column ``lai`` (or whose only column) holds samples from 0 to 20,
        or any frozen continuous distribution of `scipy.stats` without negative values.

    Returns
    -------
    distribution : frozen scipy distribution
        Of LAI. [m2 m-2]

    Raises
    ------
    ValueError
        If the name is unknown, the file holds no usable samples, or LAI could be negative.
    TypeError
        If the source is none of these.

    References
    ----------
    [Friedl1995]_, Fig. 3

    Examples
    --------
    >>> from fifesim import lai_distribution
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
        return source
    if not isinstance(source, str | Path):
        raise TypeError(f"an LAI distribution is a name, a CSV file or a frozen scipy distribution, got {type(source)}")
    if str(source) in treatments():
        return _treatment(str(source))
    if Path(source).suffix.lower() == ".csv":
        return kernel_density(read_samples(source))
    near = get_close_matches(str(source), treatments(), n=1, cutoff=0.3)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise ValueError(
        f"unknown LAI distribution {str(source)!r}: {hint}allowed are {', '.join(treatments())}, or a .csv of samples"
    )


def read_samples(path):
    """
    LAI samples of a CSV file.

    Parameters
    ----------
    path : str or path
        A table with one column ``lai``, or with a single column of any name. ``#`` starts a comment, and empty cells
        are skipped.

    Returns
    -------
    samples : array, shape (n,)
        [m2 m-2]

    Raises
    ------
    ValueError
        If the file cannot be read, if it is unclear which column holds LAI, if a cell is not a number from 0 to 20, or
        if there are fewer than five samples. The message names the line and the value.
    """
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
    """Position of the column that holds LAI."""
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
    """Line in a CSV file of a row of its table, counted from 1."""
    with open(path, encoding="utf-8") as file:
        lines = [number for number, line in enumerate(file, 1) if line.partition("#")[0].strip()]
    return lines[row + 1]


def kernel_density(samples):
    """
    Gaussian kernel density of LAI samples, reflected at zero, so that no mass lies below it.

    Parameters
    ----------
    samples : array, shape (n,)
        At least five, not negative, not all the same. [m2 m-2]

    Returns
    -------
    distribution : frozen scipy distribution
        With Scott's bandwidth.

    Raises
    ------
    ValueError
        If all samples are the same.

    References
    ----------
    [Silverman1986]_, Section 2.10 (reflection at a boundary)
    """
    samples = np.asarray(samples, float)
    bandwidth = np.std(samples, ddof=1) * samples.size ** (-1 / 5)
    if not bandwidth > 0:
        raise ValueError(f"all {samples.size} LAI samples are {samples[0]:g}: a density needs some spread")
    return _ReflectedKernels(samples, bandwidth).freeze()


class _ReflectedKernels(stats.rv_continuous):
    """Mixture of normals at the samples and at their mirror images, kept above zero."""

    def __init__(self, samples, bandwidth):
        # Seven bandwidths past the largest sample lie 1e-12 of a kernel.
        super().__init__(a=0.0, b=float(samples.max() + 7 * bandwidth), name="reflected_kernels")
        self._samples, self._bandwidth = samples, bandwidth

    def _updated_ctor_param(self):
        return {"samples": self._samples, "bandwidth": self._bandwidth}

    def _pdf(self, x):
        z, mirrored = self._distances(x)
        return np.mean(stats.norm.pdf(z) + stats.norm.pdf(mirrored), axis=-1) / self._bandwidth

    def _cdf(self, x):
        z, mirrored = self._distances(x)
        return np.mean(stats.norm.cdf(z) + stats.norm.cdf(mirrored) - 1.0, axis=-1)

    def _sf(self, x):
        z, mirrored = self._distances(x)
        return np.mean(stats.norm.sf(z) + stats.norm.sf(mirrored), axis=-1)

    def _ppf(self, q):
        nodes, below, _ = self._tables
        return np.interp(q, below, nodes)

    def _isf(self, q):
        nodes, _, above = self._tables
        return np.interp(-q, -above, nodes)

    @cached_property
    def _tables(self):
        """Probability below and above evenly spaced values, a step of 1/8192 of the support apart."""
        nodes = np.linspace(self.a, self.b, 2**13 + 1)
        return nodes, self._cdf(nodes), self._sf(nodes)

    def _distances(self, x):
        x = np.asarray(x)[..., None]
        return (x - self._samples) / self._bandwidth, (x + self._samples) / self._bandwidth


@lru_cache
def _treatment(name):
    row = datasets.table("lai_distributions.csv").set_index("treatment").loc[name]
    return truncated_normal(row["mean"], row["standard_deviation"], row["lower"], row["upper"])


def truncated_normal(mean, standard_deviation, lower, upper):
    """
    Normal distribution truncated at two bounds, given its own mean and standard deviation.

    Parameters
    ----------
    mean, standard_deviation : float
        Of the truncated distribution.
    lower, upper : float
        Bounds.

    Returns
    -------
    distribution : frozen scipy.stats.truncnorm

    Raises
    ------
    ValueError
        If no truncated normal has these moments.

    Examples
    --------
    >>> d = truncated_normal(0.74, 0.53, 0.0, 2.2)
    >>> round(float(d.mean()), 9), round(float(d.std()), 9)
    (0.74, 0.53)
    """

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
