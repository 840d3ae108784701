"""Trained retrievals: their description, their file, and their estimates of arrays of pixels."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import xarray as xr

from fifesim.base.arguments import FilePath
from fifesim.base.files import check_regular, check_suffix, in_a_line
from fifesim.retrieval import methods

RETRIEVED = {"lai": (0.0, 20.0), "fpar": (0.0, 1.0), "green_fpar": (0.0, 1.0)}
"""Quantities that a retrieval may estimate, and their physical ranges."""

FORMAT = 1
"""Version of the file of a retrieval."""

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


@dataclass(frozen=True)
class Retrieval:
    """
    A trained retrieval, from `fifesim.train` or `fifesim.read_retrieval`.

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

    def to_netcdf(self, path: FilePath) -> None:
        """
        Write the retrieval to a NetCDF file.

        Parameters
        ----------
        path : str or path
            Its name ends in ``.nc``. An existing file is replaced when the new one is complete.
        """
        check_suffix(path := Path(path), "NetCDF file", ".nc", ".nc4")
        found = xr.Dataset(attrs={"fifesim_retrieval": self.version, "method": self.method, "level": self.level})
        found.attrs |= {"instrument": self.instrument, "prior": self.prior, "seed": self.seed}
        found.attrs |= {"bands": " ".join(self.bands), "quantities": " ".join(self.quantities)}
        found.attrs |= {"wavelengths": np.array(self.wavelengths), "levels": np.array(self.levels)}
        for name, values in self.tables.items():
            values = np.asarray(values, float)
            found[f"table_{name}"] = tuple(f"{name}_{axis}" for axis in range(values.ndim)), values
        if self.score is not None:
            for name, scores in self.score.drop_vars("quantity").data_vars.items():
                found[f"score_{name}"] = scores
        partial_path = path.with_name(f".{path.name}.partial")
        try:
            found.to_netcdf(partial_path)
            os.replace(partial_path, path)
        finally:
            partial_path.unlink(missing_ok=True)


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
        If the file is missing, is not a retrieval, or has a newer format.

    Examples
    --------
    >>> import fifesim
    >>> retrieval = fifesim.read_retrieval("oli.nc")  # doctest: +SKIP
    """
    name = in_a_line(str(path), 200)
    try:
        check_regular(path)
        with xr.open_dataset(path) as file:
            found = file.load()
    except FileNotFoundError:
        raise ValueError(f"cannot read the retrieval {name}: there is no such file") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"cannot read the retrieval {name}: {in_a_line(error, 150)}") from None
    own = found.attrs
    if "fifesim_retrieval" not in own:
        raise ValueError(f"{name} is not a retrieval: write one with fifesim.train(..., path=...)")
    if int(own["fifesim_retrieval"]) != FORMAT:
        raise ValueError(
            f"{name} has the format {own['fifesim_retrieval']} of a retrieval, this fifesim reads format {FORMAT}: "
            "train it again"
        )
    names = [str(name).partition("_") for name in found.data_vars]
    tables = {name: found[f"table_{name}"].values for kind, _, name in names if kind == "table"}
    scores = {name: found[f"score_{name}"] for kind, _, name in names if kind == "score"}
    quantities = tuple(own["quantities"].split())
    return Retrieval(
        method=own["method"],
        level=own["level"],
        instrument=own["instrument"],
        bands=tuple(own["bands"].split()),
        wavelengths=tuple(np.atleast_1d(own["wavelengths"]).tolist()),
        quantities=quantities,
        levels=tuple(np.atleast_1d(own["levels"]).tolist()),
        prior=own["prior"],
        seed=int(own["seed"]),
        tables=tables,
        score=xr.Dataset(scores).assign_coords(quantity=list(quantities)) if scores else None,
    )
