"""Spectral and band terms of an atmosphere, and its coupling with the surface."""

import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from fifesim.atmosphere import gases
from fifesim.base.arrays import compiled, jitable
from fifesim.base.bands import solar_irradiance_steps
from fifesim.base.caches import cached


class TargetTerms(NamedTuple):
    """Terms of the equation of a target in its environment: arrays that broadcast. [1]"""

    path_reflectance: object  # of the atmosphere alone
    transmittance_down: object  # total, from the sun
    direct_transmittance_up: object  # to the sensor without scattering
    diffuse_transmittance_up: object  # and with
    spherical_albedo: object  # of the atmosphere seen from below
    gas_transmittance: object = 1.0  # of the absorbing gases, down and up


def apparent_reflectance(
    surface_reflectance, path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance=1.0
):
    r"""
    Apparent reflectance at the top of the atmosphere over a uniform surface.

    .. math::

        \rho^* = T_g \left[ \rho_a + T(\theta_s) \, \frac{\rho}{1 - \rho S} \, T(\theta_v) \right]

    Parameters
    ----------
    surface_reflectance : array, shape (..., band, y, x)
        Reflectance factor of the surface, :math:`\rho`. [1]
    path_reflectance : array, broadcastable
        Reflectance of the atmosphere alone, :math:`\rho_a`. [1]
    transmittance_down, transmittance_up : array, broadcastable
        Total transmittance from the sun, :math:`T(\theta_s)`, and to the sensor, :math:`T(\theta_v)`. [1]
    spherical_albedo : array, broadcastable
        Albedo of the atmosphere seen from below, :math:`S`. [1]
    gas_transmittance : array, broadcastable, optional
        Transmittance of the absorbing gases, down and up, :math:`T_g`. [1]

    Returns
    -------
    toa_reflectance : array, shape of the broadcast inputs
        Apparent reflectance :math:`\rho^*`, with the cosine of the solar zenith divided out. [1]

    Raises
    ------
    ValueError
        If :math:`\rho S \ge 1`, where the multiple reflections do not converge.

    Notes
    -----
    The surface is uniform and Lambertian; `inhomogeneous_reflectance` is for any other.

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    A perfectly clear atmosphere changes nothing:

    >>> float(apparent_reflectance(0.25, 0.0, 1.0, 1.0, 0.0))
    0.25
    """
    factors = path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance
    toa, refused = _by_cell(_apparent, (surface_reflectance, surface_reflectance), (*factors, 1.0, 0.0))
    if refused:
        _refuse(surface_reflectance, spherical_albedo, "surface_reflectance")
    return toa


def corrected_reflectance(
    toa_reflectance, path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance=1.0
):
    r"""
    Reflectance of a uniform surface from its apparent reflectance.

    .. math::

        \rho = \frac{y}{1 + S y}, \qquad y = \frac{\rho^* / T_g - \rho_a}{T(\theta_s) \, T(\theta_v)}

    Parameters
    ----------
    toa_reflectance : array, shape (..., band, y, x)
        Apparent reflectance, :math:`\rho^*`. [1]
    path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance : array
        As in `apparent_reflectance`. [1]

    Returns
    -------
    surface_reflectance : array, shape of the broadcast inputs
        Negative where the scene is darker than the atmosphere alone. [1]

    Notes
    -----
    The exact inverse of `apparent_reflectance`.

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> round(float(corrected_reflectance(apparent_reflectance(0.25, 0.1, 0.8, 0.9, 0.2), 0.1, 0.8, 0.9, 0.2)), 12)
    0.25
    """
    factors = path_reflectance, transmittance_down, transmittance_up, spherical_albedo, gas_transmittance
    return _by_cell(_corrected, (toa_reflectance,), factors)[0]


def inhomogeneous_reflectance(target, environment, terms):
    r"""
    Apparent reflectance at the top of the atmosphere of a target in its environment.

    .. math::

        \rho^* = T_g \left[ \rho_a + T(\theta_s) \, \frac{\rho_c \, e^{-\tau / \mu_v}
        + \langle \rho \rangle \, t_d(\theta_v)}{1 - \langle \rho \rangle S} \right]

    Parameters
    ----------
    target : array, shape (..., band, y, x)
        Reflectance factor of the target, :math:`\rho_c`. [1]
    environment : array, broadcastable
        Mean reflectance of the surroundings, :math:`\langle \rho \rangle`. [1]
    terms : TargetTerms
        :math:`\rho_a, T(\theta_s), e^{-\tau / \mu_v}, t_d(\theta_v), S, T_g`. [1]

    Returns
    -------
    toa_reflectance : array, shape of the broadcast inputs
        Apparent reflectance :math:`\rho^*`. [1]

    Raises
    ------
    ValueError
        If :math:`\langle \rho \rangle S \ge 1`, where the multiple reflections do not converge.

    References
    ----------
    [Tanre1990]_; [Vermote1997]_

    Examples
    --------
    Bright surroundings brighten a dark target:

    >>> terms = TargetTerms(0.1, 0.8, 0.6, 0.25, 0.2)
    >>> bright, dark = (inhomogeneous_reflectance(0.05, around, terms) for around in (0.4, 0.05))
    >>> round(float(bright - dark), 4)
    0.0787
    """
    path, down, direct, diffuse, albedo, gas = terms
    toa, refused = _by_cell(_apparent, (target, environment), (path, down, 1.0, albedo, gas, direct, diffuse))
    if refused:
        _refuse(environment, albedo, "the environment's reflectance")
    return toa


def target_reflectance(toa_reflectance, environment, terms):
    r"""
    Reflectance of a target in a known environment from its apparent reflectance.

    .. math::

        \rho_c = \left[ \frac{y \, (1 - \langle \rho \rangle S)}{T(\theta_s)}
        - \langle \rho \rangle \, t_d(\theta_v) \right] e^{\tau / \mu_v}, \qquad y = \rho^* / T_g - \rho_a

    Parameters
    ----------
    toa_reflectance : array, shape (..., band, y, x)
        Apparent reflectance, :math:`\rho^*`. [1]
    environment, terms
        As in `inhomogeneous_reflectance`. [1]

    Returns
    -------
    target : array, shape of the broadcast inputs
        Negative where the scene is darker than atmosphere and environment alone. [1]

    Notes
    -----
    The exact inverse of `inhomogeneous_reflectance`.

    References
    ----------
    [Tanre1990]_; [Vermote1997]_

    Examples
    --------
    >>> terms = TargetTerms(0.1, 0.8, 0.6, 0.25, 0.2)
    >>> round(float(target_reflectance(inhomogeneous_reflectance(0.05, 0.4, terms), 0.4, terms)), 12)
    0.05
    """
    path, down, direct, diffuse, albedo, gas = terms
    upward = (toa_reflectance / gas - path) * (1 - environment * albedo) / down
    return (upward - environment * diffuse) / direct


@jitable
def apparent_reflectance_of_cell(leaving, around, path, down, up, albedo, gas):
    r"""
    Apparent reflectance at the top of the atmosphere of one cell.

    .. math::

        \rho^* = T_g \left[ \rho_a + T(\theta_s) \, \frac{\rho}{1 - \langle \rho \rangle S} \, T(\theta_v) \right]

    Parameters
    ----------
    leaving : float
        Reflectance of the ground that is seen, :math:`\rho`. [1]
    around : float
        Reflectance of the surroundings, which exchange light with the atmosphere, :math:`\langle \rho \rangle`. [1]
    path, down, up, albedo, gas : float
        As in `apparent_reflectance`. [1]

    Returns
    -------
    toa : float
        Infinite where :math:`\langle \rho \rangle S \ge 1`. [1]

    References
    ----------
    [Tanre1990]_

    Examples
    --------
    >>> apparent_reflectance_of_cell(0.25, 0.25, 0.0, 1.0, 1.0, 0.0, 1.0)
    0.25
    """
    trapped = around * albedo
    if trapped >= 1:
        return np.inf
    return gas * (path + down * leaving / (1 - trapped) * up)


@jitable
def corrected_reflectance_of_cell(toa, path, down, up, albedo, gas):
    """
    Reflectance of one cell of a uniform surface from apparent reflectance, as in `corrected_reflectance` [Tanre1990]_.
    [1]
    """
    ground = (toa / gas - path) / (down * up)
    return ground / (1 + albedo * ground)


def _refuse(around, spherical_albedo, what):
    """Raise ValueError for the reflectances that `apparent_reflectance_of_cell` has marked."""
    trapped = np.asarray(around, float) * np.asarray(spherical_albedo, float)
    raise ValueError(
        f"{what} times spherical_albedo must be below 1, got {np.nanmax(trapped):g}: "
        "reflectance is a fraction, not a percentage"
    )


def _by_cell(kernel, cells, terms):
    """Apply a kernel to arrays that broadcast, and return its result with the number of refused cells."""
    # Terms that are constant along all last axes are not spread out over them.
    cells = [np.asarray(each) for each in cells]
    terms = np.broadcast_arrays(*(np.asarray(each, float) for each in terms))
    shape = np.broadcast_shapes(terms[0].shape, *(each.shape for each in cells))
    own = (1,) * (len(shape) - terms[0].ndim) + terms[0].shape
    split = max((axis + 1 for axis, size in enumerate(own) if size > 1), default=0)
    spread = [np.broadcast_to(each.reshape(own[:split]), shape[:split]) for each in terms]
    spread = np.stack(spread).reshape(len(terms), math.prod(shape[:split]))
    out = np.empty((spread.shape[1], math.prod(shape[split:])))
    # A cell in single precision is widened when it is read.
    wide = [each if each.dtype == np.float32 else each.astype(float, copy=False) for each in cells]
    wide = (np.ascontiguousarray(np.broadcast_to(each, shape)).reshape(out.shape) for each in wide)
    refused = kernel(*wide, spread, out)
    return out.reshape(shape)[()], refused


# Without transmitted light, division by zero gives infinity as in numpy.
@compiled
def _apparent(target, around, terms, out):
    """Fill in the apparent reflectances, and count those to be refused."""
    refused = 0
    for i in range(out.shape[0]):
        path, down, up, albedo, gas, direct, diffuse = terms[:, i]
        for j in range(out.shape[1]):
            leaving = target[i, j] * direct + around[i, j] * diffuse
            out[i, j] = apparent_reflectance_of_cell(leaving, around[i, j], path, down, up, albedo, gas)
            refused += np.isinf(out[i, j])
    return refused


@compiled
def _corrected(toa, terms, out):
    for i in range(out.shape[0]):
        path, down, up, albedo, gas = terms[:, i]
        for j in range(out.shape[1]):
            out[i, j] = corrected_reflectance_of_cell(toa[i, j], path, down, up, albedo, gas)


# Wavelengths at which scattering is computed, equal to the wavelengths of the aerosol refractive indices. [um]
WAVELENGTHS = np.array(
    [0.4, 0.412, 0.443, 0.47, 0.488, 0.515, 0.55, 0.59, 0.633, 0.67, 0.694, 0.76, 0.86]
    + [1.24, 1.536, 1.65, 1.95, 2.25, 2.5, 3.75]
)

_TINY = 1e-30  # keeps logarithms finite without aerosol


class Scattering(NamedTuple):
    """Scattering by wavelength, without gases, broadcast to (V, R, n) for V views, R azimuths and n wavelengths. [1]"""

    reflectance: np.ndarray  # of molecules and aerosol over a black ground
    molecules_reflectance: np.ndarray  # of the molecules alone
    transmittance_down: np.ndarray  # total, sun to ground
    transmittance_up: np.ndarray  # total, ground to sensor
    spherical_albedo: np.ndarray  # seen from below
    optical_depth: np.ndarray  # vertical, of molecules and aerosol
    direct_transmittance_down: np.ndarray
    direct_transmittance_up: np.ndarray
    diffuse_up_molecules: np.ndarray  # of the molecules alone, ground to sensor
    diffuse_up_aerosol: np.ndarray  # of the aerosol alone


class BandTerms(NamedTuple):
    """Terms of the coupling equation in each band, shape (band,), or (V, R, band) for several views. [1]"""

    path_reflectance: np.ndarray  # of the atmosphere alone, to be multiplied by gas_transmittance
    transmittance_down: np.ndarray  # total, sun to ground, scattering only
    transmittance_up: np.ndarray  # total, ground to sensor, scattering only
    spherical_albedo: np.ndarray  # seen from below
    gas_transmittance: np.ndarray  # down and up
    optical_depth: np.ndarray  # vertical, of molecules and aerosol
    direct_transmittance_down: np.ndarray  # of the sunbeam, scattering only
    diffuse_fraction: np.ndarray  # of the flux that falls on a black ground
    direct_transmittance_up: np.ndarray  # ground to sensor without scattering
    diffuse_up_molecules: np.ndarray  # ground to sensor, scattered by the molecules alone
    diffuse_up_aerosol: np.ndarray  # by the aerosol alone

    @property
    def uniform(self):
        """Arguments of `coupling.apparent_reflectance`, the equation over a uniform surface, by name and in order."""
        names = ("path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo", "gas_transmittance")
        return {name: getattr(self, name) for name in names}

    @property
    def target(self):
        """Terms of the equation of a target in its environment, as `coupling.TargetTerms`."""
        diffuse = np.asarray(self.transmittance_up) - self.direct_transmittance_up
        own = {name: getattr(self, name) for name in TargetTerms._fields if name in self._fields}
        return TargetTerms(diffuse_transmittance_up=diffuse, **own)


def nodes_of(bands):
    """Wavelengths of `WAVELENGTHS` needed for some bands, with two more on either side for interpolation. [um]"""
    return np.unique(np.concatenate([spectral_nodes(*band.limits) for band in bands]))


def spectral_nodes(low, high):
    """Wavelengths of `WAVELENGTHS` needed for a spectral range. [um]"""
    first = max(np.searchsorted(WAVELENGTHS, low, side="right") - 2, 0)
    return WAVELENGTHS[first : np.searchsorted(WAVELENGTHS, high) + 2]


def on_wavelengths(scattering, nodes, wavelength):
    """Scattering interpolated to other wavelengths."""
    # Cubics without overshoot in the logarithm of the wavelength: of the logarithm, or of the optical depth for
    # transmittances.
    through = ["transmittance" in name for name in Scattering._fields]
    depths = [-np.log(each) if is_one else each for each, is_one in zip(scattering, through, strict=True)]
    # A single interpolator, because creating one takes longer than using it.
    logs = np.log(np.maximum(np.concatenate([np.reshape(each, (-1, len(nodes))) for each in depths]), _TINY))
    rows = np.exp(PchipInterpolator(np.log(nodes), logs, axis=-1)(np.log(wavelength)))
    parts = np.split(rows, np.cumsum([each.size // len(nodes) for each in depths])[:-1])
    found = (part.reshape(*each.shape[:-1], -1) for part, each in zip(parts, depths, strict=True))
    return Scattering(*(np.exp(-each) if is_one else each for each, is_one in zip(found, through, strict=True)))


def band_mean_terms(scattering, nodes, atmosphere, bands, sza, vza):
    r"""
    Terms in each band, from scattering and gases by wavelength.

    With :math:`\langle X \rangle` the mean over the response times the solar spectrum,

    .. math::

        T_g = \frac{\langle T_g T T \rangle}{\langle T \rangle \langle T \rangle}, \qquad
        S = \frac{\langle S \, T_g T T \rangle}{\langle T_g T T \rangle}, \qquad
        \rho_a = \frac{\langle (\rho_a - \rho_R) T_g + \rho_R T_g^\mathrm{dry} \rangle}{T_g}

    Parameters
    ----------
    scattering : Scattering
        At the nodes.
    nodes : array, shape (k,)
        Of `WAVELENGTHS`, as `nodes_of` gives them. [um]
    atmosphere : models.Atmosphere
    bands : sequence of Band, length (band,)
    sza : float
    vza : array, shape (V,)
        [degree]

    Returns
    -------
    terms : BandTerms
        Terms of shape (V or 1, R or 1, band).

    Raises
    ------
    ValueError
        If a band reaches beyond the gas table.

    Notes
    -----
    These means make the band's reflectance equal to the mean over the spectrum at first and second order in the
    surface reflectance. Molecules scatter above the water vapour and are not dimmed by it
    (:math:`T_g^\mathrm{dry}` leaves it out); aerosol mixes with it. The gases do not enter the flux at the ground.

    References
    ----------
    [Tanre1990]_
    """
    parts = [_one_band(scattering, nodes, atmosphere, band, sza, vza) for band in bands]
    # Every term has axes for views and azimuths.
    return BandTerms(*(np.array(np.stack(values, axis=-1), ndmin=3) for values in zip(*parts, strict=True)))


def _one_band(scattering, nodes, atmosphere, band, sza, vza):
    wavelength, _ = _steps(band.limits, band.name)
    light = on_wavelengths(scattering, nodes, wavelength)
    air_mass = 1 / np.cos(np.radians(sza)) + 1 / np.cos(np.radians(vza))[:, None]
    gas = gases.gas_transmittance(wavelength, atmosphere, air_mass)
    dry = gases.gas_transmittance(wavelength, atmosphere, air_mass, gases=gases.DRY_GASES)
    ground = gas * light.transmittance_down * light.transmittance_up
    path = light.reflectance * gas + light.molecules_reflectance * (dry - gas)

    mean = _quadrature(band).mean
    down, up, direct = map(mean, (light.transmittance_down, light.transmittance_up, light.direct_transmittance_down))
    used = mean(ground)
    return BandTerms(
        path_reflectance=mean(path) * down * up / used,
        transmittance_down=down,
        transmittance_up=up,
        spherical_albedo=mean(ground * light.spherical_albedo) / used,
        gas_transmittance=used / (down * up),
        optical_depth=mean(light.optical_depth),
        direct_transmittance_down=direct,
        diffuse_fraction=1 - direct / down,
        direct_transmittance_up=mean(light.direct_transmittance_up),
        diffuse_up_molecules=mean(light.diffuse_up_molecules),
        diffuse_up_aerosol=mean(light.diffuse_up_aerosol),
    )


def band_gas_transmittance(atmosphere, band, geometry, names):
    """Mean transmittance of some gases in a band, from the sun to the ground and to the sensor. [1]"""
    wavelength, _ = _steps(band.limits, band.name)
    air_mass = 1 / geometry.mu_s + 1 / geometry.mu_v
    return float(_quadrature(band).mean(gases.gas_transmittance(wavelength, atmosphere, air_mass, gases=names)))


@cached(256, "weights of a band over the gas table")
def _quadrature(band):
    """Weights of a band mean of spectra on its `_steps`."""
    return band.quadrature(*_steps(band.limits, band.name))


@cached(256, "wavelengths and sunlight of a band")
def _steps(limits, name):
    """Wavelengths of the gas table that cover a band, and the solar irradiance of their steps."""
    table = gases.table_wavelengths()
    if limits[0] < table[0] or limits[1] > table[-1]:
        raise ValueError(
            f"band {name} spans {limits[0]:g} to {limits[1]:g} um, "
            f"the gas tables only {table[0]:g} to {table[-1]:g} um: leave it out"
        )
    used = slice(np.searchsorted(table, limits[0], side="right") - 1, np.searchsorted(table, limits[1]) + 1)
    return table[used], solar_irradiance_steps(table)[used]
