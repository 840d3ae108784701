"""How much of the sky, and of the land around, a slope sees."""

import numpy as np
from numba import njit
from numba.extending import register_jitable

from fifesim.ground.terrain.slope import Vector, along_normal, slope_cosine

# Of Gregory's series of the arctangent of a quarter of an angle: an angle of 90 degrees is good to 2e-14 of it, one
# of 60 to the last digit.
_TERMS = 16

# Places of which the sky is found together.
_PLACES = 512


def sky_vector(tangents, directions, east, north):
    r"""
    The part of the sky that a slope sees, as a vector.

    .. math::

        \mathbf{F} = \frac{1}{\pi} \int_{\text{sky}} \boldsymbol\omega \, d\omega
            = \frac{1}{2\pi} \oint \boldsymbol\Gamma \, d\Theta

    The sky factor of a surface with the unit normal n is :math:`V_d = \mathbf{n} \cdot \mathbf{F}`, which is
    Eq. 7b of Dozier and Frew. The sky is bounded by the horizon, taken as great circles between the directions, and by
    the plane of the slope; Lambert's integral along great circles is exact.

    Parameters
    ----------
    tangents : array, shape (direction, ...)
        cot H of the horizon of the land around. [1]
    directions : array, shape (direction,)
        Evenly spaced azimuths, clockwise from north. [degree]
    east, north : array, shape (...)
        Gradient of the slope itself, which gives its own horizon. NaN is level. [m m-1]

    Returns
    -------
    vector : array, shape (3, ...)
        Eastward, northward and up. [1]

    References
    ----------
    [Lambert1760]_; [DozierFrew1990]_, Eqs. 7b and 10
    """
    tangents = np.ascontiguousarray(tangents, float)
    azimuth = np.radians(np.asarray(directions, float))
    shape = tangents.shape[1:]
    own = [np.nan_to_num(np.broadcast_to(each, shape), nan=0.0).ravel() for each in (east, north)]
    out = np.zeros((3, own[0].size))
    _sky_vector(tangents.reshape(azimuth.size, -1), np.sin(azimuth), np.cos(azimuth), *own, out)
    return out.reshape(3, *shape)


@register_jitable
def sky_factor(vector, east, north):
    r"""
    Sky view factor: diffuse light from a uniform sky on a slope over that on an open plain.

    .. math:: V_d = \mathbf{n} \cdot \mathbf{F}, \qquad 0 \le V_d \le \frac{1 + \cos S}{2}

    Parameters
    ----------
    vector : fifesim.ground.terrain.slope.Vector
        Of `sky_vector`, of this slope or of one nearby. [1]
    east, north : array
        Gradient of the slope. [m m-1]

    Returns
    -------
    sky_view : array
        Not above that of a wide plane of the slope. [1]

    References
    ----------
    [DozierFrew1990]_, Eq. 7b

    Examples
    --------
    >>> float(sky_factor(Vector(0.0, 0.0, 0.75), 0.0, 0.0))
    0.75
    """
    return np.maximum(np.minimum(along_normal(vector, east, north), (1 + slope_cosine(east, north)) / 2), 0.0)


def sky_view(tangents, directions, east, north):
    r"""
    Sky view factor of slopes under a known horizon.

    .. math::

        V_d = \frac{1}{2\pi} \int_0^{2\pi} \left[ \cos S \sin^2 H
            + \sin S \cos(\phi - A) \, (H - \sin H \cos H) \right] d\phi

    with H the lower of the zenith angles of the horizon of the land around, of the slope's own, and 90 degrees.

    Parameters
    ----------
    tangents, directions, east, north
        As in `sky_vector`.

    Returns
    -------
    sky_view : array, shape (...)
        1 on an open plain. [1]

    Notes
    -----
    The integral is exact for a horizon of great circles between the directions, such as that of any plane.

    References
    ----------
    [DozierFrew1990]_, Eq. 7b

    Examples
    --------
    A wide plane of 60 degrees sees (1 + cos 60) / 2:

    >>> round(float(sky_view(np.zeros(16), np.arange(16) * 22.5, np.sqrt(3.0), 0.0)), 12)
    0.75
    """
    return sky_factor(Vector(*sky_vector(tangents, directions, east, north)), east, north)


@register_jitable
def terrain_view(sky_view, cosine):
    r"""
    Terrain configuration factor: the share of a slope's view that land takes, so far as the plane of the slope is open.

    .. math:: C_t = \frac{1 + \cos S}{2} - V_d

    Parameters
    ----------
    sky_view : array
        [1]
    cosine : array
        Of the slope. [1]

    Returns
    -------
    terrain_view : array
        0 on any wide plane. [1]

    References
    ----------
    [DozierFrew1990]_, Eq. 9b

    Examples
    --------
    >>> terrain_view(0.75, 1.0)
    0.25
    """
    return (1 + cosine) / 2 - sky_view


@njit(nogil=True, cache=True)
def _sky_vector(tangents, sin, cos, east, north, out):
    count = tangents.shape[0]
    # So many places at a time that all of theirs stays near the processor.
    for first in range(0, out.shape[1], _PLACES):
        part = slice(first, min(first + _PLACES, out.shape[1]))
        for k in range(count):
            n = (k + 1) % count
            here, there = Vector(sin[k], cos[k], 0.0), Vector(sin[n], cos[n], 0.0)
            found = Vector(out[0, part], out[1, part], out[2, part])
            _add_sector(tangents[k, part], tangents[n, part], here, there, east[part], north[part], found)


@njit(nogil=True, cache=True, error_model="numpy")
def _add_sector(tangents, next_tangents, toward, next_toward, east, north, out):
    """Lambert's terms of the edge of the sky from one direction to the next."""
    for cell in range(east.size):
        land, next_land = tangents[cell], next_tangents[cell]
        own = east[cell] * toward.x + north[cell] * toward.y
        next_own = east[cell] * next_toward.x + north[cell] * next_toward.y
        here = Vector(toward.x, toward.y, land if land > own else own)
        there = Vector(next_toward.x, next_toward.y, next_land if next_land > next_own else next_own)
        # The slope's plane and the land's horizon may cross in between; elsewhere the first arc has no length.
        across = (land - own) * (next_land - next_own) < 0
        w, v = abs(next_land - next_own) if across else 1.0, abs(land - own) if across else 0.0
        height = w * land + v * next_land if across else here.z
        crossing = Vector(w * toward.x + v * next_toward.x, w * toward.y + v * next_toward.y, height)
        one, other = _arc(here, crossing), _arc(crossing, there)
        out.x[cell] += one.x + other.x
        out.y[cell] += one.y + other.y
        out.z[cell] += one.z + other.z


@register_jitable
def _arc(a, b):
    """Lambert's term of the great circle from a to b, clockwise seen from above: its angle times its normal."""
    x, y, z = b.y * a.z - b.z * a.y, b.z * a.x - b.x * a.z, b.x * a.y - b.y * a.x
    # Of the angle from a to b, times the lengths of both.
    squared_sine, cosine = x * x + y * y + z * z, a.x * b.x + a.y * b.y + a.z * b.z
    # Tangents of its half and its quarter, over the sine, which may be 0.
    half = 1 / (np.sqrt(squared_sine + cosine * cosine) + cosine)
    quarter = half / (1 + np.sqrt(1 + squared_sine * half * half))
    square, series = squared_sine * quarter * quarter, 0.0
    for k in range(_TERMS - 1, -1, -1):
        series = 1 / (2 * k + 1) - square * series
    factor = 4 * quarter * series / (2 * np.pi)
    return Vector(factor * x, factor * y, factor * z)
