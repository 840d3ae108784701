"""Folder and HTML page of the reproduction of Friedl et al. (1995)."""

import os
import shlex
from pathlib import Path

from fifesim.base.arguments import is_path
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import effects as table_effects
from fifesim.experiments.friedl1995 import figures, reproduction
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ALIGNED, ARPS, NATIVE, PASSAGES, READINGS, TABLE_1, beside
from fifesim.experiments.friedl1995.figures import caption_numbers, table2_figure
from fifesim.experiments.friedl1995.reproduction import REALISATIONS, SEED, reproduce_case
from fifesim.ground.landscape.distribution import treatments
from fifesim.output import report
from fifesim.output.folders import check_folder, results
from fifesim.output.progress import steps
from fifesim.output.workers import check_memory_of_cells

# Smaller differences in rms R2 are not significant, given the variation between two realisations. [1]
_ALIKE = 0.02

# With fewer realisations, standard deviations are too uncertain to divide by.
_FEWEST = 10

_GROUND = {"flat": "level", "flint-hills": "the synthetic Flint Hills"}

_TEMPLATE = Path(__file__).with_name("report.html.j2")


def reproduction_page(case, found, effects, figures, run):
    """One self-contained HTML page of the experiment."""
    shown, beside = (str(name) for name in found["reading"].values)
    tables = {name: friedl1995_table.table2(found.sel(reading=name)) for name in (shown, beside)}
    texts = [friedl1995_table.text_table(found.sel(reading=name)).to_dict("records") for name in (shown, beside)]
    return report.page_html(
        _TEMPLATE, case=case, run=run, shown=shown, beside=beside,
        arps=ARPS, treatments=treatments(), sample=friedl1995_table.SAMPLE, fewest=_FEWEST,
        increments=friedl1995_table.INCREMENTS, tm=case.sensor == TABLE_1, drift=case.drift,
        interval=case.interval, pixel=case.pixel, passages=PASSAGES,
        readings={name: reading.in_words(case.interval, case.pixel) for name, reading in READINGS.items()},
        rows=list(zip(*(table.to_dict("records") for table in tables.values()), strict=True)),
        texts=list(zip(*texts, strict=True)),
        limits=table_effects.limits(*tables.values()), origins=table_effects.number_sources(case),
        fitted=table_effects.fitted_count(case),
        agreements={name: friedl1995_table.agreement(table) for name, table in tables.items()},
        table2=report.png(table2_figure(tables), _DPI), figures=figures,
        own_densities=case.own_densities, cell=found.attrs["cell"],
        captions={name: caption_numbers(found, name) for name in (shown, beside)},
        **conclusions(effects),
    )  # fmt: skip


def conclusions(effects):
    """Tables of effects, and the rows that the conclusions of the page compare."""
    readings, sensitivity = effects["readings"], effects["sensitivity"]
    rows = _of_case(readings)
    blurred = [row for name, row in rows.items() if READINGS[name].eifov is not None]
    return {
        "effects": {name: table.to_dict("records") for name, table in effects.items()},
        "known": list(dict.fromkeys(readings["name"])),
        "lands": {name: _GROUND.get(name, Path(name).name) for name in readings["dem"].unique()},
        "drifting": rows[NATIVE.name], "displaced": rows["offset"], "relief": on_relief(readings), "alike": _ALIKE,
        "blurred": min(blurred, key=lambda row: row["lai_r2_rms"], default=None),
        "slope_step": sensitivity["lai_slope"].abs().max() if len(sensitivity) else 0.0,
        "moved": sensitivity["r2_largest"].max(),
    }  # fmt: skip


def on_relief(readings):
    """Rows of readings on level ground and on hills, and the row of Table 2 that hills lower most."""
    rows = readings.to_dict("records")
    first = rows[0]["dem"]
    sets = {dem: {row["name"]: row for row in rows if row["dem"] == dem} for dem in readings["dem"].unique()}
    other = next(dem for dem in sets if dem != first)
    level, hills = (first, other) if first == "flat" else (other, first)
    native = {dem: sets[dem][NATIVE.name] for dem in (level, hills)}
    changed = {f"r2 {treatment} {arp:g}": (treatment, f"{arp:g}") for treatment, arp in friedl1995.scenes()}
    most = min(changed, key=lambda key: native[hills][key] - native[level][key])
    treatment, arp = changed[most]
    return {
        "level": sets[level], "hills": sets[hills], "dem": hills, "most": most, "treatment": treatment, "arp": arp,
        "worse": native[hills]["lai_r2_rms"] - native[level]["lai_r2_rms"],
        "native": NATIVE.name, "aligned": ALIGNED.name,
    }  # fmt: skip


def _of_case(readings):
    """Rows for the elevation of the case, by name."""
    return {row["name"]: row for row in readings.to_dict("records") if row["dem"] == readings["dem"].iloc[0]}


# Cases use the same random numbers, so their differences need few realisations.
_EFFECT_REALISATIONS = 2
_DPI = 200


def reproduce_to_folder(
    folder, *, realisations=REALISATIONS, cells=None, seed=SEED, scenes=False, overwrite=False, **inputs
):
    """Write the experiment of [Friedl1995]_ to a folder: tables, figures, nine scenarios and report.html."""
    folder = Path(folder)
    check_folder(folder, overwrite)
    if realisations < 1:
        raise ValueError(f"realisations must be at least 1, got {realisations}")
    case = friedl1995.case_of(cells=cells, **inputs)
    reproduction.check_named(case)
    check_memory_of_cells(case.cells)
    pictures = pictures_of(case)
    names = [
        "table2.csv",
        "readings.csv",
        "sizes.csv",
        "sensitivity.csv",
        *pictures.values(),
        "scenarios",
        "report.html",
    ]
    with results(folder, names, overwrite=overwrite) as partial:
        found = reproduce_case(case, realisations, seed, each=_shown)
        seeds = range(seed, seed + _EFFECT_REALISATIONS)
        tables = {
            "readings": table_effects.readings(case, seeds, each=_shown("readings of Table 1")),
            "sizes": table_effects.sizes(case, seeds, each=_shown("sizes of the scene")),
            "sensitivity": table_effects.effects_of_numbers(case, seeds, each=_shown("numbers chosen")),
            "table2": _both(found),
        }
        for name, table in tables.items():
            table.to_csv(partial / f"{name}.csv", index=False, float_format="%.6g")
        drawn = {key: report.png(figures.plot_reproduction(key[0], found, reading=key[1]), _DPI) for key in pictures}
        for key, picture in drawn.items():
            (partial / pictures[key]).write_bytes(picture)
        reproduction.write_scenarios(case, partial / "scenarios", seed, scenes, each=_shown("scenarios"))
        run = {"realisations": realisations, "effect_realisations": _EFFECT_REALISATIONS, "seed": seed}
        run["command"] = command({"realisations": realisations, "cells": case.cells, "seed": seed} | inputs)
        page = reproduction_page(case, found, tables, drawn, run)
        (partial / "report.html").write_text(page, encoding="utf-8")
    return [folder / name for name in names]


def pictures_of(case):
    """File names of the figures by number and reading; figures that depend on the reading have two."""
    shown, other = (reading.name for reading in beside(case.reading))
    names = {}
    for number in figures.FIGURE_NUMBERS:
        names[number, shown] = f"figure{number}.png"
        if number in figures.BY_READING:
            names[number, other] = f"figure{number}_{other}.png"
    return names


def command(options):
    """Command line that reproduces the folder."""
    words = ["fifesim", "reproduce"]
    defaults = {"reading": "native", "dem": "flat", "sensor": TABLE_1}
    for name in (*defaults, "densities", "optics", "background", "west", "north", "realisations", "cells", "seed"):
        value = options.get(name)
        if value is not None and value != defaults.get(name):
            words += [f"--{name}", os.fspath(value) if is_path(value) else str(value)]
    return shlex.join(words)


def _both(found):
    """Table 2 of the reading, with the coefficients of the second reading."""
    shown, other = (str(name) for name in found["reading"].values)
    table, second = (friedl1995_table.table2(found.sel(reading=name)) for name in (shown, other))
    return table.assign(**{f"{other}_{name}": second[name] for name in friedl1995_table.COEFFICIENTS})


def _shown(label):
    return lambda sequence: steps(sequence, label)
