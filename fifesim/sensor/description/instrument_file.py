"""Description of an instrument: bands, sampling, spatial response and radiometry, each number with its source."""

from collections.abc import Sequence
from dataclasses import asdict, field, replace
from functools import cached_property
from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from fifesim.base.arguments import NAMES, FilePath, Kind, Names, Range, checked
from fifesim.base.bands import NEAR_INFRARED, RED, nearest_band, solar_irradiance
from fifesim.base.footprints import LineSpread
from fifesim.base.messages import html_table
from fifesim.sensor.description.fields import (
    CONFIG,
    AlongAcross,
    Angle,
    Count,
    Name,
    Number,
    Positive,
    band_called,
    by_axes,
    key,
    lookup,
    worded,
)
from fifesim.sensor.description.listing import instrument_rows, names_of_bands
from fifesim.sensor.description.provenance import (
    NUMBER_OF,
    DescribedQuantity,
    Origin,
    Provenance,
    provenance_of,
)
from fifesim.sensor.description.spatial_response import GaussianResponse, SpatialResponse, responses_by_axis
from fifesim.sensor.description.spectral_response import SpectralResponse
from fifesim.sensor.response.noise import NoiseModel
from fifesim.sensor.response.scan import ScanPattern, Zone
from fifesim.sensor.response.spatial import AggregatedSpread


@dataclass(frozen=True, config=CONFIG)
class Noise:
    r"""
    Random noise of one band at a stated radiance.

    .. math:: \mathrm{NEdL} = L / \mathrm{SNR}

    A second point determines shot noise and constant noise; otherwise `shot` does, by default all of the variance.
    """

    radiance: Positive  # L [W m-2 sr-1 um-1]
    snr: Positive | None = None  # ratio of signal to noise there [1]
    nedl: Positive | None = None  # standard deviation there, instead of the ratio [W m-2 sr-1 um-1]
    high_radiance: Positive | None = None  # second, higher radiance [W m-2 sr-1 um-1]
    high_snr: Positive | None = None  # ratio at the second radiance [1]
    shot: Annotated[float, Field(strict=True, ge=0, le=1)] | None = None  # share of the variance that is shot noise [1]
    # Fixed pattern: standard deviations of the detectors' relative gain [1] and of their offset [W m-2 sr-1 um-1].
    gain_spread: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.0
    offset_spread: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] = 0.0

    def __post_init__(self):
        if (self.snr is None) == (self.nedl is None):
            raise ValueError("give either snr or nedl [W m-2 sr-1 um-1], at the radiance")
        if (self.high_radiance is None) != (self.high_snr is None):
            raise ValueError("high_radiance and high_snr belong together: give both or neither")
        if self.high_radiance is not None and self.high_radiance <= self.radiance:
            raise ValueError(f"high_radiance must be above radiance = {self.radiance:g}, got {self.high_radiance:g}")
        # Raises if the points and the share are inconsistent.
        self.model()

    def with_snr(self, snr):
        """Noise with another ratio at its radiance, and at the second one by the same factor."""
        scale = snr * self.equivalent_radiance / self.radiance
        return replace(self, snr=snr, nedl=None, high_snr=self.high_snr and self.high_snr * scale)

    @property
    def equivalent_radiance(self):
        """Noise equivalent radiance at `radiance`, as a standard deviation. [W m-2 sr-1 um-1]"""
        return self.radiance / self.snr if self.nedl is None else self.nedl

    def model(self, detectors=1, along="rows"):
        """Noise model at every radiance."""
        radiance, snr = [self.radiance], [self.radiance / self.equivalent_radiance]
        if self.high_radiance is not None:
            radiance, snr = [*radiance, self.high_radiance], [*snr, self.high_snr]
        model = NoiseModel.from_snr(radiance, snr, self.shot, detectors=detectors, along=along)
        return replace(model, gain_spread=self.gain_spread, offset_spread=self.offset_spread)


@dataclass(frozen=True, config=CONFIG)
class Gain:
    """Radiances that a gain state spreads over the digital numbers. [W m-2 sr-1 um-1]"""

    full_scale_radiance: Number  # of the largest digital number
    min_radiance: Number  # of digital number 0

    def __post_init__(self):
        if self.full_scale_radiance <= self.min_radiance:
            raise ValueError(
                f"full_scale_radiance must be above min_radiance, got {self.full_scale_radiance:g} "
                f"and {self.min_radiance:g} W m-2 sr-1 um-1"
            )


@dataclass(frozen=True, config=CONFIG)
class Product:
    """How the agency scales the digital numbers of its Level-1 product: by reflectance."""

    gain: Positive  # reflectance of one count [1]
    offset: Number  # reflectance of digital number 0 [1]
    bits: Annotated[int, Field(strict=True, ge=2, le=16)]
    sun_corrected: Annotated[bool, Field(strict=True)]  # whether the cosine of the solar zenith angle is divided out


@dataclass(frozen=True, config=CONFIG)
class ScanZone:
    """Zone of a scan in which samples are summed on board, on one side of nadir."""

    samples: Count  # of a line in the zone
    aggregation: Count  # elementary samples in the sum
    deleted: Annotated[int, Field(strict=True, ge=0)] = 0  # lines at each end of a sweep, which the next one sees too


@dataclass(frozen=True, config=CONFIG)
class Scan:
    """How an instrument covers the width of its swath; counts are for the first band."""

    kind: Literal["whiskbroom", "pushbroom"]  # a mirror sweeps a few detectors, or one row spans the line
    max_angle: Annotated[float, Field(strict=True, gt=0, lt=75)]  # from nadir, at the instrument [degree]
    samples: Count | None = None  # of a line
    lines: Count | None = None  # of a sweep, which are seen at once
    period: Positive | None = None  # from one sweep, or one line, to the next [s]
    swath: Positive | None = None  # published width on the ground [m]
    # From nadir outward, the same on either side. The intervals of the instrument are then between elementary samples.
    zones: tuple[ScanZone, ...] = ()

    def __post_init__(self):
        if not self.zones:
            return
        count = sum(zone.samples for zone in self.zones)
        if self.samples is not None and 2 * count != self.samples:
            raise ValueError(
                f"zones: their samples on one side of nadir must be half of samples = {self.samples}, got {count}"
            )
        if (deleted := max(zone.deleted for zone in self.zones)) and 2 * deleted >= (self.lines or 1):
            raise ValueError(f"zones: deleted = {deleted} at each end leaves none of lines = {self.lines or 1}")

    def elementary_samples(self):
        """Samples of a line of the first band before aggregation, None if they are not given."""
        if not self.zones:
            return self.samples
        return 2 * sum(zone.samples * zone.aggregation for zone in self.zones)


# Numbers that must be there and those that may; each that is there has a source.
INSTRUMENT_NUMBERS = ("altitude", "gsd", "interval", "bits", "lsf")
BAND_NUMBERS = ("srf", "full_scale_radiance", "min_radiance", "solar_irradiance")
OPTIONAL_NUMBERS = (
    "ifov", "detectors", "scan", "product", "noise", "gains", "limits", "geolocation", "compression", "paper_lsf",
)  # fmt: skip

# Numbers that an argument of `Instrument.replace` changes.
_OF_DESIGN = {"gsd": ("altitude", "gsd"), "mtf": ("lsf",), "snr": ("noise",), "registration": ("geolocation",)}

# Publications by number.
Sources = dict[Literal[INSTRUMENT_NUMBERS + BAND_NUMBERS + OPTIONAL_NUMBERS], str]  # type: ignore[misc, valid-type]

# Fields that the text of a band shows where they are given.
_SHOWN = ("name", "srf", "full_scale_radiance", "min_radiance", "solar_irradiance", "limits", "gsd", "gain")


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
    origin : dict of Origin, optional
        Origin of ``blur`` and ``noise`` where it differs from the instrument's.

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
    origin: dict[Literal["blur", "noise"], Origin] = field(default_factory=dict, repr=False, hash=False)

    def __post_init__(self):
        Gain(self.full_scale_radiance, self.min_radiance)
        if self.limits and self.limits[0] >= self.limits[1]:
            raise ValueError(f"limits: the first must be below the second, got {self.limits} um")
        if self.gain in self.gains:
            raise ValueError(f"gains: {self.gain!r} is the band's own gain state, give the others")

    def __repr__(self):
        parts = [f"{name}={value!r}" for name, value in vars(self).items() if value is not None and name in _SHOWN]
        return f"InstrumentBand({', '.join(parts)})"

    @cached_property
    def response(self):
        """Relative spectral response."""
        return self.srf.read(self.name)

    @cached_property
    def wavelength(self):
        """Response-weighted mean wavelength. [um]"""
        return self.response.center

    @property
    def spectrum_irradiance(self):
        """Solar irradiance of ASTM G173 over the response, as a reference for the published one. [W m-2 um-1]"""
        return solar_irradiance(self.response)

    def compressed_count(self, bits):
        """Digital number at which the square-root and linear scales meet, 0 for a linear scale."""
        return 2**bits - 1 if self.compression else 0

    def with_gain(self, gain):
        """Band in another gain state."""
        if gain == self.gain:
            return self
        if gain not in self.gains:
            raise ValueError(f"{self.name} has no gain state {gain!r}: it has {', '.join([self.gain, *self.gains])}")
        own = Gain(self.full_scale_radiance, self.min_radiance)
        others = {name: state for name, state in self.gains.items() if name != gain}
        return replace(self, gain=gain, gains={self.gain: own, **others}, **asdict(self.gains[gain]))


@worded
@dataclass(frozen=True, config=CONFIG)
class Instrument:
    """
    Description of an instrument.

    Parameters
    ----------
    name, title : str
        Short name, such as ``"TM"``, and full name.
    altitude : float
        Above the ground. [m]
    gsd : float
        Pixel of the gridded product. [m]
    interval : float or Angles
        Angle between the instrument's own samples, before aggregation on board. [rad]
    bits : int
        Number of radiometric bits.
    lsf : response of both axes or TwoAxesResponse
        Spatial response; see `fifesim.sensor.description.spatial_response`.
    bands : tuple of InstrumentBand
        As `fifesim.sensor.description.instrument_file` has them; at least one.
    sources : dict
        Key of ``references`` for each number; a band's own sources come first.
    references : dict
        Publications by key.
    ifov : float or Angles, optional
        Instantaneous field of view. [rad]
    detectors : int, optional
        Detectors of a band, which take turns at its lines (whiskbroom) or stand side by side (pushbroom).
    scan : Scan, optional
    geolocation : float, optional
        Error of the gridded product's place, root mean square along each axis. [m]
    product : Product, optional
        Scale of the agency's product.
    paper_lsf : response of both axes or TwoAxesResponse, optional
        Spatial response of Friedl et al. (1995), which ``response="paper"`` selects.
    origin : dict of Origin, optional
        Origin of ``blur``, ``noise`` and ``geolocation``; see `fifesim.sensor.description.provenance`.
    not_found : dict, optional
        Parts missing in ``noise``, ``blur`` and ``geolocation``, with their publisher or the search that was done.
    aliases : tuple of str, optional
        Other names.

    Raises
    ------
    ValueError
        If an argument is missing or unknown, or a value is wrong or has no source.

    Examples
    --------
    >>> import fifesim
    >>> tm = fifesim.instrument("TM")
    >>> tm.altitude, [band.name for band in tm.bands[:3]]
    (705000.0, ['TM1', 'TM2', 'TM3'])
    """

    name: Name
    title: Name
    altitude: Positive
    gsd: Positive
    interval: Angle
    bits: Annotated[int, Field(strict=True, ge=2, le=16)]
    lsf: SpatialResponse
    bands: Annotated[tuple[InstrumentBand, ...], Field(min_length=1)] = field(repr=False)
    sources: Sources = field(repr=False, hash=False)  # type: ignore[valid-type]
    references: dict[str, str] = field(repr=False, hash=False)
    ifov: Angle | None = None
    detectors: Count | None = None
    scan: Scan | None = None
    geolocation: Positive | None = None
    product: Product | None = None
    paper_lsf: SpatialResponse | None = None
    origin: dict[DescribedQuantity, Origin] = field(default_factory=dict, repr=False, hash=False)
    not_found: dict[DescribedQuantity, str] = field(default_factory=dict, repr=False, hash=False)
    aliases: tuple[Name, ...] = ()

    def __post_init__(self):
        names = [band.name for band in self.bands]
        if len(set(names)) < len(names):
            raise ValueError(f"bands: each name may occur once, got {', '.join(names)}")
        for number in (*INSTRUMENT_NUMBERS, *_given(self)):
            self.source(number)
        for band in self.bands:
            for number in (*BAND_NUMBERS, *_given(band)):
                self.source(number, band)

    def __repr__(self):
        return (
            f"Instrument {self.name}: {self.title}, {self.gsd:g} m pixels from {self.altitude / 1000:g} km, "
            f"{self.bits} bits\n  bands {names_of_bands(self)}"
        )

    def _repr_html_(self):
        return html_table(f"{self.name}: {self.title}", instrument_rows(self))

    @property
    def max_angle(self) -> float:
        """Largest scan angle from nadir, infinite where the file has no scan [degree]."""
        return np.inf if self.scan is None else self.scan.max_angle

    @property
    def provenance(self) -> tuple[Provenance, ...]:
        """Origin, uncertainty and source of blur, noise and geolocation, one row for the bands that share them."""
        return provenance_of(self)

    @property
    def line_spread(self) -> LineSpread:
        """Line spread function on the ground of the first band, across the track."""
        return self.line_spreads(self.bands[0]).across

    @property
    def ground_interval(self) -> float:
        """Distance on the ground between the samples of the first band at nadir, across the track [m]."""
        return self.ground_intervals(self.bands[0]).across

    def pixel(self, band: InstrumentBand) -> float:
        """
        Pixel of a band in the gridded product.

        Parameters
        ----------
        band : InstrumentBand

        Returns
        -------
        gsd : float
            [m]
        """
        return self.gsd if band.gsd is None else band.gsd

    def ground_intervals(self, band: InstrumentBand) -> AlongAcross:
        """
        Distances on the ground between a band's own samples at nadir, after aggregation on board.

        Parameters
        ----------
        band : InstrumentBand

        Returns
        -------
        intervals : AlongAcross
            [m]
        """
        along, across = self._on_ground(band.interval or self.interval)
        return AlongAcross(along, across * self._aggregation)

    @property
    def _aggregation(self):
        """Elementary samples that are summed at nadir."""
        return self.scan.zones[0].aggregation if self.scan and self.scan.zones else 1

    def scan_pattern(self, band: InstrumentBand) -> ScanPattern:
        """
        Lines and samples that a band takes in one sweep.

        Parameters
        ----------
        band : InstrumentBand

        Returns
        -------
        pattern : fifesim.sensor.response.scan.ScanPattern
            One line for a pushbroom, and where the instrument's file has no number of lines.
        """
        step, first = (by_axes(each.interval or self.interval) for each in (band, self.bands[0]))
        if self.scan is None or self.scan.kind == "pushbroom":
            return ScanPattern(step.along, step.across)
        fewer, shorter = first.along / step.along, first.across / step.across
        zones = tuple(
            Zone(round(zone.samples * shorter), zone.aggregation, round(zone.deleted * fewer))
            for zone in self.scan.zones
        )
        return ScanPattern(step.along, step.across, max(round((self.scan.lines or 1) * fewer), 1), zones)

    def ground_fields(self, band: InstrumentBand) -> AlongAcross:
        """
        Instantaneous field of view of a band on the ground at nadir.

        Parameters
        ----------
        band : InstrumentBand

        Returns
        -------
        widths : AlongAcross
            None where the instrument's file has none. [m]
        """
        return self._on_ground(band.ifov or self.ifov)

    def _on_ground(self, angle):
        along, across = by_axes(angle)
        return AlongAcross(along and self.altitude * along, across and self.altitude * across)

    def line_spreads(self, band: InstrumentBand, aggregation: int | None = None) -> AlongAcross:
        """
        Line spread functions of a band on the ground.

        Parameters
        ----------
        band : InstrumentBand
        aggregation : int, optional
            Elementary samples that are summed across the track; by default as many as at nadir.

        Returns
        -------
        lsf : AlongAcross
            As `fifesim.base.footprints` takes them: along for its rows, across for its columns.
        """
        (along, _), (across, view) = ((lsf.spread(view), view) for lsf, view in responses_by_axis(self, band))
        count = self._aggregation if aggregation is None else aggregation
        if count > 1:
            across = AggregatedSpread(across, count, view.interval * self.altitude)
        return AlongAcross(along, across)

    def noise_model(self, band: InstrumentBand) -> NoiseModel:
        """
        Noise of a band at every radiance.

        Parameters
        ----------
        band : InstrumentBand

        Returns
        -------
        model : fifesim.sensor.response.noise.NoiseModel

        Raises
        ------
        ValueError
            If the instrument's file has no noise for the band.
        """
        if band.noise is None:
            raise ValueError(
                f"the description of {self.name} has no noise for {band.name}: leave noise out, give "
                "noise_models=fifesim.NoiseModel(...), in a scenario [sensor.noise_model], or take an instrument that "
                "has it, such as OLI"
            )
        pushed = self.scan is not None and self.scan.kind == "pushbroom"
        return band.noise.model(band.detectors or self.detectors or 1, "columns" if pushed else "rows")

    def with_gain(self, gain: str | dict[str, str]) -> "Instrument":
        """
        The instrument with those bands that have a gain state in that state.

        Parameters
        ----------
        gain : str or dict of str
            Name of a state for every band that has it, or names by band.

        Returns
        -------
        instrument : Instrument

        Raises
        ------
        ValueError
            If a band that is named, or every band, lacks the state.
        """
        if isinstance(gain, dict):
            chosen = {band.name: state for name, state in gain.items() for band in self.select(name)}
        else:
            chosen = {band.name: gain for band in self.bands if gain == band.gain or gain in band.gains}
            if not chosen:
                raise ValueError(f"no band of {self.name} has a gain state {gain!r}")
        return replace(self, bands=tuple(band.with_gain(chosen.get(band.name, band.gain)) for band in self.bands))

    @checked
    def replace(
        self: "Instrument",
        *,
        gsd: Annotated[float, Range("m", 0, np.inf, ends="(]")] | None = None,
        mtf: Annotated[float, Range("1", 0, 1, ends="()")] | None = None,
        snr: Annotated[float, Range("1", 0, np.inf, ends="(]")] | None = None,
        registration: Annotated[float, Range("m", 0, np.inf, ends="(]")] | None = None,
    ) -> "Instrument":
        """
        The instrument with another design, for trade studies.

        Parameters
        ----------
        gsd : float, optional
            Pixel of the gridded product. Blur, sampling interval and the pixels of all bands change by the same factor,
            because the altitude does: angles stay, and the swath becomes wider or narrower. [m]
        mtf : float, optional
            Modulation transfer at the Nyquist frequency of the sampling interval, along both axes, in (0, 1): the blur
            of each band becomes a Gaussian. [1]
        snr : float, optional
            Ratio of signal to noise of the bands that have noise, at the radiance that the instrument's file states; a
            ratio at a second radiance changes by the same factor. [1]
        registration : float, optional
            Error of the place of a pixel, root mean square along each axis. [m]

        Returns
        -------
        instrument : Instrument
            Its name states the changes.

        Raises
        ------
        ValueError
            If a number is out of range, no band has noise, to whose radiance ``snr`` could refer, or samples are summed
            on board, so that ``mtf`` would not be that of the sums.

        See Also
        --------
        fifesim.trade, fifesim.compare

        Examples
        --------
        >>> import fifesim
        >>> oli = fifesim.instrument("OLI")
        >>> wide = oli.replace(gsd=60.0, snr=100.0)
        >>> wide.name, round(wide.line_spread.fwhm / oli.line_spread.fwhm, 6)
        ('OLI, gsd 60, snr 100', 2.0)
        """
        given = {"gsd": gsd, "mtf": mtf, "snr": snr, "registration": registration}
        given = {name: float(value) for name, value in given.items() if value is not None}
        if mtf is not None and self._aggregation > 1:
            raise ValueError(
                f"mtf: {self.name} sums samples on board: give the lsf of one sample in an instrument file"
            )
        if snr is not None and not any(band.noise for band in self.bands):
            raise ValueError(
                f"snr: the description of {self.name} states no radiance: give noise = {{ snr = ..., radiance = ... }} "
                "of its bands in an instrument file"
            )
        scale = 1.0 if gsd is None else gsd / self.gsd
        changed = [number for name in given for number in _OF_DESIGN[name]]
        lsf = self.lsf if mtf is None else GaussianResponse(kind="gaussian", mtf_at_nyquist=float(mtf))
        bands = tuple(
            replace(
                band,
                gsd=band.gsd and band.gsd * scale,
                lsf=band.lsf if mtf is None else None,
                noise=band.noise if snr is None or not band.noise else band.noise.with_snr(float(snr)),
                sources={number: each for number, each in band.sources.items() if number not in changed},  # type: ignore[attr-defined]
                origin={name: origin for name, origin in band.origin.items() if NUMBER_OF[name] not in changed},
            )
            for band in self.bands
        )
        return replace(
            self,
            name=", ".join([self.name, *(f"{name} {value:g}" for name, value in given.items())]),
            title=f"{self.title}, changed",
            aliases=(),
            altitude=self.altitude * scale,
            gsd=self.gsd * scale,
            lsf=lsf,
            bands=bands,
            geolocation=given.get("registration", self.geolocation),
            origin=self.origin | {name: Origin("required") for name, number in NUMBER_OF.items() if number in changed},
            sources=self.sources | dict.fromkeys(changed, "design"),
            references=self.references | {"design": "given to Instrument.replace"},
        )

    def select(self, bands: Names | None = None) -> tuple[InstrumentBand, ...]:
        """
        Bands by name.

        Parameters
        ----------
        bands : str or sequence of str, optional
            Names in any case, or as `fifesim.sensor.description.fields.band_called` knows them; all by default.

        Returns
        -------
        bands : tuple of InstrumentBand
            In the requested order.

        Raises
        ------
        ValueError
            If the instrument has no such band.

        Examples
        --------
        >>> from fifesim.sensor.description.instruments import instrument
        >>> [band.name for band in instrument("TM").select(["TM4", "tm3"])]
        ['TM4', 'TM3']
        """
        if bands is None:
            return self.bands
        names = [bands] if isinstance(bands, str) else bands
        found = tuple(map(self._own_names.get, names))
        if None in found:
            found = tuple(own or self._band_called(name) for own, name in zip(found, names, strict=True))
        if not found or len(set(found)) < len(found):
            raise ValueError(
                f"bands of {self.name} must be at least one, each once, got {', '.join(map(str, names)) or 'none'}"
            )
        return found

    @cached_property
    def _own_names(self):
        return {band.name: band for band in self.bands}

    def _band_called(self, name):
        """Band by another spelling of its name, its number or a common name."""
        if isinstance(name, str) and (found := band_called(name, self)):
            return found
        return lookup(name, {key(band.name): band for band in self.bands}, f"band of {self.name}")

    def red_and_near_infrared(self) -> tuple[InstrumentBand, InstrumentBand]:
        """
        The bands of vegetation indices.

        Returns
        -------
        bands : (InstrumentBand, InstrumentBand)
            Bands on the finest grid that has both.

        Raises
        ------
        ValueError
            If the instrument lacks one of them.
        """
        for pixel in sorted({self.pixel(band) for band in self.bands}):
            pair = [self._showing(window, pixel) for window in (RED, NEAR_INFRARED)]
            if all(pair):
                return tuple(pair)
        shown = {window: self._showing(window) for window in (RED, NEAR_INFRARED)}
        for window, band in shown.items():
            if band is None:
                raise ValueError(
                    f"{self.name} has no {window.name} band, {window.low:g} to {window.high:g} um: say which of its "
                    f"bands are meant: {', '.join(band.name for band in self.bands)}"
                )
        return tuple(shown.values())

    def _showing(self, window, pixel=None):
        """Band that is best for a window, among those with a pixel size."""
        bands = [band for band in self.bands if pixel is None or self.pixel(band) == pixel]
        number = nearest_band([band.wavelength for band in bands], window)
        return None if number is None else bands[number]

    def source(self, number: str, band: InstrumentBand | None = None) -> str:
        """
        Publication that a number comes from.

        Parameters
        ----------
        number : str
            Name of a parameter, such as ``"altitude"`` or ``"min_radiance"``.
        band : InstrumentBand, optional
            The band whose number it is.

        Returns
        -------
        reference : str

        Raises
        ------
        ValueError
            If the number has no source, or its source is not among the references.
        """
        key = (band.sources if band else {}).get(number) or self.sources.get(number)  # type: ignore[attr-defined]
        if key not in self.references:
            raise ValueError(f"sources.{number}: must be one of {', '.join(self.references)}, got {key!r}")
        return self.references[key]


def _given(item):
    """Names of the optional numbers of an instrument or a band that are given."""
    names = OPTIONAL_NUMBERS + (INSTRUMENT_NUMBERS if isinstance(item, InstrumentBand) else ())
    return [name for name in names if getattr(item, name, None)]


InstrumentLike: TypeAlias = Annotated[
    FilePath | Instrument, Kind("the name of an instrument, such as 'TM', or a fifesim.Instrument")
]
InstrumentsLike: TypeAlias = Annotated[
    Sequence[InstrumentLike], Kind("a list of instruments, such as ['TM', 'OLI']", NAMES.fits)
]
