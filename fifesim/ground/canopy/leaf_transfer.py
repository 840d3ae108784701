"""Discrete ordinates: exact radiative transfer in a layer of leaves, with the hot spot of SAIL on the first order."""

import numpy as np
from numpy.polynomial.legendre import leggauss

from fifesim.base.arrays import numbers
from fifesim.base.caches import cached
from fifesim.ground.canopy.leaf_angles import leaf_angle_classes, leaf_projection
from fifesim.ground.canopy.sail_model import (
    CanopyLayer,
    bidirectional_gap,
    folded,
    hotspot_decay,
    volume_scattering,
)

_STREAMS = 16  # directions per hemisphere
_AZIMUTHS = 90  # of the sums for Fourier modes, from 0 to 180 degrees
_MOST_MODES = 24
_MODE_TOLERANCE = 1e-6  # of the reflectance, for what is left out of the sum over modes [1]

# Weight of the directions of sun and view among the Gauss points: light from them is found, and no other changes.
_LIGHT_WEIGHT = 1e-9

# Largest optical thickness of the first layer in any direction: its error is of the order of the square.
_THIN = 0.01


def discrete_ordinates(
    lai, leaf_reflectance, leaf_transmittance, *, sza, vza=0.0, raa=0.0, leaf_angles="spherical", hotspot=0.0
):
    r"""
    Reflectances and transmittances of a leaf canopy by discrete ordinates, with Kuusk's hot spot.

    For the radiance :math:`I` of down- and upward directions, Fourier mode by mode,

    .. math::

        \mu_i \frac{dI^-_i}{dt} &= -G_i I^-_i + 2 \pi \sum_j w_j \left( F_{ij} I^-_j + B_{ij} I^+_j \right) \\
        -\mu_i \frac{dI^+_i}{dt} &= -G_i I^+_i + 2 \pi \sum_j w_j \left( F_{ij} I^+_j + B_{ij} I^-_j \right)

    where :math:`F` and :math:`B` are the forward and backward area scattering of the leaves.

    Parameters
    ----------
    lai : array
        Leaf area index. NaN gives NaN. [m2 m-2]
    leaf_reflectance, leaf_transmittance : array, broadcastable to `lai`
        Their sum must not exceed 1. [1]
    sza, vza, raa : float
        Zenith angles below 90, and relative azimuth with 0 in the hot spot. [degree]
    leaf_angles : optional
        Whatever `leaf_angle_classes` accepts.
    hotspot : float, optional
        Ratio of leaf size to canopy height; 0 for none. It acts on light that is scattered once. [1]

    Returns
    -------
    canopy : CanopyLayer
        As from `sail`. [1]

    Notes
    -----
    A thin layer, in which radiance changes linearly, is doubled until it has the leaf area of the canopy. Sun and view
    are directions of the quadrature with a negligible weight. Light scattered once is replaced by its closed form.

    References
    ----------
    [Verhoef1984]_, area scattering; [Kuusk1991]_, hot spot
    """
    shape = np.broadcast_shapes(np.shape(lai), np.shape(leaf_reflectance), np.shape(leaf_transmittance))
    given = lai, leaf_reflectance, leaf_transmittance
    lai, rho, tau = (np.broadcast_to(numbers(each), shape).ravel() for each in given)
    sza, vza, raa = float(sza), float(vza), float(folded(raa))
    leaves = leaf_angle_classes(leaf_angles)
    nodes = _nodes(sza, vza)
    known = ~np.isnan(lai + rho + tau)
    fields = np.full((len(CanopyLayer._fields), lai.size), np.nan)
    if known.any():
        cells = lai[known], rho[known], tau[known]
        fields[:, known] = _layers(*cells, nodes, (sza, vza, raa), leaves, float(hotspot))
    return CanopyLayer(*(each.reshape(shape)[()] for each in fields))


def _nodes(sza, vza):
    """Cosines and weights of the directions of a hemisphere: Gauss points, sun and view."""
    points, weights = leggauss(_STREAMS)
    mu = np.append((points + 1) / 2, np.cos(np.radians([sza, vza])))
    return mu, np.append(weights / 2, [_LIGHT_WEIGHT] * 2)


@cached(32, "area scattering of leaves between directions")
def _area_scattering(sza, vza, leaves):
    """Fourier modes of the area scattering of leaf reflectance and transmittance, shape (2, modes, n, n). [sr-1]"""
    mu, _ = _nodes(sza, vza)
    zenith = np.degrees(np.arccos(mu))
    azimuth = 180 * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS
    rows, columns = np.triu_indices(mu.size)
    sums = np.zeros((2, rows.size, _AZIMUTHS))
    for inclination, share in zip(leaves.inclination, leaves.fraction, strict=True):
        if share:
            pair = zenith[rows][:, None], zenith[columns][:, None]
            sums += share * np.array(volume_scattering(inclination, *pair, azimuth))
    modes = np.cos(np.radians(azimuth[:, None] * np.arange(_MOST_MODES))) / _AZIMUTHS
    found = np.empty((2, _MOST_MODES, mu.size, mu.size))
    found[:, :, rows, columns] = found[:, :, columns, rows] = np.moveaxis(sums @ modes, -1, 1)
    return found


def _layers(lai, rho, tau, nodes, angles, leaves, hotspot):
    """Fields of CanopyLayer of cells, shape (field, n)."""
    (mu, weights), (sza, vza, raa) = nodes, angles
    reflected, transmitted = _area_scattering(sza, vza, leaves)
    # The interception that the scattering of the quadrature implies: it conserves energy.
    projection = 2 * np.pi * (reflected[0] + transmitted[0]) @ weights
    root = np.sqrt(weights * mu)
    sun, view = mu.size - 2, mu.size - 1
    ks, ko = projection[[sun, view]] / mu[[sun, view]]
    once = np.pi / (mu[sun] * mu[view]) * -np.expm1(-(ks + ko) * lai) / (ks + ko)
    azimuthal = sza > 0 and vza > 0
    again = 0.0
    for mode in range(_MOST_MODES if azimuthal else 1):
        back = reflected[mode] * rho[:, None, None] + transmitted[mode] * tau[:, None, None]
        on = transmitted[mode] * rho[:, None, None] + reflected[mode] * tau[:, None, None]
        upward, downward = _doubled(lai, back, on, projection, mu, weights)
        if mode == 0:
            fluxes = _fluxes(upward, downward, root, sun, view)
        more = upward[:, view, sun] / (2 * root[view] * root[sun]) - back[:, view, sun] * once
        again = again + (2 if mode else 1) * np.cos(np.radians(mode * raa)) * more
        if mode > 1 and np.abs(more).max() < _MODE_TOLERANCE:
            break
    return _with_hotspot(lai, rho, tau, angles, leaves, hotspot, again, fluxes)


def _with_hotspot(lai, rho, tau, angles, leaves, hotspot, again, fluxes):
    """Fields of CanopyLayer, with the light scattered once and the gaps of both beams in closed form."""
    sza, vza, raa = angles
    inclination, fraction = np.asarray(leaves.inclination), np.asarray(leaves.fraction)
    mu_s, mu_v = np.cos(np.radians([sza, vza]))
    ks, ko = (leaf_projection(inclination, each) @ fraction / np.cos(np.radians(each)) for each in (sza, vza))
    facing, turned = (each @ fraction * np.pi / (mu_s * mu_v) for each in volume_scattering(inclination, *angles))
    alpha = hotspot_decay(sza, vza, raa, ks + ko, numbers(hotspot))
    both, sunlit_and_seen = bidirectional_gap(lai, ks, ko, alpha)
    tss, too = np.exp(-ks * lai), np.exp(-ko * lai)
    rdo, rsd, rdd, from_sun, to_view, tdd = fluxes
    rso = (facing * rho + turned * tau) * sunlit_and_seen + again
    return np.stack(np.broadcast_arrays(rso, rdo, rsd, rdd, tss, too, from_sun - tss, to_view - too, tdd, both, rdd))


def _fluxes(upward, downward, root, sun, view):
    """Hemispherical reflectances of view, sun and isotropic light, and transmittances, direct light included."""
    reflected, passed = upward @ root, downward @ root
    each = [reflected[:, view] / root[view], reflected[:, sun] / root[sun], 2 * reflected @ root]
    return *each, passed[:, sun] / root[sun], passed[:, view] / root[view], 2 * passed @ root


def _doubled(lai, back, on, projection, mu, weights):
    """Reflection and transmission of layers, shape (n, directions, directions), between roots of flux."""
    # Symmetric matrices: radiance times the root of weight times cosine.
    scale = 2 * np.pi * np.sqrt(np.outer(weights / mu, weights / mu))
    loss, gain = np.diag(projection / mu) - scale * on, scale * back
    steepest = (projection / mu).max() * max(float(lai.max()), 1e-12)
    doublings = max(int(np.ceil(np.log2(steepest / _THIN))), 0)
    half, one = (lai / 2**doublings / 2)[:, None, None], np.eye(mu.size)
    # Radiance that is linear within the layer: both sums of the light leaving are of both sums entering.
    even, odd = (np.linalg.solve(one + half * each, one - half * each) for each in (loss - gain, loss + gain))
    upward, downward = (even - odd) / 2, (even + odd) / 2
    for _ in range(doublings):
        passed = np.linalg.solve(one - upward @ upward, np.concatenate([upward @ downward, downward], axis=-1))
        upward, downward = upward + downward @ passed[..., : mu.size], downward @ passed[..., mu.size :]
    return upward, downward
