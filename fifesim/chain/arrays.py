"""The chain on plain arrays: what a setup makes of a scene in memory, kernel by kernel, without labels."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.analysis import indices
from fifesim.atmosphere import raster as atmosphere_raster
from fifesim.atmosphere.air.models import Atmosphere
from fifesim.atmosphere.schemes import coupling, engines
from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.base.footprints import regularize
from fifesim.base.geometry import Geometry
from fifesim.chain import landscapes
from fifesim.chain.setup import Setup
from fifesim.ground.canopy.raster import fpar_kernel
from fifesim.ground.canopy.rasters.evaluation import canopy_kernel
from fifesim.rasters import directions
from fifesim.rasters import grid as grids
from fifesim.rasters.regularization import areas, operators
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.response import calibration
from fifesim.sensor.response.rasters import digital_numbers
from fifesim.sensor.response.rasters.footprints import check_scene, shifts_of
from fifesim.sensor.response.rasters.noise import noisy
from fifesim.sensor.response.rasters.pixels import pixel_grid

# What `canopies_of` is told of a canopy.
_CANOPY = ("leaf_optics", "background", "leaf_angles", "hotspot", "brown", "dissociation", "brown_leaf")
_CANOPY += ("crown_cover", "crown_shape", "soil", "moisture")


@dataclass(frozen=True, eq=False)
class ArrayChain:
    """
    What a setup makes of scenes on one grid, as arrays: the kernels, and so the bits, of `fifesim.chain.setup`.

    What the scenes share is made once, when it is first needed.

    Parameters
    ----------
    setup : fifesim.chain.setup.Setup
        Of numbers: one direction of sun and sensor, one canopy, level ground, and no adjacency.
    grid : odc.geo.geobox.GeoBox
        Of the cells.
    """

    setup: Setup
    grid: GeoBox

    def __post_init__(self):
        if reasons := labelled_only(self.setup):
            raise ValueError(f"plain arrays do not do with {', '.join(reasons)}: take fifesim.simulate")
        object.__setattr__(self, "grid", as_carried(self.grid))

    @cached_property
    def instrument(self):
        """A `fifesim.sensor.description.instruments.Instrument`."""
        return find_instrument(self.setup.instrument)

    @cached_property
    def bands(self):
        """A tuple of `fifesim.sensor.description.band.InstrumentBand`."""
        return self.instrument.select(self.setup.bands)

    @cached_property
    def pixels(self):
        """Grid of the image, an `odc.geo.geobox.GeoBox`."""
        return pixel_grid(self.grid, self.instrument, self.bands, self.setup.onto, self.setup.interval)

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
        said = {name: getattr(own, name) for name in ("leaf_angles", "brown", "dissociation", "crown_cover")}
        return fpar_kernel(None, own.geometry, fpar_inf=fpar_inf, leaves=leaves, **said)[0](lai)

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
        return coupling.apparent_reflectance(reflectance, *(_down(each, reflectance.ndim) for each in terms))

    def image(self, toa):
        """
        What the instrument records.

        Parameters
        ----------
        toa : array, shape (band, y, x)
            Reflectance at the top of the atmosphere. [1]

        Returns
        -------
        image : array, shape (band, y, x)
            Digital numbers, or radiance without ``quantise``.

        See Also
        --------
        fifesim.sensor.raster.sense
        """
        own, (gain, offset, bits) = self.setup, self.scale
        irradiance, distance = _down(self.irradiance, 3), float(own.geometry.earth_sun_distance)
        means = self._footprint_means(toa)
        radiance = calibration.reflectance_to_radiance(means, irradiance, self._mu_s, distance)
        if own.noise:
            plain = xr.DataArray(radiance, dims=("band", "y", "x"))
            first = grids.lattice_position(self.pixels)
            radiance = noisy(plain, self.instrument, self.bands, own.noise, own.seed, first, own.noise_models).data
        if not own.quantise:
            return radiance
        scales = [_down(each, 3) for each in (gain, offset)]
        return calibration.radiance_to_dn(radiance, *scales, bits, *self._compressions)

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
            scales = [_down(each, 3) for each in self.scale[:2]]
            image = calibration.dn_to_radiance(image, *scales, *self._compressions)
        distance = float(self.setup.geometry.earth_sun_distance)
        return calibration.radiance_to_reflectance(image, _down(self.irradiance, 3), self._mu_s, distance)

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

    def blocks(self, size):
        """
        Grid of the blocks of the truth.

        Parameters
        ----------
        size : float
            [m]

        Returns
        -------
        blocks : odc.geo.geobox.GeoBox
        """
        return grids.aligned(self.grid, size)

    def means(self, values, size):
        """
        Means over the blocks of the truth.

        Parameters
        ----------
        values : array, shape (..., y, x)
            By cells.
        size : float
            Of a block. [m]

        Returns
        -------
        means : array, shape (..., y, x)

        See Also
        --------
        fifesim.analysis.rasters.means.aggregate
        """
        blocks = self.blocks(size)
        return regularize(values, *_operators(areas(blocks), self.grid, blocks), min_valid=self.setup.min_valid)

    @cached_property
    def _canopy(self):
        own, land = self.setup, landscapes.Land(None)
        canopies = landscapes.canopies_of(land, self.bands, {name: getattr(own, name) for name in _CANOPY})
        air = atmosphere_raster.diffuse_fraction(self.air, self._responses, own.geometry)
        light = {"diffuse_fraction": air, "geometry": own.geometry}
        kernel, rasters = canopy_kernel(None, [band.name for band in self.bands], **canopies[None], **light)
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
        return directions.mu_s(self.setup.geometry).values

    @cached_property
    def _compressions(self):
        """None where all scales are linear, as the formulas for those are shorter."""
        return (_down(self.compression, 3),) if self.compression.any() else ()

    @cached_property
    def _red_and_nir(self):
        wavelengths = [band.wavelength for band in self.bands]
        return nearest(wavelengths, RED), nearest(wavelengths, NEAR_INFRARED)

    def _footprint_means(self, toa):
        """Means over the footprints of pixels, of bands that share a line spread at a time."""
        groups = {}
        for number, band in enumerate(self.bands):
            groups.setdefault(self.instrument.line_spreads(band), []).append(number)
        means = np.empty((len(self.bands), *self.pixels.shape))
        shifts = shifts_of(self.setup.offset, self.pixels)
        for spreads, numbers in groups.items():
            names = ", ".join(self.bands[number].name for number in numbers)
            check_scene(spreads, self.grid, self.setup.min_valid, f"{self.instrument.name} {names}")
            along = _operators(spreads, self.grid, self.pixels, tuple(map(float, shifts)))
            means[numbers] = regularize(toa[numbers], *along, min_valid=self.setup.min_valid)
        return means


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
    rasters = [name for name in _CANOPY if isinstance(getattr(setup, name), xr.DataArray | xr.Dataset)]
    return [name for name, is_so in found.items() if is_so] + rasters


@lru_cache(maxsize=64)
def as_carried(grid):
    """
    A grid as a raster that lies on it tells it, by its coordinates.

    Parameters
    ----------
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    grid : odc.geo.geobox.GeoBox
    """
    return grids.geobox(grids.place(xr.DataArray(np.broadcast_to(0.0, grid.shape), dims=("y", "x")), grid))


@lru_cache(maxsize=256)
def _operators(spreads, cells, pixels, shifts=(0.0, 0.0)):
    """Operators of scenes that share their grid, made once."""
    return operators(spreads, cells, pixels, shifts)


def _down(values, ndim):
    """Values of bands before the axes of cells."""
    return np.reshape(values, (-1,) + (1,) * (ndim - 1))
