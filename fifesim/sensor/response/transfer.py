"""Transfer functions of an instrument's parts, and the line spread function of their product."""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.fft import irfft

from fifesim.base.line_spread import LineSpread, Transfer
from fifesim.sensor.response.spatial import TableSpread

# Samples of the tabulated response over its equivalent width, and the periods of the transform that are tried, in the
# same widths. What lies beyond half a period folds back into it: of a response that decays as x^-2 about 1 % of the
# share that is cut at a sixteenth of the period.
_SAMPLES = 128
_PERIODS = (64, 512, 4096, 16384)
_CUT = 16

# Share of a sinusoid at the end of the sampled frequencies above which the response has jumps that no table holds.
_JUMP = 1e-3


@dataclass(frozen=True)
class CutoffTransfer(Transfer):
    """
    Transfer function that a frequency describes.

    Parameters
    ----------
    cutoff : float
        [cycles m-1]

    Raises
    ------
    ValueError
        If the frequency is not positive.
    """

    cutoff: float

    def __post_init__(self):
        if not 0 < self.cutoff < np.inf:
            raise ValueError(f"cutoff must be a positive number of cycles per metre, got {self.cutoff}")


@dataclass(frozen=True)
class Diffraction(CutoffTransfer):
    r"""
    Transfer function of a circular aperture without aberrations, to be a part of `SystemSpread`.

    .. math:: M(f) = \frac{2}{\pi} \left( \arccos \nu - \nu \sqrt{1 - \nu^2} \right), \qquad \nu = |f| / f_c \le 1

    Parameters
    ----------
    cutoff : float
        Frequency from which on nothing passes: aperture over the product of wavelength and altitude. [cycles m-1]

    Raises
    ------
    ValueError
        If the frequency is not positive.

    References
    ----------
    [Goodman2005]_, section 6.3
    """

    def _mtf(self, frequency):
        nu = np.minimum(np.abs(frequency) / self.cutoff, 1.0)
        return 2 / np.pi * (np.arccos(nu) - nu * np.sqrt(1 - nu**2))


@dataclass(frozen=True)
class LowPass(CutoffTransfer):
    r"""
    Transfer function of electronics, a Butterworth filter whose delay is corrected; a part of `SystemSpread`.

    .. math:: M(f) = \left[ 1 + (f / f_c)^{2 n} \right]^{-1/2}

    Parameters
    ----------
    cutoff : float
        Frequency at which the power is halved, on the ground. [cycles m-1]
    order : int, optional
        Number of poles.

    Raises
    ------
    ValueError
        If the frequency or the order is not positive.
    """

    order: int = 1

    def __post_init__(self):
        super().__post_init__()
        if self.order < 1:
            raise ValueError(f"order must be at least 1, got {self.order}: it is the number of poles")

    def _mtf(self, frequency):
        return (1 + (frequency / self.cutoff) ** (2 * self.order)) ** -0.5


@dataclass(frozen=True)
class SystemSpread(LineSpread):
    r"""
    Line spread function of a chain of parts, whose transfer functions are multiplied.

    .. math::

        w(x) = \int \prod_k M_k(f) \, e^{2 \pi i f x} \, df

    It is tabulated, linear between 128 samples over its equivalent width, and cut where little is left; its own
    transfer function is that of the table. The diffraction of an aperture decays as :math:`x^{-2}` alone, so that some
    always is left.

    Parameters
    ----------
    parts : sequence
        Objects with ``mtf(frequency)``: `Diffraction` or `GaussianSpread` for the optics, `LowPass` for the
        electronics, `fifesim.base.line_spread.Boxcar` for the detector and for the smear of its motion.
    truncation : float, optional
        Largest share of the response that may be cut off. [1]

    Raises
    ------
    ValueError
        If there is no part, the truncation is not in (0, 0.1], the product has jumps, as that of one boxcar alone, or
        decays too slowly to be cut there.

    References
    ----------
    [Schowengerdt2007]_, section 3.4

    Examples
    --------
    >>> from fifesim.base.line_spread import Boxcar
    >>> spread = SystemSpread((Diffraction(0.86), Boxcar(30.0), Boxcar(9.0), LowPass(0.05)))
    >>> bool(spread.truncated_share < 1e-3), round(float(spread.cumulative(0.0)), 12)
    (True, 0.5)
    """

    parts: tuple
    truncation: float = field(default=1e-3)

    def __post_init__(self):
        object.__setattr__(self, "parts", tuple(self.parts))
        if not self.parts or not all(hasattr(part, "mtf") for part in self.parts):
            raise ValueError(f"parts must be at least one, each with an mtf, got {self.parts}")
        if not 0 < self.truncation <= 0.1:
            raise ValueError(f"truncation must be in (0, 0.1], got {self.truncation}: it is a share of the response")
        _tabulate(self.parts, self.truncation)

    @property
    def table(self):
        """The line spread function as a `fifesim.sensor.response.spatial.TableSpread`."""
        return _tabulate(self.parts, self.truncation)[0]

    @property
    def truncated_share(self):
        """Share of the response that was cut off, for which the rest is scaled [1]."""
        return _tabulate(self.parts, self.truncation)[1]

    @property
    def half_width(self):
        """Distance from the pixel centre beyond which the response is taken as zero [m]."""
        return self.table.half_width

    def _cumulative(self, x):
        return self.table.cumulative(x)

    def _mtf(self, frequency):
        return self.table.mtf(frequency)

    def product(self, frequency):
        """
        Product of the parts' modulation transfer functions, from which `mtf` differs by what was cut.

        Parameters
        ----------
        frequency : array
            Spatial frequency. [cycles m-1]

        Returns
        -------
        mtf : array, shape of frequency
            [1]
        """
        return _product(self.parts, frequency)


def _product(parts, frequency):
    return np.prod([part.mtf(frequency) for part in parts], axis=0)


@lru_cache(maxsize=64)
def _tabulate(parts, truncation):
    """Table of the response, and the share that lies beyond it."""
    width = _equivalent_width(parts)
    step = width / _SAMPLES
    left = np.inf
    for period in _PERIODS:
        density = _density(parts, step, period * _SAMPLES)
        # Half of the response at a distance of each sample and closer, the origin counted by half.
        within = step * (np.cumsum(density) - (density[0] + density) / 2)
        beyond = 1 - 2 * within[: 2 * density.size // _CUT]
        # Lobes: what lies beyond must stay small.
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
    """Half of the period that the parts let pass by half: the effective instantaneous field of view [m]."""
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
            f"the response of {parts} has jumps, which no table holds: use fifesim.base.line_spread.Boxcar, or add the "
            "optics, the smear or the electronics"
        )
    # Lines between the samples multiply the transform by sinc squared.
    density = irfft(product / np.sinc(frequency * step) ** 2, samples) / step
    return density[: samples // 2]
