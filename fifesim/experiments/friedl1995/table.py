"""Table 2 of Friedl et al. (1995) over realisations, compared with the published values."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from fifesim.analysis import regression
from fifesim.base.caches import cached
from fifesim.chain.driver import Driver, cell_block_means
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.case import ARPS, VARIABLES
from fifesim.ground.landscape.autoregression import periodic_field
from fifesim.ground.landscape.distribution import lai_distribution, rank_quantiles, treatments


def paired(*arrays):
    """Valid pixels of several arrays paired by row and column, shape (arrays, pixels); larger arrays are cut."""
    rows, columns = (min(sizes) for sizes in zip(*(each.shape for each in arrays), strict=True))
    values = np.stack([each[:rows, :columns].ravel() for each in arrays])
    return values[:, np.isfinite(values).all(axis=0)]


# Larger fields are not cached. [cell]
_FEW = 2**18


class Cells(NamedTuple):
    """Cells of a scene: LAI and FPAR, shape (y, x), and reflectance, shape (band, y, x)."""

    lai: np.ndarray
    fpar: np.ndarray
    reflectance: np.ndarray


def cells_of(case, treatment, arp, seed, light=None, driver=None):
    """Cells of a scene by the method of the paper: one Fourier transform of the scene, and exact ranks."""
    driver = driver or Driver(case.setup)
    lai = periodic_scene(case.densities[treatment], arp, seed, tuple(case.grid.shape))
    reflectance = driver.reflectance(lai)
    if light is not None:
        reflectance = driver.on_slopes(reflectance, light)
    return Cells(lai, driver.fpar(lai, case.common.ground.fpar_inf), reflectance)


def periodic_scene(density, arp, seed, shape):
    """Leaf area with exactly the density, by the periodic method of `fifesim.lai_scene`, shape (y, x). [m2 m-2]"""
    lai = np.empty(shape)
    order = (_kept_order if lai.size <= _FEW else _order)(seed, arp, shape)
    lai.ravel()[order] = rank_quantiles(lai_distribution(density), lai.size)
    return lai


def _order(seed, arp, shape):
    """Order of the cells of a field, from the smallest to the largest."""
    return np.argsort(periodic_field(seed, arp, shape), axis=None, kind="stable")


# The three treatments of a seed, and cases that change one number, share the same field.
_kept_order = cached(8, "order of cells")(_order)


SAMPLE = 200
COEFFICIENTS = ("intercept", "slope", "r2")

# Number of samples of 200 pixels per realisation.
_DRAWS = 25

# Widths of the increments for REN, not stated in the paper. At arp 0.05 LAI has four increments.
INCREMENTS = {"lai": 0.1, "fpar": 0.05}
_FEWEST = 3

# Results of one scene and their dimensions.
_DIMS = {
    **dict.fromkeys(COEFFICIENTS, ("variable",)),
    **{f"{name}_200": ("variable", "draw") for name in COEFFICIENTS},
    "ren": ("variable",),
    "range_kept": ("quantity",),
}


def realise_scenes(case, seeds, readings=None, distributions=None, arps=ARPS, each=iter):
    """Lines, noise and ranges of scenes with several seeds, dims (reading, realisation, distribution, arp)."""
    cases = [case] if readings is None else [replace(case, reading=reading) for reading in readings]
    distributions = treatments() if distributions is None else list(distributions)
    light = case.light()
    scenes = [(seed, treatment, arp) for seed in seeds for treatment in distributions for arp in arps]
    drivers = [Driver(one.setup) for one in cases]
    found = [_scene(cases, drivers, light, *scene) for scene in each(scenes)]
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
    """Table 2 compared with the published values, with standard deviations over realisations and samples."""
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


def text_table(found):
    """Mean noise and relative range of the burned, grazed scenes, compared with the published values."""
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
    """Intercept, slope and R2 of least-squares lines of samples, shape (..., 3)."""
    x_mean, y_mean = x.mean(axis=-1), y.mean(axis=-1)
    x_about, y_about = x - x_mean[..., None], y - y_mean[..., None]
    xx, xy, yy = (x_about * x_about).sum(axis=-1), (x_about * y_about).sum(axis=-1), (y_about * y_about).sum(axis=-1)
    slope = xy / xx
    return np.stack([y_mean - slope * x_mean, slope, slope * xy / yy], axis=-1)


def mean_noise(variable, ndvi, increment, slope=None):
    """Mean and relative equivalent noise [1] in increments of at least three pixels, shape (increments,)."""
    first, last = int(np.floor(variable.min() / increment)), int(np.floor(variable.max() / increment))
    increments, origin = last - first + 1, float(ndvi.mean())
    sums = regression.increment_sums(variable[None], ndvi[None], first, increment, increments, origin)
    count, mean, deviation = regression.increment_moments(sums)
    enough = count >= _FEWEST
    slope = line(variable, ndvi)[1] if slope is None else slope
    return mean[enough], regression.equivalent_noise(deviation[enough], slope, mean[enough])


def draw(pixels, count, seed, draws):
    """Samples of pixels without repetition, shape (k, draws, count)."""
    return pixels[:, _drawn(tuple(seed), pixels.shape[1], count, draws)]


# Readings of a scene, and scenes that differ in one number, are sampled at the same pixels.
@cached(256, "drawn pixels")
def _drawn(seed, pixels, count, draws):
    order = np.random.default_rng(seed).random((draws, pixels)).argsort(axis=1)
    return order[:, :count].copy()


def _scene(cases, drivers, light, seed, treatment, arp):
    """Statistics of a scene under each reading, a list of dicts."""
    case, driver = cases[0], drivers[0]
    cells = cells_of(case, treatment, arp, seed, light, driver)
    truth = [cell_block_means(array, case.grid, case.pixel, case.setup.min_valid) for array in (cells.lai, cells.fpar)]
    of_cells = driver.ndvi(driver.toa(cells.reflectance))
    limits = np.array([(each.min(), each.max()) for each in (cells.lai, cells.fpar, of_cells)])
    key = (seed, friedl1995.scenes().index((treatment, arp)))
    found = []
    for one, each in zip(cases, drivers, strict=True):
        ndvi = each.ndvi(each.planetary(each.image(each.toa(cells.reflectance), one.grid)))
        found.append(_statistics(paired(*truth, ndvi), limits, key))
    return found


def _statistics(pixels, limits, key):
    samples = draw(pixels, SAMPLE, key, _DRAWS)
    found = {}
    for suffix, values in (("", pixels), ("_200", samples)):
        lines = np.stack([line(values[2], values[k]) for k in range(2)])
        # Samples of all pixels do not differ, and have no standard deviation to divide by.
        lines = np.full_like(lines, np.nan) if suffix and pixels.shape[-1] <= SAMPLE else lines
        found |= {name + suffix: lines[..., number] for number, name in enumerate(COEFFICIENTS)}
    found["ren"] = [_noise_of_samples(samples[k], samples[2], INCREMENTS[name]) for k, name in enumerate(VARIABLES)]
    found["range_kept"] = np.ptp(samples, axis=-1).mean(axis=-1) / np.ptp(limits, axis=-1)
    return found


def _noise_of_samples(variable, ndvi, increment):
    """Mean relative equivalent noise of samples, averaged over the increments of each."""
    slopes = line(variable, ndvi)[:, 1]
    samples = zip(variable, ndvi, slopes, strict=True)
    return np.mean([mean_noise(one, seen, increment, slope)[1].mean() for one, seen, slope in samples])
