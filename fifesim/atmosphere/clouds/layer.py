"""Reflectance and transmittance of a cloud layer of drops, and its effect on the light above it."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline

from fifesim.atmosphere.clouds import THICKNESS
from fifesim.atmosphere.column import wigner
from fifesim.atmosphere.successive_orders import quadrature
from fifesim.base import files
from fifesim.base.arrays import compiled, jitable
from fifesim.base.bands import solar_irradiance_steps
from fifesim.base.caches import cached
from fifesim.base.geometry import scattering_angle_cosine

THICKEST = THICKNESS.highest  # largest optical thickness in the table [1]


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


class LayerLight(NamedTuple):
    """Light of a cloud layer by optical thickness, the last axis, for one sun and view. [1]"""

    reflectance: np.ndarray  # bidirectional reflectance factor of the layer over black ground
    transmittance_down: np.ndarray  # direct and diffuse, from the sun
    transmittance_up: np.ndarray  # and to the sensor
    spherical_albedo: np.ndarray
    diffuse_transmittance: np.ndarray  # of isotropic light


_ZENITHS = np.arange(0.0, 86.0, 5.0)  # [degree]
_BY_ZENITH = CubicSpline(np.concatenate([-_ZENITHS[:0:-1], _ZENITHS]), np.eye(2 * _ZENITHS.size - 1))
_STREAMS = 16  # directions per hemisphere
_MODES = np.arange(2 * _STREAMS)  # Fourier modes in azimuth, and degrees of the phase function
_PER_OCTAVE = 3  # optical thicknesses in the table per doubling
_THINNEST, _DOUBLINGS = 0.0125, 13  # thinnest layer in the table, and its doublings
_FIRST = 10  # doublings up to this layer, from one so thin that light changes linearly within it


class Drops(NamedTuple):
    """Scattering by the drops of clouds at one wavelength, or in one band."""

    co_albedo: float  # one less the single scattering albedo [1]
    peak: float  # share of the forward peak that counts as not scattered [1]
    phase: CubicSpline  # phase function by scattering angle [degree], from 6 degrees on, mean over the sphere 1 [1]
    row: int  # of `cloud_moments.csv`, by which light is scattered again
    stretch: float  # thickness whose light is scattered again there over the thickness of these drops [1]


_SHARED = np.array([0.4, 0.57])  # wavelengths whose tables bands without absorption share [um]


def drops_at(wavelength):
    """
    Scattering by the drops of clouds at one wavelength, by Mie theory.

    Parameters
    ----------
    wavelength : float
        0.4 to 2.5. [um]

    Returns
    -------
    drops : Drops

    Notes
    -----
    Drops have a gamma distribution of sizes with the effective radius 10 um, as assumed by ISCCP, and the effective
    variance 0.1. They scatter a rainbow at a scattering angle of 140 degrees and a glory at 180 degrees.

    References
    ----------
    [Hansen1974]_, Eq. 2.56; [Rossow1999]_

    Examples
    --------
    Rainbow, a minimum between, and glory in red light:

    >>> drops_at(0.66).phase([140.0, 160.0, 180.0]).round(2).tolist()
    [0.29, 0.13, 0.67]
    """
    return _drops(lambda values, known: make_interp_spline(known, values, k=1, axis=-1)(wavelength))


@cached(64, "scattering by cloud drops")
def band_drops(band):
    """Scattering by the drops of clouds in a band, weighted with the solar irradiance."""
    return _drops(lambda values, known: band.mean(values, known, solar_irradiance_steps(known)))


_NEGLIGIBLE = 6e-6  # co-albedo that changes no reflectance below thickness 100 by more than 0.4 % [1]


def _drops(mean):
    """Scattering by drops, from a function for the mean of a spectrum."""
    phase, table, water = (files.table(name) for name in ("cloud_phase.csv", "cloud_moments.csv", "prospect_d.csv"))
    known, fine, absorption = (each.to_numpy() for each in (table["wavelength"], water["wavelength"], water["water"]))
    wavelength, once, peak = (
        float(mean(table[name].to_numpy(), known)) for name in ("wavelength", "moment_1", f"moment_{_MODES.size}")
    )
    # The absorption of water has bands narrower than the steps of the table, unlike the ratio of drops to water.
    ratio = np.interp(fine, known, table["co_albedo"] / np.interp(known, fine, absorption))
    absorbed = float(mean(ratio * absorption, fine))
    # Two digits, so that bands share tables.
    co_albedo = 0.0 if absorbed < _NEGLIGIBLE else float(f"{absorbed:.1e}")
    shared = wavelength if co_albedo else _SHARED[np.argmin(np.abs(_SHARED - wavelength))]
    row = int(np.argmin(np.abs(known - shared)))
    function = CubicSpline(phase["angle"], mean(phase.to_numpy()[:, 1:], known))
    # Layers of the same (1 - g) times thickness scatter alike [Liou2002]_.
    return Drops(co_albedo, peak, function, row, (1 - once) / (1 - float(table.loc[row, "moment_1"])))


def layer_light(optical_thickness, drops, sza, vza, raa):
    r"""
    Reflectance and transmittance of a layer of cloud drops, from a table made by doubling.

    Parameters
    ----------
    optical_thickness : array, shape (n,)
        0 to 100. [1]
    drops : Drops
    sza, vza : float
        0 to 85. [degree]
    raa : float
        0 has sun and sensor on the same side. [degree]

    Returns
    -------
    light : LayerLight
        Arrays of shape (n,). [1]

    Notes
    -----
    Single scattering is exact, with rainbow and glory. Light scattered again follows from the first 32 Legendre moments
    of the phase function. It is a Fourier series in azimuth, interpolated by cubic splines over the zenith angles,
    every 5 degrees, and over the logarithm of the thickness, three per octave.

    References
    ----------
    [Hansen1974]_, doubling; [Wiscombe1976]_, first layer; [Nakajima1988]_, single scattering

    Examples
    --------
    A thick cloud hides the ground and reflects most of the light:

    >>> light = layer_light(np.array([0.0, 50.0]), drops_at(0.55), 30.0, 0.0, 0.0)
    >>> light.reflectance.round(1).tolist(), light.transmittance_down.round(1).tolist()
    ([0.0, 0.9], [1.0, 0.2])
    """
    thickness, table = np.asarray(optical_thickness, float), _table(drops.co_albedo, drops.row)
    sun, view = _zenith_weights(sza), _zenith_weights(vza)
    # From the side of the sun, the azimuths of propagation differ by 180 degrees.
    turn = np.where(_MODES == 0, 1, 2) * np.cos(_MODES * np.radians(raa + 180))
    rescattered = np.einsum("tmvs,mv,ms,m->t", table.rescattered, view, sun, turn, optimize=True)
    down, up = table.transmittance @ sun[0], table.transmittance @ view[0]
    nodes = np.stack([rescattered, down, up, table.spherical_albedo, table.diffuse_transmittance], axis=1)
    spline = CubicSpline(_stretched(table.thickness), nodes)
    again, fluxes = spline(_stretched(thickness * drops.stretch))[:, 0], spline(_stretched(thickness))[:, 1:]
    cosines = np.cos(np.radians(sza)), np.cos(np.radians(vza))
    phase = drops.phase(np.degrees(np.arccos(scattering_angle_cosine(sza, vza, raa))))
    once = _scattered_once(thickness, drops.co_albedo, drops.peak, *cosines, phase)
    return LayerLight(once + again, *fluxes.T)


def _stretched(thickness):
    """Place of an optical thickness in the table, a logarithm except for the thinnest. [1]"""
    return np.log1p(thickness / 0.05)


def _zenith_weights(zenith):
    """Weights of the zenith angles of the table for each Fourier mode, shape (mode, zenith). [1]"""
    weights, count = _BY_ZENITH(zenith), _ZENITHS.size
    # Beyond the zenith, the azimuth differs by 180 degrees: odd modes change their sign.
    mirrored = np.concatenate([[0.0], weights[count - 2 :: -1]])
    return weights[count - 1 :] + np.where(_MODES % 2 == 0, 1, -1)[:, None] * mirrored


def _scattered_once(thickness, co_albedo, peak, mu_s, mu_v, phase):
    """Reflectance by single scattering with the forward peak counted as not scattered. [1]"""
    kept = 1 - (1 - co_albedo) * peak
    slant = -np.expm1(-(1 / mu_s + 1 / mu_v) * kept * thickness)
    return (1 - co_albedo) / kept * phase * slant / (4 * (mu_s + mu_v))


class _LayerTable(NamedTuple):
    """Light of cloud layers by thickness, Fourier mode, and zenith angles of the view and the sun. [1]"""

    thickness: np.ndarray  # shape (n,)
    rescattered: np.ndarray  # reflectance by light scattered more than once, shape (n, mode, zenith, zenith)
    transmittance: np.ndarray  # direct and diffuse, shape (n, zenith)
    diffuse_transmittance: np.ndarray  # of isotropic light, shape (n,)
    spherical_albedo: np.ndarray  # shape (n,)


@cached(32, "light of cloud layers")
def _table(co_albedo, row):
    """Table of cloud layers, from no cloud on, by doubling, for the drops of a row of `cloud_moments.csv`."""
    moments = files.table("cloud_moments.csv").loc[row, "moment_0":].to_numpy()
    peak = moments[_MODES.size]
    points, gauss = (each[:_STREAMS] for each in quadrature(_STREAMS))
    # The zenith angles of the table have no weight in the integrals over the streams.
    mu = np.concatenate([np.cos(np.radians(_ZENITHS)), points])
    weights = np.concatenate([np.zeros(_ZENITHS.size), 2 * points * gauss])
    backward, forward = _phase_modes(mu, (2 * _MODES + 1) * (moments[:-1] - peak))
    thickness = _THINNEST * 2.0 ** (np.arange(_PER_OCTAVE) / _PER_OCTAVE - _FIRST)[:, None, None, None]
    scattered = ((1 - co_albedo) * each / (4 * mu * mu[:, None]) for each in (backward, forward))
    layer = _thin_layer(thickness, (1 - (1 - co_albedo) * peak) / mu, *scattered, weights)
    zeniths = _ZENITHS.size
    unscattered = np.zeros((1, _MODES.size, zeniths, zeniths)), np.ones((1, mu.size)), np.zeros((1, mu.size))
    found, depths = [unscattered], [np.zeros(1)]
    for number in range(_FIRST + _DOUBLINGS):
        layer, thickness = _twice(*layer, weights), 2 * thickness
        if number >= _FIRST - 1:
            reflectance, transmittance, direct = layer
            once = _scattered_once(thickness, co_albedo, peak, mu, mu[:, None], backward)
            passed, reflected = (weights @ each[:, 0] for each in (transmittance, reflectance))
            found.append(((reflectance - once)[..., :zeniths, :zeniths], direct[:, 0, 0] + passed, reflected))
            depths.append(thickness[:, 0, 0, 0])
    rescattered, passed, reflected = (np.concatenate(each) for each in zip(*found, strict=True))
    return _LayerTable(np.concatenate(depths), rescattered, passed[:, :zeniths], passed @ weights, reflected @ weights)


def _phase_modes(mu, moments):
    """Fourier modes of a phase function, backward and forward, shape (mode, mu, mu), from its Legendre series. [1]"""
    functions = np.array([wigner(mode, 0, mu, _MODES.size) for mode in _MODES])
    signs = np.where((_MODES + _MODES[:, None]) % 2 == 0, 1, -1)[:, None]
    across = np.swapaxes(functions, 1, 2) * moments
    return (across * signs) @ functions, across @ functions


def _thin_layer(thickness, lost, backward, forward, weights):
    """
    Diffuse reflectance and transmittance of a thin layer, and its direct transmittance, by [Wiscombe1976]_. [1]

    Light within the layer is the mean of the light at both sides, which conserves energy.
    """
    half, one = thickness / 2, np.eye(weights.size)
    kept = 1 / (1 + half * lost)
    backward, forward = half * backward, half * forward
    returned = np.linalg.solve(one / kept - forward * weights, backward)
    again = forward + (backward * weights) @ returned
    within = np.linalg.solve(one / kept - again * weights, again * kept)
    return 2 * (returned * kept + (returned * weights) @ within), 2 * within, 2 * kept - 1


def _twice(reflectance, transmittance, direct, weights):
    """Diffuse reflectance and transmittance, and direct transmittance, of two equal layers [Hansen1974]_. [1]"""
    leaving = np.swapaxes(direct, -1, -2)
    between = (reflectance * weights) @ reflectance
    between = np.linalg.solve(np.eye(weights.size) - between * weights, between)
    down = transmittance + between * direct + (between * weights) @ transmittance
    up = reflectance * direct + (reflectance * weights) @ down
    passed = leaving * down + transmittance * direct + (transmittance * weights) @ down
    return reflectance + leaving * up + (transmittance * weights) @ up, passed, direct**2


class CloudTables(NamedTuple):
    """Tables of the clouds of one scene, for `under_clouds`. [1]"""

    reflectance: np.ndarray  # by steps of thickness, shape (band, step)
    fluxes: np.ndarray  # the other fields of `LayerLight`, shape (band, field, step)
    kind: np.ndarray  # first band with the same fluxes, shape (band,)
    path: np.ndarray  # apparent reflectance of the atmosphere over black ground, shape (band,)
    diffuse_fraction: np.ndarray  # of the irradiance without clouds, shape (band,)
    ozone: np.ndarray  # transmittance of the ozone above the clouds, down and up, shape (band,)


_STEPS = 2000  # of the root of the thickness, which interpolate reflectance to 1e-4 of it
_PER_ROOT = _STEPS / THICKEST**0.5


def sky_tables(drops, path, diffuse_fraction, ozone, sza, vza, raa):
    """Tables of `under_clouds` for each band; ozone, which lies above the clouds, dims the light that they reflect."""
    light = np.array([_steps(each, sza, vza, raa) for each in drops])
    tables = [(each.co_albedo, each.row) for each in drops]
    kind = np.array([tables.index(each) for each in tables])
    return CloudTables(
        light[:, 0], light[:, 1:], kind, *(np.asarray(each, float) for each in (path, diffuse_fraction, ozone))
    )


def _steps(drops, sza, vza, raa):
    """Light of clouds at the steps of `CloudTables`, shape (field, step). [1]"""
    thickness = np.minimum((np.arange(_STEPS + 1) / _PER_ROOT) ** 2, THICKEST)
    return np.array(layer_light(thickness, drops, sza, vza, raa))


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


def under_clouds(clear, seen, sunlit, overhead, *, sky, in_place=False):
    """
    Apparent reflectance of a scene with clouds, by `clouded_reflectance`.

    Parameters
    ----------
    clear : array, shape (y, x, band)
        Apparent reflectance without clouds. [1]
    seen, sunlit, overhead : array, shape (y, x)
        Optical thickness of the clouds toward the sensor, toward the sun and overhead, 0 to 100. [1]
    sky : CloudTables
    in_place : bool, optional
        Whether to overwrite `clear`.

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
    out = np.moveaxis(clear, -1, 0)
    if not (in_place and out.flags.c_contiguous):
        out = np.array(out, order="C")
    _, rows, width = out.shape
    found = np.empty((3, width), np.uint32), np.empty((3, width), np.uint32), np.empty((3, width))
    at_nadir = overhead is seen
    lines = (seen, sunlit) if at_nadir else (seen, sunlit, overhead)
    light, size = np.empty((6, width)), max(_CELLS // max(width, 1), 1)
    for first in range(0, rows, size):
        columns = [np.ascontiguousarray(each[first : first + size], float) for each in lines]
        if _cloud_rows(out, first, *columns[:2], columns[-1], at_nadir, sky, *found, light):
            wrong = np.concatenate([each[(each < 0) | (each > THICKEST)] for each in columns])[0]
            raise ValueError(f"optical_thickness must be from 0 to {THICKEST:g}, got {wrong:g}: clip it, .clip(0, 100)")
    return out


_CELLS = 2**15  # whose three columns of clouds fit in the cache of a core


@compiled
def _cloud_rows(scene, first, seen, sunlit, overhead, at_nadir, sky, cell, step, share, light):
    """Add clouds to some rows of a scene; whether a thickness is invalid."""
    up = 0 if at_nadir else 2
    for i in range(len(seen)):
        v = _find(seen[i], cell[0], step[0], share[0])
        s = _find(sunlit[i], cell[1], step[1], share[1])
        o = v if at_nadir else _find(overhead[i], cell[2], step[2], share[2])
        if min(v, s, o) < 0:
            return True
        if max(v, s, o) == 0:
            continue
        for field in range(6):
            # Without clouds, reflectance and albedo are 0 and transmittances are 1, so the result is bitwise unchanged.
            light[field] = 0 if field in (0, 3) else 1
        for kind in range(len(scene)):
            if sky.kind[kind] != kind:
                continue
            table = sky.fluxes[kind]
            for field in range(3):
                _look_up(table[field], cell[0, :v], step[0, :v], share[0, :v], light[field + 1])
            _look_up(table[0], cell[1, :s], step[1, :s], share[1, :s], light[4])
            _look_up(table[3], cell[up, :o], step[up, :o], share[up, :o], light[5])
            for b in range(kind, len(scene)):
                if sky.kind[b] == kind:
                    _look_up(sky.reflectance[b], cell[0, :v], step[0, :v], share[0, :v], light[0])
                    _cloud_row(scene[b, first + i], light, sky.path[b], sky.diffuse_fraction[b], sky.ozone[b])
    return False


@jitable
def _find(thickness, cell, step, share):
    """Fill in the cells with clouds, the steps of the tables below their thickness and the shares of the way to the
    next; their number, or -1 if a thickness is invalid."""
    count, invalid = 0, False
    for j in range(thickness.size):
        cell[count] = j
        count += thickness[j] != 0
    for k in range(count):
        value = thickness[cell[k]]
        invalid |= (value < 0) | (value > THICKEST)
        at = np.sqrt(value) * _PER_ROOT
        # NaN has no step, and its share stays NaN.
        step[k] = np.uint32(at if at < _STEPS - 0.5 else _STEPS - 0.5)
        share[k] = at - step[k]
    return -1 if invalid else count


@jitable
def _look_up(table, cell, step, share, out):
    """Fill in a property of the cells with clouds, by linear interpolation."""
    for k in range(cell.size):
        value = table[step[k]]
        out[cell[k]] = value + share[k] * (table[step[k] + np.uint32(1)] - value)


@jitable
def _cloud_row(cells, light, path, diffuse, ozone):
    """Add clouds to a row of cells in one band."""
    reflected, down, up, albedo, lit, sky = light[0], light[1], light[2], light[3], light[4], light[5]
    for j in range(cells.size):
        cells[j] = clouded_reflectance(
            cells[j], path, diffuse, ozone * reflected[j], down[j], lit[j], sky[j], up[j], albedo[j]
        )
