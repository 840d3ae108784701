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
from fifesim.output.folders import check_folder, results
from fifesim.output.maps import image_map, stretch_of
from fifesim.output.workers import check_memory_of_cells
from fifesim.retrieval.description import Retrieval
from fifesim.retrieval.labels import retrieve
from fifesim.scenario.scenario import default_scenario
from fifesim.scenario.simulation import simulate
from fifesim.scenario.toml import write_scenario
from fifesim.sensor.labels import to_reflectance

_TEMPLATE = Path(__file__).with_name("endtoend.html.j2")
ENDTOEND_FILES = ("budget.csv", "budget.png", "maps.png", "report.html", "scenario.toml")
_DPI = 160
_COLOURS = {"bias": "#0072B2", "variance": "#E69F00"}
_LAI = (0.0, 20.0)
LEVEL = 0.8
"""Level of the interval of retrieved leaf area on the page. [1]"""


def endtoend_to_folder(
    scenario, folder, *, quantity="gpp", retrieval="line", weather=None, realisations=20, cells=333, seed=None,
    overwrite=False,
):  # fmt: skip
    """Write the end-to-end report of a scenario: report.html, its two pictures, budget.csv and scenario.toml."""
    folder = Path(folder)
    check_folder(folder, overwrite)
    complete = (default_scenario() if scenario is None else scenario).complete()
    target = errors.target_of(quantity, weather)
    check_memory_of_cells(min(cells, *complete.geobox().shape))
    options = {"realisations": realisations, "cells": cells, "seed": seed}
    with results(folder, ENDTOEND_FILES, overwrite=overwrite) as partial:
        found = scatter.budget(complete, quantity=quantity, retrieval=retrieval, weather=weather, **options)
        table = error_table(found)
        table.to_csv(partial / "budget.csv", index=False, float_format="%.6g")
        case = scatter.budget_cases(complete, **options)[0]
        chart = report.png(error_chart(table, target), _DPI)
        maps = report.png(map_figure(case, target, retrieval), _DPI)
        (partial / "budget.png").write_bytes(chart)
        (partial / "maps.png").write_bytes(maps)
        page = endtoend_page(case, found, table, target, retrieval, maps, chart)
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


def map_figure(case, target, retrieval):
    """Maps of one realisation: truth, image, retrieved leaf area and its interval, model and difference."""
    run = simulate(case)
    image = run["image"]["dn"].compute()
    lai, width = estimated(image, run["truth"]["lai"].compute(), retrieval)
    scene = scene_of(case, retrieval if isinstance(retrieval, Retrieval) else None)
    ground = scene.ground(IDEAL_PROPERTIES)
    cells = ground.land["lai"].copy(data=errors.of_cells(scene, target, ground))
    blocks = aggregate_blocks(cells, grids.cell_size(scene.blocks)[0], min_valid=scene.setup.min_valid)
    blocks = blocks.isel(y=slice(lai.sizes["y"]), x=slice(lai.sizes["x"]))
    rows, columns = blocks.shape
    lai, width = (each.isel(y=slice(rows), x=slice(columns)) for each in (lai, width))
    area = np.clip(lai.values, 0, None)
    model = lai.copy(data=errors.of_pixels(scene, target, errors.mean_canopy(scene), area))
    difference = model.copy(data=model.values - blocks.values)
    word, unit = _word(target), f" [{target.units}]" if target.units not in ("", "1") else ""
    cell, pixel = (grids.cell_size(grids.geobox(each))[1] for each in (cells, image))
    limits = percentile_limits(blocks.rename("truth"))
    spread = float(np.nanpercentile(np.abs(difference.values), 98)) or 1.0
    panels = [
        (cells, f"1. Truth: {word} of cells of {cell:.3g} m{unit}", "YlGn", percentile_limits(cells)),
        (None, f"2. Image in pixels of {pixel:.3g} m", None, None),
        (lai, "3. Retrieved LAI", "YlGn", (0.0, max(percentile_limits(lai)[1], 0.1))),
        (width, f"4. Width of the {100 * LEVEL:g} % interval of LAI", "viridis", (0.0, percentile_limits(width)[1])),
        (model, f"5. {word} from retrieved LAI{unit}", "YlGn", limits),
        (difference, f"6. Model minus mean truth{unit}", "RdBu_r", (-spread, spread)),
    ]
    figure = Figure(figsize=(10.2, 6.9), layout="constrained")
    for axis, (values, text, colours, ends) in zip(figure.subplots(2, 3).ravel(), panels, strict=True):
        axis.set_title(text, fontsize=9)
        axis.set_xticks([])
        axis.set_yticks([])
        if values is None:
            axis.imshow(image_map(image, "", stretch_of(image)).pixels, interpolation="nearest")
            continue
        low, high = ends
        high = high if high > low else low + 1e-6
        shown = axis.imshow(values.values, cmap=colours, vmin=low, vmax=high, interpolation="nearest")
        figure.colorbar(shown, ax=axis, orientation="horizontal", shrink=0.8, pad=0.02).ax.tick_params(labelsize=7.5)
    return figure


def estimated(image, truth, retrieval):
    """Retrieved leaf area and the width of its interval, dims (y, x). [m2 m-2]"""
    if isinstance(retrieval, Retrieval):
        level = min(retrieval.levels, key=lambda each: abs(each - LEVEL))
        found = retrieve(to_reflectance(image), retrieval, [level])
        return found["lai"], (found["lai_high"] - found["lai_low"]).isel(level=0)
    seen = ndvi_of(image)
    line = regress(truth, seen, pair="index")
    low, high = np.clip(line.prediction_interval(seen.values, LEVEL), *_LAI)
    return seen.copy(data=np.clip(line.predict(seen.values), *_LAI)), seen.copy(data=high - low)


def endtoend_page(case, budget, table, target, retrieval, maps, chart):
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
    return report.page_html(
        _TEMPLATE, title=report.title(case), word=_word(target), units=target.units, rows=rows, parts=parts,
        stages=errors.ERROR_STAGES, total=scatter.TOTAL, largest=largest, mean=mean, deviation=deviation,
        varies=float(np.sqrt(budget.truth_variance.mean())), model=target.name, method=method, weather=weather,
        scenario=case, inputs=_inputs(case), realisations=budget.sizes["realisation"], maps=maps, chart=chart,
    )  # fmt: skip


def _inputs(case):
    """Main inputs of a realisation, as name and text."""
    own, air, grid = case.sensor, case.atmosphere, case.grid
    offset = f"{own.offset[0]:g} and {own.offset[1]:g} pixels southward and eastward"
    return [
        ("Scene", f"{grid.width:.0f} m x {grid.height:.0f} m in cells of {grid.cell:.3g} m"),
        ("Ground", report.ground_in_words(case)),
        ("Instrument", f"{own.description.name}, pixels of {own.size:g} m"),
        ("Registration error", offset),
        ("Noise", ", ".join(own.noise) or "none"),
        ("Air", f"{air.profile}, {air.aerosol} aerosol, {air.engine}"),
    ]
