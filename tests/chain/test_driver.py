"""The chain by a Setup, on plain arrays and in one pass, compared with the labelled steps."""

from dataclasses import fields, replace

import dask
import numpy as np
import pytest
import xarray as xr
from lazy import no_compute

import fifesim
from fifesim.chain.driver import Driver, cell_block_means, varying_parts
from fifesim.chain.landscapes import seen_reflectance, seen_through_air
from fifesim.chain.setup import image_of, reflectance_of
from fifesim.grids import grid as grids
from fifesim.grids.windows import origin_of
from fifesim.ground.terrain.labels import light_on_slopes

GRID = fifesim.fife_site(10.0, ((300, 348), (200, 254)))
LAI = fifesim.lai_scene(GRID, arp=0.2, seed=3)


@pytest.fixture(scope="module")
def setup():
    geometry = fifesim.Geometry(35.0, 120.0, 20.0, 80.0, earth_sun_distance=1.01)
    return fifesim.Setup(
        "TM", bands=("TM4", "TM3"), geometry=geometry, canopy=fifesim.Canopy(brown=0.1), atmosphere=fifesim.Atmosphere()
    )


def test_steps_equal_the_labelled_steps_to_the_bit(setup):
    driver, labelled = Driver(setup), reflectance_of(setup, LAI)
    level = driver.reflectance(LAI.values)
    np.testing.assert_array_equal(level, labelled)
    toa = labelled.fifesim.to_toa()
    np.testing.assert_array_equal(driver.toa(level), toa)
    np.testing.assert_array_equal(driver.ndvi(driver.toa(level)), fifesim.ndvi(toa))
    means = cell_block_means(LAI.values, GRID, 35.0, 0.8)
    np.testing.assert_array_equal(means, fifesim.aggregate(LAI, 35.0, min_valid=0.8))
    for leaves in ("all", "green"):
        expected = fifesim.fpar(LAI, geometry=setup.geometry, canopy=fifesim.Canopy(brown=0.1), leaves=leaves)
        np.testing.assert_array_equal(driver.fpar(LAI.values, 0.94, leaves), expected)


def test_saturated_counts_are_no_data_as_in_the_labelled_steps(setup):
    toa = reflectance_of(setup, LAI).fifesim.to_toa()
    image = fifesim.sense(toa.where(toa.x > toa.x[30], 0.9), "TM")
    assert 0 < (image == 255).mean() < 1
    expected = image.fifesim.to_reflectance()
    np.testing.assert_array_equal(Driver(setup).planetary(image.values), expected)
    np.testing.assert_array_equal(np.isnan(expected), (image == 255) | (image == 0))


def test_reflectance_is_recovered_from_digital_numbers(setup):
    driver = Driver(setup)
    reflectance = np.linspace(0.05, 0.3, 60).reshape(2, 5, 6)
    dn = driver.recorded(driver.radiance(reflectance))
    assert dn.dtype == np.uint8
    step = driver.planetary(np.full((2, 1, 1), 2, np.uint8)) - driver.planetary(np.full((2, 1, 1), 1, np.uint8))
    assert (np.abs(driver.planetary(dn) - reflectance) <= step / 2 * (1 + 1e-9)).all()
    analogue = Driver(replace(setup, quantise=False))
    np.testing.assert_allclose(analogue.planetary(analogue.recorded(analogue.radiance(reflectance))), reflectance)


def test_varying_parts_are_named(setup):
    with pytest.raises(ValueError, match="do not support dem, adjacency, brown: use"):
        Driver(replace(setup, dem=LAI, adjacency=True, canopy=fifesim.Canopy(brown=LAI)))
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
def test_each_field_changes_the_image_and_arrays_support_or_refuse_it(setup, name):
    value, others = FIELDS[name]
    base = replace(setup, **{key: each for key, each in others.items() if key != name})
    changed = replace(base, **{name: value})
    before, expected = (image_of(each, reflectance_of(each, LAI), LAI) for each in (base, changed))
    assert before.dtype != expected.dtype or not np.array_equal(before, expected, equal_nan=True)
    xr.testing.assert_identical(expected, by_functions(changed))
    # Elevation is not a field of the setup of a driver but an argument of its steps.
    level, dem = replace(changed, dem=None, horizon=None), changed.dem
    if varying_parts(level):
        assert name in {*varying_parts(level), "surroundings"}
        return
    driver = Driver(level)
    found = driver.reflectance(LAI.values)
    if dem is not None:
        found = driver.on_slopes(found, light_on_slopes(dem, grids.geobox(LAI), changed.geometry, changed.horizon))
    image = driver.image(driver.toa(found), GRID)
    assert image.dtype == expected.dtype
    np.testing.assert_array_equal(image, expected)
    assert grids.same_grid(driver.pixels(GRID, level)[0], grids.geobox(expected))


def test_shared_driver_draws_noise_by_seed():
    setup = fifesim.Setup("OLI", bands=("B4", "B5"), geometry=fifesim.fife_geometry(), noise=("thermal",))
    driver = Driver(setup)
    toa = driver.toa(driver.reflectance(LAI.values))
    images = [driver.image(toa, GRID, replace(setup, seed=seed)) for seed in (1, 2)]
    assert (images[0] != images[1]).any()
    np.testing.assert_array_equal(images[1], Driver(replace(setup, seed=2)).image(toa, GRID))


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
