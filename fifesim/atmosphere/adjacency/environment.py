"""The adjacency effect: how far around a target the ground adds to what a satellite sees of it."""

from typing import NamedTuple

import numpy as np

# Nodes of the Gauss-Legendre rule along the edges of cells, and how many rows and columns of cells around the centre
# have the finer one. The flux through an edge varies over a length of its distance from the centre.
_FINE_NODES, _COARSE_NODES = 24, 3
_FINE_CELLS = 8


class Scatterers(NamedTuple):
    """Something of the molecules and of the aerosol, which scatter light into the view."""

    molecules: object
    aerosol: object


def environment_function(radius, vza=0.0):
    r"""
    Share of the environment's light that leaves the ground within a distance of the target.

    .. math::

        F_R &= 1 - 0.930 \, e^{-0.080 r} - 0.070 \, e^{-1.10 r} \\
        F_A &= 1 - 0.448 \, e^{-0.27 r} - 0.552 \, e^{-2.83 r} \\
        F_R' &= F_R \left[ 1 + L (1 - F_R) \right] \\
        F_A' &= F_A \left[ 1 + a + b F_A - (a + b) F_A^2 \right]

    with r in km, :math:`L = \ln \mu_v`, :math:`a = 1.3347 L + 0.57757 L^2` and :math:`b = -1.479 L - 1.5275 L^2`.

    Parameters
    ----------
    radius : array
        Horizontal distance, r. [m]
    vza : float or array, broadcastable, optional
        [degree]

    Returns
    -------
    molecules, aerosol : array, shape of the broadcast inputs
        :math:`F_R'` and :math:`F_A'`, from 0 at the target to 1. [1]

    Raises
    ------
    ValueError
        If vza is not from 0 to below 90 degrees.

    Notes
    -----
    Fits to Monte Carlo runs for molecules with a scale height of 8 km and aerosol with 2 km, seen from space. The
    correction for the view keeps the symmetry around the target. Above 68 degrees that of the molecules falls below
    zero near the target, where it is taken as zero.

    References
    ----------
    [Tanre1981]_ for nadir; [Vermote1997]_ for the view angle

    Examples
    --------
    Of what molecules and aerosol scatter into the view, these shares come from within 1 km:

    >>> [round(float(share), 2) for share in environment_function(1000.0)]
    [0.12, 0.63]
    """
    vza = np.asarray(vza, float)
    if not np.all((vza >= 0) & (vza < 90)):
        raise ValueError(f"vza must be from 0 to below 90 degrees, got {vza}: it is the angle from the zenith")
    r = np.asarray(radius, float) / 1000  # the fits are in km
    molecules = -0.930 * np.expm1(-0.080 * r) - 0.070 * np.expm1(-1.10 * r)
    aerosol = -0.448 * np.expm1(-0.27 * r) - 0.552 * np.expm1(-2.83 * r)
    log_mu_v = np.log(np.cos(np.radians(vza)))
    a = (1.3347 + 0.57757 * log_mu_v) * log_mu_v
    b = (-1.479 - 1.5275 * log_mu_v) * log_mu_v
    molecules = molecules * (1 + log_mu_v * (1 - molecules))
    aerosol = aerosol * (1 + a + aerosol * (b - (a + b) * aerosol))
    return Scatterers(np.maximum(molecules, 0.0), aerosol)


def environment_weights(diffuse_up_molecules, diffuse_up_aerosol):
    r"""
    Shares of molecules and aerosol in the light that is scattered into the view.

    Parameters
    ----------
    diffuse_up_molecules, diffuse_up_aerosol : array, broadcastable
        Diffuse transmittance from the ground to the sensor of either alone. [1]

    Returns
    -------
    molecules, aerosol : array, shape of the broadcast inputs
        They sum to 1, or are both 0 where nothing scatters. [1]

    References
    ----------
    [Vermote1997]_

    Examples
    --------
    >>> [float(share) for share in environment_weights(0.25, 0.75)]
    [0.25, 0.75]
    """
    total = np.add(diffuse_up_molecules, diffuse_up_aerosol, dtype=float)
    total = np.where(total > 0, total, 1.0)
    return Scatterers(diffuse_up_molecules / total, diffuse_up_aerosol / total)


def mixed_environment_function(radius, vza, diffuse_up_molecules, diffuse_up_aerosol):
    r"""
    Environment function of molecules and aerosol together.

    .. math:: F = \frac{t_R F_R' + t_A F_A'}{t_R + t_A}

    Parameters
    ----------
    radius : array
        Horizontal distance from the target. [m]
    vza : float or array, broadcastable
        [degree]
    diffuse_up_molecules, diffuse_up_aerosol : array, broadcastable
        Diffuse transmittance from the ground to the sensor of either alone, :math:`t_R` and :math:`t_A`. [1]

    Returns
    -------
    share : array, shape of the broadcast inputs
        1 where nothing scatters. [1]

    Raises
    ------
    ValueError
        If vza is not from 0 to below 90 degrees.

    References
    ----------
    [Vermote1997]_

    Examples
    --------
    >>> float(mixed_environment_function(0.0, 30.0, 0.25, 0.75))
    0.0
    """
    weights = environment_weights(diffuse_up_molecules, diffuse_up_aerosol)
    # What neither has is the target's own.
    return _weighted(weights, environment_function(radius, vza)) + (1 - weights.molecules - weights.aerosol)


def _weighted(weights, functions):
    return weights.molecules * functions.molecules + weights.aerosol * functions.aerosol


def point_spread(shape, cell, vza, weight_molecules, weight_aerosol):
    r"""
    Weights of the cells of a grid in the environment of the centre of one.

    The density around the target is :math:`F'(r) / 2 \pi r`. It is the divergence of the field
    :math:`F(r) / 2 \pi r` that points outward, so that the weight of a cell is the flux of this field out of it,

    .. math:: w = \oint \frac{F(r)}{2 \pi r^2} \, d \; ds

    with d the distance of an edge's line from the target: integrals of smooth functions, also around the target itself,
    where the density has no bound.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns from the target's own cell on, in one quadrant; the others are its mirror images.
    cell : (float, float)
        Size of the cells, down and across. [m]
    vza : float
        [degree]
    weight_molecules, weight_aerosol : float
        Shares of the two, as `environment_weights` gives them. [1]

    Returns
    -------
    weights : array, shape (rows, columns)
        Over the whole plane they sum to 1. [1]

    Raises
    ------
    ValueError
        If vza is not from 0 to below 90 degrees.

    References
    ----------
    [Tanre1981]_

    Examples
    --------
    >>> weights = point_spread((2, 2), (60.0, 60.0), 0.0, 0.0, 1.0)
    >>> bool(weights[0, 0] > weights[0, 1] > weights[1, 1]), bool(weights[0, 1] == weights[1, 0])
    (True, True)
    """
    weights = Scatterers(weight_molecules, weight_aerosol)
    scattered = _flux_differences(shape, cell, vza, weights, _COARSE_NODES)
    rows, columns = (min(size, _FINE_CELLS) for size in shape)
    scattered[:rows, :columns] = _flux_differences((rows, columns), cell, vza, weights, _FINE_NODES)
    scattered[0, 0] += 1 - weight_molecules - weight_aerosol
    return scattered


def _flux_differences(shape, cell, vza, weights, nodes):
    """Flux out of cells, from that through their lower and right edges; the flux through the target's is symmetric."""
    (rows, columns), (down, across) = shape, cell
    y, x = down * np.arange(rows)[:, None], across * np.arange(columns)
    lower = _edge_flux(y + down / 2, x, across, vza, weights, nodes)
    right = _edge_flux(x + across / 2, y, down, vza, weights, nodes)
    vertical = np.diff(lower, axis=0, prepend=-lower[:1])
    return vertical + np.diff(right, axis=1, prepend=-right[:, :1])


def _edge_flux(distance, middle, length, vza, weights, nodes):
    """Flux through edges on lines at a distance from the target, by the place of their middle on these. [1]"""
    distance, middle = np.broadcast_arrays(distance, middle)
    node, weight = (values[:, None] for values in np.polynomial.legendre.leggauss(nodes))
    flux = np.empty(distance.shape)
    # By rows, which stay in the processor's cache: a scene of 185 km has ten million blocks.
    for row in range(len(flux)):
        r_squared = distance[row] ** 2 + (middle[row] + node * length / 2) ** 2
        scattered = _weighted(weights, environment_function(np.sqrt(r_squared), vza))
        flux[row] = (weight * scattered / r_squared).sum(axis=0) * distance[row]
    return flux * length / (4 * np.pi)
