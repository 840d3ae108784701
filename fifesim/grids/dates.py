"""Rasters over time: steps for one date, applied to each date separately."""

from collections.abc import Callable
from functools import wraps
from hashlib import blake2b
from inspect import signature
from typing import ParamSpec, TypeVar

import numpy as np
import xarray as xr

from fifesim.base.arguments import parts_of, with_parts

P = ParamSpec("P")
R = TypeVar("R")


def by_date(step: Callable[P, R]) -> Callable[P, R]:
    """Extend a step for rasters of one date to rasters with a dimension time."""
    # Each date is processed with the same date of every other raster that has the dimension.

    parameters = list(signature(step).parameters)
    first = parameters[0]

    @wraps(step)
    def each_date(*args, **options):
        if not args and first in options:
            args = (options.pop(first),)
        if not args or "time" not in getattr(args[0], "dims", ()):
            _check_no_dates(step, dict(zip(parameters, args, strict=False)) | options)
            return step(*args, **options)
        raster, *args = args
        if "time" not in raster.coords:
            raise ValueError(
                "the raster's dimension time has no coordinate: type .assign_coords(time=['2022-06-03T17:10', ...])"
            )
        if options.get("time") is not None:
            raise ValueError("the raster has a dimension time: leave time= out, or select one date with .isel(time=0)")
        dates = []
        for number in range(raster.sizes["time"]):
            others = [_at(each, number, raster) for each in args]
            named = {name: _at(each, number, raster) for name, each in options.items()}
            dates.append(step(raster.isel(time=number), *others, **named))
        return joined(dates)

    return each_date


def joined(dates):
    """Join rasters of several dates, dims (time, ...), lazily; coordinates that differ get the dimension time."""
    first = dates[0]
    if isinstance(first, xr.DataTree):
        nodes = {node.path: next(iter(node.data_vars)) for node in first.leaves}
        rasters = {path: joined([date[path][name] for date in dates]) for path, name in nodes.items()}
        return xr.DataTree.from_dict({path: raster.to_dataset() for path, raster in rasters.items()})
    bare = [date.drop_vars(set(date.coords) - set(date.dims)) for date in dates]
    raster = xr.concat(bare, dim="time", join="override", combine_attrs="override").transpose("time", ...)
    if saturated := sum(date.attrs.get("saturated_pixels", 0) for date in dates):
        raster.attrs["saturated_pixels"] = saturated
    for name in ("time", *(name for name in first.coords if name not in (*first.dims, "time"))):
        known, *others = variables = [date.coords[name].variable for date in dates]
        # Coordinates by cell are assumed to differ, because comparing would compute them.
        differs = {"y", "x"} <= set(known.dims) or not all(known.identical(other) for other in others)
        along_time = xr.Variable.concat(variables, dim="time") if differs or name == "time" else known
        raster = raster.assign_coords({name: along_time})
    return raster


def epoch(raster):
    """Number of the noise realization of a date: seconds from the year 1 to its time, 0 without a time."""
    time = raster.coords.get("time")
    if time is None or time.ndim:
        return 0
    if time.dtype.kind != "M":
        # Dates of other calendars and other labels.
        return int.from_bytes(blake2b(str(time.item()).encode(), digest_size=7).digest(), "big") + 1
    # The year 1 is out of range in nanoseconds.
    return int((time.values.astype("M8[s]") - np.datetime64("0001-01-01", "s")).astype(int))


def _check_no_dates(step, options):
    """Raise ValueError for arguments with dates if the raster has one date."""
    for name, other in options.items():
        # Classes of pydantic hold no rasters.
        if other is None or isinstance(other, str | int | float) or hasattr(type(other), "__pydantic_validator__"):
            continue
        if not isinstance(other, xr.DataArray | xr.Dataset | xr.DataTree):
            _check_no_dates(step, parts_of(other))
        elif "time" in other.dims:
            raise ValueError(
                f"{name} has dates and the raster of {step.__name__} has none: give the raster a dimension time, or "
                "select one date with .isel(time=0)"
            )


def _at(other, number, raster):
    """Select a date in an argument with the dimension time, or in its parts."""
    if not isinstance(other, xr.DataArray | xr.Dataset | xr.DataTree):
        return with_parts(other, lambda each: _at(each, number, raster))
    if "time" not in other.dims:
        return other
    if not np.array_equal(other["time"].values, raster["time"].values):
        raise ValueError(
            f"the times of {getattr(other, 'name', None) or 'a Dataset'} differ from the times of the raster"
        )
    return other.isel(time=number)
