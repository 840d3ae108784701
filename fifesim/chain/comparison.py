"""Comparison of instruments over one scene, and of radiative transfer engines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from fifesim.analysis.indices import normalized_difference
from fifesim.analysis.regression_labels import regress
from fifesim.atmosphere import coupling
from fifesim.atmosphere import engines as schemes
from fifesim.atmosphere.engines import whole_scattering
from fifesim.atmosphere.labels import LONG_NAMES
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import Names, Numbers, described
from fifesim.base.bands import NEAR_INFRARED, RED, nearest_band
from fifesim.base.geometry import fife_geometry
from fifesim.base.messages import warn
from fifesim.chain.landscapes import land_of
from fifesim.chain.setup import Setup, image_of, reflectance_of
from fifesim.chain.steps import ndvi
from fifesim.grids import cf, directions
from fifesim.grids import grid as grids
from fifesim.grids.inputs import RasterOrDataset
from fifesim.grids.reductions import areas, computed, regularized
from fifesim.grids.sites import fife_site, made_on_site
from fifesim.sensor import labels as sensor
from fifesim.sensor.description.instrument_file import InstrumentsLike
from fifesim.sensor.description.instruments import instrument as find_instrument
from fifesim.sensor.description.provenance import DASH, mixed_origins, origin_text
from fifesim.sensor.instrument_labels import carried_instrument


def compare(
    lai: RasterOrDataset,
    instruments: InstrumentsLike,
    setup: Setup | None = None,
    *,
    bands: Mapping[str, Names] | None = None,
) -> xr.DataTree:
    """
    Simulate images of one scene by several instruments, each on its own grid.

    Parameters
    ----------
    lai : xarray.DataArray, dims (y, x), or xarray.Dataset
        Leaf area index, or a landscape with a variable ``lai``. If it is chunked, the images are lazy and share one
        pass over the scene. [m2 m-2]
    instruments : sequence of str or Instrument
    setup : Setup, optional
        Common ground, atmosphere and sampling; its instrument and bands are ignored. Give leaf and background as
        spectra, as in the default, because optics by band fit one instrument only.
    bands : mapping of str to sequence of str, optional
        Band names by instrument; by default the red and the near infrared band.

    Returns
    -------
    images : xarray.DataTree
        One node per instrument, with ``dn`` (or ``toa_radiance``), dims (band, y, x). If the bands have several
        resolutions, it has one child per resolution, such as ``/MSI/10m``.

    Raises
    ------
    ValueError
        If an instrument is repeated, ``bands`` names an instrument that is not compared, or an input is invalid.

    Warns
    -----
    UserWarning
        If the blur of the instruments, or their noise where it is simulated, has different origins: measured for one
        and assumed for another, for example. See `Instrument.provenance`.

    See Also
    --------
    fifesim.sensor.comparison_table, fifesim.output.plot_comparison, fifesim.Setup

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> images = lai.fifesim.compare(["TM", "OLI"])
    >>> list(images.children)
    ['TM', 'OLI']
    """
    setup = _checked(setup)
    descriptions = [find_instrument(each) for each in ([instruments] if isinstance(instruments, str) else instruments)]
    names = [description.name for description in descriptions]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"instruments must be one or more different names, got {', '.join(names) or 'none'}")
    bands = {find_instrument(name).name if name not in names else name: each for name, each in (bands or {}).items()}
    if set(bands) - set(names):
        raise ValueError(f"bands are given for {', '.join(set(bands) - set(names))}, which is not compared")
    # Warn once if the leaf area is part of a landscape.
    lai = lai if isinstance(lai, xr.Dataset) else land_of(lai).lai
    nodes, compared = {}, []
    for description in descriptions:
        given = bands.get(description.name)
        selected = description.red_and_near_infrared() if given is None else description.select(given)
        own = replace(setup, instrument=description, bands=tuple(band.name for band in selected))
        image = image_of(own, reflectance_of(own, lai), lai)
        nodes[f"/{description.name}"] = image if isinstance(image, xr.DataTree) else image.to_dataset()
        compared.append((description, own.bands))
    if message := mixed_origins(compared, ("blur", "noise") if setup.noise and not setup.noise_models else ("blur",)):
        warn(message)
    return xr.DataTree.from_dict(nodes)


def comparison_table(images: xr.DataTree, truth: xr.DataArray | None = None) -> pd.DataFrame:
    """
    Table of image statistics by instrument; computes.

    Parameters
    ----------
    images : xarray.DataTree
        From `compare`.
    truth : xarray.DataArray, dims (y, x), optional
        Raster of cells, such as leaf area index. Its means over the pixels of each image are regressed on NDVI.

    Returns
    -------
    table : pandas.DataFrame
        One row per instrument: ``pixel`` [m], ``rows``, ``columns``, ``bands``; origin and uncertainty of ``blur``,
        ``noise`` and ``geolocation`` of the instrument, a dash if unknown; ``ndvi_mean`` and ``ndvi_sd``. With `truth`
        also ``slope``, ``intercept``, ``r2`` and the number of pixels ``n`` of its regression on NDVI. NaN without a
        red and a near infrared band.

    Raises
    ------
    ValueError
        If `images` has other contents, or `truth` does not cover the images.

    See Also
    --------
    fifesim.compare, fifesim.regress

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
        rows[name] = row | {"bands": ", ".join(map(str, image["band"].values))} | image_origins(image)
        if not shows_ndvi(image):
            continue
        # Compute once for mean, deviation and regression.
        shown = computed(ndvi(image))[0]
        row = {"ndvi_mean": float(shown.mean()), "ndvi_sd": float(shown.std(ddof=1))}
        if truth is not None:
            means = regularized(truth, areas(grid), grid, min_valid=sensor.MIN_VALID)
            fit = regress(means, shown)
            row |= {"slope": fit.slope, "intercept": fit.intercept, "r2": fit.r2, "n": fit.n}
        rows[name] |= row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("instrument")


def recorded_images(images):
    """Recorded images in a tree from `compare`, by the name of the instrument."""
    found = {}
    for node in images.leaves:
        name = node.path.strip("/") or "the tree"
        variables = [each for each in ("dn", "toa_radiance") if each in node.data_vars]
        if not variables:
            holds = ", ".join(map(str, node.data_vars)) or "nothing"
            raise ValueError(f"{name} has no dn or toa_radiance, but {holds}: give the result of compare")
        found[name] = node[variables[0]]
    return found


def image_origins(image):
    """Origin of blur, noise and geolocation of the instrument of an image, as text."""
    description, bands = carried_instrument(image), [str(name) for name in image["band"].values]
    quantities = ("blur", "noise", "geolocation")
    return {each: DASH if description is None else origin_text(description, each, bands) for each in quantities}


def shows_ndvi(image):
    """Whether an image has a red and a near infrared band."""
    return all(
        nearest_band(image.coords.variables["wavelength"].values, window) is not None for window in (RED, NEAR_INFRARED)
    )


TYPICAL_LAI = 2.0  # of a representative surface [m2 m-2]

_TERMS = ("path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo")
_LONG_NAMES = {name: LONG_NAMES[name] for name in _TERMS}
_LONG_NAMES["gas_transmittance"] = "transmittance of the absorbing gases, down and up"


def compare_engines(
    setup: Setup | None = None, *, reflectance: Numbers | None = None, engines: Names = ("5S", "successive-orders")
) -> xr.Dataset:
    """
    Compare the atmospheric terms of several radiative transfer engines.

    Parameters
    ----------
    setup : Setup, optional
        Atmosphere, directions, instrument, bands, leaves and background; by default as in the paper.
    reflectance : number or sequence of float, shape (band,), optional
        Reflectance of a uniform surface; by default the canopy of the setup with a leaf area index of 2. [1]
    engines : sequence of str, optional
        Names of engines, as in `Atmosphere`.

    Returns
    -------
    terms : xarray.Dataset, dims (engine, band)
        Path reflectance, transmittances, spherical albedo, and ``toa_reflectance`` of the surface; also its ``ndvi`` if
        there are a red and a near infrared band. [1]

    Raises
    ------
    ValueError
        If an engine is unknown, sun or view vary or are out of range, or the number of reflectances differs from the
        number of bands.

    See Also
    --------
    fifesim.Atmosphere, fifesim.to_toa

    Examples
    --------
    >>> from fifesim import Atmosphere, Setup
    >>> from fifesim.atmosphere import compare_engines
    >>> haze = Setup(atmosphere=Atmosphere(visibility=8), bands=("TM3", "TM4"))
    >>> compare_engines(haze, engines=["5S"])["toa_reflectance"].dims
    ('engine', 'band')
    """
    setup, air, bands, geometry = _case(setup)
    surface = _surface(setup, air, reflectance, len(bands))
    responses = tuple(band.response for band in bands)
    names = [engines] if isinstance(engines, str) else list(engines)
    airs = [replace(air, engine=engine) for engine in names]
    found = [schemes.band_terms(each, responses, geometry.sza, geometry.vza, geometry.raa).uniform for each in airs]
    values = {name: np.array([terms[name] for terms in found]) for name in _LONG_NAMES}
    toa = np.array([coupling.apparent_reflectance(surface, **terms) for terms in found])
    attrs = {name: {"long_name": text, "units": "1"} for name, text in _LONG_NAMES.items()}
    data = {name: (("engine", "band"), each, attrs[name]) for name, each in values.items()}
    data["surface_reflectance"] = "band", surface, cf.attributes("surface_reflectance")
    data["toa_reflectance"] = ("engine", "band"), toa, cf.attributes("toa_reflectance")
    wavelength = [band.wavelength for band in bands]
    red, near_infrared = (nearest_band(wavelength, window) for window in (RED, NEAR_INFRARED))
    if red is not None and near_infrared is not None:
        ndvi = normalized_difference(toa[:, near_infrared], toa[:, red])
        data["ndvi"] = "engine", ndvi, cf.attributes("ndvi")
    coords = {
        "engine": names,
        "band": [band.name for band in bands],
        "wavelength": ("band", wavelength, cf.attributes("wavelength")),
    }
    return directions.with_geometry(xr.Dataset(data, coords, {"atmosphere": air.text}), geometry)


def engine_error(setup=None):
    """Relative error of the apparent reflectance by the engine of a setup against successive orders, by band. [1]"""
    # For speed, at the mean wavelength of each band.
    setup, air, bands, geometry = _case(setup)
    surface = _surface(setup, air, None, len(bands))
    wavelength = np.array([band.response.center for band in bands])
    increasing = np.argsort(wavelength)
    views = geometry.sza, np.array([geometry.vza]), np.array([geometry.raa])
    toa = []
    for scattering in (schemes.scattering, whole_scattering):
        light = scattering(air, wavelength[increasing], *views)
        down, up = light.transmittance_down, light.transmittance_up
        terms = light.reflectance, down, up, light.spherical_albedo, 1.0
        toa.append(np.ravel(coupling.apparent_reflectance(surface[increasing], *terms)))
    error = dict(zip(increasing.tolist(), (toa[0] / toa[1] - 1).tolist(), strict=True))
    return {band.name: error[number] for number, band in enumerate(bands)}


def _checked(setup: Setup | None) -> Setup:
    """Setup as given, or the default one."""
    if setup is not None and not isinstance(setup, Setup):
        raise TypeError(f"setup must be a fifesim.Setup, got {setup!r}: see fifesim.Setup")
    return setup or Setup()


def _case(setup):
    """Setup, atmosphere, bands and uniform geometry."""
    setup = _checked(setup)
    air = Atmosphere() if setup.atmosphere is None else setup.atmosphere
    geometry = fife_geometry() if setup.geometry is None else setup.geometry
    bands = find_instrument(setup.instrument).select(setup.bands)
    return setup, air, bands, directions.uniform_geometry(geometry, "a comparison of engines")


def _surface(setup, air, reflectance, n_bands):
    """Reflectance of the surface in each band, shape (band,). [1]"""
    if reflectance is None:
        # A single cell, with the same illumination for all engines.
        cell = fife_site(30, window=((0, 1), (0, 1)))
        lai = grids.place(xr.DataArray([[TYPICAL_LAI]], dims=("y", "x"), attrs=made_on_site(cell)), cell)
        level = replace(setup, atmosphere=replace(air, engine="5S"), dem=None, horizon=None)
        return reflectance_of(level, lai).values.ravel()
    surface = np.asarray(reflectance, float)
    if surface.shape not in ((), (n_bands,)) or not np.all((surface >= 0) & (surface <= 1)):
        raise ValueError(
            f"reflectance must be a number from 0 to 1, or {n_bands} numbers, one per band, got "
            f"{described(reflectance)}: leave it out to use a canopy"
        )
    return np.broadcast_to(surface, n_bands)
