"""Ground whose reflectance depends on direction, below the light of an atmosphere: streams, and their coupling."""

from dataclasses import fields
from functools import partial

import numpy as np
import xarray as xr
from numpy.polynomial import chebyshev
from scipy.spatial import cKDTree

from fifesim.atmosphere import adjacency_labels, engines
from fifesim.atmosphere.adjacency import environment_weights
from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.labels import EQUATION_SOURCE
from fifesim.atmosphere.skylight import (
    GroundStreams,
    atmospheric_sky,
    directional_coupling,
    ground_streams,
    scale_of_ground,
    weighted_sky,
)
from fifesim.base.caches import cached
from fifesim.base.surface_kernels import RPV, RossLi, check_surface, parameters_by_band
from fifesim.grids import cf, directions
from fifesim.grids import chunks as chunking
from fifesim.grids import grid as grids
from fifesim.grids.classes import by_class
from fifesim.grids.inputs import check_reflectance
from fifesim.grids.windows import origin_of
from fifesim.ground.canopy import interpolation
from fifesim.ground.canopy.crowns import lai_in_crowns
from fifesim.ground.canopy.labels import CELL_SHARES, EvenCanopy, checked_scene, uniform_kernel
from fifesim.ground.canopy.leaf_area import check_map
from fifesim.ground.canopy.reflectance_table import cell_canopy, check_cells, decay
from fifesim.ground.canopy.sail_model import Surface, over_background

STREAMS_OF = {
    "four-stream": ("so", "do", "sd", "dd"),
    "directional": ("so", ">o", "ao", "s>", ">>", "a>", "sa", ">a", "aa"),
}
"""Streams of a coupling: light from the sun s, an isotropic sky d, the actual sky >, or returned by the atmosphere a;
to the observer o, into all directions d, to the observer by scattering >, or back to the atmosphere a."""

# Error of a table between its nodes, of which less than a tenth is left, as these are the nodes of the final table. [1]
# The hot spot is less smooth toward leaf areas of 100, in the last intervals, which are not tested.
_TOLERANCE, _TESTED = 1e-5, slice(None, -3)

# Leaf areas among which the one of a cell is found, denser for thin canopies. [m2 m-2]
_LEAF_AREAS = 8.0 * (np.arange(1025) / 1024) ** 2

# Number of tables over shares between which streams are interpolated: within 5e-5 for crowns, 1e-7 for dead leaves.
_SHARES = {"brown": 9, "crown_cover": 17}

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
        return np.stack([_over(by_band, ground) for ground in _GROUNDS])[..., _TESTED]

    return interpolation.tabulate(terms, decay(scene) / (scene.crown_cover or 1.0), over_grounds, _TOLERANCE)


def _over(terms, background):
    """Streams over a background, shape (stream, band, ...), from terms of shape (band, 3 streams + 1, ...)."""
    alone, hot, through = (np.moveaxis(terms[:, part:-1:3], 1, 0) for part in range(3))
    return over_background(alone, hot, through, terms[:, -1], background)


def scene_streams(lai, background, scene, skies):
    """Streams of cells, shape (stream x band,) + lai.shape, from leaf area, a background and a Scene. [1]"""
    if scene.varies():
        return _varied_streams(lai, background, scene, skies)
    return streams_over_background(lai, background, scene, skies).reshape(-1, *lai.shape)


def streams_over_background(lai, background, scene, skies):
    """Streams of cells from the table of a scene, shape (stream, band) + lai.shape."""
    found = interpolation.interpolate(_stream_table(scene, skies), lai)
    by_band = found.reshape(len(scene.sky), -1, *lai.shape)
    below = np.broadcast_to(background, (len(scene.sky), *lai.shape) if np.ndim(background) > 1 else len(scene.sky))
    below = below if below.ndim > 1 else below.reshape(-1, *(1,) * lai.ndim)
    return _over(by_band, below)


def _varied_streams(lai, background, scene, skies):
    """`scene_streams` where the dead share or the crown cover varies by cell: polynomials between tables."""
    names = [name for name in CELL_SHARES if isinstance(getattr(scene, name), np.ndarray)]
    if len(names) > 1 or names == ["dissociation"]:
        raise ValueError(
            f"{' and '.join(names)} vary by cell, streams need numbers but for one of brown and crown_cover: use "
            "coupling='lambert', or give each class its own canopy"
        )
    (name,), cells, bands = names, lai.reshape(-1), len(scene.sky)
    ground = np.broadcast_to(np.reshape(background, (bands, -1)), (bands, cells.size))
    check_cells(cells, ground, scene)
    # In the fourth root of the gap fraction, powers of the gap fraction have no kink.
    power, count = 4 if name == "crown_cover" else 1, _SHARES[name]
    nodes = chebyshev.chebpts1(count)
    at_nodes, at_cells = (
        chebyshev.chebvander(each, count - 1) for each in (nodes, 2 * (1 - getattr(scene, name)) ** (1 / power) - 1)
    )
    weights = np.linalg.solve(at_nodes.T, at_cells.T)
    inside, out = lai_in_crowns(cells, scene.crown_cover), 0.0
    for node, weight in zip((nodes / 2 + 0.5).tolist(), weights, strict=True):
        own = scene._replace(**{name: 1 - node**power})
        out = out + weight * streams_over_background(inside * own.crown_cover, ground, own, skies)
    return out.reshape(-1, *lai.shape)


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


def is_one_pass(reflectance):
    """Whether a lazy reflectance can be coupled in one pass, because its cells differ in leaf area only."""
    return isinstance(origin_of(reflectance), EvenCanopy)


def scaled_to_slopes(streams, level, reflectance):
    """Streams scaled from the reflectance of level ground to the reflectance of slopes, dims (stream, band, y, x)."""
    ratio = xr.where(level == 0, 1 + 0 * reflectance, reflectance / level)
    made = (streams * ratio).transpose(*streams.dims)
    lines = [line for line in reflectance.attrs["history"].split("\n") if line.startswith("terrain")]
    return cf.label(made, "surface_reflectance", source=streams, history=lines[-1])


def coupled(coupling, streams, terms, around=()):
    """Reflectance at the top of the atmosphere of streams (arrays) below BandTerms, with those of surroundings. [1]"""
    ground = _ground(coupling, *streams)
    around = _ground(coupling, *streams[: -len(around)], *around) if around else None
    return directional_coupling(ground, *through_air(terms), around=around)


def _ground(coupling, *streams):
    if coupling == "directional":
        return GroundStreams(*streams)
    so, do, sd, dd = streams
    return GroundStreams(so, do, do, sd, dd, dd, sd, dd, dd)


def through_air(terms):
    """Direct and diffuse transmittances, spherical albedo, path reflectance and gas transmittance of BandTerms. [1]"""
    t, tss, too = terms, terms.direct_transmittance_down, terms.direct_transmittance_up
    fluxes = tss, t.transmittance_down - tss, too, t.transmittance_up - too
    return *fluxes, t.spherical_albedo, t.path_reflectance, t.gas_transmittance


def with_bands(raster):
    """Raster with bands, checked."""
    if "band" not in raster.dims:
        raise ValueError("reflectance has no dimension band: type .expand_dims('band')")
    return raster


def toa_of_streams(streams, coupling, atmosphere, bands, geometry, adjacency=False, surroundings=None):
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
    terms, names = band_terms_of(atmosphere, bands, geometry), STREAMS_OF[coupling]
    streams = with_bands(streams).isel(stream=[known.index(name) for name in names])
    around = _means_around(_layers(streams), names, terms, geometry.vza, surroundings) if adjacency else []
    arrays = _layers(chunking.second_pass(streams, around[0].data) if around else streams)
    by_band = [xr.Variable("band", each) for each in terms]

    def kernel(*values):
        ground, values = [check_reflectance(each) for each in values[: len(names)]], values[len(names) :]
        return coupled(coupling, ground, type(terms)(*values[len(around) :]), values[: len(around)])

    out = chunking.pointwise(kernel, *arrays, *around, *by_band)
    bands_of = {"band": streams.coords["band"]} if "band" in streams.coords else {}
    out = directions.with_geometry(grids.place(out, grids.geobox(streams), bands_of), geometry)
    how = f"{atmosphere.engine}{' with adjacency' if adjacency else ''}, {atmosphere.text}, {coupling} coupling"
    attrs = {"atmosphere": atmosphere.text, "references": EQUATION_SOURCE}
    return cf.label(out, "toa_reflectance", source=streams, history=f"to_toa: {how}", **attrs)


def _layers(streams):
    """Streams of a raster, dims (band, y, x), without names of bands."""
    count = streams.sizes["stream"]
    plain = streams.drop_vars("band", errors="ignore").transpose("stream", "band", "y", "x")
    return [plain.isel(stream=number, drop=True) for number in range(count)]


def _means_around(layers, names, terms, vza, surroundings):
    """Means around each cell, as blurred by the atmosphere, of streams that do not lead to the view."""
    outward = [each for each, name in zip(layers, names, strict=True) if not name.endswith("o")]
    count, bands = len(outward), outward[0].sizes["band"]
    if isinstance(surroundings, xr.DataArray) and "band" in surroundings.dims:
        surroundings = xr.concat([surroundings.drop_vars("band", errors="ignore")] * count, "band")
    elif np.ndim(surroundings) == 1:
        surroundings = np.tile(surroundings, count)
    weights = environment_weights(terms.diffuse_up_molecules, terms.diffuse_up_aerosol)
    weights = (np.tile(np.broadcast_to(each, bands), count) for each in weights)
    means = adjacency_labels.environment(xr.concat(outward, "band"), *weights, vza, surroundings=surroundings)
    return [means.isel(band=slice(first, first + bands)) for first in range(0, count * bands, bands)]


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

    def tested(values):
        return values[:, _TESTED]

    return interpolation.tabulate(seen, decay(scene) / (scene.crown_cover or 1.0), tested, _TOLERANCE)


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
        above = through_air(engines.BandTerms(*(np.array(each)[:, None] for each in canopy["terms"])))
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
    toa = coupled("directional", list(streams), engines.BandTerms(*(np.array(each)[:, None] for each in terms)))
    sky = np.array(scene.sky)[:, None]
    # The air_view stream of a canopy is its reflectance under an isotropic sky.
    factor = (1 - sky) * streams[0] + sky * streams[2]
    return toa, np.concatenate([factor[None], streams]), cKDTree(toa.T)
