"""Coupling of directional ground reflectance with the atmosphere, from leaf area or BRDF models."""

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from lazy import in_chunks, no_compute
from numpy.polynomial.chebyshev import chebpts1
from odc.geo.xr import wrap_xr
from oracles_atmosphere import Air, Ground, coupled_reflectance, mixed_stokes

import fifesim
from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.engines import band_terms, whole_scattering
from fifesim.atmosphere.skylight import GroundStreams, atmospheric_sky, directional_coupling, ground_streams
from fifesim.chain import coupled_ground
from fifesim.chain.coupled_ground import STREAMS_OF
from fifesim.ground.canopy.sail_model import sail, with_background

GRID = fifesim.fife_site(30 / 9, window=((0, 60), (0, 72)))
BANDS = ["TM3", "TM4"]
HAZE = fifesim.Atmosphere(visibility=10)
SLANT = fifesim.Geometry(sza=50.0, saa=120.0, vza=30.0, vaa=160.0)
GIVEN = {"instrument": "TM", "geometry": SLANT}
# Leaf reflectance and transmittance, and background, of the paper; centres of the bands [um].
LEAF, SOIL = {"TM3": (0.07, 0.04), "TM4": (0.45, 0.42)}, {"TM3": 0.15, "TM4": 0.19}
CENTRES = {"TM3": 0.66, "TM4": 0.83}
GRASS = fifesim.Canopy(leaf_optics=LEAF, background=SOIL, hotspot=0.05)
LAI = fifesim.lai_scene(GRID, seed=7)
CLASSES = [
    fifesim.CoverClass("grass", lai="burned-grazed"),
    fifesim.CoverClass("dry", lai=1.0, canopy=fifesim.Canopy(brown=0.4)),
]
RPV = fifesim.ground.RPV(0.1, 0.75, -0.1, 0.2)


def ground(lai=LAI, streams=False, canopy=GRASS, **terrain):
    given = {"canopy": canopy, "atmosphere": HAZE, "geometry": SLANT}
    return lai.fifesim.surface_reflectance("TM", bands=BANDS, streams=streams, **given, **terrain)


@pytest.fixture(scope="module")
def streams():
    """Streams that each coupling needs."""
    return {"directional": ground(streams="directional"), "four-stream": ground(streams=True)}


def haze_terms(names=BANDS):
    return band_terms(HAZE, [b.response for b in fifesim.instrument("TM").select(names)], 50.0, 30.0, SLANT.raa)


def coupled(streams):
    """`directional_coupling` of streams with dimension band and the haze."""
    terms = haze_terms()
    down, up = terms.direct_transmittance_down, terms.direct_transmittance_up
    through = down, terms.transmittance_down - down, up, terms.transmittance_up - up, terms.spherical_albedo
    return directional_coupling(streams, *through, terms.path_reflectance, terms.gas_transmittance)


def leaves(name, lai):
    """Function of sza, vza and raa that gives the reflectances of a canopy in one band."""

    def seen(sza, vza, raa):
        return with_background(sail(lai, *LEAF[name], sza=sza, vza=vza, raa=raa, hotspot=0.05), SOIL[name])

    return seen


def ndvi(red, infrared):
    return (infrared - red) / (infrared + red)


# ------------------------------------------------------------------------------------------ sums over the sky


def air_of(visibility, wavelength, sza, vza):
    air, at = fifesim.Atmosphere(visibility=visibility), np.array([wavelength])
    terms = whole_scattering(air, at, sza, np.array([vza]), np.zeros(1))
    path, down, up, albedo = (float(np.squeeze(each)) for each in terms)
    tau = float(air.rayleigh_optical_depth(at)[0] + air.aerosol_optical_depth(at)[0])
    direct = (np.exp(-tau / np.cos(np.radians(zenith))) for zenith in (sza, vza))
    sky = cache(lambda *given: mixed_stokes(air, at, *map(np.array, given), at_ground=True)[0, ..., 0])
    return Air(path, down, up, *direct, albedo, lambda sun, *place: sky(sun, *map(tuple, place)))


def summed(air, seen, sza, vza):
    """Apparent reflectance of a canopy by `coupled_reflectance`, the sum over all directions."""
    around = (
        lambda *angles: seen(*angles).rso,
        lambda zenith: seen(30.0, zenith, 0.0).rdo,
        lambda zenith: seen(zenith, 0.0, 0.0).rsd,
    )
    return float(np.squeeze(coupled_reflectance(air, Ground(*around, float(seen(30.0, 0.0, 0.0).rdd)), sza, vza, 0.0)))


@pytest.mark.parametrize(("visibility", "sza", "vza"), [(45.0, 28.5, 0.0), (10.0, 60.0, 45.0)])
def test_directional_coupling_agrees_with_the_sum_over_the_sky(visibility, sza, vza):
    """A canopy with a hot spot, in both bands and in NDVI."""
    air, found = fifesim.Atmosphere(visibility=visibility), []
    for name, wavelength in CENTRES.items():
        above, seen = air_of(visibility, wavelength, sza, vza), leaves(name, 1.0)
        skies = (atmospheric_sky(air, wavelength, zenith) for zenith in (sza, vza))
        directional = ground_streams(seen, *skies, sza, vza, 0.0)
        direct, out = above.direct_down, above.direct_up
        through = direct, above.down - direct, out, above.up - out, above.albedo, above.path
        found.append((summed(above, seen, sza, vza), float(directional_coupling(directional, *through))))
    exact, coupling = np.transpose(found)
    np.testing.assert_allclose(coupling, exact, rtol=1e-3)
    assert ndvi(*coupling) == pytest.approx(ndvi(*exact), abs=5e-4)


def test_cells_agree_with_one_canopy_below_its_sky(streams):
    """Expected values from SAIL at the leaf area of a cell, without the table, by each coupling but four-stream."""
    terms, directional, factor = haze_terms(), [], []
    for name, band in zip(BANDS, fifesim.instrument("TM").select(BANDS), strict=True):
        seen = leaves(name, float(LAI[3, 4]))
        skies = [atmospheric_sky(HAZE, band.response.center, zenith) for zenith in (SLANT.sza, SLANT.vza)]
        directional.append(ground_streams(seen, *skies, SLANT.sza, SLANT.vza, SLANT.raa))
        light = seen(SLANT.sza, SLANT.vza, SLANT.raa)
        factor.append([light.rso, light.rdo])
    expected = coupled(GroundStreams(*np.array(directional).T))
    np.testing.assert_allclose(streams["directional"].fifesim.to_toa()[:, 3, 4], expected, rtol=0, atol=2e-6)
    direct, diffuse = np.transpose(factor)
    sky = 1 - terms.direct_transmittance_down / terms.transmittance_down
    expected = apparent_reflectance((1 - sky) * direct + sky * diffuse, **terms.uniform)
    np.testing.assert_allclose(ground().fifesim.to_toa()[:, 3, 4], expected, rtol=0, atol=2e-6)


# ------------------------------------------------------------------------------------------ canopies


@pytest.mark.parametrize("coupling", ["directional", "four-stream"])
def test_one_pass_equals_streams_and_coupling(streams, coupling):
    """Equal streams are Lambertian, also with adjacency and a bright environment."""
    whole, lazy = streams[coupling], LAI.chunk(y=31, x=29)
    assert tuple(whole.stream.values) == STREAMS_OF[coupling] and whole.dims == ("stream", "band", "y", "x")
    toa = whole.fifesim.to_toa()
    with no_compute():
        once = ground(lazy).fifesim.to_toa(coupling=coupling)
        parts = ground(lazy, streams=coupling if coupling == "directional" else True).fifesim.to_toa()
    np.testing.assert_allclose(once.compute(), toa, rtol=0, atol=1e-6)
    xr.testing.assert_allclose(parts.compute(), toa, rtol=1e-12)
    assert f"{coupling} coupling" in once.history and f"{coupling} coupling" in toa.history
    even = ground().expand_dims(stream=list(STREAMS_OF[coupling]))
    for given in ({}, {"adjacency": True}, {"adjacency": True, "surroundings": [0.05, 0.3]}):
        expected = ground().fifesim.to_toa(**given)
        np.testing.assert_allclose(even.fifesim.to_toa(**given), expected, rtol=1e-9 if given else 1e-12)
    single = whole.isel(band=0).expand_dims("band").fifesim.to_toa()
    np.testing.assert_allclose(single, toa.isel(band=[0]), rtol=1e-12)


NODES = (1 - (chebpts1(2) / 2 + 0.5)).tolist()


@pytest.mark.parametrize(
    ("name", "values", "which", "limits"),
    [
        ("background", (0.15, 0.25), "directional", {"rtol": 1e-12}),
        ("brown", (0.15, 0.6), True, {"rtol": 0, "atol": 2e-5}),
        ("crown_cover", (0.4, 0.8), True, {"rtol": 0, "atol": 2e-5}),
        ("brown", NODES, "directional", {"rtol": 0, "atol": 1e-8}),
    ],
)
def test_streams_of_a_varying_property_equal_uniform_scenes(monkeypatch, name, values, which, limits):
    """The table of directional streams has two nodes here, where it is exact."""
    if values is NODES:
        monkeypatch.setitem(coupled_ground._SHARES, "brown", 2)
    canopy = GRASS.replace(**{"brown": {"brown_leaf": (0.2, 0.1)}, "crown_cover": {"crown_shape": 0.5}}.get(name, {}))
    sides = LAI.copy(data=np.where(np.arange(72) < 36, *values) * np.ones((60, 1))).drop_attrs()
    both = ground(streams=which, canopy=canopy.replace(**{name: sides}))
    for value, part in zip(values, (slice(0, 36), slice(36, 72)), strict=True):
        one = ground(streams=which, canopy=canopy.replace(**{name: value}))
        np.testing.assert_allclose(both[..., part], one[..., part], **limits)


def test_adjacency_affects_only_the_streams_into_the_sky(streams):
    """
    A dark cell in a uniform bright scene: streams to the view are from the cell, streams to the sky from the scene.
    """
    one = ground(1.5 + 0 * LAI, streams="directional").load()
    np.testing.assert_allclose(one.fifesim.to_toa(adjacency=True), one.fifesim.to_toa(), rtol=1e-12)
    bright, dark = one.isel(y=0, x=0).values, one.copy()
    dark[..., 30, 36] *= 0.5
    found = dark.fifesim.to_toa(adjacency=True).values[:, 30, 36]
    np.testing.assert_allclose(found, coupled(GroundStreams(*(0.5 * bright[:3]), *bright[3:])), rtol=2e-3)
    assert abs(found / coupled(GroundStreams(*(0.5 * bright))) - 1).min() > 0.01
    with no_compute():
        lazy = ground(LAI.chunk(y=31, x=29), streams="directional").fifesim.to_toa(adjacency=True)
    expected = streams["directional"].fifesim.to_toa(adjacency=True)
    np.testing.assert_allclose(lazy.compute(), expected, rtol=1e-12)


@pytest.mark.parametrize("slopes", ["kt", "upright"])
def test_streams_of_slopes_are_scaled_like_the_reflectance_factor(streams, slopes):
    dem = fifesim.flint_hills(GRID, seed=7)
    on_slopes = ground(streams="directional", dem=dem, slopes=slopes)
    ratio = ground(dem=dem, slopes=slopes) / ground()
    np.testing.assert_allclose(on_slopes, streams["directional"] * ratio, rtol=1e-12)
    assert "terrain" in on_slopes.history and on_slopes.dims == ("stream", "band", "y", "x")


@pytest.mark.parametrize("coupling", ["directional", "four-stream"])
def test_setup_equals_the_steps(coupling):
    """Hills, classes, adjacency and clouds together, and a flat scene that is coupled in one pass."""
    land = fifesim.landscape(GRID, cover=fifesim.ground.Patches("voronoi", 60), classes=CLASSES, seed=3)
    sky = fifesim.cloud_field(GRID, 0.5, seed=1, margin=3000)
    own = {"atmosphere": HAZE, "geometry": SLANT, "bands": BANDS, "dem": fifesim.flint_hills(GRID, seed=7)}
    setup = fifesim.Setup(coupling=coupling, slopes="kt", adjacency=True, clouds=sky, **own)
    image = land.fifesim.compare(["TM"], setup, bands={"TM": BANDS})["TM"]["dn"]
    streams = land.fifesim.surface_reflectance("TM", streams=True if coupling == "four-stream" else coupling, **own)
    cast = fifesim.atmosphere.cast_clouds(streams.isel(stream=0, drop=True), sky, dem=own["dem"])
    expected = streams.fifesim.to_toa(adjacency=True, clouds=cast).fifesim.sense("TM")
    np.testing.assert_array_equal(image, expected)
    plain = fifesim.Setup(coupling=coupling, bands=BANDS, atmosphere=HAZE, geometry=SLANT)
    lazy = LAI.chunk(y=31).fifesim.compare(["TM"], plain, bands={"TM": BANDS})["TM"]["dn"]
    assert int(abs(lazy.astype(int) - LAI.fifesim.compare(["TM"], plain, bands={"TM": BANDS})["TM"]["dn"]).max()) <= 1


@pytest.mark.parametrize("lazy", [False, True])
def test_to_surface_inverts_with_the_shape_of_a_canopy(lazy):
    """The reflectance factor of every cell is recovered; a single reflectance factor has errors up to 2 %."""
    factor, toa = ground(), ground(streams="directional").fifesim.to_toa()
    seen = in_chunks(toa, {"y": 31}) if lazy else toa
    with no_compute():
        found = seen.fifesim.to_surface(like=GRASS)
    np.testing.assert_allclose(found, factor, rtol=2e-5)
    assert abs(toa.fifesim.to_surface() / factor - 1).max() > 0.005
    assert "shape of Canopy" in found.history
    # Ground that is brighter than the canopy in both bands keeps the shape.
    bright = 1.1 * ground(streams="directional")
    bright = bright.assign_attrs(factor.attrs).fifesim.to_toa().fifesim.to_surface(like=GRASS)
    np.testing.assert_allclose(bright, 1.1 * factor, rtol=0.02)
    hole = toa.where(toa.x != toa.x[3])
    assert np.isnan(hole.fifesim.to_surface(like=GRASS)[:, :, 3]).all()


# ------------------------------------------------------------------------------------------ BRDF models


@pytest.mark.parametrize(
    "surface", [fifesim.ground.RossLi(0.3, 0.0, 0.0), fifesim.ground.RPV([0.1] * 6, 1.0, 0.0, 1.0)]
)
@pytest.mark.parametrize("coupling", ["directional", "four-stream", "lambert"])
def test_lambertian_surfaces_agree_with_the_uniform_equation(surface, coupling):
    rho = float(np.ravel(surface.reflectance(0.0, 0.0, 0.0))[0])
    toa = fifesim.to_toa(surface, HAZE, coupling=coupling, **GIVEN)
    np.testing.assert_allclose(toa, apparent_reflectance(rho, **haze_terms(None).uniform), rtol=1e-12)


def test_to_surface_inverts_with_the_shape_of_the_ground():
    """
    Every cell is a multiple of one RPV surface; the ratios of its reflectance factors under sun and sky are recovered.
    """
    factor = np.array([[0.5, 1.0], [2.0, 3.0]])
    grid = fifesim.grid_at("EPSG:26914", west=705000, north=4334000, width=20, height=20, cell=10)
    image = fifesim.to_toa(replace(RPV, rho0=wrap_xr(0.1 * factor, grid)), HAZE, **GIVEN)
    found = image.fifesim.to_surface(HAZE, like=RPV, **GIVEN)
    ratio = found.values / found.values[:, :1, 1:]
    np.testing.assert_allclose(ratio, np.broadcast_to(factor, found.shape), rtol=1e-9)
    direct = float(RPV.reflectance(SLANT.sza, SLANT.vza, SLANT.raa))
    assert float(found[3, 0, 1]) == pytest.approx(direct, rel=0.1)
    lambertian = fifesim.ground.RPV(0.2, 1.0, 0.0, 1.0)
    even = image.fifesim.to_surface(HAZE, like=lambertian, **GIVEN)
    np.testing.assert_allclose(even, image.fifesim.to_surface(HAZE, **GIVEN), rtol=1e-9)


@pytest.mark.parametrize("surface", [fifesim.ground.RossLi(0.3, 0.1, 0.02), RPV])
def test_rasters_of_brdf_parameters_agree_with_numbers(surface):
    """
    Cells and bands agree with uniform surfaces, also lazily and with NaN; adjacency changes TOA reflectance by 0.1 to
    20 %.
    """
    first, *others = (each.name for each in fields(surface))
    value = getattr(surface, first)
    by_cell = xr.where(np.arange(72) < 36, value, 0.8 * value) + 0 * LAI.drop_attrs()
    by_cell = by_cell.where(LAI[0, 0] != LAI).transpose("y", "x").odc.assign_crs(GRID.crs)
    by_band = xr.concat([by_cell, 0.9 * by_cell], "band").assign_coords(band=BANDS)
    # All weights scale a Ross-Li surface; the first parameter scales RPV.
    scaled = [first] if surface is RPV else [first, *others]
    shape = {name: by_band / value * getattr(surface, name) for name in scaled}
    raster = replace(surface, **shape)
    toa = fifesim.to_toa(raster, HAZE, **GIVEN)
    assert toa.dims == ("band", "y", "x") and toa.band.values.tolist() == BANDS and np.isnan(toa[:, 0, 0]).all()
    for coupling in ("directional", "four-stream", "lambert"):
        found = fifesim.to_toa(raster, HAZE, coupling=coupling, **GIVEN)
        for column, factor in ((1, 1.0), (40, 0.8)):
            for name, share in zip(BANDS, (1, 0.9), strict=True):
                one = replace(surface, **{key: factor * share * getattr(surface, key) for key in scaled})
                expected = fifesim.to_toa(one, HAZE, coupling=coupling, **GIVEN).sel(band=name)
                assert float(found.sel(band=name)[5, column]) == pytest.approx(float(expected), rel=1e-12)
    lazy = replace(surface, **{name: each.chunk(y=31) for name, each in shape.items()})
    with no_compute():
        lazy = fifesim.to_toa(lazy, HAZE, **GIVEN)
    np.testing.assert_allclose(lazy.compute(), toa, rtol=1e-12)
    half = replace(raster, **{name: 0.5 * each for name, each in shape.items()})
    found = toa.fifesim.to_surface(like=raster)
    np.testing.assert_allclose(toa.fifesim.to_surface(like=half), found, rtol=1e-9)
    near = fifesim.to_toa(raster, HAZE, adjacency=True, **GIVEN)
    assert 0.001 < abs(near / toa - 1).max() < 0.2
