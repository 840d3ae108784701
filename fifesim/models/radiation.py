"""Albedo and absorption of a canopy by the two-stream equations of Sellers."""

from typing import NamedTuple

import numpy as np

from fifesim.ground.canopy.sail_model import LeafScattering, scattered_again
from fifesim.models.weather import in_range


class TwoStream(NamedTuple):
    """Coefficients of the equations, and light in units of the incoming beam or skylight. [1]"""

    beam_extinction: np.ndarray
    mean_path: np.ndarray
    """Mean inverse optical depth of diffuse light per leaf area."""
    beta: np.ndarray
    """Upward share of scattered diffuse light."""
    beta_beam: np.ndarray
    """Upward share of scattered direct light."""
    albedo_beam: np.ndarray
    ground_beam: np.ndarray
    """Direct light on the ground."""
    ground_diffuse_from_beam: np.ndarray
    absorbed_beam: np.ndarray
    """Absorbed by the leaves, of the beam."""
    albedo_diffuse: np.ndarray
    ground_diffuse: np.ndarray
    absorbed_diffuse: np.ndarray


@in_range
def two_stream(leaf_reflectance, leaf_transmittance, chi, sza, lai, ground):
    r"""
    Albedo and absorption of a canopy over Lambertian ground.

    .. math::

        -\bar\mu \, \dot I^\uparrow + [1 - (1 - \beta) \omega] I^\uparrow - \omega \beta I^\downarrow &=
            \omega \bar\mu K \beta_0 \, e^{-K L} \\
        \bar\mu \, \dot I^\downarrow + [1 - (1 - \beta) \omega] I^\downarrow - \omega \beta I^\uparrow &=
            \omega \bar\mu K (1 - \beta_0) \, e^{-K L}

    Parameters
    ----------
    leaf_reflectance, leaf_transmittance : array
        Their sum :math:`\omega` must not exceed 1. [1]
    chi : array
        Departure of the leaf angles from spherical, in [-0.4, 0.6]: -0.4 is erect, 0.6 is flat. [1]
    sza : array
        Below 90. [degree]
    lai : array
        NaN gives NaN. [m2 m-2]
    ground : array
        Reflectance of the ground. [1]

    Returns
    -------
    light : TwoStream

    Raises
    ------
    ValueError
        If an argument is outside its possible range.

    Notes
    -----
    These are SAIL's equations of fluxes with other coefficients, so that SAIL's solution is used. It holds for
    conservative leaves and where :math:`K \bar\mu` equals the eigenvalue, where printed solutions divide by 0.

    References
    ----------
    [Sellers1985]_; [Dickinson1983]_
    """
    chi, mu = np.asarray(chi, float), np.cos(np.radians(sza))
    rho, tau = np.asarray(leaf_reflectance, float), np.asarray(leaf_transmittance, float)
    omega = rho + tau
    if (omega > 1 + 1e-12).any():
        raise ValueError(
            f"leaf_reflectance + leaf_transmittance must be at most 1, got {np.nanmax(omega):g}: reduce one"
        )
    phi1 = 0.5 - 0.633 * chi - 0.33 * chi**2
    phi2 = 0.877 * (1 - 2 * phi1)
    g = phi1 + phi2 * mu
    k, path = g / mu, _mean_path(phi1, phi2)
    # omega times beta and beta_beam, which are finite for black leaves.
    back = (omega + (rho - tau) * ((1 + chi) / 2) ** 2) / 2
    once = omega / 2 * g / (mu * phi2 + g)
    once = once * (1 - mu * phi1 / (mu * phi2 + g) * np.log((mu * phi1 + mu * phi2 + g) / (mu * phi1)))
    single = (1 + path * k) / (path * k) * once
    a, sigma, black = (1 - omega + back) / path, back / path, (1 - omega) / path
    zero = np.zeros(np.broadcast(k, a).shape)
    layer = scattered_again(
        np.asarray(lai, float),
        LeafScattering(
            ks=k, ko=k, a=a, sigma=sigma, m=np.sqrt(np.maximum(black, 0) * (black + 2 * sigma)),
            sf=omega * k - single * k, sb=single * k, vf=zero, vb=zero, w=zero,
        ),
    )  # fmt: skip
    ground = np.asarray(ground, float)
    again = 1 / (1 - ground * layer.rdd_below)
    down = (layer.tsd + ground * layer.tss * layer.rdd) * again
    sky = layer.tdd * again
    from_beam = layer.rsd + ground * (layer.tss + down) * layer.tdd
    from_sky = layer.rdd + ground * sky * layer.tdd
    with np.errstate(invalid="ignore", divide="ignore"):
        beta, beta_beam = np.where(omega > 0, back / omega, 0.5), np.where(omega > 0, single / omega, 0.5)
    return TwoStream(
        k, path, beta, beta_beam, from_beam, layer.tss, down, 1 - from_beam - (1 - ground) * (layer.tss + down),
        from_sky, sky, 1 - from_sky - (1 - ground) * sky,
    )  # fmt: skip


def _mean_path(phi1, phi2):
    """Mean of mu over its projection, (1 - phi1 / phi2 ln((phi1 + phi2) / phi1)) / phi2, 1 for spherical leaves."""
    ratio = phi2 / phi1
    near = np.abs(ratio) < 1e-3
    safe = np.where(near, 1.0, ratio)
    # The series of 1 - ln(1 + x) / x, over x.
    series = 0.5 - ratio / 3 + ratio**2 / 4 - ratio**3 / 5
    return np.where(near, series, (1 - np.log1p(safe) / safe) / safe) / phi1
