"""What an atmosphere does to light, wavelength by wavelength and band by band."""

import math
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from fifesim.atmosphere.air import gases
from fifesim.atmosphere.schemes.coupling import TargetTerms
from fifesim.base.bands import solar_irradiance_steps

# Wavelengths at which scattering is computed: those of the aerosol's refractive indices. [um]
WAVELENGTHS = np.array(
    [0.4, 0.412, 0.443, 0.47, 0.488, 0.515, 0.55, 0.59, 0.633, 0.67, 0.694, 0.76, 0.86]
    + [1.24, 1.536, 1.65, 1.95, 2.25, 3.75]
)

_TINY = 1e-30  # where there is no aerosol, the logarithm of what it does is still finite


class Scattering(NamedTuple):
    """
    What scattering does, without gases, by wavelength. [1]

    For V views and R relative azimuths at n wavelengths, shapes broadcast to (V, R, n).
    """

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
    """
    What the atmosphere does in each band. [1]

    Shape (band,) for one geometry; (V, R, band) as in `Scattering` for several.
    """

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
        """Those of `coupling.apparent_reflectance`, the equation over a uniform surface, by name and in its order."""
        names = ("path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo", "gas_transmittance")
        return {name: getattr(self, name) for name in names}

    @property
    def target(self):
        """Those of the equation of a target in its environment, as `coupling.TargetTerms`."""
        diffuse = np.asarray(self.transmittance_up) - self.direct_transmittance_up
        own = {name: getattr(self, name) for name in TargetTerms._fields if name in self._fields}
        return TargetTerms(diffuse_transmittance_up=diffuse, **own)


def nodes_of(bands):
    """
    Wavelengths of `WAVELENGTHS` on which the terms of some bands depend.

    Parameters
    ----------
    bands : sequence of Band

    Returns
    -------
    wavelength : array, shape (n,)
        Those inside the bands, and two on either side for the slopes of the interpolation. [um]

    Examples
    --------
    >>> from fifesim.base.bands import Band
    >>> nodes_of([Band("red", (0.6, 0.65), (1, 1))]).tolist()
    [0.55, 0.59, 0.633, 0.67, 0.694]
    """
    return np.unique(np.concatenate([spectral_nodes(*band.limits) for band in bands]))


def spectral_nodes(low, high):
    """
    Wavelengths of `WAVELENGTHS` on which a stretch of the spectrum depends.

    Parameters
    ----------
    low, high : float
        [um]

    Returns
    -------
    wavelength : array, shape (n,)
        [um]

    Examples
    --------
    >>> spectral_nodes(0.6, 0.65).size
    5
    """
    first = max(np.searchsorted(WAVELENGTHS, low, side="right") - 2, 0)
    return WAVELENGTHS[first : np.searchsorted(WAVELENGTHS, high) + 2]


def on_wavelengths(scattering, nodes, wavelength):
    """
    Scattering between the wavelengths at which it was computed.

    Parameters
    ----------
    scattering : Scattering
        At the nodes.
    nodes, wavelength : array, shape (k,) and (n,)
        Increasing. [um]

    Returns
    -------
    scattering : Scattering
        By cubics that do not overshoot: logarithms, and for a transmittance that of its optical depth, against the
        logarithm of the wavelength.
    """
    through = ["transmittance" in name for name in Scattering._fields]
    depths = [-np.log(each) if is_one else each for each, is_one in zip(scattering, through, strict=True)]
    # One interpolator for all: to make one takes longer than to use it.
    found = _of_rows(partial(_between, np.log(nodes), np.log(wavelength)), depths)
    return Scattering(*(np.exp(-each) if is_one else each for each, is_one in zip(found, through, strict=True)))


def _between(log_nodes, log_wavelength, values):
    logs = np.log(np.maximum(values, _TINY))
    return np.exp(PchipInterpolator(log_nodes, logs, axis=-1)(log_wavelength))


def _of_rows(function, arrays):
    """What a function of the last axis makes of several arrays, asked once."""
    arrays = [np.asarray(each, float) for each in arrays]
    rows = function(np.concatenate([each.reshape(-1, each.shape[-1]) for each in arrays]))
    ends = np.cumsum([math.prod(each.shape[:-1]) for each in arrays])[:-1]
    parts = np.split(rows, ends)
    return [part.reshape(each.shape[:-1] + rows.shape[1:]) for part, each in zip(parts, arrays, strict=True)]


def band_means(scattering, nodes, atmosphere, bands, sza, vza):
    r"""
    Terms in each band, from scattering and gases at each wavelength.

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
        Of shapes (V or 1, R or 1, band).

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


@lru_cache(maxsize=256)
def _quadrature(band):
    """Means over a band, of spectra on its `_steps`."""
    return band.quadrature(*_steps(band.limits, band.name))


@lru_cache(maxsize=256)
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
