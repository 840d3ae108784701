"""Polarized multiple scattering by successive orders in a layered atmosphere."""

from typing import NamedTuple

import numpy as np

from fifesim.atmosphere.aerosols import SCALE_HEIGHT
from fifesim.atmosphere.column import mixed_column, stokes_basis, wigner
from fifesim.atmosphere.gases import DEPOLARIZATION, rayleigh_anisotropy, rayleigh_phase
from fifesim.base.arrays import compiled
from fifesim.base.caches import cached
from fifesim.base.geometry import scattering_angle_cosine

MOST_ORDERS = 4000
ONE_THREAD = 2**18  # products of so many terms or fewer are not worth a second thread to BLAS


@cached(128, "directions of successive orders")
def quadrature(streams):
    """Gauss points and weights of both hemispheres, upward directions first, shape (2 streams,). [1]"""
    points, weights = np.polynomial.legendre.leggauss(streams)
    upward = (points + 1) / 2
    return np.concatenate([upward, -upward]), np.concatenate([weights, weights]) / 2


def once_scattered(column, molecules, aerosol, mu_s, mu_v, *, at_ground=False):
    r"""
    Reflectance by single scattering, with the untruncated phase functions.

    .. math:: \rho_1 = \frac{1}{4 \mu_s \mu_v} \sum_j \int \omega_j P_j e^{-\tau / \mu_s} t(\tau) \, \mathrm{d}\tau

    :math:`t` is the transmittance from there to the top, or to the ground.

    Parameters
    ----------
    column : column.Column
    molecules, aerosol : array, shape (..., views, azimuths)
        Their phase functions, or elements of their scattering matrices, at the scattering angles of the views. [1]
    mu_s : float
    mu_v : array, shape (views,)
        As in `rescattered_light`. [1]
    at_ground : bool, optional

    Returns
    -------
    reflectance : array, shape (..., views, azimuths)
        [1]
    """
    reached = column.both_ways(mu_s, mu_v, at_ground)
    by_molecules, by_aerosol = (reached.T @ column.molecules)[:, None], (reached.T @ column.aerosol_once)[:, None]
    return (by_molecules * molecules + by_aerosol * aerosol) / (4 * mu_s * mu_v[:, None])


def rescattered_light(column, mu_s, mu_v, *, at_ground=False, polarized=True, stokes=False, streams, tolerance):
    r"""
    Light scattered more than once that leaves the column, Fourier mode by mode.

    .. math:: \int J^m(\tau, \mu_v) e^{-\tau / \mu_v} \frac{\mathrm{d}\tau}{\mu_v}

    Parameters
    ----------
    column : column.Column
    mu_s : float
        Cosine of the sun's zenith angle; its irradiance across the beam is pi. [1]
    mu_v : array, shape (views,)
        Cosine of the angle from the vertical in which the light leaves, above 0. [1]
    at_ground : bool, optional
        Light that comes down to the ground, instead of light that leaves the top.
    polarized : bool, optional
        With Q and U inside of the column.
    stokes : bool, optional
        Whether Q and U are returned too; `polarized` must hold.
    streams : int
        Directions per hemisphere.
    tolerance : float
        Relative error of the field by truncation of the sums over orders and modes. [1]

    Yields
    ------
    mode : int
        The light goes with the cosine of so many times the azimuth, U with the sine.
    radiance : array, shape (components, views)
        I, or I, Q and U. [1]
    """
    nodes, _ = quadrature(streams)
    mu = np.concatenate([nodes[:streams], mu_v])
    field_size, largest, small = 0.0, 0.0, 0
    for mode in range(column.terms):
        components = 3 if polarized and column.polarizes(mode) else 1
        coefficients, size = _rescattered(column, mode, components, mu_s, streams, field_size, tolerance)
        radiance = leaving_light(column, mode, mu, coefficients, at_ground=at_ground, stokes=stokes)
        yield mode, radiance[:, streams:]
        strength = np.abs(radiance[0, :streams]).max()  # at the nodes: no view depends on the others asked for
        field_size, largest = max(field_size, size), max(largest, strength)
        small = small + 1 if strength <= tolerance * largest else 0
        if mode >= 2 and small >= 2:
            break


def lit_from_below(column, *, polarized=True, streams, tolerance):
    """Source of scattered light in a column above a surface of radiance 1, of mode 0, shape (layers, basis). [1]"""
    mode = _mode_of(column, 0, 3 if polarized else 1, streams)
    direct = np.zeros((len(column.molecules), mode.weights.size))
    direct[:, :streams] = column.layer_mean(quadrature(streams)[0][:streams])[::-1]
    source = _by_layers(_scattered(direct * mode.weights, mode.basis, mode.mixing), mode.basis.T)
    field, _ = _sum_orders(source, mode, 0.0, tolerance)
    return _scattered((direct + field) * mode.weights, mode.basis, mode.mixing)


def leaving_light(column, mode, mu, coefficients, *, at_ground=False, stokes=False):
    r"""
    Light that leaves a column for a source in its layers.

    .. math:: \int J(\tau, \mu) e^{-\tau / \mu} \frac{\mathrm{d}\tau}{\mu}

    Parameters
    ----------
    column : column.Column
    mode : int
        Fourier mode.
    mu : array, shape (directions,)
        Cosine of the angle from the vertical, above 0. [1]
    coefficients : array, shape (layers, basis)
        Coefficients of the source, in the basis of `column.stokes_basis`. [1]
    at_ground : bool, optional
        Down to the ground instead of out of the top.
    stokes : bool, optional
        Whether Q and U are returned too.

    Returns
    -------
    radiance : array, shape (1 or 3, directions)
        [1]
    """
    cosine = -mu if at_ground else mu
    coefficients = coefficients[::-1] if at_ground else coefficients
    degrees = column.terms - mode
    sources = [wigner(mode, 0, cosine, column.terms)[mode:].T @ coefficients[:, :degrees].T]
    if stokes and coefficients.shape[1] > degrees:
        basis = stokes_basis(mode, cosine, column.terms, 3)[mu.size :, degrees:]
        sources += np.split(basis @ coefficients[:, degrees:].T, 2)
    elif stokes:
        sources += [np.zeros_like(sources[0])] * 2
    escape = column.escape(mu)
    return np.stack([(escape * source).sum(axis=1) for source in sources])


def fluxes(column, source, mu, streams):
    """Total transmittance by reciprocity, shape (directions,), and spherical albedo seen from below. [1]"""
    nodes, weights = quadrature(streams)
    (out,), (back,) = (
        leaving_light(column, 0, to, source, at_ground=at_ground)
        for to, at_ground in ((mu, False), (nodes[:streams], True))
    )
    transmittance = np.exp(-len(column.molecules) * column.depth / mu) + out
    return transmittance, float(2 * (back * nodes[:streams] * weights[:streams]).sum())


def _rescattered(column, mode, components, mu_s, streams, least, tolerance):
    """Source of multiply scattered light in one Fourier mode, shape (layers, basis), and the field size."""
    matrices = _mode_of(column, mode, components, streams)
    sun = wigner(mode, 0, np.array([-mu_s]), column.terms)[mode:, 0]
    beam = column.layer_mean(np.array([mu_s])) * (0.25 if mode == 0 else 0.5)
    once = np.moveaxis(matrices.mixing[..., 0] * sun[:, None], 2, 1).reshape(len(beam), -1)
    field, size = _sum_orders(_by_layers(beam * once, matrices.basis.T), matrices, least, tolerance)
    return _scattered(field * matrices.weights, matrices.basis, matrices.mixing), size


class _Mode(NamedTuple):
    """Scattering matrices and direct transmittances of one Fourier mode."""

    basis: np.ndarray  # shape (components * directions, basis) [1]
    weights: np.ndarray  # of the directions, for each component [1]
    mixing: np.ndarray  # of `_Column.mixing` [1]
    through: np.ndarray  # of light entering a layer, shape (directions of a hemisphere,) [1]
    averaged: np.ndarray  # its mean over the layer [1]


def _mode_of(column, mode, components, streams):
    """Scattering matrices and direct transmittances of a column in a Fourier mode."""
    nodes, weights = quadrature(streams)
    basis = stokes_basis(mode, nodes, column.terms, components)
    weights = np.tile(weights / 2, components)
    return _Mode(basis, weights, column.mixing(mode, components), *column.steps(nodes[:streams]))


def _by_layers(light, matrix):
    """Product of two matrices, a few layers at a time."""
    # Small products, so that BLAS uses one thread: its threads would wait longer than they compute.
    step = max(1, ONE_THREAD // matrix.size)
    return np.concatenate([light[first : first + step] @ matrix for first in range(0, len(light), step)])


def _scattered(weighted, basis, mixing):
    """Coefficients of the source that a weighted field generates by scattering, shape (layers, basis)."""
    source = np.zeros((mixing.shape[0], basis.shape[1]))
    _mix(weighted @ basis, mixing, source)
    return source


@compiled
def _mix(incident, mixing, source):
    """Add to the source the incident light that is scattered by the mixing matrices of layers and degrees."""
    layers, degrees, components, _ = mixing.shape
    for k in range(layers):
        for to in range(components):
            for of in range(components):
                for degree in range(degrees):
                    source[k, to * degrees + degree] += mixing[k, degree, to, of] * incident[k, of * degrees + degree]


@compiled
def _travel(source, through, averaged, field):
    """Fill in the mean over each layer of the light from homogeneous sources in all layers, without incident light."""
    layers, size = source.shape
    streams = through.size
    for first in range(0, size, 2 * streams):
        for j in range(streams):
            up, down = first + j, first + streams + j
            rising, falling = 0.0, 0.0
            for k in range(layers):
                under = layers - 1 - k
                field[k, down] = source[k, down] + (falling - source[k, down]) * averaged[j]
                falling = source[k, down] + (falling - source[k, down]) * through[j]
                field[under, up] = source[under, up] + (rising - source[under, up]) * averaged[j]
                rising = source[under, up] + (rising - source[under, up]) * through[j]


@compiled
def _weighted(field, weights, out):
    """Fill in a weighted field; return the sum of its magnitude."""
    strength = 0.0
    for k in range(field.shape[0]):
        for i in range(field.shape[1]):
            out[k, i] = field[k, i] * weights[i]
            strength += abs(field[k, i]) * weights[i]
    return strength


def _sum_orders(source, mode, least, tolerance):
    """Light of all orders of scattering from the source of the first, with the tail closed as a geometric series."""
    # Returns the mean of each layer, shape (layers, components * directions), and its weighted sum. The error of the
    # tail is held below the tolerance times this sum, or times `least` where that is larger.
    total = np.zeros_like(source)
    return total, _add_orders(source, mode, np.ascontiguousarray(mode.basis.T), least, tolerance, total)


def _add_orders(source, mode, backward, least, tolerance, total):
    field, weighted = np.empty(source.shape), np.empty(source.shape)
    size, last, last_ratio = 0.0, 0.0, 2.0
    for _ in range(MOST_ORDERS):
        _travel(source, mode.through, mode.averaged, field)
        total += field
        strength = _weighted(field, mode.weights, weighted)
        size += strength
        ratio = strength / last if last > 0 else 0.0
        if last > 0 and ratio < 1:
            left = strength * abs(ratio - last_ratio) / ((1 - ratio) * (1 - ratio))
            if left <= tolerance * (size if size > least else least):
                total += field * (ratio / (1 - ratio))
                return size
        if not strength > 0:
            break
        last, last_ratio = strength, ratio
        source = _scattered(weighted, mode.basis, mode.mixing) @ backward
    return size


STREAMS = 16  # directions per hemisphere
LAYERS = 60
FIELD_TOLERANCE = 1e-6  # of the field, for what is left out of the sums over orders and over Fourier modes [1]


def path_reflectance(
    tau_molecules, tau_aerosol, single_scattering_albedo, moments, phase, sza, vza, raa, *,
    polarized=True, depolarization=DEPOLARIZATION, streams=STREAMS, layers=LAYERS, vertical=SCALE_HEIGHT,
    tolerance=FIELD_TOLERANCE,
):  # fmt: skip
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
        Single scattering albedo of the aerosol. [1]
    moments : array, shape (terms,) or (terms, 4)
        Moments of the phase function of the aerosol, or of its scattering matrix: see `truncated_expansion`. [1]
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
        Depolarization of the molecules. [1]
    streams, layers : int
        Directions per hemisphere, and layers of equal optical depth.
    vertical : float or pair of float
        Scale height of the aerosol, or bottom and top of its even layer. [km]
    tolerance : float
        Relative error of the field by truncation of the sums over orders and Fourier modes. [1]

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

    Sun and views within 65 degrees, 60 layers are within 0.03 % of many at depth 1.2, 16 directions within 0.01 % of
    many for continental and urban aerosol and 0.2 % straight back from maritime. Compared with 6SV1 at 0.4 to 0.63 um,
    sun at 45 or 60 degrees: within 0.05 % for continental aerosol, 0.12 % for urban, 0.75 % for maritime.

    References
    ----------
    [Lenoble2007]_, orders and their geometric tail; [Siewert2000]_, polarization; [Nakajima1988]_, TMS method, light
    scattered once
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
    tau_molecules, tau_aerosol, single_scattering_albedo, moments, zenith, *,
    polarized=True, depolarization=DEPOLARIZATION, streams=STREAMS, layers=LAYERS, vertical=SCALE_HEIGHT,
    tolerance=FIELD_TOLERANCE,
):  # fmt: skip
    r"""
    Total transmittance, and spherical albedo seen from below.

    For a surface of radiance 1 in all directions, by reciprocity, the upwelling light at the top is the transmittance
    and the returned light the albedo:

    .. math:: T(\mu) = I(0, \mu), \qquad S = 2 \int_0^1 I(\tau, -\mu) \, \mu \, \mathrm{d}\mu

    Parameters
    ----------
    tau_molecules, tau_aerosol, single_scattering_albedo, moments
        As in `path_reflectance`. [1]
    zenith : array, shape (n,)
        Zenith angle of the sun or the sensor. [degree]
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
    """
    atmosphere = tau_molecules, tau_aerosol, single_scattering_albedo, moments
    column = mixed_column(*atmosphere, 2 * streams, layers, vertical=vertical, depolarization=depolarization)
    source = lit_from_below(column, polarized=polarized, streams=streams, tolerance=tolerance)
    return fluxes(column, source, np.cos(np.radians(np.asarray(zenith, float))), streams)


def stokes_reflectance(
    tau_molecules, tau_aerosol, single_scattering_albedo, moments, phase, polarization, sza, vza, raa, *,
    at_ground=False, ground=0.0, depolarization=DEPOLARIZATION, streams=STREAMS, layers=LAYERS, vertical=SCALE_HEIGHT,
    tolerance=FIELD_TOLERANCE,
):  # fmt: skip
    r"""
    Polarized light at the top of the atmosphere, or of the sky at the ground, over a Lambertian ground.

    .. math::

        (I, Q, U) = \frac{\pi L}{E_0 \mu_s}, \qquad Q = L_\parallel - L_\perp, \qquad
        U = -2 \langle E_\theta E_\varphi \rangle

    :math:`\parallel` is along the meridian, the plane of the light and the zenith; :math:`\theta` grows away from
    the zenith, :math:`\varphi` counterclockwise seen from above. The ground adds
    unpolarized light, :math:`\rho T(\mu_s) / (1 - \rho S)`, to the light of the atmosphere.

    Parameters
    ----------
    tau_molecules, tau_aerosol, single_scattering_albedo, moments, sza
        As in `successive_orders.path_reflectance`.
    phase, polarization : array, shape (views, azimuths)
        For the aerosol at the scattering angles of the views, whose cosine is `scattering_angle_cosine` at the top and
        its negative at the ground: phase function, and degree of linear polarization
        :math:`-F_{12} / F_{11}`. [1]
    vza : array, shape (views,)
        Zenith angle of the sensor; at the ground, of the place in the sky. Below 90. [degree]
    raa : array, shape (azimuths,)
        Azimuth of the sun minus the azimuth of the sensor, or of the place in the sky. U is odd in it. [degree]
    at_ground : bool, optional
        Compute the light of the sky at the ground, without the direct beam.
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
        light += radiance[:, :, None] * waves[:, None] / mu_s  # Siewert: Q is across minus along
    if ground:
        light += _from_ground(column, mu_s, mu_v, ground, at_ground, accuracy)[:, :, None]
    return light


def _rotation(sza, vza, raa, way):
    """Cosine and -sine of twice the angle from meridian to scattering plane, shape (2, views, azimuths)."""
    sun, view, azimuth = np.radians(sza), np.radians(np.asarray(vza, float))[:, None], np.radians(raa)
    along = np.cos(sun) * np.sin(view) - np.sin(sun) * np.cos(view) * np.cos(azimuth)
    across = way * np.sin(sun) * np.sin(azimuth)
    norm = along**2 + across**2
    norm = np.where(norm > 0, norm, 1)  # no scattering plane at 0 and 180 degrees
    return np.stack([along**2 - across**2, -2 * along * across]) / norm


def _from_ground(column, mu_s, mu_v, ground, at_ground, accuracy):
    """Contribution of a bright ground to I, Q and U, shape (3, views)."""
    source = lit_from_below(column, **accuracy)
    (transmittance,), albedo = fluxes(column, source, np.array([mu_s]), accuracy["streams"])
    light = leaving_light(column, 0, mu_v, source, at_ground=at_ground, stokes=True) * [[1], [-1], [1]]
    if not at_ground:
        light[0] += np.exp(-len(column.molecules) * column.depth / mu_v)
    return light * ground * transmittance / (1 - ground * albedo)
