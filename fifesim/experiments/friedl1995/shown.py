"""What Figures 3 to 9 of Friedl et al. (1995) show: cells and pixels of the burned, grazed scenes of one seed."""

from dataclasses import replace

import numpy as np
import xarray as xr

from fifesim.analysis.rasters import indices
from fifesim.chain import steps as chain
from fifesim.chain.images import ndvi, planetary_reflectance
from fifesim.chain.setup import image_of
from fifesim.experiments.friedl1995 import case as friedl1995
from fifesim.experiments.friedl1995 import table as friedl1995_table
from fifesim.experiments.friedl1995.case import ARPS
from fifesim.experiments.friedl1995.pixels import block_means, ground_of, pixel_values, scene_image
from fifesim.ground.landscape.distribution import lai_distribution, treatments

# Values of leaf area at which densities are given.
_POINTS = 1201


def shown_scenes(case, readings, seed, each=iter):
    """
    Cells and pixels of the three scenes of the first treatment.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case
    readings : sequence of Reading
    seed : int
    each : callable, optional
        Wraps the sequence of scenes.

    Returns
    -------
    shown : xarray.Dataset
        ``cell_lai``, ``cell_fpar`` and ``cell_ndvi``, the last at the top of the atmosphere, over (arp, y, x) [1].
        Over (reading, arp, pixel), with NaN where a reading has fewer pixels: ``pixel_lai``, ``pixel_fpar``, the true
        means; ``pixel_ndvi`` of the image, and ``pixel_analogue_ndvi`` before digitising; ``pixel_boa_ndvi``, the mean
        of the cells', and ``pixel_ndvi_of_mean``; reflectance of the ground, of the image and of what the atmosphere
        alone makes of the ground, ``pixel_boa_red``, ``pixel_toa_red``, ``pixel_clear_red`` and likewise ``_nir``; the
        means of the products of reflectances; and ``sampled``, whether a pixel is one of a sample of 200.
    """
    cases, land = [replace(case, reading=reading) for reading in readings], case.land()
    scenes = [_scene(cases, land, arp, seed) for arp in each(ARPS)]
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
    """
    Densities of leaf area of the three treatments.

    Parameters
    ----------
    case : fifesim.experiments.friedl1995.case.Case

    Returns
    -------
    densities : xarray.DataArray, dims (distribution, leaf_area)
        Per unit of leaf area, NaN outside of the support.
    """
    known = {name: lai_distribution(case.densities[name]) for name in treatments()}
    # What lies beyond has a ten-thousandth of the cells.
    high = max(float(each.ppf(1 - 1e-4)) for each in known.values())
    at = np.linspace(0.0, high * 1.02, _POINTS)
    values = [np.where((at >= each.support()[0]) & (at <= each.support()[1]), each.pdf(at), np.nan)
              for each in known.values()]  # fmt: skip
    coords = {"distribution": list(known), "leaf_area": at}
    attrs = {"long_name": "density of leaf area index", "units": "1"}
    return xr.DataArray(values, dims=("distribution", "leaf_area"), coords=coords, attrs=attrs)


def _scene(cases, land, arp, seed):
    """Cells of a scene, and its pixels in each reading."""
    treatment = treatments()[0]
    ground = ground_of(cases[0], treatment, arp, seed, land)
    truth = _truth(cases[0], ground)
    key = [seed, friedl1995.scenes().index((treatment, arp))]
    pixels = []
    for case in cases:
        image = scene_image(case, ground)
        analogue = ndvi(image_of(replace(case.setup, quantise=False), ground.reflectance))
        red, nir = planetary_reflectance(image)
        rasters = truth | {"ndvi": ndvi(image), "analogue_ndvi": analogue, "toa_red": red, "toa_nir": nir}
        values = dict(zip(rasters, pixel_values(*rasters.values()), strict=True))
        numbers = np.arange(values["ndvi"].size)
        chosen = friedl1995_table.draw(numbers[None], friedl1995_table.SAMPLE, key, 1)[0, 0]
        one = {f"pixel_{name}": value for name, value in values.items()}
        pixels.append(one | {"sampled": np.isin(numbers, chosen)})
    cells = {"cell_lai": ground.lai, "cell_fpar": ground.fpar, "cell_ndvi": ndvi(ground.toa)}
    return {name: raster.values for name, raster in cells.items()}, pixels


def _truth(case, ground):
    """What the blocks of the truth hold, whatever the sensor."""
    red, nir = (ground.reflectance.isel(band=number, drop=True) for number in (0, 1))
    means = block_means(case, ground, ground.reflectance)
    clear = chain.to_toa(means, instrument=ground.setup.instrument)
    cells = {"lai": ground.lai, "fpar": ground.fpar, "boa_ndvi": indices.ndvi(ground.reflectance)}
    cells |= {"red_red": red**2, "red_nir": red * nir, "nir_nir": nir**2}
    found = {name: block_means(case, ground, array) for name, array in cells.items()}
    return found | {
        "ndvi_of_mean": indices.ndvi(means),
        "boa_red": means[0], "boa_nir": means[1],
        "clear_red": clear[0], "clear_nir": clear[1],
    }  # fmt: skip
