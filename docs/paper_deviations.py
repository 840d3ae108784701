"""How large the deviations from Friedl et al. (1995) are, for the page `paper.md`."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

import fifesim
from fifesim.analysis.scaling_labels import aggregate_blocks
from fifesim.atmosphere.labels import diffuse_fraction
from fifesim.base import times
from fifesim.base.geometry import sun_geometry
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.chain.steps import ndvi
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995.case import CELL, READINGS, Case
from fifesim.experiments.friedl1995.table import line, paired
from fifesim.ground.canopy import labels as canopy
from fifesim.ground.canopy import optics_labels
from fifesim.ground.canopy.labels import BandCanopy, Light
from fifesim.ground.canopy.layers import extinction_coefficient
from fifesim.ground.landscape.autoregression import autocorrelation, correlation_length
from fifesim.ground.landscape.lai_labels import lai_scene
from fifesim.sensor.instrument_labels import attributes_of

# Length scales of the three landscapes, "roughly" (Analyses). [m]
LENGTHS = {0.05: 5, 0.15: 15, 0.24: 30}


def fits(
    case, seeds, change=None, method="periodic", reflectance=reflectance_of, land=(None, None)
):
    """
    Lines of LAI on NDVI of the nine scenes, where something is otherwise.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int
    change : dict, optional
        Fields of the `fifesim.Setup` that are otherwise.
    method : str, optional
        Of the field.
    reflectance : callable, optional
        What makes reflectance of a setup and of LAI.
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
    """What a change does to the nine rows of LAI: mean and largest change of R2, mean relative change of slopes."""
    now, was = lines.mean(axis=0), base.mean(axis=0)
    r2 = now[:, 2] - was[:, 2]
    return {
        "r2": r2.mean(),
        "r2_largest": np.abs(r2).max(),
        "slope": np.mean(now[:, 1] / was[:, 1] - 1),
    }


def deviations(seeds):
    """
    Sizes of the deviations that can be computed.

    Parameters
    ----------
    seeds : sequence of int

    Returns
    -------
    sizes : dict
    """
    case = Case()
    base = fits(case, seeds)
    hills = replace(case, dem="flint-hills")
    land = hills.land()
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
        "site": (times.SIZE / 100) ** 2,
    }


def lengths():
    """
    The process beside the paper's lengths.

    Returns
    -------
    lengths : list of dict
        By ``arp``: the ``paper``'s length and that of fifesim [m], correlation of ``neighbour`` cells and at the
        paper's length (``there``), and what is left of it from one cell to the next (``left``). [1]
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
    """The widest blur over brighter soil: slopes of LAI over the paper's, and how they grow with arp."""
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
    """Share of skylight, and what it does to NDVI of the ground at the mean of the burned, grazed."""
    setup, density = case.setup, case.densities["burned-grazed"]
    lai = lai_scene(case.grid, density, arp=0.15, seed=0)
    mixed, alone = (
        float(ndvi(make(setup, lai)).mean()) for make in (reflectance_of, _by_sunlight)
    )
    shares = dict(zip(("red", "nir"), map(float, _shares(setup)), strict=True))
    return shares | {"ndvi": mixed - alone}


def facet(dem):
    """Eq. 5's factor at nadir, which is the cosine of the slope: at 20 degrees, and over the synthetic hills."""
    cosine = np.cos(np.radians(fifesim.slope(dem).values))
    return {
        "at_20": np.cos(np.radians(20)),
        "mean": np.nanmean(cosine),
        "least": np.nanquantile(cosine, 0.01),
    }


def sun():
    """Zenith angles and K at the assumed time of the overpass, and eight minutes to each side."""
    found = []
    for minute in (27, 35, 43):
        sza = float(
            sun_geometry(
                f"1987-06-06T16:{minute}Z", times.LATITUDE, times.LONGITUDE, times.ALTITUDE
            ).sza
        )
        found.append(
            {"time": f"16:{minute}", "sza": sza, "k": float(extinction_coefficient(sza))}
        )
    return found


@lru_cache
def _polarized():
    return fifesim.Atmosphere(engine="successive-orders")


def _shares(setup):
    bands = tuple(band.response for band in setup.instrument.select(setup.bands))
    atmosphere = setup.atmosphere or fifesim.Atmosphere()
    return diffuse_fraction(atmosphere, bands, setup.geometry or fifesim.fife_geometry())


def _by_sunlight(setup, lai):
    """Reflectance of level ground by SAIL for the directions of sun and view, without skylight."""
    bands = setup.instrument.select(setup.bands)
    responses = tuple(band.response for band in bands)
    own = setup.canopy
    leaf = optics_labels.leaf_optics(responses, own.leaf_optics, lai, exact=False)
    stand = BandCanopy(
        own, leaf, None, optics_labels.background(responses, own.background, lai)
    )
    return canopy.level_reflectance(
        lai,
        bands,
        stand,
        Light(setup.geometry or fifesim.fife_geometry(), np.zeros(len(bands))),
        atmosphere=(setup.atmosphere or fifesim.Atmosphere()).text,
        **attributes_of(setup.instrument),
    )
