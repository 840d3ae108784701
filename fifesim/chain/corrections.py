"""Corrections of labelled reflectance for slopes and view angles, as users apply them to images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import xarray as xr

from fifesim.analysis import corrections
from fifesim.atmosphere.engines import LARGEST_ZENITH
from fifesim.atmosphere.models import Atmosphere
from fifesim.base.arguments import NumberByBand, Time
from fifesim.base.geometry import ANGLES, relative_azimuth
from fifesim.base.messages import warn
from fifesim.base.surface_kernels import RossLi, ross_li
from fifesim.chain.steps import air_bands_and_geometry, as_bands_of, planetary_reflectance, sunlight
from fifesim.grids import cf, chunks, directions, reductions, swaths
from fifesim.grids.dates import by_date
from fifesim.grids.directions import Directions
from fifesim.grids.inputs import Horizon, RasterOrDataset
from fifesim.ground.terrain import labels as terrain_labels
from fifesim.ground.terrain.lit_slopes import slope_light
from fifesim.sensor.description.instrument_file import InstrumentLike

_REFERENCES = {
    "cosine": "Teillet et al. (1982), doi:10.1080/07038992.1982.10855028",
    "c": "Teillet et al. (1982), doi:10.1080/07038992.1982.10855028",
    "scs": "Gu and Gillespie (1998), doi:10.1016/S0034-4257(97)00177-6",
    "scs+c": "Soenen et al. (2005), doi:10.1109/TGRS.2005.852480",
    "minnaert": "Minnaert (1941), doi:10.1086/144279",
    "kt": "Dubayah (1992), doi:10.1029/91WR02671",
}

_ROY = "Roy et al. (2016), doi:10.1016/j.rse.2016.01.023"

# The surroundings in Kt are as bright as the result: each round leaves at most their share of the light. [1]
_ROUNDS = 4


@by_date
def topographic_correction(
    reflectance: RasterOrDataset,
    dem: xr.DataArray,
    method: Literal["cosine", "c", "scs", "scs+c", "minnaert", "kt"] = "scs+c",
    *,
    c: NumberByBand | None = None,
    k: NumberByBand | None = None,
    horizon: Horizon | None = None,
    upwelling: bool = True,
    atmosphere: Atmosphere | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
    instrument: InstrumentLike | None = None,
) -> xr.DataArray:
    """
    Reflectance of level ground, estimated from the reflectance of slopes.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x), or xarray.Dataset of bands
        Surface or planetary reflectance; digital numbers and radiance are converted first. [1]
    dem : xarray.DataArray, dims (y, x)
        Elevation on the cells of the reflectance, or on a larger area. [m]
    method : {"cosine", "c", "scs", "scs+c", "minnaert", "kt"}, optional
        Correction. "kt" divides by Kt (Eq. 4), which needs surface reflectance and the atmosphere.
    c : number or sequence, optional
        Constant of "c" and "scs+c", one for each band; by default from the regression of the scene on illumination. [1]
    k : number or sequence, optional
        Exponent of "minnaert", likewise. [1]
    horizon : xarray.DataArray, dims (direction, y, x), optional
        Horizon, as in `surface_reflectance`. [degree]
    upwelling : bool, optional
        Whether "kt" also divides by the cosine factor of the view (Eq. 5), as `surface_reflectance` applies it.
    atmosphere, geometry, time, instrument : optional
        As in `to_toa`; the atmosphere has an effect on "kt" only.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        Except for "kt", NaN in shadow and where the divisor is below 0.1: cos i of "cosine", "scs" and "minnaert", cos
        i + c of "c" and "scs+c". The attribute ``masked_cells`` of a result in memory is the number of such cells in
        the sun. Coordinates along band hold the constant ``c`` or the exponent ``k``. Lazy if an input is, with the
        same bits. [1]

    Raises
    ------
    ValueError
        If the sun varies from cell to cell, or the dem does not cover the reflectance.

    Notes
    -----
    At cos i = 0.1, an error of 1 degree of the slope changes a correction by 17 %.

    See Also
    --------
    fifesim.kt, fifesim.terrain.illumination, fifesim.scaling.brdf_normalise

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> dem, lai = fifesim.flint_hills(grid, seed=7), fifesim.lai_scene(grid, seed=7)
    >>> level, hilly = (lai.fifesim.surface_reflectance("TM", bands=["TM4"], dem=each) for each in (None, dem))
    >>> corrected = hilly.fifesim.topographic_correction(dem, "kt")
    >>> bool(abs(corrected - level).max() < 1e-6)
    True
    """
    for name, value, methods in (("c", c, ("c", "scs+c")), ("k", k, ("minnaert",))):
        if value is not None and method not in methods:
            raise ValueError(f"{name} is for method {' or '.join(methods)}, got method={method!r}: leave {name} out")
    image = _with_bands(as_bands_of(planetary_reflectance(reflectance), instrument, "toa_reflectance"))
    if method == "kt":
        cf.check_quantity(image, "surface_reflectance")
        air = air_bands_and_geometry(image, atmosphere, geometry, instrument, time)
        geometry = air[-1]
        light = sunlight(dem, horizon, *air, "topographic_correction")  # type: ignore[call-arg]
        out, found, dark = _over_kt(image, light, upwelling), {}, None
    else:
        known = directions.given_geometry(geometry, image, time)
        geometry = directions.uniform_geometry(known, "topographic_correction")
        slopes = _slopes(image, dem, horizon, geometry)
        out, found = _corrected(image, method, slopes, geometry.sza, c, k)
        dark = _masked(out, image, slopes[1])
    out = directions.with_geometry(swaths.placed_as(out, image, found), geometry)
    history = f"topographic_correction: {method}, sza {geometry.sza:.2f}, saa {geometry.saa:.2f}"
    history += f", least divisor {corrections.LEAST_COSINE:g}" * (method != "kt")
    masked = {} if dark is None else {"masked_cells": dark}
    return cf.label(out, _quantity(image), source=image, history=history, references=_REFERENCES[method], **masked)


def _quantity(image):
    """Name of the quantity of an image: reflectance at the top of the atmosphere, or of the surface."""
    at_top = image.attrs.get("standard_name") == cf.QUANTITIES["toa_reflectance"].standard_name
    return "toa_reflectance" if at_top else "surface_reflectance"


def _slopes(image, dem, horizon, geometry):
    """Slope [degree], illumination and view factor [1] of the cells of an image, a raster over (3, y, x)."""

    def kernel(elevation, sky, cell, seen, _):
        light = slope_light(elevation, sky, cell, seen)
        return np.stack([np.degrees(np.arccos(np.minimum(light.cosine, 1))), light.mu_s_local, light.upwelling])

    one = image.isel(band=0, drop=True)
    data = terrain_labels.on_slopes(_last_first(kernel), dem, horizon, geometry, one, leading=(3,))
    return chunks.along_first(data)


def _last_first(kernel):
    """Kernel for `on_slopes`, which passes the cells of the raster first."""
    return lambda cells, *light: kernel(*light, cells)


def _corrected(image, method, slopes, sza, c, k):
    """Corrected reflectance, and the constant or exponent of each band by name."""
    slope, cos_i, _ = (image.isel(band=0, drop=True).copy(data=each).variable for each in slopes)
    kernels = {
        "cosine": corrections.cosine_correction,
        "c": corrections.c_correction,
        "scs": corrections.scs_correction,
        "scs+c": corrections.scs_c_correction,
        "minnaert": corrections.minnaert_correction,
    }
    arguments, found = [cos_i, xr.Variable((), sza)], {}
    if method.startswith("scs"):
        arguments.append(slope)
    if method in ("c", "scs+c", "minnaert"):
        name, given = ("k", k) if method == "minnaert" else ("c", c)
        values = _estimate(name, image.data, cos_i.data, sza) if given is None else _per_band(given, image, name)
        found[name] = xr.Variable("band", values, cf.attributes(f"topographic_{name}"))
        arguments.append(found[name])
    return chunks.pointwise(kernels[method], image, *arguments), found


def _estimate(name, reflectance, cos_i, sza):
    """Constant c or exponent k of each band, from sums by row, so that its bits do not depend on chunks."""
    options = {"logarithmic": name == "k", "level": np.cos(np.radians(sza))}
    kernel, last = (partial(each, **options) for each in (corrections.line_sums, corrections.line_constant))
    sums = reductions.row_by_row(kernel, reflectance, cos_i, leading=(6, len(reflectance)))
    if isinstance(sums, np.ndarray):
        return last(sums)
    return sums.rechunk(-1).map_blocks(last, dtype=float, drop_axis=[0, 2], meta=np.empty(0))


def _masked(corrected, image, cos_i):
    """Number of cells in the sun that a correction leaves out, None for a lazy raster."""
    if corrected.chunks is not None:
        return None
    return int(((cos_i > 0) & (np.isnan(corrected.data) & np.isfinite(image.data)).any(axis=0)).sum())


def _with_bands(image):
    """Image with dims (band, y, x)."""
    if "stream" in image.dims:
        raise ValueError("reflectance has a dimension stream: call surface_reflectance without streams=")
    if "band" not in image.dims:
        raise ValueError("reflectance has no dimension band: type .expand_dims('band')")
    return image.transpose("band", "y", "x")


def _per_band(given, image, name):
    """Numbers of the bands of an image, shape (band,)."""
    names = image["band"].values.tolist() if "band" in image.coords else []
    if isinstance(given, Mapping):
        if missing := [each for each in names if each not in given]:
            raise ValueError(f"{name} has no number for {', '.join(missing)}: give one for each band")
        given = [given[each] for each in names]
    values = np.atleast_1d(np.asarray(given, float))
    if values.ndim > 1:
        raise ValueError(f"{name} must be a number, or one for each band, got shape {values.shape}")
    if len(values) not in (1, image.sizes["band"]):
        raise ValueError(f"{name} must be a number, or one for each of {image.sizes['band']} bands, got {len(values)}")
    return np.broadcast_to(values, image.sizes["band"])


def _over_kt(image, light, upwelling):
    """Reflectance of level ground whose slopes reflect as given, by repeated division by Kt."""
    view = _slopes(image, light.dem, light.horizon, light.geometry)[2]
    seen = image.copy(data=image.data / view) if upwelling else image
    level = seen
    for _ in range(_ROUNDS):
        level = image.copy(data=seen.data / terrain_labels.kt_on_slopes(level, light).data)
    return level


@by_date
def brdf_normalise(
    reflectance: RasterOrDataset,
    surface: RossLi,
    *,
    to: Directions | None = None,
    geometry: Directions | None = None,
    time: Time | None = None,
) -> xr.DataArray:
    """
    Reflectance in another view, by default at nadir, by the c-factor of the Ross-Li kernels.

    Parameters
    ----------
    reflectance : xarray.DataArray, dims (band, y, x), or xarray.Dataset of bands
        Surface reflectance. [1]
    surface : RossLi
        Weights of the kernels: numbers, or one for each band.
    to : Geometry or xarray.Dataset, optional
        Directions of the result; by default the sun of each cell and a nadir view.
    geometry : Geometry or xarray.Dataset, optional
        Directions of the reflectance; by default from its coordinates.
    time : str or datetime, optional
        Time for the position of the sun, instead of ``geometry``.

    Returns
    -------
    reflectance : xarray.DataArray, dims (band, y, x)
        Multiplied by the ratio of the modelled reflectances. Lazy if an input is. [1]

    Raises
    ------
    ValueError
        If the model is not positive in a direction.

    Warns
    -----
    UserWarning
        If sun or view are beyond 75 degrees, where the kernels are not valid.

    References
    ----------
    [Roy2016]_

    See Also
    --------
    fifesim.scaling.topographic_correction, fifesim.ground.RossLi

    Examples
    --------
    >>> import fifesim
    >>> grid = fifesim.fife_site(30 / 9, window=((0, 90), (0, 90)))
    >>> lai = fifesim.lai_scene(grid, seed=7)
    >>> slant = fifesim.Geometry(sza=30, saa=117, vza=30, vaa=117)
    >>> rho = lai.fifesim.surface_reflectance("TM", bands=["TM4"], geometry=slant)
    >>> nadir = rho.fifesim.brdf_normalise(fifesim.ground.RossLi(0.3, 0.15, 0.03))
    >>> float(nadir.vza), bool((nadir < rho).all())
    (0.0, True)
    """
    image = _with_bands(as_bands_of(reflectance, None, "surface_reflectance"))
    cf.check_quantity(image, "surface_reflectance")
    geometry = directions.given_geometry(geometry, image, time)
    to = directions.checked_geometry(_at_nadir(geometry) if to is None else to)
    weights = [xr.Variable("band", _per_band(getattr(surface, name), image, name)) for name in ("iso", "vol", "geo")]
    angles = [*directions.angles(geometry), *directions.angles(to)]
    plain = image.drop_vars(["band", *ANGLES], errors="ignore")
    out = chunks.pointwise(_normalised, plain, *weights, *angles)
    names = {"band": image.coords["band"]} if "band" in image.coords else {}
    out = directions.with_geometry(swaths.placed_as(out, image, names), to)
    history = "brdf_normalise: c-factor of Ross-Li kernels"
    return cf.label(out, "surface_reflectance", source=image, history=history, references=_ROY)


def _at_nadir(geometry):
    """Directions with the same sun and a nadir view."""
    if isinstance(geometry, xr.Dataset):
        return geometry.assign(vza=0.0, vaa=0.0)
    return replace(geometry, vza=0.0, vaa=0.0)


def _normalised(reflectance, iso, vol, geo, sza, saa, vza, vaa, to_sza, to_saa, to_vza, to_vaa):
    """Reflectance of cells in other directions. [1]"""
    if np.nanmax([np.nanmax(each, initial=0) for each in (sza, vza, to_sza, to_vza)]) > LARGEST_ZENITH:
        warn(f"the Ross-Li kernels are not valid beyond {LARGEST_ZENITH:g} degrees of sun or view")
    before = ross_li(iso, vol, geo, sza=sza, vza=vza, raa=relative_azimuth(saa, vaa))
    after = ross_li(iso, vol, geo, sza=to_sza, vza=to_vza, raa=relative_azimuth(to_saa, to_vaa))
    for model, zeniths in ((before, (sza, vza)), (after, (to_sza, to_vza))):
        if (model <= 0).any():
            at = " and ".join(f"{np.nanmax(each):g}" for each in zeniths)
            raise ValueError(
                f"the weights reflect {np.nanmin(model):.3g} for sun and view at up to {at} degrees: the c-factor "
                "needs a positive reflectance; check the order iso, vol, geo"
            )
    return reflectance * corrections.c_factor(before, after)
