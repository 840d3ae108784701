"""What annotations of the public face call by one name: a path, a time, numbers, chunks."""

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from os import PathLike
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np


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


FilePath: TypeAlias = str | PathLike[str]
Time: TypeAlias = str | datetime | np.datetime64
Names: TypeAlias = str | Sequence[str]
Numbers: TypeAlias = float | Sequence[float] | Array
NumberOrArray: TypeAlias = float | Array
# One number, or two: down and across.
Pair: TypeAlias = float | Sequence[float]
# Cells of a chunk along each side, by dimension, "auto", or a size such as "64MB".
Chunks: TypeAlias = Mapping[str, int] | int | str
# How the pixels of two rasters pair.
Pairing: TypeAlias = Literal["coordinates", "index"]
