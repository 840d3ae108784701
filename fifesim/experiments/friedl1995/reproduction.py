"""The experiment of Friedl et al. (1995) as one call: its 54 numbers by realisation, and what its figures show."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Annotated, Literal, TypeAlias

import numpy as np
import xarray as xr

from fifesim.base.annotations import Distribution, FilePath, WholeNumber
from fifesim.base.kinds import Kind
from fifesim.base.seeds import check_seed
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import shown
from fifesim.experiments.friedl1995.case import ARPS, VARIABLES
from fifesim.experiments.friedl1995.readings import TABLE_1, beside
from fifesim.experiments.friedl1995.table import COEFFICIENTS, realise
from fifesim.ground.landscape.distribution import treatments
from fifesim.output.progress import steps

FILE_BY_BAND = Kind("the path of a CSV file, or a mapping by band")
Land: TypeAlias = Annotated[FilePath, Kind("'flat', 'flint-hills' or the path of a raster file")]
Densities: TypeAlias = Annotated[
    FilePath | Mapping[str, FilePath | Distribution], Kind("a folder, or a mapping by treatment")
]

SEED = 1995
REALISATIONS = 20


def reproduce(
    *,
    reading: Literal["native", "aligned", "narrow", "offset", "blur-40.8", "blur-48.6"] = "native",
    dem: Land = "flat",
    densities: Densities | None = None,
    optics: Annotated[FilePath | Mapping[str, tuple[float, float]], FILE_BY_BAND] | None = None,
    background: Annotated[FilePath | Mapping[str, float], FILE_BY_BAND] | None = None,
    sensor: FilePath = TABLE_1,
    realisations: int = REALISATIONS,
    cells: int | None = None,
    seed: WholeNumber = SEED,
    west: float | None = None,
    north: float | None = None,
) -> xr.Dataset:
    """
    Repeat the experiment of Friedl et al. (1995): Table 2 over realisations, and what Figures 3 to 9 show.

    Without arguments the ground is level, pixels drift from the blocks of the truth as Table 1's interval has it, and
    densities, optics and background are those that were inferred from the paper's own Table 2. The paper's text speaks
    for pixels that are aligned with the blocks, the reading "aligned".

    Parameters
    ----------
    reading : {"native", "aligned", "narrow", "offset", "blur-40.8", "blur-48.6"}, optional
        Of Table 1: where pixels lie, and how wide they see.
    dem : str or path, optional
        "flat", "flint-hills", which is synthetic, or a raster file of elevation below the scene.
    densities : str, path or mapping of str, optional
        Folder of ``burned-grazed.csv``, ``burned-ungrazed.csv`` and ``unburned-ungrazed.csv``, samples of LAI; or by
        treatment what `lai_distribution` takes.
    optics : str, path or mapping of str, optional
        CSV file with columns ``band``, ``leaf_reflectance`` and ``leaf_transmittance``; or by band a pair. [1]
    background : str, path or mapping of str, optional
        CSV file with columns ``band`` and ``background``; by band a number; or shares of spectra, such as
        ``"soil_dry:0.475+shade:0.525"``. [1]
    sensor : str or path, optional
        Name of an instrument, or its file.
    realisations : int, optional
        Of each of the nine scenes.
    cells : int, optional
        Along the edge of a scene, of 3.33 m each; 333, or 12 pixels of a coarse sensor, by default.
    seed : int, optional
        Of the first realisation, whose scenes the figures show; the others follow.
    west, north : float, optional
        Upper left corner of the scenes, easting and northing in EPSG:26914: the relief depends on it. [m]

    Returns
    -------
    found : xarray.Dataset
        ``intercept``, ``slope`` and ``r2`` over (reading, realisation, distribution, arp, variable), the paper's as
        ``paper_slope`` and so on; those of samples of 200 pixels, ``slope_200``, along ``draw`` too; ``ren`` and
        ``range_kept``. ``density`` of LAI over (distribution, leaf_area). Cells and pixels of the burned, grazed
        scenes of the first realisation, ``cell_...`` and ``pixel_...``. The first of ``reading`` is the one asked for;
        beside it stands the aligned one, or the native one beside that.

    Raises
    ------
    ValueError
        If an argument is none of these, a treatment has no density, a band no optics, or the sensor no red or near
        infrared band.

    References
    ----------
    [Friedl1995]_

    See Also
    --------
    fifesim.plot_reproduction

    Examples
    --------
    >>> import fifesim
    >>> found = fifesim.reproduce(reading="aligned", realisations=1, cells=90)
    >>> found["r2"].sel(reading="aligned", variable="lai").dims
    ('realisation', 'distribution', 'arp')
    """
    given = {"dem": dem, "densities": densities, "optics": optics, "background": background}
    case = friedl1995.case_of(reading, sensor=sensor, cells=cells, west=west, north=north, **given)
    return reproduce_case(case, realisations, seed, each=lambda label: partial(steps, label=label))


def reproduce_case(case, realisations, seed, each=lambda label: iter):
    """
    The same of a case.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    realisations, seed : int
        As in `reproduce`.
    each : callable, optional
        Gives, for a label, what wraps a sequence of scenes, to show how far it is.

    Returns
    -------
    found : xarray.Dataset

    Raises
    ------
    ValueError
        If there is no realisation, or no such seed.
    """
    if realisations < 1:
        raise ValueError(f"realisations must be at least 1, got {realisations}")
    check_seed(seed)
    pair = beside(case.reading)
    found = realise(case, range(seed, seed + realisations), readings=pair, each=each("nine scenes"))
    scenes = shown.shown_scenes(case, pair, seed, each=each("scenes of the figures"))
    out = found.merge(scenes).merge(_paper()).assign(density=shown.densities(case))
    out = out.assign_coords(text=("reading", [reading.in_words(case.interval, case.pixel) for reading in pair]))
    return out.assign_attrs(
        title="Friedl et al. (1995), repeated", sensor=case.instrument.name, dem=case.dem, cells=case.cells,
        seed=str(seed), drift=case.drift, pixel=case.pixel, cell=friedl1995.CELL,
        references="Friedl et al. (1995), doi:10.1016/0034-4257(95)00156-5",
    )  # fmt: skip


def _paper():
    """The paper's own numbers."""
    dims, shape = ("variable", "distribution", "arp"), (len(VARIABLES), len(treatments()), len(ARPS))
    coords = {"variable": list(VARIABLES), "distribution": treatments(), "arp": list(ARPS)}
    table = friedl1995.paper_table()
    found = {f"paper_{name}": (dims, table[name].to_numpy().reshape(shape), {"units": "1"}) for name in COEFFICIENTS}
    text = friedl1995.paper_text().set_index(["quantity", "variable", "arp"])["value"]
    for quantity, along, names in (("ren", "variable", VARIABLES), ("range_kept", "quantity", (*VARIABLES, "ndvi"))):
        values = [[text.get((quantity, name, arp), np.nan) for arp in ARPS] for name in names]
        found[f"paper_{quantity}"] = ((along, "arp"), values, {"units": "1"})
    return xr.Dataset(found, coords=coords | {"quantity": [*VARIABLES, "ndvi"]})
