"""Angular distribution of the light of the sky, and its coupling with ground that is not Lambertian."""

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from fifesim.atmosphere import aerosols
from fifesim.atmosphere.column import mixed_column
from fifesim.atmosphere.engines import scatterers
from fifesim.atmosphere.successive_orders import LAYERS, STREAMS, leaving_light, lit_from_below, stokes_reflectance
from fifesim.base.caches import cached
from fifesim.base.geometry import scattering_angle_cosine

# Edges of the zenith panels on both sides of the sun, and of the azimuth panels from the sun [degree], and Gauss points
# in each panel of both. The bright sky around the sun needs small panels.
_ASIDE, _AROUND, _POINTS = (4.0, 14.0), (0.0, 6.0, 30.0, 90.0, 180.0), (5, 3)

# Zenith angles and azimuths of pairs of directions of the sky, whose light is 1 to 10 % of the image.
_COARSE, _TURNS = 12, 24


class SkyWeights(NamedTuple):
    """
    Light of the sky over directions, with the sun at one zenith angle.

    Weights of the irradiance on level ground; each array of weights sums up to 1.
    """

    zenith: np.ndarray
    """Zenith angles, shape (n,). [degree]"""
    azimuth: np.ndarray
    """Azimuths from the sun, one side of its plane, shape (m,). [degree]"""
    light: np.ndarray
    """Weights of the sky over black ground, shape (n, m). [1]"""
    returned: np.ndarray
    """Weights of the light from the ground that the atmosphere returns, shape (n, m). [1]"""


class GroundStreams(NamedTuple):
    """
    Mean reflectance factors between light and view. [1]

    First the light that falls on the ground, then its way: ``sun``, ``sky`` and ``air``, the light that the atmosphere
    returns to the ground; ``view`` is direct, ``sky`` by scattering into the view, ``air`` back to the atmosphere.
    """

    sun_view: np.ndarray
    sky_view: np.ndarray
    air_view: np.ndarray
    sun_sky: np.ndarray
    sky_sky: np.ndarray
    air_sky: np.ndarray
    sun_air: np.ndarray
    sky_air: np.ndarray
    air_air: np.ndarray


def directional_coupling(
    streams, tss, tsd, too, tdo, spherical_albedo, path_reflectance=0.0, gas_transmittance=1.0, around=None
):
    r"""
    Reflectance at the top of the atmosphere over ground with any reflectance, under the actual sky.

    .. math::

        \rho^* &= T_g \left[ \rho_a + \tau_{ss} (r_{so} \tau_{oo} + r_{s>} \tau_{do})
            + \tau_{sd} (r_{>o} \tau_{oo} + r_{>>} \tau_{do}) + S \, \frac{F B}{1 - r_{aa} S} \right] \\
        F &= \tau_{ss} r_{sa} + \tau_{sd} r_{>a}, \qquad B = r_{ao} \tau_{oo} + r_{a>} \tau_{do}

    where > is the light of the sky, also in the way to the sensor, and a the light that the atmosphere returns.

    Parameters
    ----------
    streams : GroundStreams
        [1]
    tss, tsd : array
        Direct and diffuse transmittance from the sun. [1]
    too, tdo : array
        Direct and diffuse transmittance to the sensor. [1]
    spherical_albedo, path_reflectance, gas_transmittance : array
        :math:`S, \rho_a, T_g`. [1]
    around : GroundStreams, optional
        Mean streams of the surroundings, which exchange light with the atmosphere; by default the ground itself. The
        three streams to the view are of the ground alone. [1]

    Returns
    -------
    toa_reflectance : array, shape of the broadcast inputs
        [1]

    Notes
    -----
    Light that the atmosphere scatters into the view leaves the ground in the directions of the sky of a sun at the
    sensor, by reciprocity. Returned light has the directions of light over Lambertian ground. The result is reciprocal;
    over ground with equal reflectances it is `fifesim.atmosphere.coupling.apparent_reflectance`.

    References
    ----------
    [Tanre1990]_; [VerhoefBach2007]_

    Examples
    --------
    >>> streams = GroundStreams(*[0.25] * 9)
    >>> float(directional_coupling(streams, 0.5, 0.25, 0.5, 0.25, 0.0))
    0.140625
    """
    r, a = streams, streams if around is None else around
    once = tss * (r.sun_view * too + a.sun_sky * tdo) + tsd * (r.sky_view * too + a.sky_sky * tdo)
    fallen, back = tss * a.sun_air + tsd * a.sky_air, r.air_view * too + a.air_sky * tdo
    again = spherical_albedo * fallen * back / (1 - a.air_air * spherical_albedo)
    return gas_transmittance * (path_reflectance + once + again)


def scale_of_ground(
    toa_reflectance, streams, tss, tsd, too, tdo, spherical_albedo, path_reflectance=0.0, gas_transmittance=1.0
):
    r"""
    Factor of a ground of known shape, from its reflectance at the top of the atmosphere.

    .. math:: \rho^* / T_g - \rho_a = s X + s^2 \, \frac{S F B}{1 - s \, r_{aa} S}

    Parameters
    ----------
    toa_reflectance : array
        [1]
    streams : GroundStreams
        Reflectance streams of the ground with the factor 1. [1]
    tss, tsd, too, tdo, spherical_albedo, path_reflectance, gas_transmittance : array
        As in `directional_coupling`. [1]

    Returns
    -------
    scale : array, shape of the broadcast inputs
        :math:`s`, the inverse of `directional_coupling` for ground that is :math:`s` times as bright. [1]

    Examples
    --------
    >>> streams, air = GroundStreams(*[0.25] * 9), (0.5, 0.25, 0.5, 0.25, 0.2, 0.1)
    >>> brighter = GroundStreams(*[0.5] * 9)
    >>> float(round(scale_of_ground(directional_coupling(brighter, *air), streams, *air), 12))
    2.0
    """
    r, y = streams, toa_reflectance / gas_transmittance - path_reflectance
    once = tss * (r.sun_view * too + r.sun_sky * tdo) + tsd * (r.sky_view * too + r.sky_sky * tdo)
    fallen, back = tss * r.sun_air + tsd * r.sky_air, r.air_view * too + r.air_sky * tdo
    kept = r.air_air * spherical_albedo
    square, linear = spherical_albedo * fallen * back - kept * once, once + y * kept
    return 2 * y / (linear + np.sqrt(linear**2 + 4 * square * y))


def ground_streams(reflectance, sun_sky, view_sky, sza, vza, raa):
    r"""
    Mean reflectance factors of a ground over the sky of the sun and over the sky of a sun at the sensor.

    .. math:: r_{>o} = \sum_k w_k \, r(\Omega_k \to o), \qquad r_{>>} = \sum_{k, l} w_k v_l \, r(\Omega_k \to \Omega_l)

    Parameters
    ----------
    reflectance : callable
        ``reflectance(sza, vza, raa)`` of arrays of shape (n,) [degree]. It returns a reflectance factor of shape
        (..., n), or the four factors ``rso``, ``rdo``, ``rsd`` and ``rdd`` of a canopy. [1]
    sun_sky, view_sky : SkyWeights
        With the sun at `sza`, and at `vza`.
    sza, vza, raa : float
        [degree]

    Returns
    -------
    streams : GroundStreams
        Fields of shape (...). [1]

    Notes
    -----
    A canopy reflects light that the atmosphere returns with its own rsd, rdo and rdd: the mean of SAIL's rso over
    directions is up to 15 % above them, and does not conserve energy. Pairs of directions of the sky are on a coarse
    grid, onto which the weights are interpolated in the cosine of the zenith angle and in Fourier modes of the azimuth.

    Examples
    --------
    >>> even = weighted_sky(lambda zenith, azimuth: np.outer(zenith, azimuth), np.cos, 0.0)
    >>> means = ground_streams(lambda sza, vza, raa: 0.25 + 0 * raa, even, even, 0.0, 0.0, 0.0)
    >>> all(abs(each - 0.25) < 1e-12 for each in means)
    True
    """
    (down, turned, weights), (up, away, back) = _one_way(sun_sky, vza, raa), _one_way(view_sky, sza, raa)
    direct = reflectance(*(np.array([each], float) for each in (sza, vza, raa)))
    to_view = reflectance(down, np.full(down.size, float(vza)), turned)
    from_sun = reflectance(np.full(up.size, float(sza)), up, away)
    pairs, shares = _both_ways(sun_sky, view_sky, raa)
    between = getattr(reflectance(*pairs), "rso", None)
    if between is not None:
        means = [direct.rso[..., 0], to_view.rso @ weights[:, 0], direct.rdo[..., 0]]
        means += [from_sun.rso @ back[:, 0], between @ shares[:, 0], from_sun.rdo @ back[:, 0]]
        return GroundStreams(*means, direct.rsd[..., 0], to_view.rsd @ weights[:, 0], direct.rdd[..., 0])
    to_view, from_sun, between = to_view @ weights, from_sun @ back, reflectance(*pairs) @ shares
    sky_sky, sky_air, air_sky, air_air = np.moveaxis(between, -1, 0)
    means = [direct[..., 0], to_view[..., 0], to_view[..., 1], from_sun[..., 0], sky_sky, air_sky]
    return GroundStreams(*means, from_sun[..., 1], sky_air, air_air)


def _one_way(sky, other, raa):
    """Zenith angles and azimuths of a sky from another direction, and weights of shape (n, 2): light, returned."""
    weights = np.stack([sky.light, sky.returned], axis=-1)
    if other == 0:  # all azimuths are alike
        return sky.zenith, np.zeros(sky.zenith.size), weights.sum(axis=1)
    turned = np.concatenate([sky.azimuth - raa, -sky.azimuth - raa])
    zenith, azimuth = np.meshgrid(sky.zenith, _folded(turned), indexing="ij")
    return zenith.ravel(), azimuth.ravel(), np.concatenate([weights, weights], axis=1).reshape(-1, 2) / 2


def _both_ways(sun_sky, view_sky, raa):
    """Directions of pairs of a coarse grid, and weights of shape (n, 4): sky to sky, sky to air, air to sky, air to
    air."""
    points = (leggauss(_COARSE)[0] + 1) / 2
    zenith, azimuth = np.degrees(np.arccos(points)), 180 * (np.arange(_TURNS // 2) + 0.5) / (_TURNS // 2)
    modes = np.arange(_TURNS // 2)
    factor = np.where(modes > 0, 2.0, 1.0) * np.cos(np.radians(modes * raa))
    waves = np.cos(np.radians(modes[:, None] * azimuth)) * factor[:, None] / azimuth.size
    (sun, sun_air), (view, view_air) = ([_modes(sky, each, points) for each in sky[2:]] for sky in (sun_sky, view_sky))
    pairs = [(sun, view), (sun, view_air), (sun_air, view), (sun_air, view_air)]
    weights = np.stack([np.einsum("ik,jk,kd->ijd", *pair, waves) for pair in pairs], axis=-1)
    grid = np.meshgrid(zenith, zenith, azimuth, indexing="ij")
    return [each.ravel() for each in grid], weights.reshape(-1, 4)


def _modes(sky, weights, points):
    """Cosine modes over the azimuth of weights of a sky, on coarse zenith cosines, shape (points, modes)."""
    modes = np.cos(np.radians(sky.azimuth[:, None] * np.arange(_TURNS // 2)))
    mu, order = np.cos(np.radians(sky.zenith)), np.argsort(points)
    ascending = points[order]
    at = np.clip(np.searchsorted(ascending, mu) - 1, 0, points.size - 2)
    share = (mu - ascending[at]) / (ascending[at + 1] - ascending[at])
    onto = np.zeros((points.size, mu.size))
    onto[order[at], np.arange(mu.size)] = 1 - share
    onto[order[at + 1], np.arange(mu.size)] = share
    return onto @ weights @ modes


def weighted_sky(radiance, returned, sza):
    """SkyWeights of ``radiance(zenith, azimuth)``, shape (n, m), and of ``returned(zenith)``, shape (n,) [degree]."""
    aside = {edge for step in (*_ASIDE, 0) for edge in (sza - step, sza + step) if 2 < edge < 80}
    zenith, zenith_weights = _panels(sorted({0.0, 80.0, 90.0, *aside}), _POINTS[0])
    azimuth, azimuth_weights = _panels(_AROUND, _POINTS[1])
    at = np.radians(zenith)
    solid = (np.cos(at) * np.sin(at) * zenith_weights)[:, None] * azimuth_weights
    light, back = radiance(zenith, azimuth) * solid, returned(zenith)[:, None] * solid
    return SkyWeights(zenith, azimuth, light / light.sum(), back / back.sum())


def mixed_sky(tau_molecules, tau_aerosol, single_scattering_albedo, moments, optics, sza, **options):
    """SkyWeights by `stokes_reflectance`; ``optics(cosine)`` is phase function and polarization of the aerosol."""
    matter = tau_molecules, tau_aerosol, single_scattering_albedo, moments

    def radiance(zenith, azimuth):
        cosine = -scattering_angle_cosine(sza, zenith[:, None], azimuth)
        return stokes_reflectance(*matter, *optics(cosine), sza, zenith, azimuth, at_ground=True, **options)[0]

    def returned(zenith):
        column = mixed_column(*matter, 2 * STREAMS if tau_aerosol > 0 else 3, LAYERS, **options)
        source = lit_from_below(column, streams=STREAMS, tolerance=1e-6)
        return leaving_light(column, 0, np.cos(np.radians(zenith)), source, at_ground=True)[0]

    return weighted_sky(radiance, returned, sza)


@cached(256, "light of the sky over directions")
def atmospheric_sky(atmosphere, wavelength, sza):
    """SkyWeights of an Atmosphere at a wavelength [um], with the sun at a zenith angle [degree]."""
    at = np.array([wavelength])
    depths = (depth(at)[0] for depth in (atmosphere.rayleigh_optical_depth, atmosphere.aerosol_optical_depth))

    def optics(cosine):
        if atmosphere.aot == 0:
            return np.zeros((2, *cosine.shape))
        phase = aerosols.aerosol_phase(atmosphere.aerosol, cosine, wavelength)
        return phase, aerosols.aerosol_polarization(atmosphere.aerosol, cosine, wavelength)

    albedo, moments, _ = scatterers(atmosphere, at, np.zeros((1, 1)), True)
    vertical = aerosols.vertical(atmosphere.aerosol)
    return mixed_sky(*map(float, depths), albedo, moments, optics, float(sza), vertical=vertical)


def _panels(edges, count):
    """Gauss points and weights of intervals, in degrees."""
    points, weights = leggauss(count)
    edges = np.asarray(edges, float)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (points + 1)).ravel(), (half * weights).ravel()


def _folded(azimuth):
    return np.abs((np.asarray(azimuth) + 180) % 360 - 180)
