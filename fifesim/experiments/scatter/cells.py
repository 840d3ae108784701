"""Light of the cells of one stand with any of its stages at their ideal, as arrays."""

from dataclasses import dataclass, field, replace

import numpy as np

from fifesim.chain.arrays import ArrayChain
from fifesim.chain.kernels import labelled_only
from fifesim.ground.terrain.rasters.dem import beside_altitude
from fifesim.ground.terrain.rasters.lit_slopes import light_on_slopes

# Half of the step of LAI by which tangents are taken: wide beside the error of the table of reflectance, 1e-6. [1]
STEP = 0.05


@dataclass(frozen=True, eq=False)
class Stand:
    """
    Cells of one stand, on level ground or on slopes.

    Parameters
    ----------
    chain : fifesim.chain.arrays.ArrayChain
        Of the red and the near infrared band, on level ground.
    slopes : tuple or None
        What `light_on_slopes` gives; None on level ground.
    lai, middle : array, shape (y, x)
        Leaf area of cells, and the mean of the pixel that each lies in. [m2 m-2]
    fpar_inf : float
        [1]
    """

    chain: ArrayChain
    slopes: tuple | None
    lai: np.ndarray
    middle: np.ndarray
    fpar_inf: float
    _known: dict = field(default_factory=dict)

    def fpar(self, curve):
        """
        Fraction of light that is absorbed.

        Parameters
        ----------
        curve : bool
            Whether it goes with leaf area as it does, or along its tangent.

        Returns
        -------
        fpar : array, shape (y, x)
            [1]
        """
        return self._of(lambda area: self.chain.kernels.fpar(area, self.fpar_inf), curve)

    def light(self, curve, on_slopes, through_air):
        """
        Reflectance of the cells.

        Parameters
        ----------
        curve, on_slopes, through_air : bool
            Whether non-linearity, topography and atmosphere are at work.

        Returns
        -------
        reflectance : array, shape (band, y, x)
            Of the ground, or at the top of the atmosphere. [1]
        """
        kernels, key = self.chain.kernels, (curve, on_slopes and self.slopes is not None)

        def reflectance(area):
            level = kernels.reflectance(area)
            return kernels.on_slopes(level, self.slopes) if key[1] else level

        # The air changes what is above alone.
        if key not in self._known:
            self._known[key] = self._of(reflectance, curve)
        return kernels.toa(self._known[key]) if through_air else self._known[key]

    def _of(self, function, curve):
        return function(self.lai) if curve else tangent(function, self.lai, self.middle)


def arrays_of(setup, bands, grid):
    """
    What stands on one grid share, where plain arrays do.

    Parameters
    ----------
    setup : fifesim.chain.setup.Setup
        With the elevation, in memory.
    bands : sequence of fifesim.sensor.description.band.InstrumentBand
        Red and near infrared.
    grid : odc.geo.geobox.GeoBox

    Returns
    -------
    chain : fifesim.chain.arrays.ArrayChain or None
        None where more than leaf area varies.
    slopes : tuple or None
    """
    level = replace(setup, dem=None, horizon=None, bands=tuple(band.name for band in bands))
    if labelled_only(level):
        return None, None
    chain = ArrayChain(level, grid)
    if setup.dem is None:
        return chain, None
    dem = beside_altitude(setup.dem, chain.kernels.air.altitude)
    return chain, light_on_slopes(dem, chain.grid, setup.geometry, setup.horizon)


def tangent(function, lai, middle):
    """
    A function of leaf area along its tangent at the middle.

    Parameters
    ----------
    function : callable
        Of leaf area to an array or raster over its cells.
    lai, middle : array or xarray.DataArray, dims (y, x)

    Returns
    -------
    values : array or xarray.DataArray
    """
    low, high = np.maximum(middle - STEP, 0.0), middle + STEP
    at = function(middle)
    along = (function(high) - function(low)) / (high - low) * (lai - middle)
    if isinstance(at, np.ndarray):
        return at + along
    return at.copy(data=at.data + along.data)
