"""Which bands of an instrument a picture of vegetation needs."""

from fifesim.base.bands import composite


def false_colour_bands(instrument):
    """
    The bands of the usual picture of vegetation: near infrared, red and green are its red, green and blue.

    Parameters
    ----------
    instrument : fifesim.sensor.description.instruments.Instrument

    Returns
    -------
    bands : tuple of InstrumentBand
        Green, red and near infrared of one grid; red and near infrared where that grid has no green.

    Raises
    ------
    ValueError
        If the instrument lacks red or near infrared.

    Examples
    --------
    >>> from fifesim.sensor.description.instruments import instrument
    >>> [band.name for band in false_colour_bands(instrument("TM"))]
    ['TM2', 'TM3', 'TM4']
    >>> [band.name for band in false_colour_bands(instrument("MODIS"))]
    ['MODIS1', 'MODIS2']
    """
    pair = instrument.red_and_near_infrared()
    sizes = {instrument.pixel(band) for band in pair}
    beside = [band for band in instrument.bands if {instrument.pixel(band)} == sizes]
    # None of them where red and near infrared lie on different grids.
    *_, red, green = composite([band.wavelength for band in beside])
    return pair if green == red else (beside[green], *pair)
