"""The same ground through every instrument: what blur, noise, registration, counts and air take from each."""

import math

import pandas as pd

from fifesim.experiments.scatter.shares import TOTAL, VARIATION, budget, table
from fifesim.scenario.scenario import Scenario
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.description.responses import knows_blur

_PIXELS = 12  # along a window of a coarse instrument, at least
_CELLS = 333  # along a window of any

# Column of the table that states whether the instrument's file has what a stage needs.
KNOWN = {"point spread": "blur", "registration": "place", "noise": "noise"}


def instrument_scenario(name, *, arp=0.15):
    """
    The paper's ground on level land as an instrument sees it.

    Parameters
    ----------
    name : str
        Of the instrument, or a file.
    arp : float, optional
        Of the ground. [1]

    Returns
    -------
    scenario : fifesim.scenario.scenario.Scenario
        Red and near infrared on the grid of its product, with its noise, and displaced along both axes by the root mean
        square error of the product's place: each where its file has them.

    Raises
    ------
    ValueError
        If there is no such instrument, or it has no red and no near infrared band.
    """
    description = instrument(name)
    bands = description.red_and_near_infrared()
    shift = (description.geolocation or 0.0) / description.pixel(bands[0])
    noise = ["all"] if all(band.noise for band in bands) else []
    sensor = {"instrument": name, "bands": [band.name for band in bands], "noise": noise, "offset": [shift, shift]}
    return Scenario(sensor=sensor, ground={"arp": arp}, terrain={"dem": "flat"})


def window_cells(scenario):
    """
    Cells along the edge of a window that holds enough pixels of an instrument.

    Parameters
    ----------
    scenario : fifesim.scenario.scenario.Scenario

    Returns
    -------
    cells : int
        333, or 12 pixels.
    """
    return max(_CELLS, math.ceil(_PIXELS * scenario.sensor.size / scenario.grid.cell))


def compare_instruments(names, *, arps=(0.05, 0.15, 0.24), realisations=20, each=iter):
    """
    Where the scatter comes from in the image of each instrument over the same ground.

    Parameters
    ----------
    names : sequence of str
    arps : sequence of float, optional
        Of the ground. [1]
    realisations : int, optional
        Of each.
    each : callable, optional
        Wraps the sequence of cases, to show how far it is.

    Returns
    -------
    table : pandas.DataFrame
        Rows of `fifesim.experiments.scatter.shares.table`, with ``instrument``, ``arp``, the ``pixel`` [m], and whether
        the file has the instrument's ``blur``, ``noise`` and ``place``. A stage whose property is unknown is NaN, and
        so are the total and the sub-pixel variation of its instrument. [1]

    Raises
    ------
    ValueError
        As `instrument_scenario`.
    """
    found = []
    for name, arp in each([(name, arp) for name in names for arp in arps]):
        scenario, description = instrument_scenario(name, arp=arp), instrument(name)
        bands, pixel = description.select(scenario.sensor.bands), scenario.sensor.size
        rows = table(budget(scenario, realisations=realisations, cells=window_cells(scenario), each=iter))
        known = {
            "blur": all(knows_blur(description, band) for band in bands),
            "noise": bool(scenario.sensor.noise),
            "place": description.geolocation is not None,
        }
        rows = _without_unknown(rows, known)
        found.append(rows.assign(instrument=description.name, arp=arp, pixel=pixel, **known))
    return pd.concat(found, ignore_index=True)


def _without_unknown(rows, known):
    """Rows of a budget, NaN where a stage's property is unknown or a row counts all stages."""
    unknown = [stage for stage, name in KNOWN.items() if not known[name]]
    hidden = rows["stage"].isin([*unknown, TOTAL, VARIATION] if unknown else [])
    numbers = rows.columns.difference(["stage", "variable"])
    return rows.assign(**rows[numbers].mask(hidden))
