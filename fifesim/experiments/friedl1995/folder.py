"""The repeated experiment as a folder of files."""

import os
import shlex
from pathlib import Path

from fifesim.base.kinds import is_path
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import effects, figures, scenarios
from fifesim.experiments.friedl1995 import report as friedl1995_report
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.readings import TABLE_1, beside
from fifesim.experiments.friedl1995.reproduction import REALISATIONS, SEED, reproduce_case
from fifesim.output import pages
from fifesim.output.folders import check_folder, results
from fifesim.output.progress import steps
from fifesim.output.run.size import check_cells

_TABLES = ("readings", "sizes", "sensitivity")

# Differences between cases share their random numbers, and need few realisations.
_EFFECT_REALISATIONS = 2
_DPI = 200


def reproduce_to_folder(
    folder, *, realisations=REALISATIONS, cells=None, seed=SEED, scenes=False, overwrite=False, **inputs
):
    """
    Repeat the experiment of Friedl et al. (1995): tables, figures, nine scenarios and report.html.

    Parameters
    ----------
    folder : str or path
        Made where it does not exist.
    realisations, cells, seed : optional
        As in `fifesim.reproduce`.
    scenes : bool, optional
        Write image, truth and scene of the first realisation beside each scenario.
    overwrite : bool, optional
        Replace these files where the folder holds something; other files stay.
    **inputs
        ``reading``, ``dem``, ``densities``, ``optics``, ``background``, ``sensor``, ``west`` and ``north``, as in
        `fifesim.reproduce`.

    Returns
    -------
    files : list of pathlib.Path

    Raises
    ------
    ValueError
        If an input is not allowed, or the folder holds something; nothing is written then.
    OSError
        If a file cannot be written; no half-written file is left.

    References
    ----------
    [Friedl1995]_
    """
    folder = Path(folder)
    check_folder(folder, overwrite)
    if realisations < 1:
        raise ValueError(f"realisations must be at least 1, got {realisations}")
    case = friedl1995.case_of(cells=cells, **inputs)
    scenarios.check_named(case)
    check_cells(case.cells)
    pictures = pictures_of(case)
    names = ["table2.csv", *(f"{name}.csv" for name in _TABLES), *pictures.values(), "scenarios", "report.html"]
    with results(folder, names, overwrite=overwrite) as partial:
        found = reproduce_case(case, realisations, seed, each=_shown)
        tables = _effects(case, range(seed, seed + _EFFECT_REALISATIONS))
        tables["table2"] = _both(found)
        for name, table in tables.items():
            table.to_csv(partial / f"{name}.csv", index=False, float_format="%.6g")
        drawn = {key: pages.png(figures.plot_reproduction(key[0], found, reading=key[1]), _DPI) for key in pictures}
        for key, picture in drawn.items():
            (partial / pictures[key]).write_bytes(picture)
        scenarios.write_scenarios(case, partial / "scenarios", seed, scenes, each=_shown("scenarios"))
        run = {"realisations": realisations, "effect_realisations": _EFFECT_REALISATIONS, "seed": seed}
        run["command"] = command({"realisations": realisations, "cells": case.cells, "seed": seed} | inputs)
        page = friedl1995_report.reproduction_page(case, found, tables, drawn, run)
        (partial / "report.html").write_text(page, encoding="utf-8")
    return [folder / name for name in names]


def pictures_of(case):
    """
    Files of the figures, those that the reading changes twice.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Returns
    -------
    pictures : dict of (int, str) to str
        Names by number and reading.
    """
    shown, other = (reading.name for reading in beside(case.reading))
    names = {}
    for number in figures.NUMBERS:
        names[number, shown] = f"figure{number}.png"
        if number in figures.BY_READING:
            names[number, other] = f"figure{number}_{other}.png"
    return names


def command(options):
    """
    The line that makes the same again.

    Parameters
    ----------
    options : mapping of str
        What is not given is left out.

    Returns
    -------
    line : str

    Examples
    --------
    >>> command({"reading": "aligned", "dem": None, "realisations": 2})
    'fifesim reproduce --reading aligned --realisations 2'
    """
    words = ["fifesim", "reproduce"]
    defaults = {"reading": "native", "dem": "flat", "sensor": TABLE_1}
    for name in (*defaults, "densities", "optics", "background", "west", "north", "realisations", "cells", "seed"):
        value = options.get(name)
        if value is not None and value != defaults.get(name):
            words += [f"--{name}", os.fspath(value) if is_path(value) else str(value)]
    return shlex.join(words)


def _both(found):
    """Table 2 of the reading, and the coefficients of the one that stands beside it."""
    shown, other = (str(name) for name in found["reading"].values)
    table, second = (friedl1995_table.table2(found.sel(reading=name)) for name in (shown, other))
    return table.assign(**{f"{other}_{name}": second[name] for name in friedl1995_table.COEFFICIENTS})


def _effects(case, seeds):
    return {
        "readings": effects.readings(case, seeds, each=_shown("readings of Table 1")),
        "sizes": effects.sizes(case, seeds, each=_shown("sizes of the scene")),
        "sensitivity": effects.sensitivity(case, seeds, each=_shown("numbers chosen")),
    }


def _shown(label):
    return lambda sequence: steps(sequence, label)
