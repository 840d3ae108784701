"""The bands of a scenario whose file names none: those of a picture in false colours."""

import os
from collections.abc import Mapping

from fifesim.sensor.description.choices import false_colour_bands
from fifesim.sensor.description.instruments import instrument

_DEFAULT = "TM"
_BY_BAND = ("leaf_reflectance", "leaf_transmittance", "background")


def with_false_colour(values):
    """
    Values of a file with green beside red and near infrared, where it names no bands.

    Parameters
    ----------
    values : mapping
        As TOML gives it, with whole paths.

    Returns
    -------
    values : mapping
        The same where bands are named, where the instrument has no green on their grid or is none, where optics are
        given by band without green, and where a noise is asked for that is not known of green.

    Examples
    --------
    >>> with_false_colour({"sensor": {"instrument": "OLI"}})["sensor"]["bands"]
    ['OLI3', 'OLI4', 'OLI5']
    >>> with_false_colour({"ground": {"background": {"TM3": 0.1, "TM4": 0.2}}})
    {'ground': {'background': {'TM3': 0.1, 'TM4': 0.2}}}
    """
    sensor = values.get("sensor", {})
    if not isinstance(sensor, Mapping) or "bands" in sensor:
        return values
    bands = _found(sensor.get("instrument", _DEFAULT))
    if len(bands) < 3 or any(bands[0].name not in each for each in _given_by_band(values)):
        return values
    if sensor.get("noise") and not sensor.get("noise_model") and bands[0].noise is None:
        return values
    return values | {"sensor": sensor | {"bands": [band.name for band in bands]}}


def _found(name):
    """Bands of an instrument; none where there is none, which is told when the scenario is made."""
    if not isinstance(name, str) or (name.endswith(".toml") and not os.path.isfile(name)):
        return ()
    try:
        return false_colour_bands(instrument(name))
    except (ValueError, OSError):
        return ()


def _given_by_band(values):
    classes = values.get("classes", {})
    stands = [values.get("ground"), *(classes.values() if isinstance(classes, Mapping) else ())]
    tables = (stand.get(key) for stand in stands if isinstance(stand, Mapping) for key in _BY_BAND)
    return [table for table in tables if isinstance(table, Mapping) and table]
