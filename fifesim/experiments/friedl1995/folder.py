"""The repeated experiment as a folder of files."""

from pathlib import Path

from fifesim.base.seeds import check_seed
from fifesim.experiments.friedl1995 import effects, figures
from fifesim.experiments.friedl1995 import report as friedl1995_report
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import Case
from fifesim.output import pages
from fifesim.output.folders import check_folder, results
from fifesim.output.progress import steps
from fifesim.output.run.size import check_cells

NUMBERS = range(3, 10)
FILES = ("table2.csv", *(f"figure{number}.png" for number in NUMBERS), "report.html")

# Differences between cases share their random numbers, and need few realisations.
_EFFECT_REALISATIONS = 2
_DPI = 200


def reproduce_to_folder(folder, *, realisations=20, cells=333, seed=1995, overwrite=False):
    """
    Repeat the experiment of Friedl et al. (1995): table2.csv, figure3.png to figure9.png and report.html.

    Parameters
    ----------
    folder : str or path
        Made where it does not exist.
    realisations : int, optional
        Of each of the nine scenes.
    cells : int, optional
        Along the edge of a scene, of 3.33 m each.
    seed : int, optional
        Of the first realisation, whose scenes the figures show; the others follow.
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

    References
    ----------
    [Friedl1995]_
    """
    folder = Path(folder)
    check_folder(folder, overwrite)
    if realisations < 1:
        raise ValueError(f"realisations must be at least 1, got {realisations}")
    case = Case(cells=cells)
    check_seed(seed)
    check_cells(cells)
    seeds = range(seed, seed + realisations)
    with results(folder, FILES, overwrite=overwrite) as partial:
        outcome = friedl1995_table.realise(case, seeds, each=_shown("nine scenes"))
        table, text = friedl1995_table.table2(outcome), friedl1995_table.text_table(outcome)
        few = range(seed, seed + _EFFECT_REALISATIONS)
        tables = {
            "readings": effects.readings(case, few, each=_shown("readings of Table 1")),
            "sizes": effects.sizes(case, few, each=_shown("sizes of the scene")),
            "sensitivity": effects.sensitivity(case, few, each=_shown("numbers chosen")),
        }
        run = {"realisations": realisations, "effect_realisations": _EFFECT_REALISATIONS, "cells": cells, "seed": seed}
        table.to_csv(partial / "table2.csv", index=False, float_format="%.6g")
        scenes = figures.pixels(case, figures.BURNED_GRAZED, seed)
        drawn = {number: getattr(figures, f"figure{number}")(scenes) for number in NUMBERS[1:]}
        pictures = {n: pages.png(figure, _DPI) for n, figure in ({3: figures.figure3(case)} | drawn).items()}
        for number, picture in pictures.items():
            (partial / f"figure{number}.png").write_bytes(picture)
        page = friedl1995_report.reproduction_page(case, table, text, tables, pictures, run)
        (partial / "report.html").write_text(page, encoding="utf-8")
    return [folder / name for name in FILES]


def _shown(label):
    return lambda sequence: steps(sequence, label)
