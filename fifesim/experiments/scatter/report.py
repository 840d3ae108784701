"""The bar chart and the HTML page of a budget."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fifesim.experiments.scatter.grounds import PROPERTIES
from fifesim.experiments.scatter.shares import CURVATURE, TOTAL, VARIATION, standard_error
from fifesim.experiments.scatter.stages import STAGES, VARIABLES
from fifesim.output import pages
from fifesim.output.pages import fixed, plus_minus
from fifesim.output.report import title
from fifesim.rasters import grid as grids
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.listing import blur_in_words, noise_in_words

_TEMPLATE = Path(__file__).with_name("report.html.j2")

# Okabe and Ito's colours, which the colour-blind tell apart; hatches tell them apart in grey.
_STYLES = {"lai": ("#0072B2", ""), "fpar": ("#E69F00", "////")}

# The three mechanisms of the paper's discussion, and what it does not name.
MECHANISMS = {
    "i. Non-linearity of the relation between NDVI and the variable": ("non-linearity", CURVATURE),
    "ii. NDVI is not scale invariant": ("NDVI scaling",),
    "iii. Regularization by the sensor": ("point spread",),
    "Place of the pixels, which the paper does not name": ("registration",),
    "Digital numbers and noise": ("quantisation", "noise"),
    "Terrain and atmosphere": ("topography", "atmosphere"),
    "Ground that varies beside its leaf area": tuple(PROPERTIES),
}


def chart(table):
    """
    Bars of the shares with their standard errors.

    Parameters
    ----------
    table : pandas.DataFrame
        From `scatter.table`.

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    names = (*_shown(table), CURVATURE)
    figure = Figure(figsize=(7.2, 1.1 + 0.4 * len(names)), layout="constrained")
    axis = figure.subplots()
    for k, variable in enumerate(VARIABLES):
        rows = table[table["variable"] == variable].set_index("stage")
        total = 100 * rows.loc[TOTAL]
        color, hatch = _STYLES[variable]
        label = f"{variable.upper()}: {fixed(total['share'], 1)}{plus_minus(total['share_error'], 1)} % in all"
        at = np.arange(len(names)) + 0.2 * (2 * k - 1)
        share, error = (100 * rows.loc[list(names), name].to_numpy(float) for name in ("share", "share_error"))
        axis.barh(at, share, 0.38, color=color, hatch=hatch, edgecolor="white", linewidth=0, label=label)
        axis.errorbar(share, at, xerr=np.nan_to_num(error), fmt="none", ecolor="#222222", elinewidth=1, capsize=2.5)
        for y, value, spread in zip(at, share, np.nan_to_num(error), strict=True):
            # Exactly nothing is a stage that is ideal already.
            text = "0" if value == 0 else fixed(value, 1)
            # Beyond whatever of bar and whisker reaches furthest.
            end = max(value + spread, 0), y
            axis.annotate(text, end, (5, 0), textcoords="offset points", va="center", fontsize=7)
    axis.axvline(0, color="#222222", linewidth=0.8)
    axis.set_yticks(np.arange(len(names)), names)
    axis.invert_yaxis()
    axis.margins(x=0.08)
    axis.set_xlabel("share of the variance that a line on NDVI does not explain [%]", fontsize=9)
    axis.tick_params(labelsize=8.5)
    axis.tick_params(axis="y", length=0)
    axis.spines[["top", "right", "left"]].set_visible(False)
    # Above the bars, wherever the long ones are.
    figure.legend(frameon=False, fontsize=8.5, loc="outside upper center", ncols=2)
    return figure


def _shown(table):
    """Stages and their ideals: those of the ground where it has them."""
    shares = table.groupby("stage")["share"].apply(lambda values: values.any())
    return {stage: ideal for stage, ideal in STAGES.items() if stage not in PROPERTIES or shares[stage]}


def mechanisms(budget):
    """
    Shares of the mechanisms of the paper's discussion.

    Parameters
    ----------
    budget : xarray.Dataset
        From `scatter.budget`.

    Returns
    -------
    rows : list of dict
        ``name``, ``parts``, the names of their stages, and by variable a dict of ``share``, its ``error`` over
        realisations, and its part ``of_total``. [1]
    """
    rows = []
    for name, parts in MECHANISMS.items():
        row = {"name": name, "parts": " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))}
        shares = sum(budget["curvature"] if part == CURVATURE else budget["share"].sel(stage=part) for part in parts)
        for variable in VARIABLES:
            share = shares.sel(variable=variable)
            mean, total = float(share.mean()), float(budget["total"].sel(variable=variable).mean())
            row[variable] = {"share": mean, "error": float(standard_error(share)), "of_total": mean / total}
        rows.append(row)
    return rows


def budget_page(scenario, budget, table, picture, run):
    """
    One self-contained HTML page.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario
        Complete.
    budget : xarray.Dataset
        From `scatter.budget`.
    table : pandas.DataFrame
        From `scatter.table`.
    picture : bytes
        The chart as PNG.
    run : mapping of str to int
        ``realisations``, ``rows`` and ``columns`` of cells, and ``seed``.

    Returns
    -------
    html : str
    """
    by_variable = {name: table[table["variable"] == name].set_index("stage").to_dict("index") for name in VARIABLES}
    found = mechanisms(budget)
    return pages.html(
        _TEMPLATE, title=title(scenario), setting=_setting(scenario, run), stages=_shown(table), variables=VARIABLES,
        rows=by_variable, mechanisms=found, largest=max(found, key=lambda row: row["lai"]["share"]),
        curvature=CURVATURE, total=TOTAL, variation=VARIATION, run=run, chart=picture,
    )  # fmt: skip


def _setting(scenario, run):
    """Rows of a small table: what the budget is of."""
    own, air = scenario.sensor, scenario.atmosphere
    height, width = (run[name] * scenario.grid.cell for name in ("rows", "columns"))
    description = instrument(own.instrument)
    interval = {"product": "that of their size", "native": f"{description.ground_interval:.3f} m, its own"}.get(
        own.interval, f"{own.interval} m"
    )
    beyond = _drift(scenario, run)
    amount = f"visibility {air.visibility:g} km" if air.aot is None else f"optical thickness {air.aot:g}"
    return [
        ("Scenes", f"{run['realisations']} of {run['rows']} x {run['columns']} cells, {height:.0f} m x {width:.0f} m"),
        ("Truth", f"means over blocks of {own.pixel:g} m, paired with pixels by row and column"),
        ("Distance between pixels", interval + (f"; the last lie {beyond:.1f} m from their blocks" if beyond else "")),
        ("Registration error", f"{own.offset[0]:g} and {own.offset[1]:g} pixels southward and eastward"),
        ("Blur", blur_in_words(own.description, own.bands)),
        ("Noise", noise_in_words(own.description, own.bands, own.noise)),
        ("Ground", "level" if scenario.terrain.dem == "flat" else Path(scenario.terrain.dem).name),
        ("Air", f"{air.profile}, {air.aerosol} aerosol, {amount}, {air.engine}"),
    ]


def _drift(scenario, run):
    """How far along an axis the last pixel lies from its block, in a row of pixels with an interval of its own. [m]"""
    own, size = scenario.sensor, scenario.sensor.pixel
    if own.interval == "product":
        return 0.0
    interval = instrument(own.instrument).ground_interval if own.interval == "native" else own.interval
    length = run["columns"] * grids.cell_size(scenario.geobox())[1]
    return (min(int(length / interval), int(length / size)) - 0.5) * abs(interval - size)
