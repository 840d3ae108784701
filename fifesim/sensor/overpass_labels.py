"""Overpasses of an instrument as labelled dates, and the sampling of AVHRR's global area coverage."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import pandas as pd
import xarray as xr

from fifesim.base import files
from fifesim.base.arguments import Kind, Pair, Range, Time, check_number
from fifesim.base.geometry import check_place
from fifesim.base.times import utc
from fifesim.grids import cf
from fifesim.grids.sites import sun_position
from fifesim.sensor.description.instrument_file import InstrumentLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.response.scan import Orbit, passes

_LOWEST_SUN = 85.0  # zenith angle up to which a pass is by day [degree]
_EPOCH = pd.Timestamp("1970-01-01", tz="UTC")


def overpasses(
    instrument: InstrumentLike,
    start: Time,
    end: Time,
    place: Annotated[Pair, Kind("latitude and longitude, such as (39.06, -96.54)")],
    *,
    phase: float = 0.0,
) -> xr.Dataset:
    """
    Dates on which an instrument sees a place by day, with sun and view.

    Parameters
    ----------
    instrument : str or Instrument
        One of TM, ETM+, OLI, MSI, MODIS and AVHRR, of any satellite.
    start, end : str or datetime
        First and last time.
    place : (float, float)
        Latitude and longitude. [degree]
    phase : float, optional
        Shift of the tracks within the repeat cycle, to match a known overpass. [day]

    Returns
    -------
    dates : xarray.Dataset, dims (time)
        ``sza``, ``saa``, ``vza``, ``vaa`` [degree], ``earth_sun_distance`` and ``ascending``. One date,
        ``dates.isel(time=0)``, has the coordinates of a `Geometry`.

    Raises
    ------
    ValueError
        If the orbit of the instrument is unknown, the end is before the start, the place or the phase is invalid, or
        there is no pass by day.

    Notes
    -----
    Nominal circular orbits of ``data/orbits.csv``, with the equator crossing in mean solar time. Intervals, views and
    times of day are nominal; the dates of real overpasses differ by a constant part of the repeat cycle, the `phase`.

    References
    ----------
    [Capderou2014]_

    Examples
    --------
    Landsat returns to the same track after 16 days:

    >>> import fifesim
    >>> import numpy as np
    >>> dates = fifesim.sensor.overpasses("TM", "1987-06-01T00:00Z", "1987-07-18T00:00Z", (39.06, -96.54))
    >>> (dates.time.diff("time").values / np.timedelta64(1, "D")).tolist()
    [16.0, 16.0]
    """
    description = find_instrument(instrument)
    orbit = _orbit_of(description)
    first, last = utc(start, "start")[0], utc(end, "end")[0]
    if not first < last:
        raise ValueError(f"end must be after start, got {end} and {start}: swap them")
    latitude, longitude = map(float, place)
    check_place(latitude, longitude)
    check_number("latitude", latitude, Range("degree", -85, 85, note="closer to a pole, tracks cross"))
    if not np.isfinite(phase):
        raise ValueError(f"phase must be a finite number of days, got {phase:g}")
    # Phases count from 1970, so that parts of a period have the dates of the whole.
    origin = _EPOCH + pd.Timedelta(days=phase)
    since, until = ((each - origin).total_seconds() for each in (first, last))
    seconds, vza, vaa, ascending = passes(orbit, since, until, latitude, longitude, description.max_angle)
    times = (origin + pd.to_timedelta(seconds, unit="s")).round("s").tz_localize(None)
    by_day = np.zeros(0, int)
    if len(times):
        view = {name: ("time", each, cf.attributes(name)) for name, each in (("vza", vza), ("vaa", vaa))}
        view["ascending"] = ("time", ascending, {"long_name": "whether the satellite flies north"})
        out = sun_position(list(times), latitude, longitude).assign(view)
        by_day = np.flatnonzero(out["sza"].values < _LOWEST_SUN)
    if not by_day.size:
        raise ValueError(
            f"{description.name} has no pass by day over {latitude:g}, {longitude:g} in this period: choose a longer "
            "one"
        )
    out.attrs = {"instrument": description.name, "altitude": description.altitude}
    return out.isel(time=by_day)


def _orbit_of(description):
    """Nominal orbit of an instrument."""
    table = files.table("orbits.csv").set_index("instrument")
    if description.name not in table.index:
        raise ValueError(
            f"the orbit of {description.name} is unknown, known are {', '.join(table.index)}: use one of these, or "
            "make dates with fifesim.sun_position"
        )
    row = table.loc[description.name]
    ascending = row["node"] == "ascending"
    return Orbit(row["orbits"] / row["days"], row["crossing"], ascending, row["inclination"], description.altitude)


def to_gac(swath: Annotated[xr.DataArray, Kind("a swath of AVHRR, from sense_swath", dimensions=0)]) -> xr.DataArray:
    """
    Global area coverage of AVHRR from samples at full resolution: means of four of five samples in every third line.

    Parameters
    ----------
    swath : xarray.DataArray, dims (..., line, sample)
        Radiance or reflectance of a swath, from `sense_swath`.

    Returns
    -------
    swath : xarray.DataArray, dims (..., line, sample)
        NaN where one of the four samples is. 2048 samples become 409.

    Raises
    ------
    ValueError
        If the raster is not a swath, has fewer than 5 samples, or holds digital numbers.

    References
    ----------
    [KLM]_, appendix J

    Examples
    --------
    >>> import fifesim
    >>> import numpy as np
    >>> import xarray as xr
    >>> lines = xr.DataArray(np.arange(40.0).reshape(4, 10), dims=("line", "sample"))
    >>> fifesim.sensor.to_gac(lines).values.tolist()
    [[1.5, 6.5], [31.5, 36.5]]
    """
    if not {"line", "sample"} <= set(swath.dims) or swath.sizes["sample"] < 5:
        raise ValueError(
            f"to_gac needs lines of 5 samples or more of a swath, got {dict(swath.sizes)}: see sense_swath"
        )
    if swath.dtype.kind != "f":
        raise ValueError(
            "to_gac averages radiance or reflectance, got digital numbers: use .fifesim.to_radiance() first"
        )
    groups = swath.sizes["sample"] // 5
    lines = swath.isel(line=slice(None, None, 3), sample=slice(0, 5 * groups))

    def averaged(array):
        return array.coarsen(sample=5).construct(sample=("sample", "of")).isel(of=slice(0, 4)).mean("of", skipna=False)

    bare = lines.drop_vars(list(lines.coords))
    coords = {name: each.variable for name, each in lines.coords.items() if "sample" not in each.dims}
    for name in (name for name in lines.coords if "sample" in lines[name].dims):
        plain = xr.DataArray(lines[name].variable.to_base_variable())
        if name in ("longitude", "vaa"):
            sine, cosine = averaged(np.sin(np.radians(plain))), averaged(np.cos(np.radians(plain)))
            found = np.degrees(np.arctan2(sine, cosine)) % 360
            found = found if name == "vaa" else (found + 180) % 360 - 180
        else:
            found = averaged(plain.astype(float))
        coords[name] = found.variable.copy(deep=False)
        coords[name].attrs = dict(lines[name].attrs)
    out = averaged(bare).assign_coords(coords)
    out.attrs = dict(swath.attrs)
    out.attrs["history"] = "\n".join(
        filter(None, [swath.attrs.get("history", ""), "to_gac: 4 of 5 samples, every third line"])
    )
    return out.rename(swath.name)
