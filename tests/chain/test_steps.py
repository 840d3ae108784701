"""Figure 1 end to end: what its users write, eagerly and lazily, and what one stage hands to another."""

import dataclasses

import numpy as np
import pytest
import xarray as xr
from lazy import ODD_CHUNKS, check_raster_function, in_chunks, no_compute

import fifesim
from fifesim.atmosphere.schemes import coupling, engines
from fifesim.base.geometry import FIFE_TIME, Geometry, earth_sun_distance
from fifesim.chain import steps as chain
from fifesim.ground.canopy import optics
from fifesim.rasters import cf
from fifesim.rasters import grid as grids
from fifesim.sensor.description.instruments import instrument

TM34 = ["TM3", "TM4"]


def contract(site, **chunks):
    """The lines that users write, in order."""
    lai = fifesim.lai_scene(site, "burned-grazed", arp=0.15, seed=7, **chunks)
    rho = lai.fifesim.surface_reflectance("TM", bands=TM34, dem=None)
    toa = rho.fifesim.to_toa()
    image = toa.fifesim.sense("TM")
    ndvi = image.fifesim.ndvi()
    truth = lai.fifesim.aggregate(30)
    return {"lai": lai, "rho": rho, "toa": toa, "image": image, "ndvi": ndvi, "truth": truth}


@pytest.fixture(scope="module")
def whole(site):
    return contract(site)


@pytest.mark.parametrize("chunks", [{"y": 27, "x": 36}, {"y": 23, "x": 31}, "auto"], ids=str)
def test_chain_has_the_same_bits_lazily_and_computes_nothing_early(site, whole, chunks):
    with no_compute():
        lazy = contract(site, chunks=chunks)
    for name, array in lazy.items():
        assert array.chunks is not None, name
        xr.testing.assert_identical(array.compute(), whole[name])
    assert fifesim.regress(lazy["truth"], lazy["ndvi"]) == fifesim.regress(whole["truth"], whole["ndvi"])


def test_chunks_may_begin_anywhere_in_the_chain(whole):
    """`DataArray.chunk` makes coordinates such as the wavelength lazy, too."""
    toa = whole["rho"].chunk(ODD_CHUNKS).fifesim.to_toa()
    image = toa.chunk({"band": 1, "y": 9}).fifesim.sense("TM")
    xr.testing.assert_identical(image.compute(), whole["image"])
    xr.testing.assert_identical(image.chunk(2).fifesim.ndvi().compute(), whole["ndvi"])


def test_every_step_lies_where_it_should(site, whole):
    for name in ("lai", "rho", "toa"):
        assert grids.same_grid(grids.geobox(whole[name]), site)
    pixels = grids.aligned(site, 30.0)
    for name in ("image", "ndvi", "truth"):
        assert grids.same_grid(grids.geobox(whole[name]), pixels)
        np.testing.assert_array_equal(whole[name]["x"], grids.coordinates(pixels)["x"])
    assert (whole["truth"] + whole["ndvi"]).shape == tuple(pixels.shape)


def test_history_tells_every_stage(whole):
    verbs = [line.split(":")[0] for line in whole["ndvi"].attrs["history"].splitlines()]
    assert verbs == ["lai_scene", "surface_reflectance", "to_toa", "sense", "to_radiance", "to_reflectance", "ndvi"]
    assert whole["ndvi"].attrs["rng_seed"] == "7"


def test_image_is_that_of_the_paper_case(whole):
    """Sparse green grass: brighter in the near infrared than in the red, NDVI between soil and dense canopy."""
    assert whole["image"].dtype == np.uint8 and whole["image"].dims == ("band", "y", "x")
    assert 0.1 < float(whole["ndvi"].min()) < float(whole["ndvi"].max()) < 0.9
    assert fifesim.regress(whole["truth"], whole["ndvi"]).slope > 0


def test_defaults_are_the_paper_case(lai):
    rho = fifesim.surface_reflectance(lai, bands=TM34)
    assert fifesim.Atmosphere.parse(rho.attrs["atmosphere"]) == fifesim.Atmosphere()
    assert fifesim.Atmosphere().visibility == 45.0
    assert cf.geometry_of(rho) == fifesim.fife_geometry()
    assert rho.attrs["instrument"] == "TM"
    assert fifesim.surface_reflectance(lai).sizes["band"] == 6


def test_skylight_of_the_atmosphere_reaches_the_ground(lai):
    """The diffuse fraction of 5S mixes SAIL's two reflectances; a haze changes both stages."""
    haze = fifesim.Atmosphere(visibility=10.0)
    rho = lai.fifesim.surface_reflectance("TM", bands=TM34, atmosphere=haze)
    bands = instrument("TM").select(TM34)
    sun = fifesim.fife_geometry()
    terms = engines.band_terms(haze, tuple(band.response for band in bands), sun.sza, sun.vza, sun.raa)
    reflectance, transmittance = optics.leaf_optics(TM34)
    expected = chain.ground.level_reflectance(
        lai, bands=TM34, wavelengths=[band.wavelength for band in bands], leaf_reflectance=reflectance,
        leaf_transmittance=transmittance, background=optics.background(TM34), diffuse_fraction=terms.diffuse_fraction,
        geometry=sun,
    )  # fmt: skip
    np.testing.assert_array_equal(rho, expected)
    assert not np.array_equal(rho, lai.fifesim.surface_reflectance("TM", bands=TM34))
    assert rho.fifesim.to_toa().attrs["atmosphere"] == haze.text


def test_different_atmosphere_raises(whole):
    for function in (fifesim.to_toa, fifesim.to_surface):
        array = whole["rho"] if function is fifesim.to_toa else whole["toa"]
        with pytest.raises(ValueError, match=r"made for another atmosphere.*surface_reflectance\(atmosphere=\.\.\.\)"):
            function(array, fifesim.Atmosphere(visibility=23.0))
        same = function(array, fifesim.Atmosphere())
        xr.testing.assert_identical(same, function(array))


def test_bare_ground_is_the_background(lai):
    bare = xr.zeros_like(lai)
    expected = np.array(optics.background(TM34))[:, None, None]
    np.testing.assert_allclose(
        bare.fifesim.surface_reflectance("TM", bands=TM34), expected + 0 * bare.values, rtol=1e-12
    )


def test_background_is_a_number_a_mapping_or_a_raster(lai):
    number, mapping = (
        lai.fifesim.surface_reflectance("TM", bands=TM34, background=value) for value in (0.2, {"TM3": 0.2, "TM4": 0.2})
    )
    raster = xr.full_like(lai, 0.2)
    np.testing.assert_array_equal(number, mapping)
    from_raster = lai.fifesim.surface_reflectance("TM", bands=TM34, background=raster)
    np.testing.assert_allclose(from_raster, number, rtol=0, atol=1e-6)
    exact = [lai.fifesim.surface_reflectance("TM", bands=TM34, background=value, exact=True) for value in (0.2, raster)]
    np.testing.assert_allclose(exact[0], exact[1], rtol=1e-12)


def test_raster_of_background_stays_lazy(lai):
    soil = in_chunks(xr.full_like(lai, 0.2).expand_dims(band=TM34), {"band": 1, "y": 20})
    with no_compute():
        rho = in_chunks(lai, ODD_CHUNKS).fifesim.surface_reflectance("TM", bands=TM34, background=soil)
    np.testing.assert_allclose(
        rho, lai.fifesim.surface_reflectance("TM", bands=TM34, background=0.2), rtol=0, atol=1e-6
    )


def test_tabulated_reflectance_is_within_a_millionth_of_the_exact_one(lai):
    options = {"bands": TM34, "hotspot": 0.1, "leaf_angles": "planophile"}
    fast, exact = (lai.fifesim.surface_reflectance("TM", **options, exact=each) for each in (False, True))
    np.testing.assert_allclose(fast, exact, rtol=0, atol=1e-6)


def test_there_and_back_through_the_atmosphere(whole):
    np.testing.assert_allclose(whole["toa"].fifesim.to_surface(), whole["rho"], rtol=0, atol=1e-12)


def test_image_goes_back_to_the_surface_within_its_counts(whole):
    """Half a count is 0.002 of reflectance in TM3 and 0.001 in TM4, more below the atmosphere: 0.004."""
    truth = fifesim.aggregate(whole["rho"], 30.0)
    back = whole["image"].fifesim.to_surface()
    assert back.name == "surface_reflectance"
    # The line spread weighs the middle of a pixel more than the mean does: compare the averages of the image.
    np.testing.assert_allclose(back.mean(("y", "x")), truth.mean(("y", "x")), rtol=0, atol=0.004)


def user_raster(site, wavelengths):
    values = np.random.default_rng(1).uniform(0.05, 0.4, (len(wavelengths), *site.shape))
    array = xr.DataArray(values, dims=("band", "y", "x"), coords={"wavelength": ("band", wavelengths)}, name="mine")
    return grids.place(array, site)


def test_user_raster_with_only_wavelengths_goes_through(site):
    """No band names, no instrument, no sun: the paper's sun, narrow bands, and the instrument's nearest ones."""
    mine = user_raster(site, [0.665, 0.842])
    toa = check_raster_function(fifesim.to_toa, mine, quantity="toa_reflectance")
    responses = tuple(
        fifesim.Band("narrow", (centre - 0.0025, centre, centre + 0.0025), (0.0, 1.0, 0.0)) for centre in (0.665, 0.842)
    )
    sun = fifesim.fife_geometry()
    terms = engines.band_terms(fifesim.Atmosphere(), responses, sun.sza, sun.vza, sun.raa)
    factors = [
        getattr(terms, name)[:, None, None]
        for name in (
            "path_reflectance", "transmittance_down", "transmittance_up", "spherical_albedo", "gas_transmittance"
        )
    ]  # fmt: skip
    np.testing.assert_array_equal(toa, coupling.apparent_reflectance(mine.values, *factors))
    image = fifesim.sense(toa, "TM")
    assert image["band"].values.tolist() == TM34
    assert np.isfinite(image.fifesim.ndvi()).all()
    np.testing.assert_allclose(toa.fifesim.to_surface(), mine, rtol=0, atol=1e-12)


def test_user_raster_may_name_the_instrument(site):
    mine = user_raster(site, [0.66, 0.83])
    as_tm = fifesim.to_toa(mine, instrument="TM")
    named = fifesim.to_toa(mine.assign_coords(band=TM34), instrument="TM")
    np.testing.assert_array_equal(as_tm, named)
    assert not np.array_equal(as_tm, fifesim.to_toa(mine))


def test_raster_without_bands_is_refused(site):
    with pytest.raises(ValueError, match=r"neither an instrument nor a wavelength: give instrument="):
        fifesim.to_toa(user_raster(site, [0.66, 0.83]).drop_vars("wavelength"))


def test_geometry_travels_with_the_raster(lai):
    sun = Geometry(50.0, 140.0, 8.0, 20.0, 1.01)
    image = lai.fifesim.surface_reflectance("TM", bands=TM34, geometry=sun).fifesim.to_toa().fifesim.sense("TM")
    assert cf.geometry_of(image) == sun
    assert cf.geometry_of(image.fifesim.ndvi()) == sun


def test_ndvi_is_from_planetary_reflectance(whole):
    rho = whole["image"].fifesim.to_reflectance()
    red, nir = rho.sel(band="TM3").values, rho.sel(band="TM4").values
    np.testing.assert_array_equal(whole["image"].fifesim.ndvi(), (nir - red) / (nir + red))
    np.testing.assert_array_equal(whole["image"].fifesim.to_radiance().fifesim.ndvi(), whole["ndvi"])
    np.testing.assert_array_equal(rho.fifesim.ndvi(), whole["ndvi"])


def test_hole_in_the_ground_is_no_data_in_the_image(lai):
    lai[18:27, 27:36] = np.nan
    image = lai.fifesim.surface_reflectance("TM", bands=TM34).fifesim.to_toa().fifesim.sense("TM")
    holes = image == 0
    assert holes[:, 2, 3].all() and int(holes.sum()) == 2
    np.testing.assert_array_equal(np.isnan(image.fifesim.ndvi()), holes[0])


@pytest.mark.parametrize(
    "options, message",
    [
        ({"horizon": 1}, "a horizon stands around a dem"),
        ({"instrument": "TN"}, "TM"),
        ({"bands": ["TM33"]}, "TM3"),
        ({"leaf_optics": {"TM3": (0.8, 0.3), "TM4": (0.5, 0.4)}}, "TM3|sum|1"),
        ({"background": -0.1}, "background|0"),
        ({"leaf_angles": "sphere"}, "spherical"),
        ({"hotspot": -1}, "hotspot"),
    ],
)
def test_impossible_ground_is_refused(lai, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.surface_reflectance(lai, **({"bands": TM34} | options))


def test_low_sun_is_refused_by_the_atmosphere(lai):
    with pytest.raises(ValueError, match=r"sza.*89"):
        fifesim.surface_reflectance(lai, geometry=Geometry(89.0, 100.0))


SMALL = {
    "grid": {"west": 704970.0 + 600, "north": 4334220.0 - 300, "width": 180.0, "height": 150.0},
    "ground": {"seed": 7},
    "terrain": {"dem": "flat"},
}


def test_scenario_runs_the_chain(whole, site):
    scenario = fifesim.Scenario.model_validate(SMALL)
    with no_compute():
        tree = fifesim.simulate(scenario)
    assert grids.same_grid(grids.geobox(tree["scene"]["lai"]), site)
    np.testing.assert_array_equal(tree["scene"]["lai"], whole["lai"])
    np.testing.assert_array_equal(tree["image"]["dn"], whole["image"])
    np.testing.assert_array_equal(tree["image"]["ndvi"], whole["ndvi"])
    np.testing.assert_array_equal(tree["truth"]["lai"], whole["truth"])
    np.testing.assert_array_equal(tree["truth"]["fpar"], fifesim.aggregate(fifesim.fpar(whole["lai"]), 30.0))


def test_scenario_options_reach_their_stages():
    options = SMALL | {
        "atmosphere": {"visibility": 23},
        "geometry": {"sza": 40.0, "saa": 100.0, "vza": 5.0, "vaa": 10.0},
        "sensor": {"bands": ["TM5"], "pixel": 50.0},
    }
    tree = fifesim.simulate(fifesim.Scenario.model_validate(options))
    image = tree["image"]["dn"]
    assert "ndvi" not in tree["image"]
    assert image["band"].values.tolist() == ["TM5"]
    assert grids.cell_size(grids.geobox(image)) == (50.0, 50.0)
    assert cf.geometry_of(image) == Geometry(40.0, 100.0, 5.0, 10.0, earth_sun_distance(FIFE_TIME))
    assert fifesim.Atmosphere.parse(image.attrs["atmosphere"]).visibility == 23


def test_leaf_and_spectra_of_a_scenario_reach_the_canopy():
    options = SMALL | {
        "ground": {"leaf": {"chlorophyll": 55.0}, "background_spectra": {"soil_wet": 0.5, "golden_grass": 0.5}},
        "sensor": {"instrument": "OLI", "bands": ["OLI4", "OLI5"]},
    }
    scenario = fifesim.Scenario.model_validate(options)
    tree = fifesim.simulate(scenario)
    rho = fifesim.surface_reflectance(
        tree["scene"]["lai"],
        "OLI",
        bands=["OLI4", "OLI5"],
        geometry=scenario.sun_and_view(),
        leaf_optics=fifesim.Leaf(chlorophyll=55.0),
        background={"soil_wet": 0.5, "golden_grass": 0.5},
    )
    np.testing.assert_array_equal(tree["image"]["dn"], fifesim.to_toa(rho).fifesim.sense("OLI"))


def test_every_key_of_a_scenario_reaches_its_stage():
    """Each key differs from its default, so that one that is left out changes the bits."""
    bands = ["TM3", "TM4"]
    leaf, back = {"TM3": (0.1, 0.08), "TM4": (0.5, 0.4)}, {"TM3": 0.1, "TM4": 0.2}
    options = {
        "grid": SMALL["grid"],
        "terrain": SMALL["terrain"],
        "ground": {
            "distribution": "burned-ungrazed",
            "arp": 0.2,
            "seed": 11,
            "method": "periodic",
            "leaf_angles": "planophile",
            "hotspot": 0.2,
            "fpar_inf": 0.9,
            "leaf_reflectance": {band: optics[0] for band, optics in leaf.items()},
            "leaf_transmittance": {band: optics[1] for band, optics in leaf.items()},
            "background": back,
        },
        "geometry": {"sza": 40.0, "saa": 100.0, "vza": 5.0, "vaa": 10.0},
        "atmosphere": {"visibility": 23, "altitude": 1.0},
        "sensor": {"bands": bands, "pixel": 50.0, "min_valid": 1.0},
    }
    tree = fifesim.simulate(fifesim.Scenario.model_validate(options))
    sun = Geometry(40.0, 100.0, 5.0, 10.0, earth_sun_distance(FIFE_TIME))
    grid = grids.grid_at("EPSG:26914", *SMALL["grid"].values(), 30 / 9)
    lai = fifesim.lai_scene(grid, "burned-ungrazed", arp=0.2, seed=11, method="periodic")
    rho = fifesim.surface_reflectance(
        lai,
        bands=bands,
        atmosphere=fifesim.Atmosphere(visibility=23, altitude=1.0),
        geometry=sun,
        leaf_optics=leaf,
        background=back,
        leaf_angles="planophile",
        hotspot=0.2,
    )
    image = fifesim.sense(fifesim.to_toa(rho), onto=grids.aligned(grid, 50.0), min_valid=1.0)
    fpar = fifesim.fpar(lai, geometry=sun, leaf_angles="planophile", fpar_inf=0.9)
    np.testing.assert_array_equal(tree["image"]["dn"], image)
    np.testing.assert_array_equal(tree["truth"]["lai"], fifesim.aggregate(lai, 50.0, min_valid=1.0))
    np.testing.assert_array_equal(tree["truth"]["fpar"], fifesim.aggregate(fpar, 50.0, min_valid=1.0))


def own_instrument(name, tm3):
    """The Thematic Mapper with another name, or the response of another band in TM3."""
    tm = instrument("TM")
    bands = tuple(
        dataclasses.replace(band, srf=tm.select(tm3)[0].srf) if band.name == "TM3" else band for band in tm.bands
    )
    return dataclasses.replace(tm, name=name, bands=bands)


@pytest.mark.parametrize("mine", [own_instrument("MINE", "TM3"), own_instrument("TM", "TM1")])
def test_the_response_of_ones_own_instrument_is_never_guessed(lai, mine):
    rho = fifesim.surface_reflectance(lai, mine, bands=["TM3", "TM4"])
    with pytest.raises(ValueError, match="give it as instrument="):
        fifesim.to_toa(rho)
    fifesim.to_toa(rho, instrument=mine)


def test_one_band_goes_through_the_chain(lai):
    rho = fifesim.surface_reflectance(lai, bands=["TM3", "TM4"])
    both = fifesim.sense(fifesim.to_toa(rho))
    one = fifesim.sense(fifesim.to_toa(rho.sel(band="TM4")))
    np.testing.assert_array_equal(one.squeeze("band"), both.sel(band="TM4"))


@pytest.mark.parametrize(
    "step", [lambda image: image.fifesim.aggregate(60), lambda image: image[0].fifesim.regress(image[1])]
)
def test_digital_numbers_are_no_values_to_average(lai, step):
    """Their 0 is no data and would be taken for dark ground."""
    image = fifesim.sense(fifesim.to_toa(fifesim.surface_reflectance(lai, bands=["TM3", "TM4"])))
    with pytest.raises(ValueError, match="digital numbers"):
        step(image)
