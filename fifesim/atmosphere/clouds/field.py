"""
Cloud field as a function of seed and place, and the displacement of clouds and shadows.

A standard normal field is the sum of six octaves of cubic B-splines over white noise, with the variances of a spectrum
of slope -5/3. It repeats every 100 km, so that its threshold meets the cover on each such square. Places are whole
millimetres, so that a window, another chunk or another cell size has the same clouds.
"""

from typing import NamedTuple

import numpy as np
from scipy import optimize, special
from scipy.interpolate import BSpline

from fifesim.base.arrays import compiled
from fifesim.base.caches import cached
from fifesim.base.lattice import generator

PERIOD = 100_000_000  # [mm]
_OCTAVES = 6
_SLOPE = 2 / 3  # exponent of the structure function of water in clouds, a spectrum of -5/3 [Cahalan1989]_ [1]
_LARGEST_LATTICE = 512  # finer noise repeats within the period
_STREAM = 2**45  # of the noise of clouds, see `base.lattice`
_SAMPLES = 400  # cells along the period at which the threshold is found
_RANKS = 400  # quantiles of the thickness
_PRACTICAL_RANGE = 0.05  # correlation at the correlation length, as of the landscapes [1]


def cloud_displacement(height, sza, saa, vza, vaa):
    r"""
    Displacement of a cloud's shadow, and of its image on the ground, from the place below the cloud.

    .. math::

        (e, n)_\mathrm{shadow} = -h \tan \theta_s \, (\sin \varphi_s, \cos \varphi_s), \qquad
        (e, n)_\mathrm{image} = -h \tan \theta_v \, (\sin \varphi_v, \cos \varphi_v)

    Parameters
    ----------
    height : array
        Height of the cloud above level ground, :math:`h`. [m]
    sza, saa, vza, vaa : array
        Zenith and azimuth angles of sun and sensor. [degree]

    Returns
    -------
    shadow_east, shadow_north, image_east, image_north : array
        [m]

    Examples
    --------
    The sun in the south throws the shadow north:

    >>> [round(float(each), 6) + 0 for each in cloud_displacement(1000.0, 45.0, 180.0, 0.0, 0.0)]
    [0.0, 1000.0, 0.0, 0.0]
    """
    angles = np.radians(np.broadcast_arrays(sza, saa, vza, vaa))
    shadow, image = (-np.asarray(height, float) * np.tan(angles[k]) for k in (0, 2))
    return shadow * np.sin(angles[1]), shadow * np.cos(angles[1]), image * np.sin(angles[3]), image * np.cos(angles[3])


class CloudCover(NamedTuple):
    """Statistics of a cloud field."""

    cover: float  # share of the area, 0 to 1 [1]
    thickness: tuple[float, float]  # mean and standard deviation of the optical thickness within clouds [1]
    length: float  # correlation length [m]
    seed: int
    day: int = 0  # days with independent skies


def cloud_thickness(clouds, northing, easting, largest=100.0):
    r"""
    Optical thickness of a cloud field at the rows and columns of a grid.

    .. math:: \tau = \exp(\mu + \sigma \Phi^{-1}(u)), \qquad u = \frac{F(z) - (1 - c)}{c}

    where the field :math:`z`, with distribution :math:`F`, exceeds its quantile :math:`1 - c`, and 0 elsewhere.

    Parameters
    ----------
    clouds : CloudCover
        Cover :math:`c`; the mean and standard deviation of :math:`\tau` determine :math:`\mu` and :math:`\sigma`.
    northing, easting : array of int, shape (rows,), (columns,)
        [mm]
    largest : float, optional
        Thicker clouds are cut to this thickness. [1]

    Returns
    -------
    thickness : array, shape (rows, columns)
        Lognormal within clouds, without the outermost 0.1 % on each side. [1]

    Examples
    --------
    >>> sky = CloudCover(0.3, (8.0, 8.0), 2000.0, 7)
    >>> place = np.arange(0, PERIOD, PERIOD // 100)
    >>> round(float((cloud_thickness(sky, place, place) > 0).mean()), 1)
    0.3
    """
    if clouds.cover == 0:
        return np.zeros((len(northing), len(easting)))
    field = _normal_field(clouds, northing, easting)
    threshold, nodes, scores = _quantiles(clouds)
    mean, deviation = clouds.thickness
    spread = np.log1p((deviation / mean) ** 2)
    out, inside = np.zeros(field.shape), field > threshold
    logarithm = np.log(mean) - spread / 2 + np.sqrt(spread) * np.interp(field[inside], nodes, scores)
    out[inside] = np.minimum(np.exp(logarithm), largest)
    return out


@cached(8, "thresholds of cloud fields")
def _quantiles(clouds):
    """Threshold of the field, and its quantiles within clouds with their normal scores."""
    place = (2 * np.arange(_SAMPLES) + 1) * (PERIOD // (2 * _SAMPLES))
    sample = np.sort(_normal_field(clouds, place, place), axis=None)
    first = min(round((1 - clouds.cover) * sample.size), sample.size - 1)
    rank = (np.arange(_RANKS) + 0.5) / _RANKS
    threshold = sample[first - 1] if first else -np.inf
    return threshold, np.quantile(sample[first:], rank), special.ndtri(rank)


def correlation(distance):
    """Correlation of the field at distances in spacings of its coarsest lattice. [1]"""
    spline = BSpline.basis_element(np.arange(-4.0, 5.0), extrapolate=False)
    shares, finer = _shares(), 2.0 ** np.arange(_OCTAVES)
    values = np.nan_to_num(spline(np.multiply.outer(distance, finer))) / spline(0.0)
    return values @ shares


def _shares():
    """Shares of the octaves in the variance, coarsest first, shape (octaves,). [1]"""
    shares = 2.0 ** (-_SLOPE * np.arange(_OCTAVES))
    return shares / shares.sum()


@cached(8, "lattices of cloud fields")
def _lattices(length, seed, day):
    """Noise of each octave, its number of lattice cells along the period, and its standard deviation."""
    spacings = optimize.brentq(lambda distance: correlation(distance) - _PRACTICAL_RANGE, 0.1, 4.0)
    coarsest = max(round(PERIOD / 1000 * spacings / length), 1)
    found = []
    for octave, share in enumerate(_shares()):
        count = coarsest * 2**octave
        size = count
        while size > max(_LARGEST_LATTICE, coarsest):
            size //= 2
        noise = generator(seed, _STREAM, (day, octave, 0, 0)).standard_normal((size, size))
        found.append((noise, count, np.sqrt(share)))
    return found


def _normal_field(clouds, northing, easting):
    """Standard normal field at rows and columns, shape (rows, columns). [1]"""
    total = np.zeros((len(northing), len(easting)))
    for noise, count, deviation in _lattices(clouds.length, clouds.seed, clouds.day):
        rows, down = _spline(northing, count)
        columns, across = _spline(easting, count)
        _add_octave(noise, rows, columns, deviation * down, across, total)
    return total


@compiled
def _add_octave(noise, rows, columns, down, across, total):
    """Add one octave to the cells, along the rows of the lattice first."""
    size, lines, made = len(noise), np.empty((4, columns.size)), np.full(4, -1)
    for i in range(rows.size):
        for k in range(4):
            row = rows[i] + k
            if made[row % 4] != row:
                made[row % 4] = row
                for j in range(columns.size):
                    value = 0.0
                    for m in range(4):
                        value += across[m, j] * noise[row % size, (columns[j] + m) % size]
                    lines[row % 4, j] = value
        l0, l1, l2, l3 = (
            lines[rows[i] % 4],
            lines[(rows[i] + 1) % 4],
            lines[(rows[i] + 2) % 4],
            lines[(rows[i] + 3) % 4],
        )
        w0, w1, w2, w3 = down[0, i], down[1, i], down[2, i], down[3, i]
        for j in range(columns.size):
            total[i, j] += w0 * l0[j] + w1 * l1[j] + w2 * l2[j] + w3 * l3[j]


def _spline(place, count):
    """First of four lattice nodes for each place, and weights of variance 1, shape (4, places)."""
    node, rest = np.divmod(np.asarray(place, np.int64) % PERIOD * count, PERIOD)
    share = rest / PERIOD
    rest = 1 - share
    weights = [rest**3, 4 + share**2 * (3 * share - 6), 4 + rest**2 * (3 * rest - 6), share**3]
    weights = np.array(weights)
    return node, weights / np.sqrt((weights**2).sum(axis=0))
