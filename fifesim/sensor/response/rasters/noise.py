"""The noise of an instrument on labelled rasters."""

from collections.abc import Mapping

import numpy as np

from fifesim.base.seeds import check_seed
from fifesim.rasters import places
from fifesim.rasters.dates import epoch
from fifesim.sensor.description.instruments import noise_of
from fifesim.sensor.response.noise import NoiseModel, add_noise, check_kinds


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
        Among "shot", "thermal" and "fixed-pattern".
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
    kinds = check_kinds(kinds)
    if not kinds:
        return radiance
    check_seed(seed)
    if isinstance(given, Mapping):
        given = {instrument.select(name)[0].name: model for name, model in given.items()}
    models = [_model(instrument, band, kinds, given) for band in bands]
    numbers = [instrument.bands.index(band) for band in bands]
    (first_row, first_column), when = first, epoch(radiance)

    def kernel(block, starts):
        band, row, column = starts
        place = {"seed": seed, "row": first_row + row, "column": first_column + column, "epoch": when}
        noise = [add_noise(one, models[k], kinds, band=numbers[k], **place) for k, one in enumerate(block, band)]
        return np.stack(noise)

    return places.located(kernel, radiance)


def _model(instrument, band, kinds, given):
    """Noise of a band, which has something of what is asked for."""
    if isinstance(given, NoiseModel):
        model = given
    else:
        model = (given or {}).get(band.name) or noise_of(instrument, band)
    random = {"shot": model.shot, "thermal": model.thermal}
    asked = [kind for kind in random if kind in kinds]
    absent = [] if not asked or any(random[kind] for kind in asked) else asked
    if "fixed-pattern" in kinds and not (model.gain_spread or model.offset_spread):
        absent = [*absent, "fixed-pattern"]
    if absent:
        raise ValueError(
            f"{instrument.name} has no {' and no '.join(absent)} noise for {band.name}: leave it out, or give "
            f"noise_models={{{band.name!r}: fifesim.NoiseModel(...)}}"
        )
    return model
