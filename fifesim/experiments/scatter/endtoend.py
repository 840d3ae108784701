"""End-to-end report: truth, image, retrieval, model and error of a quantity, with the budgets of bias and variance."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from fifesim.analysis.regression_labels import regress
from fifesim.analysis.scaling_labels import aggregate_blocks
from fifesim.chain.steps import ndvi as ndvi_of
from fifesim.experiments.scatter import errors
from fifesim.experiments.scatter import shares as scatter
from fifesim.experiments.scatter.report import draw_bars, finish_bars
from fifesim.experiments.scatter.stages import IDEAL_PROPERTIES, scene_of
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.models.weather import WEATHER_LIMITS
from fifesim.output import report
from fifesim.output.colours import percentile_limits
from fifesim.output.colours import unit as unit_of
from fifesim.output.folders import check_folder, results
from fifesim.output.maps import image_map, stretch_of, value_map
from fifesim.output.report import fixed
from fifesim.output.workers import check_memory_of_cells
from fifesim.retrieval.description import Retrieval
from fifesim.retrieval.labels import retrieve
from fifesim.scenario.scenario import default_scenario
from fifesim.scenario.simulation import simulate
from fifesim.scenario.toml import write_scenario
from fifesim.sensor.labels import to_reflectance

_TEMPLATE = Path(__file__).with_name("endtoend.html.j2")
ENDTOEND_FILES = ("budget.csv", "budget.png", "report.html", "scenario.toml")
_DPI = 160
_COLOURS = {"bias": "#0072B2", "variance": "#E69F00"}
_LAI = (0.0, 20.0)
# Relative difference of widths of intervals that is not shown as a map. [1]
_SAME = 0.1
LEVEL = 0.95
"""Preferred level of the interval of retrieved leaf area on the page, as in the report of a run. [1]"""


def endtoend_to_folder(
    scenario, folder, *, quantity="gpp", retrieval="line", weather=None, realisations=20, cells=333, seed=None,
    overwrite=False,
):  # fmt: skip
    """Write the end-to-end report of a scenario: report.html, budget.csv, its chart and scenario.toml."""
    folder = Path(folder)
    check_folder(folder, overwrite)
    complete = (default_scenario() if scenario is None else scenario).complete()
    target = errors.target_of(quantity, complete, weather)
    check_memory_of_cells(min(cells, *complete.geobox().shape))
    options = {"realisations": realisations, "cells": cells, "seed": seed}
    with results(folder, ENDTOEND_FILES, overwrite=overwrite) as partial:
        found = scatter.budget(complete, quantity=quantity, retrieval=retrieval, weather=target.weather, **options)
        table = error_table(found)
        table.to_csv(partial / "budget.csv", index=False, float_format="%.6g")
        case = scatter.budget_cases(complete, **options)[0]
        chart = report.png(error_chart(table, target), _DPI)
        (partial / "budget.png").write_bytes(chart)
        command = f"fifesim endtoend scenario.toml -o FOLDER --quantity {quantity} --realisations {realisations}"
        command += f" --cells {cells} --seed {complete.ground.seed if seed is None else seed}"
        if isinstance(retrieval, Retrieval):
            command += " --retrieval FILE"
        if weather is not None:
            command += ", which takes the default weather instead of the given one"
        page = endtoend_page(case, found, table, target, retrieval, chart, command)
        (partial / "report.html").write_text(page, encoding="utf-8")
        (partial / "scenario.toml").write_text(write_scenario(complete), encoding="utf-8")
    return [folder / name for name in ENDTOEND_FILES]


def error_table(budget):
    """Means and standard errors of bias and variance by stage: bias in % of the truth, variance in % of its total."""
    shown = [stage for stage in budget.stage.values if np.abs(budget.variance.sel(stage=stage)).sum() > 0 or
             str(budget.reason.sel(stage=stage).item())]  # fmt: skip
    scaled = {
        "bias": 100 * budget.bias / budget.truth.mean(),
        "variance": 100 * budget.variance / budget.total_variance.mean(),
    }
    totals = {"bias": 100 * budget.total_bias / budget.truth.mean(), "variance": 0 * budget.total_variance + 100}
    rows = []
    for stage in (*shown, scatter.TOTAL):
        row = {"stage": str(stage)}
        for kind, values in scaled.items():
            each = totals[kind] if stage == scatter.TOTAL else values.sel(stage=stage)
            row |= {kind: float(each.mean("realisation")), f"{kind}_error": float(scatter.standard_error(each))}
        rows.append(row | {"reason": "" if stage == scatter.TOTAL else str(budget.reason.sel(stage=stage).item())})
    return pd.DataFrame(rows)


def error_chart(table, target):
    """Bar charts of the shares of bias and variance with their standard errors."""
    rows = table[table["stage"] != scatter.TOTAL]
    figure = Figure(figsize=(8.4, 1.0 + 0.34 * len(rows)), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    labels = {"bias": f"bias [% of the mean {_word(target)}]", "variance": "variance [% of the total variance]"}
    for axis, (kind, label) in zip(axes, labels.items(), strict=True):
        share, error = (rows[name].to_numpy(float) for name in (kind, f"{kind}_error"))
        draw_bars(axis, np.arange(len(rows)), share, error, 0.6, "cannot be made ideal", color=_COLOURS[kind])
        finish_bars(axis, rows["stage"], label)
    return figure


def _word(target):
    """Short name of a quantity in text."""
    return cf.QUANTITIES[target.quantity].label if target.quantity else target.name


def maps_of(case, target, retrieval):
    """Maps of leaf area and of the quantity of one realisation, and a sentence on the interval of leaf area."""
    run = simulate(case)
    image = run["image"]["dn"].compute()
    scene = scene_of(case, retrieval if isinstance(retrieval, Retrieval) else None)
    ground, kind = scene.ground(IDEAL_PROPERTIES), target.quantity or target.name
    cells = ground.land["lai"].copy(data=errors.of_cells(scene, target, ground)).rename(kind)
    blocks = aggregate_blocks(cells, grids.cell_size(scene.blocks)[0], min_valid=scene.setup.min_valid)
    true_lai = run["truth"]["lai"].compute()
    lai, low, high = estimated(image, true_lai, retrieval)
    common = {axis: slice(min(blocks.sizes[axis], lai.sizes[axis])) for axis in ("y", "x")}
    blocks, lai, low, high, true_lai = (each.isel(common) for each in (blocks, lai, low, high, true_lai))
    area = np.clip(lai.values, 0, None)
    model = lai.copy(data=errors.of_pixels(scene, target, errors.mean_canopy(scene), area)).rename(kind)
    word, cell = _word(target), grids.cell_size(grids.geobox(cells))[1]
    unit = f" {unit_of(cells.assign_attrs(units=target.units))}".rstrip().replace(" ", "\N{NO-BREAK SPACE}")
    # One range for the maps of a quantity, that of its most variable map.
    limits, lai_limits = percentile_limits(cells), percentile_limits(true_lai)
    known, truth = np.isfinite(lai.values) & np.isfinite(true_lai.values), true_lai.values
    within = np.mean((low.values <= truth)[known] & (truth <= high.values)[known])
    width = lai.copy(data=high.values - low.values).rename("width")
    interval = f"{100 * level_of(retrieval):g} % interval"
    text = f"The true LAI is within the {interval} of the retrieved LAI in {100 * within:.0f} % of the pixels."
    narrow, wide = percentile_limits(width)
    if wide > (1 + _SAME) * narrow:
        fourth = value_map(width, f"Width of the {interval} of LAI")
    else:
        fourth = value_map(lai.copy(data=lai.values - truth), "Retrieved minus true LAI", "RdBu_r", middle=0.0)
        text += f" This interval has nearly the same width in all pixels, ± {fixed(wide / 2)} in LAI."
    difference, pixel = model.copy(data=model.values - blocks.values), grids.cell_size(grids.geobox(image))[1]
    return [
        image_map(image, f"Image in pixels of {pixel:.3g} m", stretch_of(image)),
        value_map(true_lai, "True LAI, mean over pixels", limits=lai_limits),
        value_map(lai, "Retrieved LAI", limits=lai_limits),
        fourth,
        value_map(cells, f"True {word} in cells of {cell:.3g} m{unit}", limits=limits),
        value_map(blocks, f"True {word}, mean over pixels{unit}", limits=limits),
        value_map(model, f"{word} from retrieved LAI{unit}", limits=limits),
        value_map(difference, f"Difference of the last two{unit}", "RdBu_r", middle=0.0),
    ], text


def estimated(image, truth, retrieval):
    """Retrieved leaf area and the ends of its interval, dims (y, x). [m2 m-2]"""
    if isinstance(retrieval, Retrieval):
        found = retrieve(to_reflectance(image), retrieval, [level_of(retrieval)])
        return found["lai"], *(found[name].isel(level=0) for name in ("lai_low", "lai_high"))
    seen = ndvi_of(image)
    line = regress(truth, seen, pair="index")
    ends = line.predict(seen.values), *line.prediction_interval(seen.values, LEVEL)
    return tuple(seen.copy(data=np.clip(each, *_LAI)).rename("lai") for each in ends)


def level_of(retrieval):
    """Level of the interval on the page, of those that a retrieval was calibrated for. [1]"""
    known = retrieval.levels if isinstance(retrieval, Retrieval) else (LEVEL,)
    return min(known, key=lambda each: abs(each - LEVEL))


def endtoend_page(case, budget, table, target, retrieval, chart, command):
    """One self-contained HTML page."""
    rows = table.set_index("stage").to_dict("index")
    parts = {name: row for name, row in rows.items() if name != scatter.TOTAL}
    largest = {
        kind: max(parts, key=lambda name: np.nan_to_num(abs(parts[name][kind]))) for kind in ("bias", "variance")
    }
    mean, deviation = float(budget.truth.mean()), float(np.sqrt(budget.total_variance.mean()))
    needed = target.model.weather if target.quantity in errors.models.LAND_MODELS else ()
    weather = [(name, asdict(target.weather)[name], WEATHER_LIMITS[name].unit) for name in needed]
    if isinstance(retrieval, Retrieval):
        method = f"{retrieval.method} trained on images of {retrieval.instrument}; prior: {retrieval.prior}"
    else:
        method = "line of true LAI on NDVI, fitted to each set of stages"
    maps, interval = maps_of(case, target, retrieval)
    return report.page_html(
        _TEMPLATE, title=report.title(case), word=_word(target), rows=rows, parts=parts,
        units=unit_of(budget.truth.assign_attrs(units=target.units).rename(target.quantity)).strip("[]"),
        stages=errors.ERROR_STAGES, total=scatter.TOTAL, largest=largest, mean=mean, deviation=deviation,
        varies=float(np.sqrt(budget.truth_variance.mean())), model=target.name, method=method, weather=weather,
        ideal={name: state for name, state in errors.ERROR_STAGES.items() if name not in parts},
        inputs=report.input_rows(case), realisations=budget.sizes["realisation"], maps=maps, interval=interval,
        chart=chart, command=command, files=ENDTOEND_FILES,
    )  # fmt: skip
