"""
Compute paper.json and write paper.md from it and paper.md.j2.

Run as ``python docs/make_paper.py``; it takes a quarter of an hour of a processor. ``--text`` writes the page from the
numbers that are there.
"""

import json
import sys
from pathlib import Path

import jinja2
import numpy as np
import paper_deviations

from fifesim.analysis.scaling import ndvi_linearity
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import effects, fitted, table
from fifesim.experiments.friedl1995.case import ARPS, Case
from fifesim.experiments.friedl1995.pixels import ground_of
from fifesim.experiments.friedl1995.readings import ALIGNED, NATIVE, READINGS
from fifesim.experiments.friedl1995.reproduction import SEED, reproduce_case
from fifesim.output.pages import fixed

DOCS = Path(__file__).parent
NUMBERS, TEMPLATE, PAGE = DOCS / "paper.json", DOCS / "paper.md.j2", DOCS / "paper.md"

REALISATIONS = 20
# Changes share their random numbers, and need fewer.
FEW = 4


def numbers(realisations=REALISATIONS, few=FEW):
    """
    All that the page states.

    Parameters
    ----------
    realisations : int, optional
        Of Table 2.
    few : int, optional
        Of what a change does.

    Returns
    -------
    numbers : dict
        Of plain numbers, text, lists and dicts.
    """
    case, seeds = Case(), range(SEED, SEED + few)
    found = reproduce_case(case, realisations, SEED)
    tables = {
        reading.name: table.table2(found.sel(reading=reading.name))
        for reading in (NATIVE, ALIGNED)
    }
    return {
        "run": {"realisations": realisations, "few": few, "seed": SEED, "cells": case.cells, "drift": case.drift,
                "interval": case.interval, "pixels": int(found["pixel_lai"][0, 0].count())},
        "table2": {name: each.to_dict("records") for name, each in tables.items()},
        "agreement": {name: table.agreement(each) for name, each in tables.items()},
        "limits": fitted.limits(*tables.values()),
        "text": table.text_table(found.sel(reading=NATIVE.name)).to_dict("records"),
        "readings": effects.readings(case, seeds).to_dict("records"),
        "sizes": effects.sizes(case, seeds).to_dict("records"),
        "sensitivity": effects.sensitivity(case, seeds).to_dict("records"),
        "growth_deviation": growth_deviation(found),
        "scaling": scaling(case, found),
        "deviations": paper_deviations.deviations(seeds),
        **words(case),
    }  # fmt: skip


def words(case):
    """What needs no simulation: where each number of a case comes from, how many were fitted, and what readings say."""
    return {
        "origins": [vars(each) for each in fitted.origins(case)],
        "fitted": fitted.fitted_count(case),
        "reading_texts": {name: each.text for name, each in READINGS.items()},
    }


def growth_deviation(found):
    """Standard deviation of how slopes of LAI grow from the least to the largest arp, in samples of 200 pixels."""
    slope = found["slope_200"].sel(reading=NATIVE.name, variable="lai")
    growth = (slope.sel(arp=max(ARPS)) / slope.sel(arp=min(ARPS))).mean("distribution")
    return float(growth.std(("realisation", "draw"), ddof=1))


def scaling(case, found):
    """
    Eq. 2 and Fig. 8, which nothing was fitted to, by arp.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    found : xarray.Dataset
        From `fifesim.reproduce`.

    Returns
    -------
    scaling : list of dict
        ``correlation``, that of Eq. 2 over the cells of a scene, and the mean and largest size of NDVI of the mean
        reflectance less the mean NDVI of the cells.
    """
    rows = []
    for arp in ARPS:
        ground = ground_of(case, "burned-grazed", arp, SEED)
        one = found.sel(reading=NATIVE.name, arp=arp)
        bias = (one["pixel_ndvi_of_mean"] - one["pixel_boa_ndvi"]).values
        rows.append(
            {
                "arp": arp,
                "correlation": ndvi_linearity(*ground.reflectance.values),
                "bias": np.nanmean(bias),
                "largest": np.nanmax(np.abs(bias)),
            }
        )
    return rows


def text(values):
    """
    The page.

    Parameters
    ----------
    values : dict
        From `numbers`.

    Returns
    -------
    page : str
        Markdown.
    """
    environment = jinja2.Environment(
        trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["fixed"] = fixed
    environment.globals |= {"between": between, "highest": highest}
    environment.globals["slope_of"] = lambda cosine: np.degrees(np.arccos(cosine))
    ren = noise(values["text"], values["table2"]["native"])
    return (
        environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(**values, ren=ren)
        + "\n"
    )


def nine(reading, name):
    """The nine values of LAI of a row of readings: ``r2``, ``slope``, or these of the paper, an array."""
    return np.array(
        [reading[f"{name} {treatment} {arp:g}"] for treatment, arp in friedl1995.scenes()]
    )


def highest(reading):
    """The highest of the nine slopes of LAI of a row of readings, and its treatment and arp."""
    slopes = nine(reading, "slope")
    treatment, arp = friedl1995.scenes()[slopes.argmax()]
    return {"slope": slopes.max(), "treatment": treatment, "arp": arp}


def noise(rows, lines):
    """
    Mean relative equivalent noise beside the paper's.

    Parameters
    ----------
    rows, lines : list of dict
        ``text``, and ``table2`` of one reading, from `numbers`.

    Returns
    -------
    noise : dict
        ``largest`` relative difference; ``growth`` of LAI from least to largest arp and the ``paper_growth``; and
        noise of LAI by arp with the slope of the line of LAI on NDVI, which makes it R2 times as large, ``by_other``.
    """
    rows = [row for row in rows if row["quantity"] == "ren"]
    lai = [row for row in rows if row["variable"] == "lai"]
    r2 = {
        row["arp"]: row["r2"]
        for row in lines
        if (row["variable"], row["distribution"]) == ("lai", "burned-grazed")
    }
    return {
        "largest": max(abs(row["value"] / row["paper"] - 1) for row in rows),
        "growth": lai[-1]["value"] / lai[0]["value"],
        "paper_growth": lai[-1]["paper"] / lai[0]["paper"],
        "by_other": [row["value"] * r2[row["arp"]] for row in lai],
    }


def between(reading, other):
    """What tells one row of readings from another: mean change of R2 and mean relative change of slopes of LAI."""
    r2 = nine(reading, "r2") - nine(other, "r2")
    return {
        "r2": r2.mean(),
        "slope": np.mean(nine(reading, "slope") / nine(other, "slope") - 1),
    }


def main():
    known = (
        json.loads(NUMBERS.read_text(encoding="utf-8")) | words(Case())
        if "--text" in sys.argv
        else numbers()
    )
    NUMBERS.write_text(json.dumps(_plain(known), indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(text(_plain(known)), encoding="utf-8")


def _plain(value):
    """What JSON knows, numbers with five digits; None for what is not a number."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.5g}") if np.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value


if __name__ == "__main__":
    main()
