"""Trained retrievals: their description, their file, and their estimates of arrays of pixels."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
import xarray as xr
from pydantic import BaseModel, Field, ValidationError, model_validator

from fifesim.base.arguments import FilePath
from fifesim.base.files import check_suffix, in_a_line, read_bounded, reading, whole_file
from fifesim.base.messages import html_table, value_in_words
from fifesim.retrieval import methods
from fifesim.sensor.description.fields import Name, Positive, Share, errors_in_words

RETRIEVED = {"lai": (0.0, 20.0), "fpar": (0.0, 1.0), "green_fpar": (0.0, 1.0)}
"""Quantities that a retrieval may estimate, and their physical ranges."""

FORMAT = 3
"""Version of the file of a retrieval."""

# Mark behind the NetCDF content of a file. The version and the SHA-256 of the content follow, separated by a space.
_SEAL = b"\nfifesim retrieval "

# Maximum size of a file. [byte]
_LARGEST = 2**28

_AGAIN = "train it again with fifesim.train(..., path=...)"

# Angles may be this far outside of the training. [degree]
ANGLE_MARGIN = 3.0

OUTSIDE, EDGE, NOT_CONVERGED = 1, 2, 4
"""Bits of the flag."""


class Estimated(NamedTuple):
    """Estimates of pixels with intervals and flags."""

    median: np.ndarray
    """Shape (n, quantities)."""
    sd: np.ndarray
    """Shape (n, quantities)."""
    low: np.ndarray
    """Shape (n, quantities, levels)."""
    high: np.ndarray
    """Shape (n, quantities, levels)."""
    flag: np.ndarray
    """Bits, shape (n,)."""
    diagnostics: tuple[np.ndarray, ...] = ()
    """Layers of `Retrieval.diagnostics`, each of shape (n,)."""


class _Description(BaseModel, extra="forbid", strict=True):
    """Attributes of a retrieval in its file."""

    method: Literal["line", "lookup", "quantiles", "optimal-estimation"]
    level: Literal["toa", "surface"]
    instrument: str
    bands: Annotated[tuple[Name, ...], Field(min_length=1)]
    wavelengths: tuple[Positive, ...]
    quantities: Annotated[tuple[Literal["lai", "fpar", "green_fpar"], ...], Field(min_length=1)]
    levels: Annotated[tuple[Share, ...], Field(min_length=1)]
    prior: str
    seed: int

    @model_validator(mode="after")
    def _agree(self):
        if len(self.wavelengths) != len(self.bands) or sorted(set(self.levels)) != list(self.levels):
            raise ValueError("bands need one wavelength each, and levels must increase")
        return self


@dataclass(frozen=True, repr=False)
class Retrieval:
    """
    A trained retrieval, from `fifesim.train` or `fifesim.retrieval.read_retrieval`.

    Attributes
    ----------
    method : {"line", "lookup", "quantiles", "optimal-estimation"}
    level : {"toa", "surface"}
        Level of the images.
    instrument : str
        Name of the instrument of the training images.
    bands : tuple of str
    wavelengths : tuple of float
        [um]
    quantities : tuple of str
    levels : tuple of float
        Levels of the intervals, increasing. [1]
    prior : str
        Distribution of the quantities in the training, in words.
    seed : int
        Seed of the training.
    tables : mapping of str to array
        Numbers of the method, of its domain and of its intervals.
    version : int
        Version of the file format.
    score : xarray.Dataset or None
        Scores on the landscapes that were not used in training, dims (quantity, level).

    Examples
    --------
    Ten landscapes keep this example short; `fifesim.train` warns of them.

    >>> import fifesim
    >>> chip = fifesim.Scenario(grid={"width": 300, "height": 300}, terrain={"dem": "flat"})
    >>> study = fifesim.Study(chip, {"visibility": {"uniform": [10, 60]}}, landscapes=10)
    >>> retrieval = fifesim.train(study, "line", chips=10)
    >>> retrieval.bands, retrieval.level, retrieval.levels
    (('TM3', 'TM4'), 'toa', (0.5, 0.8, 0.95))
    """

    method: str
    level: Literal["toa", "surface"]
    instrument: str
    bands: tuple[str, ...]
    wavelengths: tuple[float, ...]
    quantities: tuple[str, ...]
    levels: tuple[float, ...]
    prior: str
    seed: int
    tables: Mapping[str, np.ndarray] = field(repr=False)
    version: int = FORMAT
    score: xr.Dataset | None = field(default=None, repr=False)
    _in_words: ClassVar[str] = "a fifesim.Retrieval, as fifesim.train gives it"

    def __repr__(self):
        return (
            f"Retrieval of {value_in_words(self.quantities)} by {self.method} from {self.level} reflectance of "
            f"{self.instrument}, bands {value_in_words(self.bands)}\n"
            f"  intervals {value_in_words(self.levels)}; prior {self.prior}"
        )

    def _repr_html_(self):
        rows = [(name, getattr(self, name), "") for name in _Description.model_fields]
        rows += [] if self.score is None else [("rmse", self.score.rmse.values.tolist(), "on test landscapes")]
        return html_table("Retrieval", rows)

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Names of further layers of the estimates, a tuple of str; only optimal estimation has any."""
        return methods.diagnostics_of(self.tables)

    def estimate(self, reflectance: np.ndarray, angles: np.ndarray) -> Estimated:
        """
        Estimate the quantities of pixels.

        Parameters
        ----------
        reflectance : array, shape (n, bands)
        angles : array, shape (n, 3)
            Zenith angles of sun and view and the relative azimuth. [degree]

        Returns
        -------
        estimates : Estimated
            NaN for pixels with NaN.
        """
        known = np.isfinite(reflectance).all(1) & np.isfinite(angles).all(1)
        count, kinds = len(reflectance), len(self.quantities)
        shape = count, kinds, len(self.levels)
        median, sd, low, high = (np.full(each, np.nan) for each in ((count, kinds), (count, kinds), shape, shape))
        flag, diagnostics = np.zeros(count, np.int8), tuple(np.full(count, np.nan) for _ in self.diagnostics)
        if known.any():
            light, own = reflectance[known], angles[known]
            found = methods.ESTIMATORS[self.method](self.tables, light, own, levels=self.levels)
            median[known], sd[known] = found.median, found.sd
            for at, level in enumerate(self.levels):
                ends = methods.ends_of(found.quantiles, self.levels, level)
                factor = self.tables["stretch"][:, at]
                for out, end in zip((low, high), ends, strict=True):
                    out[known, :, at] = found.median + factor * (end - found.median)
            for layer, values in zip(diagnostics, found.diagnostics, strict=True):
                layer[known] = values
            first, last = self.tables["angle_range"]
            astray = ((own < first - ANGLE_MARGIN) | (own > last + ANGLE_MARGIN)).any(1)
            flag[known] = OUTSIDE * (methods.is_outside(self.tables, light) | astray)
            flag[known] |= NOT_CONVERGED * np.logical_not(found.converged).astype(np.int8)
        # Factors differ by level; a wider interval contains the narrower ones.
        np.minimum.accumulate(low, axis=2, out=low)
        np.maximum.accumulate(high, axis=2, out=high)
        least, most = self.tables["prior_range"]
        flag |= EDGE * ((median < least) | (median > most)).any(1).astype(np.int8)
        allowed = np.array([RETRIEVED[name] for name in self.quantities]).T
        np.clip(median, *allowed, out=median)
        for end in (low, high):
            np.clip(end, *allowed[..., None], out=end)
        return Estimated(median, sd, low, high, flag, diagnostics)

    def __eq__(self, other):
        return isinstance(other, Retrieval) and self._dataset().identical(other._dataset())

    def to_netcdf(self, path: FilePath) -> None:
        """
        Write the retrieval to a NetCDF file.

        Parameters
        ----------
        path : str or path
            Its name ends in ``.nc``. An existing file is replaced when the new one is complete. The NetCDF content is
            followed by its SHA-256 checksum, which `fifesim.retrieval.read_retrieval` compares.

        Raises
        ------
        ValueError
            If the name ends as another kind of file.
        OSError
            If the file cannot be written.
        """
        check_suffix(Path(path), "NetCDF file", ".nc", ".nc4")
        content = bytes(self._dataset().to_netcdf(engine="netcdf4"))
        with whole_file(path) as new:
            new.write_bytes(content + _SEAL + f"{self.version} {hashlib.sha256(content).hexdigest()}".encode())

    def _dataset(self):
        """Attributes, tables and scores of the retrieval as they are in its file."""
        known = {name: getattr(self, name) for name in _Description.model_fields} | {"seed": int(self.seed)}
        found = xr.Dataset(attrs={"fifesim_retrieval": _Description(**known).model_dump_json()})
        for name, values in self.tables.items():
            values = np.asarray(values, float)
            found[f"table_{name}"] = tuple(f"{name}_{axis}" for axis in range(values.ndim)), values
        if self.score is not None:
            for name, scores in self.score.drop_vars("quantity").data_vars.items():
                found[f"score_{name}"] = scores
        return found


def read_retrieval(path: FilePath) -> Retrieval:
    """
    Read a retrieval from a NetCDF file.

    Parameters
    ----------
    path : str or path
        From `fifesim.train` with ``path=`` or `Retrieval.to_netcdf`. Reading it executes no code of the file.

    Returns
    -------
    retrieval : Retrieval

    Raises
    ------
    ValueError
        If the file is missing, is not a retrieval, has another format, or has changed since it was written.

    Examples
    --------
    >>> import fifesim
    >>> retrieval = fifesim.retrieval.read_retrieval("oli.nc")  # doctest: +SKIP
    """
    name = in_a_line(str(path), 200)
    with reading("the retrieval", path):
        content = read_bounded(path, _LARGEST, "a retrieval")
    # NetCDF's library may not return from a damaged file, so that the checksum comes first.
    content, seal, text = content.rpartition(_SEAL)
    version, _, checksum = text.partition(b" ")
    if not seal:
        raise ValueError(f"{name} is not a retrieval of this fifesim, or its end is missing: {_AGAIN}")
    if version != str(FORMAT).encode():
        of = in_a_line(version.decode("ascii", "replace"), 20)
        raise ValueError(f"{name} has the format {of} of a retrieval, this fifesim reads format {FORMAT}: {_AGAIN}")
    if checksum != hashlib.sha256(content).hexdigest().encode():
        raise ValueError(f"{name} has changed since it was written, its checksum differs: {_AGAIN}")
    try:
        with xr.open_dataset(content, engine="netcdf4") as file:
            if file.nbytes > len(content):
                raise ValueError(f"it declares {file.nbytes} bytes of numbers in {len(content)} bytes")
            return _restored(file.load())
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        words = errors_in_words(error, ()) if isinstance(error, ValidationError) else in_a_line(error, 150)
        raise ValueError(f"{name} is not a valid retrieval, {words}: {_AGAIN}") from None


def _restored(file):
    """Retrieval of the content of a file, whose attributes, tables and scores are checked."""
    known = _Description.model_validate_json(file.attrs["fifesim_retrieval"])
    parts = {"table": {}, "score": {}}
    for name, values in file.data_vars.items():
        kind, _, rest = str(name).partition("_")
        parts[kind][rest] = values
    tables = {name: values.values for name, values in parts["table"].items()}
    sizes = {"quantity": len(known.quantities), "level": len(known.levels)}
    methods.check_tables(known.method, tables, len(known.bands), *sizes.values())
    scores = xr.Dataset(parts["score"])
    if any(scores.sizes.get(axis, size) != size for axis, size in sizes.items()):
        raise ValueError(f"scores have dimensions {dict(scores.sizes)}")
    scores = scores.assign_coords(quantity=list(known.quantities)) if scores else None
    return Retrieval(**dict(known), tables=tables, score=scores)
