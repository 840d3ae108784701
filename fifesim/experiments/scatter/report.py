"""Bar chart, HTML page and folder of a scatter budget."""

import shutil
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.shares import CURVATURE, TOTAL, VARIATION, standard_error
from fifesim.experiments.scatter.stages import IDEAL_PROPERTIES, STAGES, VARIABLES
from fifesim.grids import grid as grids
from fifesim.output import report
from fifesim.output.folders import check_folder, results
from fifesim.output.report import fixed, plus_minus, title
from fifesim.output.workers import check_memory_of_cells
from fifesim.scenario.scenario import default_scenario
from fifesim.scenario.toml import write_scenario
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.provenance import DASH

_TEMPLATE = Path(__file__).with_name("report.html.j2")
_LANDSCAPE = "landscape.json"
BUDGET_FILES = ("budget.csv", "budget.png", "report.html", "scenario.toml")

# Colours of Okabe and Ito, suitable for colour-blind readers; hatches differ in grey too.
_STYLES = {"lai": ("#0072B2", ""), "fpar": ("#E69F00", "////")}

# The three mechanisms discussed in the paper, and further ones.
MECHANISMS = {
    "i. Non-linearity of the relation between NDVI and the variable": ("non-linearity", CURVATURE),
    "ii. NDVI is not scale invariant": ("NDVI scaling",),
    "iii. Regularization by the sensor": ("point spread",),
    "Registration of the pixels (not discussed in the paper)": ("registration",),
    "Digital numbers and noise": ("quantisation", "noise"),
    "Terrain and atmosphere": ("topography", "atmosphere", "coupling", "clouds", "shadows"),
    "Variation of ground properties other than leaf area": tuple(IDEAL_PROPERTIES),
}


def bar_chart(table):
    """Bar chart of the shares with their standard errors."""
    names = (*_shown(table), CURVATURE)
    figure = Figure(figsize=(7.2, 1.1 + 0.4 * len(names)), layout="constrained")
    axis = figure.subplots()
    for k, variable in enumerate(VARIABLES):
        rows = table[table["variable"] == variable].set_index("stage")
        total = 100 * rows.loc[TOTAL]
        color, hatch = _STYLES[variable]
        label = f"{variable.upper()}: {fixed(total['share'], 1)}{plus_minus(total['share_error'], 1)} % in total"
        at = np.arange(len(names)) + 0.2 * (2 * k - 1)
        share, error = (100 * rows.loc[list(names), name].to_numpy(float) for name in ("share", "share_error"))
        draw_bars(axis, at, share, error, 0.38, "unknown", color=color, hatch=hatch, label=label)
    finish_bars(axis, names, "share of the variance not explained by a line on NDVI [%]")
    # Above the axes, clear of long bars.
    figure.legend(frameon=False, fontsize=8.5, loc="outside upper center", ncols=2)
    return figure


def draw_bars(axis, at, share, error, height, missing, **style):
    """Horizontal bars with whiskers and numbers; a hatched bar and a text where a share is NaN."""
    error, longest = np.nan_to_num(error), np.nanmax(np.abs(share))
    axis.barh(at, share, height, edgecolor="white", linewidth=0, **style)
    axis.errorbar(share, at, xerr=error, fmt="none", ecolor="#222222", elinewidth=1, capsize=2.5)
    for y, value, spread in zip(at, share, error, strict=True):
        if np.isnan(value):
            axis.barh(y, longest, height, color="none", edgecolor="#999999", hatch="xxxx", linewidth=0)
        text = missing if np.isnan(value) else fixed(value, 1)
        # Place the text beyond the end of bar and whisker.
        end = longest if np.isnan(value) else max(value + spread, 0)
        axis.annotate(text, (end, y), (5, 0), textcoords="offset points", va="center", fontsize=7)


def finish_bars(axis, names, label):
    """Names of the bars from top to bottom, the label of their axis, and its frame."""
    axis.axvline(0, color="#222222", linewidth=0.8)
    axis.set_yticks(np.arange(len(names)), names)
    axis.yaxis.set_inverted(True)
    axis.margins(x=0.16)
    axis.set_xlabel(label, fontsize=9)
    axis.tick_params(labelsize=8.5)
    axis.tick_params(axis="y", length=0)
    axis.spines[["top", "right", "left"]].set_visible(False)


def _shown(table):
    """Stages that have an effect, or an unknown one, with their ideal states."""
    shares = table.groupby("stage")["share"].apply(lambda values: (values != 0).any())
    return {stage: ideal for stage, ideal in STAGES.items() if shares[stage]}


def mechanisms(budget):
    """Shares of the mechanisms discussed in the paper, by the stages that have an effect. [1]"""
    rows = []
    for name, all_parts in MECHANISMS.items():
        parts = [part for part in all_parts if part == CURVATURE or (budget["share"].sel(stage=part) != 0).any()]
        if not parts:
            continue
        row = {"name": name, "parts": " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))}
        each = [budget["curvature"] if part == CURVATURE else budget["share"].sel(stage=part) for part in parts]
        # An unknown part is left out; a mechanism with unknown parts only is unknown.
        shares = xr.concat(each, "part", coords="minimal", compat="override").sum("part", min_count=1)
        for variable in VARIABLES:
            share = shares.sel(variable=variable)
            mean, total = float(share.mean()), float(budget["total"].sel(variable=variable).mean())
            row[variable] = {"share": mean, "error": float(standard_error(share)), "of_total": mean / total}
        rows.append(row)
    return rows


def budget_page(scenario, budget, table, picture, run, files=BUDGET_FILES, ends=None):
    """One self-contained HTML page of a budget."""
    by_variable = {name: table[table["variable"] == name].set_index("stage").to_dict("index") for name in VARIABLES}
    found, shown = mechanisms(budget), _shown(table)
    unknown = [stage for stage, row in by_variable["lai"].items() if row["origin"] == DASH and np.isnan(row["share"])]
    return report.page_html(
        _TEMPLATE, title=title(scenario), scenario=scenario, stages=shown, variables=VARIABLES,
        ideal={name: state for name, state in STAGES.items() if name not in shown},
        native_interval=instrument(scenario.sensor.instrument).ground_interval, drift=_drift(scenario, run),
        rows=by_variable, mechanisms=found, largest=max(found, key=lambda row: np.nan_to_num(row["lai"]["share"])),
        inputs=report.input_rows(scenario), ends=ends, unknown=unknown, files=files,
        curvature=CURVATURE, total=TOTAL, variation=VARIATION, run=run, chart=picture,
    )  # fmt: skip


def _drift(scenario, run):
    """Distance along an axis between the last pixel and its block, for pixels at a native interval. [m]"""
    own, size = scenario.sensor, scenario.sensor.pixel
    if own.interval == "product":
        return 0.0
    interval = instrument(own.instrument).ground_interval if own.interval == "native" else own.interval
    length = run["columns"] * grids.cell_size(scenario.geobox())[1]
    return (min(int(length / interval), int(length / size)) - 0.5) * abs(interval - size)


_DPI = 200


def budget_to_folder(scenario, folder, *, realisations=20, cells=333, seed=None, overwrite=False):
    """Write the scatter budget of a scenario: budget.csv, budget.png, report.html and scenario.toml."""
    folder = Path(folder)
    check_folder(folder, overwrite)
    complete = (default_scenario() if scenario is None else scenario).complete()
    check_memory_of_cells(min(cells, *complete.geobox().shape))
    options = {"realisations": realisations, "cells": cells, "seed": seed}
    shown, names = complete, BUDGET_FILES
    if "learned" in complete.landscape.files:
        # The folder has a copy, which its scenario reads.
        shown = complete.model_copy(update={"landscape": complete.landscape.with_paths(lambda path: _LANDSCAPE)})
        names = (*names, _LANDSCAPE)
    with results(folder, names, overwrite=overwrite) as partial:
        if shown is not complete:
            shutil.copyfile(complete.learned, partial / _LANDSCAPE)
        found = scatter.budget(complete, **options)
        table = scatter.budget_table(found)
        rows, columns = (min(cells, size) for size in complete.geobox().shape)
        run = {"realisations": found.sizes["realisation"], "rows": rows, "columns": columns, "cells": cells}
        run["seed"] = complete.ground.seed if seed is None else seed
        table.to_csv(partial / "budget.csv", index=False, float_format="%.6g")
        chart = report.png(bar_chart(table), _DPI)
        (partial / "budget.png").write_bytes(chart)
        ends = scatter.total_range(complete, **options, each=iter)
        page = budget_page(complete, found, table, chart, run, names, ends)
        (partial / "report.html").write_text(page, encoding="utf-8")
        (partial / "scenario.toml").write_text(write_scenario(shown), encoding="utf-8")
    return [folder / name for name in names]
