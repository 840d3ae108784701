"""Stokes parameters of the light that leaves the top of an atmosphere, and of the sky as the ground sees it."""

import numpy as np

from fifesim.atmosphere.air.molecules import DEPOLARIZATION, rayleigh_anisotropy, rayleigh_phase
from fifesim.atmosphere.air.own_aerosol import SCALE_HEIGHT
from fifesim.atmosphere.schemes.column import mixed_column
from fifesim.atmosphere.schemes.orders import fluxes, leaving_light, lit_from_below, once_scattered, rescattered_light
from fifesim.atmosphere.schemes.successive_orders import LAYERS, STREAMS, TOLERANCE
from fifesim.base.geometry import scattering_angle_cosine


def stokes_reflectance(
    tau_molecules,
    tau_aerosol,
    single_scattering_albedo,
    moments,
    phase,
    polarization,
    sza,
    vza,
    raa,
    *,
    at_ground=False,
    ground=0.0,
    depolarization=DEPOLARIZATION,
    streams=STREAMS,
    layers=LAYERS,
    vertical=SCALE_HEIGHT,
    tolerance=TOLERANCE,
):
    r"""
    Polarized light at the top of the atmosphere, or of the sky at the ground, over a Lambertian ground.

    .. math::

        (I, Q, U) = \frac{\pi L}{E_0 \mu_s}, \qquad Q = L_\parallel - L_\perp, \qquad
        U = -2 \langle E_\theta E_\varphi \rangle

    :math:`\parallel` is along the meridian, the plane of the light and the zenith; :math:`\theta` grows away from
    the zenith, :math:`\varphi` counterclockwise seen from above. The ground adds
    :math:`\rho T(\mu_s) / (1 - \rho S)`, not polarized, to what the air sends on.

    Parameters
    ----------
    tau_molecules, tau_aerosol, single_scattering_albedo, moments, sza
        As in `successive_orders.path_reflectance`.
    phase, polarization : array, shape (views, azimuths)
        Of the aerosol at the scattering angles of the views, whose cosine is `scattering_angle_cosine` at the top and
        that with its sign turned at the ground: phase function, and degree of linear polarization
        :math:`-F_{12} / F_{11}`. [1]
    vza : array, shape (views,)
        Zenith angle of the sensor; at the ground, of the place in the sky. Below 90. [degree]
    raa : array, shape (azimuths,)
        Azimuth of the sun less that of the sensor, or of the place in the sky, clockwise. U is odd in it. [degree]
    at_ground : bool, optional
        Of the light of the sky at the ground; the sunbeam itself is left out.
    ground : float, optional
        Reflectance of the ground. [1]
    depolarization, streams, layers, vertical, tolerance
        As in `successive_orders.path_reflectance`.

    Returns
    -------
    stokes : array, shape (3, views, azimuths)
        I, Q and U. [1]

    Notes
    -----
    I at the top over black ground is `successive_orders.path_reflectance`. The flux of I at the ground is
    `successive_orders.flux_transmittance` less the sunbeam.

    References
    ----------
    [Siewert2000]_; compared with [Natraj2009]_ and [Emde2015]_

    Examples
    --------
    A quarter of the way round the sky from the sun, light is polarized across the plane of scattering:

    >>> stokes = stokes_reflectance(0.1, 0, 1, [1.0], [[0.0]], [[0.0]], 60.0, [30.0], [180.0], at_ground=True)
    >>> bool(stokes[1, 0, 0] / stokes[0, 0, 0] < -0.8), bool(abs(stokes[2, 0, 0]) < 1e-9)
    (True, True)
    """
    atmosphere = tau_molecules, tau_aerosol, single_scattering_albedo, moments
    accuracy = {"streams": streams, "tolerance": tolerance}
    terms = 2 * streams if tau_aerosol > 0 else 3  # molecules have no more
    column = mixed_column(*atmosphere, terms, layers, vertical=vertical, depolarization=depolarization)
    mu_s, mu_v = np.cos(np.radians(float(sza))), np.cos(np.radians(np.asarray(vza, float)))
    way = -1 if at_ground else 1
    cosine = way * scattering_angle_cosine(sza, np.asarray(vza, float)[:, None], np.asarray(raa, float))
    sines = 1 - cosine**2
    molecules = rayleigh_phase(cosine, depolarization), 0.75 * rayleigh_anisotropy(depolarization) * sines
    aerosol = np.asarray(phase, float), np.asarray(phase, float) * polarization
    turned = _rotation(sza, vza, raa, way)
    once = [np.stack([first, *(-crossed * turned)]) for first, crossed in (molecules, aerosol)]
    light = once_scattered(column, *once, mu_s, mu_v, at_ground=at_ground)
    azimuth = np.radians(np.asarray(raa, float)) - (0 if at_ground else np.pi)  # between the ways of the light
    for mode, radiance in rescattered_light(column, mu_s, mu_v, at_ground=at_ground, stokes=True, **accuracy):
        waves = np.stack([np.cos(mode * azimuth), -np.cos(mode * azimuth), np.sin(mode * azimuth)])
        light += radiance[:, :, None] * waves[:, None] / mu_s  # Siewert's Q is across less along the meridian
    if ground:
        light += _from_ground(column, mu_s, mu_v, ground, at_ground, accuracy)[:, :, None]
    return light


def _rotation(sza, vza, raa, way):
    """Cosine and minus sine of twice the angle from the meridian to the plane of scattering: (2, views, azimuths)."""
    sun, view, azimuth = np.radians(sza), np.radians(np.asarray(vza, float))[:, None], np.radians(raa)
    along = np.cos(sun) * np.sin(view) - np.sin(sun) * np.cos(view) * np.cos(azimuth)
    across = way * np.sin(sun) * np.sin(azimuth)
    norm = along**2 + across**2
    norm = np.where(norm > 0, norm, 1)  # straight on or back there is no plane, and nothing to turn
    return np.stack([along**2 - across**2, -2 * along * across]) / norm


def _from_ground(column, mu_s, mu_v, ground, at_ground, accuracy):
    """What a bright ground adds, shape (3, views)."""
    source = lit_from_below(column, **accuracy)
    (transmittance,), albedo = fluxes(column, source, np.array([mu_s]), accuracy["streams"])
    light = leaving_light(column, 0, mu_v, source, at_ground=at_ground, stokes=True) * [[1], [-1], [1]]
    if not at_ground:
        light[0] += np.exp(-len(column.molecules) * column.depth / mu_v)
    return light * ground * transmittance / (1 - ground * albedo)
