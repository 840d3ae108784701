"""Irradiance, Kt and reflectance of all cells on slopes in one pass over the ground."""

from typing import NamedTuple

import numpy as np

from fifesim.base.arrays import compiled, jitable
from fifesim.ground.terrain.horizon import horizon_terrain_view, sky_factor
from fifesim.ground.terrain.slope import (
    Vector,
    along_normal,
    direction_vector,
    rise,
    slope_cosine,
    topographic_factor,
    upwelling_factor,
)


class Sky(NamedTuple):
    """Sky at places, and for each row and column of cells the previous place and the weight of the next."""

    # Vector of `horizon.sky_vector` and tangent of the horizon toward the sun, shape (4, places, places). [1]
    layers: np.ndarray
    row: np.ndarray
    row_share: np.ndarray
    column: np.ndarray
    column_share: np.ndarray


class SlopeLight(NamedTuple):
    """Geometric terms of the light on slopes, by cell. [1]"""

    cosine: np.ndarray  # of the slope
    sky_view: np.ndarray
    mu_s_local: np.ndarray  # 0 in shadow
    upwelling: np.ndarray  # Eq. 5


class _Setting(NamedTuple):
    """Unit vectors toward sun and sensor, tangent of the solar elevation, and factors from rise to gradient [m-1]."""

    sun: Vector
    sun_tangent: float
    sensor: Vector
    per_y: float
    per_x: float


def slope_light(dem, sky, cell, geometry):
    """
    SlopeLight of cells, shape (rows, columns), NaN where elevation is. [1] `dem` [m] has a margin of one cell, which
    may be NaN; `cell` is the size down and across [m].
    """
    rows, columns = dem.shape
    light = SlopeLight(*np.empty((len(SlopeLight._fields), rows - 2, columns - 2)))
    # The sky at the columns of cells, in the rows of places that these cells need.
    first, last = sky.row.min(initial=sky.layers.shape[1]), sky.row.max(initial=0)
    places = np.moveaxis(np.asarray(sky.layers, float)[:, first : last + 2], 1, 0)
    after = np.minimum(sky.column + 1, places.shape[2] - 1)
    # An infinite horizon without weight is NaN, which is in shadow.
    with np.errstate(invalid="ignore"):
        lines = np.ascontiguousarray(_between(places[..., sky.column], places[..., after], sky.column_share))
    below = np.minimum(sky.row + 1 - first, len(lines) - 1)
    rows = sky.row - first, below, sky.row_share
    _slope_light(np.ascontiguousarray(dem, float), lines, *rows, _setting(cell, geometry), light)
    return light


def slope_reflectance(reflectance, dem, sky, cell, geometry, direct_transmittance, transmittance_down, upwelling=True):
    r"""
    Reflectance factor of cells on slopes relative to the irradiance of level ground, shape (band, rows, columns). [1]
    :math:`\rho \, K_t \, \max(\mu_v, 0) / \cos \theta_v` [Friedl1995]_, Eqs. 4 and 5; arguments as in `slope_light` and
    `topographic_factor`. Without `upwelling`, Eq. 4.
    """
    out = np.empty(reflectance.shape)
    air = direct_transmittance, transmittance_down
    _pass_over(reflectance, dem, sky, cell, geometry, *air, upwelling, True, out, out)
    return out


def slope_factor(reflectance, dem, sky, cell, geometry, direct_transmittance, transmittance_down):
    """Topographic correction factor Kt, shape (band, rows, columns), NaN where elevation or reflectance is. [1]"""
    out = np.empty(reflectance.shape)
    air = direct_transmittance, transmittance_down
    _pass_over(reflectance, dem, sky, cell, geometry, *air, False, False, out, out)
    return out


def slope_factor_and_reflectance(
    reflectance, dem, sky, cell, geometry, direct_transmittance, transmittance_down, upwelling=True
):
    """Kt and reflectance in one pass, shape (2, band, rows, columns), with the bits of separate passes. [1]"""
    both = np.empty((2, *reflectance.shape))
    air = direct_transmittance, transmittance_down
    _pass_over(reflectance, dem, sky, cell, geometry, *air, upwelling, True, *both)
    return both


# Cells of a strip of rows, whose light stays in the cache for all bands.
_STRIP = 2**15


def _pass_over(reflectance, dem, sky, cell, geometry, direct, total, upwelling, reflected, kt, out):
    """Fill in Kt and, on request, reflectance, which may share the array of Kt."""
    rho, air = np.ascontiguousarray(reflectance, float), (np.asarray(direct, float), np.asarray(total, float))
    _, rows, columns = rho.shape
    step = max(_STRIP // max(columns, 1), 1)
    for first in range(0, rows, step):
        part = slice(first, first + step)
        above = sky._replace(row=sky.row[part], row_share=sky.row_share[part])
        light = slope_light(dem[first : first + step + 2], above, cell, geometry)
        if not upwelling:
            light.upwelling[:] = 1.0
        _slope_factors(rho, first, light, geometry.mu_s, *air, reflected, kt, out)


def _setting(cell, geometry):
    sun, view = direction_vector(geometry.sza, geometry.saa), direction_vector(geometry.vza, geometry.vaa)
    # Overhead, no horizon reaches the sun.
    sun_tangent = sun.z / np.hypot(sun.x, sun.y) if geometry.sza > 0 else np.inf
    cell_y, cell_x = cell
    return _Setting(sun, sun_tangent, view, 0.5 / cell_y, 0.5 / cell_x)


# Divided as numpy does: a check of each divisor for 0 would keep a loop from taking several cells at once.
@compiled
def _slope_light(dem, lines, before, after, share, setting, light):
    """Fill in the light of rows of cells, below the sky of lines of places before and after each row."""
    gradient = np.empty((2, light.cosine.shape[1]))
    for i in range(before.size):
        _gradient_of_row(dem[i], dem[i + 1], dem[i + 2], setting, gradient[0], gradient[1])
        line = SlopeLight(light.cosine[i], light.sky_view[i], light.mu_s_local[i], light.upwelling[i])
        _light_of_row(gradient[0], gradient[1], lines[before[i]], lines[after[i]], share[i], setting, line)


@compiled
def _slope_factors(rho, first, light, mu_s, direct, total, reflected, kt, out):
    """Fill in Kt and reflectance of a strip of rows."""
    for i in range(light.cosine.shape[0]):
        cosine, sky_view, mu_s_local = light.cosine[i], light.sky_view[i], light.mu_s_local[i]
        for band in range(rho.shape[0]):
            own, factor, seen = rho[band, first + i], kt[band, first + i], out[band, first + i]
            for j in range(own.size):
                land = horizon_terrain_view(sky_view[j], cosine[j])
                air = mu_s, direct[band], total[band]
                factor[j] = topographic_factor(sky_view[j], land, own[j], mu_s_local[j], *air)
            if reflected:
                for j in range(own.size):
                    seen[j] = own[j] * factor[j] * light.upwelling[i, j]


@jitable
def _between(before, after, share):
    return (1 - share) * before + share * after


@jitable
def _gradient_of_row(above, here, below, setting, east, north):
    """Gradient of one row of cells from its elevation and the neighbouring rows, each with a margin of one cell."""
    for j in range(east.size):
        rising = rise(here[j], here[j + 1], here[j + 2]) * setting.per_x
        east[j] = np.nan if np.isnan(here[j + 1]) else rising
        north[j] = rise(below[j + 1], here[j + 1], above[j + 1]) * setting.per_y


@jitable
def _light_of_row(east, north, above, below, share, setting, light):
    for j in range(east.size):
        seen = Vector(
            _between(above[0, j], below[0, j], share),
            _between(above[1, j], below[1, j], share),
            _between(above[2, j], below[2, j], share),
        )
        lit = _between(above[3, j], below[3, j], share) <= setting.sun_tangent
        light.cosine[j] = slope_cosine(east[j], north[j])
        light.sky_view[j] = sky_factor(seen, east[j], north[j])
        light.mu_s_local[j] = np.maximum(along_normal(setting.sun, east[j], north[j]), 0.0) * lit
        light.upwelling[j] = upwelling_factor(along_normal(setting.sensor, east[j], north[j]), setting.sensor.z)
