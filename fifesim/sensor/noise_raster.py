"""The noise of an instrument on labelled rasters."""

from fifesim import chunks
from fifesim.sensor.noise import add_noise, check_kinds, check_seed


def noisy(radiance, instrument, bands, kinds, seed, first=(0, 0)):
    """
    Radiance with the noise of an instrument.

    Parameters
    ----------
    radiance : xarray.DataArray, dims (band, y, x)
        By pixels. [W m-2 sr-1 um-1]
    instrument : fifesim.sensor.instruments.Instrument
    bands : sequence of fifesim.sensor.instruments.InstrumentBand
        One for each of the array.
    kinds : str or sequence of str
        Among "shot", "thermal" and "fixed-pattern".
    seed : int
    first : (int, int), optional
        Line and sample of the first pixel, which draw the noise.

    Returns
    -------
    radiance : xarray.DataArray, dims (band, y, x)
        The same array without kinds. [W m-2 sr-1 um-1]

    Raises
    ------
    ValueError
        If a kind is unknown, or a band's description has no noise.

    See Also
    --------
    fifesim.sensor.noise.add_noise
    """
    kinds = check_kinds(kinds)
    if not kinds:
        return radiance
    check_seed(seed)
    models = [instrument.noise_model(band) for band in bands]
    numbers = [instrument.bands.index(band) for band in bands]
    first_row, first_column = first

    def kernel(block, starts):
        band, row, column = starts
        out = block.astype(float)
        for layer in range(block.shape[0]):
            out[layer] = add_noise(
                block[layer],
                models[band + layer],
                kinds,
                seed=seed,
                band=numbers[band + layer],
                row=first_row + row,
                column=first_column + column,
            )
        return out

    return chunks.located(kernel, radiance)
