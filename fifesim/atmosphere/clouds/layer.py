"""Reflectance and transmittance of a cloud layer of drops, and its effect on the light above it."""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from fifesim.atmosphere.successive_orders import flux_transmittance, path_reflectance
from fifesim.base import files
from fifesim.base.arrays import jitable
from fifesim.base.bands import solar_irradiance_steps
from fifesim.base.caches import cached
from fifesim.base.geometry import scattering_angle_cosine

ASYMMETRY = 0.85  # of drops in the visible and near infrared [Hansen1974]_ [1]
DROP_RADIUS = 10e-4  # effective radius of drops in water clouds, as assumed by ISCCP [Rossow1999]_ [cm]
THICKEST = 100.0  # largest optical thickness in the table [1]


def two_stream_reflectance(optical_depth, asymmetry, ground=0.0):
    r"""
    Reflectance of a conservative cloud over a Lambertian ground, in the two-stream approximation.

    .. math::

        R = \frac{(1 - g) \tau}{2 + (1 - g) \tau}, \qquad R_g = R + \frac{(1 - R)^2 \rho}{1 - \rho R}

    Parameters
    ----------
    optical_depth : array
        Optical thickness of the cloud, :math:`\tau`. [1]
    asymmetry : array
        Asymmetry parameter of the drops, :math:`g`. [1]
    ground : array, optional
        Reflectance of the ground, :math:`\rho`; 0 is the cloud alone. [1]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        [1]

    Notes
    -----
    The approximation has no sun angle. Exact plane albedos differ by up to 0.05 for a sun within 30 degrees of the
    zenith, and by up to 0.19 at 60 degrees; `layer_light` is the exact solution.

    References
    ----------
    [Bohren1987]_

    Examples
    --------
    A layer that reflects half of the light:

    >>> float(two_stream_reflectance(8.0, 0.75)), float(two_stream_reflectance(8.0, 0.75, 1.0))
    (0.5, 1.0)
    """
    reflected = (1 - np.asarray(asymmetry, float)) * optical_depth
    reflected = reflected / (2 + reflected)
    return reflected + (1 - reflected) ** 2 * ground / (1 - np.asarray(ground, float) * reflected)


def drop_co_albedo(absorption, index, radius=DROP_RADIUS):
    r"""
    Share of the light meeting a large, weakly absorbing drop that is absorbed, over the light that it scatters.

    .. math:: 1 - \omega = \frac{2}{3} n^2 \left[1 - (1 - n^{-2})^{3/2}\right] \kappa r

    Parameters
    ----------
    absorption : array
        Absorption coefficient of water, :math:`\kappa`. [cm-1]
    index : array
        Refractive index of water, :math:`n`. [1]
    radius : float, optional
        Effective radius of the drops, :math:`r`. [cm]

    Returns
    -------
    co_albedo : array
        One less the single scattering albedo :math:`\omega`. [1]

    Notes
    -----
    The limit of geometrical optics for :math:`\kappa r \ll 1`, where the extinction is twice the cross section.

    References
    ----------
    [Twomey1980]_

    Examples
    --------
    With n = 1.33 the factor is 0.84:

    >>> round(float(drop_co_albedo(1.0, 1.33, 1.0)), 2)
    0.84
    """
    index = np.asarray(index, float)
    return 2 / 3 * index**2 * (1 - (1 - index**-2.0) ** 1.5) * absorption * radius


_NEGLIGIBLE = 1e-5  # co-albedo that changes no reflectance below thickness 100 by more than 0.4 % [1]


@cached(64, "absorption by cloud drops")
def band_co_albedo(band):
    """Co-albedo of cloud drops in a band, to two digits so that bands share tables, and 0 if negligible. [1]"""
    water, absorbing = files.table("water_index.csv"), files.table("prospect_d.csv")
    wavelength = absorbing["wavelength"].to_numpy()
    index = np.interp(wavelength, water["wavelength"], water["refractive_index"])
    share = drop_co_albedo(absorbing["water"].to_numpy(), index)
    mean = float(band.mean(share, wavelength, solar_irradiance_steps(wavelength)))
    return 0.0 if mean < _NEGLIGIBLE else float(f"{mean:.1e}")


class LayerLight(NamedTuple):
    """Light of a cloud layer by optical thickness, the last axis, for one sun and view. [1]"""

    reflectance: np.ndarray  # bidirectional reflectance factor of the layer over black ground
    transmittance_down: np.ndarray  # direct and diffuse, from the sun
    transmittance_up: np.ndarray  # and to the sensor
    diffuse_transmittance: np.ndarray  # of isotropic light
    spherical_albedo: np.ndarray


_THICKNESS = np.array(
    [0.0, 0.01, 0.03, 0.06, 0.1, 0.18, 0.3, 0.5, 0.8, 1.2, 1.8, 2.6, 3.8, 5.5, 8.0, 11.5, 16.0, 23.0, 34.0, 55.0]
    + [THICKEST]
)
_ZENITHS = np.arange(0.0, 76.0, 5.0)  # [degree]
_AZIMUTHS = np.arange(0.0, 181.0, 7.5)  # [degree]
_MOMENTS = ASYMMETRY ** np.arange(33)
_STREAMS = 16
_GAUSS, _WEIGHTS = (np.polynomial.legendre.leggauss(8)[0] + 1) / 2, np.polynomial.legendre.leggauss(8)[1] / 2


def henyey_greenstein(cosine):
    r"""Phase function :math:`(1 - g^2) / (1 + g^2 - 2 g \cos \Theta)^{3/2}` of the drops [Henyey1941]_. [1]"""
    return (1 - ASYMMETRY**2) / (1 + ASYMMETRY**2 - 2 * ASYMMETRY * cosine) ** 1.5


def layer_light(optical_thickness, co_albedo, sza, vza, raa):
    r"""
    Reflectance and transmittance of a layer of cloud drops, from a table made by successive orders of scattering.

    Parameters
    ----------
    optical_thickness : array, shape (n,)
        0 to 100. [1]
    co_albedo : float
        One less the single scattering albedo. [1]
    sza, vza : float
        0 to 75. [degree]
    raa : float
        0 has sun and sensor on the same side. [degree]

    Returns
    -------
    light : LayerLight
        Arrays of shape (n,). [1]

    Notes
    -----
    Drops scatter by the function of Henyey and Greenstein with asymmetry 0.85, without rainbow and glory. Single
    scattering is exact, and the rest is interpolated: splines over the thickness, cubics every 5 degrees of zenith and
    7.5 of azimuth.

    References
    ----------
    [Henyey1941]_; [Lenoble2007]_; [Nakajima1988]_

    Examples
    --------
    A thick cloud hides the ground and reflects most of the light:

    >>> light = layer_light(np.array([0.0, 50.0]), 0.0, 30.0, 0.0, 0.0)
    >>> light.reflectance.round(1).tolist(), light.transmittance_down.round(1).tolist()
    ([0.0, 0.9], [1.0, 0.2])
    """
    s, sun = _cubic(sza, _ZENITHS)
    v, view = _cubic(vza, _ZENITHS)
    r, turn = _cubic(raa, _AZIMUTHS)
    parts = [_rescattered(co_albedo, float(_ZENITHS[s + i]))[:, v : v + 4, r : r + 4] for i in range(4)]
    rescattered = np.einsum("stvr,s,v,r->t", np.array(parts), sun, view, turn)
    through, diffuse, albedo = _fluxes(co_albedo)
    down, up = through[:, s : s + 4] @ sun, through[:, v : v + 4] @ view
    place, at = np.log1p(_THICKNESS), np.log1p(np.asarray(optical_thickness, float))
    once = _scattered_once(np.asarray(optical_thickness, float), co_albedo, sza, vza, raa)
    smooth = (CubicSpline(place, each)(at) for each in (rescattered, down, up, diffuse, albedo))
    reflectance, down, up, diffuse, albedo = smooth
    return LayerLight(once + reflectance, down, up, diffuse, albedo)


def _cubic(value, nodes):
    """First of the four nodes around a value, and their Lagrange weights."""
    step = nodes[1]
    first = min(max(int(value / step) - 1, 0), nodes.size - 4)
    place, others = value / step - first, np.arange(4.0)
    terms = [[(place - k) / (i - k) for k in others if k != i] for i in others]
    return first, np.prod(terms, axis=1)


def _scattered_once(thickness, co_albedo, sza, vza, raa):
    """Reflectance by single scattering with the forward peak counted as not scattered, shape of thickness. [1]"""
    mu_s, mu_v = np.cos(np.radians(sza)), np.cos(np.radians(vza))
    phase, kept = henyey_greenstein(scattering_angle_cosine(sza, vza, raa)), 1 - (1 - co_albedo) * _MOMENTS[-1]
    slant = -np.expm1(-(1 / mu_s + 1 / mu_v) * kept * thickness)
    return (1 - co_albedo) / kept * phase * slant / (4 * (mu_s + mu_v))


def _accuracy(thickness):
    """Options of the solver: layers thin enough, and a tolerance that holds in thick clouds."""
    layers = int(np.clip(8 * thickness, 40, 360))
    return {"polarized": False, "streams": _STREAMS, "layers": layers, "vertical": (0.0, 1.0), "tolerance": 1e-11}


@cached(512, "light scattered in clouds")
def _rescattered(co_albedo, sza):
    """Reflectance by light scattered more than once, shape (thickness, view, azimuth). [1]"""
    view, turn = _ZENITHS[:, None], _AZIMUTHS
    phase = henyey_greenstein(scattering_angle_cosine(sza, view, turn))
    out = np.zeros((_THICKNESS.size, _ZENITHS.size, _AZIMUTHS.size))
    for number, depth in enumerate(_THICKNESS[1:].tolist(), 1):
        cloud = 0.0, depth, 1 - co_albedo, _MOMENTS, phase
        whole = path_reflectance(*cloud, sza, _ZENITHS, _AZIMUTHS, **_accuracy(depth))
        out[number] = whole - _scattered_once(depth, co_albedo, sza, view, turn)
    return out


@cached(64, "fluxes through clouds")
def _fluxes(co_albedo):
    """Transmittance by zenith angle and of isotropic light, and spherical albedo, by thickness. [1]"""
    zenith = np.concatenate([_ZENITHS, np.degrees(np.arccos(_GAUSS))])
    found = [
        flux_transmittance(0.0, depth, 1 - co_albedo, _MOMENTS, zenith, **_accuracy(depth))
        for depth in _THICKNESS[1:].tolist()
    ]
    through = np.array([np.ones(zenith.size), *(each for each, _ in found)])
    albedo = np.array([0.0, *(each for _, each in found)])
    diffuse = through[:, _ZENITHS.size :] @ (2 * _GAUSS * _WEIGHTS)
    diffuse[0] = 1.0
    return through[:, : _ZENITHS.size], diffuse, albedo


class CloudTables(NamedTuple):
    """Tables of the clouds of one scene by band and on steps of thickness, for `under_clouds`. [1]"""

    seen: np.ndarray  # reflectance, transmittances down and up, and spherical albedo, shape (band, n, 4)
    lit: np.ndarray  # transmittance from the sun, shape (band, n)
    sky: np.ndarray  # transmittance of isotropic light, shape (band, n)
    path: np.ndarray  # apparent reflectance of the atmosphere over black ground, shape (band,)
    diffuse_fraction: np.ndarray  # of the irradiance without clouds, shape (band,)


_STEPS = 4000  # of the root of the thickness, which interpolate reflectance to 1e-5
_PER_ROOT = _STEPS / THICKEST**0.5


def sky_tables(co_albedos, path, diffuse_fraction, ozone, sza, vza, raa):
    """Tables of `under_clouds` for each band; ozone, which lies above the clouds, dims the light that they reflect."""
    thickness = np.minimum((np.arange(_STEPS + 1) / _PER_ROOT) ** 2, THICKEST)
    lights = [layer_light(thickness, each, sza, vza, raa) for each in co_albedos]
    reflectance, down, up, diffuse, albedo = (np.array(each) for each in zip(*lights, strict=True))
    seen = np.stack([reflectance * np.asarray(ozone)[:, None], down, up, albedo], axis=-1)
    return CloudTables(seen, down, diffuse, np.asarray(path, float), np.asarray(diffuse_fraction, float))


@jitable
def clouded_reflectance(clear, path, diffuse, reflected, down, lit, sky, up, albedo):
    r"""
    Apparent reflectance of one cell below and between clouds.

    .. math::

        \rho^* = R(\tau_v) + \frac{T(\tau_v, \theta_v)}{1 - \rho_0 S(\tau_v)} \left\{ T(\tau_v, \theta_s) \, \rho_a
            + \left[ (1 - d) \, T(\tau_s, \theta_s) + d \, T_d(\tau_o) \right] (\rho_0 - \rho_a) \right\}

    Clouds of three columns matter: toward the sensor (v), toward the sun (s) and overhead (o). A shadow keeps the
    skylight. In an even overcast all three agree, and this is the layer above a reflector :math:`\rho_0`.

    Parameters
    ----------
    clear : float
        Apparent reflectance without clouds, :math:`\rho_0`. [1]
    path : float
        Its part from the atmosphere alone, :math:`\rho_a`. [1]
    diffuse : float
        Diffuse fraction of the irradiance, :math:`d`. [1]
    reflected, down, up, albedo : float
        Reflectance, transmittances and spherical albedo of the clouds toward the sensor. [1]
    lit : float
        Transmittance of the clouds toward the sun, :math:`T(\tau_s, \theta_s)`. [1]
    sky : float
        Transmittance of the clouds overhead for isotropic light, :math:`T_d(\tau_o)`. [1]

    Returns
    -------
    reflectance : float
        Equal to the clear one, to the bit, without clouds. [1]

    References
    ----------
    [Liou2002]_, adding of layers

    Examples
    --------
    An opaque shadow with a quarter of skylight:

    >>> round(clouded_reflectance(0.25, 0.05, 0.25, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0), 6)
    0.1
    """
    dimmed = (1 - diffuse) * (1 - lit) + diffuse * (1 - sky)
    below = clear - path * (1 - down) - (clear - path) * dimmed
    return reflected + up * below / (1 - clear * albedo)


def under_clouds(clear, seen, sunlit, overhead, *, sky):
    """
    Apparent reflectance of a scene with clouds, by `clouded_reflectance`.

    Parameters
    ----------
    clear : array, shape (y, x, band)
        Apparent reflectance without clouds. [1]
    seen, sunlit, overhead : array, shape (y, x)
        Optical thickness of the clouds toward the sensor, toward the sun and overhead, 0 to 100. [1]
    sky : CloudTables

    Returns
    -------
    reflectance : array, shape (band, y, x)
        [1]

    Raises
    ------
    ValueError
        If a thickness is negative or above 100.

    References
    ----------
    [Liou2002]_
    """
    columns = [np.ascontiguousarray(each, float) for each in (seen, sunlit, overhead)]
    for each in columns:
        if (wrong := each[(each < 0) | (each > THICKEST)]).size:
            raise ValueError(
                f"optical_thickness must be from 0 to {THICKEST:g}, got {wrong.flat[0]:g}: clip it, .clip(0, 100)"
            )
    clear = np.ascontiguousarray(np.moveaxis(clear, -1, 0), float)
    out = np.empty(clear.shape)
    _cloud_scene(clear, *columns, sky, out)
    return out


@njit(nogil=True, cache=True)
def _cloud_scene(clear, seen, sunlit, overhead, sky, out):
    bands, rows, columns = clear.shape
    cells = np.empty(columns, np.int64)
    place, share = np.empty((3, columns), np.int64), np.empty((3, columns))
    for i in range(rows):
        # Only cells with clouds take the long way.
        count = 0
        for j in range(columns):
            if seen[i, j] + sunlit[i, j] + overhead[i, j] != 0:
                _find(seen[i, j], 0, count, place, share)
                _find(sunlit[i, j], 1, count, place, share)
                if overhead[i, j] == seen[i, j]:
                    place[2, count], share[2, count] = place[0, count], share[0, count]
                else:
                    _find(overhead[i, j], 2, count, place, share)
                cells[count] = j
                count += 1
        for b in range(bands):
            out[b, i] = clear[b, i]
            path, diffuse, table, lit, sky_light = (
                sky.path[b],
                sky.diffuse_fraction[b],
                sky.seen[b],
                sky.lit[b],
                sky.sky[b],
            )
            for k in range(count):
                v, s, o = place[0, k], place[1, k], place[2, k]
                x, y, z = share[0, k], share[1, k], share[2, k]
                out[b, i, cells[k]] = clouded_reflectance(
                    clear[b, i, cells[k]],
                    path,
                    diffuse,
                    table[v, 0] + x * (table[v + 1, 0] - table[v, 0]),
                    table[v, 1] + x * (table[v + 1, 1] - table[v, 1]),
                    lit[s] + y * (lit[s + 1] - lit[s]),
                    sky_light[o] + z * (sky_light[o + 1] - sky_light[o]),
                    table[v, 2] + x * (table[v + 1, 2] - table[v, 2]),
                    table[v, 3] + x * (table[v + 1, 3] - table[v, 3]),
                )


@jitable
def _find(thickness, which, number, place, share):
    """Fill in the step of a thickness in the tables, and the share of the way to the next; NaN stays NaN."""
    if np.isnan(thickness):
        place[which, number], share[which, number] = 0, np.nan
        return
    at = np.sqrt(thickness) * _PER_ROOT
    place[which, number] = min(int(at), _STEPS - 1)
    share[which, number] = at - place[which, number]
