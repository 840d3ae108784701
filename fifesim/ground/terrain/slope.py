"""Gradient, slope and aspect of elevation, with its units, and the light on a slope (Equations 4 and 5)."""

from typing import NamedTuple

import numpy as np

from fifesim.base.arrays import compiled, jitable

# Metres in one unit of elevation, and names that files use for it. NIST SP 811, App. B.8: the two feet differ by 2e-6.
_UNITS = {
    "m": (1.0, "metre", "metres", "meter", "meters"),
    "ft": (0.3048, "foot", "feet", "international foot", "foot (international)"),
    "us-ft": (1200.0 / 3937.0, "us survey foot", "us survey feet", "survey foot", "ftus", "foot us", "us foot"),
    "km": (1000.0, "kilometre", "kilometer"),
    "dm": (0.1, "decimetre", "decimeter"),
    "cm": (0.01, "centimetre", "centimeter"),
    "mm": (0.001, "millimetre", "millimeter"),
}

# Above this share of neighbours that are equal, whole numbers are terraces: their risers show in slope and aspect.
TERRACES = 0.25


def metres_per_unit(name):
    """Length of a unit of elevation, by the spelling of files and coordinate reference systems. [m]"""
    plain = str(name).strip().lower().replace("_", " ")
    for unit, (metres, *names) in _UNITS.items():
        if plain in (unit, *names):
            return metres
    raise ValueError(f"vertical units must be one of {', '.join(_UNITS)}, got {name!r}")


def terrace_step(values):
    """Vertical resolution of terraced whole-number elevations, None for elevations without terraces."""
    # The greatest common divisor of the differences, where along both axes more than a quarter of the neighbours are
    # equal, and some are not. A plane along one axis has equal neighbours along the other.
    both = [np.diff(values, axis=axis) for axis in (0, 1)]
    both = [each[np.isfinite(each)] for each in both]
    differences, known = np.concatenate(both), values[np.isfinite(values)]
    if not known.size or not differences.any() or np.any(known != np.rint(known)):
        return None
    equal = min(np.mean(each == 0) if each.size else 1.0 for each in both)
    return int(np.gcd.reduce(np.abs(differences).astype(np.int64))) if equal > TERRACES else None


def bilinear(layer, rows, columns):
    """Bilinear interpolation between places, constant after the last place, shape (rows, columns)."""
    (row, down), (column, across) = rows, columns
    out = np.empty((row.size, column.size))
    _bilinear(np.asarray(layer, float), row, down, column, across, out)
    return out


@compiled
def _bilinear(layer, row, down, column, across, out):
    line = np.empty(layer.shape[1])
    last = layer.shape[0] - 1, layer.shape[1] - 1
    for i in range(row.size):
        one, other = row[i], min(row[i] + 1, last[0])
        share = down[i]
        for k in range(line.size):
            line[k] = layer[one, k] * (1 - share) + layer[other, k] * share
        for j in range(column.size):
            before = column[j]
            out[i, j] = line[before] * (1 - across[j]) + line[min(before + 1, last[1])] * across[j]


class Vector(NamedTuple):
    """Components eastward, northward and up; each a number or an array."""

    x: float
    y: float
    z: float


@jitable
def rise(low, here, high):
    """Rise of the ground over two cells, by the other half if an end is missing, 0 if both are. [m]"""
    before = 2 * here - high if np.isnan(low) else low
    after = 2 * here - low if np.isnan(high) else high
    return 0.0 if np.isnan(after - before) else after - before


def gradient(dem, cell_y, cell_x, rows=None, columns=None):
    r"""
    Rise of the ground eastward and northward.

    .. math::

        \frac{\partial z}{\partial x} = \frac{z_{j+1} - z_{j-1}}{2 \Delta x}, \qquad
        \frac{\partial z}{\partial y} = \frac{z_{i-1} - z_{i+1}}{2 \Delta y}

    Parameters
    ----------
    dem : array, shape (rows + 2, columns + 2)
        Elevation, north up, with a margin of one cell. [m]
    cell_y, cell_x : float
        [m]
    rows, columns : array of int, optional
        Rows and columns of the result, counted with the margin; by default all cells inside of it.

    Returns
    -------
    east, north : array, shape (rows, columns)
        [m m-1]

    Notes
    -----
    Where a neighbour is NaN the difference is one-sided, as if the ground went on straight; a NaN cell gives NaN.
    """
    dem = np.ascontiguousarray(dem, float)
    rows = np.arange(1, dem.shape[0] - 1) if rows is None else np.asarray(rows)
    columns = np.arange(1, dem.shape[1] - 1) if columns is None else np.asarray(columns)
    out = np.empty((2, rows.size, columns.size))
    _gradient(dem, rows, columns, 2 * cell_y, 2 * cell_x, out)
    return out[0], out[1]


@jitable
def slope_cosine(east, north):
    r"""Cosine of a slope from its gradient [m m-1]: :math:`\cos S = (1 + |\nabla z|^2)^{-1/2}`. [1]"""
    return 1 / np.sqrt(1 + east * east + north * north)


@jitable
def along_normal(vector, east, north):
    r"""
    Component of a vector along the normal of a slope, negative where the slope faces away. [unit of the vector]
    :math:`\mathbf{n} \cdot \mathbf{v} = \left( v_z - \frac{\partial z}{\partial x} v_x - \frac{\partial z}{\partial y}
    v_y \right) \cos S`. For the unit vector toward the sun or the sensor it is the cosine of the local zenith angle.
    """
    return (vector.z - east * vector.x - north * vector.y) * slope_cosine(east, north)


def slope_aspect(dem, cell_y, cell_x):
    r"""
    Slope and aspect of the ground.

    .. math::

        \tan S = |\nabla z|, \qquad
        \tan A = \frac{-\partial z / \partial x}{-\partial z / \partial y}

    with x to the east and y to the north.

    Parameters
    ----------
    dem : array, shape (rows + 2, columns + 2)
        Elevation, north up, with a margin of one cell, which may be NaN. [m]
    cell_y, cell_x : float
        [m]

    Returns
    -------
    slope : array, shape (rows, columns)
        0 is level. [degree]
    aspect : array, shape (rows, columns)
        Azimuth of the direction down the slope, clockwise from north; 0 on level ground. [degree]

    Notes
    -----
    Central differences, exact on a plane and on a paraboloid.

    References
    ----------
    [DozierFrew1990]_, Eqs. 11 and 12, whose azimuths run from south through east
    """
    return slope_angles(*gradient(dem, cell_y, cell_x))


def slope_angles(east, north):
    """Slope and aspect of a gradient. [degree]"""
    # 0 - x and not -x: level ground must not face -0.
    aspect = np.degrees(np.arctan2(0 - east, 0 - north)) % 360
    # np.hypot foresees overflow, and takes five times as long for the same digits but the last.
    slope = np.degrees(np.arctan(np.sqrt(east * east + north * north)))
    return slope, np.where(aspect == 360, 0.0, aspect)


def steepness(dem, cell_y, cell_x):
    """Slope without aspect, with the bits of `slope_aspect`, shape (rows, columns). [degree]"""
    dem = np.ascontiguousarray(dem, float)
    out = np.empty((dem.shape[0] - 2, dem.shape[1] - 2))
    _tangent(dem, 2.0 * cell_y, 2.0 * cell_x, out)
    return np.degrees(np.arctan(out, out=out), out=out)


@compiled
def _gradient(dem, rows, columns, over_y, over_x, out):
    for i in range(rows.size):
        for j in range(columns.size):
            row, column = rows[i], columns[j]
            here = dem[row, column]
            if np.isnan(here):
                out[:, i, j] = np.nan
                continue
            out[0, i, j] = rise(dem[row, column - 1], here, dem[row, column + 1]) / over_x
            out[1, i, j] = rise(dem[row + 1, column], here, dem[row - 1, column]) / over_y


# Divided as numpy does: a check of each divisor for 0 would keep a loop from taking several cells at once.
@compiled
def _tangent(dem, over_y, over_x, out):
    """Tangent of the slope."""
    for i in range(out.shape[0]):
        above, here, below, line = dem[i], dem[i + 1], dem[i + 2], out[i]
        for j in range(line.size):
            east = rise(here[j], here[j + 1], here[j + 2]) / over_x
            north = rise(below[j + 1], here[j + 1], above[j + 1]) / over_y
            line[j] = np.nan if np.isnan(here[j + 1]) else np.sqrt(east * east + north * north)


def direction_vector(zenith, azimuth):
    """Unit vector toward the sun or the sensor. [1]"""
    zenith, azimuth = np.radians(zenith), np.radians(azimuth)
    return Vector(np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith))


@jitable
def topographic_factor(sky_view, terrain_view, reflectance, mu_s_local, mu_s, direct_transmittance, transmittance_down):
    r"""
    Topographic correction factor: irradiance of a slope relative to level ground.

    .. math::

        K_t = V_d + C_t \, \rho
            + \frac{e^{-\tau / \mu_0}}{T(\theta_s)} \left[ \frac{\mu_s}{\mu_0} - V_d \right]

    Parameters
    ----------
    sky_view, terrain_view : array
        :math:`V_d` and :math:`C_t`. [1]
    reflectance : array
        Reflectance of the surrounding land, :math:`\rho`, as on level ground. [1]
    mu_s_local : array
        Cosine of the sun's zenith angle on the slope, :math:`\mu_s`; 0 in shadow. [1]
    mu_s : float
        The same on level ground, :math:`\mu_0`. [1]
    direct_transmittance : array
        Transmittance of the direct beam, :math:`e^{-\tau / \mu_0}`. [1]
    transmittance_down : array
        Total, direct and diffuse, :math:`T(\theta_s)`. [1]

    Returns
    -------
    kt : array
        1 on level and open ground. [1]

    Notes
    -----
    The sky is uniform, the land around a slope is as bright as the slope's own cell, and its light comes once.

    References
    ----------
    [Friedl1995]_, Eq. 4; [Dubayah1992]_
    """
    direct = direct_transmittance / transmittance_down
    return sky_view + terrain_view * reflectance + direct * (mu_s_local / mu_s - sky_view)


@jitable
def upwelling_factor(mu_v_local, mu_v):
    r"""
    Cosine correction of the light that leaves a slope toward the sensor; 0 where the slope faces away. [1]
    :math:`\max(\mu_v, 0) / \cos \theta_v`. The paper has no divisor; with it level ground has 1 in any view.
    [Friedl1995]_, Eq. 5
    """
    return np.maximum(mu_v_local, 0.0) / mu_v
