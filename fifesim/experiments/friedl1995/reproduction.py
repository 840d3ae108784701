"""Reproduction of Friedl et al. (1995): statistics, scenes, and scenarios as files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Annotated, Literal, TypeAlias

import numpy as np
import xarray as xr

from fifesim.base.arguments import FilePath, FrozenDistribution, Kind, WholeNumber
from fifesim.base.lattice import check_seed
from fifesim.chain.driver import Driver, cell_block_means
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ALIGNED, ARPS, NATIVE, VARIABLES
from fifesim.experiments.friedl1995.table import COEFFICIENTS, realise_scenes
from fifesim.ground.landscape.distribution import lai_distribution, treatments
from fifesim.output import stac
from fifesim.output.progress import steps
from fifesim.output.run_folder import simulate_to_folder
from fifesim.scenario.toml import write_scenario

# Values of leaf area at which densities are given.
_POINTS = 1201


def shown_scenes(case, readings, seed, each=iter):
    """Cells and pixels of the three scenes of the first treatment."""
    # Variables `cell_*` have dims (arp, y, x), variables `pixel_*` (reading, arp, pixel), with NaN where a reading has
    # fewer pixels.
    cases, light = [replace(case, reading=reading) for reading in readings], case.light()
    scenes = [_scene(cases, light, arp, seed) for arp in each(ARPS)]
    longest = max(one["pixel_lai"].size for _, pixels in scenes for one in pixels)
    names = list(scenes[0][1][0])
    variables = {}
    for name in names:
        values = np.full((len(cases), len(ARPS), longest), False if name == "sampled" else np.nan)
        for row, (_, pixels) in enumerate(scenes):
            for number, one in enumerate(pixels):
                values[number, row, : one[name].size] = one[name]
        variables[name] = (("reading", "arp", "pixel"), values, {"units": "1"})
    for name in scenes[0][0]:
        variables[name] = (("arp", "y", "x"), np.stack([cells[name] for cells, _ in scenes]), {"units": "1"})
    coords = {"reading": [one.reading.name for one in cases], "arp": list(ARPS)}
    return xr.Dataset(variables, coords=coords)


def densities(case):
    """Densities of leaf area of the three treatments, dims (distribution, leaf_area), NaN outside of the support."""
    known = {name: lai_distribution(case.densities[name]) for name in treatments()}
    # Only 1e-4 of the cells have larger values.
    high = max(float(each.ppf(1 - 1e-4)) for each in known.values())
    at = np.linspace(0.0, high * 1.02, _POINTS)
    values = [np.where((at >= each.support()[0]) & (at <= each.support()[1]), each.pdf(at), np.nan)
              for each in known.values()]  # fmt: skip
    coords = {"distribution": list(known), "leaf_area": at}
    attrs = {"long_name": "density of leaf area index", "units": "1"}
    return xr.DataArray(values, dims=("distribution", "leaf_area"), coords=coords, attrs=attrs)


def _scene(cases, light, arp, seed):
    """Cells of a scene, and its pixels in each reading."""
    treatment = treatments()[0]
    driver = Driver(cases[0].setup)
    cells = friedl1995_table.cells_of(cases[0], treatment, arp, seed, light, driver)
    toa, truth = driver.toa(cells.reflectance), _truth(cases[0], driver, cells)
    key = [seed, friedl1995.scenes().index((treatment, arp))]
    pixels = []
    for case in cases:
        digital, analogue = (Driver(replace(case.setup, quantise=quantise)) for quantise in (True, False))
        image = digital.planetary(digital.image(toa, case.grid))
        smooth = analogue.ndvi(analogue.planetary(analogue.image(toa, case.grid)))
        seen = {"ndvi": digital.ndvi(image), "analogue_ndvi": smooth, "toa_red": image[0], "toa_nir": image[1]}
        values = friedl1995_table.paired(*truth.values(), *seen.values())
        numbers = np.arange(values.shape[1])
        chosen = friedl1995_table.draw(numbers[None], friedl1995_table.SAMPLE, key, 1)[0, 0]
        one = {f"pixel_{name}": value for name, value in zip((*truth, *seen), values, strict=True)}
        pixels.append(one | {"sampled": np.isin(numbers, chosen)})
    return {"cell_lai": cells.lai, "cell_fpar": cells.fpar, "cell_ndvi": driver.ndvi(toa)}, pixels


def _truth(case, driver, cells):
    """Variables on the blocks of the truth, independent of the sensor."""
    red, nir = cells.reflectance
    arrays = {"lai": cells.lai, "fpar": cells.fpar, "boa_ndvi": driver.ndvi(cells.reflectance)}
    arrays |= {"red_red": red**2, "red_nir": red * nir, "nir_nir": nir**2, "boa_red": red, "boa_nir": nir}
    found = {
        name: cell_block_means(array, case.grid, case.pixel, case.setup.min_valid) for name, array in arrays.items()
    }
    means = np.stack([found["boa_red"], found["boa_nir"]])
    clear = driver.toa(means)
    return found | {"ndvi_of_mean": driver.ndvi(means), "clear_red": clear[0], "clear_nir": clear[1]}


FILE_BY_BAND = Kind("the path of a CSV file, or a mapping by band")
LandPath: TypeAlias = Annotated[FilePath, Kind("'flat', 'flint-hills' or the path of a raster file")]
Densities: TypeAlias = Annotated[
    FilePath | Mapping[str, FilePath | FrozenDistribution], Kind("a folder, or a mapping by treatment")
]

SEED = 1995
REALISATIONS = 20


def reproduce(
    *,
    reading: Literal["native", "aligned"] = "native",
    dem: LandPath = "flat",
    densities: Densities | None = None,
    optics: Annotated[FilePath | Mapping[str, tuple[float, float]], FILE_BY_BAND] | None = None,
    background: Annotated[FilePath | Mapping[str, float], FILE_BY_BAND] | None = None,
    sensor: FilePath = "TM",
    realisations: int = REALISATIONS,
    cells: int | None = None,
    seed: WholeNumber = SEED,
    west: float | None = None,
    north: float | None = None,
) -> xr.Dataset:
    """
    Reproduce the experiment of Friedl et al. (1995): Table 2 over realisations, and the data of Figures 3 to 9.

    By default, the ground is level, pixels are spaced by the sampling interval of Table 1 and therefore drift from the
    blocks of the truth, and LAI densities, optics and background are fitted to Table 2 of the paper. The text of the
    paper suggests pixels aligned with the blocks, which is the reading "aligned".

    Parameters
    ----------
    reading : {"native", "aligned"}, optional
        Interpretation of Table 1: position of the pixels.
    dem : str or path, optional
        "flat", "flint-hills" (synthetic), or a raster file of elevation.
    densities : str, path or mapping of str, optional
        Folder with LAI samples ``burned-grazed.csv``, ``burned-ungrazed.csv`` and ``unburned-ungrazed.csv``; or
        distributions by treatment, as in `lai_distribution`.
    optics : str, path or mapping of str, optional
        CSV file with columns ``band``, ``leaf_reflectance`` and ``leaf_transmittance``; or pairs by band. [1]
    background : str, path or mapping of str, optional
        CSV file with columns ``band`` and ``background``; numbers by band; or fractions of spectra, such as
        ``"soil_dry:0.475+shade:0.525"``. [1]
    sensor : str or path, optional
        Name of an instrument, or its file.
    realisations : int, optional
        Number of realisations of each of the nine scenes.
    cells : int, optional
        Cells of 3.33 m along the edge of a scene; by default 333, or 12 pixels of a coarse sensor.
    seed : int, optional
        Seed of the first realisation, which the figures show; the others count up.
    west, north : float, optional
        Easting and northing of the upper left corner of the scenes in EPSG:26914, which determine the relief. [m]

    Returns
    -------
    found : xarray.Dataset
        ``intercept``, ``slope`` and ``r2`` over (reading, realisation, distribution, arp, variable), with published
        values as ``paper_slope`` and so on, and samples of 200 pixels as ``slope_200`` with a dimension ``draw``;
        ``ren`` and ``range_kept``; ``density`` of LAI over (distribution, leaf_area); ``cell_...`` and ``pixel_...``
        for the burned, grazed scenes of the first realisation. The first ``reading`` is the requested one; the second
        is "aligned", or "native" if the first is "aligned".

    Raises
    ------
    ValueError
        If an argument is invalid, a treatment has no density, a band has no optics, or the sensor has no red or near
        infrared band.

    References
    ----------
    [Friedl1995]_

    See Also
    --------
    fifesim.budget

    Examples
    --------
    >>> import fifesim
    >>> found = fifesim.reproduce(reading="aligned", realisations=1, cells=90)
    >>> found["r2"].sel(reading="aligned", variable="lai").dims
    ('realisation', 'distribution', 'arp')
    """
    case = friedl1995.case_of(
        reading=reading, dem=dem, densities=densities, optics=optics, background=background, sensor=sensor,
        cells=cells, west=west, north=north,
    )  # fmt: skip
    return reproduce_case(case, realisations, seed, each=lambda label: partial(steps, label=label))


def reproduce_case(case, realisations, seed, each=lambda label: iter):
    """Repeat the experiment for a case."""
    if realisations < 1:
        raise ValueError(f"realisations must be at least 1, got {realisations}")
    check_seed(seed)
    pair = [case.reading, NATIVE if case.reading == ALIGNED else ALIGNED]
    found = realise_scenes(case, range(seed, seed + realisations), readings=pair, each=each("nine scenes"))
    scenes = shown_scenes(case, pair, seed, each=each("scenes of the figures"))
    out = found.merge(scenes).merge(_paper()).assign(density=densities(case))
    out = out.assign_coords(text=("reading", [reading.in_words(case.interval, case.pixel) for reading in pair]))
    return out.assign_attrs(
        title="Friedl et al. (1995), reproduced", sensor=case.instrument.name, dem=case.dem, cells=case.cells,
        seed=str(seed), drift=case.drift, pixel=case.pixel, cell=friedl1995.CELL,
        references="Friedl et al. (1995), doi:10.1016/0034-4257(95)00156-5",
    )  # fmt: skip


def _paper():
    """Numbers published in the paper."""
    dims, shape = ("variable", "distribution", "arp"), (len(VARIABLES), len(treatments()), len(ARPS))
    coords = {"variable": list(VARIABLES), "distribution": treatments(), "arp": list(ARPS)}
    table = friedl1995.paper_table()
    found = {f"paper_{name}": (dims, table[name].to_numpy().reshape(shape), {"units": "1"}) for name in COEFFICIENTS}
    text = friedl1995.paper_text().set_index(["quantity", "variable", "arp"])["value"]
    for quantity, along, names in (("ren", "variable", VARIABLES), ("range_kept", "quantity", (*VARIABLES, "ndvi"))):
        values = [[text.get((quantity, name, arp), np.nan) for arp in ARPS] for name in names]
        found[f"paper_{quantity}"] = ((along, "arp"), values, {"units": "1"})
    return xr.Dataset(found, coords=coords | {"quantity": [*VARIABLES, "ndvi"]})


def write_scenarios(case, folder, seed, scenes=False, each=iter):
    """Write the nine scenarios of a realisation, each into a folder such as ``burned-grazed-0.05``, or runs of them."""
    items = {}
    for treatment, arp in each(friedl1995.scenes()):
        own, scenario = folder / f"{treatment}-{arp:g}", case.scenario(treatment, arp, seed).complete()
        if scenes:
            simulate_to_folder(scenario, own, scene=True)
            items[f"{own.name}/item.json"] = json.loads((own / "item.json").read_text(encoding="utf-8"))
        else:
            own.mkdir(parents=True)
            (own / "scenario.toml").write_text(write_scenario(scenario), encoding="utf-8")
    if items:
        stac.write_collection(folder, "friedl1995", "The nine scenes of Friedl et al. (1995), reproduced.", items)
