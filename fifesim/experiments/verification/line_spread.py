"""Checks of line spreads and of the transfer of an instrument's parts, by quadrature and closed forms."""

from functools import partial

import numpy as np
from scipy.integrate import quad
from scipy.signal import butter, freqs
from scipy.stats import norm

from fifesim.base.line_spread import Boxcar
from fifesim.experiments.verification.deviations import Deviation, integral, largest
from fifesim.sensor.description.instruments import instrument
from fifesim.sensor.response.spatial import CosineSpread, GaussianSpread, TableSpread
from fifesim.sensor.response.transfer import Diffraction, LowPass, SystemSpread

_deviation = partial(Deviation, "sensor")

_TABLE = (-31.0, -12.5, 4.0, 38.0), (0.0, 0.4, 1.0, -0.1)

# Line spread, density by its definition, where it has kinks, and what may be left: a Gaussian is cut, and a product is
# a table that rounds its kinks.
_SHAPES = {
    "cosine": (CosineSpread(30.0), lambda x: np.cos(2 * np.pi * x / 90.0), (-15.0, 15.0), 1e-9),
    "boxcar": (Boxcar(30.0), lambda x: 1.0 + 0 * x, (-15.0, 15.0), 1e-9),
    "Gaussian": (GaussianSpread(33.0), lambda x: 2.0 ** -((2 * x / 33.0) ** 2), (-85.0, 0.0, 85.0), 1e-8),
    "uneven table": (TableSpread(*_TABLE), lambda x: np.interp(x, *_TABLE), _TABLE[0], 1e-9),
    "even table": (
        TableSpread((-21.0, -9.0, 9.0, 21.0), (0.0, 1.0, 1.0, 0.0)),
        lambda x: np.minimum((21.0 - np.abs(x)) / 12.0, 1.0),
        (-21.0, -9.0, 9.0, 21.0),
        1e-9,
    ),
    "two boxcars": (
        SystemSpread((Boxcar(30.0), Boxcar(12.0)), 1e-9),
        lambda x: np.minimum((21.0 - np.abs(x)) / 12.0, 1.0),
        (-21.0, -9.0, 9.0, 21.0),
        2e-5,
    ),
}


def _transform(density, kinks, frequency):
    """Fourier transform of a density."""
    turn = 2 * np.pi * frequency
    even = integral(lambda x: density(x) * np.cos(turn * x), kinks)
    return even - 1j * integral(lambda x: density(x) * np.sin(turn * x), kinks)


def _shapes():
    """Shares up to a distance and transfers; what lies between the ends of the support is all."""
    ends = 0.0
    for name, (spread, density, kinks, bound) in _SHAPES.items():
        whole = integral(density, kinks)
        shares = [integral(density, [*(k for k in kinks if k < x), x]) / whole for x in (-14.0, 3.0, 14.5)]
        transfers = np.array([_transform(density, kinks, f) for f in (1 / 200, 1 / 60, 1 / 23)]) / whole
        # The modulus, where the response is not even.
        transfers = np.abs(transfers) if name == "uneven table" else transfers.real
        found = [*spread.cumulative([-14.0, 3.0, 14.5]), *spread.mtf([1 / 200, 1 / 60, 1 / 23])]
        worst = largest(found, [*shares, *transfers])
        yield _deviation(f"line spread and transfer, {name}", worst, bound, "1", "its density, quadrature")
        reach = spread.half_width
        ends = np.maximum(ends, largest(spread.cumulative([-reach - 1, -reach, reach, reach + 1]), [0, 0, 1, 1]))
    yield _deviation("line spreads between their ends", ends, 1e-12, "1", "theory")


def _parts():
    """An aperture's overlap with itself and its tail, the poles of a filter, and two Gaussians in one."""
    nu = np.array([0.0, 0.2, 0.55, 0.9, 1.3])
    overlap = [4 / np.pi * quad(lambda t: np.sqrt(1 - t * t), min(each, 1), 1)[0] for each in nu]
    worst = largest(Diffraction(0.4).mtf(-0.4 * nu), overlap)
    yield _deviation("transfer of an aperture", worst, 1e-9, "1", "overlap of two disks, quadrature")
    frequency = np.array([0.001, 0.01, 0.03])
    poles = [abs(freqs(*butter(n, 0.01, analog=True), frequency)[1]) for n in (1, 3)]
    worst = largest([LowPass(0.01, n).mtf(frequency) for n in (1, 3)], poles)
    yield _deviation("transfer of electronics", worst, 1e-12, "1", "poles, scipy.signal")
    system = SystemSpread((Diffraction(0.5), GaussianSpread(3.0)), 2e-3)
    tail = 4 / (np.pi**3 * 0.5 * system.half_width)
    worst = 100 * largest(system.truncated_share, tail, relative=True)
    yield _deviation("share of an aperture's response cut off", worst, 2.0, "%", "Struve's asymptote")
    both = SystemSpread((GaussianSpread(30.0), GaussianSpread(40.0)), 1e-6)
    x = np.linspace(-60.0, 60.0, 13)
    worst = largest(both.cumulative(x), norm.cdf(x, scale=50.0 / np.sqrt(8 * np.log(2))))
    yield _deviation("line spread of two Gaussians", worst, 1e-5, "1", "their variances add")


def _instruments():
    """Angles on the ground, and a transfer that was measured: 40.8 m is half of the period that passes by half."""
    tm, measured = instrument("TM"), instrument("L4TM").line_spread
    angles = tm.line_spread.width / (9 * 4.778e-6 * 705e3), tm.ground_interval / (43e-6 * 705e3)
    found = [*angles, measured.mtf(0.5 / 40.8) / 0.5]
    yield _deviation("TM's line spread on the ground", largest(found, 1), 1e-4, "1", "Schowengerdt et al. (1985)")
    at_nyquist = GaussianSpread.from_mtf(0.3, 30.0)
    worst = largest(at_nyquist.mtf(1 / 60), 0.3)
    yield _deviation("Gaussian of a given transfer", worst, 1e-12, "1", "its definition")


CHECKS = (_shapes, _parts, _instruments)
