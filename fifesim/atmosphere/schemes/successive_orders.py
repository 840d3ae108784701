"""Multiple scattering in the mixed atmosphere of molecules and aerosol, by successive orders."""

import numpy as np

from fifesim.atmosphere.air.molecules import DEPOLARIZATION, rayleigh_phase
from fifesim.atmosphere.air.own_aerosol import SCALE_HEIGHT
from fifesim.atmosphere.schemes.column import mixed_column
from fifesim.atmosphere.schemes.orders import fluxes, lit_from_below, once_scattered, rescattered_light

STREAMS = 16  # directions per hemisphere
LAYERS = 60
TOLERANCE = 1e-6  # of the field, for what is left out of the sums over orders and over Fourier modes [1]


def path_reflectance(
    tau_molecules,
    tau_aerosol,
    single_scattering_albedo,
    moments,
    phase,
    sza,
    vza,
    raa,
    *,
    polarized=True,
    depolarization=DEPOLARIZATION,
    streams=STREAMS,
    layers=LAYERS,
    vertical=SCALE_HEIGHT,
    tolerance=TOLERANCE,
):
    r"""
    Reflectance at the top of the atmosphere over a black surface.

    .. math::

        \rho &= \rho_1 + \frac{1}{\mu_s} \sum_m (-1)^m \cos(m \, \mathrm{raa}) \, I^m, \\
        I^m &= \int J^m(\tau, \mu_v) \, e^{-\tau / \mu_v} \frac{\mathrm{d}\tau}{\mu_v}

    :math:`\rho_1`, the light scattered once, has the whole phase function; :math:`J^m` is the source of the light that
    is scattered more often, its forward peak counted as not scattered.

    Parameters
    ----------
    tau_molecules, tau_aerosol : float
        Optical depths. [1]
    single_scattering_albedo : float
        Of the aerosol. [1]
    moments : array, shape (terms,) or (terms, 4)
        Of the aerosol's phase function, or of its scattering matrix: see `truncated_expansion`. [1]
    phase : array, shape (views, azimuths)
        Phase function of the aerosol at the scattering angles of the views. [1]
    sza : float
        Below 90. [degree]
    vza : array, shape (views,)
        Below 90. [degree]
    raa : array, shape (azimuths,)
        0 has sun and sensor on the same side. [degree]
    polarized : bool
        With the Stokes parameters Q and U, or with the intensity alone.
    depolarization : float
        Of the molecules. [1]
    streams, layers : int
        Directions per hemisphere, and layers of equal optical depth.
    vertical : float or pair of float
        Scale height of the aerosol, or bottom and top of its even layer. [km]
    tolerance : float
        Of the field, for what is left out of the sums over orders and over Fourier modes. [1]

    Returns
    -------
    reflectance : array, shape (views, azimuths)
        [1]

    Notes
    -----
    Molecules fall off exponentially with a scale height of 8 km. Each layer is of even composition,
    with an even source. Given moments of the phase function alone, the aerosol does not polarize, which moves the
    reflectance by up to 1.2 % for continental aerosol and 2.9 % for urban; without any polarization it is up to 6 % off
    at 0.44 um. V, circular polarization, is left out: at depth 1 it moves nothing by more than 1e-5.

    Sun and views within 65 degrees, 60 layers are within .03 % of many at depth 1.2, 16 directions within .01 % of
    many for continental and urban aerosol and .2 % straight back from maritime. Beside 6SV1 at 0.4 to 0.63 um, the
    sun at 45 or 60 degrees: within .05 % for continental aerosol, .12 % for urban, .75 % for maritime.

    References
    ----------
    [Lenoble2007]_, orders and their geometric tail; [Siewert2000]_, polarization; [Nakajima1988]_, TMS method, light
    scattered once

    Examples
    --------
    Sun and sensor may change places:

    >>> air = 0.2, 0.0, 1.0, [1.0], [[0.0]]
    >>> there, back = (path_reflectance(*air, sza, [vza], [30.0]) for sza, vza in [(20.0, 50.0), (50.0, 20.0)])
    >>> bool(abs(there - back) < 2e-5)
    True
    """
    atmosphere = tau_molecules, tau_aerosol, single_scattering_albedo, moments
    column = mixed_column(*atmosphere, 2 * streams, layers, vertical=vertical, depolarization=depolarization)
    mu_s, mu_v = np.cos(np.radians(float(sza))), np.cos(np.radians(np.asarray(vza, float)))
    azimuth = np.radians(np.asarray(raa, float))
    sines = np.sqrt((1 - mu_s**2) * (1 - mu_v**2))[:, None]
    molecules = rayleigh_phase(-mu_s * mu_v[:, None] - sines * np.cos(azimuth), depolarization)
    reflectance = once_scattered(column, molecules, np.asarray(phase, float), mu_s, mu_v)
    options = {"polarized": polarized, "streams": streams, "tolerance": tolerance}
    for mode, (radiance,) in rescattered_light(column, mu_s, mu_v, **options):
        reflectance += (-1) ** mode * np.cos(mode * azimuth) * radiance[:, None] / mu_s
    return reflectance


def flux_transmittance(
    tau_molecules,
    tau_aerosol,
    single_scattering_albedo,
    moments,
    zenith,
    *,
    polarized=True,
    depolarization=DEPOLARIZATION,
    streams=STREAMS,
    layers=LAYERS,
    vertical=SCALE_HEIGHT,
    tolerance=TOLERANCE,
):
    r"""
    Total transmittance, and spherical albedo seen from below.

    A surface of radiance 1 in all directions sends up, by reciprocity, the transmittance, and gets back the albedo:

    .. math:: T(\mu) = I(0, \mu), \qquad S = 2 \int_0^1 I(\tau, -\mu) \, \mu \, \mathrm{d}\mu

    Parameters
    ----------
    tau_molecules, tau_aerosol, single_scattering_albedo, moments
        As in `path_reflectance`. [1]
    zenith : array, shape (n,)
        Of the sun or of the sensor. [degree]
    polarized : bool
    depolarization : float
    streams, layers : int
    vertical : float or pair of float
    tolerance : float
        As in `path_reflectance`.

    Returns
    -------
    transmittance : array, shape (n,)
        Direct and diffuse, of the flux on a horizontal surface. [1]
    spherical_albedo : float
        [1]

    References
    ----------
    [Lenoble2007]_, orders and their geometric tail; [Siewert2000]_, polarization

    Examples
    --------
    A thicker layer lets less through and sends more back:

    >>> (thin, little), (thick, more) = (flux_transmittance(tau, 0.0, 1.0, [1.0], [60.0]) for tau in (0.1, 0.3))
    >>> bool(1 > thin > thick), bool(0 < little < more)
    (True, True)
    """
    atmosphere = tau_molecules, tau_aerosol, single_scattering_albedo, moments
    column = mixed_column(*atmosphere, 2 * streams, layers, vertical=vertical, depolarization=depolarization)
    source = lit_from_below(column, polarized=polarized, streams=streams, tolerance=tolerance)
    return fluxes(column, source, np.cos(np.radians(np.asarray(zenith, float))), streams)
