"""The HTML page of the repeated experiment."""

from pathlib import Path

from fifesim.experiments.friedl1995 import fitted
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.captions import captions
from fifesim.experiments.friedl1995.case import ARPS, CELLS
from fifesim.experiments.friedl1995.readings import ALIGNED, CELL, NATIVE, READINGS
from fifesim.ground.landscape.distribution import treatments
from fifesim.output import pages

_TEMPLATE = Path(__file__).with_name("report.html.j2")


def reproduction_page(case, found, effects, figures, run):
    """
    One self-contained HTML page.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    found : xarray.Dataset
        From `fifesim.experiments.friedl1995.reproduction.reproduction`.
    effects : mapping of str to pandas.DataFrame
        ``readings``, ``sizes`` and ``sensitivity`` of `fifesim.experiments.friedl1995.effects`.
    figures : mapping of (int, str) to bytes
        PNG by number and reading.
    run : mapping of str
        ``realisations``, ``effect_realisations``, ``seed``, and the ``command`` that makes the page again.

    Returns
    -------
    html : str
    """
    shown, beside = (str(name) for name in found["reading"].values)
    tables = {name: friedl1995_table.table2(found.sel(reading=name)) for name in (shown, beside)}
    texts = {name: friedl1995_table.text_table(found.sel(reading=name)).to_dict("records") for name in (shown, beside)}
    own = dict(case.densities) == {name: name for name in treatments()}
    return pages.html(
        _TEMPLATE, case=case, run=run, shown=shown, beside=beside, pixel=case.pixel, cell=CELL,
        rows=list(zip(*(table.to_dict("records") for table in tables.values()), strict=True)),
        texts=list(zip(*texts.values(), strict=True)),
        limits=fitted.limits(*tables.values()), origins=fitted.origins(case), fitted=fitted.fitted_count(case),
        agreements={name: friedl1995_table.agreement(table) for name, table in tables.items()},
        readings=READINGS, arps=ARPS, treatments=treatments(), sample=friedl1995_table.SAMPLE,
        effects={name: each.to_dict("records") for name, each in effects.items()},
        blur=on_blur(effects["readings"], effects["sensitivity"]), relief=on_relief(effects["readings"]),
        sizes=on_size(effects["readings"]), moved=effects["sensitivity"]["r2_largest"].max(),
        figures=figures, captions={name: captions(found, name, own) for name in (shown, beside)},
        drift=case.drift, interval=case.interval, standard=case.cells == CELLS,
    )  # fmt: skip


def on_blur(readings, sensitivity):
    """
    What the figures say of blur in the place of drift.

    Parameters
    ----------
    readings, sensitivity : pandas.DataFrame
        From `fifesim.experiments.friedl1995.effects`.

    Returns
    -------
    sentences : list of str
        None where blur was not among the readings.
    """
    rows = {row["name"]: row for row in readings.to_dict("records") if row["dem"] == readings["dem"].iloc[0]}
    blurred = [row for name, row in rows.items() if READINGS[name].eifov is not None]
    if not blurred or NATIVE.name not in rows:
        return []
    drift = rows[NATIVE.name]
    said = [
        f"{row['name']}: R² of LAI off by {row['lai_r2_rms']:.2f} in the root mean square of nine rows, slopes by "
        f"{100 * row['lai_slope_rms']:.0f} %; {100 * row['lai_slope_rest']:.0f} % once all are divided by a common "
        f"factor of {row['lai_slope_factor']:.2f}; they grow {row['growth']:.2f} times from arp {min(ARPS):g} to "
        f"{max(ARPS):g}."
        for row in (drift, *blurred)
    ]
    paper = drift["paper_growth"]
    said.append(f"The paper's slopes grow {paper:.2f} times.")
    closest = min(blurred, key=lambda row: row["lai_r2_rms"])
    if closest["lai_slope_rms"] > 2 * drift["lai_slope_rms"]:
        said.append(_slopes_decide(drift, closest, paper, sensitivity))
    else:
        said.append("These figures do not tell blur from drift.")
    return said


def on_relief(readings):
    """
    What relief does, beside the same without, or the reverse.

    Parameters
    ----------
    readings : pandas.DataFrame

    Returns
    -------
    relief : dict
        Rows of the readings table: ``level`` and ``hills``, each by reading, and the ``lowest`` row of R2 on hills.
    """
    rows = readings.to_dict("records")
    first = rows[0]["dem"]
    sets = {dem: {row["name"]: row for row in rows if row["dem"] == dem} for dem in readings["dem"].unique()}
    other = next(dem for dem in sets if dem != first)
    level, hills = (first, other) if first == "flat" else (other, first)
    keys = [f"r2 {treatment} {arp:g}" for treatment in treatments() for arp in ARPS]
    changed = {key: sets[hills][NATIVE.name][key] - sets[level][NATIVE.name][key] for key in keys}
    most = min(changed, key=changed.get)
    _, treatment, arp = most.split()
    return {
        "level": sets[level], "hills": sets[hills], "dem": hills, "most": most, "treatment": treatment, "arp": arp,
        "least": max(changed, key=changed.get), "native": NATIVE.name, "aligned": ALIGNED.name,
    }  # fmt: skip


def on_size(readings):
    """
    Whether a constant displacement does as well as the interval.

    Parameters
    ----------
    readings : pandas.DataFrame

    Returns
    -------
    sentence : str
    """
    rows = {row["name"]: row for row in readings.to_dict("records") if row["dem"] == readings["dem"].iloc[0]}
    offset, native = rows["offset"], rows[NATIVE.name]
    said = (
        f"a constant offset has R² of LAI off by {offset['lai_r2_rms']:.3f} and slopes by "
        f"{100 * offset['lai_slope_rms']:.0f} % in the root mean square, the interval by {native['lai_r2_rms']:.3f} and "
        f"{100 * native['lai_slope_rms']:.0f} %"
    )
    alike = abs(offset["lai_r2_rms"] - native["lai_r2_rms"]) < 0.02
    return said + (": Table 2 does not tell them apart" if alike else "")


def _slopes_decide(drift, blurred, paper, sensitivity):
    """Why blur is not the drift, in figures."""
    step = sensitivity["lai_slope"].abs().max() if len(sensitivity) else float("nan")
    growth = "do not grow so" if abs(blurred["growth"] - paper) > 2 * abs(drift["growth"] - paper) else "grow so too"
    return (
        f"R² alone lets blur pass for drift; slopes do not: blur narrows NDVI, and they rise to "
        f"{blurred['lai_slope_factor']:.2f} times the paper's, where the largest that one changed number does to them is "
        f"{100 * step:.0f} %. Other optics may bring a common factor; but slopes of {blurred['name']} {growth}, and "
        "growth is what a common factor leaves as it is."
    )
