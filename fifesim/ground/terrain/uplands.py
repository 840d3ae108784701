"""Uplands between four rivers, into which streams have cut trees of valleys."""

import threading
from functools import lru_cache

import numpy as np

from fifesim.base.seeds import generator
from fifesim.ground.terrain.spline import REACH, spline_coefficients
from fifesim.ground.terrain.spline_noise import noise_square
from fifesim.ground.terrain.streams import StreamPower, erode, least_ways

# An upland is a square of nodes between rivers. [m]
NODES = 181
NODE = 45.0
UPLAND = (NODES - 1) * NODE

STREAMS = StreamPower(steps=40, area_exponent=0.519, uplift=751.0, creep=5000.0, node=NODE)
ERODIBILITY = 4.68  # mean, for areas in m2

# Standard deviations of the logarithms, and lattice steps [m], of the noise in erodibility and in the cost of a way to
# a river, which lays out the first streams; and that of the preference for one of eight neighbours.
ERODIBILITY_NOISE = ((0.077, 2400.0), (0.09, 208.0))
WAY_NOISE = ((0.286, 1050.0), (0.622, 150.0))
PREFERENCE_NOISE = 0.104

# Before uplift: elevation and its rise with the cost of the way to a river. Rivers lie at the base, and in the valleys
# that join two of them the saddle is higher. [m], [1], [m], [m]
START = 345.0
TILT = 0.00077
BASE = 335.0
SADDLE = 63.0

# Stream of random numbers, beside those of the hills.
_STREAM = 80

_lock = threading.Lock()


def upland(seed, line, column):
    """
    Spline coefficients of the eroded ground between four rivers.

    Parameters
    ----------
    seed : int
    line, column : int
        Place in the net of rivers.

    Returns
    -------
    coefficients : array, shape (NODES + 2 REACH, NODES + 2 REACH)
        Mirrored at points of the rivers, so that both sides meet there. [m]
    """
    # Threads that want the same upland wait for the one that makes it.
    with _lock:
        return _upland(seed, line, column)


# Those within reach of three landscapes of chips, in 20 MB.
@lru_cache(maxsize=64)
def _upland(seed, line, column):
    drawn = generator(seed, _STREAM, (0, 0, line, column))
    erodibility, cost = (
        np.exp(sum(size * noise_square(drawn, NODE / step, NODES) for size, step in noise))
        for noise in (ERODIBILITY_NOISE, WAY_NOISE)
    )
    preference = np.exp(PREFERENCE_NOISE * drawn.standard_normal((8, NODES * NODES)))
    ground = START + TILT * NODE * least_ways(cost)
    valley = BASE + SADDLE * (1 - np.abs(np.linspace(-1, 1, NODES))) ** 0.6
    ground[0] = ground[-1] = BASE
    ground[:, 0] = ground[:, -1] = valley
    ground = erode(ground, ERODIBILITY * erodibility, preference, STREAMS)
    coefficients = spline_coefficients(np.pad(ground, 2 * REACH, mode="reflect", reflect_type="odd"))
    return coefficients[REACH:-REACH, REACH:-REACH]
