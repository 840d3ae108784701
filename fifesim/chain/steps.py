"""Steps of Figure 1 that need quantities from more than one stage."""

from __future__ import annotations

from operator import attrgetter
from typing import Annotated, Literal, TypeAlias

import numpy as np
import xarray as xr

from fifesim.analysis import index_labels
from fifesim.atmosphere import engines
from fifesim.atmosphere import labels as atmosphere_labels
from fifesim.atmosphere.clouds.labels import Clouds, with_clouds
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import Coupling, Kind, Names, Surroundings, Time, described
from fifesim.base.bands import Band
from fifesim.base.caches import cached
from fifesim.base.messages import warn
from fifesim.base.surface_kernels import RPV, RossLi
from fifesim.chain import coupled_ground, landscapes
from fifesim.chain.landscapes import seen_through_air, warn_of_tallgrass
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date
from fifesim.grids.directions import Directions
from fifesim.grids.grid import north_up
from fifesim.grids.inputs import Horizon, RasterOrDataset, incoming
from fifesim.grids.sites import check_same_angles, is_fife
from fifesim.ground.canopy import labels as canopy_labels
from fifesim.ground.canopy import optics_labels
from fifesim.ground.canopy.description import TALLGRASS, Canopy
from fifesim.ground.canopy.labels import Light
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain.source_labels import beside_altitude
from fifesim.sensor import labels as sensor
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.instrument_labels import (
    attributes_of,
    carried_instrument,
    check_wavelengths,
    given_instrument,
    is_radiance,
    matching_bands,
    warn_of_others,
)

# Half width of the triangular response of a band known only by its wavelength, equal to the step of the gas tables.
# [um]
_NARROW = 0.0025


# Ground below an atmosphere.
GROUND = Kind(
    "an xarray.DataArray, an xarray.Dataset, a fifesim.ground.RossLi or a fifesim.ground.RPV",
    lambda value: isinstance(value, xr.DataArray | xr.Dataset | RossLi | RPV),
    dimensions=2,
)
# Ground whose directional shape is known.
KNOWN_SHAPE = Kind(
    "a fifesim.ground.RossLi, a fifesim.ground.RPV or a fifesim.Canopy",
    lambda value: isinstance(value, RossLi | RPV | Canopy),
    dimensions=2,
)
# Streams of a surface reflectance.
Streams: TypeAlias = Annotated[
    bool | Literal["directional"],
    Kind("True, False or 'directional'", lambda value: isinstance(value, bool) or str(value) == "directional"),
]

_default_atmosphere = cached(1, "default atmosphere")(Atmosphere)
_carried_atmosphere = cached(64, "atmospheres of rasters")(Atmosphere.parse)


def air_of(atmosphere, array, assume=False):
    """Atmosphere as given; by default from the array, else midlatitude summer with continental aerosol."""
    # Warns of the default unless fifesim made the raster on the FIFE site.
    if atmosphere is not None and not isinstance(atmosphere, Atmosphere):
        raise TypeError(f"atmosphere must be a fifesim.Atmosphere, got {described(atmosphere)}: see fifesim.Atmosphere")
    carried = array.attrs.get("atmosphere")
    if assume:
        if atmosphere is None:
            raise ValueError("assume=True needs the atmosphere to assume: give it too, such as fifesim.Atmosphere(...)")
        return atmosphere
    if carried is not None:
        carried = _carried_atmosphere(carried)
        if atmosphere is not None and atmosphere != carried:
            raise ValueError(
                f"the reflectance was made for another atmosphere ({carried.text}) than the one given "
                f"({atmosphere.text}): give it to surface_reflectance(atmosphere=...); or, to correct with a wrong "
                "atmosphere on purpose, use to_surface(..., assume=True)"
            )
    if atmosphere is None and carried is None and not is_fife(array):
        warn(
            f"the atmosphere over {array.name or 'the raster'} is unknown: using {_default_atmosphere().text}; "
            "give atmosphere=fifesim.Atmosphere(...), with the ground elevation in km"
        )
    return atmosphere or carried or _default_atmosphere()


def air_bands_and_geometry(array, atmosphere, geometry, instrument, time=None, *, assume=False):
    """Atmosphere, spectral responses and geometry as given; by default from the array."""
    geometry = directions.given_geometry(geometry, array, time)
    return air_of(atmosphere, array, assume), _responses(array, instrument), geometry


def as_bands_of(raster, instrument, name):
    """Reflectance with bands named after an instrument, dims ([band], y, x)."""
    _check_is_image(raster, name)
    array = incoming(raster, name)
    description = carried_instrument(array) if instrument is None else find_instrument(instrument)
    if description is None or "band" not in array.coords:
        return array
    other = array.attrs.get("instrument") not in (None, description.name)
    if "wavelength" in array.coords and not other:
        return array
    bands = matching_bands(array, description)
    warn_of_others(array, description, bands)
    names, centres = [band.name for band in bands], [band.wavelength for band in bands]
    along_band = cf.band_coordinates(band=names, wavelength=centres)
    return array.assign_coords({key: each if array["band"].ndim else each[0] for key, each in along_band.items()})


def _check_is_image(raster, wanted):
    """Raise ValueError for leaf area and other quantities that are no light; reflectance of both levels passes."""
    if isinstance(raster, xr.DataArray):
        cf.check_quantity(raster, wanted, "surface_reflectance", "toa_reflectance", "toa_radiance", "dn")


def _responses(array, instrument):
    """Spectral responses of the given instrument, or of the instrument of the raster if the wavelengths agree."""
    description = carried_instrument(array) if instrument is None else find_instrument(instrument)
    if description is not None:
        bands = matching_bands(array, description)
        centres = [band.wavelength for band in bands]
        if (
            instrument is None
            and "wavelength" in array.coords
            and not np.allclose(array.coords.variables["wavelength"].values, centres, 1e-6)
        ):
            raise ValueError(
                f"the raster names {description.name} as its instrument, but its wavelengths differ: give instrument="
            )
        return tuple(band.response for band in bands)
    if "wavelength" not in array.coords:
        raise ValueError(
            "the raster has no instrument and no wavelength: give instrument=, or assign a coordinate "
            "'wavelength' [um] along band"
        )
    centres = np.atleast_1d(array["wavelength"].values).astype(float)
    return tuple(Band(f"{at:g} um", (at - _NARROW, at, at + _NARROW), (0.0, 1.0, 0.0)) for at in centres)


@by_date
def ndvi(image: RasterOrDataset) -> xr.DataArray:
    """
    Normalized difference vegetation index of planetary reflectance, as in the paper (Results).

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Digital numbers, radiance or reflectance, with a coordinate ``wavelength`` [um] along band.

    Returns
    -------
    ndvi : xarray.DataArray, dims (y, x)
        NaN for no data. [1]

    Raises
    ------
    ValueError
        If there is no red or no near infrared band, or no calibration.

    See Also
    --------
    fifesim.index, fifesim.sensor.noise_std

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> image = rho.fifesim.to_toa().fifesim.sense("TM")
    >>> ndvi = image.fifesim.ndvi()
    >>> round(float(ndvi.mean()), 2)
    0.37
    """
    return _index(image, "NDVI")


@by_date
def index(
    image: xr.DataArray,
    name: Annotated[
        Literal["NDVI", "EVI", "EVI2", "SAVI", "MSAVI", "NDWI", "NDMI", "NIRv"],
        Kind("the name of an index, such as 'NDVI'"),
    ],
) -> xr.DataArray:
    """
    Spectral index of an image.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        Surface or planetary reflectance with a coordinate ``wavelength`` [um] along band. Digital numbers and radiance
        are first converted to planetary reflectance.
    name : {"NDVI", "EVI", "EVI2", "SAVI", "MSAVI", "NDWI", "NDMI", "NIRv"}
        Defined as in spyndex. NDWI indicates open water (green and near infrared), NDMI leaf water (near and shortwave
        infrared). EVI is defined for surface reflectance: use it after `to_surface`.

    Returns
    -------
    index : xarray.DataArray, dims (y, x)
        NaN for no data. [1]

    Raises
    ------
    ValueError
        If the index is unknown, or the image lacks a band or its calibration.

    References
    ----------
    [Rouse1974]_; [Huete1988]_; [Qi1994]_; [McFeeters1996]_; [Gao1996]_; [Huete2002]_; [Jiang2008]_; [Badgley2017]_

    See Also
    --------
    fifesim.ndvi, fifesim.regress

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM1", "TM3", "TM4"])
    >>> round(float(rho.fifesim.index("EVI").mean()), 2)
    0.27
    """
    return _index(image, name)


def _index(image, name):
    """Spectral index of an image, without labelling the intermediate reflectance."""
    if not _is_recorded(image):
        return index_labels.reflectance_index(planetary_reflectance(image), name)
    reflectance, history = sensor.planetary(image)
    check_wavelengths(reflectance)
    found = index_labels.reflectance_index(reflectance, name, source=image, history=history)
    found.attrs |= reflectance.attrs
    return found


def _is_recorded(image):
    """Whether an image holds digital numbers or radiance."""
    return cf.is_counts(image) or is_radiance(image)


def planetary_reflectance(image):
    """Reflectance of an image, converted from digital numbers or radiance, dims (band, y, x). [1]"""
    _check_is_image(image, "toa_reflectance")
    reflectance = sensor.to_reflectance(image) if _is_recorded(image) else incoming(image, "toa_reflectance")
    check_wavelengths(reflectance)
    return reflectance


@by_date
def kt(
    reflectance: xr.DataArray,
    dem: xr.DataArray,
    *,
    horizon: Horizon | None = None,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    instrument: InstrumentLike | None = None,
) -> xr.DataArray:
    """
    Topographic correction factor Kt: the effect of terrain on the irradiance in each band.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x)
        Reflectance of level ground, from `surface_reflectance` without a dem. [1]
    dem : xarray.DataArray, dims (y, x)
        Elevation, as in `surface_reflectance`. [m]
    horizon : xarray.DataArray, dims (direction, y, x), optional
        Horizon, as in `surface_reflectance`. [degree]
    atmosphere, geometry, time, instrument : optional
        As in `to_toa`.

    Returns
    -------
    kt : xarray.DataArray, dims (band, y, x)
        Lazy if an input is. [1]

    Raises
    ------
    ValueError
        As in `surface_reflectance`.

    References
    ----------
    [Friedl1995]_, Eq. 4; [Dubayah1992]_

    See Also
    --------
    fifesim.terrain.slope, fifesim.terrain.illumination, fifesim.scaling.topographic_correction

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem = fifesim.flint_hills(grid, seed=7)
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM4"])
    >>> kt = rho.fifesim.kt(dem)
    >>> kt.dims, bool(abs(kt.mean() - 1) < 0.1)
    (('band', 'y', 'x'), True)
    """
    reflectance = as_bands_of(reflectance, instrument, "surface_reflectance")
    air = air_bands_and_geometry(reflectance, atmosphere, geometry, instrument, time)
    return terrain_labels.kt_on_slopes(directions.dated(reflectance, time), sunlight(dem, horizon, *air, "kt"))  # type: ignore[call-arg]


def kt_and_reflectance(level, dem, horizon=None, upwelling=True):
    """Kt and the reflectance on slopes from the reflectance of level ground, in one pass, dims (band, y, x). [1]"""
    air = air_bands_and_geometry(level, None, None, None)
    light = sunlight(dem, horizon, *air, "surface_reflectance on slopes")
    return terrain_labels.slope_kt_and_reflectance(level, light, upwelling)


def sunlight(dem, horizon, atmosphere, bands, geometry, purpose):
    """Sunlight on an elevation model. Sun and sensor must have one direction; `purpose` is for the error message."""
    geometry = directions.uniform_geometry(geometry, purpose)
    terms = engines.band_terms(atmosphere, bands, geometry.sza, geometry.vza, geometry.raa)
    dem = beside_altitude(dem, atmosphere.altitude)
    return terrain_labels.Sunlight(dem, geometry, terms.direct_transmittance_down, terms.transmittance_down, horizon)


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
    slopes: Literal["kt", "upright"] = "kt",
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    exact: bool = False,
    streams: Streams = False,
) -> xr.DataArray:
    """
    Reflectance factor of the ground in the bands of an instrument.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape with a variable ``lai``, from `landscape`. Its other variables take precedence
        over the canopies of its classes, which take precedence over ``canopy``. [m2 m-2]
    instrument : str or Instrument, optional
        Instrument whose bands are simulated; by default TM for a scene on the FIFE site.
    canopy : Canopy, optional
        Leaves, canopy structure and background; by default green tallgrass of the FIFE site.
    bands : sequence of str, optional
        Band names; all by default.
    dem : xarray.DataArray, dims (y, x), optional
        Elevation on the cells of ``lai``, or on a larger area, which then contributes to horizons. The reflectance of
        level ground is multiplied by Kt (Eq. 4) and the cosine of the view angle (Eq. 5). By default the ground is
        level. [m]
    horizon : xarray.DataArray, dims (direction, y, x), optional
        Horizon of a larger elevation model, from `horizon`. [degree]
    upwelling : bool, optional
        Whether to apply the cosine of the view angle on slopes, Eq. 5.
    slopes : {"kt", "upright"}, optional
        Model of slopes: reflectance of level ground times Kt, as in the paper, or SAIL on each slope with upright
        plants and the sum of the light between slopes, without Eq. 5, where cells of a class differ in leaf area only.
    atmosphere : Atmosphere, optional
        Determines the diffuse fraction; saved with the result. The default is midlatitude summer, continental aerosol,
        45 km visibility and 0.4 km altitude, with a warning for rasters from other sources.
    geometry : Geometry, optional
        Directions of sun and sensor; by default from the coordinates of ``lai``, else from its time and place. A scene
        on the FIFE site has the sun of the paper.
    time : str or datetime, optional
        Time for the position of the sun at the grid centre, with a nadir view; instead of ``geometry``.
    exact : bool, optional
        Evaluate leaf optics and SAIL at every cell, instead of interpolating a table that is accurate to 1e-6.
    streams : bool or "directional", optional
        Return separate reflectances for `to_toa`: True from the sun s and an isotropic sky d to the
        observer o and into all directions d (``so``, ``do``, ``sd``, ``dd``); "directional" for the sky of this
        atmosphere, >, and for the light that it returns, a (``so``, ``>o``, ``ao``, ``s>``, ``>>``, ``a>``, ``sa``,
        ``>a``, ``aa``). On slopes, all are scaled as the reflectance factor.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x), or (stream, band, y, x) with ``streams``
        Lazy if ``lai`` is. [1]

    Raises
    ------
    ValueError
        If an argument is out of range (a negative LAI in lazy data raises when computed); if the dem is not in metres,
        does not cover ``lai``, or has other cells; if the instrument or the position of the sun is unknown.

    Warns
    -----
    UserWarning
        If the atmosphere, leaves or background are not given for a scene outside the FIFE site, or if LAI is part of a
        landscape, whose other variables are left out.

    References
    ----------
    [Verhoef1984]_; [VerhoefBach2007]_; [Friedl1995]_, Fig. 1 and Eqs. 4 and 5; [Yang2020]_ for moist soil

    See Also
    --------
    fifesim.Canopy, fifesim.fpar, fifesim.to_toa, fifesim.ground.canopy_spectra

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"])
    >>> rho.mean(["y", "x"]).round(3).values
    array([0.089, 0.229])
    """
    if dem is None and (horizon is not None or slopes != "kt"):
        what = "a horizon" if horizon is not None else f"slopes={slopes!r}"
        raise ValueError(f"{what} needs an elevation: give dem= too")
    land = landscapes.land_of(lai)
    lai = north_up(land.lai)
    description = given_instrument(instrument, lai)
    geometry = directions.given_geometry(geometry, lai, time)
    atmosphere = air_of(atmosphere, lai)
    if time is not None:
        lai = directions.dated(lai, time)
    selected = description.select(bands)
    responses = tuple(map(attrgetter("response"), selected))
    land, canopy = land._replace(lai=lai), canopy or TALLGRASS
    if not is_fife(lai):
        warn_of_tallgrass(lai.name or "the raster", land.classes, canopy, land.cells)
    canopies = landscapes.canopies_of(land, responses, canopy, exact)
    light = Light(geometry, atmosphere_labels.diffuse_fraction(atmosphere, responses, geometry))
    soil = optics_labels.background_attributes(canopy.replace(**land.cells) if land.cells else canopy)
    provenance = {"atmosphere": atmosphere.text, **soil, **attributes_of(description)}
    if land.cover is None:
        level = canopy_labels.level_reflectance(lai, selected, canopies[None], light, exact, provenance)
    else:
        level = canopy_labels.reflectance_of_classes(lai, land.cover, selected, canopies, light, exact, provenance)
    reflectance = level
    if dem is not None:
        sun = sunlight(dem, horizon, atmosphere, responses, geometry, "surface_reflectance on slopes")
        if slopes == "upright":
            reflectance = landscapes.upright_plants(level, land, canopies, light, sun)
        else:
            reflectance = terrain_labels.terrain_reflectance(level, sun, upwelling)
    if not streams:
        return reflectance
    directions.uniform_geometry(geometry, "streams")
    skies = coupled_ground.skies_of(atmosphere, responses, geometry) if streams == "directional" else None
    found = coupled_ground.reflectance_streams(land, selected, canopies, light, skies, level)
    return found if dem is None else coupled_ground.scaled_to_slopes(found, level, reflectance)


@by_date
def to_toa(
    reflectance: Annotated[xr.DataArray | xr.Dataset | RossLi | RPV, GROUND],
    atmosphere: Atmosphere | None = None,
    *,
    geometry: Directions | None = None,
    time: Time | None = None,
    instrument: InstrumentLike | None = None,
    elevation: xr.DataArray | None = None,
    adjacency: bool = False,
    surroundings: Surroundings | None = None,
    clouds: Clouds | None = None,
    coupling: Coupling | None = None,
) -> xr.DataArray:
    """
    Apparent reflectance at the top of the atmosphere.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x), xarray.Dataset of bands, RossLi or RPV
        Surface reflectance factor, with band names of an instrument or a coordinate ``wavelength`` [um] along band.
        Integers need an attribute ``scale_factor``. Streams of `surface_reflectance` have a dimension ``stream``. A
        RossLi or RPV needs ``instrument`` and, unless its rasters carry angles, ``geometry``. [1]
    atmosphere : Atmosphere, optional
        By default from the array. If it has none: midlatitude summer, continental aerosol, 45 km visibility and 0.4 km
        altitude, with a warning for rasters from other sources.
    geometry : Geometry, optional
        Directions of sun and sensor as numbers or rasters; by default from the coordinates of the array, else from its
        time and place.
    time : str or datetime, optional
        Time for the position of the sun at the grid centre, with a nadir view; instead of ``geometry``.
    instrument : str or Instrument, optional
        Instrument with the spectral response of the bands; by default from the array. If it is unknown, each band has
        the resolution of the gas tables, 2.5 nm.
    elevation : xarray.DataArray, dims (y, x), optional
        Ground elevation by cell, instead of the altitude of the atmosphere. [m]
    adjacency : bool, optional
        Whether to include light reflected by the surroundings and scattered into the line of sight.
    surroundings : number, sequence or xarray.DataArray, optional
        Reflectance around the scene for `adjacency`: a number, one number per band, or a raster on a larger grid; by
        default the scene mean. [1]
    clouds : xarray.Dataset, dims (y, x), optional
        Clouds from `cast_clouds`, or from `cloud_field`, which are then cast onto the level ground or ``elevation``.
        They need one direction of sun and sensor.
    coupling : {"lambert", "four-stream", "directional"}, optional
        Light between ground and atmosphere: with the directions of the sky ("directional"), with an isotropic sky,
        which is often worse than one reflectance factor ("four-stream"), or with one reflectance factor ("lambert").
        The default is "lambert" for a reflectance, and "directional" for streams of this coupling, RossLi and RPV.
        Without streams, "directional" needs a lazy reflectance of a level scene whose cells differ in leaf area only,
        and no `adjacency`. Surroundings exchange light with the atmosphere by their mean streams.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x), or (band) for RossLi and RPV of numbers
        Lazy if the input is. [1]

    Raises
    ------
    ValueError
        If the array was made for another atmosphere, streams were made for other zenith angles, units, bands or
        angles are invalid, the position of the sun is unknown, or values are outside the range of reflectance.

    Notes
    -----
    Without ``elevation`` the whole scene is at the altitude of the atmosphere; 100 m change the reflectance by 0.001 in
    the blue.

    Clouds lie above the atmosphere except for its ozone; shadows keep the skylight.

    References
    ----------
    [Tanre1990]_

    See Also
    --------
    fifesim.to_surface, fifesim.cloud_field, fifesim.atmosphere.cast_clouds

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
    if isinstance(reflectance, RossLi | RPV):
        given = {"elevation": elevation, "surroundings": surroundings, "clouds": clouds, "time": time}
        given |= {"adjacency": True} if adjacency else {}
        options = {name: each for name, each in given.items() if each is not None}
        return _toa_of_surface(reflectance, coupling or "directional", atmosphere, geometry, instrument, options)
    streams = isinstance(reflectance, xr.DataArray) and "stream" in reflectance.dims
    by_direction = streams or coupling in coupled_ground.STREAMS_OF
    if by_direction and elevation is not None:
        raise ValueError("elevation needs coupling='lambert' and one reflectance factor: leave it out")
    if not streams and by_direction and adjacency:
        raise ValueError(
            f"adjacency with coupling={coupling!r} needs streams: give surface_reflectance(..., streams='directional')"
        )
    if not streams and "stream" in reflectance.coords:
        raise ValueError(
            f"the raster is the stream {reflectance['stream'].item()!r} of a reflectance: give all streams, or take it "
            "as the factor of Lambertian ground with .drop_vars('stream')"
        )
    if not streams:
        reflectance = as_bands_of(reflectance, instrument, "surface_reflectance")
    air = air_bands_and_geometry(reflectance, atmosphere, geometry, instrument, time)
    around = {"adjacency": adjacency, "surroundings": surroundings}
    if streams:
        toa = coupled_ground.toa_of_streams(reflectance, coupling, *air, **around)
    else:
        made = seen_through_air(reflectance, coupling or "lambert", *air)
        toa = atmosphere_labels.toa_from_surface(
            directions.dated(reflectance, time), *air, elevation=elevation, **around, made=made
        )
        if by_direction:
            toa.attrs["history"] += f", {coupling} coupling"
    # After the checks of the engine.
    check_same_angles(air[-1], reflectance, "sza", "vza")
    if clouds is not None:
        toa = with_clouds(toa, clouds, *air, elevation=elevation)
    return _of(instrument, toa)


def _toa_of_surface(surface, coupling, atmosphere, geometry, instrument, options):
    """Apparent reflectance of a RossLi or RPV in the bands of an instrument, dims (band) or (band, y, x). [1]"""
    kind, rasters = type(surface).__name__, coupled_ground.rasters_of(surface)
    if instrument is None:
        raise ValueError(f"a {kind} has no instrument: give instrument=")
    if rasters:
        geometry = directions.given_geometry(geometry, rasters[0], options.pop("time", None))
    elif options:
        raise ValueError(f"{', '.join(options)} needs rasters, got numbers in {surface!r}: leave it out")
    if geometry is None:
        raise ValueError(f"a {kind} has no geometry: give geometry=")
    geometry = directions.uniform_geometry(directions.checked_geometry(geometry), "to_toa of a surface")
    names = [each["band"].values.tolist() for each in rasters if "band" in each.dims and "band" in each.coords]
    selected = find_instrument(instrument).select(names[0] if names else None)
    if rasters:
        atmosphere = air_of(atmosphere, rasters[0])
        ground = coupled_ground.surface_raster(surface, coupling, atmosphere, selected, geometry)
        return to_toa(ground, instrument=instrument, coupling=coupling, **options)
    atmosphere = atmosphere or _default_atmosphere()
    values = coupled_ground.toa_of_surface(
        surface, coupling, atmosphere, [each.response for each in selected], geometry
    )
    along = {"band": [each.name for each in selected], "wavelength": [each.wavelength for each in selected]}
    out = xr.DataArray(values, dims="band", coords=cf.band_coordinates(**along) | directions.coordinates_of(geometry))
    history = f"to_toa: {kind}, {coupling} coupling, {atmosphere.text}"
    return cf.label(out, "toa_reflectance", history=history, atmosphere=atmosphere.text)


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
    like: Annotated[RossLi | RPV | Canopy, KNOWN_SHAPE] | None = None,
) -> xr.DataArray:
    """
    Surface reflectance from reflectance at the top of the atmosphere; the inverse of `to_toa`.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x), or xarray.Dataset of bands
        Reflectance at the top of the atmosphere; radiance and digital numbers are converted first.
    atmosphere : Atmosphere, optional
        As in `to_toa`. It must equal the atmosphere of the array unless `assume` is True.
    assume : bool, optional
        Correct with the given atmosphere even if the image was simulated with a different one, to study the effect of a
        wrong aerosol load. The given atmosphere is saved with the result.
    geometry, time, instrument, elevation, adjacency, surroundings : optional
        As in `to_toa`.
    like : RossLi, RPV or Canopy, optional
        Directional shape of the ground. The result is the reflectance factor, under sun and sky, of this surface times
        the factor that the image requires in each band. A canopy of numbers has the leaf area that fits all bands of a
        cell best. By default the ground is Lambertian.

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
    fifesim.to_toa, fifesim.Atmosphere

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
    air = air_bands_and_geometry(reflectance, atmosphere, geometry, instrument, time, assume=assume)
    if not assume:
        check_same_angles(air[-1], reflectance, "sza")
    if like is not None:
        if elevation is not None or adjacency or surroundings is not None:
            raise ValueError(
                "like= needs one altitude and no adjacency: leave out elevation, adjacency and surroundings"
            )
        check_same_angles(air[-1], reflectance, "sza", "vza")
        reflectance = directions.dated(reflectance, time)
        if not isinstance(like, Canopy):
            return _of(instrument, coupled_ground.surface_like(reflectance, like, *air))
        return _of(instrument, coupled_ground.surface_like_canopy(reflectance, _even_canopy(like, *air), *air))
    surface = atmosphere_labels.surface_from_toa(
        directions.dated(reflectance, time), *air,
        elevation=elevation, adjacency=adjacency, surroundings=surroundings,
    )  # fmt: skip
    return _of(instrument, surface)


def _even_canopy(canopy, atmosphere, bands, geometry):
    """EvenCanopy of a description of numbers, without leaf area."""
    geometry = directions.uniform_geometry(geometry, "to_surface(like=)")
    light = Light(geometry, atmosphere_labels.diffuse_fraction(atmosphere, bands, geometry))
    stand = landscapes.canopies_of(landscapes.Land(None), bands, canopy)[None]
    even = canopy_labels.even_canopy(None, stand, light, False)
    if even is None or even.scene.model != "sail":
        raise ValueError(
            "like= takes a Canopy of numbers, without dead leaves and crowns, by SAIL: leave out rasters, brown, "
            "crown_cover and model"
        )
    return even


def _of(instrument, array):
    """Raster with the attributes of the given instrument."""
    if instrument is None:
        return array
    attrs = {key: value for key, value in array.attrs.items() if key != "instrument_description"}
    out = grids.with_values(array, array.data)
    out.attrs = attrs | attributes_of(find_instrument(instrument))
    return out
