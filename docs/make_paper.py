"""
Compute paper.json and write paper.md from it and paper.md.j2.

``python docs/make_paper.py`` takes a quarter of an hour of processor time. ``--only scenes`` computes one part
and keeps the other numbers. ``--text`` computes nothing and writes the page.
"""

import argparse
import json
from pathlib import Path

import jinja2
import numpy as np
import paper_deviations
import paper_effects as effects
from paper_effects import PASSAGES, READINGS, Case

from fifesim.analysis.scaling import linearity_correlation
from fifesim.chain.driver import Driver, cell_block_means
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table
from fifesim.experiments.friedl1995.case import ALIGNED, ARPS, CELL, NATIVE, VARIABLES
from fifesim.experiments.friedl1995.reproduction import SEED, reproduce_case
from fifesim.experiments.friedl1995.table import cells_of
from fifesim.output.report import fixed

DOCS = Path(__file__).parent
NUMBERS, TEMPLATE, PAGE = DOCS / "paper.json", DOCS / "paper.md.j2", DOCS / "paper.md"

REALISATIONS = 20
# Effects of changes need fewer, because they share their random numbers.
FEW = 4

# Digits of printed noise and range; percentages are computed from the printed values.
DIGITS = 3


def numbers(only=None):
    """
    Compute the numbers of the page.

    Parameters
    ----------
    only : sequence of str, optional
        Names of `PARTS` to compute; all by default.

    Returns
    -------
    numbers : dict
        Plain numbers, text, lists and dicts.
    """
    case, found = Case(), {}
    for name in PARTS if only is None else only:
        found |= PARTS[name](case)
    return found | words(case)


def scenes(case):
    """Table 2, noise, range and scaling of the nine scenes."""
    found = reproduce_case(case, REALISATIONS, SEED)
    by_reading = {each.name: found.sel(reading=each.name) for each in (NATIVE, ALIGNED)}
    tables = {name: table.table2(each) for name, each in by_reading.items()}
    return {
        "run": {"realisations": REALISATIONS, "few": FEW, "seed": SEED, "cells": case.cells, "drift": case.drift,
                "interval": case.interval, "pixels": int(found["pixel_lai"][0, 0].count())},
        "table2": {name: each.to_dict("records") for name, each in tables.items()},
        "agreement": {name: effects.agreement(each) for name, each in tables.items()},
        "limits": effects.limits(*tables.values()),
        "text": {name: table.text_table(each).to_dict("records") for name, each in by_reading.items()},
        "spread": spread(case, range(SEED, SEED + REALISATIONS)),
        "growth_deviation": growth_deviation(found),
        "scaling": scaling(case, found),
    }  # fmt: skip


_SEEDS = range(SEED, SEED + FEW)
PARTS = {
    "scenes": scenes,
    "readings": lambda case: {"readings": effects.readings(case, _SEEDS).to_dict("records")},
    "sizes": lambda case: {"sizes": effects.sizes(case, _SEEDS).to_dict("records")},
    "sensitivity": lambda case: {
        "sensitivity": effects.effects_of_numbers(case, _SEEDS).to_dict("records")
    },
    "deviations": lambda case: {"deviations": paper_deviations.deviations(_SEEDS)},
}


def words(case):
    """Numbers and text without simulation: origins, the number of fitted inputs, readings and pixel sizes."""
    return {
        "origins": [source._asdict() for source in effects.number_sources(case)],
        "fitted": effects.fitted_count(case),
        "reading_texts": {name: each.text for name, each in READINGS.items()},
        "passages": PASSAGES,
        "cells_per_pixel": {
            "aligned": (case.pixel / CELL) ** 2,
            "native": (case.interval / CELL) ** 2,
        },
    }


def spread(case, seeds):
    """
    Coefficient of variation of the block means of burned, grazed ground.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int

    Returns
    -------
    spread : dict of str to dict of str to float
        By variable and arp, the mean over realisations of the standard deviation divided by the mean. [1]
    """
    driver, min_valid = Driver(case.setup), case.setup.min_valid
    found = {name: {} for name in VARIABLES}
    for arp in ARPS:
        cells = [cells_of(case, "burned-grazed", arp, seed, driver=driver) for seed in seeds]
        for name in VARIABLES:
            arrays = [getattr(scene, name) for scene in cells]
            blocks = [
                cell_block_means(array, case.grid, case.pixel, min_valid) for array in arrays
            ]
            found[name][f"{arp:g}"] = np.mean(
                [np.nanstd(each, ddof=1) / np.nanmean(each) for each in blocks]
            )
    return found


def growth_deviation(found):
    """Standard deviation of the growth of LAI slopes from the smallest to the largest arp, in samples of 200 pixels."""
    slope = found["slope_200"].sel(reading=NATIVE.name, variable="lai")
    growth = (slope.sel(arp=max(ARPS)) / slope.sel(arp=min(ARPS))).mean("distribution")
    return float(growth.std(("realisation", "draw"), ddof=1))


def scaling(case, found):
    """
    Eq. 2 and Fig. 8 by arp, to which no input was fitted.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    found : xarray.Dataset
        From `fifesim.reproduce`.

    Returns
    -------
    scaling : list of dict
        ``correlation`` of Eq. 2 over the cells of a scene, and the mean and largest difference between NDVI of the
        mean reflectance and mean NDVI of the cells.
    """
    rows = []
    for arp in ARPS:
        cells = cells_of(case, "burned-grazed", arp, SEED)
        one = found.sel(reading=NATIVE.name, arp=arp)
        bias = (one["pixel_ndvi_of_mean"] - one["pixel_boa_ndvi"]).values
        rows.append(
            {
                "arp": arp,
                "correlation": linearity_correlation(*cells.reflectance),
                "bias": np.nanmean(bias),
                "largest": np.nanmax(np.abs(bias)),
            }
        )
    return rows


def text(values):
    """
    Text of the page.

    Parameters
    ----------
    values : dict
        Result of `numbers`.

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
    template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
    return template.render(**values, noise=noise(values), kept=range_kept(values)) + "\n"


def nine(reading, name):
    """Array of the nine values ``r2`` or ``slope`` of LAI of a reading, or of the paper."""
    return np.array(
        [reading[f"{name} {treatment} {arp:g}"] for treatment, arp in friedl1995.scenes()]
    )


def highest(reading):
    """Highest of the nine slopes of LAI of a reading, with its treatment and arp."""
    slopes = nine(reading, "slope")
    treatment, arp = friedl1995.scenes()[slopes.argmax()]
    return {"slope": slopes.max(), "treatment": treatment, "arp": arp}


def noise(values):
    """
    Mean relative equivalent noise compared with the paper.

    Parameters
    ----------
    values : dict
        From `numbers`.

    Returns
    -------
    rows : list of dict
        By ``variable`` and ``arp``: the value of the ``paper``, and for the readings ``native`` and ``aligned`` the
        noise over increments, its ``deviation`` between realisations, its relative ``difference`` from the paper, the
        ``estimate`` from R2 and the spread of the variable, and the noise ``by_other`` regression, R2 times as
        large. [1]
    """
    counted = {name: _of_quantity(rows, "ren") for name, rows in values["text"].items()}
    r2 = {
        (name, row["variable"], row["arp"]): row["r2"]
        for name, rows in values["table2"].items()
        for row in rows
        if row["distribution"] == "burned-grazed"
    }
    found = []
    for (variable, arp), first in counted[NATIVE.name].items():
        row = {"variable": variable, "arp": arp, "paper": first["paper"]}
        for name, rows in counted.items():
            one, share = rows[variable, arp], r2[name, variable, arp]
            row[name] = {
                "value": one["value"],
                "deviation": one["deviation"],
                "difference": round(one["value"], DIGITS) / one["paper"] - 1,
                "estimate": expected_noise(share, values["spread"][variable][f"{arp:g}"]),
                "by_other": one["value"] * share,
            }
        found.append(row)
    return found


def expected_noise(r2, spread):
    r"""
    Relative equivalent noise of a normal pair at the mean of the variable.

    Parameters
    ----------
    r2 : float
        R2 of the regression of NDVI on the variable. [1]
    spread : float
        Standard deviation of the variable divided by its mean. [1]

    Returns
    -------
    noise : float
        [1]

    Notes
    -----
    The residual standard deviation of NDVI is :math:`s_N \sqrt{1 - R^2}` and the slope :math:`\sqrt{R^2} s_N / s_L`, so
    that Eq. 7 gives :math:`\sqrt{(1 - R^2) / R^2}\, s_L / \bar{L}`.

    Examples
    --------
    >>> round(expected_noise(0.5, 0.1), 12)
    0.1
    """
    return np.sqrt((1 - r2) / r2) * spread


def range_kept(values):
    """
    Share of the cells' range that pixels keep, compared with the paper.

    Parameters
    ----------
    values : dict
        From `numbers`.

    Returns
    -------
    rows : list of dict
        By ``variable`` and ``arp``: the value of the ``paper``, rows of the ``native`` and ``aligned`` reading, and
        the ``difference`` and ``relative`` difference of the native reading from the paper. [1]
    """
    kept = {name: _of_quantity(rows, "range_kept") for name, rows in values["text"].items()}
    found = []
    for (variable, arp), one in kept[NATIVE.name].items():
        row = {"variable": variable, "arp": arp, "paper": one["paper"]}
        row |= {name: rows[variable, arp] for name, rows in kept.items()}
        printed = round(one["value"], DIGITS)
        row |= {"difference": printed - one["paper"], "relative": printed / one["paper"] - 1}
        found.append(row)
    return found


def _of_quantity(rows, quantity):
    """Rows of a quantity with a value in the paper, by variable and arp."""
    return {
        (row["variable"], row["arp"]): row
        for row in rows
        if row["quantity"] == quantity and row["paper"] is not None
    }


def between(reading, other):
    """Mean change of R2 and mean relative change of LAI slopes from one reading to another."""
    r2 = nine(reading, "r2") - nine(other, "r2")
    return {
        "r2": r2.mean(),
        "slope": np.mean(nine(reading, "slope") / nine(other, "slope") - 1),
    }


def main():
    parser = argparse.ArgumentParser(description="Compute paper.json and write paper.md.")
    parser.add_argument("--only", nargs="+", choices=PARTS, help="Compute these parts.")
    parser.add_argument("--text", action="store_true", help="Compute none, write the page.")
    given = parser.parse_args()
    only = () if given.text else given.only
    known = {} if only is None else json.loads(NUMBERS.read_text(encoding="utf-8"))
    known = _plain(known | numbers(only=only))
    NUMBERS.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(text(known), encoding="utf-8")


def _plain(value):
    """Values that JSON can hold: numbers with five digits, None for NaN and infinity."""
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
