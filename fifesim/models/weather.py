"""Weather of a day for the models, and the range of each quantity and argument of a formula."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import wraps
from inspect import signature
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fifesim.base.arguments import check_fields
from fifesim.base.messages import warn
from fifesim.grids.inputs import opened
from fifesim.ground.canopy.description import ByValue, NumberByCell, is_raster
from fifesim.ground.canopy.leaf_area import LARGEST_LAI


class Limits(NamedTuple):
    """Unit and allowed range of a quantity, the remedy if it is exceeded, and the range in which formulas hold."""

    unit: str
    lowest: float
    highest: float
    remedy: str
    valid: tuple[float, float] = (-np.inf, np.inf)


_KELVIN = Limits(
    "K", 150, 350, "degC was given for K: add 273.15",
    # Formula of the saturation pressure over water, WMO No. 8 (2018), annex 4.B.
    (228.15, 333.15),
)  # fmt: skip

WEATHER_LIMITS = {
    "temperature": _KELVIN,
    "temperature_min": _KELVIN,
    "temperature_max": _KELVIN,
    "humidity": Limits("1", 0, 1, "it is a fraction: divide percent by 100", (0, 1)),
    # Highest and lowest places with vegetation.
    "pressure": Limits("Pa", 1e4, 1.2e5, "multiply hPa by 100, kPa by 1000", (5e4, 1.1e5)),
    # Above the solar constant only next to clouds. Overcast days have more than 35 W m-2, no day 35 MJ m-2.
    "shortwave": Limits("W m-2", 0, 2000, "it is the mean over the daylight hours, not MJ m-2 d-1", (35, 1361)),
    "net_radiation": Limits("W m-2", -500, 2000, "it is the mean over the daylight hours", (-200, 1100)),
    "ground_heat": Limits("W m-2", -1000, 1000, "it is the mean over the daylight hours", (-300, 300)),
    "day_length": Limits("h", 0, 24, "it is the time between sunrise and sunset in hours", (2, 24)),
    "diffuse_fraction": Limits("1", 0, 1, "it is a fraction: divide percent by 100", (0, 1)),
}

_FRACTION = Limits("1", 0, 1, "it is a fraction: divide percent by 100")
_CELSIUS = Limits("degC", -123, 70, "K was given for degC: subtract 273.15")
_DAILY = Limits("MJ m-2 d-1", 0, 50, "a mean over the day in W m-2 is multiplied by 0.0864")
_AT_LEAST_0 = Limits("", 0, np.inf, "it is not negative")
FORMULA_LIMITS = {
    **dict.fromkeys(("ta_k", "tmin_k"), _KELVIN),
    **dict.fromkeys(("tmin_c", "tmin", "tmax"), _CELSIUS),
    "rh_percent": Limits("%", 0, 100, "air that holds more water is fog"),
    "pressure_pa": WEATHER_LIMITS["pressure"],
    "vpd_pa": Limits("Pa", 0, 5e4, "it is not negative, and less than the saturation pressure"),
    "ea_kpa": Limits("kPa", 0, 50, "divide Pa by 1000"),
    **dict.fromkeys(("par_mj", "rs_mj"), _DAILY),
    "rn": WEATHER_LIMITS["net_radiation"],
    "g": WEATHER_LIMITS["ground_heat"],
    "ndvi": Limits("1", -1, 1, "it is a normalized difference: divide scaled integers by their scale"),
    "lai": Limits("m2 m-2", 0, LARGEST_LAI, "multiply scaled integers by their scale, set missing values to NaN"),
    **dict.fromkeys(("fpar", "fapar_max", "diffuse_fraction"), _FRACTION),
    **dict.fromkeys(("leaf_reflectance", "leaf_transmittance", "ground"), _FRACTION),
    "chi": Limits("1", -0.4, 0.6, "0 is spherical"),
    "sza": Limits("degree", 0, 90, "the sun is above the horizon"),
    "latitude": Limits("degree", -90, 90, "it is positive in the north"),
    "day_of_year": Limits("1", 1, 366, "it is 1 on the first of January"),
    "elevation": Limits("m", -500, 9000, "multiply km by 1000"),
    "wind_height": Limits("m", 0.1, 1000, "the profile holds above the grass"),
    **dict.fromkeys(("u2", "par", "quantum_yield", "p_max", "vcmax25", "ci_pa", "extinction", "g_max"), _AT_LEAST_0),
}
"""Allowed range of the arguments of formulas, whose names state their unit."""


@dataclass(frozen=True, eq=False)
class Weather(ByValue):
    """
    Weather of a day. Fluxes and temperature are means over the daylight hours.

    Parameters
    ----------
    temperature : float or xarray.DataArray, dims (y, x)
        Air temperature. [K]
    temperature_min, temperature_max : float or xarray.DataArray, dims (y, x)
        Lowest and highest air temperature of the day. [K]
    humidity : float or xarray.DataArray, dims (y, x)
        Relative humidity. [1]
    pressure : float or xarray.DataArray, dims (y, x)
        [Pa]
    shortwave : float or xarray.DataArray, dims (y, x)
        Incoming shortwave radiation. [W m-2]
    net_radiation : float or xarray.DataArray, dims (y, x)
        [W m-2]
    ground_heat : float or xarray.DataArray, dims (y, x), optional
        Heat flux into the ground. [W m-2]
    day_length : float or xarray.DataArray, dims (y, x), optional
        Time between sunrise and sunset. [h]
    diffuse_fraction : float or xarray.DataArray, dims (y, x), optional
        Diffuse fraction of the photosynthetically active radiation. [1]

    Raises
    ------
    ValueError
        If a value is outside of the allowed range, a raster has other units, or the lowest temperature exceeds the
        mean or the mean exceeds the highest.

    Warns
    -----
    UserWarning
        If a value is outside of the range in which the formulas of the models hold.

    Examples
    --------
    >>> from fifesim.models import fife_weather
    >>> fife_weather().replace(humidity=0.4).humidity
    0.4
    >>> fife_weather().replace(temperature=25.0)
    Traceback (most recent call last):
    ...
    ValueError: temperature must be in [150, 350] K, got 25: degC was given for K: add 273.15
    """

    temperature: NumberByCell
    temperature_min: NumberByCell
    temperature_max: NumberByCell
    humidity: NumberByCell
    pressure: NumberByCell
    shortwave: NumberByCell
    net_radiation: NumberByCell
    ground_heat: NumberByCell = 0.0
    day_length: NumberByCell = 12.0
    diffuse_fraction: NumberByCell = 0.2

    def __post_init__(self):
        check_fields(self)
        for each in fields(self):
            value, limits = opened(getattr(self, each.name)), WEATHER_LIMITS[each.name]
            object.__setattr__(self, each.name, value)
            units = str(value.attrs.get("units", limits.unit)) if is_raster(value) else limits.unit
            if units != limits.unit:
                raise ValueError(f"{each.name} has units {units!r}, needs {limits.unit!r}: convert it, then set units")
            # Lazy rasters are checked when they are computed.
            if not is_raster(value) or value.chunks is None:
                check_weather(each.name, value)
        check_order({each.name: getattr(self, each.name) for each in fields(self)})

    def replace(self, **changes: Any) -> Weather:
        """
        Weather with new values of some fields.

        Parameters
        ----------
        **changes
            New values by name.

        Returns
        -------
        weather : Weather
        """
        return Weather(**{each.name: getattr(self, each.name) for each in fields(self)} | changes)


def check_weather(name, values):
    """Raise ValueError for impossible values of a quantity, and warn of values outside the range of formulas."""
    limits = WEATHER_LIMITS[name]
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{name} must be finite, got NaN or infinity: fill gaps of a raster with .fillna(value)")
    for end in _checked_ends(name, values, limits):
        if end < limits.valid[0] or end > limits.valid[1]:
            warn(
                f"{name} is {end:g} {limits.unit}, formulas of the models hold from {limits.valid[0]:g} to "
                f"{limits.valid[1]:g}: the result may be wrong; {limits.remedy}"
            )


def _checked_ends(name, values, limits):
    """Smallest and largest value, NaN where all are missing; ValueError if one is impossible."""
    values = np.atleast_1d(np.asarray(values, float))
    ends = [float(each.reduce(values, axis=None)) for each in (np.fmin, np.fmax)] if values.size else []
    for end in ends:
        if end < limits.lowest or end > limits.highest:
            allowed = f"[{limits.lowest:g}, {limits.highest:g}] {limits.unit}".removesuffix(" 1").rstrip()
            raise ValueError(f"{name} must be in {allowed}, got {end:g}: {limits.remedy}")
    return ends


def in_range(formula):
    """Wrap a formula so that it raises ValueError for arguments outside `FORMULA_LIMITS`; NaN passes."""
    arguments = signature(formula)

    @wraps(formula)
    def checking(*args, **options):
        for name, values in arguments.bind(*args, **options).arguments.items():
            if name in FORMULA_LIMITS:
                _checked_ends(name, values, FORMULA_LIMITS[name])
        return formula(*args, **options)

    return checking


def check_order(weather):
    """Raise ValueError if temperatures by name, as numbers or blocks of cells, are not lowest, mean, highest."""
    names = [name for name in ("temperature_min", "temperature", "temperature_max") if name in weather]
    for low, high in pairwise(name for name in names if not is_raster(weather[name])):
        one, other = np.broadcast_arrays(weather[low], weather[high])
        wrong = one > other
        if wrong.any():
            raise ValueError(
                f"{low} must not exceed {high}, got {one[wrong][0]:g} and {other[wrong][0]:g} K: change one of them"
            )


def weather_over(place, weather=None, is_on_site=False):
    """Given weather, else `fife_weather`, with a warning if the place is not the FIFE site."""
    if weather is not None:
        return weather
    weather = fife_weather()
    if not is_on_site:
        warn(
            f"the weather over {place} is unknown: using an assumed June day of the FIFE site, {weather.temperature:g} "
            f"K, {weather.shortwave:g} W m-2 and {weather.day_length:g} h; give weather=fifesim.models.Weather(...)"
        )
    return weather


def fife_weather() -> Weather:
    """
    Weather of a typical clear June day at the FIFE site. The numbers are assumed, not measured.

    Returns
    -------
    weather : Weather

    Examples
    --------
    >>> from fifesim.models import fife_weather
    >>> fife_weather().temperature
    300.0
    """
    return Weather(
        temperature=300.0,
        temperature_min=289.0,
        temperature_max=304.0,
        humidity=0.5,
        pressure=96500.0,
        shortwave=550.0,
        net_radiation=360.0,
        ground_heat=40.0,
        day_length=14.9,
        diffuse_fraction=0.2,
    )
