"""The chain on plain arrays: each step runs the kernel of its labelled function, without labels."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.analysis import indices
from fifesim.atmosphere import coupling, engines
from fifesim.atmosphere import labels as atmosphere_labels
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.bands import NEAR_INFRARED, RED, nearest_band
from fifesim.base.caches import cached
from fifesim.base.footprints import regularize
from fifesim.base.geometry import Geometry
from fifesim.chain import absorbed_light, landscapes
from fifesim.chain.setup import Setup, is_default
from fifesim.grids import grid as grids
from fifesim.grids.grid import as_carried
from fifesim.grids.reductions import areas, operators
from fifesim.ground.canopy.labels import Light, canopy_kernel, fpar_kernel
from fifesim.ground.canopy.properties import PROPERTIES
from fifesim.ground.terrain.lit_slopes import slope_reflectance
from fifesim.sensor import labels as sensor_labels
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.labels import noisy
from fifesim.sensor.pixel_labels import check_scene, pixel_grid, shifts_of
from fifesim.sensor.response import calibration

# Fields of a setup that the steps on arrays use. A setup whose other fields differ from their defaults needs labels.
_SUPPORTED = frozenset(
    ("instrument", "bands", "atmosphere", "geometry", "canopy", "upwelling")
    + ("onto", "interval", "offset", "min_valid", "noise", "noise_models", "seed", "quantise")
)


@dataclass(frozen=True, eq=False)
class Driver:
    """Steps of a setup on arrays over (band, y, x) or (y, x). Shared tables are computed once."""

    setup: Setup

    def __post_init__(self):
        if parts := varying_parts(self.setup):
            raise ValueError(f"plain arrays do not support {', '.join(parts)}: use fifesim.simulate")

    @cached_property
    def instrument(self):
        """Description of the instrument."""
        return find_instrument(self.setup.instrument)

    @cached_property
    def bands(self):
        """Bands of the setup, a tuple of InstrumentBand."""
        return self.instrument.select(self.setup.bands)

    @cached_property
    def irradiance(self):
        """Solar irradiance of each band, shape (band,). [W m-2 um-1]"""
        return np.array([band.solar_irradiance for band in self.bands])

    @cached_property
    def scale(self):
        """Gain and offset, shape (band,) [W m-2 sr-1 um-1], and number of bits."""
        return sensor_labels.scale(self.instrument, self.bands)

    @cached_property
    def compression(self):
        """Number of counts of square-root scales, shape (band,); 0 for linear scales."""
        return np.array([band.compressed_count(self.scale[2]) for band in self.bands])

    @property
    def air(self):
        """Atmosphere of the setup."""
        return Atmosphere() if self.setup.atmosphere is None else self.setup.atmosphere

    @property
    def shows_ndvi(self):
        """Whether the setup has a red and a near infrared band."""
        return None not in self._red_and_nir

    def reflectance(self, lai):
        """Reflectance of level ground, as `reflectance_of`."""
        kernel, blocks = self._canopy
        return kernel(lai, *blocks)

    def on_slopes(self, level, light):
        """Reflectance of slopes from the reflectance of level ground and the result of `light_on_slopes`."""
        air = self._terms.direct_transmittance_down, self._terms.transmittance_down
        return slope_reflectance(level, *light, *air, self.setup.upwelling)

    def fpar(self, lai, fpar_inf, leaves="all"):
        """Fraction of absorbed photosynthetically active radiation, as `absorbed_light.fpar` by Beer's law."""
        return fpar_kernel(None, self.setup.canopy, self.setup.geometry, fpar_inf, leaves)[0](lai)

    def absorbed(self, lai, canopy, suns=None):
        """Light absorbed by green leaves of a canopy of numbers for each sun, by default that of the image. [1]"""
        stand = landscapes.canopies_of(landscapes.Land(None), absorbed_light.PAR_BANDS, canopy)[None]
        suns = (float(self.setup.geometry.sza),) if suns is None else suns
        kernel, rasters = absorbed_light.sunlit_kernel(None, stand, self.air, suns, "green")
        return kernel(lai, *(each.values for each in rasters))

    def toa(self, reflectance):
        """Apparent reflectance at the top of the atmosphere, as `steps.to_toa`."""
        terms = self._terms.uniform.values()
        return coupling.apparent_reflectance(reflectance, *(_along_first(each, reflectance.ndim) for each in terms))

    def corrected(self, toa):
        """Reflectance at the ground, as `steps.to_surface`."""
        terms = self._terms.uniform.values()
        return coupling.corrected_reflectance(toa, *(_along_first(each, toa.ndim) for each in terms))

    def image(self, toa, cells, setup=None):
        """Digital numbers, or radiance without ``quantise``, of reflectance on a grid of cells."""
        # Pixels and seed are arguments because the driver may be shared by several setups.
        own, cells = setup or self.setup, as_carried(cells)
        pixels, shifts = self.pixels(cells, own)
        means = np.empty((len(self.bands), *pixels.shape))
        for spreads, numbers in self._bands_by_spread.items():
            names = ", ".join(self.bands[number].name for number in numbers)
            check_scene(spreads, cells, own.min_valid, f"{self.instrument.name} {names}")
            along = shared_operators(spreads, cells, pixels, shifts)
            means[numbers] = regularize(toa[numbers], *along, min_valid=own.min_valid)
        return self.recorded(self.with_noise(self.radiance(means), pixels, own))

    def pixels(self, cells, setup):
        """Grid of the image over a grid of cells, and the shifts of its pixels southward and eastward [m]."""
        grid = pixel_grid(as_carried(cells), self.instrument, self.bands, setup.onto, setup.interval)
        return grid, tuple(map(float, shifts_of(setup.offset, grid)))

    def radiance(self, reflectance):
        """Radiance [W m-2 sr-1 um-1] of reflectance at the top of the atmosphere."""
        return calibration.reflectance_to_radiance(reflectance, *self._sun)

    def with_noise(self, radiance, pixels, setup):
        """Radiance with noise for the pixels of a grid."""
        plain, first = xr.DataArray(radiance, dims=("band", "y", "x")), grids.lattice_position(pixels)
        return noisy(plain, self.instrument, self.bands, setup.noise, setup.seed, first, setup.noise_models).data

    def recorded(self, radiance):
        """Digital numbers of a radiance, or the radiance without ``quantise``."""
        if not self.setup.quantise:
            return radiance
        gain, offset, *compression = self._scales
        return calibration.radiance_to_dn(radiance, gain, offset, self.scale[2], *compression)

    def planetary(self, image):
        """Planetary reflectance of digital numbers, NaN where they are saturated, or of radiance."""
        if image.dtype.kind == "u":
            image = calibration.dn_to_radiance(image, *self._scales, saturated=2 ** self.scale[2] - 1)
        return calibration.radiance_to_reflectance(image, *self._sun)

    def ndvi(self, reflectance, linear=False):
        """Normalized difference vegetation index, shape (...), of reflectance, shape (band, ...), or of its tangent."""
        red, nir = self._red_and_nir
        kernel = indices.linear_normalized_difference if linear else indices.normalized_difference
        return kernel(reflectance[nir], reflectance[red])

    @cached_property
    def _canopy(self):
        """Kernel of the canopy and its arrays."""
        own = self.setup
        stand = landscapes.canopies_of(landscapes.Land(None), self._responses, own.canopy)[None]
        light = Light(own.geometry, atmosphere_labels.diffuse_fraction(self.air, self._responses, own.geometry))
        kernel, rasters = canopy_kernel(None, [band.name for band in self.bands], stand, light)
        return kernel, [each.values for each in rasters]

    @cached_property
    def _terms(self):
        """Terms of the atmosphere in each band."""
        light = self.setup.geometry
        return engines.band_terms(self.air, self._responses, light.sza, light.vza, light.raa)

    @cached_property
    def _responses(self):
        return tuple(band.response for band in self.bands)

    @cached_property
    def _sun(self):
        """Solar irradiance, cosine of the zenith angle and distance."""
        geometry = self.setup.geometry
        return _along_first(self.irradiance, 3), geometry.mu_s, float(geometry.earth_sun_distance)

    @cached_property
    def _scales(self):
        """Gain and offset, and the compression if any band has one; linear scales use shorter formulas."""
        scales = [*self.scale[:2], self.compression] if self.compression.any() else self.scale[:2]
        return [_along_first(each, 3) for each in scales]

    @cached_property
    def _bands_by_spread(self):
        groups = {}
        for number, band in enumerate(self.bands):
            groups.setdefault(self.instrument.line_spreads(band), []).append(number)
        return groups

    @cached_property
    def _red_and_nir(self):
        wavelengths = [band.wavelength for band in self.bands]
        return nearest_band(wavelengths, RED), nearest_band(wavelengths, NEAR_INFRARED)


def varying_parts(setup):
    """Names of the parts of a setup that plain arrays do not support, because they are unknown or vary by cell."""
    found = [each.name for each in fields(setup) if each.name not in _SUPPORTED and not is_default(setup, each.name)]
    found += [] if isinstance(setup.geometry, Geometry) else ["angles by cell"]
    found += ["a drifting offset"] if any(np.ndim(each) for each in setup.offset) else []
    return found + [name for name in PROPERTIES if isinstance(getattr(setup.canopy, name), xr.DataArray | xr.Dataset)]


def cell_block_means(values, cells, size, min_valid):
    """Means of arrays over (..., y, x) over square blocks of a size [m], as `scaling_labels.aggregate_blocks`."""
    cells = as_carried(cells)
    blocks = grids.aligned_grid(cells, size)
    return regularize(values, *shared_operators(areas(blocks), cells, blocks), min_valid=min_valid)


def shared_operators(spreads, cells, pixels, shifts=(0.0, 0.0)):
    """Operators from cells to pixels, cached for scenes that share them."""
    # Comparing CRSs takes longer than building an operator, which does not depend on the CRS.
    return _kept_operators(spreads, *(GeoBox(each.shape, each.affine, None) for each in (cells, pixels)), shifts)


_kept_operators = cached(256, "sampling operators")(operators)


def _along_first(values, ndim):
    """Values of bands as an array of `ndim` dimensions with bands first."""
    return np.reshape(values, (-1,) + (1,) * (ndim - 1))
