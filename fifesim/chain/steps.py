"""The steps of Figure 1 that need more than one stage: what a stage needs of another is handed to it here."""

from __future__ import annotations

import xarray as xr

from fifesim.atmosphere import raster as atmosphere_raster
from fifesim.atmosphere.air.models import Atmosphere
from fifesim.base.annotations import Names, Surroundings, Time
from fifesim.chain import landscapes
from fifesim.chain.carried import air_bands_and_geometry, air_of, as_bands_of
from fifesim.chain.images import planetary_reflectance
from fifesim.chain.seen_canopy import seen_through_air
from fifesim.chain.slopes import sunlight
from fifesim.chain.stands import warn_of_tallgrass
from fifesim.ground.canopy.description import TALLGRASS, Canopy
from fifesim.ground.canopy.rasters import soils
from fifesim.ground.canopy.rasters.evaluation import Light
from fifesim.ground.terrain.rasters import lit_slopes
from fifesim.rasters import directions
from fifesim.rasters.annotations import Horizon, RasterOrDataset
from fifesim.rasters.axes import north_up
from fifesim.rasters.dates import by_date
from fifesim.rasters.directions import Directions
from fifesim.rasters.sites import is_fife
from fifesim.rasters.sun import check_same_sun
from fifesim.sensor.description.annotations import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.rasters.carried import attributes_of, given_instrument


@by_date
def surface_reflectance(
    lai: RasterOrDataset,
    instrument: InstrumentLike | None = None,
    *,
    canopy: Canopy | None = None,
    bands: Names | None = None,
    dem: xr.DataArray | None = None,
    horizon: Horizon | None = None,
    upwelling: bool = True,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    exact: bool = False,
) -> xr.DataArray:
    """
    Reflectance factor of the ground in the bands of an instrument.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape with a variable ``lai``, from `landscape`. Its other variables have precedence
        over the canopies of its classes, and these over ``canopy``. [m2 m-2]
    instrument : str or Instrument, optional
        Whose bands are simulated; by default TM for a scene on the FIFE site.
    canopy : Canopy, optional
        Leaves, their arrangement, and the ground below them; by default green tallgrass of the FIFE site.
    bands : sequence of str, optional
        Names of its bands; all by default.
    dem : xarray.DataArray, dims (y, x), optional
        Elevation on the cells of ``lai``, or on more of them, whose horizons then count; without it the ground is
        level. The reflectance is that of level ground times Kt (Eq. 4) and the view's cosine (Eq. 5). [m]
    horizon : xarray.DataArray, dims (direction, y, x), optional
        Of an elevation model that reaches further than ``dem``, from `horizon`. [degree]
    upwelling : bool, optional
        Whether with the view's cosine on slopes, Eq. 5.
    atmosphere : Atmosphere, optional
        Decides the share of skylight; by default midlatitude summer, continental aerosol, 45 km visibility, 0.4 km
        above the sea, which is a warning for a map of one's own. It travels on with the result.
    geometry : Geometry, optional
        Of sun and sensor; by default that of ``lai``, else of the sun at its time and place. A scene that was made on
        the FIFE site has the paper's sun.
    time : str or datetime, optional
        In the place of ``geometry``: when the sun stood over the middle of the grid, below a nadir view.
    exact : bool, optional
        Evaluate SAIL at every cell instead of interpolating a table that is within 1e-6 of it, and all leaves.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        Lazy where ``lai`` is. [1]

    Raises
    ------
    ValueError
        If an argument is out of its range; on lazy data, a negative LAI when it computes. If the dem is not in metres,
        does not cover ``lai``, or lies on other cells. If nothing says which instrument, or where the sun stands.

    Warns
    -----
    UserWarning
        If the atmosphere, or leaves or background of the canopy, are not given for a scene from elsewhere than the FIFE
        site.

    References
    ----------
    [Verhoef1984]_; [VerhoefBach2007]_; [Friedl1995]_, Fig. 1 and Eqs. 4 and 5; [Yang2020]_ for moist soil

    See Also
    --------
    fifesim.ground.canopy.sail_model.sail, fifesim.ground.canopy.layers.two_layers,
    fifesim.ground.canopy.crowns.clumped,
    fifesim.ground.canopy.soil.brightened, fifesim.ground.canopy.soil_water.moistened,
    fifesim.ground.terrain.lit_slopes.slope_reflectance

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> rho.mean(["y", "x"]).round(3).values
    array([0.089, 0.229])
    """
    if dem is None and horizon is not None:
        raise ValueError("a horizon stands around a dem: give dem= too")
    land = landscapes.land_of(lai)
    lai = north_up(land.lai)
    description = given_instrument(instrument, lai)
    geometry = directions.given_geometry(geometry, lai, time)
    atmosphere, lai = air_of(atmosphere, lai), directions.dated(lai, time)
    selected = description.select(bands)
    responses = tuple(band.response for band in selected)
    land, canopy = land._replace(lai=lai), canopy or TALLGRASS
    if not is_fife(lai):
        warn_of_tallgrass(lai.name or "the raster", land.classes, canopy, land.cells)
    canopies = landscapes.canopies_of(land, selected, canopy, exact)
    light = Light(geometry, atmosphere_raster.diffuse_fraction(atmosphere, responses, geometry))
    soil = soils.in_words(canopy.replace(**land.cells))
    provenance = {"atmosphere": atmosphere.text, **soil, **attributes_of(description)}
    level = landscapes.level_reflectance(land, selected, canopies, light, exact=exact, **provenance)
    if dem is None:
        return level
    light = sunlight(dem, atmosphere, responses, geometry, "surface_reflectance on slopes")
    return lit_slopes.terrain_reflectance(level, upwelling=upwelling, horizon=horizon, **light)


@by_date
def to_toa(
    reflectance: RasterOrDataset,
    atmosphere: Atmosphere | None = None,
    *,
    geometry: Directions | None = None,
    time: Time | None = None,
    instrument: InstrumentLike | None = None,
    elevation: xr.DataArray | None = None,
    adjacency: bool = False,
    surroundings: Surroundings | None = None,
) -> xr.DataArray:
    """
    Apparent reflectance at the top of the atmosphere.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x), or xarray.Dataset of bands
        Surface reflectance factor, with band names of an instrument or a coordinate ``wavelength`` [um] along band;
        whole numbers say their scale by ``scale_factor``. [1]
    atmosphere : Atmosphere, optional
        By default that which the array carries, else midlatitude summer, continental aerosol, 45 km visibility, 0.4 km
        above the sea, which is a warning for a raster of one's own.
    geometry : Geometry, optional
        Its angles are numbers or rasters; by default that which the array carries, else of the sun at its time and
        place.
    time : str or datetime, optional
        In the place of ``geometry``: when the sun stood over the middle of the grid, below a nadir view.
    instrument : str or Instrument, optional
        Whose spectral response the bands have; by default that which the array carries. Without one, each band is as
        narrow as the gas tables, 2.5 nm.
    elevation : xarray.DataArray, dims (y, x), optional
        Of the ground, in the place of the atmosphere's one altitude, where relief matters. [m]
    adjacency : bool, optional
        Whether light that the surroundings reflect is scattered into the view of a cell.
    surroundings : number, sequence or xarray.DataArray, optional
        Reflectance around the scene, for adjacency: one number, one for each band, or a raster on a larger grid; by
        default the scene's mean. [1]

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        Lazy where the input is. [1]

    Raises
    ------
    ValueError
        If the array was made for another atmosphere, units, bands or angles are not usable, nothing says where the sun
        stands, or values cannot be a reflectance.

    Notes
    -----
    Without ``elevation`` all of the scene lies at the altitude of the atmosphere: 100 m of relief is 1 % of the
    molecules, .001 of reflectance in the blue and less elsewhere.

    References
    ----------
    [Tanre1990]_

    See Also
    --------
    fifesim.atmosphere.schemes.coupling.apparent_reflectance

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> haze = fifesim.Atmosphere(visibility=10)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"], atmosphere=haze)
    >>> toa = rho.fifesim.to_toa()
    >>> (toa - rho).mean(["y", "x"]).round(3).values
    array([ 0.01, -0.03])
    """
    reflectance = as_bands_of(reflectance, instrument, "surface_reflectance")
    light = air_bands_and_geometry(reflectance, atmosphere, geometry, instrument, time)
    scene = {"elevation": elevation, "adjacency": adjacency, "surroundings": surroundings}
    scene["made"] = seen_through_air(reflectance)
    return _of(instrument, atmosphere_raster.to_toa(directions.dated(reflectance, time), *light, **scene))


@by_date
def to_surface(
    reflectance: RasterOrDataset,
    atmosphere: Atmosphere | None = None,
    *,
    assume: bool = False,
    geometry: Directions | None = None,
    time: Time | None = None,
    instrument: InstrumentLike | None = None,
    elevation: xr.DataArray | None = None,
    adjacency: bool = False,
    surroundings: Surroundings | None = None,
) -> xr.DataArray:
    """
    Surface reflectance from that at the top of the atmosphere; the inverse of `to_toa`.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x), or xarray.Dataset of bands
        Reflectance at the top of the atmosphere; radiance and digital numbers are converted first.
    atmosphere : Atmosphere, optional
        As in `to_toa`; another than that which the array carries is an error, unless it is assumed.
    assume : bool, optional
        Whether to correct for the atmosphere given, whatever air the image was taken through: what a wrong haze costs.
        The result carries the assumed one.
    geometry, time, instrument, elevation, adjacency, surroundings : optional
        As in `to_toa`.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        Negative values are kept. [1]

    Raises
    ------
    ValueError
        As in `to_toa`.

    See Also
    --------
    fifesim.atmosphere.schemes.coupling.corrected_reflectance

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> toa = rho.fifesim.to_toa()
    >>> bool(abs(toa.fifesim.to_surface() - rho).max() < 1e-6)
    True
    """
    reflectance = as_bands_of(planetary_reflectance(reflectance), instrument, "toa_reflectance")
    light = air_bands_and_geometry(reflectance, atmosphere, geometry, instrument, time, assume=assume)
    if not assume:
        check_same_sun(light[-1], reflectance)
    scene = {"elevation": elevation, "adjacency": adjacency, "surroundings": surroundings}
    return _of(instrument, atmosphere_raster.to_surface(directions.dated(reflectance, time), *light, **scene))


def _of(instrument, array):
    """Raster that carries the instrument which was given."""
    if instrument is None:
        return array
    attrs = {key: value for key, value in array.attrs.items() if key != "instrument_description"}
    return array.drop_attrs(deep=False).assign_attrs(attrs | attributes_of(find_instrument(instrument)))
