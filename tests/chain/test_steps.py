"""Figure 1 end to end, by labelled steps, by a Setup, on plain arrays and in one pass."""

import warnings
from dataclasses import fields, replace

import dask
import numpy as np
import pytest
import xarray as xr
from lazy import check_raster_function, no_compute

import fifesim
from fifesim.atmosphere import coupling, engines
from fifesim.chain.driver import Driver, varying_parts
from fifesim.chain.landscapes import seen_reflectance, seen_through_air
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.chain.steps import kt_and_reflectance
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.grids.windows import origin_of
from fifesim.sensor.description.instruments import instrument

TM34 = ["TM3", "TM4"]
AIR = fifesim.Atmosphere()


@pytest.mark.parametrize("chunks", [{"y": 23, "x": 31}, "auto"], ids=str)
def test_lazy_chain_is_identical_and_computes_nothing_early(site, contract, whole, chunks):
    with no_compute():
        lazy = contract(site, chunks=chunks)
    for name, array in lazy.items():
        assert array.chunks is not None, name
        xr.testing.assert_identical(array.compute(), whole[name])
    assert fifesim.regress(lazy["truth"], lazy["ndvi"]) == fifesim.regress(whole["truth"], whole["ndvi"])


def test_every_step_is_on_the_right_grid_and_in_the_history(site, whole):
    for name in ("lai", "rho", "toa"):
        assert grids.same_grid(grids.geobox(whole[name]), site)
    pixels = grids.aligned_grid(site, 30.0)
    for name in ("image", "ndvi", "truth"):
        assert grids.same_grid(grids.geobox(whole[name]), pixels)
        np.testing.assert_array_equal(whole[name]["x"], grids.coordinates(pixels)["x"])
    assert (whole["truth"] + whole["ndvi"]).shape == tuple(pixels.shape)
    verbs = [line.split(":")[0] for line in whole["ndvi"].attrs["history"].splitlines()]
    assert verbs == ["lai_scene", "surface_reflectance", "to_toa", "sense", "to_radiance", "to_reflectance", "ndvi"]
    assert whole["ndvi"].attrs["rng_seed"] == "7"


def test_defaults_are_the_paper_case(lai, whole):
    rho = whole["rho"]
    assert fifesim.Atmosphere.parse(rho.attrs["atmosphere"]) == AIR
    assert AIR.visibility == 45.0
    assert directions.geometry_of(rho) == fifesim.fife_geometry()
    assert rho.attrs["instrument"] == "TM" and rho.attrs["site"] == "FIFE"
    assert fifesim.surface_reflectance(lai).sizes["band"] == 6
    for function, name in ((fifesim.to_toa, "rho"), (fifesim.to_surface, "toa")):
        xr.testing.assert_identical(function(whole[name], AIR), function(whole[name]))
    np.testing.assert_array_equal(rho.isel(band=0).fifesim.to_toa().squeeze(), whole["toa"][0])


def test_surface_reflectance_is_recovered_within_quantisation(whole):
    """Half a count is 0.002 in reflectance in TM3 and 0.001 in TM4, and more at the surface: 0.004."""
    np.testing.assert_allclose(whole["toa"].fifesim.to_surface(), whole["rho"], rtol=0, atol=1e-12)
    truth = fifesim.aggregate(whole["rho"], 30.0)
    back = whole["image"].fifesim.to_surface()
    assert back.name == "surface_reflectance"
    # The line spread function gives the centre of a pixel more weight than a mean, so image averages are compared.
    np.testing.assert_allclose(back.mean(("y", "x")), truth.mean(("y", "x")), rtol=0, atol=0.004)


def test_gap_in_the_ground_is_no_data_in_the_image(lai):
    lai[18:27, 27:36] = np.nan
    paper = fifesim.instrument("TM", response="paper")
    image = lai.fifesim.surface_reflectance("TM", bands=TM34).fifesim.to_toa().fifesim.sense(paper)
    holes = image == 0
    assert holes[:, 2, 3].all() and int(holes.sum()) == 2
    np.testing.assert_array_equal(np.isnan(image.fifesim.ndvi()), holes[0])


def test_indices_are_from_planetary_reflectance(whole):
    rho = whole["image"].fifesim.to_reflectance()
    red, nir = rho.sel(band="TM3").values, rho.sel(band="TM4").values
    np.testing.assert_array_equal(whole["ndvi"], (nir - red) / (nir + red))
    for image in (whole["image"].fifesim.to_radiance(), rho):
        np.testing.assert_array_equal(image.fifesim.ndvi(), whole["ndvi"])
    np.testing.assert_array_equal(whole["image"].fifesim.index("EVI2"), 2.5 * (nir - red) / (nir + 2.4 * red + 1))
    np.testing.assert_array_equal(whole["image"].fifesim.index("NDVI"), whole["ndvi"])


@pytest.mark.parametrize("upwelling", [True, False])
def test_one_pass_equals_kt_and_reflectance_on_slopes(lai, upwelling):
    """Labels are equal too, and the results are lazy."""
    dem = fifesim.flint_hills(grids.geobox(lai), seed=7)
    level = fifesim.surface_reflectance(lai.chunk(20), bands=TM34)
    found = kt_and_reflectance(level, dem, upwelling=upwelling)
    on_slopes = fifesim.surface_reflectance(lai, bands=TM34, dem=dem, upwelling=upwelling)
    for one, other in zip(found, (level.fifesim.kt(dem), on_slopes), strict=True):
        assert one.chunks is not None
        xr.testing.assert_identical(one.compute(), other.compute())


# ------------------------------------------------------------------------------------------ what a raster carries


def narrow_terms(atmosphere):
    """Terms of narrow bands in red and near infrared, under the sun of FIFE."""
    bands = (fifesim.sensor.Band("narrow", (at - 0.0025, at, at + 0.0025), (0.0, 1.0, 0.0)) for at in (0.665, 0.842))
    return engines.band_terms(atmosphere, tuple(bands), fifesim.fife_geometry().sza, 0.0, 0.0)


@pytest.fixture(scope="module")
def mine(site):
    """Reflectance from another program, with wavelengths and without names of bands."""
    values = np.random.default_rng(1).uniform(0.05, 0.4, (2, *site.shape))
    coords = {"wavelength": ("band", [0.665, 0.842])}
    array = grids.place(xr.DataArray(values, dims=("band", "y", "x"), coords=coords, name="mine"), site)
    return directions.with_geometry(array, fifesim.fife_geometry())


def test_user_raster_needs_only_wavelengths(mine):
    """Without band names and instrument, bands are narrow, and the image has the nearest bands of the instrument."""
    toa = check_raster_function(lambda each: fifesim.to_toa(each, AIR), mine, quantity="toa_reflectance")
    factors = {name: each[:, None, None] for name, each in narrow_terms(AIR).uniform.items()}
    np.testing.assert_array_equal(toa, coupling.apparent_reflectance(mine.values, **factors))
    image = fifesim.sense(toa, instrument("TM", "paper"))
    assert image["band"].values.tolist() == TM34
    assert np.isfinite(image.fifesim.ndvi()).all()
    np.testing.assert_allclose(toa.fifesim.to_surface(), mine, rtol=0, atol=1e-12)


@pytest.mark.parametrize("names", [[3, 4], ["B03", "B04"], ["red", "nir"], ["tm_3", "TM 4"]])
def test_common_band_names_are_recognised(mine, names):
    """Bands get the names and wavelengths of the instrument."""
    mine = mine.drop_vars("wavelength")
    toa = fifesim.to_toa(mine.assign_coords(band=names), AIR, instrument="Landsat 5")
    assert toa["band"].values.tolist() == TM34
    centres = [band.wavelength for band in instrument("TM").select(TM34)]
    np.testing.assert_array_equal(toa["wavelength"], centres)
    np.testing.assert_array_equal(toa, fifesim.to_toa(mine.assign_coords(band=TM34), AIR, instrument="TM"))
    image = toa.fifesim.sense()
    assert image.attrs["instrument"] == "TM" and np.isfinite(image.fifesim.ndvi()[1:-1, 1:-1]).all()


def test_known_atmosphere_is_no_warning(lai, mine):
    with warnings.catch_warnings(action="error", category=UserWarning):
        lai.fifesim.surface_reflectance().fifesim.to_toa()
        toa = fifesim.to_toa(mine, AIR)
        assert toa.fifesim.to_surface().attrs["atmosphere"] == AIR.text


def own_instrument(name, tm3):
    """The Thematic Mapper with another name, or with the response of another band in TM3."""
    tm = instrument("TM", "paper")
    bands = tuple(replace(band, srf=tm.select(tm3)[0].srf) if band.name == "TM3" else band for band in tm.bands)
    return replace(tm, name=name, bands=bands)


@pytest.mark.parametrize("mine", [own_instrument("MINE", "TM3"), own_instrument("TM", "TM1")])
def test_user_instrument_is_kept_along_the_chain(lai, mine, tmp_path):
    rho = fifesim.surface_reflectance(lai, mine, bands=TM34)
    toa = fifesim.to_toa(rho)
    np.testing.assert_array_equal(toa, fifesim.to_toa(rho, instrument=mine))
    image = toa.fifesim.sense()
    np.testing.assert_array_equal(image, toa.fifesim.sense(mine))
    assert toa.fifesim.sense("MSI").attrs["instrument"] == "MSI"
    again = fifesim.open_image(image.fifesim.to_geotiff(tmp_path / "mine.tif"))
    np.testing.assert_array_equal(again.fifesim.to_surface(), image.fifesim.to_surface(instrument=mine))
    as_tm = fifesim.to_surface(again.drop_vars("wavelength"), instrument="TM")
    assert np.array_equal(as_tm, again.fifesim.to_surface()) == (mine.name == "MINE"), "its TM3 is TM1"


def test_assumed_atmosphere_leaves_uncorrected_path_reflectance(mine):
    """
    Over black ground, the result is the difference of the two path reflectances, divided by the clear transmittance.
    """
    haze, clear = fifesim.Atmosphere(visibility=10.0), fifesim.Atmosphere(visibility=40.0)
    dark = fifesim.to_toa(0 * mine, haze)
    found = check_raster_function(
        lambda toa: toa.fifesim.to_surface(clear, assume=True), dark, quantity="surface_reflectance"
    )
    true, assumed = narrow_terms(haze), narrow_terms(clear)
    path = true.path_reflectance * true.gas_transmittance / assumed.gas_transmittance - assumed.path_reflectance
    left = path / (assumed.transmittance_down * assumed.transmittance_up)
    assert np.all(left > 0.005)
    expected = left / (1 + assumed.spherical_albedo * left)
    np.testing.assert_allclose(found[:, 0, 0], expected, rtol=1e-12)
    assert found.attrs["atmosphere"] == clear.text
    xr.testing.assert_identical(dark.fifesim.to_surface(haze, assume=True), dark.fifesim.to_surface())


# ------------------------------------------------------------------------------------------ setups and plain arrays

GRID = fifesim.fife_site(10.0, ((300, 348), (200, 254)))
LAI = fifesim.lai_scene(GRID, arp=0.2, seed=3)


@pytest.fixture(scope="module")
def setup():
    geometry = fifesim.Geometry(35.0, 120.0, 20.0, 80.0, earth_sun_distance=1.01)
    return fifesim.Setup(
        "TM", bands=("TM4", "TM3"), geometry=geometry, canopy=fifesim.Canopy(brown=0.1), atmosphere=fifesim.Atmosphere()
    )


def test_saturated_counts_are_no_data_as_in_the_labelled_steps(setup):
    toa = reflectance_of(setup, LAI).fifesim.to_toa()
    image = fifesim.sense(toa.where(toa.x > toa.x[30], 0.9), "TM")
    assert 0 < (image == 255).mean() < 1
    expected = image.fifesim.to_reflectance()
    np.testing.assert_array_equal(Driver(setup).planetary(image.values), expected)
    np.testing.assert_array_equal(np.isnan(expected), (image == 255) | (image == 0))


def test_varying_parts_are_named(setup):
    assert varying_parts(replace(setup, canopy=fifesim.Canopy(brown=LAI), adjacency=True)) == ["adjacency", "brown"]
    assert varying_parts(replace(setup, offset=(np.zeros(3), 0.0))) == ["a drifting offset"]
    angles = xr.Dataset({"sza": 30.0, "saa": 120.0})
    assert varying_parts(replace(setup, geometry=angles)) == ["angles by cell"]


HILLS = fifesim.flint_hills(GRID.pad(1), seed=2)
LOW_SUN = {"dem": HILLS, "geometry": fifesim.Geometry(75.0, 120.0, 20.0, 80.0)}
NOISY = {"instrument": "OLI", "bands": ("B4", "B5"), "noise": ("thermal",)}

# A value of each field of a setup that changes the image, and the other fields that it needs.
FIELDS = {
    "instrument": ("OLI", {"bands": ("nir", "red")}),
    "bands": (("TM3", "TM4"), {}),
    "atmosphere": (fifesim.Atmosphere(visibility=10), {}),
    "geometry": (fifesim.Geometry(50.0, 120.0), {}),
    "canopy": (fifesim.Canopy(brown=0.4), {}),
    "dem": (HILLS, {}),
    "horizon": (fifesim.horizon(fifesim.flint_hills(GRID.pad(100), seed=2)), LOW_SUN),
    "upwelling": (False, {"dem": HILLS}),
    "slopes": ("upright", {"dem": HILLS, "canopy": fifesim.Canopy()}),
    "coupling": ("four-stream", {}),
    "adjacency": (True, {}),
    "surroundings": (0.5, {"adjacency": True}),
    "clouds": (fifesim.cloud_field(GRID, 0.8, seed=2, margin=2000), {}),
    "onto": (fifesim.grid_at(GRID.crs, GRID.affine.c + 7.0, GRID.affine.f - 11.0, 120, 90, 30), {}),
    "interval": ("native", {}),
    "offset": ((0.4, -0.3), {}),
    "min_valid": (0.5, {}),
    "noise": (("thermal",), NOISY),
    "noise_models": (fifesim.NoiseModel(thermal=5.0, shot=0.0), NOISY),
    "seed": (5, NOISY),
    "quantise": (False, {}),
}


def by_functions(setup):
    """Image by the public functions, with the fields of a setup as arguments."""

    def given(names):
        return {name: getattr(setup, name) for name in names.split()}

    ground = given("instrument bands atmosphere geometry canopy dem horizon upwelling slopes")
    rho = fifesim.surface_reflectance(LAI, streams=setup.coupling == "four-stream", **ground)
    clouds = setup.clouds
    if clouds is not None:
        clouds = fifesim.atmosphere.cast_clouds(rho, clouds, dem=setup.dem)
    toa = fifesim.to_toa(rho, clouds=clouds, **given("coupling adjacency surroundings"))
    pixels = given("instrument onto interval offset min_valid noise noise_models seed quantise")
    return fifesim.sense(toa, **pixels)


def test_defaults_equal_the_defaults_of_the_functions(lai, whole):
    setup = fifesim.Setup(bands=("TM3", "TM4"))
    xr.testing.assert_identical(image_of(setup, reflectance_of(setup, lai)), whole["image"])


@pytest.mark.parametrize("name", [each.name for each in fields(fifesim.Setup)])
def test_each_field_changes_the_image_as_the_argument_of_its_function(setup, name):
    value, others = FIELDS[name]
    base = replace(setup, **{key: each for key, each in others.items() if key != name})
    changed = replace(base, **{name: value})
    before, expected = (image_of(each, reflectance_of(each, LAI), LAI) for each in (base, changed))
    assert before.dtype != expected.dtype or not np.array_equal(before, expected, equal_nan=True)
    xr.testing.assert_identical(expected, by_functions(changed))


# ------------------------------------------------------------------------------------------ one pass

BANDS = ["TM2", "TM3", "TM4"]


def scene(**chunks):
    return fifesim.lai_scene(fifesim.fife_site(30 / 9, window=((0, 90), (0, 72))), arp=0.15, seed=7, chunks=chunks)


def chains(lai, exact=False, **canopy):
    reflectance = lai.fifesim.surface_reflectance("TM", bands=BANDS, canopy=fifesim.Canopy(**canopy), exact=exact)
    return reflectance, reflectance.fifesim.to_toa()


@pytest.mark.parametrize(
    "canopy", [{}, {"hotspot": 0.1, "soil": 0.05}, {"brown": 0.2}, {"crown_cover": 0.7}, {"exact": True}]
)
def test_one_pass_equals_two_passes_to_the_bit(canopy):
    """One pass is used if cells differ only in leaf area."""
    with no_compute():
        reflectance, lazy = chains(scene(y=31, x=29), **canopy)
        once = seen_through_air(reflectance) is not None
    assert once == (not {"brown", "crown_cover", "exact"} & set(canopy))
    kept = [name for name in reflectance.data.dask.layers if "call" in name and name in lazy.data.dask.layers]
    assert not (once and kept)
    xr.testing.assert_identical(lazy.compute(), chains(scene(y=31, x=29).compute(), **canopy)[1])


def test_changed_reflectance_is_not_recomputed():
    reflectance, _ = chains(scene(y=90, x=40))
    halved = (0.5 * reflectance).assign_attrs(reflectance.attrs)
    assert seen_through_air(halved) is None and seen_through_air(reflectance.compute()) is None
    half = halved.fifesim.to_toa().compute()
    assert float(half.mean()) < 0.9 * float(reflectance.fifesim.to_toa().mean())


def test_missing_cells_are_missing():
    lai = np.array([[0.0, np.nan, 2.5]])
    canopy = origin_of(chains(scene(y=90, x=40))[0])
    names = ("path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo", "gas_transmittance")
    clear = dict(zip(names, np.repeat([[0.0], [1.0], [1.0], [0.0], [1.0]], 3, axis=1), strict=True))
    found = seen_reflectance(lai, background=canopy.background, scene=canopy.scene, terms=clear)
    assert np.isnan(found[:, 0, 1]).all()
    # Without atmosphere, bare ground has the reflectance of the background.
    np.testing.assert_allclose(found[:, 0, 0], canopy.background, rtol=1e-9)


def test_image_and_index_together_compute_the_scene_once_and_equal_each_alone():
    """Also the truth; results are identical to the bit."""
    made = []

    def counted(block):
        made.append(block.shape)
        return block

    lai = scene(y=45, x=36)
    lai = lai.copy(data=lai.data.map_blocks(counted, dtype=float, meta=np.empty((0, 0))))
    image = chains(lai)[1].fifesim.sense("TM")
    each = image, image.fifesim.ndvi(), lai.fifesim.aggregate(30)
    together = dask.compute(*each, scheduler="synchronous")
    assert len(made) == lai.data.npartitions
    for one, alone in zip(together, each, strict=True):
        np.testing.assert_array_equal(one, alone.compute())
