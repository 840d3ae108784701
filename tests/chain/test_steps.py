"""Figure 1 end to end: calls by users, eager and lazy, and the values passed between stages."""

import numpy as np
import pytest
import xarray as xr
from lazy import no_compute

import fifesim
from fifesim.atmosphere import engines
from fifesim.chain.steps import kt_and_reflectance
from fifesim.grids import directions
from fifesim.grids import grid as grids
from fifesim.ground.canopy import optics
from fifesim.ground.canopy.labels import BandCanopy, Light, level_reflectance
from fifesim.sensor.description.instruments import instrument

TM34 = ["TM3", "TM4"]


@pytest.mark.parametrize("chunks", [{"y": 27, "x": 36}, {"y": 23, "x": 31}, "auto"], ids=str)
def test_lazy_chain_is_identical_and_computes_nothing_early(site, contract, whole, chunks):
    with no_compute():
        lazy = contract(site, chunks=chunks)
    for name, array in lazy.items():
        assert array.chunks is not None, name
        xr.testing.assert_identical(array.compute(), whole[name])
    assert fifesim.regress(lazy["truth"], lazy["ndvi"]) == fifesim.regress(whole["truth"], whole["ndvi"])


def test_every_step_is_on_the_right_grid(site, whole):
    for name in ("lai", "rho", "toa"):
        assert grids.same_grid(grids.geobox(whole[name]), site)
    pixels = grids.aligned_grid(site, 30.0)
    for name in ("image", "ndvi", "truth"):
        assert grids.same_grid(grids.geobox(whole[name]), pixels)
        np.testing.assert_array_equal(whole[name]["x"], grids.coordinates(pixels)["x"])
    assert (whole["truth"] + whole["ndvi"]).shape == tuple(pixels.shape)


def test_one_selected_band_gives_the_same_values(whole):
    one = whole["rho"].isel(band=0).fifesim.to_toa()
    np.testing.assert_array_equal(one.squeeze(), whole["toa"][0])


def test_history_lists_every_stage(whole):
    verbs = [line.split(":")[0] for line in whole["ndvi"].attrs["history"].splitlines()]
    assert verbs == ["lai_scene", "surface_reflectance", "to_toa", "sense", "to_radiance", "to_reflectance", "ndvi"]
    assert whole["ndvi"].attrs["rng_seed"] == "7"


def test_defaults_are_the_paper_case(lai):
    rho = fifesim.surface_reflectance(lai, bands=TM34)
    assert fifesim.Atmosphere.parse(rho.attrs["atmosphere"]) == fifesim.Atmosphere()
    assert fifesim.Atmosphere().visibility == 45.0
    assert directions.geometry_of(rho) == fifesim.fife_geometry()
    assert rho.attrs["instrument"] == "TM"
    assert fifesim.surface_reflectance(lai).sizes["band"] == 6


def test_skylight_of_the_atmosphere_reaches_the_ground(lai):
    """The diffuse fraction of 5S mixes the two reflectances of SAIL; haze changes both stages."""
    haze = fifesim.Atmosphere(visibility=10.0)
    rho = lai.fifesim.surface_reflectance("TM", bands=TM34, atmosphere=haze)
    bands = instrument("TM").select(TM34)
    sun = fifesim.fife_geometry()
    terms = engines.band_terms(haze, tuple(band.response for band in bands), sun.sza, sun.vza, sun.raa)
    stand = BandCanopy(fifesim.Canopy(), optics.band_leaf_optics(TM34), None, optics.band_background(TM34))
    expected = level_reflectance(lai, bands, stand, Light(sun, terms.diffuse_fraction))
    np.testing.assert_array_equal(rho, expected)
    assert not np.array_equal(rho, lai.fifesim.surface_reflectance("TM", bands=TM34))
    assert rho.fifesim.to_toa().attrs["atmosphere"] == haze.text


def test_background_is_a_number_a_mapping_or_a_raster(lai):
    def over(background, **options):
        canopy = fifesim.Canopy(background=background)
        return lai.fifesim.surface_reflectance("TM", bands=TM34, canopy=canopy, **options)

    raster = xr.full_like(lai, 0.2)
    np.testing.assert_array_equal(over(0.2), over({"TM3": 0.2, "TM4": 0.2}))
    np.testing.assert_allclose(over(raster), over(0.2), rtol=0, atol=1e-6)
    np.testing.assert_allclose(over(raster, exact=True), over(0.2, exact=True), rtol=1e-12)


def test_to_surface_inverts_to_toa(whole):
    np.testing.assert_allclose(whole["toa"].fifesim.to_surface(), whole["rho"], rtol=0, atol=1e-12)


def test_surface_reflectance_is_recovered_within_quantisation(whole):
    """Half a count is 0.002 in reflectance in TM3 and 0.001 in TM4, and more at the surface: 0.004."""
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


def test_impossible_ground_is_refused(lai):
    with pytest.raises(ValueError, match="a horizon needs an elevation"):
        horizon = xr.DataArray(np.zeros((16, 2, 2)), dims=("direction", "y", "x"))
        fifesim.surface_reflectance(lai, bands=TM34, horizon=horizon)
    with pytest.raises(ValueError, match=r"sza.*89"):
        fifesim.surface_reflectance(lai, geometry=fifesim.Geometry(89.0, 100.0))
    with pytest.raises(ValueError, match="background"):
        fifesim.surface_reflectance(lai, bands=TM34, canopy=fifesim.Canopy(background=-0.1))
    for dem, slopes in ((None, "uprigt"), (fifesim.flint_hills(grids.geobox(lai), seed=7), "Upright")):
        with pytest.raises(ValueError, match=f"slopes must be 'kt' or 'upright', got '{slopes}'"):
            fifesim.surface_reflectance(lai, bands=TM34, dem=dem, slopes=slopes)


def test_indices_are_from_planetary_reflectance(whole):
    rho = whole["image"].fifesim.to_reflectance()
    red, nir = rho.sel(band="TM3").values, rho.sel(band="TM4").values
    np.testing.assert_array_equal(whole["ndvi"], (nir - red) / (nir + red))
    for image in (whole["image"].fifesim.to_radiance(), rho):
        np.testing.assert_array_equal(image.fifesim.ndvi(), whole["ndvi"])
    np.testing.assert_array_equal(whole["image"].fifesim.index("EVI2"), 2.5 * (nir - red) / (nir + 2.4 * red + 1))
    np.testing.assert_array_equal(whole["image"].fifesim.index("NDVI"), whole["ndvi"])


def test_regression_refuses_digital_numbers(whole):
    """Digital number 0 is no data and would count as dark ground."""
    with pytest.raises(ValueError, match="digital numbers, whose 0 is no data"):
        whole["image"][0].fifesim.regress(whole["image"][1])


def test_band_names_that_contradict_wavelengths_are_rejected():
    """Swapped wavelengths of TM3 and TM4 would change the sign. Bands with other names may have any wavelength."""
    values = np.stack([np.full((4, 4), 0.06), np.full((4, 4), 0.30)])
    rho = xr.DataArray(values, dims=("band", "y", "x"), coords={"wavelength": ("band", [0.83, 0.66])})
    rho = rho.assign_coords(x=705000 + 30.0 * np.arange(4), y=4334000 - 30.0 * np.arange(4)).rio.write_crs(26914)
    for index in (fifesim.ndvi, lambda each: fifesim.index(each, "NDVI")):
        with pytest.raises(ValueError, match=r"band TM3 has the wavelength 0.83 um, .*contradict each other"):
            index(rho.assign_coords(band=["TM3", "TM4"]))
    assert float(fifesim.ndvi(rho.assign_coords(band=["first", "second"])).mean()) < 0
    right = rho.assign_coords(band=["TM3", "TM4"], wavelength=("band", [0.66, 0.83]))
    assert float(fifesim.ndvi(right).mean()) > 0


def test_reflectance_and_kt_share_the_sky_view_in_the_graph(lai):
    """Reflectance on slopes and Kt share all layers of the graph except the last layer of each."""
    grid = grids.geobox(lai)
    lai, dem = lai.chunk({"y": 20, "x": 30}), fifesim.flint_hills(grid, seed=7, chunks=25)
    level, slopes = (lai.fifesim.surface_reflectance("TM", bands=["TM4"], dem=each) for each in (None, dem))
    own = set(level.fifesim.kt(dem).data.dask.layers) - set(slopes.data.dask.layers)
    assert len(own) == 1, own


def test_kt_warns_if_elevation_and_atmosphere_altitude_differ(lai):
    """Reflectance on the same slopes warns too."""
    level = lai.fifesim.surface_reflectance("TM", bands=["TM4"])
    dem = fifesim.flint_hills(grids.geobox(lai), seed=7)
    with pytest.warns(UserWarning, match="beside an altitude of the atmosphere of 0.4 km"):
        level.fifesim.kt(dem + 2000.0)


@pytest.mark.parametrize("upwelling", [True, False])
def test_one_pass_equals_both_steps(lai, upwelling):
    """Labels are equal too, and the results are lazy."""
    dem = fifesim.flint_hills(grids.geobox(lai), seed=7)
    level = fifesim.surface_reflectance(lai.chunk(20), bands=TM34)
    found = kt_and_reflectance(level, dem, upwelling=upwelling)
    on_slopes = fifesim.surface_reflectance(lai, bands=TM34, dem=dem, upwelling=upwelling)
    for one, other in zip(found, (level.fifesim.kt(dem), on_slopes), strict=True):
        assert one.chunks is not None
        xr.testing.assert_identical(one.compute(), other.compute())
