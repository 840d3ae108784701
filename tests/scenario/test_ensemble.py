"""Chips, scenes simulated alone and public functions give the same bits, and each key changes the result."""

from functools import cache
from json import dumps, loads

import numpy as np
import pytest
import xarray as xr
from mistakes import cases, lines

import fifesim
from fifesim.grids import grid as grids
from fifesim.scenario.ensemble import LIGHT, realise, realise_arrays
from fifesim.scenario.ground import elevation, ground_scene
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import clouds_of, setup_of, simulate

SMALL = {"width": 300.0, "height": 240.0, "west": 708000.0, "north": 4331000.0}

FLAT = {"dem": "flat"}

# Each case changes settings that the others leave at their defaults.
NOT_LEARNED = {"learned": "none"}

STREAMS = {"lambert": False, "four-stream": True, "directional": "directional"}


def scenario(**tables):
    return Scenario(**merged({"grid": SMALL, "landscape": NOT_LEARNED}, {"terrain": FLAT} | tables))


def by_verbs(one):
    """Image of a scenario by public functions."""
    setup, grid = setup_of(one), one.geobox()
    dem, horizon, _ = elevation(one, grid)
    land, air = ground_scene(one, grid), {"atmosphere": setup.atmosphere, "geometry": setup.geometry}
    slopes = {} if dem is None else {"dem": dem, "horizon": horizon, "slopes": setup.slopes}
    rho = land.fifesim.surface_reflectance(
        setup.instrument, bands=setup.bands, canopy=setup.canopy, upwelling=setup.upwelling, **slopes, **air,
        streams=STREAMS[setup.coupling],
    )  # fmt: skip
    clouds = None if setup.clouds is None else fifesim.atmosphere.cast_clouds(rho, clouds_of(one, grid, None), dem=dem)
    toa = fifesim.to_toa(rho, adjacency=setup.adjacency, clouds=clouds)
    return fifesim.sense(
        toa, setup.instrument, onto=setup.onto, interval=setup.interval, offset=setup.offset, noise=setup.noise,
        noise_models=setup.noise_models, seed=setup.seed, min_valid=setup.min_valid,
    )  # fmt: skip


@pytest.mark.parametrize(("case", "name"), cases("combination"), ids=str)
def test_realisation_and_public_functions_are_identical_to_simulating_the_scenario(case, name):
    one = scenario(**case)
    alone, found = simulate(one), realise(one)
    assert list(found) == ["image", "truth"]
    for name, node in found.items():
        expected = alone[name].to_dataset().compute()
        assert set(node.variables) == set(expected.variables)
        for key, variable in expected.variables.items():
            got = node.variables[key]
            assert got.dtype == variable.dtype and got.dims == variable.dims
            np.testing.assert_array_equal(got, variable)
            # Attributes of a realisation are a subset of the attributes of the single simulation.
            assert {each: variable.attrs.get(each) for each in got.attrs} == got.attrs
        assert node.odc.geobox == expected.odc.geobox
    image, truth = realise_arrays(one)
    assert set(image) == {*found["image"].data_vars, *LIGHT} and set(truth) == set(found["truth"].data_vars)
    for name, values in (image | truth).items():
        np.testing.assert_array_equal(values, (found["image"] if name in image else found["truth"])[name])
    np.testing.assert_array_equal(by_verbs(one), found["image"]["dn"])


STAND_OF = {
    "ground": lambda others: {"ground": others},
    "classes.a": lambda others: {
        "landscape": {"cover": "pastures", "size": 100.0},
        "classes": {"a": others, "b": {"soil": 0.1}},
    },
}


def changes():
    """Value of each key that changes the image, the truth or the place, and the other keys that it needs."""
    found = {}
    for name, value, others, *along in lines("scenario_changes"):
        section, _, key = name.partition(".")
        if section == "stand":
            found |= {f"{place}.{key}": (value, needed(others)) for place, needed in STAND_OF.items()}
        else:
            found[name] = value, others, *along
    return found


CHANGES = changes()

# A key that changes neither image nor truth, but only a budget, and a key without which the scenario is an error.
OF_BUDGETS, NECESSARY = "clouds.mask", "terrain.fill"


def all_keys():
    """Names of the keys of a scenario, those of classes for a class a."""
    sections = Scenario(landscape={"cover": "pastures"}, classes={"a": {}}).sections()
    return [".".join((*place, key)) for place, section in sections.items() for key in type(section).model_fields]


def merged(one, other):
    """A table with the keys of another table, which replace its own."""
    common = {key for key in one.keys() & other.keys() if isinstance(one[key], dict)}
    return one | other | {key: merged(one[key], other[key]) for key in common}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Folder with rasters of leaf area, elevation with a gap, and cover around the scenes."""
    folder = tmp_path_factory.mktemp("files")
    grid = fifesim.grid_at("EPSG:26914", 707700, 4331300, width=900, height=900, cell=10)
    fifesim.lai_scene(grid, seed=3).rio.to_raster(folder / "lai.tif")
    dem = fifesim.flint_hills(grid, seed=3)
    dem.rio.to_raster(folder / "dem.tif")
    dem[38:40, 38:40] = np.nan
    dem.rio.to_raster(folder / "hole.tif")
    cover = np.indices(grid.shape).sum(axis=0) // 12 % 2 + 1
    raster = grids.place(xr.DataArray(cover.astype(np.uint8), dims=("y", "x")), grid)
    raster.rio.to_raster(folder / "cover.tif")
    return folder


@cache
def results(tables, complete):
    """Image and truth as arrays, with the coordinate reference system."""
    one = Scenario(**loads(tables))
    image, truth = realise_arrays(one, complete=complete)
    return image | truth | {"crs": np.array(one.geobox().crs.to_wkt())}


@pytest.mark.parametrize("name", all_keys())
def test_each_key_changes_the_result_equally_in_simulate_and_in_chips(files, monkeypatch, name):
    monkeypatch.chdir(files)
    value, others, *along = CHANGES[name]
    base = merged({"grid": SMALL | {"width": 240.0, "cell": 10.0}, "terrain": FLAT, "landscape": NOT_LEARNED}, others)
    changed = {name.split(".")[-1]: value}
    for part in name.split(".")[-2::-1]:
        changed = {part: changed}
    changed = merged(merged(base, changed), *along or [{}])
    # A complete image has no edge.
    complete = name not in ("ground.method", "sensor.min_valid")
    found = results(dumps(changed), complete)
    run = simulate(Scenario(**changed), None, complete=complete)
    assert not complete or (found["dn"] > 0).all()
    for each in set(found) - {"crs"}:
        node = run["image"] if each in run["image"].variables else run["truth"]
        np.testing.assert_array_equal(found[each], node[each], err_msg=each)
    if name == NECESSARY:
        with pytest.raises(ValueError, match="fill=20"):
            results(dumps(base), complete)
        return
    before = results(dumps(base), complete)
    differs = any(not np.array_equal(before.get(each), found[each]) for each in found)
    assert differs == (name != OF_BUDGETS)
