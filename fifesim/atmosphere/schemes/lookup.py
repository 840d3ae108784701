"""Reflectance through an atmosphere whose sun, view or ground altitude varies from cell to cell."""

import dataclasses
import threading
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from fifesim.atmosphere.air.models import ozone_column, water_vapour_column
from fifesim.atmosphere.air.profiles import profile_above
from fifesim.atmosphere.schemes.engines import LARGEST_ZENITH, terms_at
from fifesim.atmosphere.schemes.single_scattering import once_on_nodes, once_reflectance, scattered_once
from fifesim.base.geometry import relative_azimuth

# The lattice is the same whatever cells are asked for, so the result does not depend on how a raster is cut.
ZENITH_STEP = 2.5  # [degree]
AZIMUTH_STEP = 5.0  # [degree]
ALTITUDE_STEP = 0.5  # [km]
HIGHEST = 4.0  # ground altitude that the profiles hold to [km]
LINEAR, CUBIC = 2, 4  # nodes that an interpolation takes

_lock = threading.Lock()


class Tables(NamedTuple):
    """Terms on the nodes of altitude (A), sun (S), view (V) and azimuth (R), one of them or a stretch each. [1]"""

    path_reflectance: np.ndarray  # (A, S, V, R, band), less what the aerosol scatters once
    transmittance_down: np.ndarray  # (A, S, band)
    transmittance_up: np.ndarray  # (A, V, band)
    spherical_albedo: np.ndarray  # (A, S, V, band)
    gas_transmittance: np.ndarray  # (A, S, V, band)


def varying_reflectance(reflectance, altitude, sza, saa, vza, vaa, *, atmosphere, bands, to_surface=False):
    r"""
    Apparent reflectance of a uniform surface, or back, where the geometry varies.

    Parameters
    ----------
    reflectance : array, shape (..., band)
        Of the surface, or apparent with ``to_surface``. [1]
    altitude : array, broadcastable to (...)
        Of the ground. [km]
    sza, saa, vza, vaa : array, broadcastable to (...)
        Where an angle is one number its value is used as it is; else the terms are interpolated. [degree]
    atmosphere : models.Atmosphere
        Its own altitude counts for columns of the user's own only.
    bands : tuple of Band
    to_surface : bool, optional
        Whether the inverse is wanted.

    Returns
    -------
    reflectance : array, shape (band, ...)
        NaN where an input is. [1]

    Raises
    ------
    ValueError
        If an angle or altitude is out of the range of the model, or :math:`\rho S \ge 1`, where the multiple
        reflections do not converge.

    Notes
    -----
    The terms of `terms.BandTerms` are interpolated, by cubics every 2.5 degrees of zenith and 5 of azimuth and
    linearly every 0.5 km; what the aerosol scatters once is sharper than that, and is added cell by cell. For zenith
    angles within 70 degrees that leaves 3e-5 of apparent reflectance with continental or urban aerosol; in maritime
    haze of 5 km, whose glory is narrow and moves with the wavelength, .002 within 5 degrees of backscatter and 3e-4
    elsewhere.
    A column of water vapour or ozone of the user's own is that at the altitude of the atmosphere, and scales the
    profile at the others.

    References
    ----------
    [Tanre1990]_
    """
    cells = reflectance.shape[:-1]
    altitude = _in_range("altitude", altitude, HIGHEST, "km")
    sza, vza = (_in_range(name, angle, LARGEST_ZENITH, "degrees") for name, angle in (("sza", sza), ("vza", vza)))
    raa = relative_azimuth(saa, vaa)
    axes = (
        _axis(altitude, ALTITUDE_STEP, HIGHEST, LINEAR, True),
        _axis(sza, ZENITH_STEP, LARGEST_ZENITH, CUBIC, True),
        _axis(vza, ZENITH_STEP, LARGEST_ZENITH, CUBIC, False),
        _axis(raa, AZIMUTH_STEP, 180.0, CUBIC, False),
    )
    once = scattered_once(atmosphere, tuple(bands))
    tables = _tables(atmosphere, tuple(bands), once, *(axis.nodes for axis in axes))
    places = (np.broadcast_to(np.asarray(values, float), cells).ravel() for values in (altitude, sza, vza, raa))
    lattices = tuple((axis.step, axis.size, axis.first) for axis in axes)
    out = np.empty((reflectance.shape[-1], int(np.prod(cells))))
    values = np.ascontiguousarray(reflectance, float).reshape(-1, reflectance.shape[-1])
    _through(values, *places, lattices, tables, once, to_surface, out)
    # The kernel marks what does not converge.
    if np.any(np.isinf(out)):
        raise ValueError(
            "surface_reflectance times spherical_albedo must be below 1 in every cell, got a reflectance of "
            f"{np.nanmax(values):g}: reflectance is a fraction, not a percentage"
        )
    return out.reshape(-1, *cells)


def varying_diffuse_fraction(sza, *, atmosphere, bands):
    """
    Share of skylight in the irradiance of level ground, where the sun varies.

    Parameters
    ----------
    sza : array, shape (...)
        [degree]
    atmosphere : models.Atmosphere
    bands : tuple of Band

    Returns
    -------
    diffuse_fraction : array, shape (band, ...)
        A cubic spline through every 2.5 degrees; NaN where the angle is. [1]

    Raises
    ------
    ValueError
        If an angle is out of the range of the model.

    References
    ----------
    [Tanre1990]_
    """
    sza = _in_range("sza", sza, LARGEST_ZENITH, "degrees")
    nodes = np.arange(round(LARGEST_ZENITH / ZENITH_STEP) + 1) * ZENITH_STEP
    terms = [_node(atmosphere, tuple(bands), node, (0.0,), (0.0,)) for node in nodes.tolist()]
    spline = CubicSpline(nodes, [each.diffuse_fraction[0, 0] for each in terms])
    return np.moveaxis(spline(sza), -1, 0)


def _in_range(name, values, high, unit):
    values = np.asarray(values, float)
    wrong = (values < 0) | (values > high)
    if wrong.any():
        found = values[wrong].flat[0]
        raise ValueError(f"{name} must be from 0 to {high:g} {unit} in every cell, got {found:g}: the model ends there")
    return values


class _Axis(NamedTuple):
    """Nodes of one dimension of the tables: a stretch of the lattice, or one value of its own."""

    nodes: np.ndarray
    step: float  # of the lattice
    size: int  # nodes of the whole lattice; 1 for a value of its own
    first: int  # node of the lattice with which the stretch begins


def _axis(values, step, high, order, stretch):
    if values.ndim == 0:
        return _Axis(values.reshape(1), 1.0, 1, 0)
    lattice = np.arange(round(high / step) + 1) * step
    known = values[np.isfinite(values)]
    first, last = 0, lattice.size - order
    if stretch:
        ends = (known.min(), known.max()) if known.size else (0.0, 0.0)
        first, last = (min(max(int(end / step) - (order // 2 - 1), 0), last) for end in ends)
    return _Axis(lattice[first : last + order], step, lattice.size, first)


def _at_altitude(atmosphere, altitude):
    """The same air above other ground."""
    here, there = (profile_above(atmosphere.profile, z) for z in (atmosphere.altitude, altitude))
    own = {
        name: column(there) / column(here) * getattr(atmosphere, name)
        for name, column in (("h2o", water_vapour_column), ("o3", ozone_column))
        if getattr(atmosphere, name) is not None
    }
    return dataclasses.replace(atmosphere, altitude=altitude, **own)


def _tables(atmosphere, bands, once, altitude, sza, vza, raa):
    nodes = [
        [_node(_at_altitude(atmosphere, z), bands, s, tuple(vza), tuple(raa)) for s in sza.tolist()]
        for z in altitude.tolist()
    ]
    path, albedo, gas = (
        np.array([[getattr(node, name) for node in row] for row in nodes])
        for name in ("path_reflectance", "spherical_albedo", "gas_transmittance")
    )
    shape = (altitude.size, sza.size, vza.size, raa.size, len(bands))
    return Tables(
        path - once_on_nodes(sza, vza, raa, *once),
        np.array([[node.transmittance_down[0, 0] for node in row] for row in nodes]),
        np.array([np.broadcast_to(row[0].transmittance_up[:, 0], (vza.size, len(bands))) for row in nodes]),
        np.ascontiguousarray(np.broadcast_to(albedo[:, :, :, 0], (*shape[:3], len(bands)))),
        np.ascontiguousarray(np.broadcast_to(gas[:, :, :, 0], (*shape[:3], len(bands)))),
    )


def _node(atmosphere, bands, sza, vza, raa):
    # Several threads want the same nodes at once, and one of them is enough to compute them.
    with _lock:
        return _node_terms(atmosphere, bands, sza, vza, raa)


@lru_cache(maxsize=512)
def _node_terms(atmosphere, bands, sza, vza, raa):
    return terms_at(atmosphere, bands, sza, np.array(vza), np.array(raa))


@njit(nogil=True, cache=True)
def _stencil(value, lattice, order, weights):
    """Weights of Lagrange's polynomial on the nodes around a value; the first of them in the table, and how many."""
    step, size, first = lattice
    if size == 1:
        weights[0] = 1.0
        return 0, 1
    place = value / step
    start = min(max(int(place) - (order // 2 - 1), 0), size - order)
    for i in range(order):
        weights[i] = 1.0
        for j in range(order):
            if j != i:
                weights[i] *= (place - start - j) / (i - j)
    return start - first, order


@njit(nogil=True, cache=True)
def _through(reflectance, altitude, sza, vza, raa, lattices, tables, once, to_surface, out):
    path, down, up, albedo, gas = tables
    n_bands = path.shape[-1]
    wa, ws, wv, wr = np.empty(2), np.empty(4), np.empty(4), np.empty(4)
    terms = np.empty((5, n_bands))
    for cell in range(reflectance.shape[0]):
        if np.isnan(altitude[cell] + sza[cell] + vza[cell] + raa[cell]):
            out[:, cell] = np.nan
            continue
        a, na = _stencil(altitude[cell], lattices[0], LINEAR, wa)
        s, ns = _stencil(sza[cell], lattices[1], CUBIC, ws)
        v, nv = _stencil(vza[cell], lattices[2], CUBIC, wv)
        r, nr = _stencil(raa[cell], lattices[3], CUBIC, wr)
        terms[:] = 0.0
        for i in range(na):
            for j in range(ns):
                for b in range(n_bands):
                    terms[1, b] += wa[i] * ws[j] * down[a + i, s + j, b]
            for k in range(nv):
                for b in range(n_bands):
                    terms[2, b] += wa[i] * wv[k] * up[a + i, v + k, b]
            for j in range(ns):
                for k in range(nv):
                    weight = wa[i] * ws[j] * wv[k]
                    for b in range(n_bands):
                        terms[3, b] += weight * albedo[a + i, s + j, v + k, b]
                        terms[4, b] += weight * gas[a + i, s + j, v + k, b]
                    for m in range(nr):
                        for b in range(n_bands):
                            terms[0, b] += weight * wr[m] * path[a + i, s + j, v + k, r + m, b]
        for b in range(n_bands):
            rho = reflectance[cell, b]
            two_way = terms[1, b] * terms[2, b]
            terms[0, b] += once_reflectance(
                sza[cell], vza[cell], raa[cell], once[0][b], once[1][b], once[2][b], once[3][b]
            )
            if to_surface:
                ground = (rho / terms[4, b] - terms[0, b]) / two_way
                out[b, cell] = ground / (1 + terms[3, b] * ground)
            elif terms[3, b] * rho >= 1:
                out[b, cell] = np.inf
            else:
                out[b, cell] = terms[4, b] * (terms[0, b] + two_way * rho / (1 - terms[3, b] * rho))
