"""Soil below a canopy: its brightness along the soil line."""

import numpy as np
from numba import njit

from fifesim.base import datasets
from fifesim.ground.canopy.ranges import outside, within
from fifesim.ground.canopy.spectra import band_means

# Where the reflectance of a soil is its brightness: in the midst of visible light, as for aerosol and visibility. [um]
GREEN = 0.55

# Cells that are done together, so that they stay in the nearest cache.
_RUN = 1024


def soil_line(bands):
    r"""
    Change of the reflectance of bands along the soil line, for a change of brightness.

    .. math:: s_b = \frac{d_b}{d(0.55 \, \mathrm{\mu m})}, \quad d = r_\mathrm{dry} - r_\mathrm{wet}

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band

    Returns
    -------
    slope : array, shape (band,)
        [1]

    Raises
    ------
    ValueError
        If a band lies beyond the spectra, 0.4 to 2.45 um.

    Notes
    -----
    The line leads through the two soils of ``data/ground_spectra.csv``: TM4 changes by 1.20 where TM3 changes by 1.

    References
    ----------
    [Baret1993]_ for soil lines of many bands

    Examples
    --------
    >>> from fifesim.base.bands import Band
    >>> soil_line([Band("green", (0.549, 0.55, 0.551), (0, 1, 0))]).round(3).tolist()
    [1.0]
    """
    table = datasets.table("ground_spectra.csv")
    wavelength, change = (each.to_numpy() for each in (table["wavelength"], table["soil_dry"] - table["soil_wet"]))
    check_range(bands, wavelength)
    return band_means(bands, wavelength, change) / np.interp(GREEN, wavelength, change)


def brightened(reflectance, brightness, line):
    """
    Reflectance of a soil that is brighter, or darker, along the soil line.

    Parameters
    ----------
    reflectance : array, shape (..., band)
        NaN gives NaN. [1]
    brightness : array, shape (...)
        Change of the reflectance at 0.55 um; NaN gives NaN. [1]
    line : array, shape (band,)
        From `soil_line`.

    Returns
    -------
    reflectance : array, shape (..., band)
        Cut off at 0 and 1, where a soil cannot be darker or brighter. [1]

    Raises
    ------
    ValueError
        If a change is beyond -1 to 1.

    Examples
    --------
    >>> brightened(np.array([0.15, 0.19]), -0.1, np.array([1.0, 2.0])).round(3).tolist()
    [0.05, 0.0]
    """
    return in_cells(_brighten, reflectance, brightness, np.asarray(line, float), check=check_brightness)


def in_cells(kernel, reflectance, change, *parameters, check):
    """
    Reflectance of bands that a kernel makes of that before and of a number for each cell.

    Parameters
    ----------
    kernel : callable
        ``kernel(reflectance, change, *parameters, out)`` fills out, shape (band, n), from (band, n), or (band, 1) where
        it is the same in all cells, and (n,). It gives how many of the numbers are out of their range.
    reflectance : array, shape (band,) or (..., band)
    change : array, shape (...)
    *parameters
        Passed to the kernel.
    check : callable
        Of the numbers, raises where one is out of its range.

    Returns
    -------
    reflectance : array, shape (..., band)
        In memory one band after the other, as it is used next.
    """
    reflectance, change = np.atleast_1d(np.asarray(reflectance, float)), np.asarray(change, float)
    shape = np.broadcast_shapes(reflectance.shape[:-1], change.shape)
    cells = change if change.shape == shape else np.broadcast_to(change, shape)
    bands = reflectance.shape[-1]
    if reflectance.ndim > 1:
        below = np.broadcast_to(np.moveaxis(reflectance, -1, 0), (bands, *shape)).reshape(bands, -1)
    else:
        below = reflectance[:, None]
    out = np.empty((bands, cells.size))
    if kernel(np.ascontiguousarray(below), np.ascontiguousarray(cells).reshape(-1), *parameters, out):
        check(change)
    return np.moveaxis(out.reshape(bands, *shape), 0, -1)


@njit(nogil=True, cache=True)
def _brighten(reflectance, brightness, line, out):
    by_cell, wrong = reflectance.shape[1] > 1, 0
    for first in range(0, brightness.size, _RUN):
        run = slice(first, first + _RUN)
        change = brightness[run]
        wrong += outside(change, -1.0, 1.0)
        for band in range(out.shape[0]):
            before, after = reflectance[band, run] if by_cell else reflectance[band], out[band, run]
            for i in range(change.size):
                value = before[i if by_cell else 0] + change[i] * line[band]
                # NaN is neither.
                after[i] = 0.0 if value < 0.0 else 1.0 if value > 1.0 else value
    return wrong


def check_brightness(brightness):
    """
    Refuse a change of reflectance that none can have; NaN passes.

    Parameters
    ----------
    brightness : array
        [1]

    Raises
    ------
    ValueError
        If one is outside -1 to 1.

    Examples
    --------
    >>> check_brightness(-0.04)
    """
    check_span(brightness, -1.0, "soil is a change of reflectance along the soil line", "soil=0.04, not percent")


def check_span(values, lowest, meaning, such_as):
    """
    Refuse values below the lowest or above 1; NaN passes.

    Parameters
    ----------
    values : array
    lowest : float
    meaning, such_as : str
        What they are, by their name first, and what to type.

    Raises
    ------
    ValueError
        If one is.
    """
    values = np.asarray(values, float)
    if not within(values, lowest, 1.0):
        name = meaning.partition(" ")[0]
        wrong = np.nanmin(values) if np.nanmin(values) < lowest else np.nanmax(values)
        raise ValueError(f"{name} must be in [{lowest:g}, 1], got {wrong:g}: {meaning}; give for instance {such_as}")


def check_range(bands, wavelength):
    """
    Refuse bands beyond the spectra that soils are known by.

    Parameters
    ----------
    bands : sequence of fifesim.base.bands.Band
    wavelength : array, shape (n,)
        [um]

    Raises
    ------
    ValueError
        If one lies beyond.
    """
    for band in bands:
        if band.limits[0] < wavelength[0] or band.limits[1] > wavelength[-1]:
            raise ValueError(
                f"no soil line for band {band.name}, {band.limits[0]:g} to {band.limits[1]:g} um: its spectra have "
                f"{wavelength[0]:g} to {wavelength[-1]:g} um; give bands= without it, or soil as background= by cell"
            )
