"""Which band of an instrument a name stands for, as agencies, catalogues and files of images call them."""

import re

from fifesim.base.bands import COMMON_NAMES, nearest
from fifesim.sensor.description.names import key

# What agencies write before the number of a band.
_PREFIXES = {"", "b", "band", "srb", "surreflb"}


def band_called(name, instrument):
    """
    Band of an instrument that a name stands for.

    Parameters
    ----------
    name : str or int
        The instrument's own name, its number (``3``, ``"B3"``, ``"B03"``, ``"B8A"``, ``"SR_B3"``), or a common name
        such as ``"red"``, ``"nir"`` or ``"swir16"``.
    instrument : fifesim.sensor.description.instrument_file.Instrument

    Returns
    -------
    band : fifesim.sensor.description.band.InstrumentBand or None
        None where it stands for none.
    """
    wanted = key(str(name))
    # A common name may end in what looks like a number of a band: nir08.
    if wanted in COMMON_NAMES:
        found = nearest([band.wavelength for band in instrument.bands], COMMON_NAMES[wanted])
        return None if found is None else instrument.bands[found]
    prefix, number = _parts(wanted)
    own = [(band, *_parts(band.name)) for band in instrument.bands]
    for band, letters, its in own:
        if wanted == key(band.name) or (number and (letters, its) == (prefix, number)):
            return band
    # VIIRS counts two kinds of bands, I1 and M1: a number alone means neither.
    numbered = [band for band, _, its in own if number and its == number]
    return numbered[0] if len(numbered) == 1 and prefix in _PREFIXES else None


def _parts(name):
    """What stands before the number that a name ends in, and that number with its letter, without leading zeros."""
    found = re.fullmatch(r"(|.*[a-z])0*([1-9]\d*a?)", key(name))
    return found.groups() if found else (key(name), "")
