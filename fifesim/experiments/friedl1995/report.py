"""Folder and HTML page of the reproduction of Friedl et al. (1995)."""

import shlex
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import CELLS, VARIABLES, case_of
from fifesim.experiments.friedl1995.reproduction import REALISATIONS, SEED, reproduce_case, write_scenarios
from fifesim.experiments.friedl1995.table import COEFFICIENTS, INCREMENTS, SAMPLE
from fifesim.output import report
from fifesim.output.folders import check_folder, results
from fifesim.output.progress import steps
from fifesim.output.workers import check_memory_of_cells

# Marker and colour of the first and of the second reading.
_OF_READINGS = (("o", "#0072B2"), ("x", "#D55E00"))

_TEMPLATE = Path(__file__).with_name("report.html.j2")
_DPI = 200
# Files of version 0.2.0, which must not stay next to a new run.
_EARLIER = ("readings.csv", "sizes.csv", "sensitivity.csv", "figure*.png")
REPRODUCED = ("table2.csv", "reproduction.nc", "scenarios", "report.html")


def reproduce_to_folder(
    folder, *, realisations=REALISATIONS, cells=None, seed=SEED, scenes=False, overwrite=False, **inputs
):
    """Write the experiment of [Friedl1995]_ to a folder: Table 2, data of the figures, nine scenarios, report.html."""
    folder = Path(folder)
    check_folder(folder, overwrite)
    case = case_of(cells=cells, **inputs)
    check_memory_of_cells(case.cells)
    stale = [path.name for pattern in _EARLIER for path in folder.glob(pattern)]
    with results(folder, REPRODUCED, overwrite=overwrite, stale=stale) as unfinished:
        found = reproduce_case(case, realisations, seed, each=lambda label: partial(steps, label=label))
        tables = {str(each): friedl1995_table.table2(found.sel(reading=each)) for each in found["reading"].values}
        (first, other), second = tables.values(), str(found["reading"].values[1])
        both = first.assign(**{f"{second}_{name}": other[name] for name in COEFFICIENTS})
        both.to_csv(unfinished / "table2.csv", index=False, float_format="%.6g")
        found.to_netcdf(unfinished / "reproduction.nc")
        write_scenarios(case, unfinished / "scenarios", seed, scenes, each=partial(steps, label="scenarios"))
        options = inputs | {"realisations": realisations, "cells": case.cells, "seed": seed}
        words = [word for name, value in options.items() if value is not None for word in (f"--{name}", str(value))]
        page = reproduction_page(case, found, tables, realisations, shlex.join(["fifesim", "reproduce", *words]))
        (unfinished / "report.html").write_text(page, encoding="utf-8")
    return [folder / name for name in REPRODUCED]


def reproduction_page(case, found, tables, realisations, command):
    """One self-contained HTML page of the experiment."""
    shown, beside = tables
    texts = [friedl1995_table.text_table(found.sel(reading=name)).to_dict("records") for name in tables]
    differences = {name: (each["r2"] - each["paper_r2"])[each["variable"] == "lai"] for name, each in tables.items()}
    return report.page_html(
        _TEMPLATE, case=case, realisations=realisations, command=command, shown=shown,
         beside=beside, sample=SAMPLE, increments=INCREMENTS, cells=CELLS,
        readings=dict(zip(tables, found["text"].values.tolist(), strict=True)),
        rms={name: float(np.sqrt(np.mean(each**2))) for name, each in differences.items()},
        rows=list(zip(*(table.to_dict("records") for table in tables.values()), strict=True)),
        texts=list(zip(*texts, strict=True)), table2=report.png(table2_figure(tables), _DPI),
    )  # fmt: skip


def table2_figure(tables):
    """Figure of Table 2 by reading, compared with the published values."""
    first = next(iter(tables.values()))
    figure = Figure(figsize=(7.2, 5.2), layout="constrained")
    axes = figure.subplots(2, 3, sharey=True)
    scenes = first[first["variable"] == "lai"]
    labels = [f"{row.distribution.replace('-', ', ')}, {row.arp:g}" for row in scenes.itertuples()]
    for line, variable in zip(axes, VARIABLES, strict=True):
        for axis, name in zip(line, COEFFICIENTS, strict=True):
            for (reading, table), (marker, color) in zip(tables.items(), _OF_READINGS, strict=True):
                rows = table[table["variable"] == variable]
                spread = rows[f"{name}_deviation"].fillna(0)
                axis.errorbar(rows[name], range(len(rows)), xerr=spread, fmt=marker, color=color, ms=4, label=reading)
            paper = first[first["variable"] == variable][f"paper_{name}"]
            axis.plot(paper, range(len(paper)), "s", color="#222222", mfc="none", ms=7, label="paper")
            axis.set_title(f"{variable.upper()}: {'R²' if name == 'r2' else name}", fontsize="medium")
            axis.grid(axis="y", color="0.92")
            axis.spines[["top", "right"]].set_visible(False)
    axes[0, 0].invert_yaxis()
    for axis in axes[:, 0]:
        axis.set_yticks(range(len(labels)), labels, fontsize=8)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure
