"""Slow references for scattering: numerical Eddington equations, and non-Lambertian ground."""

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from fifesim.atmosphere import aerosols, engines
from fifesim.atmosphere.successive_orders import stokes_reflectance
from fifesim.base.geometry import scattering_angle_cosine

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


def henyey_greenstein(asymmetry, scattering_cosine):
    """Phase function of a given asymmetry, whose mean is 1. [1]"""
    return (1 - asymmetry**2) / (1 + asymmetry**2 - 2 * asymmetry * scattering_cosine) ** 1.5


class Ground(NamedTuple):
    """Reflectance factors of a non-Lambertian ground. [1]"""

    directional: object  # function of sza, vza and raa [degree]
    of_skylight: object  # function of vza: isotropic light toward the sensor
    of_sunlight: object  # function of sza: into the hemisphere
    of_both: float  # isotropic light into the hemisphere


class Air(NamedTuple):
    """Atmosphere for given zenith angles of sun and view. [1]"""

    path: float
    down: float
    up: float
    direct_down: float
    direct_up: float
    albedo: float
    sky: object  # radiance at the ground, function of sza, vza (n, 1) and raa (m,): pi L / (E0 mu_s)

    def over_lambertian(self, reflectance):
        return self.path + self.down * self.up * reflectance / (1 - self.albedo * reflectance)

    @property
    def skylight(self):
        return 1 - self.direct_down / self.down


def sky_directions(air, zenith, flux, *, fine):
    """
    Quadrature of skylight, refined around the sun.

    Returns zenith angles, azimuths relative to the sun [degree], and weights that sum to the flux of the skylight.
    """
    rings, turns, nodes = ((3, 8, 20), (3, 8, 20, 50, 110), 4) if fine else ((8,), (8, 50), 2)
    rings = {0, 90, *(edge for step in rings for edge in (zenith - step, zenith, zenith + step) if 0 < edge < 75), 75}
    theta, theta_weights = _panels(sorted(rings), nodes)
    phi, phi_weights = _panels([0, *turns, 180], nodes)
    turned = np.radians(theta)
    weights = (np.cos(turned) * np.sin(turned) * np.radians(theta_weights))[:, None] * np.radians(phi_weights) / np.pi
    light = air.sky(zenith, theta, phi) * weights
    # Both sides of the principal plane.
    found = np.broadcast_arrays(theta[:, None], np.concatenate([phi, -phi]), np.concatenate([light, light], axis=1))
    theta, phi, light = (each.ravel() for each in found)
    assert abs(light.sum() / flux - 1) < (1e-3 if fine else 0.05)
    return theta, phi, light * flux / light.sum()


def coupled_reflectance(air, ground, sza, vza, raa):
    """
    Apparent reflectance over a non-Lambertian ground.

    The ground scatters sunlight and skylight between all directions. The scattered light goes up directly or is
    scattered by the air; by reciprocity, this equals the skylight of a sun at the sensor. Light that the air scatters
    back to the ground is taken as isotropic.
    """
    diffuse_up = air.up - air.direct_up
    below, coarse = (sky_directions(air, sza, air.down - air.direct_down, fine=fine) for fine in (True, False))
    theta, phi, upward = sky_directions(air, vza, diffuse_up, fine=True)
    sunlit = air.direct_down * ground.directional(sza, theta, _folded(phi + raa))
    toward_air = upward @ sunlit
    theta, phi, upward = sky_directions(air, vza, diffuse_up, fine=False)
    if vza == 0:  # the same from all azimuths: the azimuth of the skylight does not matter
        zenith, place = np.unique(coarse[0], return_inverse=True)
        coarse = zenith, np.zeros(zenith.size), np.bincount(place, coarse[2])
    for here in np.array_split(np.arange(theta.size), 8):
        away = _folded(coarse[1][:, None] - phi[here] - raa)
        scattered = ground.directional(coarse[0][:, None], theta[here], away)
        toward_air += coarse[2] @ scattered @ upward[here]
    seen = air.direct_down * ground.directional(sza, vza, raa)
    seen += below[2] @ ground.directional(below[0], vza, _folded(below[1] - raa))
    leaving = air.direct_down * ground.of_sunlight(sza) + below[2] @ ground.of_sunlight(below[0])
    back = air.albedo * leaving / (1 - air.albedo * ground.of_both)
    again = air.direct_up * ground.of_skylight(vza) + upward @ ground.of_skylight(theta)
    return air.path + air.direct_up * seen + toward_air + back * again


def _panels(edges, nodes):
    """Gauss points and weights on consecutive intervals."""
    points, weights = leggauss(nodes)
    edges = np.asarray(edges, float)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (points + 1)).ravel(), (half * weights).ravel()


def _folded(azimuth):
    return np.abs((azimuth + 180) % 360 - 180)


def mixed_stokes(atmosphere, wavelength, sza, vza, raa, *, at_ground=False, ground=0.0):
    """I, Q and U at the top of the atmosphere or of the sky at the ground, without gases, shape (3, V, R, n)."""
    cosine = scattering_angle_cosine(sza, np.asarray(vza, float)[:, None], np.asarray(raa, float))
    cosine = -cosine if at_ground else cosine
    vertical = aerosols.vertical(atmosphere.aerosol)
    options = {"at_ground": at_ground, "ground": ground, "vertical": vertical}
    found = []
    for at in np.asarray(wavelength, float)[:, None]:
        depths = (
            float(depth(at)[0]) for depth in (atmosphere.rayleigh_optical_depth, atmosphere.aerosol_optical_depth)
        )
        *aerosol, phase = engines.scatterers(atmosphere, at, cosine, True)
        none = np.zeros(cosine.shape)
        polarization = aerosols.aerosol_polarization(atmosphere.aerosol, cosine, at[0]) if atmosphere.aot else none
        optics = *depths, *aerosol, phase, polarization
        found.append(stokes_reflectance(*optics, sza, vza, raa, **options))
    return np.stack(found, axis=-1)
