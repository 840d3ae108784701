"""Effects of the deviations from Friedl et al. (1995), for the page `paper.md`."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from paper_effects import READINGS, Case

import fifesim
from fifesim.analysis.scaling_labels import aggregate_blocks
from fifesim.atmosphere.labels import diffuse_fraction
from fifesim.base.geometry import sun_geometry
from fifesim.base.times import SITE_ALTITUDE, SITE_LATITUDE, SITE_LONGITUDE, SITE_SIZE
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.chain.steps import ndvi
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.case import CELL
from fifesim.experiments.friedl1995.table import line, paired
from fifesim.ground.canopy import labels as canopy
from fifesim.ground.canopy import optics_labels
from fifesim.ground.canopy.labels import BandCanopy, Light
from fifesim.ground.canopy.layers import extinction_coefficient
from fifesim.ground.landscape.autoregression import autocorrelation, correlation_length
from fifesim.ground.landscape.lai_labels import lai_scene
from fifesim.scenario.ground import elevation, in_memory
from fifesim.sensor.instrument_labels import attributes_of

# Length scales of the three landscapes, "roughly" (Analyses). [m]
LENGTHS = {0.05: 5, 0.15: 15, 0.24: 30}


def fits(
    case, seeds, change=None, method="periodic", reflectance=reflectance_of, land=(None, None)
):
    """
    Regressions of LAI on NDVI of the nine scenes with a change.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int
    change : dict, optional
        Changed fields of the `fifesim.Setup`.
    method : str, optional
        Method of the random field.
    reflectance : callable, optional
        Function of a setup and LAI that returns reflectance.
    land : (xarray.DataArray, xarray.DataArray), optional
        Elevation and horizon.

    Returns
    -------
    lines : array, shape (realisation, scene, 3)
        Intercept, slope and R2.
    """
    found = []
    for seed in seeds:
        for treatment, arp in friedl1995.scenes():
            setup = replace(case.setup, dem=land[0], horizon=land[1], **(change or {}))
            lai = lai_scene(
                case.grid, case.densities[treatment], arp=arp, seed=seed, method=method
            )
            image = image_of(setup, reflectance(setup, lai).compute())
            truth = aggregate_blocks(lai, case.pixel, min_valid=setup.min_valid)
            values = paired(truth.values, ndvi(image).values)
            found.append(line(values[1], values[0]))
    return np.array(found).reshape(len(seeds), len(friedl1995.scenes()), 3)


def effect(lines, base):
    """Effect of a change on the nine rows of LAI: mean and largest change of R2, mean relative change of slopes."""
    after, before = lines.mean(axis=0), base.mean(axis=0)
    r2 = after[:, 2] - before[:, 2]
    return {
        "r2": r2.mean(),
        "r2_largest": np.abs(r2).max(),
        "slope": np.mean(after[:, 1] / before[:, 1] - 1),
    }


def deviations(seeds):
    """
    Effects of the deviations that can be computed.

    Parameters
    ----------
    seeds : sequence of int

    Returns
    -------
    effects : dict
    """
    case = Case()
    base = fits(case, seeds)
    hills = replace(case, dem="flint-hills")
    land = in_memory(*elevation(hills.common, hills.grid)[:2])
    on_hills = fits(hills, seeds, land=land)
    narrow = replace(case.instrument, lsf=replace(case.instrument.lsf, count=8))
    return {
        "lengths": lengths(),
        "sky": sky(case) | effect(fits(case, seeds, reflectance=_by_sunlight), base),
        "facet": facet(land[0])
        | effect(fits(hills, seeds, {"upwelling": False}, land=land), on_hills),
        "streaming": effect(fits(case, seeds, method="streaming"), base),
        "eight": effect(fits(case, seeds, {"instrument": narrow}), base)
        | {"width": narrow.line_spread.width},
        "orders": effect(fits(case, seeds, {"atmosphere": _polarized()}), base),
        "blur": blur(case, seeds),
        "sun": sun(),
        "edge": 1 / np.cos(np.radians(case.instrument.scan.max_angle)),
        "site": (SITE_SIZE / 100) ** 2,
    }


def lengths():
    """
    Correlation of the process compared with the length scales of the paper.

    Returns
    -------
    lengths : list of dict
        By ``arp``: ``length`` in the ``paper`` and in fifesim [m], correlation of ``neighbour`` cells and at the
        length in the paper (``there``), and the factor by which it falls from one cell to the next (``left``). [1]
    """
    found, cells = [], np.arange(12)
    for arp, length in LENGTHS.items():
        correlation = autocorrelation(arp, cells)
        there = np.exp(np.interp(length / CELL, cells, np.log(correlation)))
        row = {
            "arp": arp,
            "paper": length,
            "length": correlation_length(arp, CELL),
            "there": there,
        }
        found.append(
            row | {"neighbour": correlation[1], "left": correlation[4] / correlation[3]}
        )
    return found


def blur(case, seeds):
    """Slopes of LAI with the widest blur over brighter soil, relative to the paper, and their growth with arp."""
    soil = {"TM3": 0.25, "TM4": 0.19}
    blurred = replace(case, reading=READINGS["blur-48.6"])
    slope = fits(
        blurred, seeds, {"canopy": blurred.setup.canopy.replace(background=soil)}
    ).mean(axis=0)[:, 1]
    paper = friedl1995.paper_table().query("variable == 'lai'")["slope"].to_numpy()
    by_arp = slope.reshape(3, 3)
    factor = np.exp(np.log(slope / paper).mean())
    return {
        "background": soil["TM3"],
        "factor": factor,
        "growth": np.mean(by_arp[:, 2] / by_arp[:, 0]),
    }


def sky(case):
    """Fraction of skylight, and its effect on the mean NDVI of the ground (burned, grazed)."""
    setup, density = case.setup, case.densities["burned-grazed"]
    lai = lai_scene(case.grid, density, arp=0.15, seed=0)
    with_sky, without = (
        float(ndvi(reflectance(setup, lai)).mean())
        for reflectance in (reflectance_of, _by_sunlight)
    )
    fractions = dict(zip(("red", "nir"), map(float, _sky_fractions(setup)), strict=True))
    return fractions | {"ndvi": with_sky - without}


def facet(dem):
    """Factor of Eq. 5 at nadir, the cosine of the slope: at 20 degrees, and over the synthetic hills."""
    cosine = np.cos(np.radians(fifesim.terrain.slope(dem).values))
    return {
        "at_20": np.cos(np.radians(20)),
        "mean": np.nanmean(cosine),
        "least": np.nanquantile(cosine, 0.01),
    }


def sun():
    """Solar zenith angle and K at the assumed time of the overpass, and eight minutes before and after."""
    found = []
    for minute in (27, 35, 43):
        sza = float(
            sun_geometry(
                f"1987-06-06T16:{minute}Z", SITE_LATITUDE, SITE_LONGITUDE, SITE_ALTITUDE
            ).sza
        )
        found.append(
            {"time": f"16:{minute}", "sza": sza, "k": float(extinction_coefficient(sza))}
        )
    return found


@lru_cache
def _polarized():
    return fifesim.Atmosphere(engine="successive-orders")


def _sky_fractions(setup):
    bands = tuple(band.response for band in setup.instrument.select(setup.bands))
    atmosphere = setup.atmosphere or fifesim.Atmosphere()
    return diffuse_fraction(atmosphere, bands, setup.geometry or fifesim.fife_geometry())


def _by_sunlight(setup, lai):
    """Reflectance of level ground by SAIL for sunlight alone."""
    bands = setup.instrument.select(setup.bands)
    responses = tuple(band.response for band in bands)
    description = setup.canopy
    leaf = optics_labels.leaf_optics(responses, description.leaf_optics, lai, exact=False)
    ground = optics_labels.background(responses, description.background, lai)
    stand = BandCanopy(description, leaf, None, ground)
    return canopy.level_reflectance(
        lai,
        bands,
        stand,
        Light(setup.geometry or fifesim.fife_geometry(), np.zeros(len(bands))),
        atmosphere=(setup.atmosphere or fifesim.Atmosphere()).text,
        **attributes_of(setup.instrument),
    )
