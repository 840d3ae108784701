"""One scene through many instruments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pandas as pd
import xarray as xr

from fifesim.analysis.rasters.regression import regress
from fifesim.base.annotations import Names
from fifesim.base.bands import NEAR_INFRARED, RED, nearest
from fifesim.chain.images import ndvi
from fifesim.chain.setup import Setup, image_of, reflectance_of
from fifesim.rasters import grid as grids
from fifesim.rasters.annotations import RasterOrDataset
from fifesim.rasters.reductions import computed
from fifesim.rasters.regularization import areas, regularized
from fifesim.sensor import raster as sensor
from fifesim.sensor.description.annotations import InstrumentsLike
from fifesim.sensor.description.instruments import instrument as find_instrument


def compare(
    lai: RasterOrDataset,
    instruments: InstrumentsLike,
    setup: Setup | None = None,
    *,
    bands: Mapping[str, Names] | None = None,
) -> xr.DataTree:
    """
    Images of one scene by many instruments, each on its own grid.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape that has it as ``lai``; in chunks, the images are lazy, and one pass over the
        scene makes them all. [m2 m-2]
    instruments : sequence of str or Instrument
    setup : Setup, optional
        Ground, air and sampling that they share; its instrument and bands do not count. Spectra of leaf and background,
        as by default, fit every instrument.
    bands : mapping of str to sequence of str, optional
        Bands by the name of an instrument; by default its red and its near infrared band.

    Returns
    -------
    images : xarray.DataTree
        A node for each instrument by its name, with ``dn`` (or ``toa_radiance``), dims (band, y, x); below it, of bands
        of several resolutions, a node for each, such as ``/MSI/10m``.

    Raises
    ------
    ValueError
        If an instrument is named twice, ``bands`` names one that is not asked for, or a step of the chain refuses its
        input.

    See Also
    --------
    comparison_table, plot_comparison, Setup

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> images = lai.fifesim.compare(["TM", "OLI"])
    >>> list(images.children)
    ['TM', 'OLI']
    """
    setup = Setup() if setup is None else setup
    if not isinstance(setup, Setup):
        raise TypeError(f"setup must be a fifesim.Setup, got {setup!r}: see fifesim.Setup")
    descriptions = [find_instrument(each) for each in ([instruments] if isinstance(instruments, str) else instruments)]
    names = [description.name for description in descriptions]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"instruments must be at least one, each once, got {', '.join(names) or 'none'}")
    bands = {find_instrument(name).name if name not in names else name: each for name, each in (bands or {}).items()}
    if set(bands) - set(names):
        raise ValueError(f"bands are given for {', '.join(set(bands) - set(names))}, which is not compared")
    nodes = {}
    for description in descriptions:
        given = bands.get(description.name)
        selected = description.red_and_near_infrared() if given is None else description.select(given)
        own = replace(setup, instrument=description, bands=tuple(band.name for band in selected))
        image = image_of(own, reflectance_of(own, lai))
        nodes[f"/{description.name}"] = image if isinstance(image, xr.DataTree) else image.to_dataset()
    return xr.DataTree.from_dict(nodes)


def comparison_table(images: xr.DataTree, truth: xr.DataArray | None = None) -> pd.DataFrame:
    """
    What each of some images of one scene shows, a row for each instrument; computes.

    Parameters
    ----------
    images : xarray.DataTree
        From `compare`.
    truth : xarray.DataArray, dims (y, x), optional
        On cells, such as leaf area index; its means over the pixels of each image are compared with the NDVI.

    Returns
    -------
    table : pandas.DataFrame
        By instrument: ``pixel`` [m], ``rows``, ``columns``, ``bands``, ``ndvi_mean``, ``ndvi_sd``, and with a truth
        ``slope``, ``intercept`` and ``r2`` of it on the NDVI, with the ``n`` pixels that both have. NaN where the bands
        make no NDVI.

    Raises
    ------
    ValueError
        If the tree holds something else, or the truth does not lie on its ground.

    See Also
    --------
    regress

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> images = lai.fifesim.compare(["TM", "OLI"])
    >>> images.fifesim.comparison_table().pixel.to_dict()
    {'TM': 30.0, 'OLI': 30.0}
    """
    rows = {}
    for name, image in recorded_images(images).items():
        grid = grids.geobox(image)
        row = {"pixel": grids.cell_size(grid)[0], "rows": grid.shape.y, "columns": grid.shape.x}
        rows[name] = row | {"bands": ", ".join(map(str, image["band"].values))}
        if not shows_ndvi(image):
            continue
        # Once, for the mean, the deviation and the regression.
        shown = computed(ndvi(image))[0]
        row = {"ndvi_mean": float(shown.mean()), "ndvi_sd": float(shown.std(ddof=1))}
        if truth is not None:
            means = regularized(truth, areas(grid), grid, min_valid=sensor.MIN_VALID)
            fit = regress(means, shown)
            row |= {"slope": fit.slope, "intercept": fit.intercept, "r2": fit.r2, "n": fit.n}
        rows[name] |= row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("instrument")


def recorded_images(images):
    """
    What instruments recorded, as `compare` keeps it.

    Parameters
    ----------
    images : xarray.DataTree

    Returns
    -------
    images : dict of str to xarray.DataArray, dims (band, y, x)
        By the name of the instrument, with its pixel where it has several.

    Raises
    ------
    ValueError
        If a node holds neither digital numbers nor radiance.
    """
    found = {}
    for node in images.leaves:
        name = node.path.strip("/") or "the tree"
        variables = [each for each in ("dn", "toa_radiance") if each in node.data_vars]
        if not variables:
            holds = ", ".join(map(str, node.data_vars)) or "nothing"
            raise ValueError(f"{name} holds no dn and no toa_radiance, but {holds}: give that of compare")
        found[name] = node[variables[0]]
    return found


def shows_ndvi(image):
    """
    Whether an image has a red and a near infrared band.

    Parameters
    ----------
    image : xarray.DataArray, dims (band, y, x)
        With a coordinate ``wavelength``. [um]

    Returns
    -------
    shows : bool
    """
    return all(nearest(image["wavelength"].values, window) is not None for window in (RED, NEAR_INFRARED))
