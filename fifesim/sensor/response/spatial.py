"""
Line spread functions of sensors (Eq. 3), as `fifesim.base.footprints` takes them.

Here stand the cosine of the paper, the Gaussian and a measured table; `fifesim.base.line_spread.Boxcar` is another, and
`fifesim.sensor.response.transfer` makes one of the parts of an instrument. A footprint takes one for its rows, along
the track, and one for its columns, across the track. Each shape holds its integral C and the transform M of its
density w.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr, spherical_jn

from fifesim.base.line_spread import FiniteSpread, LineSpread

# Standard deviations at which a Gaussian is cut: 2e-9 of it lie beyond.
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

    Examples
    --------
    Half of the response lies before the centre:

    >>> float(CosineSpread(30.0).cumulative(0.0))
    0.5
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

    Raises
    ------
    ValueError
        If the width is not positive.

    Examples
    --------
    >>> spread = GaussianSpread(30.0)
    >>> round(float(spread.cumulative(15.0) - spread.cumulative(-15.0)), 3)
    0.761
    """

    fwhm: float

    def __post_init__(self):
        self._check_width(self.fwhm)

    @classmethod
    def from_mtf(cls, mtf_at_nyquist, interval):
        r"""
        The Gaussian with a given modulation transfer at the Nyquist frequency of a sampling interval d.

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

        Raises
        ------
        ValueError
            If the transfer is not in (0, 1), or the interval not positive.

        Examples
        --------
        >>> round(float(GaussianSpread.from_mtf(0.3, 30.0).mtf(1 / 60)), 12)
        0.3
        """
        if not 0 < mtf_at_nyquist < 1:
            raise ValueError(f"mtf_at_nyquist must be in (0, 1), got {mtf_at_nyquist}: it is a share, not percent")
        cls._check_width(interval)
        return cls(float(np.sqrt(-16 * np.log(2) * np.log(mtf_at_nyquist)) * interval / np.pi))

    @property
    def sigma(self):
        """Standard deviation [m]."""
        return self.fwhm / np.sqrt(8 * np.log(2))

    @property
    def half_width(self):
        """Distance from the pixel centre beyond which the response is taken as zero [m]."""
        return _GAUSSIAN_REACH * self.sigma

    @property
    def truncated_share(self):
        """Share of the Gaussian that lies beyond the half width, for which the rest is scaled [1]."""
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

    Raises
    ------
    ValueError
        If the positions do not increase, a value is not finite, or the integral is not positive.

    Examples
    --------
    A triangle:

    >>> float(TableSpread([-30, 0, 30], [0, 1, 0]).cumulative(-15.0))
    0.125
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
        """Distance from the pixel centre beyond which the response is zero [m]."""
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
