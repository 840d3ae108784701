"""Types of arguments, each with the kind that is checked: a path, a time, numbers, chunks."""

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from os import PathLike
from typing import Annotated, Any, Literal, Protocol, TypeAlias

import numpy as np

from fifesim.base.kinds import (
    CHUNKS,
    DATES,
    LIST,
    NAMES,
    NUMBERS,
    PAIR,
    PATH,
    PLAIN,
    ROW,
    UNCHECKED,
    Kind,
    is_path,
)


class Array(Protocol):
    """What numpy reads as an array, such as an array of numpy or dask, a column of pandas, an xarray.DataArray."""

    def __array__(self) -> np.ndarray: ...


class Distribution(Protocol):
    """A frozen continuous distribution, as `scipy.stats` has them."""

    @property
    def ppf(self) -> Callable[..., Any]:
        """Value below which a share of the distribution lies."""

    @property
    def cdf(self) -> Callable[..., Any]:
        """Share of the distribution that lies below a value."""

    @property
    def pdf(self) -> Callable[..., Any]:
        """Density."""

    @property
    def mean(self) -> Callable[[], Any]:
        """Mean."""

    @property
    def std(self) -> Callable[[], Any]:
        """Standard deviation."""

    @property
    def support(self) -> Callable[[], tuple[Any, Any]]:
        """Least and largest value."""


FilePath: TypeAlias = Annotated[str | PathLike[str], PATH]
Time: TypeAlias = Annotated[str | datetime | np.datetime64, DATES]
Times: TypeAlias = Annotated[Time | Sequence[Time] | Array, DATES]
Names: TypeAlias = Annotated[str | Sequence[str], NAMES]
Noise: TypeAlias = Annotated[
    Names, Kind("a list of kinds of noise, such as ['shot', 'thermal'], 'all', or () for none")
]
# The function checks the number, and its message states the range.
WholeNumber: TypeAlias = Annotated[int, UNCHECKED]
Metres: TypeAlias = Annotated[float, Kind("a size in metres, such as 30.0")]
Numbers: TypeAlias = Annotated[float | Sequence[float] | Array, NUMBERS]
NumberOrArray: TypeAlias = Annotated[float | Array, NUMBERS]
NumberOrList: TypeAlias = Annotated[Numbers, LIST]
NumberByBand: TypeAlias = Annotated[Numbers | Mapping[str, float], Kind("a number, or one for each band")]
Surroundings: TypeAlias = Annotated[Numbers, Kind("a reflectance, one for each band, or a raster", dimensions=0)]
# One number, or two: down and across.
Pair: TypeAlias = Annotated[float | Sequence[float], PAIR]
Interval: TypeAlias = Annotated[
    Literal["native"] | Pair, Kind("'native', or metres between pixels, down and across", ROW.fits)
]
# Along rows and along columns.
Offset: TypeAlias = Annotated[
    Sequence[Numbers], Kind("two numbers, or two lists of them, such as (0.5, 0.0)", ROW.fits)
]
# Cells of a chunk along each side, by dimension, "auto", or a size such as "64MB".
Chunks: TypeAlias = Annotated[Mapping[str, int] | int | str, CHUNKS]
# How the pixels of two rasters pair.
Pairing: TypeAlias = Literal["coordinates", "index"]
# The name of an aerosol, or the share of each of its components.
AerosolMixture: TypeAlias = Annotated[str | Mapping[str, float], PLAIN]
LaiDistribution: TypeAlias = Annotated[
    FilePath | Distribution,
    Kind(
        "the name of a treatment, the path of a CSV file or a frozen scipy distribution",
        lambda value: is_path(value) or hasattr(value, "ppf"),
    ),
]
