"""Slow references for the canopy: sums over leaves, a matrix exponential, and quadrature for the hot spot."""

from itertools import pairwise

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm


def leaf_cosines(inclination, zenith, azimuth):
    """Cosine of the angle between a direction and the normals of leaves at given azimuths relative to it. [1]"""
    inclination, zenith = np.radians(inclination), np.radians(zenith)
    return np.cos(inclination) * np.cos(zenith) + np.sin(inclination) * np.sin(zenith) * np.cos(azimuth)


def turned_leaves(inclination, sza, vza, raa, count=200_000):
    """Projections and area scattering coefficients of leaves of one inclination, averaged over azimuth."""
    azimuth = (np.arange(count) + 0.5) * 2 * np.pi / count
    sun = leaf_cosines(inclination, sza, azimuth)
    view = leaf_cosines(inclination, vza, azimuth - np.radians(raa))
    reflected = np.where(sun * view > 0, sun * view, 0).mean()
    transmitted = np.where(sun * view < 0, -sun * view, 0).mean()
    return np.abs(sun).mean(), np.abs(view).mean(), reflected, transmitted


def four_streams(lai, rho, tau, sza, vza, raa, inclination):
    """Four-stream solution for leaves of one inclination by a matrix exponential, without hot spot."""
    mu_s, mu_v = np.cos(np.radians([sza, vza]))
    sun, view, reflected, transmitted = turned_leaves(inclination, sza, vza, raa)
    ks, ko, bf = sun / mu_s, view / mu_v, np.cos(np.radians(inclination)) ** 2
    w = (reflected * rho + transmitted * tau) / (mu_s * mu_v)
    forward = {k: ((k + bf) * tau + (k - bf) * rho) / 2 for k in (ks, ko, 1.0)}
    backward = {k: ((k + bf) * rho + (k - bf) * tau) / 2 for k in (ks, ko, 1.0)}
    loss, back = 1 - forward[1.0], backward[1.0]
    streams = np.array(
        [
            [-ks, 0, 0, 0],
            [forward[ks], -loss, back, 0],
            [-backward[ks], -back, loss, 0],
            [-w, -backward[ko], -forward[ko], ko],
        ]
    )
    down = expm(streams * lai)
    # Unknown: upward streams at the top and downward streams at the bottom. Known: incoming streams.
    unknown = np.zeros((4, 4))
    unknown[:, :2] = down[:, 2:]
    unknown[0, 2] = unknown[1, 3] = -1
    known = np.stack([-down[:, 0], -down[:, 1], [0, 0, 1, 0], [0, 0, 0, 1]], axis=1)
    out = np.linalg.solve(unknown, known)
    rows = ["rsd rdd tdd -", "rso rdo tdo too", "tss - - -", "tsd tdd rdd -"]
    return {name: out[i, j] for i, row in enumerate(rows) for j, name in enumerate(row.split()) if name != "-"}


def sunlit_and_seen(lai, ks, ko, alpha):
    """Leaf area that is both sunlit and visible, by adaptive quadrature between its length scales."""
    overlap = (lambda x: x) if alpha == 0 else (lambda x: -np.expm1(-alpha * x) / alpha)

    def gap(x):
        return np.exp(-(ks + ko) * lai * x + np.sqrt(ks * ko) * lai * overlap(x))

    scales = np.outer([1 / max(alpha, 1e-9), 1 / max((ks + ko) * lai, 1e-9)], [0.3, 1, 3, 10, 30]).ravel()
    edges = np.unique(np.clip([0, *scales, 1], 0, 1))
    return lai * sum(quad(gap, a, b, epsabs=1e-15, epsrel=1e-10)[0] for a, b in pairwise(edges))


def fpar_of_green_leaves(lai, sza, brown, dissociation, crown_cover, fpar_inf, projection=0.5):
    """FPAR of green leaves with a mean projection: two layers of random crowns, Verhoef and Bach (2007). [1]"""
    cosine = np.cos(np.radians(sza))
    extinction, inside = projection / cosine, lai / crown_cover
    above, below = (1 - brown) * inside, brown * inside
    green_above = 1 - (1 - dissociation) * brown
    green_below = (1 - dissociation) * (1 - brown)
    absorbed = green_above * (1 - np.exp(-extinction * above))
    absorbed += green_below * np.exp(-extinction * above) * (1 - np.exp(-extinction * below))
    return (1 - (1 - crown_cover) ** (1 / cosine)) * fpar_inf * absorbed
