"""Table 2 of Friedl et al. (1995) over realisations, and how far it agrees with the paper's."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from fifesim.analysis import uncertainty
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.case import ARPS, VARIABLES

SAMPLE = 200
COEFFICIENTS = ("intercept", "slope", "r2")

# Samples of 200 pixels that are drawn from each realisation.
_DRAWS = 25

# Widths of the increments in which noise is counted: the paper does not state them. At arp 0.05 they leave LAI four.
INCREMENTS = {"lai": 0.1, "fpar": 0.05}
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class Outcome:
    """
    What the realisations gave.

    Parameters
    ----------
    fits : array, shape (realisation, scene, variable, 3)
        Intercept, slope and R2 of all pixels.
    sampled : array, shape (realisation, scene, variable, draw, 3)
        The same of samples of 200 pixels.
    ren : array, shape (realisation, scene, variable)
        Mean relative equivalent noise of a sample over its increments, in the mean over samples. [1]
    kept : array, shape (realisation, scene, 3)
        Share of the range of the cells of LAI, FPAR and NDVI that a sample has, in the mean over samples. [1]
    """

    fits: np.ndarray
    sampled: np.ndarray
    ren: np.ndarray
    kept: np.ndarray


def realise(case, seeds, scenes=None, each=iter):
    """
    Run scenes with several seeds.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int
        One for each realisation; the scenes of one share their noise.
    scenes : sequence of (str, float), optional
        The nine by default.
    each : callable, optional
        Wraps the sequence of (seed, scene), to show how far it is.

    Returns
    -------
    outcome : Outcome
    """
    scenes = friedl1995.scenes() if scenes is None else scenes
    found = [_one(case, scene, seed) for seed, scene in each([(seed, scene) for seed in seeds for scene in scenes])]
    stacked = (np.array(values) for values in zip(*found, strict=True))
    return Outcome(*(values.reshape(len(seeds), len(scenes), *values.shape[1:]) for values in stacked))


def table2(outcome):
    """
    Table 2 beside the paper's.

    Parameters
    ----------
    outcome : Outcome
        Of the nine scenes.

    Returns
    -------
    table : pandas.DataFrame
        Columns variable, distribution, arp; intercept, slope and r2, the means over realisations; these with
        ``_deviation``, their standard deviations over realisations, and with ``_deviation_200``, of a sample of 200
        pixels; and with ``paper_`` before them.
    """
    paper = friedl1995.paper_table()
    columns = {name: paper[name] for name in ("variable", "distribution", "arp")}
    # A standard deviation needs two realisations.
    spread = outcome.fits.std(axis=0, ddof=1) if len(outcome.fits) > 1 else np.full(outcome.fits.shape[1:], np.nan)
    of_samples = outcome.sampled.std(axis=(0, 3), ddof=1)
    for suffix, values in (("", outcome.fits.mean(axis=0)), ("_deviation", spread), ("_deviation_200", of_samples)):
        for k, name in enumerate(COEFFICIENTS):
            columns[name + suffix] = values[:, :, k].T.ravel()
    columns |= {f"paper_{name}": paper[name] for name in COEFFICIENTS}
    return pd.DataFrame(columns)


def agreement(table):
    """
    How far a table is from the paper's.

    Parameters
    ----------
    table : pandas.DataFrame
        From `table2`.

    Returns
    -------
    agreement : dict of str to float
        By variable, ``lai`` or ``fpar``: root mean square and largest difference of R2, the same of the three rows at
        arp 0.24, root mean square, mean and largest relative difference of slopes, largest difference of intercepts;
        and ``chi_square``, the mean over all coefficients of the squared difference in standard deviations of a sample.
    """
    found = {}
    for variable, rows in table.groupby("variable"):
        r2 = rows["r2"] - rows["paper_r2"]
        slope = rows["slope"] / rows["paper_slope"] - 1
        found |= {
            f"{variable}_r2_rms": np.sqrt(np.mean(r2**2)),
            f"{variable}_r2_largest": r2.abs().max(),
            f"{variable}_r2_largest_long": r2[rows["arp"] == max(ARPS)].abs().max(),
            f"{variable}_slope_rms": np.sqrt(np.mean(slope**2)),
            f"{variable}_slope_mean": slope.mean(),
            f"{variable}_slope_largest": slope.abs().max(),
            f"{variable}_intercept_largest": (rows["intercept"] - rows["paper_intercept"]).abs().max(),
        }
    scores = [(table[name] - table[f"paper_{name}"]) / table[f"{name}_deviation_200"] for name in COEFFICIENTS]
    found["chi_square"] = np.mean(np.square(scores))
    return {name: float(value) for name, value in found.items()}


def text_table(outcome):
    """
    Mean noise and range kept of the burned, grazed scenes, beside the paper's.

    Parameters
    ----------
    outcome : Outcome
        Of the nine scenes.

    Returns
    -------
    table : pandas.DataFrame
        Columns quantity, variable, arp, value, deviation over realisations, and paper, NaN where it states none.
    """
    paper = friedl1995.paper_text().set_index(["quantity", "variable", "arp"])["value"]
    rows = []
    for quantity, values in (("ren", outcome.ren), ("range_kept", outcome.kept)):
        # Two variables have REN, NDVI keeps a range as well.
        for k, variable in enumerate((*VARIABLES, "ndvi")[: values.shape[-1]]):
            # Burned and grazed is the first treatment of the table.
            for scene, arp in enumerate(ARPS):
                found = values[:, scene, k]
                deviation = found.std(ddof=1) if len(found) > 1 else np.nan
                rows.append((quantity, variable, arp, found.mean(), deviation, paper.get((quantity, variable, arp))))
    return pd.DataFrame(rows, columns=["quantity", "variable", "arp", "value", "deviation", "paper"])


def line(x, y):
    """
    Least-squares lines of samples.

    Parameters
    ----------
    x, y : array, shape (..., n)

    Returns
    -------
    coefficients : array, shape (..., 3)
        Intercept, slope and R2.

    Examples
    --------
    >>> line(np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0])).tolist()
    [1.0, 2.0, 1.0]
    """
    x_mean, y_mean = x.mean(axis=-1), y.mean(axis=-1)
    x_about, y_about = x - x_mean[..., None], y - y_mean[..., None]
    xx, xy, yy = (x_about * x_about).sum(axis=-1), (x_about * y_about).sum(axis=-1), (y_about * y_about).sum(axis=-1)
    slope = xy / xx
    return np.stack([y_mean - slope * x_mean, slope, slope * xy / yy], axis=-1)


def mean_noise(variable, ndvi, increment):
    """
    Mean over increments of the relative equivalent noise of a sample.

    Parameters
    ----------
    variable, ndvi : array, shape (n,)
    increment : float
        Width, in units of the variable.

    Returns
    -------
    values, noise : array, shape (increments,)
        Mean of the variable and its relative equivalent noise in increments of at least three pixels. [1]
    """
    first, last = int(np.floor(variable.min() / increment)), int(np.floor(variable.max() / increment))
    increments, origin = last - first + 1, float(ndvi.mean())
    sums = uncertainty.increment_sums(variable[None], ndvi[None], first, increment, increments, origin)
    count, mean, deviation = uncertainty.increment_moments(sums)
    enough = count >= _FEWEST
    slope = line(variable, ndvi)[1]
    return mean[enough], uncertainty.equivalent_noise(deviation[enough], slope, mean[enough])


def draw(pixels, count, seed, draws):
    """
    Samples of pixels without repetition.

    Parameters
    ----------
    pixels : array, shape (k, n)
    count : int
        At most n are drawn.
    seed : sequence of int
    draws : int

    Returns
    -------
    samples : array, shape (k, draws, count)
    """
    order = np.random.default_rng(seed).random((draws, pixels.shape[1])).argsort(axis=1)
    return pixels[:, order[:, :count]]


def _one(case, scene, seed):
    treatment, arp = scene
    pixels, limits = friedl1995.run(case, treatment, arp, seed)
    samples = draw(pixels, SAMPLE, [seed, friedl1995.scenes().index(scene)], _DRAWS)
    fits = np.stack([line(pixels[2], pixels[k]) for k in range(2)])
    sampled = np.stack([line(samples[2], samples[k]) for k in range(2)])
    ren = [
        np.mean([mean_noise(*pair, INCREMENTS[name])[1].mean() for pair in zip(samples[k], samples[2], strict=True)])
        for k, name in enumerate(VARIABLES)
    ]
    kept = np.ptp(samples, axis=-1).mean(axis=-1) / np.ptp(limits, axis=-1)
    return fits, sampled, np.array(ren), kept
