"""One band of an instrument: spectral response and radiometry, and what it sees otherwise than the others."""

from dataclasses import asdict, field, replace
from typing import Literal

from pydantic.dataclasses import dataclass

from fifesim.base.bands import solar_irradiance
from fifesim.sensor.description.fields import CONFIG, Angle, Count, Name, Number, Positive
from fifesim.sensor.description.performance import Gain, Noise
from fifesim.sensor.description.spatial_response import SpatialResponse
from fifesim.sensor.description.spectral_response import SpectralResponse

# Numbers that must be there and those that may; each that is there has a source.
INSTRUMENT_NUMBERS = ("altitude", "gsd", "interval", "bits", "lsf")
BAND_NUMBERS = ("srf", "full_scale_radiance", "min_radiance", "solar_irradiance")
OPTIONAL_NUMBERS = (
    "ifov", "detectors", "scan", "product", "noise", "gains", "limits", "geolocation", "compression"
)  # fmt: skip

# Publications by number.
Sources = dict[Literal[INSTRUMENT_NUMBERS + BAND_NUMBERS + OPTIONAL_NUMBERS], str]  # type: ignore[valid-type]

# What a band tells of itself, as far as it is given.
_TOLD = ("name", "srf", "full_scale_radiance", "min_radiance", "solar_irradiance", "limits", "gsd", "gain")


@dataclass(frozen=True, config=CONFIG)
class InstrumentBand:
    """
    One band of an instrument.

    Parameters
    ----------
    name : str
        Name, such as ``"TM3"``.
    srf : spectral response
        Where the relative spectral response is found; see `fifesim.sensor.description.spectral_response`.
    full_scale_radiance, min_radiance : float
        Radiances of the largest digital number and of digital number 0. [W m-2 sr-1 um-1]
    solar_irradiance : float
        Extraterrestrial irradiance that the agency publishes for planetary reflectance. [W m-2 um-1]
    limits : tuple of float, optional
        Wavelengths between which the band is nominally. [um]
    gsd, interval, ifov, lsf, detectors : optional
        Where they differ from the instrument's.
    noise : Noise, optional
    gain : str, optional
        Name of the gain state that the radiances belong to.
    gains : dict of Gain, optional
        Other gain states by name.
    compression : "square-root", optional
        Scale of the digital numbers, which meets the linear one at both ends; that is linear by default.
    sources : dict
        Key of the instrument's references for each number that has another source than the instrument says.

    Raises
    ------
    pydantic.ValidationError
        If a value is wrong; `fifesim.sensor.description.instruments.read_instrument` names file and key.
    """

    name: Name
    srf: SpectralResponse
    full_scale_radiance: Number
    min_radiance: Number
    solar_irradiance: Positive
    limits: tuple[Positive, Positive] | None = None
    gsd: Positive | None = None
    interval: Angle | None = None
    ifov: Angle | None = None
    lsf: SpatialResponse | None = None
    detectors: Count | None = None
    noise: Noise | None = None
    gain: Name = "nominal"
    gains: dict[str, Gain] = field(default_factory=dict, repr=False, hash=False)
    compression: Literal["square-root"] | None = None
    sources: Sources = field(default_factory=dict, repr=False, hash=False)  # type: ignore[valid-type]

    def __post_init__(self):
        Gain(self.full_scale_radiance, self.min_radiance)
        if self.limits and self.limits[0] >= self.limits[1]:
            raise ValueError(f"limits: the first must be below the second, got {self.limits} um")
        if self.gain in self.gains:
            raise ValueError(f"gains: {self.gain!r} is the band's own gain state, give the others")

    def __repr__(self):
        said = {name: value for name, value in vars(self).items() if value is not None and name in _TOLD}
        return f"InstrumentBand({', '.join(f'{name}={value!r}' for name, value in said.items())})"

    @property
    def response(self):
        """Relative spectral response, a `fifesim.base.bands.Band`."""
        return self.srf.read(self.name)

    @property
    def wavelength(self):
        """Response-weighted mean wavelength [um]."""
        return self.response.center

    @property
    def spectrum_irradiance(self):
        """Solar irradiance that ASTM G173 has over the response, beside the agency's [W m-2 um-1]."""
        return solar_irradiance(self.response)

    def compressed_count(self, bits):
        """
        Digital number at which the band's scale meets the linear one.

        Parameters
        ----------
        bits : int
            Of its instrument.

        Returns
        -------
        count : int
            The largest of a scale of square roots, 0 for a linear one.
        """
        return 2**bits - 1 if self.compression else 0

    def with_gain(self, gain):
        """
        The band in another gain state.

        Parameters
        ----------
        gain : str
            Name of a state.

        Returns
        -------
        band : InstrumentBand

        Raises
        ------
        ValueError
            If the band has no such state.
        """
        if gain == self.gain:
            return self
        if gain not in self.gains:
            raise ValueError(f"{self.name} has no gain state {gain!r}: it has {', '.join([self.gain, *self.gains])}")
        own = Gain(self.full_scale_radiance, self.min_radiance)
        others = {name: state for name, state in self.gains.items() if name != gain}
        return replace(self, gain=gain, gains={self.gain: own, **others}, **asdict(self.gains[gain]))
