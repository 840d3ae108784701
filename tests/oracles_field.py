"""Covariance of the autoregressive field from its spectrum on a torus."""

import numpy as np

from fifesim.ground.landscape.autoregression import response


def covariances(arp, size=512):
    """Covariances by lag from the two-dimensional spectrum on a torus that is many correlation lengths wide."""
    u = 2 * np.pi * np.fft.fftfreq(size)
    return np.fft.ifft2(response(arp, u[:, None], u) ** 2).real
