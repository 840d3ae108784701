"""Reflectance through an atmosphere whose sun, view or ground altitude varies from cell to cell."""

import dataclasses
import threading
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from fifesim.atmosphere import aerosols
from fifesim.atmosphere.coupling import apparent_reflectance_of_cell, corrected_reflectance_of_cell
from fifesim.atmosphere.engines import LARGEST_ZENITH, terms_at
from fifesim.base.arrays import compiled, jitable
from fifesim.base.caches import cached
from fifesim.base.geometry import relative_azimuth

ANGLE_STEP = 0.25  # between scattering angles of the phase function [degree]


class Once(NamedTuple):
    """Optical properties that determine single scattering by the aerosol in each band. [1]"""

    albedo: np.ndarray  # of single scattering, shape (band,)
    depth: np.ndarray  # of the aerosol, shape (band,)
    overlying: np.ndarray  # depth of the molecules above it, shape (band,)
    phase: np.ndarray  # by scattering angle every `ANGLE_STEP`, shape (band, 721)


@cached(64, "single scattering by the aerosol")
def scattered_once(atmosphere, bands):
    """Optical properties for single scattering by the aerosol at the middle of each band."""
    wavelength = np.array([band.center for band in bands])
    cosine = np.cos(np.radians(np.arange(0, 180 + ANGLE_STEP / 2, ANGLE_STEP)))
    none = np.zeros(wavelength.size)
    if atmosphere.aot == 0:
        return Once(none, none, none, np.zeros((wavelength.size, cosine.size)))
    overlying = none
    if atmosphere.engine != "5S":
        # The closed forms have no molecules above the aerosol.
        overlying = dataclasses.replace(atmosphere, altitude=0.0).rayleigh_optical_depth(wavelength)
    _, albedo, _ = aerosols.aerosol_optics(atmosphere.aerosol, wavelength)
    phase = aerosols.aerosol_phase(atmosphere.aerosol, cosine, wavelength[:, None])
    return Once(albedo, atmosphere.aerosol_optical_depth(wavelength), overlying, phase)


@compiled
def once_reflectance(sza, vza, raa, once, band):
    r"""
    Reflectance by single scattering in one band.

    .. math:: \rho_1 = \frac{\omega P(\Theta)}{4 (\mu_s + \mu_v)} \left(1 - e^{-m \tau_A}\right) e^{-m \tau_R}

    Parameters
    ----------
    sza, vza, raa : float
        [degree]
    once : Once
    band : int
        Number of the band in it.

    Returns
    -------
    reflectance : float
        [1]

    References
    ----------
    [Tanre1990]_
    """
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))
    sines = np.sin(np.radians(sza)) * np.sin(np.radians(vza))
    cosine = min(max(-mu_s * mu_v - sines * np.cos(np.radians(raa)), -1.0), 1.0)
    place = np.degrees(np.arccos(cosine)) / ANGLE_STEP
    phase = once.phase[band]
    index = min(int(place), phase.size - 2)
    between = phase[index] + (place - index) * (phase[index + 1] - phase[index])
    air_mass = 1 / mu_s + 1 / mu_v
    turned = once.albedo[band] * between / (4 * (mu_s + mu_v))
    return turned * -np.expm1(-air_mass * once.depth[band]) * np.exp(-air_mass * once.overlying[band])


@compiled
def once_on_nodes(sza, vza, raa, once):
    """Reflectance by single scattering [Tanre1990]_ on nodes, shape (S, V, R, band). [1]"""
    out = np.empty((sza.size, vza.size, raa.size, once.albedo.size))
    for s in range(sza.size):
        for v in range(vza.size):
            for r in range(raa.size):
                for b in range(once.albedo.size):
                    out[s, v, r, b] = once_reflectance(sza[s], vza[v], raa[r], once, b)
    return out


# The lattice does not depend on the requested cells, so the result does not depend on chunks or windows.
ZENITH_STEP = 2.5  # [degree]
AZIMUTH_STEP = 5.0  # [degree]
ALTITUDE_STEP = 0.5  # [km]
HIGHEST = 4.0  # ground altitude that the profiles hold to [km]
LINEAR, CUBIC = 2, 4  # nodes per interpolation

_lock = threading.Lock()


class ByAxis(NamedTuple):
    """One value for each axis of the tables."""

    altitude: object
    sza: object
    vza: object
    raa: object


class Lattice(NamedTuple):
    """Nodes of one axis of the tables: a regular part of the axis, or a single value."""

    step: float
    size: int  # of the complete axis; 1 for a single value
    first: int  # of all nodes, with which the stretch begins


class Tables(NamedTuple):
    """Terms on the nodes of altitude (A), sun (S), view (V) and azimuth (R). [1]"""

    path_reflectance: np.ndarray  # (A, S, V, R, band), less what the aerosol scatters once
    transmittance_down: np.ndarray  # (A, S, band)
    transmittance_up: np.ndarray  # (A, V, band)
    spherical_albedo: np.ndarray  # (A, S, V, band)
    gas_transmittance: np.ndarray  # (A, S, V, band)


def varying_reflectance(reflectance, altitude, sza, saa, vza, vaa, *, atmosphere, bands, to_surface=False):
    r"""
    Apparent reflectance of a uniform surface, or the inverse, where the geometry varies from cell to cell.

    Parameters
    ----------
    reflectance : array, shape (..., band)
        Surface reflectance, or apparent reflectance with ``to_surface``. [1]
    altitude : array, broadcastable to (...)
        Altitude of the ground. [km]
    sza, saa, vza, vaa : array, broadcastable to (...)
        Angles. A scalar angle is used exactly; otherwise the terms are interpolated. [degree]
    atmosphere : models.Atmosphere
        Its altitude matters only for user-defined columns.
    bands : tuple of Band
    to_surface : bool, optional
        Compute the inverse.

    Returns
    -------
    reflectance : array, shape (band, ...)
        NaN if an input is NaN. [1]

    Raises
    ------
    ValueError
        If an angle or altitude is out of the range of the model, or :math:`\rho S \ge 1`, where the multiple
        reflections do not converge.

    Notes
    -----
    The terms of `coupling.BandTerms` are interpolated, by cubics every 2.5 degrees of zenith and 5 of azimuth and
    linearly every 0.5 km; single scattering by the aerosol varies faster, and is added cell by cell. For zenith angles
    within 70 degrees the error of apparent reflectance is 3e-5 with continental or urban aerosol; in maritime haze of 5
    km, whose glory is narrow and moves with the wavelength, 0.002 within 5 degrees of backscatter and 3e-4 elsewhere. A
    user-defined column of water vapour or ozone refers to the altitude of the atmosphere, and scales the profile at
    other altitudes.

    References
    ----------
    [Tanre1990]_
    """
    cells, n_bands = reflectance.shape[:-1], reflectance.shape[-1]
    altitude = _in_range("altitude", altitude, HIGHEST, "km")
    sza, vza = _in_range("sza", sza, LARGEST_ZENITH, "degrees"), _in_range("vza", vza, LARGEST_ZENITH, "degrees")
    raa = relative_azimuth(saa, vaa)
    axes = ByAxis(
        altitude=_axis(altitude, ALTITUDE_STEP, HIGHEST, LINEAR, stretch=True),
        sza=_axis(sza, ZENITH_STEP, LARGEST_ZENITH, CUBIC, stretch=True),
        vza=_axis(vza, ZENITH_STEP, LARGEST_ZENITH, CUBIC, stretch=False),
        raa=_axis(raa, AZIMUTH_STEP, 180.0, CUBIC, stretch=False),
    )
    lattices, nodes = ByAxis(*(lattice for lattice, _ in axes)), ByAxis(*(nodes for _, nodes in axes))
    once = scattered_once(atmosphere, tuple(bands))
    tables = _tables(atmosphere, tuple(bands), once, nodes)
    # Copies: numba compiles a kernel anew for arrays that cannot be written.
    spread = (np.broadcast_to(np.asarray(values, float), cells).flatten() for values in (altitude, sza, vza, raa))
    out = np.empty((n_bands, int(np.prod(cells))))
    values = np.ascontiguousarray(reflectance, float).reshape(-1, n_bands)
    _through(values, ByAxis(*spread), lattices, tables, once, to_surface, out)
    # The kernel marks values that do not converge.
    if np.any(np.isinf(out)):
        raise ValueError(
            "surface_reflectance times spherical_albedo must be below 1 in every cell, got a reflectance of "
            f"{np.nanmax(values):g}: reflectance is a fraction, not a percentage"
        )
    return out.reshape(-1, *cells)


def varying_diffuse_fraction(sza, *, atmosphere, bands):
    """
    Diffuse fraction of the irradiance of level ground, where the sun varies.

    Parameters
    ----------
    sza : array, shape (...)
        [degree]
    atmosphere : models.Atmosphere
    bands : tuple of Band

    Returns
    -------
    diffuse_fraction : array, shape (band, ...)
        Cubic spline with nodes every 2.5 degrees; NaN if the angle is NaN. [1]

    References
    ----------
    [Tanre1990]_
    """
    sza = _in_range("sza", sza, LARGEST_ZENITH, "degrees")
    nodes = np.arange(round(LARGEST_ZENITH / ZENITH_STEP) + 1) * ZENITH_STEP
    terms = [_node(atmosphere, tuple(bands), node, (0.0,), (0.0,)) for node in nodes.tolist()]
    spline = CubicSpline(nodes, [at_node.diffuse_fraction[0, 0] for at_node in terms])
    return np.moveaxis(spline(sza), -1, 0)


def _in_range(name, values, high, unit):
    values = np.asarray(values, float)
    wrong = (values < 0) | (values > high)
    if wrong.any():
        found = values[wrong].flat[0]
        raise ValueError(f"{name} must be from 0 to {high:g} {unit} in every cell, got {found:g}: the model ends there")
    return values


def _axis(values, step, high, order, *, stretch):
    """Lattice of one axis, and the nodes that the values need."""
    if values.ndim == 0:
        return Lattice(1.0, 1, 0), values.reshape(1)
    nodes = np.arange(round(high / step) + 1) * step
    known = values[np.isfinite(values)]
    first, last = 0, nodes.size - order
    if stretch:
        ends = (known.min(), known.max()) if known.size else (0.0, 0.0)
        first, last = (min(max(int(end / step) - (order // 2 - 1), 0), last) for end in ends)
    return Lattice(step, nodes.size, first), nodes[first : last + order]


def _tables(atmosphere, bands, once, nodes):
    vza, raa, airs = nodes.vza, nodes.raa, map(atmosphere.above, nodes.altitude.tolist())
    grid = [[_node(air, bands, s, tuple(vza), tuple(raa)) for s in nodes.sza.tolist()] for air in airs]

    def gathered(term, views=1):
        values = np.array([[getattr(terms, term)[:, 0] for terms in row] for row in grid])
        return np.broadcast_to(values, (*values.shape[:2], views, len(bands)))

    scattered = np.array([[terms.path_reflectance for terms in row] for row in grid])
    tables = Tables(
        path_reflectance=scattered - once_on_nodes(nodes.sza, vza, raa, once),
        transmittance_down=gathered("transmittance_down")[:, :, 0],
        transmittance_up=gathered("transmittance_up", vza.size)[:, 0],
        spherical_albedo=gathered("spherical_albedo", vza.size),
        gas_transmittance=gathered("gas_transmittance", vza.size),
    )
    return Tables(*(np.ascontiguousarray(values) for values in tables))


def _node(atmosphere, bands, sza, vza, raa):
    # Lock, so that only one of several threads computes the same nodes.
    with _lock:
        return _node_terms(atmosphere, bands, sza, vza, raa)


@cached(512, "terms of the atmosphere at nodes of a table")
def _node_terms(atmosphere, bands, sza, vza, raa):
    return terms_at(atmosphere, bands, sza, np.array(vza), np.array(raa))


@jitable
def _stencil(value, lattice, order, weights):
    """Fill in the Lagrange weights of a value; return the index of the first node and their number."""
    if lattice.size == 1:
        weights[0] = 1.0
        return 0, 1
    place = value / lattice.step
    start = min(max(int(place) - (order // 2 - 1), 0), lattice.size - order)
    for i in range(order):
        weights[i] = 1.0
        for j in range(order):
            if j != i:
                weights[i] *= (place - start - j) / (i - j)
    return start - lattice.first, order


@compiled
def _interpolate(place, lattices, tables, weights, terms):
    """Terms of all bands at one place, interpolated in the tables."""
    a, n_altitudes = _stencil(place.altitude, lattices.altitude, LINEAR, weights.altitude)
    s, n_suns = _stencil(place.sza, lattices.sza, CUBIC, weights.sza)
    v, n_views = _stencil(place.vza, lattices.vza, CUBIC, weights.vza)
    r, n_azimuths = _stencil(place.raa, lattices.raa, CUBIC, weights.raa)
    bands = range(terms.path_reflectance.size)
    for b in bands:
        terms.path_reflectance[b] = terms.transmittance_down[b] = terms.transmittance_up[b] = 0.0
        terms.spherical_albedo[b] = terms.gas_transmittance[b] = 0.0
    for i in range(n_altitudes):
        for j in range(n_suns):
            weight = weights.altitude[i] * weights.sza[j]
            for b in bands:
                terms.transmittance_down[b] += weight * tables.transmittance_down[a + i, s + j, b]
        for k in range(n_views):
            weight = weights.altitude[i] * weights.vza[k]
            for b in bands:
                terms.transmittance_up[b] += weight * tables.transmittance_up[a + i, v + k, b]
        for j in range(n_suns):
            for k in range(n_views):
                weight = weights.altitude[i] * weights.sza[j] * weights.vza[k]
                for b in bands:
                    terms.spherical_albedo[b] += weight * tables.spherical_albedo[a + i, s + j, v + k, b]
                    terms.gas_transmittance[b] += weight * tables.gas_transmittance[a + i, s + j, v + k, b]
                for m in range(n_azimuths):
                    for b in bands:
                        path = tables.path_reflectance[a + i, s + j, v + k, r + m, b]
                        terms.path_reflectance[b] += weight * weights.raa[m] * path


@compiled
def _through(reflectance, places, lattices, tables, once, to_surface, out):
    n_bands = out.shape[0]
    terms = Tables(np.empty(n_bands), np.empty(n_bands), np.empty(n_bands), np.empty(n_bands), np.empty(n_bands))
    weights = ByAxis(np.empty(LINEAR), np.empty(CUBIC), np.empty(CUBIC), np.empty(CUBIC))
    for cell in range(out.shape[1]):
        place = ByAxis(places.altitude[cell], places.sza[cell], places.vza[cell], places.raa[cell])
        if np.isnan(place.altitude + place.sza + place.vza + place.raa):
            out[:, cell] = np.nan
            continue
        _interpolate(place, lattices, tables, weights, terms)
        for b in range(n_bands):
            rho, albedo, gas = reflectance[cell, b], terms.spherical_albedo[b], terms.gas_transmittance[b]
            path = terms.path_reflectance[b] + once_reflectance(place.sza, place.vza, place.raa, once, b)
            # One transmittance of both ways stands for the two.
            two_way = terms.transmittance_down[b] * terms.transmittance_up[b]
            if to_surface:
                out[b, cell] = corrected_reflectance_of_cell(rho, path, two_way, 1.0, albedo, gas)
            else:
                out[b, cell] = apparent_reflectance_of_cell(rho, rho, path, two_way, 1.0, albedo, gas)
