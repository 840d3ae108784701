"""A budget as a folder of files."""

from pathlib import Path

from fifesim.experiments.scatter import report as scatter_report
from fifesim.experiments.scatter import shares as scatter
from fifesim.output import pages
from fifesim.output.folders import check_folder, results
from fifesim.output.run.size import check_cells
from fifesim.scenario.toml import write_scenario

FILES = ("budget.csv", "budget.png", "report.html", "scenario.toml")

_DPI = 200


def budget_to_folder(scenario, folder, *, realisations=20, cells=333, seed=None, overwrite=False):
    """
    Where the scatter of a scenario comes from: budget.csv, budget.png, report.html and scenario.toml.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario or None
        None is the paper's case.
    folder : str or path
        Made where it does not exist.
    realisations, cells, seed : optional
        As in `scatter.budget`.
    overwrite : bool, optional
        Replace these files where the folder holds something; other files stay.

    Returns
    -------
    files : list of pathlib.Path

    Raises
    ------
    ValueError
        If a number is not allowed, or the folder holds something; nothing is written then.
    OSError
        If a file cannot be written; no half-written file is left.
    """
    folder = Path(folder)
    check_folder(folder, overwrite)
    complete = (scatter.default_scenario() if scenario is None else scenario).complete()
    check_cells(min(cells, *complete.geobox().shape))
    options = {"realisations": realisations, "cells": cells, "seed": seed}
    with results(folder, FILES, overwrite=overwrite) as partial:
        found = scatter.budget(complete, **options)
        table = scatter.table(found)
        rows, columns = (min(cells, size) for size in complete.geobox().shape)
        run = {"realisations": found.sizes["realisation"], "rows": rows, "columns": columns}
        run["seed"] = complete.ground.seed if seed is None else seed
        table.to_csv(partial / "budget.csv", index=False, float_format="%.6g")
        chart = pages.png(scatter_report.chart(table), _DPI)
        (partial / "budget.png").write_bytes(chart)
        page = scatter_report.budget_page(complete, found, table, chart, run)
        (partial / "report.html").write_text(page, encoding="utf-8")
        (partial / "scenario.toml").write_text(write_scenario(complete), encoding="utf-8")
    return [folder / name for name in FILES]
