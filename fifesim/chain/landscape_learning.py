"""Learning of landscapes from maps of leaf area or NDVI."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Literal

import numpy as np
import xarray as xr

from fifesim.base.files import in_a_line
from fifesim.base.geometry import Geometry
from fifesim.base.messages import warn
from fifesim.chain.steps import ndvi as ndvi_of
from fifesim.chain.steps import surface_reflectance
from fifesim.grids import cf
from fifesim.grids import grid as grids
from fifesim.grids.inputs import FileOrRaster
from fifesim.grids.sites import made_on_site
from fifesim.grids.source import open_source
from fifesim.grids.warp import onto_grid
from fifesim.ground.canopy.description import Canopy
from fifesim.ground.landscape import learning
from fifesim.ground.landscape.learned_labels import Landscape
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument

# Leaf area from which NDVI hardly changes, and the largest that an NDVI is turned into. [m2 m-2]
_SATURATED, _DENSEST = 5.0, 7.0

# Share of saturated cells that gives a warning, and the median of leaf area below which the ground is bare.
_MOST_SATURATED, _BARE = 0.2, 0.1


def learn_landscape(
    image: xr.DataArray,
    dem: FileOrRaster | None = None,
    *,
    quantity: Literal["lai", "ndvi"] | None = None,
    instrument: InstrumentLike | None = None,
    geometry: Geometry | None = None,
    canopy: Canopy | None = None,
    noise: float = 0.0,
    source: str | None = None,
    properties: Mapping[str, Mapping] | None = None,
) -> Landscape:
    """
    Learn a landscape from a map of leaf area or NDVI, and an elevation model.

    Parameters
    ----------
    image : xarray.DataArray, dims (y, x)
        Map of leaf area [m2 m-2] or of the NDVI of the ground [1] on square cells in a projected CRS, NaN for clouds,
        water and everything else that is not the vegetation of interest.
    dem : str, path or xarray.DataArray, optional
        Elevation model in any CRS, interpolated bilinearly to the cells of the map. Give `fine_dem` of a model that is
        coarser than the map. Without it, the landscape is level. [m]
    quantity : {"lai", "ndvi"}, optional
        Quantity of the map; by default its name.
    instrument : str or Instrument, optional
        Instrument of the map, whose blur is removed; required for NDVI. By default, cells are means of the ground.
    geometry : Geometry, optional
        Directions of the sun and the view, required for NDVI.
    canopy : Canopy, optional
        Canopy that turns NDVI into leaf area; by default green tallgrass of the FIFE site.
    noise : float, optional
        Standard deviation of the noise of the map, in its unit.
    source : str, optional
        Source of the map and the elevation, for the description.
    properties : dict of str to dict, optional
        Soil brightness, dead fraction and moisture, which a map of leaf area does not teach, such as
        ``{"moisture": {"mean": 0.25, "sd": 0.08, "leaf_area": 0.2, "forms": {"above_400": -0.5}, "spacings": [120],
        "note": "assumed"}}``: correlation with the residual of leaf area, weights on normal scores of forms of the land
        (`fifesim.ground.terrain.forms.FORMS`), and spacings [m] of own random fields.

    Returns
    -------
    landscape : Landscape

    Raises
    ------
    ValueError
        If the map has fewer than 2,000 known cells, holds digital numbers, is of an unknown quantity, shows bare
        ground, or does not overlap with the elevation; if its CRS is not projected or its cells are not square; or if
        the instrument or the geometry of an NDVI is missing.

    Warns
    -----
    UserWarning
        If NDVI is saturated in more than a fifth of the cells.

    Notes
    -----
    The description has four parts: the distribution of leaf area; the response of its normal scores to forms of the
    land (`fifesim.ground.terrain.forms.land_forms`) by a ridge regression; random fields, isotropic or along contours,
    that fit the variogram and spectrum of the residual; and gusts, random fields that make the residual stronger or
    weaker in places. Blur and noise of the map are applied to trial landscapes before they are compared with it. Lines
    such as roads are not learned as lines.

    See Also
    --------
    fifesim.ground.Landscape, fifesim.ground.compare_landscapes, fifesim.landscape

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.grid_at("EPSG:32614", 707600.0, 4331900.0, 600.0, 600.0, 10.0)
    >>> lai = fifesim.lai_scene(grid, seed=1)
    >>> land = fifesim.learn_landscape(lai).simulate(grid, seed=2)
    >>> abs(float(land["lai"].mean() - lai.mean())) < 0.2
    True
    """
    quantity = _quantity(image, quantity)
    grid = grids.geobox(image)
    grids.check_grid(grid)
    cell, across = grids.cell_size(grid)
    if abs(cell - across) > 1e-3 * cell:
        raise ValueError(f"the cells of the map are {cell:g} x {across:g} m: bring it to square cells first")
    image = grids.north_up(image.transpose("y", "x"))
    values = np.asarray(image.values, float)
    learning.check_enough(np.isfinite(values), "image")
    lai = values if quantity == "lai" else _leaf_area(values, made_on_site(grid), instrument, geometry, canopy)
    median = float(np.nanmedian(lai))
    if median < _BARE:
        raise ValueError(
            f"the median leaf area of the map is {median:.2g} m2 m-2: give a map of a date with leaves, "
            "or mask bare ground"
        )
    ground = None if dem is None else _elevation(dem, grid, np.isfinite(values))
    spread = None if instrument is None else find_instrument(instrument)
    blur = partial(_transfer, None if spread is None else spread.line_spreads(_red(spread)), cell)
    source = source or in_a_line(str(image.name or quantity))
    edge = grid.affine.f, grid.affine.c
    made = learning.learn(lai, values, ground, cell, edge, blur, noise, source)
    return Landscape(**made.model_dump() | {"properties": properties or {}})


def _quantity(image, quantity):
    """Quantity of a map, which is no digital number."""
    if cf.is_counts(image):
        raise ValueError(
            "the map holds digital numbers: give fifesim.ndvi(image) of its surface reflectance, or a map of leaf area"
        )
    if quantity is None:
        found = [name for name in ("ndvi", "lai") if name in str(image.name).lower()]
        if len(found) != 1:
            raise ValueError(f"the quantity of image {image.name!r} is unknown: type quantity='ndvi' or quantity='lai'")
        quantity = found[0]
    low, high = float(image.min()), float(image.max())
    limit = (-1.0, 1.0) if quantity == "ndvi" else (0.0, 20.0)
    if not (limit[0] <= low and high <= limit[1]):
        raise ValueError(
            f"the map spans {low:g} to {high:g}, {quantity} lies in {limit[0]:g} to {limit[1]:g}: apply its scale, and "
            "set missing values to NaN"
        )
    return quantity


def _red(instrument):
    """Band of the instrument that is nearest to the red."""
    return min(instrument.bands, key=lambda band: abs(band.wavelength - 0.66))


def _transfer(spreads, cell, down, across):
    """Modulation transfer of the map; without an instrument, that of the means of cells."""
    if spreads is None:
        return np.sinc(down * cell) * np.sinc(across * cell)
    along, beside = spreads
    return along.mtf(down) * beside.mtf(across)


def _leaf_area(values, site, instrument, geometry, canopy):
    """Leaf area of the NDVI of level ground by the canopy model."""
    missing = [name for name, each in (("instrument", instrument), ("geometry", geometry)) if each is None]
    if missing:
        raise ValueError(
            f"a map of NDVI needs {' and '.join(missing)}: type for instance instrument='MSI', "
            "geometry=fifesim.Geometry(sza=25, saa=140, vza=0, vaa=0)"
        )
    steps = np.linspace(0.0, _DENSEST, 141)
    grid = grids.grid_at("EPSG:32614", 700000.0, 4330000.0, 10.0 * steps.size, 10.0, 10.0)
    ladder = grids.place(xr.DataArray(steps[None], dims=("y", "x"), attrs={"units": "m2 m-2"}, name="lai"), grid)
    ladder = cf.label(ladder, "lai", history="learn_landscape: leaf area of the curve of NDVI", **site)
    curve = ndvi_of(surface_reflectance(ladder, instrument, canopy=canopy or Canopy(), geometry=geometry)).values[0]
    rising = np.maximum.accumulate(curve)
    saturated = np.mean(values[np.isfinite(values)] > np.interp(_SATURATED, steps, rising))
    if saturated > _MOST_SATURATED:
        warn(
            f"NDVI is saturated in {saturated:.0%} of the cells: their leaf area is uncertain; give a map of "
            "leaf area, or another canopy="
        )
    keep = np.r_[True, np.diff(rising) > 0]
    return np.where(np.isfinite(values), np.interp(values, rising[keep], steps[keep]), np.nan)


def _elevation(dem, grid, known):
    """Elevation on the cells of the map, NaN where it is unknown."""
    ground = np.asarray(onto_grid(open_source(dem, "dem"), grid).values, float)
    if (share := np.mean(np.isfinite(ground[known]))) < 0.1:
        raise ValueError(
            f"the elevation covers {share:.0%} of the known cells of the map: give one that overlaps with it"
        )
    return ground
