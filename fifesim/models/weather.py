"""Weather of a day for the models, with the range of each quantity."""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fifesim.base.arguments import check_fields
from fifesim.base.messages import warn
from fifesim.ground.canopy.description import NumberByCell, is_raster


class Limits(NamedTuple):
    """Unit and allowed range of a quantity, the remedy if it is exceeded, and the range in which formulas hold."""

    unit: str
    lowest: float
    highest: float
    remedy: str
    valid: tuple[float, float]


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
    # Above the solar constant only next to clouds.
    "shortwave": Limits("W m-2", 0, 2000, "it is the mean over the daylight hours", (0, 1361)),
    "net_radiation": Limits("W m-2", -500, 2000, "it is the mean over the daylight hours", (-200, 1100)),
    "ground_heat": Limits("W m-2", -1000, 1000, "it is the mean over the daylight hours", (-300, 300)),
    "day_length": Limits("h", 0, 24, "it is the time between sunrise and sunset in hours", (0, 24)),
    "diffuse_fraction": Limits("1", 0, 1, "it is a fraction: divide percent by 100", (0, 1)),
}


@dataclass(frozen=True, eq=False)
class Weather:
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
    >>> from fifesim import fife_weather
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
            value, limits = getattr(self, each.name), WEATHER_LIMITS[each.name]
            if not is_raster(value):
                check_weather(each.name, value)
                continue
            units = str(value.attrs.get("units", limits.unit))
            if units != limits.unit:
                raise ValueError(f"{each.name} has units {units!r}, needs {limits.unit!r}: convert it, then set units")
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
    limits, values = WEATHER_LIMITS[name], np.asarray(values, float)
    if not values.size or np.isnan(values).all():
        return
    ends = float(np.nanmin(values)), float(np.nanmax(values))
    for end in ends:
        if not limits.lowest <= end <= limits.highest:
            allowed = f"[{limits.lowest:g}, {limits.highest:g}] {limits.unit}".removesuffix(" 1")
            raise ValueError(f"{name} must be in {allowed}, got {end:g}: {limits.remedy}")
        if not limits.valid[0] <= end <= limits.valid[1]:
            warn(
                f"{name} is {end:g} {limits.unit}, formulas of the models hold from {limits.valid[0]:g} to "
                f"{limits.valid[1]:g}: the result may be wrong"
            )


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


def fife_weather() -> Weather:
    """
    Weather of a typical clear June day at the FIFE site. The numbers are assumed, not measured.

    Returns
    -------
    weather : Weather

    Examples
    --------
    >>> from fifesim import fife_weather
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
