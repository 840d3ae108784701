"""Slow reference for the scattering formulas: the Eddington equations integrated numerically."""

import numpy as np
from scipy.integrate import quad, solve_bvp

# Siewert (2000), problem IIA: beta, alpha, zeta and gamma of spheres.
SIEWERT = np.array(
    [
        [1, 0, 0, 0],
        [2.104031, 0, 0, 0],
        [2.095158, 3.726079, 3.615946, -0.116688],
        [1.414939, 2.202868, 2.240516, -0.209370],
        [0.703593, 1.190694, 1.139473, -0.227137],
        [0.235001, 0.391203, 0.365605, -0.144524],
        [0.064039, 0.105556, 0.082779, -0.052640],
        [0.012837, 0.020484, 0.013649, -0.012400],
        [0.002010, 0.003097, 0.001721, -0.002093],
        [0.000246, 0.000366, 0.000172, -0.000267],
        [0.000024, 0.000035, 0.000014, -0.000027],
        [0.000002, 0.000003, 0.000001, -0.000002],
    ]
)


def eddington_intensities(tau, albedo, asymmetry, mu_s):
    """Mean J and net upward H diffuse intensity as functions of depth, sun of flux pi, black surface. [1]"""

    def slopes(depth, state):
        mean, net = state
        beam = albedo / 4 * np.exp(-depth / mu_s)
        return np.stack([3 * (1 - albedo * asymmetry) * net + 3 * asymmetry * mu_s * beam, (1 - albedo) * mean - beam])

    def edges(top, bottom):
        return np.array([top[0] - 2 * top[1], bottom[0] + 2 * bottom[1]])

    depths = np.linspace(0, tau, 41)
    return solve_bvp(slopes, edges, depths, np.zeros((2, 41)), tol=1e-9).sol


def sobolev_reflectance(tau, albedo, asymmetry, phase, mu_s, mu_v):
    """Source function of the Eddington field, with single scattering exact, integrated along the view. [1]"""
    field = eddington_intensities(tau, albedo, asymmetry, mu_s)

    def emitted(depth):
        mean, net = field(depth)
        once = albedo / 4 * phase * np.exp(-depth / mu_s)
        return (albedo * mean + 3 * albedo * asymmetry * mu_v * net + once) * np.exp(-depth / mu_v) / mu_v

    return quad(emitted, 0, tau, epsabs=1e-12, epsrel=1e-10)[0] / mu_s


def eddington_flux(tau, albedo, asymmetry, mu_s):
    """Plane albedo and total transmittance of the flux. [1]"""
    field = eddington_intensities(tau, albedo, asymmetry, mu_s)
    return 4 * field(0)[1] / mu_s, np.exp(-tau / mu_s) - 4 * field(tau)[1] / mu_s
