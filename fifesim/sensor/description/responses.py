"""What is known of an instrument's spatial response, and other responses that may be asked for."""

from dataclasses import replace

from fifesim.sensor.description.fields import by_axes
from fifesim.sensor.description.spatial_response import BoxcarResponse

RESPONSES = ("system", "detector", "paper")

_DETECTOR = BoxcarResponse(kind="boxcar")


def knows_blur(instrument, band):
    """
    Whether the file of an instrument knows more of a band's spatial response than its detector.

    Parameters
    ----------
    instrument : fifesim.sensor.description.instrument_file.Instrument
    band : fifesim.sensor.description.band.InstrumentBand

    Returns
    -------
    known : bool
        Where it does not, images are sharper than the instrument's.
    """
    return _kinds(instrument, band) != {"boxcar"}


def with_response(instrument, response):
    """
    An instrument with another spatial response.

    Parameters
    ----------
    instrument : fifesim.sensor.description.instrument_file.Instrument
    response : {"system", "detector", "paper"}
        What the file knows of the whole system, the detector alone, or the cosine of the paper's Table 1.

    Returns
    -------
    instrument : fifesim.sensor.description.instrument_file.Instrument
        Detectors are as wide as the instantaneous field of view, or as the interval where the file has none.

    Raises
    ------
    ValueError
        If there is no such response, or the file has none of that kind.
    """
    if response not in RESPONSES:
        raise ValueError(f"response must be one of {', '.join(RESPONSES)}, got {response!r}")
    if response == "detector":
        return replace(instrument, lsf=_DETECTOR, bands=tuple(_sharp(instrument, band) for band in instrument.bands))
    if response == "paper":
        known = any(_kinds(instrument, band) == {"cosine"} for band in instrument.bands)
    else:
        known = any(knows_blur(instrument, band) for band in instrument.bands)
    if not known:
        raise ValueError(
            f"the description of {instrument.name} has no {response!r} response: type response='detector', or give an "
            "instrument whose file has it"
        )
    return instrument


def _kinds(instrument, band):
    return {part.kind for part in by_axes(band.lsf or instrument.lsf)}


def _sharp(instrument, band):
    """A band with its field of view, and none of its own response."""
    number = "ifov" if band.ifov or instrument.ifov else "interval"
    width = getattr(band, number) or getattr(instrument, number)
    sources = {key: value for key, value in band.sources.items() if key != "lsf"}
    source = sources[number] if number in sources else instrument.sources[number]
    return replace(band, lsf=None, ifov=width, sources=sources | {"ifov": source})
