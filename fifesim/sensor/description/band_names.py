"""Which band of an instrument a name stands for, as agencies, catalogues and files of images call them."""

import re

from fifesim.base.bands import COMMON_NAMES, nearest
from fifesim.sensor.description.names import key


def band_called(name, instrument):
    """
    Band of an instrument that a name stands for.

    Parameters
    ----------
    name : str or int
        The instrument's own name, its number (``3``, ``"B3"``, ``"B03"``, ``"B8A"``, ``"SR_B3"``), or a common name of
        STAC such as ``"red"`` or ``"nir"``.
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
    for band in instrument.bands:
        if _plain(wanted) == _plain(key(band.name)):
            return band
    # VIIRS counts two kinds of bands, I1 and M1: a number alone means neither.
    numbered = [band for band in instrument.bands if _number(wanted) == _number(band.name)]
    return numbered[0] if len(numbered) == 1 else None


def _plain(name):
    """Letters and number of a name, without leading zeros."""
    return re.sub(r"(?<=[a-z])0+(?=[1-9])", "", name)


def _number(name):
    """Number that a name ends in, with its letter, without leading zeros; the name itself where there is none."""
    found = re.fullmatch(r"(?:|.*[a-z])0*([1-9]\d*a?)", key(name))
    return found.group(1) if found else key(name)
