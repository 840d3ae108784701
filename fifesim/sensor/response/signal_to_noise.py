"""How noisy an instrument is at a radiance, by its description."""

from __future__ import annotations

import numpy as np

from fifesim.base.annotations import Numbers
from fifesim.sensor.description.annotations import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.instruments import noise_of


def noise_equivalent_radiance(instrument: InstrumentLike, band: str, radiance: Numbers) -> np.ndarray:
    """
    Standard deviation of an instrument's shot and thermal noise at a radiance.

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument
    band : str
        Name of a band.
    radiance : array
        [W m-2 sr-1 um-1]

    Returns
    -------
    nedl : array, shape of radiance
        Without fixed pattern and quantisation. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If there is no such instrument or band, its description has no noise, or a radiance is negative.

    Examples
    --------
    >>> import fifesim
    >>> round(fifesim.noise_equivalent_radiance("OLI", "OLI4", 22.0).item(), 3)
    0.096
    """
    return _noise_of(instrument, band).noise_equivalent_radiance(_checked(radiance))


def snr(instrument: InstrumentLike, band: str, radiance: Numbers) -> np.ndarray:
    """
    Signal-to-noise ratio of an instrument at a radiance, with shot and thermal noise.

    Parameters
    ----------
    instrument : str or fifesim.sensor.description.instruments.Instrument
    band : str
        Name of a band.
    radiance : array
        [W m-2 sr-1 um-1]

    Returns
    -------
    snr : array, shape of radiance
        Without fixed pattern and quantisation. [1]

    Raises
    ------
    ValueError
        If there is no such instrument or band, its description has no noise, or a radiance is negative.

    Examples
    --------
    >>> import fifesim
    >>> fifesim.snr("OLI", "OLI4", [22.0, 60.0]).round()
    array([230., 627.])
    """
    return _noise_of(instrument, band).snr(_checked(radiance))


def _checked(radiance):
    """Radiance as an array, or ValueError if a value is negative."""
    radiance = np.asarray(radiance, float)
    if np.any(radiance < 0):
        raise ValueError(f"radiance must not be negative, got {radiance[radiance < 0].flat[0]:g} W m-2 sr-1 um-1")
    return radiance


def _noise_of(instrument, band):
    description = find_instrument(instrument)
    (found,) = description.select([band])
    return noise_of(description, found)
