"""The chain by cell on plain arrays: the kernels of a setup, without labels."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from fifesim.analysis import indices
from fifesim.atmosphere import raster as atmosphere_raster
from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.schemes import coupling, engines
from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.base.geometry import Geometry
from fifesim.chain import landscapes
from fifesim.chain.setup import Setup
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.ground.canopy.raster import fpar_kernel
from fifesim.ground.canopy.rasters.evaluation import Light, canopy_kernel
from fifesim.ground.terrain.lit_slopes import slope_reflectance
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.response import calibration
from fifesim.sensor.response.rasters import digital_numbers


@dataclass(frozen=True, eq=False)
class Kernels:
    """
    What a setup makes of cells and pixels, as arrays: the bits of `fifesim.chain.setup`.

    What scenes share is made once, when it is first needed.

    Parameters
    ----------
    setup : fifesim.chain.setup.Setup
        Of numbers: one direction of sun and sensor, one canopy, level ground, and no adjacency.

    Raises
    ------
    ValueError
        If something of the setup is none of that.
    """

    setup: Setup

    def __post_init__(self):
        if reasons := labelled_only(self.setup):
            raise ValueError(f"plain arrays do not do with {', '.join(reasons)}: take fifesim.simulate")

    @cached_property
    def instrument(self):
        """A `fifesim.sensor.description.instruments.Instrument`."""
        return find_instrument(self.setup.instrument)

    @cached_property
    def bands(self):
        """A tuple of `fifesim.sensor.description.band.InstrumentBand`."""
        return self.instrument.select(self.setup.bands)

    @cached_property
    def irradiance(self):
        """Of the sun in each band, shape (band,). [W m-2 um-1]"""
        return np.array([band.solar_irradiance for band in self.bands])

    @cached_property
    def scale(self):
        """Radiance of a count and of number 0, shape (band,) each, and number of bits."""
        return digital_numbers.scale(self.instrument, self.bands)

    @cached_property
    def compression(self):
        """Counts of scales of square roots, shape (band,), 0 where a scale is linear."""
        return np.array([band.compressed_count(self.scale[2]) for band in self.bands])

    def reflectance(self, lai):
        """
        Reflectance of level ground.

        Parameters
        ----------
        lai : array, shape (y, x)
            [m2 m-2]

        Returns
        -------
        reflectance : array, shape (band, y, x)
            [1]

        See Also
        --------
        fifesim.chain.setup.reflectance_of
        """
        kernel, blocks = self._canopy
        return kernel(lai, *blocks)

    def on_slopes(self, level, light):
        """
        Reflectance of ground on slopes.

        Parameters
        ----------
        level : array, shape (band, y, x)
            Of level ground. [1]
        light : tuple
            From `fifesim.ground.terrain.rasters.lit_slopes.light_on_slopes`.

        Returns
        -------
        reflectance : array, shape (band, y, x)
            [1]

        See Also
        --------
        fifesim.ground.terrain.rasters.lit_slopes.terrain_reflectance
        """
        air = self._terms.direct_transmittance_down, self._terms.transmittance_down
        return slope_reflectance(level, *light, *air, self.setup.upwelling)

    def fpar(self, lai, fpar_inf, leaves="all"):
        """
        Fraction of photosynthetically active radiation that the canopy absorbs.

        Parameters
        ----------
        lai : array, shape (y, x)
            [m2 m-2]
        fpar_inf : float
            Of an infinitely thick canopy. [1]
        leaves : {"all", "green"}, optional

        Returns
        -------
        fpar : array, shape (y, x)
            [1]

        See Also
        --------
        fifesim.chain.landscapes.fpar
        """
        own = self.setup
        return fpar_kernel(None, own.canopy, own.geometry, fpar_inf, leaves)[0](lai)

    def toa(self, reflectance):
        """
        Apparent reflectance at the top of the atmosphere.

        Parameters
        ----------
        reflectance : array, shape (band, ...)
            Of the ground. [1]

        Returns
        -------
        reflectance : array, shape (band, ...)
            [1]

        See Also
        --------
        fifesim.chain.steps.to_toa
        """
        terms = self._terms.uniform.values()
        return coupling.apparent_reflectance(reflectance, *(down(each, reflectance.ndim) for each in terms))

    def recorded(self, radiance):
        """
        What the instrument records of the light that its pixels see.

        Parameters
        ----------
        radiance : array, shape (band, y, x)
            [W m-2 sr-1 um-1]

        Returns
        -------
        image : array, shape (band, y, x)
            Digital numbers, or the radiance without ``quantise``.

        See Also
        --------
        fifesim.sensor.raster.recorded
        """
        gain, offset, bits = self.scale
        if not self.setup.quantise:
            return radiance
        return calibration.radiance_to_dn(radiance, down(gain, 3), down(offset, 3), bits, *self._compressions)

    def radiance(self, reflectance):
        """
        Radiance of a reflectance at the top of the atmosphere.

        Parameters
        ----------
        reflectance : array, shape (band, y, x)
            [1]

        Returns
        -------
        radiance : array, shape (band, y, x)
            [W m-2 sr-1 um-1]

        See Also
        --------
        fifesim.sensor.raster.as_radiance
        """
        distance = float(self.setup.geometry.earth_sun_distance)
        return calibration.reflectance_to_radiance(reflectance, down(self.irradiance, 3), self._mu_s, distance)

    @property
    def shows_ndvi(self):
        """Whether there are a red and a near infrared band."""
        return None not in self._red_and_nir

    def planetary(self, image):
        """
        Reflectance of an image of digital numbers or radiance.

        Parameters
        ----------
        image : array, shape (band, y, x)

        Returns
        -------
        reflectance : array, shape (band, y, x)
            [1]

        See Also
        --------
        fifesim.sensor.raster.to_reflectance
        """
        if self.setup.quantise:
            scales = [down(each, 3) for each in self.scale[:2]]
            image = calibration.dn_to_radiance(image, *scales, *self._compressions)
        distance = float(self.setup.geometry.earth_sun_distance)
        return calibration.radiance_to_reflectance(image, down(self.irradiance, 3), self._mu_s, distance)

    def ndvi(self, reflectance):
        """
        Normalized difference vegetation index of a reflectance.

        Parameters
        ----------
        reflectance : array, shape (band, ...)
            [1]

        Returns
        -------
        ndvi : array, shape (...)
            [1]

        See Also
        --------
        fifesim.chain.images.ndvi
        """
        red, nir = self._red_and_nir
        return indices.normalized_difference(reflectance[nir], reflectance[red])

    @cached_property
    def _canopy(self):
        own = self.setup
        stand = landscapes.canopies_of(landscapes.Land(None), self.bands, own.canopy)[None]
        light = Light(own.geometry, atmosphere_raster.diffuse_fraction(self.air, self._responses, own.geometry))
        kernel, rasters = canopy_kernel(None, [band.name for band in self.bands], stand, light)
        return kernel, [each.values for each in rasters]

    @cached_property
    def _responses(self):
        return tuple(band.response for band in self.bands)

    @property
    def air(self):
        """A `fifesim.atmosphere.air.models.Atmosphere`."""
        return Atmosphere() if self.setup.atmosphere is None else self.setup.atmosphere

    @cached_property
    def _terms(self):
        light = self.setup.geometry
        return engines.band_terms(self.air, self._responses, light.sza, light.vza, light.raa)

    @cached_property
    def _mu_s(self):
        return np.cos(np.radians(self.setup.geometry.sza))

    @cached_property
    def _compressions(self):
        """None where all scales are linear, as the formulas for those are shorter."""
        return (down(self.compression, 3),) if self.compression.any() else ()

    @cached_property
    def _red_and_nir(self):
        wavelengths = [band.wavelength for band in self.bands]
        return nearest(wavelengths, RED), nearest(wavelengths, NEAR_INFRARED)


def labelled_only(setup):
    """
    What of a setup plain arrays do not do with.

    Parameters
    ----------
    setup : fifesim.chain.setup.Setup

    Returns
    -------
    reasons : list of str
        Empty where all is one number.
    """
    found = {
        "relief": setup.dem is not None,
        "adjacency": setup.adjacency,
        "angles by cell": not isinstance(setup.geometry, Geometry),
        "a drifting offset": any(np.ndim(each) for each in setup.offset),
    }
    rasters = [name for name in PROPERTIES if isinstance(getattr(setup.canopy, name), xr.DataArray | xr.Dataset)]
    return [name for name, is_so in found.items() if is_so] + rasters


def down(values, ndim):
    """
    Values of bands before the axes of cells.

    Parameters
    ----------
    values : array, shape (band,)
    ndim : int
        Of the array that they meet.

    Returns
    -------
    values : array, shape (band, 1, ...)
    """
    return np.reshape(values, (-1,) + (1,) * (ndim - 1))
