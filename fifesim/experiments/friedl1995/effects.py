"""What each choice does to Table 2: readings of Table 1, relief, the size of the scene, and every number chosen."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from fifesim.base import datasets
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ARPS, VARIABLES
from fifesim.experiments.friedl1995.readings import ALIGNED, CELL, NATIVE, READINGS, TABLE_1
from fifesim.ground.canopy.optics import background, leaf_optics
from fifesim.ground.landscape.distribution import treatments, truncated_normal

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
    The readings of Table 1 side by side, on the case's elevation, and the first two of them with or without relief.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    seeds : sequence of int
    each : callable, optional
        Wraps the sequence of scenes.

    Returns
    -------
    table : pandas.DataFrame
        A row for each: ``name`` and ``dem``; R2 and slopes of LAI by treatment and arp, such as
        ``r2 burned-grazed 0.05``; ``growth``, the slope at arp 0.24 over that at 0.05 in the mean of the three
        treatments; and how far all rows are from the paper's, as `agreement` has it.
    """
    other = replace(case, dem="flint-hills" if case.dem == "flat" else "flat")
    rows = []
    for one, several in ((case, readings_for(case)), (other, (NATIVE, ALIGNED))):
        found = friedl1995_table.realise(one, seeds, readings=several, each=each)
        rows += [
            {"name": reading.name, "dem": one.dem} | row_of(found.sel(reading=reading.name)) for reading in several
        ]
    return pd.DataFrame(rows)


def readings_for(case):
    """
    Readings that the instrument of a case can have.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Returns
    -------
    readings : list of Reading
        All for TM; another has no line spread of Table 1.
    """
    return [each for each in READINGS.values() if case.instrument.name == TABLE_1 or not each.other_response]


def sizes(case, seeds, each=iter):
    """
    Scenes of several sizes: the larger, the further the last native pixels are from their blocks.

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
    rows = []
    for cells in each(tuple(round(size / friedl1995.CELLS * case.cells) for size in SIZES)):
        found = friedl1995_table.realise(replace(case, cells=cells), seeds).isel(reading=0)
        rows.append({"name": f"{cells} cells, {cells * CELL:.0f} m"} | row_of(found))
    return pd.DataFrame(rows)


def row_of(found):
    """
    Table 2 of one reading in a row.

    Parameters
    ----------
    found : xarray.Dataset
        From `fifesim.experiments.friedl1995.table.realise`, of one reading.

    Returns
    -------
    row : dict
        As `readings` says.
    """
    table = friedl1995_table.table2(found)
    row = friedl1995_table.agreement(table)
    lai = table[table["variable"] == "lai"]
    return lines_in_a_row(lai) | {f"paper_{key}": value for key, value in lines_in_a_row(lai, "paper_").items()} | row


def lines_in_a_row(table, prefix=""):
    """
    R2 and slopes of LAI by treatment and arp, and how slopes grow with arp.

    Parameters
    ----------
    table : pandas.DataFrame
        Rows of LAI of Table 2.
    prefix : str, optional
        Of the columns, ``paper_`` for the paper's.

    Returns
    -------
    row : dict of str to float
    """
    known = table.set_index(["distribution", "arp"])
    row = {
        f"{name} {treatment} {arp:g}": float(known.loc[(treatment, arp), prefix + name])
        for name in ("r2", "slope")
        for treatment in treatments()
        for arp in ARPS
    }
    growths = [row[f"slope {name} {max(ARPS):g}"] / row[f"slope {name} {min(ARPS):g}"] for name in treatments()]
    return row | {"growth": float(np.mean(growths))}


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
        (relative) and intercepts, of LAI and of FPAR; ``r2_largest``, the largest change of an R2; of mean noise and
        range kept of LAI at arp 0.24, burned and grazed.
    """
    base = friedl1995_table.realise(case, seeds).isel(reading=0).mean("realisation")
    rows = []
    for change in each(changes(case)):
        other = friedl1995_table.realise(change.case, seeds).isel(reading=0).mean("realisation")
        row = {"name": change.name, "before": change.before, "after": change.after}
        for variable in VARIABLES:
            was, now = base.sel(variable=variable), other.sel(variable=variable)
            row |= {
                f"{variable}_r2": (now["r2"] - was["r2"]).mean(),
                f"{variable}_slope": (now["slope"] / was["slope"] - 1).mean(),
                f"{variable}_intercept": (now["intercept"] - was["intercept"]).mean(),
            }
        longest = {"distribution": treatments()[0], "arp": max(ARPS)}
        row["r2_largest"] = abs(other["r2"] - base["r2"]).max()
        row["lai_ren"] = (other["ren"] - base["ren"]).sel(variable="lai", **longest)
        row["lai_kept"] = (other["range_kept"] - base["range_kept"]).sel(quantity="lai", **longest)
        rows.append({key: value if isinstance(value, str) else float(value) for key, value in row.items()})
    return pd.DataFrame(rows)


def changes(case):
    """
    A change of each number that was chosen; densities of one's own stay.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Returns
    -------
    changes : list of Change
    """
    found = [*_leaf_changes(case), *_background_changes(case)]
    if dict(case.densities) == {name: name for name in treatments()}:
        for name, after, keys in (
            ("mean LAI", "each + 0.1", {"shift": 0.1}),
            ("standard deviation of LAI", "each less a tenth", {"factor": 0.9}),
            ("bounds of LAI", "3 standard deviations from the mean", {"bound": 0.25}),
        ):
            found.append(Change(name, "the table's", after, replace(case, densities=shifted_densities(**keys))))
    bits = case.instrument.bits
    if bits < 16:
        found.append(Change("radiometric bits", f"{bits}", "16, next to no quantisation", replace(case, bits=16)))
    return found


def shifted_densities(shift=0.0, factor=1.0, bound=0.0):
    """
    Densities of LAI of the three treatments, changed.

    Parameters
    ----------
    shift : float, optional
        Added to mean and bounds. [m2 m-2]
    factor : float, optional
        Of the standard deviation. [1]
    bound : float, optional
        By how many standard deviations the bounds move outward; a lower one of 0 stays. [1]

    Returns
    -------
    densities : dict of str to frozen scipy distribution
        By treatment.
    """
    found = {}
    for name, mean, deviation, low, high in datasets.table("lai_distributions.csv").itertuples(index=False):
        moved = max(low + shift - bound * deviation, 0.0) if low else low, high + shift + bound * deviation
        found[name] = truncated_normal(mean + shift, factor * deviation, *moved)
    return found


def _responses(case):
    """Bands of the case, which spectra need."""
    return [band.response for band in case.instrument.select(case.bands)]


def _leaf_changes(case):
    """One leaf number at a time."""
    pairs = np.transpose(leaf_optics(_responses(case), case.optics))
    optics = {band: tuple(map(float, pair)) for band, pair in zip(case.bands, pairs, strict=True)}
    steps = {"leaf reflectance": (-0.005, 0.01), "leaf transmittance": (0.01, 0.02)}
    for position, (name, by_band) in enumerate(steps.items()):
        for band, step in zip(case.bands, by_band, strict=True):
            pair = list(optics[band])
            before, pair[position] = pair[position], round(pair[position] + step, 6)
            changed = replace(case, optics={**optics, band: tuple(pair)})
            yield Change(f"{name} {band}", f"{before:.4g}", f"{pair[position]:.4g}", changed)


def _background_changes(case):
    """Background of one band at a time."""
    values = background(_responses(case), case.background)
    ground = {band: float(value) for band, value in zip(case.bands, values, strict=True)}
    for band in case.bands:
        after = round(ground[band] + 0.01, 6)
        changed = replace(case, background={**ground, band: after})
        yield Change(f"background {band}", f"{ground[band]:.4g}", f"{after:.4g}", changed)
