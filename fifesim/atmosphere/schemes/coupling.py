"""Coupling of surface and atmosphere: reflectance at the surface to apparent reflectance in space, and back."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable


class TargetTerms(NamedTuple):
    """Terms of the equation of a target in its environment: arrays that broadcast. [1]"""

    path_reflectance: object  # of the atmosphere alone
    transmittance_down: object  # total, from the sun
    direct_transmittance_up: object  # to the sensor without scattering
    diffuse_transmittance_up: object  # and with
    spherical_albedo: object  # of the atmosphere seen from below
    gas_transmittance: object = 1.0  # of the absorbing gases, down and up


def apparent_reflectance(
    surface_reflectance, path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance=1.0
):
    r"""
    Apparent reflectance at the top of the atmosphere over a uniform surface.

    .. math::

        \rho^* = T_g \left[ \rho_a + T(\theta_s) \, \frac{\rho}{1 - \rho S} \, T(\theta_v) \right]

    Parameters
    ----------
    surface_reflectance : array, shape (..., band, y, x)
        Reflectance factor of the surface, :math:`\rho`. [1]
    path_reflectance : array, broadcastable
        Reflectance of the atmosphere alone, :math:`\rho_a`. [1]
    transmittance_down, transmittance_up : array, broadcastable
        Total transmittance from the sun, :math:`T(\theta_s)`, and to the sensor, :math:`T(\theta_v)`. [1]
    spherical_albedo : array, broadcastable
        Of the atmosphere seen from below, :math:`S`. [1]
    gas_transmittance : array, broadcastable, optional
        Of the absorbing gases, down and up, :math:`T_g`. [1]

    Returns
    -------
    toa_reflectance : array, shape of the broadcast inputs
        Apparent reflectance :math:`\rho^*`, with the cosine of the solar zenith divided out. [1]

    Raises
    ------
    ValueError
        If :math:`\rho S \ge 1`, where the multiple reflections do not converge.

    Notes
    -----
    The surface is uniform and Lambertian; `inhomogeneous_reflectance` is for any other.

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    A perfectly clear atmosphere changes nothing:

    >>> float(apparent_reflectance(0.25, 0.0, 1.0, 1.0, 0.0))
    0.25
    """
    factors = path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance
    toa, refused = _by_cell(_apparent, (surface_reflectance, surface_reflectance), factors)
    if refused:
        _refuse(surface_reflectance, spherical_albedo, "surface_reflectance")
    return toa


def corrected_reflectance(
    toa_reflectance, path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance=1.0
):
    r"""
    Reflectance of a uniform surface from its apparent reflectance.

    .. math::

        \rho = \frac{y}{1 + S y}, \qquad y = \frac{\rho^* / T_g - \rho_a}{T(\theta_s) \, T(\theta_v)}

    Parameters
    ----------
    toa_reflectance : array, shape (..., band, y, x)
        Apparent reflectance, :math:`\rho^*`. [1]
    path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance : array
        As in `apparent_reflectance`. [1]

    Returns
    -------
    surface_reflectance : array, shape of the broadcast inputs
        Negative where the scene is darker than the atmosphere alone. [1]

    Notes
    -----
    The exact inverse of `apparent_reflectance`.

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> round(float(corrected_reflectance(apparent_reflectance(0.25, 0.1, 0.8, 0.9, 0.2), 0.1, 0.8, 0.9, 0.2)), 12)
    0.25
    """
    factors = path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance
    return _by_cell(_corrected, (toa_reflectance,), factors)[0]


def inhomogeneous_reflectance(target, environment, terms):
    r"""
    Apparent reflectance at the top of the atmosphere of a target in its environment.

    .. math::

        \rho^* = T_g \left[ \rho_a + T(\theta_s) \, \frac{\rho_c \, e^{-\tau / \mu_v}
        + \langle \rho \rangle \, t_d(\theta_v)}{1 - \langle \rho \rangle S} \right]

    Parameters
    ----------
    target : array, shape (..., band, y, x)
        Reflectance factor of the target, :math:`\rho_c`. [1]
    environment : array, broadcastable
        Mean of the ground around it, :math:`\langle \rho \rangle`. [1]
    terms : TargetTerms
        :math:`\rho_a, T(\theta_s), e^{-\tau / \mu_v}, t_d(\theta_v), S, T_g`. [1]

    Returns
    -------
    toa_reflectance : array, shape of the broadcast inputs
        Apparent reflectance :math:`\rho^*`. [1]

    Raises
    ------
    ValueError
        If :math:`\langle \rho \rangle S \ge 1`, where the multiple reflections do not converge.

    References
    ----------
    [Tanre1990]_; [Vermote1997]_

    Examples
    --------
    Bright surroundings brighten a dark target:

    >>> terms = TargetTerms(0.1, 0.8, 0.6, 0.25, 0.2)
    >>> bright, dark = (inhomogeneous_reflectance(0.05, around, terms) for around in (0.4, 0.05))
    >>> round(float(bright - dark), 4)
    0.0787
    """
    path, down, direct, diffuse, albedo, gas = terms
    leaving = np.multiply(target, direct) + np.multiply(environment, diffuse)
    toa, refused = _by_cell(_apparent, (leaving, environment), (path, down, 1.0, albedo, gas))
    if refused:
        _refuse(environment, albedo, "the environment's reflectance")
    return toa


def target_reflectance(toa_reflectance, environment, terms):
    r"""
    Reflectance of a target in a known environment, from its apparent reflectance.

    .. math::

        \rho_c = \left[ \frac{y \, (1 - \langle \rho \rangle S)}{T(\theta_s)}
        - \langle \rho \rangle \, t_d(\theta_v) \right] e^{\tau / \mu_v}, \qquad y = \rho^* / T_g - \rho_a

    Parameters
    ----------
    toa_reflectance : array, shape (..., band, y, x)
        Apparent reflectance, :math:`\rho^*`. [1]
    environment, terms
        As in `inhomogeneous_reflectance`. [1]

    Returns
    -------
    target : array, shape of the broadcast inputs
        Negative where the scene is darker than atmosphere and environment alone. [1]

    Notes
    -----
    The exact inverse of `inhomogeneous_reflectance`.

    References
    ----------
    [Tanre1990]_; [Vermote1997]_

    Examples
    --------
    >>> terms = TargetTerms(0.1, 0.8, 0.6, 0.25, 0.2)
    >>> round(float(target_reflectance(inhomogeneous_reflectance(0.05, 0.4, terms), 0.4, terms)), 12)
    0.05
    """
    path, down, direct, diffuse, albedo, gas = terms
    upward = (toa_reflectance / gas - path) * (1 - environment * albedo) / down
    return (upward - environment * diffuse) / direct


@register_jitable
def apparent_reflectance_of_cell(leaving, around, path, down, up, albedo, gas):
    r"""
    Apparent reflectance at the top of the atmosphere of one cell.

    .. math::

        \rho^* = T_g \left[ \rho_a + T(\theta_s) \, \frac{\rho}{1 - \langle \rho \rangle S} \, T(\theta_v) \right]

    Parameters
    ----------
    leaving : float
        Reflectance of the ground that is seen, :math:`\rho`. [1]
    around : float
        That of the ground which exchanges light with the atmosphere, :math:`\langle \rho \rangle`. [1]
    path, down, up, albedo, gas : float
        As in `apparent_reflectance`. [1]

    Returns
    -------
    toa : float
        Infinite where :math:`\langle \rho \rangle S \ge 1`. [1]

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> apparent_reflectance_of_cell(0.25, 0.25, 0.0, 1.0, 1.0, 0.0, 1.0)
    0.25
    """
    trapped = around * albedo
    if trapped >= 1:
        return np.inf
    return gas * (path + down * leaving / (1 - trapped) * up)


@register_jitable
def corrected_reflectance_of_cell(toa, path, down, up, albedo, gas):
    r"""
    Reflectance of one cell of a uniform surface, from its apparent reflectance.

    Parameters
    ----------
    toa, path, down, up, albedo, gas : float
        As in `corrected_reflectance`, whose equation this is. [1]

    Returns
    -------
    reflectance : float
        [1]

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> corrected_reflectance_of_cell(0.25, 0.0, 1.0, 1.0, 0.0, 1.0)
    0.25
    """
    ground = (toa / gas - path) / (down * up)
    return ground / (1 + albedo * ground)


def _refuse(around, spherical_albedo, what):
    """Say which reflectances `apparent_reflectance_of_cell` has marked."""
    trapped = np.asarray(around, float) * np.asarray(spherical_albedo, float)
    raise ValueError(
        f"{what} times spherical_albedo must be below 1, got {np.nanmax(trapped):g}: "
        "reflectance is a fraction, not a percentage"
    )


def _by_cell(kernel, cells, terms):
    """
    Kernel over arrays that broadcast, and what it says of them.

    Terms that are the same along all last axes are not spread out over them.
    """
    cells = [np.asarray(each) for each in cells]
    terms = np.broadcast_arrays(*(np.asarray(each, float) for each in terms))
    shape = np.broadcast_shapes(terms[0].shape, *(each.shape for each in cells))
    own = (1,) * (len(shape) - terms[0].ndim) + terms[0].shape
    split = max((axis + 1 for axis, size in enumerate(own) if size > 1), default=0)
    spread = [np.broadcast_to(each.reshape(own[:split]), shape[:split]) for each in terms]
    spread = np.stack(spread).reshape(len(terms), math.prod(shape[:split]))
    out = np.empty((spread.shape[1], math.prod(shape[split:])))
    # A cell in single precision is widened when it is read.
    wide = [each if each.dtype == np.float32 else each.astype(float, copy=False) for each in cells]
    wide = (np.ascontiguousarray(np.broadcast_to(each, shape)).reshape(out.shape) for each in wide)
    said = kernel(*wide, spread, out)
    return out.reshape(shape)[()], said


# Where no light comes through, division by zero is no error but what numpy makes of it.
@njit(nogil=True, cache=True, error_model="numpy")
def _apparent(leaving, around, terms, out):
    """Fill in what is seen; how many reflectances are to be refused."""
    refused = 0
    for i in range(out.shape[0]):
        path, down, up, albedo, gas = terms[:, i]
        for j in range(out.shape[1]):
            out[i, j] = apparent_reflectance_of_cell(leaving[i, j], around[i, j], path, down, up, albedo, gas)
            refused += np.isinf(out[i, j])
    return refused


@njit(nogil=True, cache=True, error_model="numpy")
def _corrected(toa, terms, out):
    for i in range(out.shape[0]):
        path, down, up, albedo, gas = terms[:, i]
        for j in range(out.shape[1]):
            out[i, j] = corrected_reflectance_of_cell(toa[i, j], path, down, up, albedo, gas)
