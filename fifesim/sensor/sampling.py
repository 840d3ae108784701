"""What an instrument's description says of one band: its pixels, its line spread functions, its noise."""

from fifesim.sensor.instruments import instrument as find_instrument


def product_pixel(instrument, band):
    """
    Pixel of the gridded product.

    Parameters
    ----------
    instrument : fifesim.sensor.instruments.Instrument
    band : fifesim.sensor.instruments.InstrumentBand

    Returns
    -------
    along, across : float
        Along and across the track. [m]
    """
    return instrument.gsd, instrument.gsd


def native_interval(instrument, band):
    """
    Distance between the instrument's own samples at nadir.

    Parameters
    ----------
    instrument : fifesim.sensor.instruments.Instrument
    band : fifesim.sensor.instruments.InstrumentBand

    Returns
    -------
    along, across : float
        Along and across the track. [m]
    """
    return instrument.ground_interval, instrument.ground_interval


def line_spreads(instrument, band):
    """
    Line spread functions on the ground at nadir.

    Parameters
    ----------
    instrument : fifesim.sensor.instruments.Instrument
    band : fifesim.sensor.instruments.InstrumentBand

    Returns
    -------
    along, across : line spread function
        As `fifesim.footprints` takes them: along the track, for rows, and across it, for columns.
    """
    return instrument.line_spread, instrument.line_spread


def noise_model(instrument, band):
    """
    Noise of a band.

    Parameters
    ----------
    instrument : fifesim.sensor.instruments.Instrument
    band : fifesim.sensor.instruments.InstrumentBand

    Returns
    -------
    model : fifesim.sensor.noise.NoiseModel

    Raises
    ------
    ValueError
        If the description has no noise.
    """
    model = getattr(band, "noise", None)
    if model is None:
        raise ValueError(
            f"the description of {instrument.name} has no noise for {band.name}: leave noise out, or give an "
            "instrument whose file has it"
        )
    return model


def noise_equivalent_radiance(instrument, band, radiance):
    """
    Standard deviation of an instrument's shot and thermal noise at a radiance.

    Parameters
    ----------
    instrument : str or fifesim.sensor.instruments.Instrument
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
        If there is no such instrument or band, or its description has no noise.
    """
    return _noise_of(instrument, band).noise_equivalent_radiance(radiance)


def snr(instrument, band, radiance):
    """
    Signal-to-noise ratio of an instrument at a radiance, with shot and thermal noise.

    Parameters
    ----------
    instrument : str or fifesim.sensor.instruments.Instrument
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
        If there is no such instrument or band, or its description has no noise.
    """
    return _noise_of(instrument, band).snr(radiance)


def _noise_of(instrument, band):
    description = find_instrument(instrument)
    return noise_model(description, *description.select(band))
