"""Description of an instrument: bands, sampling, spatial response and radiometry, each number with its source."""

from dataclasses import field, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from fifesim.base.annotations import Names
from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.base.line_spread import LineSpread
from fifesim.sensor.description.band import BAND_NUMBERS, INSTRUMENT_NUMBERS, OPTIONAL_NUMBERS, InstrumentBand, Sources
from fifesim.sensor.description.band_names import band_called
from fifesim.sensor.description.fields import CONFIG, AlongAcross, Angle, Count, Name, Positive, by_axes
from fifesim.sensor.description.names import key, lookup
from fifesim.sensor.description.performance import Product, Scan
from fifesim.sensor.description.spatial_response import SpatialResponse, View
from fifesim.sensor.description.wording import worded
from fifesim.sensor.response.noise import NoiseModel


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
        Angle between the instrument's own samples. [rad]
    bits : int
        Number of radiometric bits.
    lsf : response of both axes or TwoAxesResponse
        Spatial response; see `fifesim.sensor.description.spatial_response`.
    bands : tuple of InstrumentBand
        As `fifesim.sensor.description.band` has them; at least one.
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
    not_found : dict, optional
        What is left out of ``noise`` and ``blur``, and who published it.
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
    not_found: dict[Literal["noise", "blur"], str] = field(default_factory=dict, repr=False, hash=False)
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
            f"{self.bits} bits\n  bands {', '.join(band.name for band in self.bands)}"
        )

    @property
    def max_angle(self) -> float:
        """Largest scan angle from nadir, infinite where the file has no scan [degree]."""
        return np.inf if self.scan is None else self.scan.max_angle

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
        Distances on the ground between a band's own samples at nadir.

        Parameters
        ----------
        band : InstrumentBand

        Returns
        -------
        intervals : AlongAcross
            [m]
        """
        return self._on_ground(band.interval or self.interval)

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

    def line_spreads(self, band: InstrumentBand) -> AlongAcross:
        """
        Line spread functions of a band on the ground.

        Parameters
        ----------
        band : InstrumentBand

        Returns
        -------
        lsf : AlongAcross
            As `fifesim.base.footprints` takes them: along for its rows, across for its columns.
        """
        given = band.lsf or self.lsf, band.ifov or self.ifov, band.interval or self.interval
        axes = zip(*map(by_axes, given), strict=True)
        return AlongAcross(*(lsf.spread(View(self.altitude, ifov, interval, band)) for lsf, ifov, interval in axes))

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
                f"the description of {self.name} has no noise for {band.name}: leave noise out, or give an instrument "
                "whose file has it"
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

    def select(self, bands: Names | None = None) -> tuple[InstrumentBand, ...]:
        """
        Bands by name.

        Parameters
        ----------
        bands : str or sequence of str, optional
            Names in any case, or as `fifesim.sensor.description.band_names.band_called` knows them; all by default.

        Returns
        -------
        bands : tuple of InstrumentBand
            In the order asked for.

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
        known = {key(band.name): band for band in self.bands}
        names = known if bands is None else [bands] if isinstance(bands, str) else bands
        called = [band_called(name, self) if isinstance(name, str) else None for name in names]
        found = tuple(
            lookup(name, known, f"band of {self.name}") if band is None else band
            for name, band in zip(names, called, strict=True)
        )
        if not found or len(set(found)) < len(found):
            raise ValueError(
                f"bands of {self.name} must be at least one, each once, got {', '.join(map(str, names)) or 'none'}"
            )
        return found

    def red_and_near_infrared(self) -> tuple[InstrumentBand, InstrumentBand]:
        """
        The bands of vegetation indices.

        Returns
        -------
        bands : (InstrumentBand, InstrumentBand)
            Of the finest grid that has both.

        Raises
        ------
        ValueError
            If the instrument lacks one of them.
        """
        for pixel in sorted({self.pixel(band) for band in self.bands}):
            pair = [self._showing(window, pixel) for window in (RED, NEAR_INFRARED)]
            if all(pair):
                return tuple(pair)
        pair = {window: self._showing(window) for window in (RED, NEAR_INFRARED)}
        for window, band in pair.items():
            if band is None:
                raise ValueError(
                    f"{self.name} has no {window.name} band, {window.low:g} to {window.high:g} um: say which of its "
                    f"bands are meant: {', '.join(band.name for band in self.bands)}"
                )
        return tuple(pair.values())

    def _showing(self, window, pixel=None):
        """The band that shows best what a window is for, among those of a size of pixels."""
        bands = [band for band in self.bands if pixel is None or self.pixel(band) == pixel]
        number = nearest([band.wavelength for band in bands], window)
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
        key = (band.sources if band else {}).get(number) or self.sources.get(number)
        if key not in self.references:
            raise ValueError(f"sources.{number}: must be one of {', '.join(self.references)}, got {key!r}")
        return self.references[key]


def _given(item):
    """Names of the optional numbers that an instrument or a band has."""
    names = OPTIONAL_NUMBERS + (INSTRUMENT_NUMBERS if isinstance(item, InstrumentBand) else ())
    return [name for name in names if getattr(item, name, None)]
