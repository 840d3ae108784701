"""
Line spread and transfer functions of sensors (Eq. 3), as `fifesim.base.footprints` takes them.

These are the cosine of the paper, the Gaussian and a measured table; `Boxcar` is another, and `transfer` builds one
from the parts of an instrument. A footprint has one for its rows, along the track, and one for its columns, across the
track. Each shape has its integral C and the transform M of its density w.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.fft import irfft
from scipy.special import ndtr, spherical_jn

from fifesim.base.caches import cached
from fifesim.base.footprints import FiniteSpread, LineSpread, Transfer

# Standard deviations at which a Gaussian is truncated; 2e-9 of its integral lies beyond.
_GAUSSIAN_REACH = 6.0


@dataclass(frozen=True)
class CosineSpread(FiniteSpread):
    r"""
    Cosine line spread function of a width W, truncated at half its amplitude.

    .. math::

        w(x) &= \cos\frac{2 \pi x}{3 W}, \quad |x| \le W / 2 \\
        C(x) &= \frac{1}{2} + \frac{1}{\sqrt{3}} \sin\frac{2 \pi x}{3 W} \\
        M(f) &= \frac{\pi}{3 \sqrt{3}} \left[ \mathrm{sinc}\left(\tfrac{1}{3} - f W\right)
            + \mathrm{sinc}\left(\tfrac{1}{3} + f W\right) \right] \\
        \mathrm{sinc}\,t &= \frac{\sin \pi t}{\pi t}

    References
    ----------
    [Friedl1995]_, Table 1, note a
    """

    def _cumulative(self, x):
        x = np.clip(x, -self.half_width, self.half_width)
        return 0.5 + np.sin(2 * np.pi * x / (3 * self.width)) / np.sqrt(3)

    def _mtf(self, frequency):
        phase = frequency * self.width
        return np.pi / (3 * np.sqrt(3)) * (np.sinc(1 / 3 - phase) + np.sinc(1 / 3 + phase))


@dataclass(frozen=True)
class GaussianSpread(LineSpread):
    r"""
    Gaussian line spread function.

    .. math:: w(x) = \exp\left(-\frac{x^2}{2 \sigma^2}\right), \qquad \sigma = \frac{W}{2 \sqrt{2 \ln 2}}, \qquad
        M(f) = \exp(-2 \pi^2 \sigma^2 f^2)

    It is cut at :math:`6 \sigma`, where 2e-9 of it is lost, and scaled; M is the transform of the whole.

    Parameters
    ----------
    fwhm : float
        Full width W at half of the maximum. [m]
    """

    fwhm: float

    @classmethod
    def from_mtf(cls, mtf_at_nyquist, interval):
        r"""
        Gaussian with a given modulation transfer at the Nyquist frequency of a sampling interval d.

        .. math:: M\left(\frac{1}{2 d}\right) = \exp\left(-\frac{\pi^2 \sigma^2}{2 d^2}\right)

        Parameters
        ----------
        mtf_at_nyquist : float
            In (0, 1). [1]
        interval : float
            Distance d between samples. [m]

        Returns
        -------
        spread : GaussianSpread
        """
        return cls(float(np.sqrt(-16 * np.log(2) * np.log(mtf_at_nyquist)) * interval / np.pi))

    @property
    def sigma(self):
        """Standard deviation. [m]"""
        return self.fwhm / np.sqrt(8 * np.log(2))

    @property
    def half_width(self):
        """Distance from the pixel centre beyond which the response is taken as zero. [m]"""
        return _GAUSSIAN_REACH * self.sigma

    @property
    def truncated_share(self):
        """Share of the Gaussian beyond the half width, by which the rest is rescaled. [1]"""
        return float(2 * ndtr(-_GAUSSIAN_REACH))

    def _cumulative(self, x):
        z = np.clip(x / self.sigma, -_GAUSSIAN_REACH, _GAUSSIAN_REACH)
        return (ndtr(z) - ndtr(-_GAUSSIAN_REACH)) / (1 - self.truncated_share)

    def _mtf(self, frequency):
        return np.exp(-2 * (np.pi * self.sigma * frequency) ** 2)


@dataclass(frozen=True)
class TableSpread(LineSpread):
    r"""
    Measured line spread function, linear between its positions and zero beyond them.

    With :math:`z = 2 \pi f h` on a segment of half length h around c, with mean value v and slope m,

    .. math:: M(f) = \sum e^{-2 \pi i f c} \left[ 2 h v \, j_0(z) - 2 i m h^2 j_1(z) \right]

    or its modulus where the table is not symmetric.

    Parameters
    ----------
    positions : sequence of float, shape (n,)
        Distances from the pixel's nominal centre, increasing. [m]
    values : sequence of float, shape (n,)
        Response, in any unit: it is scaled to an integral of 1. Lobes may be negative. [1]
    """

    positions: tuple = field(repr=False)
    values: tuple = field(repr=False)

    def __post_init__(self):
        positions = tuple(float(each) for each in self.positions)
        values = tuple(float(each) for each in self.values)
        if len(positions) < 2 or len(positions) != len(values):
            raise ValueError(
                f"a line spread table needs two positions or more and a value for each, got {len(positions)} positions "
                f"and {len(values)} values"
            )
        if not (np.all(np.isfinite(positions + values)) and np.all(np.diff(positions) > 0)):
            raise ValueError("a line spread table needs finite values at positions that increase: sort them")
        area = float(np.trapezoid(values, positions))
        if not area > 0:
            raise ValueError(f"a line spread function must have a positive integral, got {area:g}")
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "values", tuple(value / area for value in values))

    @property
    def half_width(self):
        """Distance from the pixel centre beyond which the response is zero. [m]"""
        return max(abs(self.positions[0]), abs(self.positions[-1]))

    def _cumulative(self, x):
        nodes, density = np.array(self.positions), np.array(self.values)
        area = np.concatenate([[0.0], np.cumsum(np.diff(nodes) * (density[1:] + density[:-1]) / 2)])
        x = np.clip(x, nodes[0], nodes[-1])
        index = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
        into = x - nodes[index]
        slope = (density[index + 1] - density[index]) / (nodes[index + 1] - nodes[index])
        return (area[index] + into * (density[index] + slope * into / 2)) / area[-1]

    def _mtf(self, frequency):
        nodes, density = np.array(self.positions), np.array(self.values)
        half = np.diff(nodes) / 2
        mean, rise = (density[1:] + density[:-1]) / 2, np.diff(density) / 2
        omega = 2 * np.pi * frequency[..., None]
        z = omega * half
        even, odd = 2 * mean * half * spherical_jn(0, z), 2 * rise * half * spherical_jn(1, z)
        transform = (np.exp(-1j * omega * (nodes[:-1] + half)) * (even - 1j * odd)).sum(axis=-1)
        symmetric = np.array_equal(nodes, -nodes[::-1]) and np.array_equal(density, density[::-1])
        return transform.real if symmetric else np.abs(transform)


@dataclass(frozen=True)
class AggregatedSpread(LineSpread):
    r"""
    Line spread function of samples that an instrument sums.

    .. math::

        C(x) = \frac{1}{n} \sum_{k=1}^{n} C_1(x - x_k), \qquad
        M(f) = M_1(f) \, \frac{1}{n} \sum_{k=1}^{n} \cos 2 \pi f x_k, \qquad x_k = \left(k - \tfrac{n + 1}{2}\right) d

    Parameters
    ----------
    sample : LineSpread
        Line spread function of one sample, C1 and M1.
    count : int
        Number n of samples.
    interval : float
        Distance d between them. [m]
    """

    sample: LineSpread
    count: int
    interval: float

    @property
    def half_width(self):
        """Distance from the pixel centre beyond which the response is zero. [m]"""
        return self.sample.half_width + float(self._places.max())

    @property
    def _places(self):
        """Centres of the samples. [m]"""
        return (np.arange(self.count) - (self.count - 1) / 2) * self.interval

    def _cumulative(self, x):
        return self.sample.cumulative(x[..., None] - self._places).mean(axis=-1)

    def _mtf(self, frequency):
        return self.sample.mtf(frequency) * np.cos(2 * np.pi * frequency[..., None] * self._places).mean(axis=-1)


# Samples of the tabulated response per equivalent width, and tried periods of the transform in equivalent widths. The
# response beyond half a period is aliased: for a response that decays as x^-2, about 1 % of the share that is truncated
# at a sixteenth of the period.
_SAMPLES = 128
_PERIODS = (64, 512, 4096, 16384)
_CUT = 16

# Transfer at the largest sampled frequency above which the response has jumps and cannot be tabulated.
_JUMP = 1e-3


@dataclass(frozen=True)
class Diffraction(Transfer):
    r"""
    Transfer function of a circular aperture without aberrations, a part of `SystemSpread`.

    .. math:: M(f) = \frac{2}{\pi} \left( \arccos \nu - \nu \sqrt{1 - \nu^2} \right), \qquad \nu = |f| / f_c \le 1

    Parameters
    ----------
    cutoff : float
        Frequency from which on nothing passes: aperture over the product of wavelength and altitude. [cycles m-1]

    References
    ----------
    [Goodman2005]_, section 6.3
    """

    cutoff: float

    def _mtf(self, frequency):
        nu = np.minimum(np.abs(frequency) / self.cutoff, 1.0)
        return 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))


@dataclass(frozen=True)
class LowPass(Transfer):
    r"""
    Transfer function of electronics, a Butterworth filter with corrected delay, a part of `SystemSpread`.

    .. math:: M(f) = \left[ 1 + (f / f_c)^{2 n} \right]^{-1/2}

    Parameters
    ----------
    cutoff : float
        Frequency at which the power is halved, on the ground. [cycles m-1]
    order : int, optional
        Number of poles.
    """

    cutoff: float
    order: int = 1

    def _mtf(self, frequency):
        return (1 + (frequency / self.cutoff) ** (2 * self.order)) ** -0.5


@dataclass(frozen=True)
class Mixture(Transfer):
    r"""
    Transfer function of a weighted sum of bands.

    .. math:: M(f) = \sum_s a_s \prod_k M_{sk}(f), \qquad \sum_s a_s = 1

    Parameters
    ----------
    shares : sequence of float
        Shares a of the bands. [1]
    parts : sequence
        For each band, objects with ``mtf(frequency)``.
    """

    shares: tuple
    parts: tuple

    def _mtf(self, frequency):
        return sum(share * _product(each, frequency) for share, each in zip(self.shares, self.parts, strict=True))


@dataclass(frozen=True)
class Difference(Transfer):
    r"""
    Transfer function from the image of one instrument to the image of another, a part of `SystemSpread`.

    .. math:: K(f) = M_t(f) \, \frac{M(f) \, (1 + \epsilon^2)}{M(f)^2 + \epsilon^2}

    It is the ratio of both transfers where the first instrument passes much more than the floor, and falls to zero
    where it passes less. Frequencies are amplified :math:`(1 + \epsilon^2) / 2 \epsilon` times at most.

    Parameters
    ----------
    target : Transfer
        The other instrument, Mt.
    recorded : Transfer
        The instrument that recorded the image, M.
    floor : float
        Floor epsilon, in (0, 1). [1]
    """

    target: Transfer
    recorded: Transfer
    floor: float

    def left(self, frequency):
        """Transfer of both images together relative to the target alone. [1]"""
        square = self.recorded.mtf(frequency) ** 2
        return square * (1 + self.floor**2) / (square + self.floor**2)

    def _mtf(self, frequency):
        recorded = self.recorded.mtf(frequency)
        return self.target.mtf(frequency) * recorded * (1 + self.floor**2) / (recorded**2 + self.floor**2)


@dataclass(frozen=True)
class SystemSpread(LineSpread):
    r"""
    Line spread function of a chain of parts, whose transfer functions are multiplied.

    .. math::

        w(x) = \int \prod_k M_k(f) \, e^{2 \pi i f x} \, df

    It is tabulated, linear between 128 samples over its equivalent width, and cut where little is left; its
    transfer function is the transform of the table. Diffraction of an aperture decays only as :math:`x^{-2}`, so
    a part is always left.

    Parameters
    ----------
    parts : sequence
        Objects with ``mtf(frequency)``: `Diffraction` or `GaussianSpread` for the optics, `LowPass` for the
        electronics, `fifesim.base.footprints.Boxcar` for the detector and for the smear of its motion.
    truncation : float, optional
        Largest share of the response that may be cut off. [1]

    References
    ----------
    [Schowengerdt2007]_, section 3.4
    """

    parts: tuple
    truncation: float = field(default=1e-3)

    def __post_init__(self):
        object.__setattr__(self, "parts", tuple(self.parts))
        if not 0 < self.truncation <= 0.1:
            raise ValueError(f"truncation must be in (0, 0.1], got {self.truncation}: it is a share of the response")
        _tabulate(self.parts, self.truncation)

    @property
    def table(self):
        """Tabulated line spread function."""
        return _tabulate(self.parts, self.truncation)[0]

    @property
    def truncated_share(self):
        """Truncated share of the response, by which the rest is rescaled. [1]"""
        return _tabulate(self.parts, self.truncation)[1]

    @property
    def half_width(self):
        """Distance from the pixel centre beyond which the response is taken as zero. [m]"""
        return self.table.half_width

    def _cumulative(self, x):
        return self.table.cumulative(x)

    def _mtf(self, frequency):
        return self.table.mtf(frequency)


def _product(parts, frequency):
    return np.prod([part.mtf(frequency) for part in parts], axis=0)


@cached(64, "tables of spatial responses")
def _tabulate(parts, truncation):
    """Table of the response, and the share beyond it."""
    width = _equivalent_width(parts)
    step = width / _SAMPLES
    left = np.inf
    for period in _PERIODS:
        density = _density(parts, step, period * _SAMPLES)
        # Half of the response at a distance of each sample and closer, the origin counted by half.
        within = step * (np.cumsum(density) - (density[0] + density) / 2)
        beyond = 1 - 2 * within[: 2 * density.size // _CUT]
        # The side lobes beyond must be small.
        small = np.maximum.accumulate(np.abs(beyond)[::-1])[::-1] <= truncation
        if small.any():
            last = max(int(small.argmax()), 1)
            half = np.append(density[:last], 0.0)
            positions = step * np.arange(-last, last + 1)
            return TableSpread(positions, np.concatenate([half[:0:-1], half])), float(abs(beyond[last]))
        left = float(abs(beyond[-1]))
    raise ValueError(
        f"the response of {parts} decays too slowly: {left:.1e} of it lies beyond {step * beyond.size:.0f} m, above "
        f"truncation = {truncation:g}; allow a larger truncation"
    )


def _equivalent_width(parts):
    """Effective instantaneous field of view: half of the period with a transfer of one half. [m]"""
    frequency = np.geomspace(1e-7, 1e3, 20001)
    mtf = _product(parts, frequency)
    if not (mtf[0] > 0.5 > mtf.min()):
        raise ValueError(f"the parts {parts} have no width between 0.5 mm and 5000 km")
    return 0.5 / frequency[np.argmax(mtf < 0.5)]


def _density(parts, step, samples):
    """Line spread function at 0, step, 2 step ... up to half the period of the transform."""
    frequency = np.arange(samples // 2 + 1) / (samples * step)
    product = _product(parts, frequency)
    if abs(product[-1]) > _JUMP:
        raise ValueError(
            f"the response of {parts} has jumps, which no table holds: use fifesim.base.footprints.Boxcar, or add the "
            "optics, the smear or the electronics"
        )
    # Lines between the samples multiply the transform by sinc squared.
    density = irfft(product / np.sinc(frequency * step) ** 2, samples) / step
    return density[: samples // 2]
