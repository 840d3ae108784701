"""Bidirectional reflectance of land by kernels and closed forms: Ross-Li, and Rahman, Pinty and Verstraete (RPV)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from fifesim.base.arguments import Numbers, check_fields


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
    >>> from fifesim import RossLi
    >>> RossLi(0.2, 0.1, 0.03).reflectance(0.0, 0.0, 0.0)
    array(0.2)
    """

    _in_words: ClassVar[str] = "a fifesim.RossLi, such as fifesim.RossLi(0.2, 0.1, 0.03)"

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
    rho0, k, theta, rhoc : number or sequence
        Parameters of `fifesim.base.surface_kernels.rpv`: a number, or one for each band. [1]

    Examples
    --------
    >>> from fifesim import RPV
    >>> RPV(0.2, 1.0, 0.0, 1.0).reflectance(30.0, 40.0, 90.0)
    array(0.2)
    """

    _in_words: ClassVar[str] = "a fifesim.RPV, such as fifesim.RPV(0.1, 0.8, -0.1, 0.1)"

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


def check_surface(surface, largest_zenith=75.0):
    """Raise ValueError if a surface of numbers reflects negatively, or more than it receives, within some zenith."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    mu, share = (nodes + 1) / 2, (nodes + 1) * weights / 2  # 2 mu dmu
    sun, view, azimuth = np.arange(0.0, largest_zenith + 1, 5.0), np.degrees(np.arccos(mu)), np.arange(5.0, 180, 10)
    seen = sun[:, None, None], np.append(sun, view)[:, None], azimuth
    values = np.stack([each.reflectance(*seen) for each in surfaces_by_band(surface)])
    if not np.isfinite(values).all():
        raise ValueError(f"{surface!r} has a reflectance that is not finite: check its parameters for NaN")
    within = values[:, :, : sun.size]
    if within.min() < 0:
        _, s, v, a = np.unravel_index(within.argmin(), within.shape)
        raise ValueError(
            f"{surface!r} reflects {within[:, s, v, a].min():.3g} at sza {sun[s]:g}, vza {sun[v]:g} and raa "
            f"{azimuth[a]:g}: reflectance must not be negative; check the order of the weights"
        )
    albedo = values[:, :, sun.size :].mean(axis=-1) @ share
    if albedo.max() > 1:
        s = np.unravel_index(albedo.argmax(), albedo.shape)[1]
        raise ValueError(
            f"{surface!r} reflects {albedo.max():.3g} of the sunlight at sza {sun[s]:g}: it must not reflect more than "
            "it receives; weights are fractions, not percent"
        )


def surfaces_by_band(surface, bands=None):
    """Surfaces with a number for each parameter, one for each band, or one if all bands are alike."""
    names = [each.name for each in fields(surface)]
    values = {name: np.atleast_1d(np.asarray(getattr(surface, name), float)) for name in names}
    if rasters := [name for name, each in values.items() if each.ndim > 1]:
        raise ValueError(f"{', '.join(rasters)} is a raster, a number or one for each band is needed here")
    count = max(each.size for each in values.values()) if bands is None else bands
    for name, each in values.items():
        if each.shape not in ((1,), (count,)):
            raise ValueError(f"{name} must be a number, or one for each of {count} bands, got shape {each.shape}")
    rows = zip(*(np.broadcast_to(each, count).tolist() for each in values.values()), strict=True)
    return [type(surface)(*row) for row in rows]
