"""References for horizon and sky view: ray marching, and the published integral of Dozier."""

import numpy as np


def march(dem, row, column, cell_y, cell_x, azimuth, reach, step=0.05):
    """Tangent of the horizon elevation at one cell, from bilinear samples in small steps of distance."""
    r = np.arange(1, int(reach / step) + 1) * step
    # Before the first grid line across the ray, the ground belongs to the local slope.
    down, right = np.cos(np.radians(azimuth)) / cell_y, np.sin(np.radians(azimuth)) / cell_x
    r = r[r >= 1 / max(abs(down), abs(right)) - 1e-9]
    i = row - r * down
    j = column + r * right
    inside = (i >= 0) & (i <= dem.shape[0] - 1) & (j >= 0) & (j <= dem.shape[1] - 1)
    r, i, j = r[inside], i[inside], j[inside]
    a, b = np.minimum(i.astype(int), dem.shape[0] - 2), np.minimum(j.astype(int), dem.shape[1] - 2)
    u, v = i - a, j - b
    z = (1 - u) * ((1 - v) * dem[a, b] + v * dem[a, b + 1]) + u * ((1 - v) * dem[a + 1, b] + v * dem[a + 1, b + 1])
    return max(0.0, float(np.max((z - dem[row, column]) / r, initial=0.0)))


def dozier(slope, aspect, tangent_of, count=200_000):
    """Eq. 7b of Dozier and Frew by the midpoint rule; `tangent_of` is a function of azimuth [radian]."""
    phi = (np.arange(count) + 0.5) * 2 * np.pi / count
    s, a = np.radians(slope), np.radians(aspect)
    own = np.arctan2(1.0, -np.tan(s) * np.cos(phi - a))  # Eq. 10
    h = np.minimum(np.minimum(np.arctan2(1.0, tangent_of(phi)), own), np.pi / 2)
    return float(np.mean(np.cos(s) * np.sin(h) ** 2 + np.sin(s) * np.cos(phi - a) * (h - np.sin(h) * np.cos(h))))


def plane_gradient(slope, aspect):
    """Rise eastward and northward of a plane that falls by a slope toward an aspect [degree]."""
    steep, azimuth = np.tan(np.radians(slope)), np.radians(aspect)
    return -steep * np.sin(azimuth), -steep * np.cos(azimuth)


def plane(shape, cell_y, cell_x, slope, aspect):
    """Elevation of a plane that falls by a slope toward an aspect [degree]."""
    i, j = np.mgrid[: shape[0], : shape[1]].astype(float)
    north, east = -i * cell_y, j * cell_x
    a = np.radians(aspect)
    return 1000 - np.tan(np.radians(slope)) * (east * np.sin(a) + north * np.cos(a))


def hills(shape, seed=0, relief=30.0, length=9.0):
    """Smooth random ground: waves of several lengths [cells]."""
    rng = np.random.default_rng(seed)
    i, j = np.mgrid[: shape[0], : shape[1]].astype(float)
    z = np.full(shape, 400.0)
    for wave in length * 1.6 ** np.arange(5):
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        z += relief * wave / (10 * length) * np.sin(2 * np.pi / wave * (i * np.cos(angle) + j * np.sin(angle)) + phase)
    return z
