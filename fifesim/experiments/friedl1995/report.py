"""The HTML page of the repeated experiment."""

from pathlib import Path

from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ARPS
from fifesim.output import pages

_TEMPLATE = Path(__file__).with_name("report.html.j2")

CAPTIONS = {
    3: "Densities of LAI of the three treatments, inferred from Table 2 (the measurements are not public).",
    4: "LAI of the ground, burned and grazed: a part of 120 x 120 cells of 3.33 m.",
    5: "LAI and FPAR of 200 pixels against NDVI, burned and grazed. Ground: means of the cells' NDVI over the blocks "
    "of the truth. Sensor: the simulated image, whose 8 bits show as columns.",
    6: "Densities of 200 pixels, and of all cells, burned and grazed; NDVI is that at the top of the atmosphere.",
    7: "Relative equivalent noise (Eq. 7) of 200 pixels by increments of 0.1 of LAI and 0.05 of FPAR with at "
    "least three pixels.",
    8: "NDVI of the mean reflectance against the mean NDVI of the cells (above), and their difference beside what the "
    "curvature of NDVI predicts from the variances within the pixel (below).",
    9: "Reflectance of the image against the mean reflectance of the ground in the same block. The line is what the "
    "atmosphere alone does; the scatter about it is the sensor's.",
}


def reproduction_page(case, table, text, effects, figures, run):
    """
    One self-contained HTML page.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    table : pandas.DataFrame
        From `friedl1995_table.table2`.
    text : pandas.DataFrame
        From `friedl1995_table.text_table`.
    effects : mapping of str to pandas.DataFrame
        ``readings``, ``sizes`` and ``sensitivity`` of `friedl1995_effects`.
    figures : mapping of int to bytes
        PNG by number.
    run : mapping of str to int
        ``realisations``, ``effect_realisations``, ``cells`` and ``seed``.

    Returns
    -------
    html : str
    """
    found = friedl1995_table.agreement(table)
    return pages.html(
        _TEMPLATE, rows=table.to_dict("records"), text=text.to_dict("records"), criteria=criteria(table, text),
        agreement=found, arps=ARPS, sample=friedl1995_table.SAMPLE,
        effects={name: each.to_dict("records") for name, each in effects.items()},
        figures=figures, captions=CAPTIONS, run=run, readings=friedl1995.READINGS,
        used=friedl1995.USED, interval=case.setup.instrument.ground_interval,
        cell=friedl1995.CELL, pixel=friedl1995.PIXEL,
        standard_cells=friedl1995.CELLS, optics=case.setup.leaf_optics, drift=_drift(case),
        relief=_named(effects["readings"], "native interval with relief"),
        aligned_relief=_named(effects["readings"], "aligned with relief"),
    )  # fmt: skip


def criteria(table, text):
    """
    How near to the paper the results are, and how near they should be.

    Parameters
    ----------
    table, text : pandas.DataFrame
        As `reproduction_page` takes them.

    Returns
    -------
    criteria : list of dict
        ``name``, ``value``, ``limit`` and whether it is ``met``.
    """
    found = friedl1995_table.agreement(table)
    rows = []
    for variable, intercept in (("lai", 0.25), ("fpar", 0.06)):
        label = variable.upper()
        rows += [
            (f"R² of {label}, largest difference of nine rows", found[f"{variable}_r2_largest"], 0.12),
            (f"R² of {label}, largest difference at arp 0.24", found[f"{variable}_r2_largest_long"], 0.08),
            (f"R² of {label}, root mean square difference", found[f"{variable}_r2_rms"], 0.06),
            (f"slope of {label}, largest relative difference", found[f"{variable}_slope_largest"], 0.15),
            (f"intercept of {label}, largest difference", found[f"{variable}_intercept_largest"], intercept),
        ]
    known = text.dropna(subset=["paper"])
    noise, kept = (known[known["quantity"] == name] for name in ("ren", "range_kept"))
    rows += [
        ("mean REN, largest relative difference", float((noise["value"] / noise["paper"] - 1).abs().max()), 0.45),
        ("share of the range kept, largest difference", float((kept["value"] - kept["paper"]).abs().max()), 0.10),
    ]
    out = [{"name": name, "value": value, "limit": f"{limit:g}", "met": value <= limit} for name, value, limit in rows]
    for variable in ("lai", "fpar"):
        of = noise[noise["variable"] == variable].set_index("arp")["value"]
        growth = float(of[max(ARPS)] / of[min(ARPS)])
        out.append({"name": f"mean REN of {variable.upper()} at arp 0.24 over that at 0.05", "value": growth,
                    "limit": "2 to 3.3", "met": 2 <= growth <= 3.3})  # fmt: skip
    return out


def _named(table, name):
    """The row of a table with a name."""
    return table[table["name"] == name].iloc[0].to_dict()


def _drift(case):
    """How far the last pixel lies from its block. [m]"""
    size = case.setup.instrument.ground_interval
    return int(case.cells * friedl1995.CELL / size - 1) * (size - friedl1995.PIXEL)
