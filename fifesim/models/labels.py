"""Maps of gross primary production, evapotranspiration and albedo, from leaf area and weather."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from fifesim.atmosphere.engines import light_at_ground
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import Time
from fifesim.base.bands import Band
from fifesim.base.geometry import sun_positions
from fifesim.base.messages import warn
from fifesim.chain.absorbed_light import absorption_of, check_spectra
from fifesim.chain.landscapes import canopies_of, land_of, stands_of, warn_of_tallgrass
from fifesim.chain.steps import air_of
from fifesim.grids import cf, directions, projection
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.dates import by_date
from fifesim.grids.directions import Directions
from fifesim.grids.grid import north_up, with_crs_of
from fifesim.grids.inputs import RasterOrDataset
from fifesim.grids.sites import is_fife
from fifesim.ground.canopy.description import TALLGRASS, Canopy, is_raster
from fifesim.ground.canopy.interpolation import interpolate, tabulate
from fifesim.ground.canopy.labels import checked_scene
from fifesim.ground.canopy.layers import extinction_coefficient, mixed
from fifesim.ground.canopy.leaf_area import LARGEST_OF_MAPS, check_map, check_share
from fifesim.models import evaporation, production
from fifesim.models.daylight import declination, sun_at, suns_of_day
from fifesim.models.production import CARBON
from fifesim.models.radiation import two_stream
from fifesim.models.weather import Weather, check_order, check_weather, weather_over

# Cells at a time, so that intermediate results stay in the cache of the processor: 2 to 5 times as fast as whole
# rasters.
_BLOCK = 2**13

PAR_OF_SHORTWAVE = 0.45
"""Energy of photosynthetically active radiation over that of shortwave radiation [1]; [Running2004]_."""
PHOTONS = 4.57
"""Photons of photosynthetically active radiation of sun and sky per energy [umol J-1]; [McCree1972]_."""


class LandModel(NamedTuple):
    """Function ``f(lai, fpar, weather, sza)`` of arrays, the weather it needs, and its name in the history."""

    function: Callable
    weather: tuple[str, ...]
    words: str
    of_green_leaves: bool = False
    """Whether the leaf area is of green leaves, and FPAR has no effect."""
    of_absorbed_light: bool = False
    """Whether the result is in proportion to FPAR times light, and has no other relation to the sun."""


def photon_flux(weather):
    """Photosynthetically active photon flux, mean over the daylight hours. [umol m-2 s-1]"""
    return PHOTONS * PAR_OF_SHORTWAVE * weather.shortwave


def _light_use(lai, fpar, weather, sza):
    energy = PAR_OF_SHORTWAVE * weather.shortwave * weather.day_length * 3600e-6
    deficit = evaporation.saturation_pressure(weather.temperature)[0] * (1 - weather.humidity)
    return production.light_use_gpp(weather.temperature_min - 273.15, deficit, fpar, energy)


def _photosynthesis(lai, fpar, weather, sza):
    rate = production.canopy_photosynthesis(lai, extinction_coefficient(sza), photon_flux(weather), *LEAF_RESPONSE)
    return rate * weather.day_length * 3600 * CARBON


LEAF_RESPONSE = 0.05, 30.0
"""Quantum yield [mol mol-1] and photosynthesis in full light [umol m-2 s-1] of a grass leaf; assumed."""


def _farquhar(lai, fpar, weather, sza):
    light = photon_flux(weather), weather.diffuse_fraction
    return production.farquhar_canopy(lai, *light, sza, weather.temperature) * weather.day_length * 3600 * CARBON


def _c4(lai, fpar, weather, sza):
    light = photon_flux(weather), weather.diffuse_fraction
    rate = production.c4_canopy(lai, *light, sza, weather.temperature, pressure_pa=weather.pressure)
    return rate * weather.day_length * 3600 * CARBON


def _penman_monteith(lai, fpar, weather, sza):
    found = evaporation.penman_monteith(
        weather.temperature, 100 * weather.humidity, weather.pressure, lai, fpar, weather.net_radiation,
        weather.temperature_min,
    )  # fmt: skip
    return found.le * weather.day_length * 3600 / found.latent_heat


def _pt_jpl(lai, fpar, weather, sza):
    # PT-JPL computes FPAR from NDVI by a line, which is inverted here.
    found = evaporation.pt_jpl(
        weather.temperature, 100 * weather.humidity, weather.pressure, 0.8 * fpar + 0.17, LARGEST_FPAR, lai,
        weather.net_radiation, weather.ground_heat,
    )  # fmt: skip
    return found.le * weather.day_length * 3600 / evaporation.latent_heat(weather.temperature)


LARGEST_FPAR = 0.94
"""Largest FPAR of the year for PT-JPL, that of a closed canopy in [Friedl1995]_. [1]"""

_HEAT = ("temperature", "humidity", "pressure", "net_radiation", "day_length")
LAND_MODELS = {
    "gpp": {
        "light-use": LandModel(
            _light_use,
            ("temperature", "temperature_min", "humidity", "shortwave", "day_length"),
            "MOD17",
            of_absorbed_light=True,
        ),
        "photosynthesis": LandModel(_photosynthesis, ("shortwave", "day_length"), "Monsi and Saeki", True),
        "farquhar": LandModel(
            _farquhar,
            ("temperature", "pressure", "shortwave", "diffuse_fraction", "day_length"),
            "two leaves, C3",
            True,
        ),
    },
    "evapotranspiration": {
        "penman-monteith": LandModel(_penman_monteith, (*_HEAT, "temperature_min"), "Penman-Monteith, canopy"),
        "pt-jpl": LandModel(_pt_jpl, (*_HEAT, "ground_heat"), "PT-JPL"),
    },
}
"""Models by quantity and name; the first is the default. Results are per day, at the means of the weather."""


def of_pathway(model, pathway):
    """Model of leaves with a pathway; only the biochemistry of two leaves depends on it."""
    if model.function is not _farquhar or pathway == "C3":
        return model
    return model._replace(function=_c4, words="two leaves, C4")


_LIT = "shortwave", "net_radiation", "ground_heat"
"""Weather in proportion to the light."""


def evaluated(model, weather, suns, lai, fpar):
    """
    Sum of a model over suns, for arrays of leaf area, FPAR by sun (or none) and weather of numbers or arrays of one
    shape. Without suns (None), the model is evaluated once, at the means of the weather and one FPAR.
    """
    shape, lai = np.shape(lai), np.asarray(lai, float).reshape(-1)
    fpar = [np.asarray(each, float).reshape(-1) for each in fpar]
    if suns is not None and not suns.sza:
        return np.where(np.isnan(lai), np.nan, 0.0).reshape(shape)
    given = {name: np.asarray(getattr(weather, name), float) for name in model.weather}
    out = np.empty(lai.size)
    for start in range(0, out.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        part = {name: each.reshape(-1)[block] if each.ndim else float(each) for name, each in given.items()}
        share = [each[block] for each in fpar]
        if suns is None or model.of_absorbed_light:
            share = share[0] if suns is None else suns.weighted(share)
            out[block] = model.function(lai[block], share, SimpleNamespace(**part), None)
            continue
        out[block] = 0.0
        for number, (sza, weight) in enumerate(zip(suns.sza, suns.weight, strict=True)):
            own = share[number] if share else None
            out[block] += weight * model.function(lai[block], own, _weather_at(suns, number, part), sza)
    return out.reshape(shape)


def kernel_of_leaf_area(model, weather, suns, absorbed=None):
    """Kernel of leaf area alone: the sum of a model over suns, from a table; ``absorbed`` gives FPAR by sun."""

    def of_cells(cells):
        shares = () if absorbed is None or not suns.sza else absorbed(np.minimum(cells, LARGEST_OF_MAPS))
        return evaluated(model, weather, suns, cells, shares)[None]

    # The largest value is that of dense canopies.
    largest = float(of_cells(np.array([20.0]))[0, 0]) or 1.0
    table = tabulate(of_cells, _TABLE_RATE, lambda values: values / largest, _TABLE_TOLERANCE)
    return partial(_of_leaf_area, table)


# A table of a day costs less than one evaluation of a model in each cell of a scene of 100,000 cells. Light saturates
# leaves at one leaf area for each sun, so that the curve is less smooth than its parts in SAIL.
_TABLE_RATE, _TABLE_TOLERANCE = 2.0, 1e-5


def _of_leaf_area(table, lai):
    return interpolate(table, check_map(lai))[0]


def _weather_at(suns, number, weather):
    """Weather at one sun, with the light of the day spread over the time between sunrise and sunset."""
    more = suns.light[number] * weather["day_length"] / suns.hours
    changed = {name: more * weather[name] for name in _LIT if name in weather} | {"day_length": suns.hours}
    if "diffuse_fraction" in weather:
        changed["diffuse_fraction"] = suns.diffuse_fraction(number, weather["diffuse_fraction"])
    return SimpleNamespace(**weather | changed)


def suns_over(grid, geometry, atmosphere, name="the raster", sza=None):
    """Suns of the day over a grid in which the sun takes a position, or the one sun of a zenith angle in this day."""
    latitude = projection.middle(grid)[1]
    day = suns_of_day(atmosphere, latitude, declination(float(geometry.sza), float(geometry.saa), latitude, name))
    return day if sza is None else sun_at(day, atmosphere, sza)


@by_date
def gpp(
    lai: RasterOrDataset,
    weather: Weather | None = None,
    *,
    model: Literal["light-use", "MOD17", "photosynthesis", "farquhar"] = "light-use",
    fpar: xr.DataArray | None = None,
    canopy: Canopy | None = None,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    pathway: Literal["C3", "C4"] | None = None,
) -> xr.DataArray:
    """
    Gross primary production: the sum of a day, or the flux at one time.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape with a variable ``lai``. [m2 m-2]
    weather : Weather, optional
        By default `fife_weather`, a day in June that is assumed, with a warning outside the FIFE site.
    model : {"light-use", "MOD17", "photosynthesis", "farquhar"}, optional
        Light use efficiency of MOD17 (two names), photosynthesis of leaves integrated over the canopy, or the
        biochemistry of sunlit and shaded leaves.
    fpar : xarray.DataArray, dims (y, x), optional
        For "light-use" only; by default the light that green leaves absorb,
        ``fpar(lai, method="energy", leaves="green")`` at each position of the sun.
    canopy : Canopy, optional
        For this FPAR. The other models use only the share of dead leaves, which do not produce.
    atmosphere : Atmosphere, optional
        Determines this FPAR and the course of the light over the day.
    geometry : Geometry, optional
        Position of the sun at any time of the day, whose path follows from it and the latitude; by default from the
        coordinates of ``lai``, else its ``time``, which may be at night, or the day of the paper on the FIFE site.
    time : str or datetime, optional
        Return the flux at this time instead of the sum of the day.
    pathway : {"C3", "C4"}, optional
        Photosynthesis of the leaves, for "farquhar" only. The default is C4 for FIFE's tallgrass, and C3 with a warning
        elsewhere.

    Returns
    -------
    gpp : xarray.DataArray, dims (y, x)
        Mass of carbon, 0 without a sun. Lazy if an input is. [g m-2 d-1], or [g m-2 s-1] with ``time``

    Raises
    ------
    ValueError
        If LAI, FPAR or weather are out of range, if FPAR is given for a model that does not use it, or with a canopy
        or atmosphere, or a pathway for another model than "farquhar".

    Warns
    -----
    UserWarning
        If weather is outside of the range of the formulas; if weather, atmosphere, or the leaves and background that
        determine FPAR, are not given outside the FIFE site; if LAI is part of a landscape, whose other variables are
        left out; if the sun does not rise, or ``day_length`` of the weather differs from its path by more than 1.5 h.

    Notes
    -----
    A day is the sum over 16 Gauss points between sunrise and sunset, within 0.5 % of 144 steps. Radiation follows the
    light under the clear atmosphere, with the daily sums of the weather; temperature and humidity are constant. With
    ``fpar``, one evaluation at the means of the weather is exact.

    References
    ----------
    [Running2004]_; [MonsiSaeki1953]_; [DePury1997]_; [Collatz1992]_

    See Also
    --------
    fifesim.evapotranspiration, fifesim.light, fifesim.models.Weather

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> round(float(lai.fifesim.gpp().mean()), 1)
    4.1
    """
    return _map("gpp", lai, weather, model, fpar, canopy, atmosphere, geometry, time, pathway)


@by_date
def evapotranspiration(
    lai: RasterOrDataset,
    weather: Weather | None = None,
    *,
    model: Literal["penman-monteith", "pt-jpl"] = "penman-monteith",
    fpar: xr.DataArray | None = None,
    canopy: Canopy | None = None,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
) -> xr.DataArray:
    """
    Evapotranspiration: the sum of the daylight hours, or the flux at one time.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape with a variable ``lai``. [m2 m-2]
    weather : Weather, optional
        By default `fife_weather`, a day in June that is assumed, with a warning outside the FIFE site.
    model : {"penman-monteith", "pt-jpl"}, optional
        Transpiration of the canopy as in MOD16, or canopy, soil and intercepted rain after Priestley and Taylor.
    fpar : xarray.DataArray, dims (y, x), optional
        By default ``fpar(lai, method="energy", leaves="green")`` at each position of the sun.
    canopy, atmosphere, geometry, time : optional
        As in `gpp`. The leaf area of the models includes dead leaves.

    Returns
    -------
    evapotranspiration : xarray.DataArray, dims (y, x)
        Mass of water, which equals millimetres. Lazy if an input is. [kg m-2 d-1], or [kg m-2 s-1] with ``time``

    Raises
    ------
    ValueError
        If LAI, FPAR or weather are out of range, or FPAR is given with a canopy or atmosphere.

    Warns
    -----
    UserWarning
        As `gpp`.

    References
    ----------
    [Mu2011]_; [Fisher2008]_

    See Also
    --------
    fifesim.gpp, fifesim.models.albedo, fifesim.models.Weather

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> round(float(lai.fifesim.evapotranspiration().mean()), 1)
    1.2
    """
    return _map("evapotranspiration", lai, weather, model, fpar, canopy, atmosphere, geometry, time)


def _map(quantity, lai, weather, name, fpar, canopy, atmosphere, geometry, time, pathway=None):
    """Labelled result of a model, dims (y, x)."""
    land, model = land_of(lai), LAND_MODELS[quantity]["light-use" if name == "MOD17" else name]
    area = checked_scene(north_up(land.lai))
    weather = weather_over(area.name or "the raster", weather, is_fife(area))
    if model.of_green_leaves and fpar is not None:
        raise ValueError(f"fpar has no effect with model={name!r}, which takes leaf area: leave it out")
    if name != "farquhar" and pathway is not None:
        raise ValueError(f"pathway has no effect with model={name!r}: leave it out, or use model='farquhar'")
    if name == "farquhar" and pathway is None and not is_fife(area):
        warn(f"the photosynthesis of {area.name or 'the raster'} is unknown: using pathway='C3'; give 'C3' or 'C4'")
    model = of_pathway(model, pathway or ("C4" if is_fife(area) else "C3"))
    for what, given in (("canopy", canopy), ("atmosphere", atmosphere)):
        if fpar is not None and given is not None and (what == "canopy" or time is None):
            raise ValueError(f"{what} has no effect with fpar, which it would determine: leave out one of them")
    given = {each: getattr(weather, each) for each in model.weather}
    varying = {
        each: with_crs_of(north_up(value.rename(each)), area) for each, value in given.items() if is_raster(value)
    }
    suns = None if fpar is not None and time is None else _suns(quantity, area, weather, geometry, time, atmosphere)
    shares, absorbed = [], None
    if model.of_green_leaves:
        # Dead leaves do not take part; their shade is neglected.
        area = _green(area, land, canopy or TALLGRASS)
    elif fpar is not None:
        cf.check_units(fpar, "fpar")
        shares = [with_crs_of(north_up(fpar), area)]
    elif suns.sza:
        scene = lai if isinstance(lai, xr.Dataset) else land.lai
        absorption = absorption_of(scene, "green", canopy, atmosphere, suns.sza)
        absorbed = absorption.of_leaf_area
        if absorbed is None or varying:
            layers = absorption.layers(len(suns.sza))
            shares = [layers.isel(band=number).rename("fpar") for number in range(len(suns.sza))]
    rasters = [each.drop_vars(set(each.coords) - {"y", "x", "spatial_ref"}) for each in varying.values()]
    shares = [share.drop_vars(set(share.coords) - {"y", "x", "spatial_ref"}) for share in shares]
    if shares or varying:
        kernel = partial(_kernel, model, given, tuple(varying), suns, len(shares))
    else:
        kernel = kernel_of_leaf_area(model, SimpleNamespace(**given), suns, absorbed)
    out = grids.place(chunking.pointwise(kernel, area, *shares, *rasters), grids.geobox(area))
    words = [f"{quantity}: {model.words}", *([f"{', '.join(varying)} by cell"] if varying else [])]
    if suns is not None:
        at = f"sza {suns.sza[0]:.2f}" if time is not None and suns.sza else f"sum over {suns.hours:.2f} h of sun"
        words.append(at)
    out = cf.label(out, quantity, source=land.lai, history=", ".join(words))
    if time is not None:
        out.attrs["units"] = out.attrs["units"].replace("d-1", "s-1")
    return out


_OTHER_DAY = 1.5  # difference of day lengths that causes a warning [h]


def _suns(quantity, area, weather, geometry, time, atmosphere):
    """Suns of the day of a raster, or of one instant."""
    name, sza, grid = area.name or "the raster", None, grids.geobox(area)
    dates = [] if "time" not in area.coords or "sza" in area.coords else [area.coords["time"]]
    if time is None and geometry is None and dates and dates[0].ndim == 0:
        time = dates[0].values
    else:
        dates = []
    if time is not None:
        if geometry is not None:
            raise ValueError("geometry and time both determine the sun: give one of them")
        # At night, too.
        longitude, latitude = projection.middle(grid)
        (zenith,), (azimuth,) = sun_positions([time], latitude, longitude)[1:3]
        geometry, sza = SimpleNamespace(sza=zenith, saa=azimuth), None if dates else zenith
    else:
        geometry = directions.uniform_geometry(directions.given_geometry(geometry, area), quantity)
    suns = suns_over(grid, geometry, air_of(atmosphere, area), name, sza)
    if suns.sza and not is_raster(weather.day_length) and abs(weather.day_length - suns.hours) > _OTHER_DAY:
        warn(
            f"the weather has day_length {weather.day_length:g} h, but the sun is over {name} for {suns.hours:.1f} h: "
            "its light is spread over the time of sun; give the weather of the day, such as "
            f"weather.replace(day_length={suns.hours:.1f}, shortwave=...)"
        )
    if not suns.sza:
        what = "does not rise on this day" if sza is None else f"is below the horizon, sza {sza:.1f}"
        warn(f"the sun over {name} {what}: {quantity} is 0; give another time")
    return suns


def _kernel(model, given, varying, suns, count, lai, *blocks):
    """Result of a model for a block of cells."""
    shares, blocks = blocks[:count], blocks[count:]
    for name, block in zip(varying, blocks, strict=True):
        check_weather(name, block)
    weather = given | dict(zip(varying, blocks, strict=True))
    check_order(weather)
    for share in shares:
        check_share("fpar", share)
    return evaluated(model, SimpleNamespace(**weather), suns, check_map(lai), shares)


def _green(area, land, canopy):
    """Leaf area of green leaves, dims (y, x). [m2 m-2]"""
    stands = stands_of(land.classes, canopy, land.cells)
    if len({float(each.brown) if not is_raster(each.brown) else id(each.brown) for each in stands.values()}) > 1:
        raise ValueError(
            "classes have different dead shares: use model='light-use', or give brown as a variable of the landscape"
        )
    brown = next(iter(stands.values())).brown
    if not is_raster(brown):
        return area if brown == 0 else area.copy(data=area.data * (1 - brown))
    return area.copy(data=chunking.pointwise(lambda one, other: one * (1 - other), area, brown.rename("brown")).data)


_ALBEDO_EDGES = (0.40, 0.45, 0.50, 0.55, 0.60, 0.65, 0.70, 0.75, 0.85, 1.0, 1.3, 1.75, 2.4)
ALBEDO_BANDS = tuple(Band(f"{low:.2f}-{high:.2f} um", (low, high), (1.0, 1.0)) for low, high in pairwise(_ALBEDO_EDGES))
"""Bands over the solar spectrum for albedo."""


@by_date
def albedo(
    lai: RasterOrDataset,
    *,
    chi: float = 0.0,
    canopy: Canopy | None = None,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
) -> xr.DataArray:
    """
    Albedo of vegetated ground from 0.4 to 2.4 um by the two-stream equations of Sellers.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape without classes. [m2 m-2]
    chi : float, optional
        Departure of the leaf angles from spherical, in [-0.4, 0.6]; the leaf angles of the canopy have no effect. [1]
    canopy : Canopy, optional
        Optics of leaves and ground, and the share of dead leaves; numbers only.
    atmosphere, geometry, time : optional
        Spectrum and direction of the light, as in `light`.

    Returns
    -------
    albedo : xarray.DataArray, dims (y, x)
        Share of the direct and diffuse sunlight at the ground that is reflected. Lazy if an input is. [1]

    Raises
    ------
    ValueError
        If a property other than LAI varies by cell or class, or optics are given by band.

    Warns
    -----
    UserWarning
        As `surface_reflectance`.

    References
    ----------
    [Sellers1985]_

    See Also
    --------
    fifesim.light, fifesim.evapotranspiration

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> round(float(lai.fifesim.albedo().mean()), 2)
    0.15
    """
    land, canopy = land_of(lai), canopy or TALLGRASS
    area = checked_scene(north_up(land.lai))
    given = canopy.replace(**land.cells)
    varying = [name for name in given.given if is_raster(getattr(given, name))] + ["cover"] * (land.cover is not None)
    if varying or given.crown_cover != 1:
        what = ", ".join(varying) if varying else f"crown_cover {given.crown_cover:g}"
        raise ValueError(
            f"albedo is for canopies that differ in leaf area only, got {what}: remove it, or use light() for visible "
            "light"
        )
    check_spectra({None: given})
    geometry = directions.uniform_geometry(directions.given_geometry(geometry, area, time), "albedo")
    if not is_fife(area):
        warn_of_tallgrass(area.name or "the raster", (), canopy, land.cells)
    stand = canopies_of(land._replace(lai=area), ALBEDO_BANDS, canopy)[None]
    shares, sky = light_at_ground(air_of(atmosphere, area), ALBEDO_BANDS, float(geometry.sza), photons=False)
    leaf = stand.leaf if stand.dead is None else mixed(stand.leaf, stand.dead, given.brown)
    optics = [np.reshape(each, (-1, 1)) for each in leaf]

    def of_bands(cells):
        found = two_stream(*optics, chi, float(geometry.sza), cells, np.reshape(stand.background, (-1, 1)))
        seen = found.albedo_beam * (1 - sky[:, None]) + found.albedo_diffuse * sky[:, None]
        return (shares @ seen)[None]

    # Light decays with the extinction of the beam and of diffuse light together.
    table = tabulate(of_bands, 1 + float(extinction_coefficient(float(geometry.sza), "spherical")))
    out = chunking.pointwise(lambda block: interpolate(table, check_map(block))[0], area)
    history = f"albedo: two-stream, chi {chi:g}, sza {float(geometry.sza):.2f}"
    return cf.label(grids.place(out, grids.geobox(area)), "albedo", source=land.lai, history=history)
