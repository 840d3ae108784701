"""Instruments as text, for people to read."""


def describe(instrument):
    """
    What an instrument is, in lines of text.

    Parameters
    ----------
    instrument : fifesim.sensor.instruments.Instrument

    Returns
    -------
    text : str
        Sampling, spatial response and radiometry of its bands, and the sources.

    Examples
    --------
    >>> from fifesim.sensor.instruments import instrument
    >>> describe(instrument("TM")).splitlines()[0]
    'TM  Landsat-5 Thematic Mapper'
    """
    width = instrument.line_spread.width
    lines = [
        f"{instrument.name}  {instrument.title}",
        f"  altitude {instrument.altitude / 1000:g} km, pixels of {instrument.gsd:g} m in the gridded product, "
        f"own interval {1e6 * instrument.interval:g} urad = {instrument.ground_interval:.3f} m at nadir",
        f"  line spread {instrument.lsf.kind}, support {width:.2f} m; {instrument.bits} bits",
        "  band   wavelength      at half peak   radiance of DN 0 and full scale   solar irradiance",
        "                 um                um                   W m-2 sr-1 um-1           W m-2 um-1",
    ]
    for band in instrument.bands:
        low, high = _half_peak(band.response)
        lines.append(
            f"  {band.name:<6}{band.wavelength:>11.3f}{low:>10.3f} - {high:.3f}"
            f"{band.min_radiance:>18.2f}{band.full_scale_radiance:>16.2f}{band.solar_irradiance:>21.1f}"
        )
    lines += ["  sources", *(f"    {text}" for text in instrument.references.values())]
    return "\n".join(lines)


def _half_peak(response):
    """First and last tabulated wavelengths at which a response is at least half of its maximum [um]."""
    above = [w for w, r in zip(response.wavelength, response.response, strict=True) if r >= max(response.response) / 2]
    return above[0], above[-1]
