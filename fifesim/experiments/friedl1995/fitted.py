"""What of the agreement with Table 2 is found, what is fitted and what is assumed, and how near is near."""

from dataclasses import dataclass

from fifesim.base import datasets
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import CELLS, VARIABLES
from fifesim.experiments.friedl1995.readings import PASSAGES, READINGS, TABLE_1
from fifesim.ground.landscape.distribution import treatments

FITTED, CHOSEN, FOUND, YOURS = "fitted to Table 2", "assumed", "in the paper", "given by you"
# To the length scales, and to the share of the range that pixels keep, which the paper's text states.
FITTED_TO_TEXT = "fitted to the text"

# Largest differences that are wanted, by variable. They were set after trials with nearly the inputs and the reading of
# now and before this program first ran the nine scenes, in view of how samples of 200 pixels scatter; `limits` says how
# many of their standard deviations each is.
_WANTED = {
    "r2_largest": 0.12,
    "r2_largest_long": 0.08,
    "r2_rms": 0.06,
    "slope_largest": 0.15,
    "intercept_largest": {"lai": 0.25, "fpar": 0.06},
}
_WORDS = {
    "r2_largest": "R² of {}, largest difference of nine rows",
    "r2_largest_long": "R² of {}, largest difference at arp 0.24",
    "r2_rms": "R² of {}, root mean square difference",
    "slope_largest": "slope of {}, largest relative difference",
    "intercept_largest": "intercept of {}, largest difference",
}


@dataclass(frozen=True)
class Origin:
    """
    Where numbers that the simulation needs come from.

    Parameters
    ----------
    name : str
    count : int
    origin : str
        One of "fitted to Table 2", "fitted to the text", "assumed", "in the paper" and "given by you".
    text : str
        How.
    """

    name: str
    count: int
    origin: str
    text: str


def origins(case):
    """
    Where each number comes from that the nine scenes need.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Returns
    -------
    origins : list of Origin
    """
    scenes, bands = len(treatments()), len(case.bands)
    return [
        *_densities(case, scenes),
        _optics(case, 2 * bands),
        _background(case, bands),
        _size(case),
        Origin(
            "reading of Table 1", 1, FITTED if case.reading.own_interval and case.sensor == TABLE_1 else CHOSEN,
            f"{case.reading.name}, one of {len(READINGS)}; R² of Table 2 agrees with the native one, "
            f"{' and '.join(f'section {name}' for name in PASSAGES)} with the aligned one",
        ),
        Origin(
            "form of the random field", 1, FITTED_TO_TEXT,
            "simultaneous, of two forms that were tried; its length scales and range kept are nearer to the paper's",
        ),
        _land(case),
        Origin(
            "instrument", 1, FOUND if case.sensor == TABLE_1 else YOURS,
            "interval, line spread (9 angles as 9 steps), bits and radiances of Table 1"
            if case.sensor == TABLE_1
            else case.instrument.title,
        ),
        Origin("arp", 3, FOUND, "section Analyses: 0.05, 0.15 and 0.24"),
        Origin("air", 2, FOUND, "section Data: midlatitude summer, continental, visibility 45 km, by 5S"),
        Origin("leaf angles, FPAR of a thick canopy", 2, FOUND, "sections Data and Analyses: spherical, 0.94"),
        Origin("date", 1, FOUND, "section Data: 6 June 1987"),
        Origin("hour and view", 2, CHOSEN, "16:35 UTC, the hour of a Landsat, and nadir; the paper states neither"),
    ]  # fmt: skip


def fitted_count(case):
    """
    How many numbers were fitted to the 54 of Table 2.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Returns
    -------
    count : int
    """
    return sum(each.count for each in origins(case) if each.origin == FITTED)


def limits(table, beside):
    """
    How near to the paper the coefficients are, how near they should be, and why so near.

    Parameters
    ----------
    table, beside : pandas.DataFrame
        From `table2`, of the reading and of the one that stands beside it.

    Returns
    -------
    limits : list of dict
        ``name``, ``value`` and ``beside``, the ``limit``, how many standard deviations of a sample of 200 pixels it is,
        ``deviations``, of the row where that is largest, and whether it is ``met``.
    """
    found, other = friedl1995_table.agreement(table), friedl1995_table.agreement(beside)
    rows = []
    for variable in VARIABLES:
        of = table[table["variable"] == variable]
        for key, wanted in _WANTED.items():
            limit = wanted[variable] if isinstance(wanted, dict) else wanted
            value = found[f"{variable}_{key}"]
            rows.append(
                {
                    "name": _WORDS[key].format(variable.upper()),
                    "value": value,
                    "beside": other[f"{variable}_{key}"],
                    "limit": limit,
                    "deviations": limit / _scatter(of, key),
                    "met": value <= limit,
                }
            )
    return rows


def _scatter(rows, key):
    """Standard deviation of a sample of 200 pixels that a limit is to be held against."""
    if key == "slope_largest":
        return float((rows["slope_deviation_200"] / rows["slope"].abs()).max())
    if key == "intercept_largest":
        return float(rows["intercept_deviation_200"].max())
    deviations = rows["r2_deviation_200"]
    if key == "r2_largest_long":
        deviations = deviations[rows["arp"] == rows["arp"].max()]
    return float((deviations**2).mean() ** 0.5 if key == "r2_rms" else deviations.max())


def _densities(case, scenes):
    if dict(case.densities) != {name: name for name in treatments()}:
        return [Origin("densities of LAI", scenes, YOURS, "with all their modes")]
    table = datasets.table("lai_distributions.csv").set_index("treatment").loc[list(treatments())]
    means, spreads = (", ".join(f"{each:g}" for each in table[name]) for name in ("mean", "standard_deviation"))
    return [
        Origin(
            "mean LAI", scenes, FITTED,
            f"{means} ({', '.join(table.index)}): from means and ratios of slopes of LAI and FPAR, Eq. 6 between",
        ),
        Origin("standard deviation of LAI", scenes, FITTED, f"{spreads}: from the same ratios; weakly constrained"),
        Origin(
            "bounds of LAI", 1, FITTED_TO_TEXT,
            "at 2.75 standard deviations, the expected extreme of 200 normal values, and at zero. How many values FIFE "
            "measured is not known: chosen because the range that pixels keep is nearer to the paper's than without",
        ),
        Origin("shape of the densities", 1, CHOSEN, "normal between the bounds; the paper's have secondary modes"),
    ]  # fmt: skip


def _optics(case, count):
    if case.optics is not None:
        return Origin("leaf reflectance and transmittance", count, YOURS, "by band")
    return Origin(
        "leaf reflectance and transmittance", count, FITTED,
        "to slopes and intercepts; not checked against measured leaves of bluestem",
    )  # fmt: skip


def _background(case, count):
    if case.background is not None:
        return Origin("background", len(case.background), YOURS, "by band, or shares of spectra")
    return Origin("background", count, FITTED, "to slopes and intercepts")


def _size(case):
    own = case.cells == CELLS
    text = "to R², by way of the drift: the paper states no size" if own else "the paper states no size"
    return Origin("size of the scenes", 1, FITTED if own else YOURS, text)


def _land(case):
    text = {
        "flat": "level; the paper says that the site's elevation was used (section Data)",
        "flint-hills": "synthetic hills; the paper used the site's elevation (section Data)",
    }
    own = case.dem in text
    return Origin("elevation", 1, CHOSEN if own else YOURS, text.get(case.dem, "a file"))
