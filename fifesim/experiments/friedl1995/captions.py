"""Captions of the figures, with what they state computed from what they show."""

import numpy as np

from fifesim.analysis import density
from fifesim.experiments.friedl1995.figures import sample
from fifesim.experiments.friedl1995.readings import ALIGNED, NATIVE
from fifesim.experiments.friedl1995.table import INCREMENTS

# A rise of a density is a peak where it reaches this share of the highest.
_PEAK = 0.05


def figure_captions(found, reading, own_densities):
    """
    Captions of Figures 3 to 9.

    Parameters
    ----------
    found : xarray.Dataset
        From `fifesim.reproduce`.
    reading : str
        Whose pixels are shown.
    own_densities : bool
        Whether the densities of LAI are fifesim's, which were inferred.

    Returns
    -------
    captions : dict of int to str
    """
    size, seen = found.attrs["cell"], f"burned, grazed; pixels read as {reading}"
    source = (
        "inferred from Table 2: measurements behind the paper's Fig. 3 were not found, nor its secondary modes"
        if own_densities
        else "as given"
    )
    return {
        3: f"Densities of LAI of the three treatments, {source}.",
        4: f"LAI of the ground, burned and grazed: a part of 120 x 120 cells of {size:.2f} m.",
        5: f"LAI and FPAR of 200 pixels against NDVI, {seen}. Ground: means of the cells' NDVI over the blocks of the "
        "truth. Sensor: the simulated image, whose digital numbers show as columns.",
        6: f"Densities of 200 pixels, and of all cells, {seen}; reflected at zero but for NDVI, which is that at the "
        f"top of the atmosphere. {_peaks(found, reading)}",
        7: f"Relative equivalent noise (Eq. 7) of 200 pixels by increments of {INCREMENTS['lai']:g} of LAI and "
        f"{INCREMENTS['fpar']:g} of FPAR with at least three pixels, {seen}.",
        8: "NDVI of the mean reflectance against the mean NDVI of the cells (above), and their difference beside what "
        "the curvature of NDVI predicts from the variances within the pixel (below). No sensor is in it.",
        9: f"Reflectance of the image against the mean reflectance of the ground in the same block, {seen}. The line "
        f"is what the atmosphere alone does. {_scatter(found, reading)}",
    }


def peaks(values):
    """
    How many peaks the density of a sample has.

    Parameters
    ----------
    values : array, shape (n,)

    Returns
    -------
    count : int
    """
    found = density.sample_density(values, np.linspace(values.min(), values.max(), 500))
    rises = (found[1:-1] > found[:-2]) & (found[1:-1] >= found[2:]) & (found[1:-1] > _PEAK * found.max())
    return int(rises.sum())


def scatter(found, reading, band):
    """
    Scatter of the reflectance of all pixels about a line through that of the ground.

    Parameters
    ----------
    found : xarray.Dataset
    reading : str
    band : str
        ``red`` or ``nir``.

    Returns
    -------
    scatter : array, shape (arp,)
        1 - R2. [1]
    """
    scenes = found.sel(reading=reading)
    pairs = zip(scenes[f"pixel_boa_{band}"].values, scenes[f"pixel_toa_{band}"].values, strict=True)
    return np.array([1 - np.corrcoef(boa[np.isfinite(toa)], toa[np.isfinite(toa)])[0, 1] ** 2 for boa, toa in pairs])


def drift_share(found):
    """
    Share of the scatter of reflectance that goes when native pixels are put onto their blocks.

    Parameters
    ----------
    found : xarray.Dataset
        With the native and the aligned reading.

    Returns
    -------
    share : array, shape (band, arp)
        Of red and near infrared. [1]
    """
    return np.array(
        [1 - scatter(found, ALIGNED.name, band) / scatter(found, NATIVE.name, band) for band in ("red", "nir")]
    )


def _peaks(found, reading):
    """What the digits do to the density of NDVI at the smallest arp."""
    arp = float(found["arp"].values[0])
    values = sample(found, reading, arp)
    digital, analogue = peaks(values["ndvi"]), peaks(values["analogue_ndvi"])
    said = (
        f"At arp {arp:g} NDVI takes {np.unique(values['ndvi']).size} values in 200 pixels, and its curve has "
        f"{_counted(digital)}; before digitising (grey) {_counted(analogue)}."
    )
    of_lai = peaks(values["lai"])
    return said + (f" The {of_lai} of LAI, which is not digitised, are those of a sample." if of_lai > 1 else "")


def _counted(number):
    return "one peak" if number == 1 else f"{number} peaks"


def _scatter(found, reading):
    """What the scatter of Fig. 9 is made of."""
    if {NATIVE.name, ALIGNED.name} - set(found["reading"].values.tolist()):
        return "What each reading leaves of the scatter is in the table of readings."
    share, drift = drift_share(found), found.attrs["drift"]
    range_ = f"{100 * share.min():.0f} to {100 * share.max():.0f} %"
    if reading == NATIVE.name:
        most = "Most of the scatter" if share.min() > 0.5 else "A part of the scatter"
        return (
            f"{most} about it, {range_} of 1 − R² by band and arp, is the assumed drift of the pixels, up to "
            f"{drift:.1f} m along each axis: it goes when they are put onto their blocks. The rest is response and "
            "digitising."
        )
    return (
        f"The scatter about it is response and digitising; native pixels, which drift, have more, of which {range_} is "
        "the drift's."
    )
