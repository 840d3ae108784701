"""Processing a stack of dates equals processing each date alone."""

import numpy as np
import pytest
import xarray as xr
from lazy import in_chunks, no_compute

import fifesim
from fifesim.grids.dates import epoch, joined

TIMES = np.array(["2022-05-01T17:00", "2022-06-01T17:00", "2022-07-01T16:50"], "M8[ns]")
NOISE = {"noise": "thermal", "noise_models": fifesim.NoiseModel(shot=0.0, thermal=0.5), "quantise": False}


@pytest.fixture(scope="module")
def season(lai_values):
    """Leaf area at three dates on the same cells."""
    dates = [(lai_values * share).assign_coords(time=time) for share, time in zip((0.4, 1.0, 1.4), TIMES, strict=True)]
    return joined(dates)


def run_chain(lai):
    toa = lai.fifesim.surface_reflectance("TM", bands=["TM3", "TM4"]).fifesim.to_toa()
    image = toa.fifesim.sense()
    noisy = toa.fifesim.sense(seed=3, **NOISE)
    of_image = image, noisy, image.fifesim.ndvi(), image.fifesim.to_surface()
    return toa, *of_image, lai.fifesim.fpar(), lai.fifesim.aggregate(30)


def test_each_date_equals_the_date_processed_alone(season):
    together = run_chain(season)
    for number in range(3):
        for stack, alone in zip(together, run_chain(season.isel(time=number)), strict=True):
            assert stack.dims[0] == "time"
            xr.testing.assert_equal(stack.isel(time=number), alone)


def test_each_date_has_its_sun_position(season):
    toa = run_chain(season)[0]
    assert toa["sza"].dims == ("time",) and toa["vza"].dims == ()
    for number, time in enumerate(TIMES):
        sun = fifesim.grids.directions.sun_over(season.odc.geobox, time)
        assert toa["sza"][number] == pytest.approx(sun.sza, abs=1e-9)
    assert toa.odc.crs == season.odc.crs


def test_noise_differs_between_dates_and_the_fixed_pattern_does_not(season):
    toa = joined([season.isel(time=0).assign_coords(time=time) for time in TIMES[:2]])
    toa = toa.fifesim.surface_reflectance("TM", bands=["TM3"], geometry=fifesim.fife_geometry()).fifesim.to_toa()
    one, other = toa.fifesim.sense(**NOISE)
    assert not np.any(one.values == other.values)
    model = fifesim.NoiseModel(shot=0.0, thermal=0.5, gain_spread=0.01, offset_spread=0.1, detectors=16)
    one, other = toa.fifesim.sense(noise="fixed-pattern", noise_models=model, quantise=False)
    np.testing.assert_array_equal(one, other)


def test_stack_of_dates_stays_lazy(season):
    lazy = in_chunks(season, {"y": 20, "x": 27})
    with no_compute():
        results = run_chain(lazy)
    for made, known in zip(results, run_chain(season), strict=True):
        np.testing.assert_array_equal(made.compute(), known)


def test_other_rasters_may_have_the_same_dates(season):
    background = xr.zeros_like(season) + xr.DataArray([0.1, 0.2, 0.3], dims="time")
    rho = season.fifesim.surface_reflectance("TM", bands=["TM3"], canopy=fifesim.Canopy(background=background))
    alone = season[2].fifesim.surface_reflectance("TM", bands=["TM3"], canopy=fifesim.Canopy(background=background[2]))
    np.testing.assert_array_equal(rho[2], alone)
    with pytest.raises(ValueError, match=r"the times of .* differ from the times of the raster"):
        season.fifesim.surface_reflectance("TM", canopy=fifesim.Canopy(background=background[:2]))


def test_epochs_are_seconds():
    """Images one second apart draw different noise; an image without a time uses epoch 0."""
    at = [xr.DataArray(1.0, coords={"time": np.datetime64(f"2022-05-01T17:00:0{s}")}) for s in (0, 1)]
    assert epoch(at[1]) - epoch(at[0]) == 1 and epoch(at[0]) > 0
    assert epoch(xr.DataArray(1.0)) == 0
    days = (np.datetime64("2022-05-01") - np.datetime64("0001-01-01")).astype(int)
    for unit in ("s", "us", "ns"):
        time = np.datetime64("2022-05-01T17:00:00").astype(f"M8[{unit}]")
        assert epoch(xr.DataArray(1.0, coords={"time": time})) == days * 86400 + 17 * 3600
    others = {epoch(xr.DataArray(1.0, coords={"time": label})) for label in (0, 1, "May")}
    assert len(others) == 3 and 0 not in others


def test_nested_arguments_may_have_dates(season):
    season = season[:, :9, :9]
    background = xr.zeros_like(season) + xr.DataArray([0.1, 0.2, 0.3], dims="time")
    leaf = fifesim.Leaf(chlorophyll=background.drop_attrs(deep=False) * 200)
    canopy = fifesim.Canopy(background={"TM3": background}, leaf_optics=leaf)
    rho = season.fifesim.surface_reflectance("TM", bands=["TM3"], canopy=canopy)
    leaf = fifesim.Leaf(chlorophyll=leaf.chlorophyll[1])
    canopy = fifesim.Canopy(background={"TM3": background[1]}, leaf_optics=leaf)
    expected = season[1].fifesim.surface_reflectance("TM", bands=["TM3"], canopy=canopy)
    np.testing.assert_array_equal(rho[1], expected)


def test_inconsistent_dates_are_rejected(season):
    with pytest.raises(ValueError, match=r"dimension time has no coordinate.*assign_coords\(time="):
        season.drop_vars("time").fifesim.surface_reflectance("TM")
    with pytest.raises(ValueError, match="the raster has a dimension time: leave time= out"):
        season.fifesim.surface_reflectance("TM", time="2022-05-01T17:00Z")
    with pytest.raises(ValueError, match="dem has dates and the raster of kt has none"):
        fifesim.kt(season[0].fifesim.surface_reflectance("TM"), season * 0)
    with pytest.raises(ValueError, match="background has dates and the raster of surface_reflectance has none"):
        season[0].fifesim.surface_reflectance("TM", canopy=fifesim.Canopy(background=season / 30))
