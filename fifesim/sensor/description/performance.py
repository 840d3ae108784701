"""Noise, gain states, scan and products of an instrument, as its file gives them."""

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from fifesim.sensor.description.fields import CONFIG, Count, Number, Positive
from fifesim.sensor.response.noise import NoiseModel


@dataclass(frozen=True, config=CONFIG)
class Noise:
    r"""
    Random noise of one band at a stated radiance.

    .. math:: \mathrm{NEdL} = L / \mathrm{SNR}

    Parameters
    ----------
    radiance : float
        Radiance L that the figure holds for. [W m-2 sr-1 um-1]
    snr : float, optional
        Ratio of signal to noise there. [1]
    nedl : float, optional
        Noise equivalent radiance there, standard deviation; instead of the ratio. [W m-2 sr-1 um-1]
    shot : float, optional
        Share of the variance there that grows in proportion to the signal; the rest is constant. Where it is not
        given it is not known, and all of the noise is taken as constant. [1]
    gain_spread : float, optional
        Standard deviation of the detectors' relative gain: fixed pattern, which stripes the image. [1]
    offset_spread : float, optional
        Standard deviation of the detectors' offset. [W m-2 sr-1 um-1]

    Raises
    ------
    pydantic.ValidationError
        Unless one of the ratio and the noise is given.
    """

    radiance: Positive
    snr: Positive | None = None
    nedl: Positive | None = None
    shot: Annotated[float, Field(strict=True, ge=0, le=1)] | None = None
    gain_spread: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.0
    offset_spread: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] = 0.0

    def __post_init__(self):
        if (self.snr is None) == (self.nedl is None):
            raise ValueError("give either snr or nedl [W m-2 sr-1 um-1], at the radiance")

    @property
    def equivalent_radiance(self):
        """Noise equivalent radiance at `radiance`, standard deviation [W m-2 sr-1 um-1]."""
        return self.radiance / self.snr if self.nedl is None else self.nedl

    def model(self, detectors, along):
        """
        The noise at every radiance.

        Parameters
        ----------
        detectors : int
            Number of detectors of the band.
        along : "rows" or "columns"
            Which pixels a detector sees.

        Returns
        -------
        model : fifesim.sensor.response.noise.NoiseModel
        """
        snr, shot = self.radiance / self.equivalent_radiance, self.shot or 0.0
        spread = {"gain_spread": self.gain_spread, "offset_spread": self.offset_spread}
        return NoiseModel.from_snr(self.radiance, snr, shot, detectors=detectors, along=along, **spread)


@dataclass(frozen=True, config=CONFIG)
class Gain:
    """
    Radiances that a gain state spreads over the digital numbers.

    Parameters
    ----------
    full_scale_radiance, min_radiance : float
        Radiances of the largest digital number and of digital number 0. [W m-2 sr-1 um-1]
    """

    full_scale_radiance: Number
    min_radiance: Number

    def __post_init__(self):
        if self.full_scale_radiance <= self.min_radiance:
            raise ValueError(
                f"full_scale_radiance must be above min_radiance, got {self.full_scale_radiance:g} "
                f"and {self.min_radiance:g} W m-2 sr-1 um-1"
            )


@dataclass(frozen=True, config=CONFIG)
class Product:
    """
    How the agency scales the digital numbers of its Level-1 product: by reflectance.

    Parameters
    ----------
    gain, offset : float
        Reflectance of one count and of digital number 0. [1]
    bits : int
        Of the product's numbers.
    sun_corrected : bool
        Whether that reflectance has the cosine of the solar zenith angle divided out.
    """

    gain: Positive
    offset: Number
    bits: Annotated[int, Field(strict=True, ge=2, le=16)]
    sun_corrected: Annotated[bool, Field(strict=True)]


@dataclass(frozen=True, config=CONFIG)
class Scan:
    """
    How an instrument covers the width of its swath.

    Parameters
    ----------
    kind : "whiskbroom" or "pushbroom"
        A mirror that sweeps a few detectors across the track, or a row of detectors as long as the line.
    max_angle : float
        Largest angle from nadir, at the instrument. [degree]
    samples : int, optional
        Samples of a line.
    lines : int, optional
        Lines of a sweep, which are seen at once.
    period : float, optional
        Time from one sweep, or one line, to the next. [s]
    swath : float, optional
        Width on the ground that is published. [m]
    """

    kind: Literal["whiskbroom", "pushbroom"]
    max_angle: Annotated[float, Field(strict=True, gt=0, lt=75)]
    samples: Count | None = None
    lines: Count | None = None
    period: Positive | None = None
    swath: Positive | None = None
