"""What each choice does to Table 2: readings of Table 1, the size of the scene, and every number chosen."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ARPS, VARIABLES
from fifesim.ground.canopy.optics import background

SIZES = (256, 300, 333, 400)


@dataclass(frozen=True)
class Change:
    """One number changed in the case: what it is, what it was, what it becomes, and the case with it."""

    name: str
    before: str
    after: str
    case: friedl1995.Case


def readings(case, seeds, each=iter):
    """
    The readings of Table 1 side by side.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int
    each : callable, optional
        Wraps the readings.

    Returns
    -------
    table : pandas.DataFrame
        A row for each: R2 of LAI, burned and grazed, and of LAI, burned and ungrazed, by arp, and how far all rows are
        from the paper's.
    """
    cases = [(reading.name, replace(case, reading=reading)) for reading in friedl1995.READINGS]
    return pd.DataFrame([_row(name, one, seeds) for name, one in each(cases)])


def sizes(case, seeds, each=iter):
    """
    Scenes of several sizes: the larger, the further the last pixels are from their blocks.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int
    each : callable, optional
        Wraps the sizes.

    Returns
    -------
    table : pandas.DataFrame
        As `readings` gives it.
    """
    cases = [(f"{cells} cells, {cells * friedl1995.CELL:.0f} m", replace(case, cells=cells)) for cells in SIZES]
    return pd.DataFrame([_row(name, one, seeds) for name, one in each(cases)])


def sensitivity(case, seeds, each=iter):
    """
    What a change of each chosen number does, with the same random numbers.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int
    each : callable, optional
        Wraps the changes.

    Returns
    -------
    table : pandas.DataFrame
        A row for each change: ``name``, ``before``, ``after``, and the mean change over nine rows of R2 and of slopes
        (relative) and intercepts, of LAI and of FPAR; of mean noise and range kept of LAI at arp 0.24.
    """
    base = friedl1995_table.realise(case, seeds)
    rows = []
    for change in each(changes(case)):
        other = friedl1995_table.realise(change.case, seeds)
        row = {"name": change.name, "before": change.before, "after": change.after}
        for k, variable in enumerate(VARIABLES):
            was, now = base.fits.mean(axis=0)[:, k], other.fits.mean(axis=0)[:, k]
            row |= {
                f"{variable}_r2": np.mean(now[:, 2] - was[:, 2]),
                f"{variable}_slope": np.mean(now[:, 1] / was[:, 1] - 1),
                f"{variable}_intercept": np.mean(now[:, 0] - was[:, 0]),
            }
        longest = len(ARPS) - 1
        row["lai_ren"] = (other.ren - base.ren)[:, longest, 0].mean()
        row["lai_kept"] = (other.kept - base.kept)[:, longest, 0].mean()
        rows.append(row)
    return pd.DataFrame(rows)


def changes(case):
    """
    A change of each number that was chosen.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Returns
    -------
    changes : list of Change
    """
    ground = dict(zip(friedl1995.BANDS, background(list(friedl1995.BANDS), case.setup.background), strict=True))
    found = []
    for name, (band, position, step) in {
        "leaf reflectance TM3": ("TM3", 0, -0.005),
        "leaf reflectance TM4": ("TM4", 0, 0.01),
        "leaf transmittance TM3": ("TM3", 1, 0.01),
        "leaf transmittance TM4": ("TM4", 1, 0.02),
    }.items():
        pair = list(case.setup.leaf_optics[band])
        before, pair[position] = pair[position], round(pair[position] + step, 6)
        optics = {**case.setup.leaf_optics, band: tuple(pair)}
        found.append(Change(name, f"{before:g}", f"{pair[position]:g}", _but(case, leaf_optics=optics)))
    for band, step in (("TM3", 0.01), ("TM4", 0.01)):
        after = round(ground[band] + step, 6)
        changed = _but(case, background={**ground, band: after})
        found.append(Change(f"background {band}", f"{ground[band]:g}", f"{after:g}", changed))
    for name, after, shift, factor, bound in (
        ("mean LAI", "each + 0.1", 0.1, 1.0, 0.0),
        ("standard deviation of LAI", "each less a tenth", 0.0, 0.9, 0.0),
        ("bounds of LAI", "2.75 standard deviations from the mean", 0.0, 1.0, -0.25),
    ):
        densities = friedl1995.densities(shift, factor, bound)
        found.append(Change(name, "the table's", after, replace(case, densities=densities)))
    instrument = case.setup.instrument
    finer = _but(case, instrument=replace(instrument, bits=16))
    found.append(Change("radiometric bits", f"{instrument.bits}", "16, next to no quantisation", finer))
    return found


def _but(case, **changes):
    """The case with another setup."""
    return replace(case, setup=replace(case.setup, **changes))


def _row(name, case, seeds):
    table = friedl1995_table.table2(friedl1995_table.realise(case, seeds))
    row = {"name": name}
    for treatment in ("burned-grazed", "burned-ungrazed"):
        chosen = table[(table["variable"] == "lai") & (table["distribution"] == treatment)]
        row |= {f"{treatment} {arp:g}": value for arp, value in zip(ARPS, chosen["r2"], strict=True)}
    return row | friedl1995_table.agreement(table)
