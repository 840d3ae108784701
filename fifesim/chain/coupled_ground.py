"""Ground whose reflectance depends on direction, below the light of an atmosphere: canopies and kernels."""

from functools import partial

import numpy as np
import xarray as xr

from fifesim.atmosphere import engines
from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.skylight import (
    GroundStreams,
    atmospheric_sky,
    directional_coupling,
    four_stream_coupling,
    ground_streams,
    scale_of_ground,
    weighted_sky,
)
from fifesim.base.caches import cached
from fifesim.base.surface_kernels import check_surface, surfaces_by_band
from fifesim.grids import cf, directions
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.classes import by_class
from fifesim.grids.inputs import check_reflectance
from fifesim.ground.canopy import interpolation
from fifesim.ground.canopy.labels import checked_scene, uniform_kernel
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.canopy.reflectance_table import cell_canopy, decay
from fifesim.ground.canopy.sail_model import Surface, over_background

STREAMS_OF = {
    "four-stream": ("so", "do", "sd", "dd"),
    "directional": ("so", ">o", "ao", "s>", ">>", "a>", "sa", ">a", "aa"),
}
"""Streams of a coupling: light from the sun s, an isotropic sky d, the actual sky >, or returned by the atmosphere a;
to the observer o, into all directions d, to the observer by scattering >, or back to the atmosphere a."""

# Error of a table between its nodes, of which less than a tenth is left, as these are the nodes of the final table. [1]
_TOLERANCE = 1e-5

# Backgrounds for which a table of streams is tested.
_GROUNDS = (0.0, 0.5, 1.0)


def _canopy_terms(canopy):
    """Terms of `over_background` of the four reflectances of a canopy, a Surface of arrays of shape (3, ...)."""
    c = canopy
    zero, down, up = 0 * c.rdd, c.tss + c.tsd, c.too + c.tdo
    terms = (
        (c.rso, c.tsstoo - c.tss * c.too, down * up),
        (c.rdo, zero, c.tdd * up),
        (c.rsd, zero, down * c.tdd),
        (c.rdd, zero, c.tdd**2),
    )
    return Surface(*(np.stack(np.broadcast_arrays(*each)) for each in terms))


def _scene_terms(lai, scene, skies):
    """Terms of the streams of each band, and reflectance from below, shape (band, 3 streams + 1, LAI)."""
    below = cell_canopy(lai, scene)
    if skies is None:
        found = np.stack(_canopy_terms(below), axis=0)
    else:
        bands = [_under_sky(lai, scene, number, *each) for number, each in enumerate(skies)]
        found = np.stack(bands, axis=2)
    streams, _, bands, count = found.shape
    terms = np.moveaxis(found, 2, 0).reshape(bands, 3 * streams, count)
    return np.concatenate([terms, np.broadcast_to(below.rdd_below, (bands, count))[:, None]], axis=1)


def _under_sky(lai, scene, number, sun_sky, view_sky):
    """Terms of the streams of one band, shape (streams, 3, LAI)."""
    by_band = {name: value for name, value in scene._asdict().items() if isinstance(value, tuple)}
    one = scene._replace(**{name: value[number : number + 1] for name, value in by_band.items()})

    def reflectance(sza, vza, raa):
        # The axis of one band gives way to leaf area.
        seen = cell_canopy(lai[:, None], one._replace(sza=sza[None], vza=vza[None], raa=raa[None]))
        shape = 3, lai.size, sza.size
        return Surface(*(np.broadcast_to(each, shape) for each in _canopy_terms(seen)))

    return np.stack(ground_streams(reflectance, sun_sky, view_sky, scene.sza, scene.vza, scene.raa))


def skies_of(atmosphere, bands, geometry):
    """Sky of the sun and of a sun at the sensor, by band."""
    return tuple((atmosphere, band.center, geometry.sza, geometry.vza) for band in bands)


def _of(skies):
    if skies is None:
        return None
    return [[atmospheric_sky(air, at, float(zenith)) for zenith in (sza, vza)] for air, at, sza, vza in skies]


@cached(16, "streams of canopies over leaf area")
def _stream_table(scene, skies):
    """Table of `_scene_terms` over leaf area."""
    found = _of(skies)

    def terms(lai):
        return _scene_terms(lai, scene, found).reshape(-1, lai.size)

    def over_grounds(values):
        by_band = values.reshape(len(scene.sky), -1, values.shape[1])
        return np.stack([_over(by_band, ground) for ground in _GROUNDS])

    return interpolation.tabulate(terms, decay(scene) / (scene.crown_cover or 1.0), over_grounds, _TOLERANCE)


def _over(terms, background):
    """Streams over a background, shape (stream, band, ...), from terms of shape (band, 3 streams + 1, ...)."""
    alone, hot, through = (np.moveaxis(terms[:, part:-1:3], 1, 0) for part in range(3))
    return over_background(alone, hot, through, terms[:, -1], background)


def scene_streams(lai, background, scene, skies):
    """Streams of cells, shape (stream x band,) + lai.shape, from leaf area, a background and a Scene. [1]"""
    if scene.varies():
        raise ValueError(
            "brown, dissociation or crown_cover vary by cell, streams need numbers: use coupling='lambert', or give "
            "each class its own canopy"
        )
    found = interpolation.interpolate(_stream_table(scene, skies), lai)
    by_band = found.reshape(len(scene.sky), -1, *lai.shape)
    below = np.broadcast_to(background, (len(scene.sky), *lai.shape) if np.ndim(background) > 1 else len(scene.sky))
    below = below if below.ndim > 1 else below.reshape(-1, *(1,) * lai.ndim)
    return _over(by_band, below).reshape(-1, *lai.shape)


def reflectance_streams(land, bands, canopies, light, skies, level):
    """Streams of a landscape, dims (stream, band, y, x), labelled as its level reflectance."""
    lai, names = checked_scene(land.lai), [band.name for band in bands]
    coupling = "four-stream" if skies is None else "directional"
    evaluate = partial(scene_streams, skies=skies)
    count = len(STREAMS_OF[coupling]) * len(bands)
    if land.cover is None:
        kernel, rasters = uniform_kernel(evaluate, lai, names, canopies[None], light)
        out = chunking.pointwise(kernel, lai, *rasters, bands=count)
    else:
        kernels = {code: uniform_kernel(evaluate, lai, names, stand, light) for code, stand in canopies.items()}
        out = by_class(kernels, land.cover, lai, bands=count)
    data = out.data.reshape(-1, len(bands), *out.shape[1:])
    coords = {name: each for name, each in level.coords.items() if name not in ("x", "y", "spatial_ref")}
    made = xr.DataArray(data, dims=("stream", "band", "y", "x"), coords=coords)
    made = grids.place(made.assign_coords(stream=list(STREAMS_OF[coupling])), grids.geobox(level))
    return cf.label(made, "surface_reflectance", source=level, history=f"streams: {coupling}")


def coupled(coupling, streams, terms):
    """Reflectance at the top of the atmosphere of streams (list of arrays) below BandTerms that broadcast. [1]"""
    through = _through(terms)
    if coupling == "four-stream":
        return four_stream_coupling(*streams, *through)
    return directional_coupling(GroundStreams(*streams), *through)


def _through(terms):
    """Direct and diffuse transmittances, spherical albedo, path reflectance and gas transmittance of BandTerms. [1]"""
    t, tss, too = terms, terms.direct_transmittance_down, terms.direct_transmittance_up
    fluxes = tss, t.transmittance_down - tss, too, t.transmittance_up - too
    return *fluxes, t.spherical_albedo, t.path_reflectance, t.gas_transmittance


def surface_like(toa, like, atmosphere, bands, geometry):
    """Surface reflectance factor of ground with the shape of a RossLi or RPV, dims (band, y, x). [1]"""
    terms = band_terms_of(atmosphere, bands, geometry)
    streams = surface_streams(like, "directional", atmosphere, bands, geometry)
    share = terms.diffuse_fraction
    factor = (1 - share) * streams[0] + share * streams[1]
    if not (factor > 0).all():
        raise ValueError(f"{like!r} reflects {factor.min():g} in a band, which has no shape: it must be above 0")
    by_band = [xr.Variable("band", each) for each in (factor, *streams, *_through(terms))]

    def kernel(seen, factor, *values):
        return factor * scale_of_ground(seen, GroundStreams(*values[:9]), *values[9:])

    plain = _with_bands(toa).transpose("band", "y", "x").drop_vars("band", errors="ignore")
    out = chunking.pointwise(kernel, plain, *by_band)
    names = {"band": toa.coords["band"]} if "band" in toa.coords else {}
    out = directions.with_geometry(grids.place(out, grids.geobox(toa), names), geometry)
    text = f"to_surface: {atmosphere.engine}, shape of {type(like).__name__}, {atmosphere.text}"
    return cf.label(out, "surface_reflectance", source=toa, history=text, atmosphere=atmosphere.text)


def _with_bands(raster):
    if "band" not in raster.dims:
        raise ValueError("reflectance has no dimension band: type .expand_dims('band')")
    return raster


def toa_of_streams(streams, coupling, atmosphere, bands, geometry):
    """Apparent reflectance of a raster of streams, dims (band, y, x). [1]"""
    known = [str(name) for name in streams["stream"].values] if "stream" in streams.coords else []
    coupling = coupling or ("directional" if ">>" in known else "four-stream")
    if coupling == "lambert":
        raise ValueError("coupling='lambert' takes one reflectance factor: call surface_reflectance without streams=")
    if missing := [name for name in STREAMS_OF[coupling] if name not in known]:
        cure = "'directional'" if coupling == "directional" else "True"
        raise ValueError(
            f"coupling={coupling!r} needs stream {', '.join(missing)}, the raster has "
            f"{', '.join(known) or 'no names'}: make it with surface_reflectance(..., streams={cure})"
        )
    streams, terms = _with_bands(streams), band_terms_of(atmosphere, bands, geometry)
    order = [known.index(name) for name in STREAMS_OF[coupling]]
    arrays = [streams.isel(stream=number, drop=True).transpose("band", "y", "x") for number in order]
    plain = [each.drop_vars("band", errors="ignore") for each in arrays]
    by_band = type(terms)(*(xr.Variable("band", each) for each in terms))
    count = len(plain)

    def kernel(*values):
        return coupled(coupling, [check_reflectance(each) for each in values[:count]], type(terms)(*values[count:]))

    out = chunking.pointwise(kernel, *plain, *by_band)
    names = {"band": streams.coords["band"]} if "band" in streams.coords else {}
    out = directions.with_geometry(grids.place(out, grids.geobox(arrays[0]), names), geometry)
    text = f"to_toa: {atmosphere.engine}, {coupling} coupling, {atmosphere.text}"
    return cf.label(out, "toa_reflectance", source=streams, history=text, atmosphere=atmosphere.text)


def band_terms_of(atmosphere, bands, geometry):
    """Terms of the atmosphere in each band for one direction of sun and sensor."""
    geometry = directions.uniform_geometry(geometry, "directional coupling")
    return engines.band_terms(atmosphere, tuple(bands), geometry.sza, geometry.vza, geometry.raa)


def toa_of_canopy(canopy, coupling, atmosphere, bands, geometry):
    """Apparent reflectance of an EvenCanopy in one pass over its leaf area, dims (band, y, x). [1]"""
    terms = tuple(map(tuple, band_terms_of(atmosphere, bands, geometry)))
    skies = skies_of(atmosphere, bands, geometry) if coupling == "directional" else None
    kernel = partial(_seen, background=canopy.background, scene=canopy.scene, skies=skies, terms=terms)
    return chunking.pointwise(kernel, canopy.lai, bands=len(bands))


def _seen(lai, *, background, scene, skies, terms):
    return interpolation.interpolate(_seen_table(background, scene, skies, terms), check_map(lai))


@cached(16, "reflectance of canopies below skies")
def _seen_table(background, scene, skies, terms):
    """Table of the apparent reflectance of each band over leaf area."""
    found = _of(skies)
    above = engines.BandTerms(*(np.array(each)[:, None] for each in terms))
    coupling = "four-stream" if skies is None else "directional"

    def seen(lai):
        return coupled(coupling, list(_over(_scene_terms(lai, scene, found), np.array(background)[:, None])), above)

    return interpolation.tabulate(seen, decay(scene) / (scene.crown_cover or 1.0), tolerance=_TOLERANCE)


def toa_of_surface(surface, coupling, atmosphere, bands, geometry):
    """Apparent reflectance of a RossLi or RPV, shape (band,). [1]"""
    terms = band_terms_of(atmosphere, bands, geometry)
    if coupling == "lambert":
        so, do, *_ = surface_streams(surface, "four-stream", atmosphere, bands, geometry)
        mixed = (1 - terms.diffuse_fraction) * so + terms.diffuse_fraction * do
        return apparent_reflectance(mixed, **terms.uniform)
    return coupled(coupling, surface_streams(surface, coupling, atmosphere, bands, geometry), terms)


def surface_streams(surface, coupling, atmosphere, bands, geometry):
    """Streams of a RossLi or RPV in each band, list of arrays of shape (band,). [1]"""
    check_surface(surface)
    towards, found = (geometry.sza, geometry.vza, geometry.raa), []
    for own, band in zip(surfaces_by_band(surface, len(bands)), bands, strict=True):
        if coupling == "directional":
            skies = [atmospheric_sky(atmosphere, band.center, float(zenith)) for zenith in towards[:2]]
        else:
            skies = [weighted_sky(_even, np.ones_like, zenith) for zenith in towards[:2]]
        means = ground_streams(own.reflectance, *skies, *towards)
        found.append(means if coupling == "directional" else (means[0], means[1], means[3], means[4]))
    return [np.array(each) for each in zip(*found, strict=True)]


def _even(zenith, azimuth):
    return np.ones((zenith.size, azimuth.size))
