"""Types of arguments, each with the kind by which it is checked: path, time, numbers, chunks."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from os import PathLike
from typing import Annotated, Any, Literal, Protocol, TypeAlias

import numpy as np

from fifesim.base.arguments import CHUNKS, DATES, LIST, NAMES, NUMBERS, PAIR, PATH, PLAIN, ROW, UNCHECKED, Kind, is_path


class Array(Protocol):
    """Anything that numpy reads as an array: of numpy or dask, a column of pandas, an xarray.DataArray."""

    def __array__(self) -> np.ndarray: ...


class FrozenDistribution(Protocol):
    """Frozen continuous distribution, as in `scipy.stats`."""

    def ppf(self, q: Any, /) -> Any:
        """Quantile of a share of the distribution."""

    def cdf(self, x: Any, /) -> Any:
        """Share of the distribution below a value."""

    def pdf(self, x: Any, /) -> Any:
        """Probability density."""

    def mean(self) -> Any:
        """Mean."""

    def std(self) -> Any:
        """Standard deviation."""

    def support(self) -> tuple[Any, Any]:
        """Smallest and largest value."""


FilePath: TypeAlias = Annotated[str | PathLike[str], PATH]
Time: TypeAlias = Annotated[str | datetime | np.datetime64, DATES]
Times: TypeAlias = Annotated[Time | Sequence[Time] | Array, DATES]
Names: TypeAlias = Annotated[str | Sequence[str], NAMES]
NoiseKinds: TypeAlias = Annotated[
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
    FilePath | FrozenDistribution,
    Kind(
        "the name of a treatment, the path of a CSV file or a frozen scipy distribution",
        lambda value: is_path(value) or hasattr(value, "ppf"),
    ),
]
