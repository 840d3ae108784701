"""Multiple scattering in the mixed atmosphere of molecules and aerosol, by successive orders."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from fifesim.atmosphere.air.molecules import rayleigh_phase
from fifesim.atmosphere.air.own_aerosol import SCALE_HEIGHT
from fifesim.atmosphere.schemes.column import mixed_column
from fifesim.atmosphere.schemes.phase_expansion import stokes_basis, wigner

STREAMS = 16  # directions per hemisphere
LAYERS = 60
TOLERANCE = 1e-6  # of the field, for what is left out of the sums over orders and over Fourier modes [1]
MOST_ORDERS = 1000


def path_reflectance(
    tau_molecules,
    tau_aerosol,
    single_scattering_albedo,
    moments,
    phase,
    sza,
    vza,
    raa,
    *,
    polarized=True,
    streams=STREAMS,
    layers=LAYERS,
    vertical=SCALE_HEIGHT,
):
    r"""
    Reflectance at the top of the atmosphere over a black surface.

    .. math::

        \rho = \rho_1 + \frac{1}{\mu_s} \sum_m (-1)^m \cos(m \, raa) \int J^m(\tau, \mu_v)
            e^{-\tau / \mu_v} \frac{\mathrm{d}\tau}{\mu_v}

    :math:`\rho_1`, the light scattered once, has the whole phase function; :math:`J^m` is the source of the light that
    is scattered more often, its forward peak counted as not scattered.

    Parameters
    ----------
    tau_molecules, tau_aerosol : float
        Optical depths. [1]
    single_scattering_albedo : float
        Of the aerosol. [1]
    moments : array, shape (terms,) or (terms, 4)
        Of the aerosol's phase function, or of its scattering matrix: see `truncated_expansion`. [1]
    phase : array, shape (views, azimuths)
        Phase function of the aerosol at the scattering angles of the views. [1]
    sza : float
        Below 90. [degree]
    vza : array, shape (views,)
        Below 90. [degree]
    raa : array, shape (azimuths,)
        0 has sun and sensor on the same side. [degree]
    polarized : bool
        With the Stokes parameters Q and U, or with the intensity alone.
    streams, layers : int
        Directions per hemisphere, and layers of equal optical depth.
    vertical : float or pair of float
        Scale height of the aerosol, or bottom and top of its even layer. [km]

    Returns
    -------
    reflectance : array, shape (views, azimuths)
        [1]

    Notes
    -----
    Molecules fall off exponentially with a scale height of 8 km. Each layer is of even composition,
    with an even source. Given moments of the phase function alone, the aerosol does not polarize, which moves the
    reflectance by up to 1.2 % for continental aerosol and 2.9 % for urban; without any polarization it is up to 6 % off
    at 0.44 um. V, circular polarization, is left out: at depth 1 it moves nothing by more than 1e-5.

    Sun and views within 65 degrees, 60 layers are within .03 % of many at depth 1.2, 16 directions within .01 % of
    many for continental and urban aerosol and .2 % straight back from maritime. Beside 6SV1 at 0.4 to 0.63 um, the
    sun at 45 or 60 degrees: within .05 % for continental aerosol, .12 % for urban, .75 % for maritime.

    References
    ----------
    [Lenoble2007]_, orders and their geometric tail; [Siewert2000]_, polarization; [Nakajima1988]_, TMS method, light
    scattered once

    Examples
    --------
    Sun and sensor may change places:

    >>> air = 0.2, 0.0, 1.0, [1.0], [[0.0]]
    >>> there, back = (path_reflectance(*air, sza, [vza], [30.0]) for sza, vza in [(20.0, 50.0), (50.0, 20.0)])
    >>> bool(abs(there - back) < 2e-5)
    True
    """
    optics = tau_molecules, tau_aerosol, single_scattering_albedo, moments
    column = mixed_column(*optics, 2 * streams, layers, vertical)
    mu_s, mu_v = np.cos(np.radians(float(sza))), np.cos(np.radians(np.asarray(vza, float)))
    azimuth = np.radians(np.asarray(raa, float))
    nodes, _ = _quadrature(streams)
    upward = np.concatenate([nodes[:streams], mu_v])
    escape = column.escape(upward)
    reflectance = _single_scattering(column, np.asarray(phase, float), mu_s, mu_v, azimuth)
    field_size, largest, small = 0.0, 0.0, 0
    for mode in range(2 * streams):
        components = 3 if polarized and column.polarizes(mode) else 1
        coefficients, size = _rescattered(column, mode, components, mu_s, streams, field_size)
        radiance = (escape * (wigner(mode, 0, upward, 2 * streams)[mode:].T @ coefficients.T)).sum(axis=1)
        reflectance += (-1) ** mode * np.cos(mode * azimuth) * radiance[streams:, None] / mu_s
        strength = np.abs(radiance[:streams]).max()  # at the nodes: no view depends on the others asked for
        field_size, largest = max(field_size, size), max(largest, strength)
        small = small + 1 if strength <= TOLERANCE * largest else 0
        if mode >= 2 and small >= 2:
            break
    return reflectance


def flux_transmittance(
    tau_molecules,
    tau_aerosol,
    single_scattering_albedo,
    moments,
    zenith,
    *,
    polarized=True,
    streams=STREAMS,
    layers=LAYERS,
    vertical=SCALE_HEIGHT,
):
    r"""
    Total transmittance, and spherical albedo seen from below.

    A surface of radiance 1 in all directions sends up, by reciprocity, the transmittance, and gets back the albedo:

    .. math:: T(\mu) = I(0, \mu), \qquad S = 2 \int_0^1 I(\tau, -\mu) \, \mu \, \mathrm{d}\mu

    Parameters
    ----------
    tau_molecules, tau_aerosol, single_scattering_albedo, moments
        As in `path_reflectance`. [1]
    zenith : array, shape (n,)
        Of the sun or of the sensor. [degree]
    polarized : bool
    streams, layers, vertical
        As in `path_reflectance`.

    Returns
    -------
    transmittance : array, shape (n,)
        Direct and diffuse, of the flux on a horizontal surface. [1]
    spherical_albedo : float
        [1]

    References
    ----------
    [Lenoble2007]_, orders and their geometric tail; [Siewert2000]_, polarization

    Examples
    --------
    A thicker layer lets less through and sends more back:

    >>> (thin, little), (thick, more) = (flux_transmittance(tau, 0.0, 1.0, [1.0], [60.0]) for tau in (0.1, 0.3))
    >>> bool(1 > thin > thick), bool(0 < little < more)
    (True, True)
    """
    optics = tau_molecules, tau_aerosol, single_scattering_albedo, moments
    column = mixed_column(*optics, 2 * streams, layers, vertical)
    count, components = 2 * streams, 3 if polarized else 1
    nodes, weights = _quadrature(streams)
    up, zenith_up = nodes[:streams], np.cos(np.radians(np.asarray(zenith, float)))
    direct = np.zeros((layers, components * count))
    direct[:, :streams] = column.layer_mean(up)[::-1]
    basis, mixing = stokes_basis(0, nodes, count, components), column.mixing(0, components)
    shares = np.tile(weights / 2, components)
    source = _scattered(direct * shares, basis, mixing) @ basis.T
    through, averaged = column.steps(up)
    field, _ = _sum_orders(source, _Mode(basis, shares, mixing, through, averaged), 0.0)
    coefficients = _scattered((direct + field) * shares, basis, mixing)[:, :count]
    # Down from the surface, the layers come in the opposite order.
    out = column.escape(zenith_up) * (wigner(0, 0, zenith_up, count).T @ coefficients.T)
    back = column.escape(up) * (wigner(0, 0, -up, count).T @ coefficients[::-1].T)
    transmittance = np.exp(-layers * column.depth / zenith_up) + out.sum(axis=1)
    return transmittance, float(2 * (back.sum(axis=1) * up * weights[:streams]).sum())


@lru_cache
def _quadrature(streams):
    """Cosines of the directions, upward ones first, and their weights: Gauss points of each hemisphere."""
    points, weights = np.polynomial.legendre.leggauss(streams)
    upward = (points + 1) / 2
    return np.concatenate([upward, -upward]), np.concatenate([weights, weights]) / 2


def _single_scattering(column, phase, mu_s, mu_v, azimuth):
    """Reflectance of the light scattered once, shape (views, azimuths)."""
    sines = np.sqrt((1 - mu_s**2) * (1 - mu_v**2))[:, None]
    molecules = rayleigh_phase(-mu_s * mu_v[:, None] - sines * np.cos(azimuth))
    slant = 1 / mu_s + 1 / mu_v
    reached = column.layer_mean(1 / slant) * column.depth
    by_molecules, by_aerosol = (reached.T @ column.molecules)[:, None], (reached.T @ column.aerosol_once)[:, None]
    return (by_molecules * molecules + by_aerosol * phase) / (4 * mu_s * mu_v[:, None])


def _rescattered(column, mode, components, mu_s, streams, least):
    """
    Source of the light scattered more than once, in one Fourier mode.

    Returns its coefficients in the Legendre functions of the mode, shape (layers, degrees), and the size of the field.
    """
    count = 2 * streams
    nodes, weights = _quadrature(streams)
    basis = stokes_basis(mode, nodes, count, components)
    weights = np.tile(weights / 2, components)
    mixing = column.mixing(mode, components)
    sun = wigner(mode, 0, np.array([-mu_s]), count)[mode:, 0]
    beam = column.layer_mean(np.array([mu_s])) * (0.25 if mode == 0 else 0.5)
    once = np.moveaxis(mixing[..., 0] * sun[:, None], 2, 1).reshape(len(beam), -1)
    through, averaged = column.steps(nodes[:streams])
    field, size = _sum_orders(beam * once @ basis.T, _Mode(basis, weights, mixing, through, averaged), least)
    return _scattered(field * weights, basis, mixing)[:, : count - mode], size


class _Mode(NamedTuple):
    """What scatters and carries the light of one Fourier mode."""

    basis: np.ndarray  # shape (components * directions, basis) [1]
    weights: np.ndarray  # of the directions, for each component [1]
    mixing: np.ndarray  # of `_Column.mixing` [1]
    through: np.ndarray  # of what enters a layer, shape (directions of a hemisphere,) [1]
    averaged: np.ndarray  # its mean over the layer [1]


@njit(nogil=True, cache=True)
def _scattered(weighted, basis, mixing):
    """Coefficients of the source that a field, times its weights, makes by scattering: shape (layers, basis)."""
    incident = np.dot(weighted, basis)
    source = np.zeros_like(incident)
    layers, degrees, components, _ = mixing.shape
    for k in range(layers):
        for to in range(components):
            for of in range(components):
                for degree in range(degrees):
                    source[k, to * degrees + degree] += mixing[k, degree, to, of] * incident[k, of * degrees + degree]
    return source


@njit(nogil=True, cache=True)
def _travel(source, through, averaged):
    """Mean over each layer of the light that the even sources of all layers send, none entering from outside."""
    layers, size = source.shape
    streams = through.size
    field = np.empty_like(source)
    for first in range(0, size, 2 * streams):
        for j in range(streams):
            up, down = first + j, first + streams + j
            rising, falling = 0.0, 0.0
            for k in range(layers):
                under = layers - 1 - k
                field[k, down] = source[k, down] + (falling - source[k, down]) * averaged[j]
                falling = source[k, down] + (falling - source[k, down]) * through[j]
                field[under, up] = source[under, up] + (rising - source[under, up]) * averaged[j]
                rising = source[under, up] + (rising - source[under, up]) * through[j]
    return field


@njit(nogil=True, cache=True)
def _sum_orders(source, mode, least):
    """
    Light of all orders of scattering from the source of the first, the tail closed as a geometric series.

    Returns the mean of each layer, shape (layers, components * directions), and its size: the weighted sum. The error
    of the tail, were the ratio of successive orders to go on changing as it last did, is held below the tolerance
    times the size, or times `least` where that is larger.
    """
    backward = np.ascontiguousarray(mode.basis.T)
    total = np.zeros_like(source)
    size, last, last_ratio = 0.0, 0.0, 2.0
    for _ in range(MOST_ORDERS):
        field = _travel(source, mode.through, mode.averaged)
        total += field
        strength = (np.abs(field) * mode.weights).sum()
        size += strength
        ratio = strength / last if last > 0 else 0.0
        if last > 0 and ratio < 1:
            left = strength * abs(ratio - last_ratio) / (1 - ratio) ** 2
            if left <= TOLERANCE * max(size, least):
                return total + field * (ratio / (1 - ratio)), size
        if not strength > 0:
            break
        last, last_ratio = strength, ratio
        source = np.dot(_scattered(field * mode.weights, mode.basis, mode.mixing), backward)
    return total, size
