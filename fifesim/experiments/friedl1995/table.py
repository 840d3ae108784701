"""Table 2 of Friedl et al. (1995) over realisations, and how far it agrees with the paper's."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pandas as pd
import xarray as xr

from fifesim.analysis import uncertainty
from fifesim.chain.arrays import ArrayChain
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.case import ARPS, VARIABLES
from fifesim.experiments.friedl1995.cells import cells_of
from fifesim.experiments.friedl1995.pixels import paired
from fifesim.ground.landscape.distribution import treatments

SAMPLE = 200
COEFFICIENTS = ("intercept", "slope", "r2")

# Samples of 200 pixels that are drawn from each realisation.
_DRAWS = 25

# Widths of the increments in which noise is counted: the paper does not state them. At arp 0.05 they leave LAI four.
INCREMENTS = {"lai": 0.1, "fpar": 0.05}
_FEWEST = 3

# What one scene gives, and along what.
_DIMS = {
    **dict.fromkeys(COEFFICIENTS, ("variable",)),
    **{f"{name}_200": ("variable", "draw") for name in COEFFICIENTS},
    "ren": ("variable",),
    "range_kept": ("quantity",),
}


def realise(case, seeds, readings=None, distributions=None, arps=ARPS, each=iter):
    """
    Run scenes with several seeds.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int
        One for each realisation; the scenes of one share their noise.
    readings : sequence of Reading, optional
        Of the same ground; by default the case's alone.
    distributions : sequence of str, optional
        Treatments; all by default.
    arps : sequence of float, optional
        [1]
    each : callable, optional
        Wraps the sequence of scenes, to show how far it is.

    Returns
    -------
    found : xarray.Dataset
        Over (reading, realisation, distribution, arp): ``intercept``, ``slope`` and ``r2`` of all pixels along
        ``variable``, and those of samples of 200 pixels, ``intercept_200`` and so on, along ``draw``; ``ren``, the mean
        relative equivalent noise of a sample over its increments, and ``range_kept``, the share of the range of the
        cells that a sample has, along ``quantity``, both in the mean over samples. [1]
    """
    cases = [case] if readings is None else [replace(case, reading=reading) for reading in readings]
    distributions = treatments() if distributions is None else list(distributions)
    land = case.land()
    scenes = [(seed, treatment, arp) for seed in seeds for treatment in distributions for arp in arps]
    chains = [ArrayChain(one.setup, one.grid) for one in cases]
    found = [_scene(cases, chains, land, *scene) for scene in each(scenes)]
    shape = (len(seeds), len(distributions), len(arps), len(cases))
    outer = ("realisation", "distribution", "arp", "reading")
    variables = {}
    for name, dims in _DIMS.items():
        values = np.array([[one[name] for one in scene] for scene in found])
        variables[name] = (outer + dims, values.reshape(*shape, *values.shape[2:]), {"units": "1"})
    coords = {"reading": [each.reading.name for each in cases], "realisation": list(seeds), "arp": list(arps)}
    coords |= {"distribution": distributions, "variable": list(VARIABLES), "quantity": [*VARIABLES, "ndvi"]}
    return xr.Dataset(variables, coords=coords).transpose("reading", "realisation", "distribution", "arp", ...)


def table2(found):
    """
    Table 2 beside the paper's.

    Parameters
    ----------
    found : xarray.Dataset
        From `realise`, of one reading and the nine scenes.

    Returns
    -------
    table : pandas.DataFrame
        Columns variable, distribution, arp; intercept, slope and r2, the means over realisations; these with
        ``_deviation``, their standard deviations over realisations, and with ``_deviation_200``, of a sample of 200
        pixels; and with ``paper_`` before them.
    """
    paper = friedl1995.paper_table()
    columns = {name: paper[name] for name in ("variable", "distribution", "arp")}
    for name in COEFFICIENTS:
        values, sampled = found[name], found[f"{name}_200"]
        # A standard deviation needs two realisations.
        one = values.sizes["realisation"] == 1
        spread = values.isel(realisation=0) * np.nan if one else values.std("realisation", ddof=1)
        of_samples = sampled.std(("realisation", "draw"), ddof=1)
        for suffix, each in (("", values.mean("realisation")), ("_deviation", spread), ("_deviation_200", of_samples)):
            columns[name + suffix] = each.transpose("variable", "distribution", "arp").values.ravel()
    order = [name + suffix for suffix in ("", "_deviation", "_deviation_200") for name in COEFFICIENTS]
    columns = {name: columns[name] for name in ("variable", "distribution", "arp", *order)}
    return pd.DataFrame(columns | {f"paper_{name}": paper[name] for name in COEFFICIENTS})


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
        arp 0.24, root mean square, mean and largest relative difference of slopes, what is left of its root mean square
        after one common ``factor``, largest difference of intercepts; and the root mean square over all coefficients of
        the difference in standard deviations, ``if_sampled`` of a sample of 200 pixels, and ``if_all`` of one
        realisation of all pixels.
    """
    found = {}
    for variable, rows in table.groupby("variable"):
        r2 = rows["r2"] - rows["paper_r2"]
        ratio = rows["slope"] / rows["paper_slope"]
        factor = np.exp(np.log(ratio).mean()) if (ratio > 0).all() else np.nan
        found |= {
            f"{variable}_r2_rms": np.sqrt(np.mean(r2**2)),
            f"{variable}_r2_largest": r2.abs().max(),
            f"{variable}_r2_largest_long": r2[rows["arp"] == max(ARPS)].abs().max(),
            f"{variable}_slope_rms": np.sqrt(np.mean((ratio - 1) ** 2)),
            f"{variable}_slope_mean": (ratio - 1).mean(),
            f"{variable}_slope_largest": (ratio - 1).abs().max(),
            f"{variable}_slope_factor": factor,
            f"{variable}_slope_rest": np.sqrt(np.mean((ratio / factor - 1) ** 2)),
            f"{variable}_intercept_largest": (rows["intercept"] - rows["paper_intercept"]).abs().max(),
        }
    for name, suffix in (("if_sampled", "_deviation_200"), ("if_all", "_deviation")):
        scores = [(table[each] - table[f"paper_{each}"]) / table[each + suffix] for each in COEFFICIENTS]
        found[name] = np.sqrt(np.mean(np.square(scores)))
    return {name: float(value) for name, value in found.items()}


def text_table(found):
    """
    Mean noise and range kept of the burned, grazed scenes, beside the paper's.

    Parameters
    ----------
    found : xarray.Dataset
        From `realise`, of one reading.

    Returns
    -------
    table : pandas.DataFrame
        Columns quantity, variable, arp, value, deviation over realisations, and paper, NaN where it states none.
    """
    paper = friedl1995.paper_text().set_index(["quantity", "variable", "arp"])["value"]
    shown = found.sel(distribution=treatments()[0])
    rows = []
    for quantity, along in (("ren", "variable"), ("range_kept", "quantity")):
        for name in found[along].values:
            for arp in ARPS:
                values = shown[quantity].sel({along: name, "arp": arp}).values
                deviation = values.std(ddof=1) if values.size > 1 else np.nan
                rows.append((quantity, name, arp, values.mean(), deviation, paper.get((quantity, name, arp))))
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


def mean_noise(variable, ndvi, increment, slope=None):
    """
    Relative equivalent noise of a sample by increments.

    Parameters
    ----------
    variable, ndvi : array, shape (n,)
    increment : float
        Width, in units of the variable.
    slope : float, optional
        Of the sample's line, where it is known.

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
    slope = line(variable, ndvi)[1] if slope is None else slope
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
    return pixels[:, _drawn(tuple(seed), pixels.shape[1], count, draws)]


# Readings of a scene, and scenes that differ in one number, have samples of the same places.
@lru_cache(maxsize=256)
def _drawn(seed, pixels, count, draws):
    order = np.random.default_rng(seed).random((draws, pixels)).argsort(axis=1)
    return order[:, :count].copy()


def _scene(cases, chains, land, seed, treatment, arp):
    """What each reading gives of a scene, a list of dicts."""
    first, kernels = chains[0], chains[0].kernels
    cells = cells_of(cases[0], treatment, arp, seed, land, kernels)
    truth = [first.means(array, cases[0].pixel) for array in (cells.lai, cells.fpar)]
    toa = kernels.toa(cells.reflectance)
    limits = np.array([(each.min(), each.max()) for each in (cells.lai, cells.fpar, kernels.ndvi(toa))])
    key = (seed, friedl1995.scenes().index((treatment, arp)))
    found = []
    for chain in chains:
        image = chain.image(chain.kernels.toa(cells.reflectance))
        ndvi = chain.kernels.ndvi(chain.kernels.planetary(image))
        found.append(_statistics(paired(*truth, ndvi), limits, key))
    return found


def _statistics(pixels, limits, key):
    samples = draw(pixels, SAMPLE, key, _DRAWS)
    found = {}
    for suffix, values in (("", pixels), ("_200", samples)):
        lines = np.stack([line(values[2], values[k]) for k in range(2)])
        found |= {name + suffix: lines[..., number] for number, name in enumerate(COEFFICIENTS)}
    found["ren"] = [_noise_of_samples(samples[k], samples[2], INCREMENTS[name]) for k, name in enumerate(VARIABLES)]
    found["range_kept"] = np.ptp(samples, axis=-1).mean(axis=-1) / np.ptp(limits, axis=-1)
    return found


def _noise_of_samples(variable, ndvi, increment):
    """Mean relative equivalent noise of samples, each in the mean over its increments."""
    slopes = line(variable, ndvi)[:, 1]
    samples = zip(variable, ndvi, slopes, strict=True)
    return np.mean([mean_noise(one, seen, increment, slope)[1].mean() for one, seen, slope in samples])
