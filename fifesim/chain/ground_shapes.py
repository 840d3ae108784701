"""Ground of a known directional shape: the streams of kernels, and surface reflectance with the shape of a ground."""

from dataclasses import fields
from functools import partial

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.engines import BandTerms
from fifesim.atmosphere.skylight import (
    GroundStreams,
    atmospheric_sky,
    ground_streams,
    scale_of_ground,
    weighted_sky,
)
from fifesim.base.caches import cached
from fifesim.base.surface_kernels import RPV, RossLi, check_surface, parameters_by_band
from fifesim.chain.coupled_ground import (
    STREAMS_OF,
    band_terms_of,
    coupled,
    skies_of,
    streams_over_background,
    through_air,
    with_bands,
)
from fifesim.grids import cf, directions
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids

# Leaf areas among which the one of a cell is found, denser for thin canopies. [m2 m-2]
_LEAF_AREAS = 8.0 * (np.arange(1025) / 1024) ** 2


def rasters_of(surface):
    """Parameters of a RossLi or RPV that are rasters over (y, x)."""
    values = [getattr(surface, each.name) for each in fields(surface)]
    return [each for each in values if isinstance(each, xr.DataArray) and {"y", "x"} <= set(each.dims)]


def kernel_streams(surface, coupling, atmosphere, bands, geometry):
    """Streams of a RossLi or RPV, list of arrays of shape (band,), or of rasters, dims (band, y, x). [1]"""
    towards = geometry.sza, geometry.vza, geometry.raa
    skies = skies_of(atmosphere, bands, geometry) if coupling == "directional" else (None,) * len(bands)
    kernel = partial(_kernel_block, kind=type(surface), coupling=coupling, towards=towards, skies=skies)
    count, size = len(STREAMS_OF[coupling]), len(bands)
    if not rasters_of(surface):
        check_surface(surface)
        return list(kernel(*parameters_by_band(surface, size)).reshape(count, size))
    values = [getattr(surface, each.name) for each in fields(surface)]
    out = chunking.pointwise(kernel, *(_with_bands_of(each, size) for each in values), bands=count * size)
    return [out.isel(band=slice(first, first + size)) for first in range(0, count * size, size)]


def _with_bands_of(value, size):
    """Parameter with one layer for each band."""
    if not isinstance(value, xr.DataArray):
        return xr.Variable("band", np.broadcast_to(np.asarray(value, float), size))
    plain = value.drop_vars("band", errors="ignore")
    return plain if "band" in plain.dims else plain.expand_dims(band=size)


def _kernel_block(*parameters, kind, coupling, towards, skies):
    """Streams of kernels, shape (stream x band, ...), from parameters that broadcast to shape (..., band)."""
    values = np.stack(np.broadcast_arrays(*(np.asarray(each, float) for each in parameters)))
    cells = values.reshape(len(values), -1, len(skies))
    out = np.full((len(STREAMS_OF[coupling]), len(skies), cells.shape[1]), np.nan)
    for band, sky in enumerate(skies):
        known = np.isfinite(cells[:, :, band]).all(axis=0)
        if not known.any():
            continue
        given = cells[:, known, band]
        check_surface(kind(*given))
        # Streams are linear in the weights of kernels and in the amplitude of RPV.
        if kind is RossLi:
            units = [_means(RossLi(*row), coupling, towards, sky) for row in np.eye(3)]
            out[:, band, known] = np.transpose(units) @ given
        else:
            shapes, number = np.unique(given[1:], axis=1, return_inverse=True)
            means = [_means(RPV(1.0, *row), coupling, towards, sky) for row in shapes.T]
            out[:, band, known] = given[0] * np.transpose(means)[:, number.ravel()]
    return out.reshape(-1, *values.shape[1:-1])


def _means(surface, coupling, towards, sky):
    """Streams of a surface of numbers below one sky, or an isotropic one."""
    if coupling == "directional":
        air, at, *zeniths = sky
        pair = [atmospheric_sky(air, at, float(zenith)) for zenith in zeniths]
        return ground_streams(surface.reflectance, *pair, *towards)
    pair = [weighted_sky(_even, np.ones_like, zenith) for zenith in towards[:2]]
    means = ground_streams(surface.reflectance, *pair, *towards)
    return means.sun_view, means.sky_view, means.sun_sky, means.sky_sky


def _even(zenith, azimuth):
    return np.ones((zenith.size, azimuth.size))


def toa_of_surface(surface, coupling, atmosphere, bands, geometry):
    """Apparent reflectance of a RossLi or RPV of numbers, shape (band,). [1]"""
    terms = band_terms_of(atmosphere, bands, geometry)
    if coupling == "lambert":
        so, do, *_ = kernel_streams(surface, "four-stream", atmosphere, bands, geometry)
        mixed = (1 - terms.diffuse_fraction) * so + terms.diffuse_fraction * do
        return apparent_reflectance(mixed, **terms.uniform)
    return coupled(coupling, kernel_streams(surface, coupling, atmosphere, bands, geometry), terms)


def surface_raster(surface, coupling, atmosphere, bands, geometry):
    """Streams of a RossLi or RPV of rasters, dims (stream, band, y, x), or its reflectance factor for "lambert". [1]"""
    responses, names = [each.response for each in bands], STREAMS_OF.get(coupling)
    streams = kernel_streams(surface, coupling if names else "four-stream", atmosphere, responses, geometry)
    along = {"band": [each.name for each in bands], "wavelength": [each.wavelength for each in bands]}
    coords = cf.band_coordinates(**along) | directions.coordinates_of(geometry)
    if names:
        made = xr.concat(streams, "stream").assign_coords(stream=list(names)).transpose("stream", "band", "y", "x")
    else:
        share = xr.DataArray(band_terms_of(atmosphere, responses, geometry).diffuse_fraction, dims="band")
        made = ((1 - share) * streams[0] + share * streams[1]).transpose("band", "y", "x")
    made = grids.place(made.assign_coords(coords), grids.geobox(rasters_of(surface)[0]))
    history = f"surface: {type(surface).__name__}, {coupling}"
    return cf.label(made, "surface_reflectance", history=history, atmosphere=atmosphere.text)


def surface_like(toa, like, atmosphere, bands, geometry):
    """Surface reflectance factor of ground with the shape of a RossLi or RPV, dims (band, y, x). [1]"""
    terms = band_terms_of(atmosphere, bands, geometry)
    streams = kernel_streams(like, "directional", atmosphere, bands, geometry)
    values = (*streams, terms.diffuse_fraction, *through_air(terms))
    arrays = [each if isinstance(each, xr.DataArray) else xr.Variable("band", each) for each in values]

    def kernel(seen, *values):
        ground, share = GroundStreams(*values[:9]), values[9]
        factor = (1 - share) * ground.sun_view + share * ground.sky_view
        if (factor <= 0).any():
            raise ValueError(f"{like!r} reflects {np.nanmin(factor):g}, which has no shape: it must be above 0")
        return factor * scale_of_ground(seen, ground, *values[10:])

    out = chunking.pointwise(kernel, _plain(toa), *arrays)
    return _labelled(out, toa, type(like).__name__, atmosphere, geometry)


def surface_like_canopy(toa, canopy, atmosphere, bands, geometry):
    """Surface reflectance factor of ground with the shape of an EvenCanopy, dims (band, y, x). [1]"""
    terms = tuple(map(tuple, band_terms_of(atmosphere, bands, geometry)))
    given = {"background": canopy.background, "scene": canopy.scene, "skies": skies_of(atmosphere, bands, geometry)}
    out = chunking.pointwise(partial(_like_canopy, **given, terms=terms), _plain(toa), bands=len(bands))
    return _labelled(out, toa, "Canopy", atmosphere, geometry)


def _plain(toa):
    return with_bands(toa).transpose("band", "y", "x").drop_vars("band", errors="ignore")


def _labelled(out, toa, shape, atmosphere, geometry):
    names = {"band": toa.coords["band"]} if "band" in toa.coords else {}
    out = directions.with_geometry(grids.place(out, grids.geobox(toa), names), geometry)
    text = f"to_surface: {atmosphere.engine}, shape of {shape}, {atmosphere.text}"
    return cf.label(out, "surface_reflectance", source=toa, history=text, atmosphere=atmosphere.text)


def _like_canopy(seen, **canopy):
    """Reflectance factor of cells, shape (band, ...), from apparent reflectance, shape (..., band)."""
    toa, values, tree = _shapes(**canopy)
    cells, out = seen.reshape(-1, len(toa)), np.full((len(toa), seen[..., 0].size), np.nan)
    known = np.isfinite(cells).all(axis=1)
    if known.any():
        near, share = _nearest(toa, tree, cells[known])
        own = (1 - share) * values[..., near] + share * values[..., near + 1]
        above = through_air(BandTerms(*(np.array(each)[:, None] for each in canopy["terms"])))
        out[:, known] = own[0] * scale_of_ground(cells[known].T, GroundStreams(*own[1:]), *above)
    return out.reshape(-1, *seen.shape[:-1])


def _nearest(curve, tree, cells):
    """Segment of a curve over leaf area, shape (band, n), that is nearest to cells, and the place along it, 0 to 1."""
    node = tree.query(cells)[1]
    found = []
    for start in (np.maximum(node - 1, 0), np.minimum(node, curve.shape[1] - 2)):
        along, away = curve[:, start + 1] - curve[:, start], cells.T - curve[:, start]
        share = np.clip((along * away).sum(axis=0) / np.maximum((along**2).sum(axis=0), 1e-300), 0, 1)
        found.append((start, share, ((away - share * along) ** 2).sum(axis=0)))
    (before, share, near), (behind, other, far) = found
    return np.where(near <= far, before, behind), np.where(near <= far, share, other)


@cached(16, "shapes of canopies over leaf area")
def _shapes(background, scene, skies, terms):
    """Apparent reflectance, shape (band, n), of leaf areas; factor and streams, shape (10, band, n); and a search."""
    lai = _LEAF_AREAS * scene.crown_cover
    streams = streams_over_background(lai, np.array(background), scene, skies)
    toa = coupled("directional", list(streams), BandTerms(*(np.array(each)[:, None] for each in terms)))
    sky = np.array(scene.sky)[:, None]
    # The air_view stream of a canopy is its reflectance under an isotropic sky.
    factor = (1 - sky) * streams[0] + sky * streams[2]
    return toa, np.concatenate([factor[None], streams]), cKDTree(toa.T)
