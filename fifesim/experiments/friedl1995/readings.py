"""How Table 1 of Friedl et al. (1995) may be read: where pixels lie, and how wide they see."""

import re
from dataclasses import dataclass, replace

from fifesim.base import datasets
from fifesim.sensor.description.spatial_response import CosineResponse, GaussianResponse

# Nine cells across a pixel of 30 m.
CELL = 30 / 9

# The instrument of Table 1, from whose file those of other responses are made.
TABLE_1 = "TM"
_FILE = "instruments/tm.toml"

_OWN_INTERVAL = "43 µrad × 705 km = 30.315 m"

_BLUR = (
    "a Gaussian of {eifov:g} m effective field of view, measured in flight over the San Mateo Bridge "
    "(Schowengerdt et al. 1985, Landsat-4 TM)"
)


@dataclass(frozen=True)
class Reading:
    """
    How the pixels of Table 1 lie on the blocks of ground that they are compared with, and how they see.

    Parameters
    ----------
    name : str
    text : str
        What it takes Table 1 to say.
    own_interval : bool
        Pixels at the instrument's own sampling interval, paired with the blocks by row and column.
    count : int, optional
        Number of angles of the line spread function, instead of Table 1's.
    eifov : float, optional
        Effective field of view of a Gaussian in the place of Table 1's line spread function. [m]
    offset : float
        Constant displacement of the image, southward and eastward. [cell]
    """

    name: str
    text: str
    own_interval: bool = False
    count: int | None = None
    eifov: float | None = None
    offset: float = 0.0

    @property
    def other_response(self):
        """Whether the pixels see otherwise than the instrument's file says."""
        return self.count is not None or self.eifov is not None

    def in_words(self, interval, pixel):
        """
        What it takes an instrument to do.

        Parameters
        ----------
        interval, pixel : float
            Of the instrument. [m]

        Returns
        -------
        text : str
            That of Table 1 where the two are its own.

        Examples
        --------
        >>> ALIGNED.in_words(30.0, 10.0)
        'pixels of 10 m on the blocks of the truth'
        """
        said = self.text
        if f"{interval:.3f}" not in _OWN_INTERVAL:
            said = said.replace(_OWN_INTERVAL, f"{interval:.3f} m")
        return said.replace("30 m", f"{pixel:g} m")

    def instrument(self, description):
        """
        An instrument as the reading has it.

        Parameters
        ----------
        description : fifesim.sensor.description.instrument_file.Instrument

        Returns
        -------
        instrument : fifesim.sensor.description.instrument_file.Instrument
        """
        if self.count is not None:
            lsf = description.lsf
            return replace(description, lsf=CosineResponse(kind="cosine", step=lsf.step, count=self.count))
        if self.eifov is not None:
            angle = self.eifov / description.altitude
            return replace(description, lsf=GaussianResponse(kind="gaussian", eifov=angle))
        return description

    def instrument_file(self, altitude):
        """
        Text of an instrument file that has the reading's response and all else from Table 1's.

        Parameters
        ----------
        altitude : float
            Of the instrument. [m]

        Returns
        -------
        text : str
            TOML.

        Raises
        ------
        RuntimeError
            If the installation's file has no response that can be changed.
        """
        text = datasets.path(_FILE).read_text(encoding="utf-8")
        if self.count is not None:
            changed, times = re.subn(r"(?m)^count = 9\b.*$", f"count = {self.count}  # {self.text}", text)
        else:
            lsf = f'[lsf]\nkind = "gaussian"\neifov = {self.eifov / altitude!r}  # rad: {self.text}\n'
            changed, times = re.subn(r"(?s)\[lsf\].*?\n(?=\n\[)", lsf, text)
        if times != 1:
            raise RuntimeError(f"{_FILE} has no response that can be changed: reinstall fifesim")
        return changed.replace('lsf = "Friedl1995"', f'lsf = "{self.name}"', 1).replace(
            "[references]\n", f'[references]\n"{self.name}" = "{self.text}"\n', 1
        )


# The paper's text on cells and pixels, by section. It speaks for the aligned reading.
PASSAGES = {
    "Ground Scene Model": "9² ground cells per simulated sensor pixel",
    "Analyses": "81 (9²) ground scene elements per 30-m TM pixel",
}

NATIVE = Reading(
    "native",
    f"pixels every {_OWN_INTERVAL}, paired by row and column with the 30 m blocks of the truth",
    own_interval=True,
)
ALIGNED = Reading("aligned", "pixels of 30 m on the blocks of the truth")
READINGS = {
    reading.name: reading
    for reading in (
        NATIVE,
        ALIGNED,
        Reading("narrow", "aligned, with a line spread of 7 steps (23.6 m) instead of 9 (30.3 m)", count=7),
        Reading("offset", "aligned, then displaced by 2 cells (6.7 m) along both axes", offset=2.0),
        Reading("blur-40.8", "aligned, with " + _BLUR.format(eifov=40.8), eifov=40.8),
        Reading("blur-48.6", "aligned, with " + _BLUR.format(eifov=48.6), eifov=48.6),
    )
}


def reading_of(name, sensor):
    """
    A reading by its name.

    Parameters
    ----------
    name : str
        A key of `READINGS`.
    sensor : str
        Name of the instrument that is to be read so.

    Returns
    -------
    reading : Reading

    Raises
    ------
    ValueError
        If there is none, or it changes the response of Table 1 and the instrument is another.
    """
    if name not in READINGS:
        raise ValueError(f"reading must be one of {', '.join(READINGS)}, got {name!r}")
    found = READINGS[name]
    if found.other_response and sensor != TABLE_1:
        rest = ", ".join(each.name for each in READINGS.values() if not each.other_response)
        raise ValueError(f"the reading {name!r} is one of Table 1, of TM: for {sensor} type {rest}")
    return found


def beside(reading):
    """
    Readings that are shown together: the one asked for, and the aligned one, or the native one beside that.

    Parameters
    ----------
    reading : Reading

    Returns
    -------
    readings : list of Reading
    """
    return [reading, NATIVE if reading == ALIGNED else ALIGNED]
