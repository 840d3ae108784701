"""Bidirectional reflectance of land by kernels and closed forms: Ross-Li, and Rahman, Pinty and Verstraete (RPV)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from scipy.spatial import ConvexHull

from fifesim.base.arguments import Numbers, check_fields
from fifesim.base.caches import cached


def ross_thick(sza, vza, raa):
    r"""
    Volume kernel of thick foliage, 0 for sun and view at the zenith.

    .. math::

        K_\mathrm{vol} = \frac{(\pi / 2 - \xi) \cos \xi + \sin \xi}{\mu_s + \mu_v} - \frac{\pi}{4}

    with :math:`\xi` the angle between the directions of sun and sensor.

    Parameters
    ----------
    sza, vza, raa : array
        Zenith angles below 90, and relative azimuth with 0 in the hot spot. [degree]

    Returns
    -------
    kernel : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Roujean1992]_; [Wanner1995]_, Eq. 7

    Examples
    --------
    >>> float(round(ross_thick(0.0, 0.0, 0.0), 12))
    0.0
    """
    mu_s, mu_v, cosine, _ = _directions(sza, vza, raa)
    apart = np.arccos(cosine)
    return ((np.pi / 2 - apart) * cosine + np.sin(apart)) / (mu_s + mu_v) - np.pi / 4


def li_sparse(sza, vza, raa, *, height=2.0, shape=1.0):
    r"""
    Geometric kernel of sparse crowns and their shadows, in its reciprocal form.

    .. math::

        K_\mathrm{geo} &= O - \sec \theta_s' - \sec \theta_v'
            + \tfrac{1}{2} (1 + \cos \xi') \sec \theta_s' \sec \theta_v' \\
        O &= \frac{t - \sin t \cos t}{\pi} (\sec \theta_s' + \sec \theta_v'), \qquad
        \cos t = \frac{h}{b} \frac{\sqrt{D^2 + (\tan \theta_s' \tan \theta_v' \sin \varphi)^2}}
            {\sec \theta_s' + \sec \theta_v'}

    with :math:`\tan \theta' = (b / r) \tan \theta` and the distance :math:`D` of both directions on level ground.

    Parameters
    ----------
    sza, vza, raa : array
        As in `ross_thick`. [degree]
    height : float, optional
        Height of the crown centres over the vertical radius of a crown, :math:`h / b`. [1]
    shape : float, optional
        Vertical over horizontal radius of a crown, :math:`b / r`. [1]

    Returns
    -------
    kernel : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Wanner1995]_, Eqs. 31 to 39, made reciprocal by the second secant in the last term, as in the MODIS product

    Examples
    --------
    >>> float(round(li_sparse(0.0, 0.0, 0.0), 12))
    0.0
    """
    tan_s, tan_v = (shape * np.tan(np.radians(angle)) for angle in (sza, vza))
    sza, vza = np.degrees(np.arctan(tan_s)), np.degrees(np.arctan(tan_v))
    mu_s, mu_v, cosine, azimuth = _directions(sza, vza, raa)
    secants = 1 / mu_s + 1 / mu_v
    # The squared distance without cancellation near the hot spot.
    apart = (tan_s - tan_v) ** 2 + 4 * tan_s * tan_v * np.sin(azimuth / 2) ** 2
    cos_t = np.minimum(height * np.sqrt(apart + (tan_s * tan_v * np.sin(azimuth)) ** 2) / secants, 1)
    t = np.arccos(cos_t)
    overlap = (t - np.sin(t) * cos_t) * secants / np.pi
    return overlap - secants + (1 + cosine) / (2 * mu_s * mu_v)


def ross_li(iso, vol, geo, *, sza, vza, raa):
    r"""
    Reflectance factor by the Ross-Li kernels of the MODIS product.

    .. math:: R = f_\mathrm{iso} + f_\mathrm{vol} K_\mathrm{vol} + f_\mathrm{geo} K_\mathrm{geo}

    Parameters
    ----------
    iso, vol, geo : array
        Weights of the kernels. [1]
    sza, vza, raa : array
        As in `ross_thick`. [degree]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        It may be negative for low suns and views. [1]

    References
    ----------
    [Lucht2000]_

    Examples
    --------
    >>> float(round(ross_li(0.2, 0.1, 0.03, sza=0.0, vza=0.0, raa=0.0), 12))
    0.2
    """
    return iso + vol * ross_thick(sza, vza, raa) + geo * li_sparse(sza, vza, raa)


def rpv(rho0, k, theta, rhoc, *, sza, vza, raa):
    r"""
    Reflectance factor by the model of Rahman, Pinty and Verstraete.

    .. math::

        R = \rho_0 \left[ \mu_s \mu_v (\mu_s + \mu_v) \right]^{k - 1}
            \frac{1 - \Theta^2}{(1 + 2 \Theta \cos \xi + \Theta^2)^{3 / 2}}
            \left( 1 + \frac{1 - \rho_c}{1 + D} \right)

    with :math:`\xi` the angle between the directions of sun and sensor and :math:`D` their distance on level ground.

    Parameters
    ----------
    rho0 : array
        Amplitude. [1]
    k : array
        Bowl (below 1) or bell shape (above 1). [1]
    theta : array
        Asymmetry: negative is backscatter. [1]
    rhoc : array
        Hot spot: 1 has none. [1]
    sza, vza, raa : array
        As in `ross_thick`. [degree]

    Returns
    -------
    reflectance : array, shape of the broadcast inputs
        [1]

    References
    ----------
    [Rahman1993]_

    Examples
    --------
    Without shape it is Lambertian:

    >>> float(rpv(0.2, 1.0, 0.0, 1.0, sza=30.0, vza=40.0, raa=90.0))
    0.2
    """
    mu_s, mu_v, cosine, azimuth = _directions(sza, vza, raa)
    tan_s, tan_v = np.tan(np.radians(sza)), np.tan(np.radians(vza))
    apart = np.sqrt((tan_s - tan_v) ** 2 + 4 * tan_s * tan_v * np.sin(azimuth / 2) ** 2)
    asymmetry = (1 - theta**2) / (1 + 2 * theta * cosine + theta**2) ** 1.5
    return rho0 * (mu_s * mu_v * (mu_s + mu_v)) ** (k - 1) * asymmetry * (1 + (1 - rhoc) / (1 + apart))


def _directions(sza, vza, raa):
    """Cosines of both zenith angles and of the angle between the directions, and the relative azimuth [radian]."""
    sza, vza, azimuth = np.radians(sza), np.radians(vza), np.radians(raa)
    mu_s, mu_v = np.cos(sza), np.cos(vza)
    cosine = mu_s * mu_v + np.sin(sza) * np.sin(vza) * np.cos(azimuth)
    return mu_s, mu_v, np.clip(cosine, -1, 1), azimuth


@dataclass(frozen=True, eq=False)
class RossLi:
    """
    Land whose reflectance is a sum of the Ross-Li kernels, as in the MODIS product MCD43.

    Parameters
    ----------
    iso, vol, geo : number, sequence or xarray.DataArray
        Weights of the kernels: a number, one for each band, or a raster over ([band], y, x). [1]

    Examples
    --------
    >>> from fifesim.ground import RossLi
    >>> RossLi(0.2, 0.1, 0.03).reflectance(0.0, 0.0, 0.0)
    array(0.2)
    """

    _in_words: ClassVar[str] = "a fifesim.ground.RossLi, such as fifesim.ground.RossLi(0.2, 0.1, 0.03)"

    iso: Numbers
    vol: Numbers
    geo: Numbers

    def __post_init__(self):
        check_fields(self)

    def reflectance(self, sza: Numbers, vza: Numbers, raa: Numbers) -> np.ndarray:
        """
        Reflectance factor toward directions, by `ross_li`.

        Parameters
        ----------
        sza, vza, raa : array
            [degree]

        Returns
        -------
        reflectance : array, shape of the broadcast angles and weights
            [1]
        """
        own = (np.asarray(each, float) for each in (self.iso, self.vol, self.geo))
        return np.asarray(ross_li(*own, sza=sza, vza=vza, raa=raa))


@dataclass(frozen=True, eq=False)
class RPV:
    """
    Land with the reflectance of Rahman, Pinty and Verstraete.

    Parameters
    ----------
    rho0, k, theta, rhoc : number, sequence or xarray.DataArray
        Parameters of `fifesim.base.surface_kernels.rpv`: a number, one for each band, or a raster over ([band], y, x).
        Each different set of k, theta and rhoc in rasters takes 2 ms. [1]

    Examples
    --------
    >>> from fifesim.ground import RPV
    >>> RPV(0.2, 1.0, 0.0, 1.0).reflectance(30.0, 40.0, 90.0)
    array(0.2)
    """

    _in_words: ClassVar[str] = "a fifesim.ground.RPV, such as fifesim.ground.RPV(0.1, 0.8, -0.1, 0.1)"

    rho0: Numbers
    k: Numbers
    theta: Numbers
    rhoc: Numbers

    def __post_init__(self):
        check_fields(self)

    def reflectance(self, sza: Numbers, vza: Numbers, raa: Numbers) -> np.ndarray:
        """
        Reflectance factor toward directions, by `rpv`.

        Parameters
        ----------
        sza, vza, raa : array
            [degree]

        Returns
        -------
        reflectance : array, shape of the broadcast angles and parameters
            [1]
        """
        own = (np.asarray(each, float) for each in (self.rho0, self.k, self.theta, self.rhoc))
        return np.asarray(rpv(*own, sza=sza, vza=vza, raa=raa))


_LARGEST_ZENITH = 75.0  # of sun and view in the check of a surface [degree]
_AT_ONCE = 64  # surfaces in a check


@cached(1, "directions of the check of a surface")
def _checked_directions():
    """Directions (sun, view, azimuth) of a check, those after the last sun being a quadrature, and its weights."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    mu, share = (nodes + 1) / 2, (nodes + 1) * weights / 2  # 2 mu dmu
    sun, view, azimuth = np.arange(0.0, _LARGEST_ZENITH + 1, 5.0), np.degrees(np.arccos(mu)), np.arange(5.0, 180, 10)
    return (sun[:, None, None], np.append(sun, view)[:, None], azimuth), share


@cached(1, "extremes of the Ross-Li kernels")
def _extreme_directions():
    """Directions in which a sum of Ross-Li kernels may be smallest, flat indices of `_checked_directions`."""
    angles, _ = _checked_directions()
    suns = angles[0].size
    kernels = np.stack([kernel(*angles)[:, :suns].ravel() for kernel in (ross_thick, li_sparse)], axis=-1)
    return ConvexHull(kernels).vertices, kernels


def check_surface(surface):
    """Raise ValueError if a surface, of numbers or shape (n,), reflects negatively or more than it receives."""
    values = (np.ravel(np.asarray(getattr(surface, each.name), float)) for each in fields(surface))
    rows = np.unique(np.stack(np.broadcast_arrays(*values)), axis=1)
    if not np.isfinite(rows).all():
        raise ValueError(f"{surface!r} has a parameter that is not finite: check it for NaN")
    if isinstance(surface, RossLi):
        rows = _least_ross_li(rows)
    for first in range(0, rows.shape[1], _AT_ONCE):
        _check_rows(type(surface), rows[:, first : first + _AT_ONCE])


def _least_ross_li(rows):
    """Weights whose reflectance is lowest, and whose albedo is highest, at one of the suns."""
    (angles, share), (corners, kernels) = _checked_directions(), _extreme_directions()
    lowest = (rows[0] + kernels[corners] @ rows[1:]).min(axis=0)
    quadrature = [kernel(*angles)[:, angles[0].size :].mean(axis=-1) @ share for kernel in (ross_thick, li_sparse)]
    highest = (rows[0] + np.transpose(quadrature) @ rows[1:]).max(axis=0)
    return rows[:, np.unique([lowest.argmin(), highest.argmax()])]


def _check_rows(kind, rows):
    """Check surfaces, a column of parameters for each."""
    (sun, view, azimuth), share = _checked_directions()
    values = kind(*(row[:, None, None, None] for row in rows)).reflectance(sun, view, azimuth)
    within = values[:, :, : sun.size]
    if within.min() < 0:
        number, s, v, a = np.unravel_index(within.argmin(), within.shape)
        raise ValueError(
            f"{kind(*rows[:, number].tolist())!r} reflects {within.min():.3g} at sza {sun.flat[s]:g}, vza "
            f"{view.flat[v]:g} and raa {azimuth[a]:g}: reflectance must not be negative; check the order of the weights"
        )
    albedo = values[:, :, sun.size :].mean(axis=-1) @ share
    if albedo.max() > 1:
        number, s = np.unravel_index(albedo.argmax(), albedo.shape)
        raise ValueError(
            f"{kind(*rows[:, number].tolist())!r} reflects {albedo.max():.3g} of the sunlight at sza {sun.flat[s]:g}: "
            "it must not reflect more than it receives; weights are fractions, not percent"
        )


def parameters_by_band(surface, bands):
    """Parameters of a surface of numbers, each of shape (band,)."""
    found = []
    for each in fields(surface):
        value = np.atleast_1d(np.asarray(getattr(surface, each.name), float))
        if value.shape not in ((1,), (bands,)):
            raise ValueError(f"{each.name} must be a number, or one for each of {bands} bands, got shape {value.shape}")
        found.append(np.broadcast_to(value, bands))
    return found
