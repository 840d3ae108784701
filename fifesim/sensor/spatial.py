"""Line spread functions of sensors (Eq. 3), as `fifesim.footprints` takes them."""

from dataclasses import dataclass

import numpy as np

from fifesim.footprints import check_width


@dataclass(frozen=True)
class CosineSpread:
    r"""
    Cosine line spread function truncated at half its amplitude.

    .. math:: w(x) = \cos\frac{2 \pi x}{3 W}, \qquad |x| \le W / 2

    Parameters
    ----------
    width : float
        Width W of the support. [m]

    Raises
    ------
    ValueError
        If the width is not positive.

    References
    ----------
    [Friedl1995]_, Table 1, note a

    Examples
    --------
    Half of the response lies before the centre:

    >>> float(CosineSpread(30.0).cumulative(0.0))
    0.5
    """

    width: float

    def __post_init__(self):
        check_width(self.width)

    @property
    def half_width(self):
        """Distance from the pixel centre beyond which the response is zero [m]."""
        return self.width / 2

    def cumulative(self, x):
        r"""
        Share of the response that lies before a distance from the pixel centre.

        .. math:: C(x) = \frac{1}{2} + \frac{1}{\sqrt{3}} \sin\frac{2 \pi x}{3 W}

        Parameters
        ----------
        x : array
            Distance from the pixel centre. [m]

        Returns
        -------
        share : array, shape of x
            0 before the support, 1 behind it. [1]
        """
        x = np.clip(x, -self.half_width, self.half_width)
        return 0.5 + np.sin(2 * np.pi * x / (3 * self.width)) / np.sqrt(3)

    def mtf(self, frequency):
        r"""
        Modulation transfer function, the Fourier transform of the line spread function.

        .. math::

            M(f) = \frac{\pi}{3 \sqrt{3}} \left[ \mathrm{sinc}\left(\frac{1}{3} - f W\right)
                + \mathrm{sinc}\left(\frac{1}{3} + f W\right) \right],
            \qquad \mathrm{sinc}\,t = \frac{\sin \pi t}{\pi t}

        Parameters
        ----------
        frequency : array
            Spatial frequency. [cycles m-1]

        Returns
        -------
        mtf : array, shape of frequency
            Factor by which a sinusoid's amplitude is reduced. [1]
        """
        phase = np.asarray(frequency, float) * self.width
        return np.pi / (3 * np.sqrt(3)) * (np.sinc(1 / 3 - phase) + np.sinc(1 / 3 + phase))
