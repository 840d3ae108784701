"""Orders of scattering of one Fourier mode after another, in a column of even layers."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from fifesim.atmosphere.schemes.phase_expansion import stokes_basis, wigner

MOST_ORDERS = 1000
ONE_THREAD = 2**18  # products of so many terms or fewer are not worth a second thread to BLAS


@lru_cache
def quadrature(streams):
    """
    Directions in which light is followed.

    Parameters
    ----------
    streams : int
        Directions of a hemisphere.

    Returns
    -------
    cosines, weights : array, shape (2 * streams,)
        Gauss points of each hemisphere, upward ones first. [1]
    """
    points, weights = np.polynomial.legendre.leggauss(streams)
    upward = (points + 1) / 2
    return np.concatenate([upward, -upward]), np.concatenate([weights, weights]) / 2


def once_scattered(column, molecules, aerosol, mu_s, mu_v, *, at_ground=False):
    r"""
    Reflectance of the light scattered once, with the whole phase functions.

    .. math:: \rho_1 = \frac{1}{4 \mu_s \mu_v} \sum_j \int \omega_j P_j e^{-\tau / \mu_s} t(\tau) \, \mathrm{d}\tau

    :math:`t` is the transmittance from there to the top, or to the ground.

    Parameters
    ----------
    column : column.Column
    molecules, aerosol : array, shape (..., views, azimuths)
        Their phase functions, or elements of their scattering matrices, at the scattering angles of the views. [1]
    mu_s : float
    mu_v : array, shape (views,)
        As in `rescattered_light`. [1]
    at_ground : bool, optional

    Returns
    -------
    reflectance : array, shape (..., views, azimuths)
        [1]
    """
    reached = column.both_ways(mu_s, mu_v, at_ground)
    by_molecules, by_aerosol = (reached.T @ column.molecules)[:, None], (reached.T @ column.aerosol_once)[:, None]
    return (by_molecules * molecules + by_aerosol * aerosol) / (4 * mu_s * mu_v[:, None])


def rescattered_light(column, mu_s, mu_v, *, at_ground=False, polarized=True, stokes=False, streams, tolerance):
    r"""
    Light scattered more than once that leaves the column, Fourier mode by mode.

    .. math:: \int J^m(\tau, \mu_v) e^{-\tau / \mu_v} \frac{\mathrm{d}\tau}{\mu_v}

    Parameters
    ----------
    column : column.Column
    mu_s : float
        Cosine of the sun's zenith angle; its irradiance across the beam is pi. [1]
    mu_v : array, shape (views,)
        Of the angle from the vertical in which the light leaves, above 0. [1]
    at_ground : bool, optional
        Of the light that comes down to the ground, instead of that which leaves the top.
    polarized : bool, optional
        With Q and U inside of the column.
    stokes : bool, optional
        Whether Q and U are returned too; `polarized` must hold.
    streams : int
        Directions per hemisphere.
    tolerance : float
        Of the field, for what is left out of the sums over orders and over modes. [1]

    Yields
    ------
    mode : int
        The light goes with the cosine of so many times the azimuth, U with the sine.
    radiance : array, shape (components, views)
        I, or I, Q and U. [1]
    """
    nodes, _ = quadrature(streams)
    mu = np.concatenate([nodes[:streams], mu_v])
    field_size, largest, small = 0.0, 0.0, 0
    for mode in range(column.terms):
        components = 3 if polarized and column.polarizes(mode) else 1
        coefficients, size = _rescattered(column, mode, components, mu_s, streams, field_size, tolerance)
        radiance = leaving_light(column, mode, mu, coefficients, at_ground=at_ground, stokes=stokes)
        yield mode, radiance[:, streams:]
        strength = np.abs(radiance[0, :streams]).max()  # at the nodes: no view depends on the others asked for
        field_size, largest = max(field_size, size), max(largest, strength)
        small = small + 1 if strength <= tolerance * largest else 0
        if mode >= 2 and small >= 2:
            break


def lit_from_below(column, *, polarized=True, streams, tolerance):
    """
    Source of the light of a surface of radiance 1 below the column, scattered at least once.

    Parameters
    ----------
    column : column.Column
    polarized : bool, optional
    streams : int
    tolerance : float
        As in `rescattered_light`.

    Returns
    -------
    coefficients : array, shape (layers, basis)
        Of mode 0, for `leaving_light`. [1]
    """
    components = 3 if polarized else 1
    nodes, weights = quadrature(streams)
    direct = np.zeros((len(column.molecules), components * nodes.size))
    direct[:, :streams] = column.layer_mean(nodes[:streams])[::-1]
    basis, mixing = stokes_basis(0, nodes, column.terms, components), column.mixing(0, components)
    shares = np.tile(weights / 2, components)
    source = _by_layers(_scattered(direct * shares, basis, mixing), basis.T)
    through, averaged = column.steps(nodes[:streams])
    field, _ = _sum_orders(source, _Mode(basis, shares, mixing, through, averaged), 0.0, tolerance)
    return _scattered((direct + field) * shares, basis, mixing)


def leaving_light(column, mode, mu, coefficients, *, at_ground=False, stokes=False):
    r"""
    Light that leaves a column for a source in its layers.

    .. math:: \int J(\tau, \mu) e^{-\tau / \mu} \frac{\mathrm{d}\tau}{\mu}

    Parameters
    ----------
    column : column.Column
    mode : int
        Fourier mode.
    mu : array, shape (directions,)
        Of the angle from the vertical, above 0. [1]
    coefficients : array, shape (layers, basis)
        Of the source, in the basis of `phase_expansion.stokes_basis`. [1]
    at_ground : bool, optional
        Down to the ground instead of out of the top.
    stokes : bool, optional
        Whether Q and U are returned too.

    Returns
    -------
    radiance : array, shape (1 or 3, directions)
        [1]
    """
    cosine = -mu if at_ground else mu
    coefficients = coefficients[::-1] if at_ground else coefficients
    degrees = column.terms - mode
    sources = [wigner(mode, 0, cosine, column.terms)[mode:].T @ coefficients[:, :degrees].T]
    if stokes and coefficients.shape[1] > degrees:
        basis = stokes_basis(mode, cosine, column.terms, 3)[mu.size :, degrees:]
        sources += np.split(basis @ coefficients[:, degrees:].T, 2)
    elif stokes:
        sources += [np.zeros_like(sources[0])] * 2
    escape = column.escape(mu)
    return np.stack([(escape * source).sum(axis=1) for source in sources])


def fluxes(column, source, mu, streams):
    """
    Transmittance of the flux, and spherical albedo seen from below.

    Parameters
    ----------
    column : column.Column
    source : array
        Of `lit_from_below`. [1]
    mu : array, shape (directions,)
        Cosines of zenith angles. [1]
    streams : int

    Returns
    -------
    transmittance : array, shape (directions,)
        Direct and diffuse, by reciprocity. [1]
    spherical_albedo : float
        [1]
    """
    nodes, weights = quadrature(streams)
    (out,), (back,) = (
        leaving_light(column, 0, to, source, at_ground=at_ground)
        for to, at_ground in ((mu, False), (nodes[:streams], True))
    )
    transmittance = np.exp(-len(column.molecules) * column.depth / mu) + out
    return transmittance, float(2 * (back * nodes[:streams] * weights[:streams]).sum())


def _rescattered(column, mode, components, mu_s, streams, least, tolerance):
    """
    Source of the light scattered more than once, in one Fourier mode.

    Returns its coefficients in the basis of the mode, shape (layers, basis), and the size of the field.
    """
    nodes, weights = quadrature(streams)
    basis = stokes_basis(mode, nodes, column.terms, components)
    weights = np.tile(weights / 2, components)
    mixing = column.mixing(mode, components)
    sun = wigner(mode, 0, np.array([-mu_s]), column.terms)[mode:, 0]
    beam = column.layer_mean(np.array([mu_s])) * (0.25 if mode == 0 else 0.5)
    once = np.moveaxis(mixing[..., 0] * sun[:, None], 2, 1).reshape(len(beam), -1)
    through, averaged = column.steps(nodes[:streams])
    carried = _Mode(basis, weights, mixing, through, averaged)
    field, size = _sum_orders(_by_layers(beam * once, basis.T), carried, least, tolerance)
    return _scattered(field * weights, basis, mixing), size


class _Mode(NamedTuple):
    """What scatters and carries the light of one Fourier mode."""

    basis: np.ndarray  # shape (components * directions, basis) [1]
    weights: np.ndarray  # of the directions, for each component [1]
    mixing: np.ndarray  # of `_Column.mixing` [1]
    through: np.ndarray  # of what enters a layer, shape (directions of a hemisphere,) [1]
    averaged: np.ndarray  # its mean over the layer [1]


def _by_layers(light, matrix):
    """
    Product of two matrices, some layers at a time.

    So little at once that BLAS does it in one thread: its threads would wait for each other longer than they work.
    """
    step = max(1, ONE_THREAD // matrix.size)
    return np.concatenate([light[first : first + step] @ matrix for first in range(0, len(light), step)])


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
def _sum_orders(source, mode, least, tolerance):
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
            if left <= tolerance * max(size, least):
                return total + field * (ratio / (1 - ratio)), size
        if not strength > 0:
            break
        last, last_ratio = strength, ratio
        source = np.dot(_scattered(field * mode.weights, mode.basis, mode.mixing), backward)
    return total, size
