"""The noise of an instrument on labelled rasters."""

from collections.abc import Mapping

import numpy as np

from fifesim.base.seeds import check_seed
from fifesim.rasters import places
from fifesim.rasters.dates import epoch
from fifesim.sensor.description.instruments import noise_of
from fifesim.sensor.response.noise import ALL, NoiseModel, add_noise, check_kinds


def noisy(radiance, instrument, bands, kinds, seed, first=(0, 0), given=None):
    """
    Radiance with the noise of an instrument.

    Parameters
    ----------
    radiance : xarray.DataArray, dims (band, y, x)
        By pixels; another scalar coordinate ``time`` is another draw. [W m-2 sr-1 um-1]
    instrument : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
        One for each of the array.
    kinds : str or sequence of str
        Among "shot", "thermal" and "fixed-pattern", or "all" for the kinds that each band has.
    seed : int
    first : (int, int), optional
        Line and sample of the first pixel, which draw the noise.
    given : fifesim.sensor.response.noise.NoiseModel, or mapping of str to NoiseModel, optional
        For every band, or by name, instead of what the description says.

    Returns
    -------
    radiance : xarray.DataArray, dims (band, y, x)
        The same array without kinds. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If a kind or the name of a band is unknown, or a band has no noise of that kind.
    TypeError
        If the seed is no whole number.

    See Also
    --------
    fifesim.sensor.response.noise.add_noise
    """
    if not check_kinds(kinds):
        return radiance
    check_seed(seed)
    models = noise_models(instrument, bands, kinds, given)
    numbers = [instrument.bands.index(band) for band in bands]
    (first_row, first_column), when = first, epoch(radiance)

    def kernel(block, starts):
        band, row, column = starts
        place = {"seed": seed, "row": first_row + row, "column": first_column + column, "epoch": when}
        noise = [add_noise(one, *models[k], band=numbers[k], **place) for k, one in enumerate(block, band)]
        return np.stack(noise)

    return places.located(kernel, radiance)


def noise_models(instrument, bands, kinds, given=None):
    """
    Noise model of each band, and the kinds of noise to draw from it.

    Parameters
    ----------
    instrument : fifesim.sensor.description.instruments.Instrument
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
    kinds : str or sequence of str
        Among "shot", "thermal" and "fixed-pattern", or "all" for the kinds that each band has.
    given : fifesim.sensor.response.noise.NoiseModel, or mapping of str to NoiseModel, optional
        Model for every band, or by band name, that replaces the one in the description.

    Returns
    -------
    models : list of (fifesim.sensor.response.noise.NoiseModel, tuple of str)

    Raises
    ------
    ValueError
        If a kind or the name of a band is unknown, or a band lacks a requested kind.
    """
    kinds = check_kinds(kinds)
    if isinstance(given, Mapping):
        given = {instrument.select(name)[0].name: model for name, model in given.items()}
    models = []
    for band in bands:
        model = given if isinstance(given, NoiseModel) else (given or {}).get(band.name) or noise_of(instrument, band)
        if kinds != (ALL,) and (absent := [kind for kind in kinds if kind not in model.kinds]):
            known = " and ".join(model.kinds) or "none"
            raise ValueError(
                f"noise = {list(kinds)}: {instrument.name} has no {' and no '.join(absent)} noise for {band.name}, "
                f"only {known}; type noise='all' for the kinds that each band has, or give "
                f"noise_models={{{band.name!r}: fifesim.NoiseModel(...)}}, in a scenario [sensor.noise_model]"
            )
        models.append((model, model.kinds if kinds == (ALL,) else kinds))
    return models
