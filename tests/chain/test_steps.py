"""Figure 1 end to end: calls by users, eager and lazy, and the values passed between stages."""

import numpy as np
import pytest
import xarray as xr
from lazy import no_compute

import fifesim
from fifesim.atmosphere import engines
from fifesim.base.geometry import Geometry
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
    number, mapping = (
        lai.fifesim.surface_reflectance("TM", bands=TM34, canopy=fifesim.Canopy(background=value))
        for value in (0.2, {"TM3": 0.2, "TM4": 0.2})
    )
    raster = xr.full_like(lai, 0.2)
    np.testing.assert_array_equal(number, mapping)
    from_raster = lai.fifesim.surface_reflectance("TM", bands=TM34, canopy=fifesim.Canopy(background=raster))
    np.testing.assert_allclose(from_raster, number, rtol=0, atol=1e-6)
    exact = [
        lai.fifesim.surface_reflectance("TM", bands=TM34, canopy=fifesim.Canopy(background=value), exact=True)
        for value in (0.2, raster)
    ]
    np.testing.assert_allclose(exact[0], exact[1], rtol=1e-12)


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


@pytest.mark.parametrize(
    "options, message",
    [
        (
            {"horizon": xr.DataArray(np.zeros((16, 2, 2)), dims=("direction", "y", "x"))},
            "a horizon needs an elevation",
        ),
        ({"instrument": "TN"}, "TM"),
        ({"bands": ["TM33"]}, "TM3"),
    ],
)
def test_impossible_ground_is_refused(lai, options, message):
    with pytest.raises(ValueError, match=message):
        fifesim.surface_reflectance(lai, **({"bands": TM34} | options))


@pytest.mark.parametrize(
    "field, message",
    [
        ({"leaf_optics": {"TM3": (0.8, 0.3), "TM4": (0.5, 0.4)}}, "TM3|sum|1"),
        ({"background": -0.1}, "background|0"),
        ({"leaf_angles": "sphere"}, "spherical"),
        ({"hotspot": -1}, "hotspot"),
    ],
)
def test_impossible_canopy_is_refused(lai, field, message):
    with pytest.raises(ValueError, match=message):
        fifesim.surface_reflectance(lai, bands=TM34, canopy=fifesim.Canopy(**field))


def test_low_sun_is_refused_by_the_atmosphere(lai):
    with pytest.raises(ValueError, match=r"sza.*89"):
        fifesim.surface_reflectance(lai, geometry=Geometry(89.0, 100.0))
