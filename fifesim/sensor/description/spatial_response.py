"""
Spatial responses of instrument files: angles, which an altitude turns into metres on the ground.

The formulas are in `spatial`.
"""

from dataclasses import replace
from typing import Annotated, Literal, NamedTuple, get_args

import numpy as np
from pydantic import Discriminator, Field, Tag
from pydantic.dataclasses import dataclass

from fifesim.base.footprints import Boxcar
from fifesim.sensor.description.fields import CONFIG, Count, Number, Positive, Share, TwoAxes, by_axes
from fifesim.sensor.response import spatial


class View(NamedTuple):
    """View of the ground by one band at nadir, along one axis."""

    altitude: float  # [m]
    ifov: float | None  # instantaneous field of view [rad]
    interval: float  # angle between samples [rad]
    band: object  # with the response-weighted mean `wavelength`, which only some responses need [um]

    def width(self, response):
        """Instantaneous field of view on the ground. [m]"""
        if self.ifov is None:
            raise ValueError(f"lsf: kind {response!r} needs the instantaneous field of view: add ifov, in radians")
        return self.ifov * self.altitude


# The response of one axis is a class whose ``spread(view)`` is its line spread function on the ground.


@dataclass(frozen=True, config=CONFIG)
class CosineResponse:
    """A cosine truncated at half amplitude, sampled at angles, as tables of sensors give it."""

    kind: Literal["cosine"]
    step: Positive  # angle between samples of the response [rad]
    count: Count

    def spread(self, view):
        """Line spread function on the ground."""
        return spatial.CosineSpread(self.count * self.step * view.altitude)


@dataclass(frozen=True, config=CONFIG)
class BoxcarResponse:
    """The detector alone: uniform over an angle."""

    kind: Literal["boxcar"]
    width: Positive | None = None  # by default the instantaneous field of view [rad]

    def spread(self, view):
        """Line spread function on the ground."""
        return Boxcar(view.width("boxcar") if self.width is None else self.width * view.altitude)


@dataclass(frozen=True, config=CONFIG)
class GaussianResponse:
    r"""
    A Gaussian, by one of three measures.

    .. math:: M\left(\frac{1}{2 E}\right) = \frac{1}{2} \quad\Rightarrow\quad W = \frac{4 \ln 2}{\pi} E

    relates the effective instantaneous field of view E to the full width W at half of the maximum.
    """

    kind: Literal["gaussian"]
    fwhm: Positive | None = None  # W [rad]
    mtf_at_nyquist: Share | None = None  # modulation transfer at the Nyquist frequency of the sampling interval [1]
    eifov: Positive | None = None  # E, half of the period that is passed by half [rad]

    def __post_init__(self):
        given = [name for name in ("fwhm", "mtf_at_nyquist", "eifov") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of fwhm, mtf_at_nyquist and eifov, got {' and '.join(given) or 'none'}")

    def spread(self, view):
        """Line spread function on the ground."""
        if self.mtf_at_nyquist is not None:
            return spatial.GaussianSpread.from_mtf(self.mtf_at_nyquist, view.interval * view.altitude)
        fwhm = self.fwhm if self.eifov is None else 4 * np.log(2) / np.pi * self.eifov
        return spatial.GaussianSpread(float(fwhm * view.altitude))


@dataclass(frozen=True, config=CONFIG)
class TableResponse:
    """A measured response, linear between angles and zero beyond them."""

    kind: Literal["table"]
    angles: Annotated[tuple[Number, ...], Field(min_length=2)]  # from the nominal centre of the pixel, increasing [rad]
    values: Annotated[tuple[Number, ...], Field(min_length=2)]  # in any unit

    def __post_init__(self):
        # Errors in the table are raised before the simulation starts.
        spatial.TableSpread(self.angles, self.values)

    def spread(self, view):
        """Line spread function on the ground."""
        return spatial.TableSpread(tuple(angle * view.altitude for angle in self.angles), self.values)


@dataclass(frozen=True, config=CONFIG)
class SystemResponse:
    """Product of the modulation transfers of the parts of an instrument, in units of its field of view and interval."""

    kind: Literal["system"]
    detector: Positive = 1.0  # width [instantaneous fields of view]
    smear: Positive | None = None  # way of the detector over the ground while it integrates [sampling intervals]
    blur: Positive | None = None  # full width at half maximum of Gaussian optics [instantaneous fields of view]
    aperture: Positive | None = None  # diameter of optics limited by diffraction [m]
    electronics: Positive | None = None  # frequency at which the filter halves the power [cycles per sampling interval]
    poles: Count = 1  # of this filter
    truncation: Share = 1e-3  # largest share of the response that may be cut off [1]

    def spread(self, view):
        """Line spread function on the ground."""
        width, interval = view.width("system"), view.interval * view.altitude
        parts = [Boxcar(self.detector * width)]
        if self.smear is not None:
            parts.append(Boxcar(self.smear * interval))
        if self.blur is not None:
            parts.append(spatial.GaussianSpread(self.blur * width))
        if self.aperture is not None:
            parts.append(spatial.Diffraction(self.aperture / (1e-6 * view.band.wavelength * view.altitude)))
        if self.electronics is not None:
            parts.append(spatial.LowPass(self.electronics / interval, self.poles))
        return spatial.SystemSpread(tuple(parts), self.truncation)


AxisResponse = Annotated[
    CosineResponse | BoxcarResponse | GaussianResponse | TableResponse | SystemResponse, Field(discriminator="kind")
]


@dataclass(frozen=True, config=CONFIG)
class TwoAxesResponse(TwoAxes):
    """Spatial response that differs between the axes, along and across the track."""

    along: AxisResponse
    across: AxisResponse


def _form(value):
    keys = value if isinstance(value, dict) else vars(value) if hasattr(value, "__dict__") else ()
    return "axes" if {"along", "across"} & set(keys) else "both"


SpatialResponse = Annotated[
    Annotated[AxisResponse, Tag("both")] | Annotated[TwoAxesResponse, Tag("axes")], Discriminator(_form)
]


ResponseName = Literal["system", "detector", "paper", "sharpest", "softest"]

_DETECTOR = BoxcarResponse(kind="boxcar")


def knows_blur(instrument, band):
    """Whether the spatial response of a band is known beyond its detector; else images are too sharp."""
    return {part.kind for part in by_axes(band.lsf or instrument.lsf)} != {"boxcar"}


def responses_by_axis(instrument, band):
    """Response and view of a band along and across the track."""
    given = band.lsf or instrument.lsf, band.ifov or instrument.ifov, band.interval or instrument.interval
    axes = zip(*map(by_axes, given), strict=True)
    return [(lsf, View(instrument.altitude, ifov, interval, band)) for lsf, ifov, interval in axes]


def with_response(instrument, response):
    """Instrument with the response of the system, an end of its uncertainty, the detector alone, or the paper."""
    if response not in get_args(ResponseName):
        raise ValueError(f"response must be one of {', '.join(get_args(ResponseName))}, got {response!r}")
    # Detectors are as wide as the instantaneous field of view, or as the interval where the file has none.
    if response == "detector":
        return replace(instrument, lsf=_DETECTOR, bands=tuple(_sharp(instrument, band) for band in instrument.bands))
    if response == "paper" and instrument.paper_lsf is not None:
        sources = instrument.sources | {"lsf": instrument.sources["paper_lsf"]}
        origin = {key: value for key, value in instrument.origin.items() if key != "blur"}
        return replace(instrument, lsf=instrument.paper_lsf, sources=sources, origin=origin)
    if response == "paper" or not any(knows_blur(instrument, band) for band in instrument.bands):
        raise ValueError(
            f"the description of {instrument.name} has no {response!r} response: type response='detector', or give an "
            "instrument whose file has it"
        )
    if response in ("sharpest", "softest"):
        return _at_end(instrument, 1 if response == "sharpest" else -1)
    return instrument


# Modulation transfer at the Nyquist frequency is kept within these limits at the ends of its uncertainty. [1]
_LEAST, _MOST = 0.01, 0.95


def _at_end(instrument, sign):
    """Instrument with Gaussians whose transfer at the Nyquist frequency is one end of its stated uncertainty."""
    origins = [band.origin.get("blur") or instrument.origin.get("blur") for band in instrument.bands]
    bands = list(zip(instrument.bands, origins, strict=True))
    if unknown := [band.name for band, origin in bands if origin is None or origin.uncertainty is None]:
        raise ValueError(
            f"the description of {instrument.name} states no uncertainty of the blur of {', '.join(unknown)}: give "
            "[origin] blur = { kind = ..., uncertainty = ... } in its file"
        )
    found = []
    for band, origin in bands:
        axes = []
        for lsf, view in responses_by_axis(instrument, band):
            own = lsf.spread(view).mtf(0.5 / (view.interval * view.altitude))
            end = min(max(float(own) + sign * origin.uncertainty, _LEAST), _MOST)
            axes.append(GaussianResponse(kind="gaussian", mtf_at_nyquist=end))
        found.append(replace(band, lsf=TwoAxesResponse(*axes)))
    return replace(instrument, bands=tuple(found))


def _sharp(instrument, band):
    """Band with its field of view and without a separate response."""
    number = "ifov" if band.ifov or instrument.ifov else "interval"
    width = getattr(band, number) or getattr(instrument, number)
    sources = {key: value for key, value in band.sources.items() if key != "lsf"}
    source = sources[number] if number in sources else instrument.sources[number]
    return replace(band, lsf=None, ifov=width, sources=sources | {"ifov": source})
