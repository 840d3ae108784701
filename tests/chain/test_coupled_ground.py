"""Coupling of directional ground reflectance with the atmosphere, from leaf area or BRDF models."""

from dataclasses import fields, replace

import numpy as np
import pytest
import xarray as xr
from lazy import in_chunks, no_compute
from numpy.polynomial.chebyshev import chebpts1
from odc.geo.xr import wrap_xr

import fifesim
from fifesim.atmosphere.coupling import apparent_reflectance
from fifesim.atmosphere.engines import band_terms
from fifesim.atmosphere.skylight import GroundStreams, atmospheric_sky, directional_coupling, ground_streams
from fifesim.chain import coupled_ground
from fifesim.chain.coupled_ground import STREAMS_OF
from fifesim.ground.canopy.sail_model import sail, with_background

GRID = fifesim.fife_site(30 / 9, window=((0, 60), (0, 72)))
BANDS = ["TM3", "TM4"]
HAZE = fifesim.Atmosphere(visibility=10)
SLANT = fifesim.Geometry(sza=50.0, saa=120.0, vza=30.0, vaa=160.0)
LEAF, SOIL = {"TM3": (0.07, 0.04), "TM4": (0.45, 0.42)}, {"TM3": 0.15, "TM4": 0.19}
GRASS = fifesim.Canopy(leaf_optics=LEAF, background=SOIL, hotspot=0.05)
LAI = fifesim.lai_scene(GRID, seed=7)
CLASSES = [
    fifesim.CoverClass("grass", lai="burned-grazed"),
    fifesim.CoverClass("dry", lai=1.0, canopy=fifesim.Canopy(brown=0.4)),
]


def ground(lai=LAI, streams=False, canopy=GRASS, geometry=SLANT):
    given = {"canopy": canopy, "atmosphere": HAZE, "geometry": geometry}
    return lai.fifesim.surface_reflectance("TM", bands=BANDS, streams=streams, **given)


@pytest.fixture(scope="module")
def directional():
    return ground(streams="directional").fifesim.to_toa()


def test_cells_agree_with_the_sum_over_the_sky(directional):
    """Expected values from SAIL at the leaf area of a cell, without the table."""
    lai = float(LAI[3, 4])
    for name in BANDS:
        (band,) = (each.response for each in fifesim.instrument("TM").select([name]))
        terms = band_terms(HAZE, [band], SLANT.sza, SLANT.vza, SLANT.raa)

        def surface(sza, vza, raa, name=name):
            return with_background(sail(lai, *LEAF[name], sza=sza, vza=vza, raa=raa, hotspot=0.05), SOIL[name])

        skies = [atmospheric_sky(HAZE, band.center, zenith) for zenith in (SLANT.sza, SLANT.vza)]
        streams = ground_streams(surface, *skies, SLANT.sza, SLANT.vza, SLANT.raa)
        down, up = terms.direct_transmittance_down, terms.direct_transmittance_up
        through = down, terms.transmittance_down - down, up, terms.transmittance_up - up, terms.spherical_albedo
        expected = directional_coupling(streams, *through, terms.path_reflectance, terms.gas_transmittance)
        assert float(directional.sel(band=name)[3, 4]) == pytest.approx(float(expected[0]), abs=2e-6)


@pytest.mark.parametrize("coupling", ["directional", "four-stream"])
def test_one_pass_equals_streams_and_coupling(coupling):
    streams = ground(streams="directional" if coupling == "directional" else True)
    assert tuple(streams.stream.values) == STREAMS_OF[coupling] and streams.dims == ("stream", "band", "y", "x")
    with no_compute():
        lazy = ground(LAI.chunk(y=31, x=29)).fifesim.to_toa(coupling=coupling)
    toa = streams.fifesim.to_toa()
    np.testing.assert_allclose(lazy.compute(), toa, rtol=0, atol=1e-6)
    assert f"{coupling} coupling" in lazy.history and f"{coupling} coupling" in toa.history
    with no_compute():
        parts = ground(LAI.chunk(y=31, x=29), streams="directional" if coupling == "directional" else True)
        parts = parts.fifesim.to_toa()
    xr.testing.assert_allclose(parts.compute(), toa, rtol=1e-12)


def test_equal_streams_are_lambertian():
    level = ground()
    even = level.expand_dims(stream=list(STREAMS_OF["directional"]))
    np.testing.assert_allclose(even.fifesim.to_toa(), level.fifesim.to_toa(), rtol=1e-12)
    even = level.expand_dims(stream=list(STREAMS_OF["four-stream"]))
    np.testing.assert_allclose(even.fifesim.to_toa(), level.fifesim.to_toa(), rtol=1e-12)


def test_streams_of_a_landscape_and_of_varying_soil():
    """With a background by cell, streams equal the streams of uniform scenes."""
    soil = xr.DataArray(np.where(np.arange(72) < 36, 0.15, 0.25) * np.ones((60, 1)), dims=("y", "x"))
    soil = LAI.copy(data=soil.values).rename("background").drop_attrs()
    both = ground(streams="directional", canopy=GRASS.replace(background=soil))
    for value, part in ((0.15, slice(0, 36)), (0.25, slice(36, 72))):
        one = ground(streams="directional", canopy=GRASS.replace(background=value))
        np.testing.assert_allclose(both[..., part], one[..., part], rtol=1e-12)


def sides(values):
    """Raster of one value in the west and another in the east."""
    return LAI.copy(data=np.where(np.arange(72) < 36, *values) * np.ones((60, 1))).drop_attrs()


@pytest.mark.parametrize("given", [{"brown": (0.15, 0.6)}, {"crown_cover": (0.4, 0.8), "crown_shape": 0.5}])
def test_streams_of_a_varying_fraction_equal_uniform_scenes(given):
    (name, values), *others = given.items()
    canopy = GRASS.replace(brown_leaf=(0.2, 0.1), **dict(others))
    both = ground(streams=True, canopy=canopy.replace(**{name: sides(values)}))
    for value, part in zip(values, (slice(0, 36), slice(36, 72)), strict=True):
        one = ground(streams=True, canopy=canopy.replace(**{name: value}))
        np.testing.assert_allclose(both[..., part], one[..., part], rtol=0, atol=2e-5)


def test_directional_streams_of_a_varying_fraction_are_exact_at_the_nodes(monkeypatch):
    """The fractions are the nodes of two tables."""
    monkeypatch.setitem(coupled_ground._SHARES, "brown", 2)
    canopy, values = GRASS.replace(brown_leaf=(0.2, 0.1)), (1 - (chebpts1(2) / 2 + 0.5)).tolist()
    both = ground(streams="directional", canopy=canopy.replace(brown=sides(values)))
    for value, part in zip(values, (slice(0, 36), slice(36, 72)), strict=True):
        one = ground(streams="directional", canopy=canopy.replace(brown=value))
        np.testing.assert_allclose(both[..., part], one[..., part], rtol=0, atol=1e-8)


@pytest.mark.parametrize("surface", [fifesim.RossLi(0.3, 0.0, 0.0), fifesim.RPV([0.1] * 6, 1.0, 0.0, 1.0)])
def test_lambertian_surfaces_agree_with_the_uniform_equation(surface):
    terms = band_terms(HAZE, [b.response for b in fifesim.instrument("TM").select(None)], 50.0, 30.0, SLANT.raa)
    rho = float(np.ravel(surface.reflectance(0.0, 0.0, 0.0))[0])
    for coupling in ("directional", "four-stream", "lambert"):
        toa = fifesim.to_toa(surface, HAZE, instrument="TM", geometry=SLANT, coupling=coupling)
        np.testing.assert_allclose(toa, apparent_reflectance(rho, **terms.uniform), rtol=1e-12)


def test_to_surface_inverts_with_the_shape_of_the_ground():
    """
    Every cell is a multiple of one RPV surface; the ratios of its reflectance factors under sun and sky are recovered.
    """
    shape, factor = fifesim.RPV(0.1, 0.75, -0.1, 0.2), np.array([[0.5, 1.0], [2.0, 3.0]])
    grid = fifesim.grid_at("EPSG:26914", west=705000, north=4334000, width=20, height=20, cell=10)
    given = {"instrument": "TM", "geometry": SLANT}
    values = [[fifesim.to_toa(fifesim.RPV(0.1 * f, 0.75, -0.1, 0.2), HAZE, **given) for f in row] for row in factor]
    data = np.moveaxis(np.array([[each.values for each in row] for row in values]), -1, 0)
    one = xr.concat([wrap_xr(each, grid) for each in data], values[0][0]["band"])
    image = one.assign_coords(wavelength=values[0][0]["wavelength"])
    found = image.fifesim.to_surface(HAZE, like=shape, **given)
    ratio = found.values / found.values[:, :1, 1:]
    np.testing.assert_allclose(ratio, np.broadcast_to(factor, found.shape), rtol=1e-9)
    direct = float(shape.reflectance(SLANT.sza, SLANT.vza, SLANT.raa))
    assert float(found[3, 0, 1]) == pytest.approx(direct, rel=0.1)
    lambertian = fifesim.RPV(0.2, 1.0, 0.0, 1.0)
    even = image.fifesim.to_surface(HAZE, like=lambertian, **given)
    np.testing.assert_allclose(even, image.fifesim.to_surface(HAZE, **given), rtol=1e-9)
    with pytest.raises(ValueError, match="no adjacency"):
        image.fifesim.to_surface(HAZE, like=shape, adjacency=True, **given)


def test_invalid_arguments_are_rejected():
    with pytest.raises(ValueError, match="needs stream >o, ao"):
        ground(streams=True).fifesim.to_toa(coupling="directional")
    with pytest.raises(ValueError, match="holds one reflectance factor"):
        ground().fifesim.to_toa(coupling="directional")
    with pytest.raises(ValueError, match="needs streams"):
        ground(LAI.chunk(y=31)).fifesim.to_toa(coupling="directional", adjacency=True)
    with pytest.raises(ValueError, match="leaf area"):
        ground((LAI - 5).chunk(y=31)).fifesim.to_toa(coupling="four-stream").compute()
    by_cell = (0.1 + 0 * LAI).drop_attrs()
    with pytest.raises(ValueError, match="brown and crown_cover vary"):
        ground(streams=True, canopy=GRASS.replace(brown=by_cell, crown_cover=by_cell + 0.7))
    with pytest.raises(ValueError, match="no geometry"):
        fifesim.to_toa(fifesim.RPV(0.1, 0.8, -0.1, 0.1), HAZE, instrument="TM")
    with pytest.raises(ValueError, match="reflectance must not be negative"):
        fifesim.to_toa(fifesim.RossLi(0.05, 0.19, 0.06), HAZE, instrument="TM", geometry=SLANT)
    with pytest.raises(ValueError, match="of the sunlight"):
        fifesim.to_toa(fifesim.RossLi(20, 10, 3), HAZE, instrument="TM", geometry=SLANT)
    with pytest.raises(ValueError, match="not finite"):
        fifesim.to_toa(fifesim.RossLi([0.2, np.nan, 0.2, 0.2, 0.2, 0.2], 0, 0), HAZE, instrument="TM", geometry=SLANT)
    with pytest.raises(ValueError, match="has no instrument"):
        fifesim.to_toa(fifesim.RossLi(0.1 + 0 * LAI, 0, 0), HAZE, geometry=SLANT)
    with pytest.raises(ValueError, match=r"RossLi\(iso=0.05, vol=0.19, geo=0.06\) reflects -"):
        fifesim.to_toa(fifesim.RossLi(xr.where(LAI > 1, 0.05, 0.3), 0.19, 0.06), HAZE, instrument="TM", geometry=SLANT)
    with pytest.raises(ValueError, match="Canopy of numbers"):
        ground().fifesim.to_toa().fifesim.to_surface(like=GRASS.replace(model="discrete-ordinates"))
    with pytest.raises(ValueError, match="no shape"):
        ground().fifesim.to_toa().fifesim.to_surface(like=fifesim.RossLi(0, 0, 0))
    with pytest.raises(ValueError, match="and surroundings"):
        ground().fifesim.to_toa().fifesim.to_surface(like=fifesim.RossLi(0.2, 0, 0), surroundings=0.2)


@pytest.mark.parametrize("make", [ground, lambda: ground(LAI.chunk(y=31)), lambda: fifesim.RossLi(0.2, 0.1, 0.03)])
def test_unknown_coupling_is_rejected(make):
    with pytest.raises(ValueError, match="coupling must be 'directional', 'four-stream' or 'lambert'"):
        fifesim.to_toa(make(), HAZE, instrument="TM", geometry=SLANT, coupling="directionl")


@pytest.mark.parametrize(
    "option", [{"elevation": LAI}, {"adjacency": True}, {"surroundings": 0.2}, {"time": "1987-07-01T17:00"}]
)
def test_uniform_surface_rejects_raster_options(option):
    (name,) = option
    with pytest.raises(ValueError, match=f"{name} needs rasters"):
        fifesim.to_toa(fifesim.RossLi(0.2, 0.1, 0.03), HAZE, instrument="TM", geometry=SLANT, **option)


def test_streams_for_other_directions_or_out_of_range_are_rejected():
    streams = ground(streams=True)
    lazy = ground(LAI.chunk(y=31))
    for name in ("sza", "vza"):
        other = fifesim.Geometry(**{"sza": 50.0, "saa": 120.0, "vza": 30.0, "vaa": 160.0, name: 10.0})
        with pytest.raises(ValueError, match=f"made for {name}="):
            streams.fifesim.to_toa(geometry=other)
        with pytest.raises(ValueError, match=f"made for {name}="):
            lazy.fifesim.to_toa(geometry=other, coupling="directional")
    with pytest.raises(ValueError, match=r"-0\.5 to 5 is allowed"):
        (streams - 1).assign_attrs(streams.attrs).fifesim.to_toa()
    with pytest.raises(ValueError, match="elevation needs coupling"):
        streams.fifesim.to_toa(elevation=400 + 0 * LAI)
    with pytest.raises(ValueError, match="is the stream 'so'"):
        streams.isel(stream=0).fifesim.to_toa()
    with pytest.raises(ValueError, match="made for sza="):
        ground().fifesim.to_toa(geometry=fifesim.Geometry(10.0, 120.0, 30.0, 160.0))
    with pytest.raises(ValueError, match="no dimension band"):
        streams.isel(band=0).fifesim.to_toa()
    with pytest.raises(ValueError, match="no dimension band"):
        ground().fifesim.to_toa().isel(band=0).fifesim.to_surface(like=fifesim.RossLi(0.2, 0, 0))
    single = streams.isel(band=0).expand_dims("band").fifesim.to_toa()
    np.testing.assert_allclose(single, streams.fifesim.to_toa().isel(band=[0]), rtol=1e-12)


def test_discrete_ordinates_have_no_directional_streams():
    with pytest.raises(ValueError, match="one direction of sun and view"):
        exact = {"canopy": GRASS.replace(model="discrete-ordinates"), "exact": True}
        known = {"atmosphere": HAZE, "geometry": SLANT}
        LAI[:2, :2].fifesim.surface_reflectance("TM", bands=BANDS, streams="directional", **known, **exact)


def test_adjacency_of_equal_streams_is_lambertian_and_has_no_effect_on_uniform_ground():
    """Equal streams are also Lambertian with a bright environment."""
    level = ground()
    for given in ({}, {"surroundings": [0.05, 0.3]}):
        expected = level.fifesim.to_toa(adjacency=True, **given)
        for coupling in ("directional", "four-stream"):
            even = level.expand_dims(stream=list(STREAMS_OF[coupling]))
            found = even.fifesim.to_toa(adjacency=True, **given)
            np.testing.assert_allclose(found, expected, rtol=1e-9)
    one = ground(1.5 + 0 * LAI, streams="directional")
    np.testing.assert_allclose(one.fifesim.to_toa(adjacency=True), one.fifesim.to_toa(), rtol=1e-12)
    streams = ground(LAI.chunk(y=31, x=29), streams="directional")
    with no_compute():
        lazy = streams.fifesim.to_toa(adjacency=True)
    np.testing.assert_allclose(lazy.compute(), ground(streams="directional").fifesim.to_toa(adjacency=True), rtol=1e-12)


def test_surroundings_affect_only_the_streams_into_the_sky():
    """
    A dark cell in a uniform bright scene: streams to the view are from the cell, streams to the sky from the scene.
    """
    streams = ground(1.5 + 0 * LAI, streams="directional").load()
    bright = streams.isel(y=0, x=0).values
    dark = streams.copy()
    dark[..., 30, 36] *= 0.5
    found = dark.fifesim.to_toa(adjacency=True).values[:, 30, 36]
    terms = band_terms(HAZE, [b.response for b in fifesim.instrument("TM").select(BANDS)], 50.0, 30.0, SLANT.raa)
    down, up = terms.direct_transmittance_down, terms.direct_transmittance_up
    through = down, terms.transmittance_down - down, up, terms.transmittance_up - up, terms.spherical_albedo
    mixed = GroundStreams(*(0.5 * bright[:3]), *bright[3:])
    expected = directional_coupling(mixed, *through, terms.path_reflectance, terms.gas_transmittance)
    np.testing.assert_allclose(found, expected, rtol=2e-3)
    alone = directional_coupling(
        GroundStreams(*(0.5 * bright)), *through, terms.path_reflectance, terms.gas_transmittance
    )
    assert abs(found / alone - 1).min() > 0.01


def test_streams_of_slopes_are_scaled_like_the_reflectance_factor():
    dem = fifesim.flint_hills(GRID, seed=7)
    given = {"canopy": GRASS, "atmosphere": HAZE, "geometry": SLANT, "bands": BANDS}
    for slopes in ("kt", "upright"):
        on_slopes = LAI.fifesim.surface_reflectance("TM", dem=dem, slopes=slopes, streams="directional", **given)
        ratio = LAI.fifesim.surface_reflectance("TM", dem=dem, slopes=slopes, **given) / ground()
        np.testing.assert_allclose(on_slopes, ground(streams="directional") * ratio, rtol=1e-12)
        assert "terrain" in on_slopes.history and on_slopes.dims == ("stream", "band", "y", "x")


@pytest.mark.parametrize("coupling", ["directional", "four-stream"])
def test_setup_equals_the_steps(coupling):
    """Hills, classes, adjacency and clouds together, and a flat scene that is coupled in one pass."""
    land = fifesim.landscape(GRID, cover=fifesim.Patches("voronoi", 60), classes=CLASSES, seed=3)
    sky = fifesim.cloud_field(GRID, 0.5, seed=1, margin=3000)
    own = {"atmosphere": HAZE, "geometry": SLANT, "bands": BANDS, "dem": fifesim.flint_hills(GRID, seed=7)}
    setup = fifesim.Setup(coupling=coupling, slopes="kt", adjacency=True, clouds=sky, **own)
    image = land.fifesim.compare(["TM"], setup, bands={"TM": BANDS})["TM"]["dn"]
    streams = land.fifesim.surface_reflectance("TM", streams=True if coupling == "four-stream" else coupling, **own)
    cast = fifesim.cast_clouds(streams.isel(stream=0, drop=True), sky, dem=own["dem"])
    expected = streams.fifesim.to_toa(adjacency=True, clouds=cast).fifesim.sense("TM")
    np.testing.assert_array_equal(image, expected)
    plain = fifesim.Setup(coupling=coupling, bands=BANDS, atmosphere=HAZE, geometry=SLANT)
    lazy = LAI.chunk(y=31).fifesim.compare(["TM"], plain, bands={"TM": BANDS})["TM"]["dn"]
    assert int(abs(lazy.astype(int) - LAI.fifesim.compare(["TM"], plain, bands={"TM": BANDS})["TM"]["dn"]).max()) <= 1


@pytest.mark.parametrize("surface", [fifesim.RossLi(0.3, 0.1, 0.02), fifesim.RPV(0.1, 0.75, -0.1, 0.2)])
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
    scaled = [first, *others] if isinstance(surface, fifesim.RossLi) else [first]
    shape = {name: by_band / value * getattr(surface, name) for name in scaled}
    raster = replace(surface, **shape)
    given = {"instrument": "TM", "geometry": SLANT}
    toa = fifesim.to_toa(raster, HAZE, **given)
    assert toa.dims == ("band", "y", "x") and toa.band.values.tolist() == BANDS and np.isnan(toa[:, 0, 0]).all()
    for column, factor in ((1, 1.0), (40, 0.8)):
        for number, name in enumerate(BANDS):
            one = replace(surface, **{key: factor * (1, 0.9)[number] * getattr(surface, key) for key in scaled})
            for coupling in ("directional", "four-stream", "lambert"):
                expected = fifesim.to_toa(one, HAZE, coupling=coupling, **given).sel(band=name)
                found = fifesim.to_toa(raster, HAZE, coupling=coupling, **given).sel(band=name)[5, column]
                assert float(found) == pytest.approx(float(expected), rel=1e-12)
    lazy = replace(surface, **{name: each.chunk(y=31) for name, each in shape.items()})
    with no_compute():
        lazy = fifesim.to_toa(lazy, HAZE, **given)
    np.testing.assert_allclose(lazy.compute(), toa, rtol=1e-12)
    found = toa.fifesim.to_surface(like=raster)
    half = replace(raster, **{name: 0.5 * each for name, each in shape.items()})
    np.testing.assert_allclose(toa.fifesim.to_surface(like=half), found, rtol=1e-9)
    near = fifesim.to_toa(raster, HAZE, adjacency=True, **given)
    assert 0.001 < abs(near / toa - 1).max() < 0.2


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
    with pytest.raises(ValueError, match="made for sza="):
        toa.fifesim.to_surface(HAZE, assume=True, like=GRASS, geometry=fifesim.Geometry(10.0, 120.0, 30.0, 160.0))
