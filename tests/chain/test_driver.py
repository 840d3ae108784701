"""The chain on plain arrays compared with the labelled steps."""

from dataclasses import fields, replace

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.chain.driver import Driver, cell_block_means, varying_parts
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.grids import grid as grids
from fifesim.ground.terrain.labels import light_on_slopes

GRID = fifesim.fife_site(10.0, ((300, 348), (200, 254)))


@pytest.fixture(scope="module")
def lai():
    return fifesim.lai_scene(GRID, arp=0.2, seed=3)


@pytest.fixture(scope="module")
def setup():
    geometry = fifesim.Geometry(35.0, 120.0, 20.0, 80.0, earth_sun_distance=1.01)
    return fifesim.Setup(
        "TM", bands=("TM4", "TM3"), geometry=geometry, canopy=fifesim.Canopy(brown=0.1), atmosphere=fifesim.Atmosphere()
    )


def test_steps_equal_the_labelled_steps_to_the_bit(lai, setup):
    driver, labelled = Driver(setup), reflectance_of(setup, lai)
    level = driver.reflectance(lai.values)
    np.testing.assert_array_equal(level, labelled)
    toa = labelled.fifesim.to_toa()
    np.testing.assert_array_equal(driver.toa(level), toa)
    np.testing.assert_array_equal(driver.ndvi(driver.toa(level)), fifesim.ndvi(toa))
    for leaves in ("all", "green"):
        expected = fifesim.fpar(lai, geometry=setup.geometry, canopy=fifesim.Canopy(brown=0.1), leaves=leaves)
        np.testing.assert_array_equal(driver.fpar(lai.values, 0.94, leaves), expected)


def test_saturated_counts_are_no_data_as_in_the_labelled_steps(lai, setup):
    toa = reflectance_of(setup, lai).fifesim.to_toa()
    image = fifesim.sense(toa.where(toa.x > toa.x[30], 0.9), "TM")
    assert 0 < (image == 255).mean() < 1
    expected = image.fifesim.to_reflectance()
    np.testing.assert_array_equal(Driver(setup).planetary(image.values), expected)
    np.testing.assert_array_equal(np.isnan(expected), (image == 255) | (image == 0))


def test_slopes_equal_the_labelled_steps(lai, setup):
    dem = fifesim.flint_hills(GRID.pad(1), seed=2)
    setup = replace(setup, upwelling=False)
    light = light_on_slopes(dem, grids.geobox(lai), setup.geometry)
    found = Driver(setup).on_slopes(Driver(setup).reflectance(lai.values), light)
    np.testing.assert_array_equal(found, reflectance_of(replace(setup, dem=dem), lai))


def test_reflectance_is_recovered_from_digital_numbers(setup):
    driver = Driver(setup)
    reflectance = np.linspace(0.05, 0.3, 60).reshape(2, 5, 6)
    dn = driver.recorded(driver.radiance(reflectance))
    assert dn.dtype == np.uint8
    step = driver.planetary(np.full((2, 1, 1), 2, np.uint8)) - driver.planetary(np.full((2, 1, 1), 1, np.uint8))
    assert (np.abs(driver.planetary(dn) - reflectance) <= step / 2 * (1 + 1e-9)).all()
    analogue = Driver(replace(setup, quantise=False))
    np.testing.assert_allclose(analogue.planetary(analogue.recorded(analogue.radiance(reflectance))), reflectance)


def test_varying_parts_are_named(lai, setup):
    with pytest.raises(ValueError, match="do not support dem, adjacency, brown: use"):
        Driver(replace(setup, dem=lai, adjacency=True, canopy=fifesim.Canopy(brown=lai)))
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


@pytest.mark.parametrize("name", [each.name for each in fields(fifesim.Setup)])
def test_each_field_changes_the_image_and_arrays_support_or_refuse_it(lai, setup, name):
    value, others = FIELDS[name]
    base = replace(setup, **{key: each for key, each in others.items() if key != name})
    changed = replace(base, **{name: value})
    before, expected = (image_of(each, reflectance_of(each, lai), lai) for each in (base, changed))
    assert before.dtype != expected.dtype or not np.array_equal(before, expected, equal_nan=True)
    # Elevation is not a field of the setup of a driver but an argument of its steps.
    level, dem = replace(changed, dem=None, horizon=None), changed.dem
    if varying_parts(level):
        assert name in {*varying_parts(level), "surroundings"}
        return
    driver = Driver(level)
    found = driver.reflectance(lai.values)
    if dem is not None:
        found = driver.on_slopes(found, light_on_slopes(dem, grids.geobox(lai), changed.geometry, changed.horizon))
    np.testing.assert_array_equal(driver.image(driver.toa(found), GRID), expected)


@pytest.mark.parametrize(
    "own",
    [
        {},
        {"interval": "native", "offset": (0.4, -0.3)},
        {"instrument": "OLI", "bands": ("B4", "B5"), "noise": ("thermal",), "seed": 5},
        {"quantise": False, "interval": 45.0, "min_valid": 0.8},
    ],
)
def test_image_equals_the_labelled_image_to_the_bit(lai, own):
    setup = fifesim.Setup(**{"bands": ("TM3", "TM4"), "geometry": fifesim.fife_geometry()} | own)
    driver, level = Driver(setup), reflectance_of(setup, lai)
    found, expected = driver.image(driver.toa(level.values), GRID), image_of(setup, level)
    assert found.dtype == expected.dtype
    np.testing.assert_array_equal(found, expected)
    assert grids.same_grid(driver.pixels(GRID, setup)[0], grids.geobox(expected))
    means = cell_block_means(lai.values, GRID, 35.0, setup.min_valid)
    np.testing.assert_array_equal(means, fifesim.aggregate(lai, 35.0, min_valid=setup.min_valid))


def test_shared_driver_draws_noise_by_seed(lai):
    setup = fifesim.Setup("OLI", bands=("B4", "B5"), geometry=fifesim.fife_geometry(), noise=("thermal",))
    driver = Driver(setup)
    toa = driver.toa(driver.reflectance(lai.values))
    images = [driver.image(toa, GRID, replace(setup, seed=seed)) for seed in (1, 2)]
    assert (images[0] != images[1]).any()
    np.testing.assert_array_equal(images[1], Driver(replace(setup, seed=2)).image(toa, GRID))
