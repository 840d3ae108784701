"""The chain on plain arrays: what a setup makes of a scene in memory, from cells to pixels, without labels."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import xarray as xr
from odc.geo.geobox import GeoBox

from fifesim.base.footprints import regularize
from fifesim.chain.kernels import Kernels
from fifesim.chain.setup import Setup
from fifesim.rasters import grid as grids
from fifesim.rasters.carried_grid import as_carried
from fifesim.rasters.regularization import areas, operators
from fifesim.sensor.response.rasters.footprints import check_scene, shifts_of
from fifesim.sensor.response.rasters.noise import noisy
from fifesim.sensor.response.rasters.pixels import pixel_grid


@dataclass(frozen=True, eq=False)
class ArrayChain:
    """
    What a setup makes of scenes on one grid, as arrays: the bits of `fifesim.chain.setup`.

    Parameters
    ----------
    setup : fifesim.chain.setup.Setup
        As `fifesim.chain.kernels.Kernels` takes it.
    grid : odc.geo.geobox.GeoBox
        Of the cells.
    kernels : fifesim.chain.kernels.Kernels, optional
        Of a setup that differs in the place of its pixels and in the seed of its noise alone, to share what is made.

    Raises
    ------
    ValueError
        As of `Kernels`.
    """

    setup: Setup
    grid: GeoBox
    kernels: Kernels | None = None

    def __post_init__(self):
        object.__setattr__(self, "grid", as_carried(self.grid))
        object.__setattr__(self, "kernels", Kernels(self.setup) if self.kernels is None else self.kernels)

    @cached_property
    def pixels(self):
        """Grid of the image, an `odc.geo.geobox.GeoBox`."""
        return pixel_grid(self.grid, self.kernels.instrument, self.kernels.bands, self.setup.onto, self.setup.interval)

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
        own, kernels = self.setup, self.kernels
        radiance = kernels.radiance(self._footprint_means(toa))
        if own.noise:
            plain = xr.DataArray(radiance, dims=("band", "y", "x"))
            said = own.noise, own.seed, grids.lattice_position(self.pixels), own.noise_models
            radiance = noisy(plain, kernels.instrument, kernels.bands, *said).data
        return kernels.recorded(radiance)

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
        return regularize(values, *shared_operators(areas(blocks), self.grid, blocks), min_valid=self.setup.min_valid)

    def _footprint_means(self, toa):
        """Means over the footprints of pixels, of bands that share a line spread at a time."""
        instrument, bands, groups = self.kernels.instrument, self.kernels.bands, {}
        for number, band in enumerate(bands):
            groups.setdefault(instrument.line_spreads(band), []).append(number)
        means = np.empty((len(bands), *self.pixels.shape))
        shifts = tuple(map(float, shifts_of(self.setup.offset, self.pixels)))
        for spreads, numbers in groups.items():
            names = ", ".join(bands[number].name for number in numbers)
            check_scene(spreads, self.grid, self.setup.min_valid, f"{instrument.name} {names}")
            along = shared_operators(spreads, self.grid, self.pixels, shifts)
            means[numbers] = regularize(toa[numbers], *along, min_valid=self.setup.min_valid)
        return means


def shared_operators(spreads, cells, pixels, shifts=(0.0, 0.0)):
    """
    Operators of `fifesim.rasters.regularization.operators`, kept for scenes that share them.

    Parameters
    ----------
    spreads, cells, pixels, shifts
        As there, shifts as numbers.

    Returns
    -------
    rows, columns : fifesim.base.footprints.AxisOperator
    """
    # A CRS takes longer to compare than an operator to make, and does not matter to it.
    return _kept_operators(spreads, *(GeoBox(each.shape, each.affine, None) for each in (cells, pixels)), shifts)


_kept_operators = lru_cache(maxsize=256)(operators)
