"""A Setup holds the arguments of all steps of the chain."""

from dataclasses import fields, replace

import xarray as xr

import fifesim
from fifesim.chain.setup import Setup, image_of, reflectance_of
from fifesim.grids import grid as grids

# Every field of ground, atmosphere and sampling differs from its default, as arguments of the public functions.
GROUND = {
    "bands": ("TM3", "TM4"),
    "atmosphere": fifesim.Atmosphere(visibility=23),
    "geometry": fifesim.Geometry(40.0, 100.0, 5.0, 10.0),
    "canopy": fifesim.Canopy(hotspot=0.2, brown=0.3, soil=0.03),
    "upwelling": False,
}
SENSOR = {
    "interval": (20.0, 25.0),
    "offset": (0.2, -0.1),
    "min_valid": 0.9,
    "noise": ("thermal",),
    "noise_models": fifesim.NoiseModel(thermal=2.0, shot=0.0),
    "seed": 5,
    "quantise": False,
}


def test_all_fields_reach_their_steps(lai, site):
    dem = fifesim.flint_hills(site.pad(1), seed=7)
    horizon = fifesim.horizon(fifesim.flint_hills(site.pad(40), seed=7))
    air = {"adjacency": True, "surroundings": 0.3}
    sky = fifesim.cloud_field(site, 0.8, seed=2, length=300, height=100, margin=500)
    setup = Setup(instrument="TM", dem=dem, horizon=horizon, clouds=sky, **GROUND, **air, **SENSOR)
    rho = fifesim.surface_reflectance(lai, "TM", dem=dem, horizon=horizon, **GROUND)
    xr.testing.assert_identical(reflectance_of(setup, lai), rho)
    cells = fifesim.atmosphere.cast_clouds(rho, sky, dem=dem)
    assert cells.cloud.any()
    image = fifesim.sense(fifesim.to_toa(rho, **air, clouds=cells), "TM", **SENSOR)
    xr.testing.assert_identical(image_of(setup, rho), image)
    told = {"instrument", "dem", "horizon", "clouds", *GROUND, *air, *SENSOR}
    upright = replace(setup, slopes="upright", canopy=fifesim.Canopy(hotspot=0.2))
    own = GROUND | {"canopy": upright.canopy, "slopes": "upright"}
    expected = fifesim.surface_reflectance(lai, "TM", dem=dem, horizon=horizon, **own)
    xr.testing.assert_identical(reflectance_of(upright, lai), expected)
    # Coupling has separate tests.
    assert {field.name for field in fields(Setup)} - told == {"onto", "slopes", "coupling"}


def test_pixels_can_be_on_a_given_grid(lai, site, whole):
    pixels = fifesim.grid_at(site.crs, site.affine.c + 7.0, site.affine.f - 11.0, 90, 60, 30)
    setup = replace(Setup(bands=("TM3", "TM4")), onto=pixels)
    xr.testing.assert_identical(image_of(setup, whole["rho"]), whole["toa"].fifesim.sense("TM", onto=pixels))


def test_defaults_equal_the_defaults_of_the_functions(lai, whole):
    setup = Setup(bands=("TM3", "TM4"))
    xr.testing.assert_identical(image_of(setup, reflectance_of(setup, lai)), whole["image"])


def test_repr_shows_fields_that_differ_from_defaults(lai):
    assert repr(Setup()) == "Setup(instrument='TM')"
    said = repr(Setup("OLI", dem=lai, canopy=fifesim.Canopy(hotspot=0.1), onto=grids.geobox(lai), noise=("shot",)))
    assert said == (
        "Setup(instrument='OLI', canopy=Canopy(hotspot=0.1), dem=<DataArray of y 45 x x 54>, "
        "onto=<GeoBox of y 45 x x 54>, noise=('shot',))"
    )
    assert repr(Setup(fifesim.instrument("TM"))) == "Setup(instrument='TM')"
