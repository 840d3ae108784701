"""The HTML page of the repeated experiment."""

from pathlib import Path

from fifesim.experiments.friedl1995 import fitted
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.captions import figure_captions
from fifesim.experiments.friedl1995.case import ARPS
from fifesim.experiments.friedl1995.readings import ALIGNED, NATIVE, PASSAGES, READINGS, TABLE_1
from fifesim.ground.landscape.distribution import treatments
from fifesim.output import pages

# Root mean squares of R2 that differ by less are alike: two realisations leave about so much. [1]
_ALIKE = 0.02

# Standard deviations over fewer realisations are too uncertain to divide by.
_FEWEST = 10

_GROUND = {"flat": "level", "flint-hills": "the synthetic Flint Hills"}

_RELIEF_COUNTS = (
    "If the pixels drifted as they do here, relief of this kind was not in Table 2; if relief of this kind was, its "
    "scatter is not to be had from this drift with these densities and optics. The paper does not say which, nor do "
    "these simulations."
)
_RELIEF_HELPS = (
    "Relief of this kind brings R² nearer to the paper's; how near is in the table. So a part of the paper's scatter "
    "may be relief."
)
_RELIEF_PASSES = "Relief of this kind changes too little to be told from level ground by Table 2."

_TEMPLATE = Path(__file__).with_name("report.html.j2")


def reproduction_page(case, found, effects, figures, run):
    """
    One self-contained HTML page.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    found : xarray.Dataset
        From `fifesim.experiments.friedl1995.reproduction.reproduce_case`.
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
    texts = [friedl1995_table.text_table(found.sel(reading=name)).to_dict("records") for name in (shown, beside)]
    own = dict(case.densities) == {name: name for name in treatments()}
    return pages.html(
        _TEMPLATE, case=case, run=run, shown=shown, beside=beside, **_constants(case),
        rows=list(zip(*(table.to_dict("records") for table in tables.values()), strict=True)),
        texts=list(zip(*texts, strict=True)),
        limits=fitted.limits(*tables.values()), origins=fitted.origins(case), fitted=fitted.fitted_count(case),
        agreements={name: friedl1995_table.agreement(table) for name, table in tables.items()},
        figures=figures, captions={name: figure_captions(found, name, own) for name in (shown, beside)},
        **_conclusions(effects),
    )  # fmt: skip


def _constants(case):
    """What a page says of its case, whatever was found."""
    return {
        "arps": ARPS, "treatments": treatments(), "sample": friedl1995_table.SAMPLE, "fewest": _FEWEST,
        "increments": friedl1995_table.INCREMENTS, "tm": case.sensor == TABLE_1, "drift": case.drift,
        "interval": case.interval, "pixel": case.pixel, "passages": PASSAGES,
        "readings": {name: each.in_words(case.interval, case.pixel) for name, each in READINGS.items()},
    }  # fmt: skip


def _conclusions(effects):
    """The tables of effects, and what follows from them."""
    readings, sensitivity = effects["readings"], effects["sensitivity"]
    return {
        "effects": {name: each.to_dict("records") for name, each in effects.items()},
        "known": list(dict.fromkeys(readings["name"])),
        "lands": {name: _GROUND.get(name, Path(name).name) for name in readings["dem"].unique()},
        "blur": on_blur(readings, sensitivity), "relief": on_relief(readings),
        "displacement": on_displacement(readings), "moved": sensitivity["r2_largest"].max(),
    }  # fmt: skip


def on_blur(readings, sensitivity):
    """
    What the figures say of blur in the place of drift.

    Parameters
    ----------
    readings, sensitivity : pandas.DataFrame
        From `fifesim.experiments.friedl1995.effects`.

    Returns
    -------
    text : str
        Empty where blur is not among the readings.
    """
    rows = _of_case(readings)
    blurred = [row for name, row in rows.items() if READINGS[name].eifov is not None]
    if not blurred:
        return ""
    drift, blur = rows[NATIVE.name], min(blurred, key=lambda row: row["lai_r2_rms"])
    said = (
        f"R² of {blur['name']} is off by {blur['lai_r2_rms']:.2f} in the root mean square of nine rows, that of the "
        f"drift by {drift['lai_r2_rms']:.2f}. Slopes of {blur['name']} are off by {100 * blur['lai_slope_rms']:.0f} %, "
        f"those of the drift by {100 * drift['lai_slope_rms']:.0f} %"
    )
    if blur["lai_slope_rms"] < 2 * drift["lai_slope_rms"]:
        return said + ": these figures do not tell blur from drift."
    step = 100 * sensitivity["lai_slope"].abs().max() if len(sensitivity) else 0.0
    said += (
        f": blur narrows NDVI, drift does not, and slopes rise {blur['lai_slope_factor']:.2f} times. Other optics "
        f"could lower all of them together, though no change in the last table moves them by more than {step:.0f} %; "
        f"{100 * blur['lai_slope_rest']:.0f} % would be left, of the drift {100 * drift['lai_slope_rest']:.0f} %. "
    )
    paper, drifting, blurring = drift["paper_growth"], drift["growth"], blur["growth"]
    growths = f"{paper:.2f} times in the paper, {drifting:.2f} with drift, {blurring:.2f} with blur"
    decided = abs(blurring - paper) > 2 * abs(drifting - paper)
    end = "So slopes decide, not R²." if decided else "So it is their height that speaks against blur, and no more."
    return said + f"What a common factor leaves is how slopes grow with arp: {growths}. {end}"


def on_relief(readings):
    """
    What relief does, beside the same without, or the reverse.

    Parameters
    ----------
    readings : pandas.DataFrame

    Returns
    -------
    relief : dict
        Rows of the readings table by reading, ``level`` and ``hills``; the ``treatment`` and ``arp`` whose R2 falls
        most, and its column; and what ``follows``.
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
    worse = sets[hills][NATIVE.name]["lai_r2_rms"] - sets[level][NATIVE.name]["lai_r2_rms"]
    return {
        "level": sets[level], "hills": sets[hills], "dem": hills, "most": most, "treatment": treatment, "arp": arp,
        "follows": _RELIEF_COUNTS if worse > _ALIKE else _RELIEF_HELPS if worse < -_ALIKE else _RELIEF_PASSES,
        "native": NATIVE.name, "aligned": ALIGNED.name,
    }  # fmt: skip


def on_displacement(readings):
    """
    Whether a constant displacement does as well as the interval.

    Parameters
    ----------
    readings : pandas.DataFrame

    Returns
    -------
    sentence : str
    """
    rows = _of_case(readings)
    offset, native = rows["offset"], rows[NATIVE.name]
    said = (
        f"A constant offset has R² of LAI off by {offset['lai_r2_rms']:.3f} and slopes by "
        f"{100 * offset['lai_slope_rms']:.0f} % in the root mean square, the interval by {native['lai_r2_rms']:.3f} "
        f"and {100 * native['lai_slope_rms']:.0f} %"
    )
    alike = abs(offset["lai_r2_rms"] - native["lai_r2_rms"]) < _ALIKE
    return said + (": Table 2 does not tell them apart." if alike else ".")


def _of_case(readings):
    """Rows on the elevation of the case, by name."""
    return {row["name"]: row for row in readings.to_dict("records") if row["dem"] == readings["dem"].iloc[0]}
