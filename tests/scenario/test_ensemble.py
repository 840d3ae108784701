from functools import cache
from json import dumps, loads

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.grids import grid as grids
from fifesim.scenario.ensemble import LIGHT, realise, realise_arrays
from fifesim.scenario.ground import elevation, ground_scene
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import clouds_of, setup_of, simulate

SMALL = {"width": 300.0, "height": 240.0, "west": 708000.0, "north": 4331000.0}
FLAT = {"dem": "flat"}
NOISE = {"noise": ["thermal"], "seed": 3}

# Each case changes settings that the others leave at their defaults.
NOT_LEARNED = {"learned": "none"}
CASES = {
    "flat": {},
    "learned": {"landscape": {"learned": "konza"}},
    "periodic": {"ground": {"method": "periodic", "arp": 0.24}},
    "native": {"sensor": {"interval": "native"}},
    "metres": {"sensor": {"interval": 25.0, "offset": [0.3, -0.2]}},
    "oblique": {"geometry": {"sza": 50.0, "saa": 130.0, "vza": 30.0, "vaa": 100.0}},
    "hazy": {"atmosphere": {"visibility": 8.0, "aerosol": "urban"}},
    "noisy": {"sensor": {"instrument": "OLI", **NOISE}},
    "eight bands": {"sensor": {"instrument": "MSI", "bands": ["B2", "B3", "B4", "B8"]}},
    "one band": {"sensor": {"bands": ["TM4"]}},
    "canopy": {"ground": {"brown": 0.2, "crown_cover": 0.7, "hotspot": 0.05, "leaf_angles": "planophile"}},
    "leaf": {"ground": {"leaf": {"chlorophyll": 30.0}, "background_spectra": {"soil_dry": 0.6, "shade": 0.4}}},
    "hills": {"terrain": {"dem": "flint-hills"}},
    "low sun on hills": {
        "terrain": {"dem": "flint-hills", "seed": 7, "horizon_reach": 600},
        "geometry": {"sza": 73.0, "saa": 95.0},
    },
    "classes on hills": {"terrain": {"dem": "flint-hills", "horizon_reach": 300}, "landscape": {"cover": "pastures"}},
    "classes": {"landscape": {"cover": "pastures"}},
    "varying": {"landscape": {"deviations": {"soil": 0.03, "brown": 0.05}}, "ground": {"brown": 0.2}},
    "adjacency": {"atmosphere": {"adjacency": True}},
    "coupled on hills": {
        "atmosphere": {"coupling": "four-stream"},
        "terrain": {"dem": "flint-hills", "horizon_reach": 300},
    },
}


def scenario(**tables):
    return Scenario(**merged({"grid": SMALL, "landscape": NOT_LEARNED}, {"terrain": FLAT} | tables))


@pytest.mark.parametrize("case", CASES)
def test_realisation_is_identical_to_simulating_its_scenario(case):
    one = scenario(**CASES[case])
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
        node = found["image"] if name in image else found["truth"]
        np.testing.assert_array_equal(values, node[name])


# ------------------------------------------------------------------------------------------ every key

PATCHES = {"landscape": {"cover": "pastures", "size": 100.0}}
CLASSES = PATCHES | {"classes": {"a": {}, "b": {"brown": 0.5}}}
SHARES = PATCHES | {"classes": {"a": {"share": 0.5}, "b": {"share": 0.5, "brown": 0.5}}}
CODES = {"landscape": {"cover": "cover.tif"}, "classes": {"a": {"code": 1}, "b": {"code": 2, "brown": 0.5}}}
BY_BAND = {"leaf_reflectance": {"TM3": 0.08, "TM4": 0.4}, "leaf_transmittance": {"TM3": 0.05, "TM4": 0.3}}
HILLS = {"terrain": {"dem": "flint-hills", "horizon_reach": 100.0}}
DARK = {"terrain": {"dem": "flint-hills", "horizon_reach": 600.0}, "geometry": {"sza": 74.0, "saa": 95.0}}
FILE = {"terrain": {"dem": "dem.tif", "horizon_reach": 100.0}}
PLACE = {"geometry": {"time": "1987-06-06T16:35Z"}, "atmosphere": {"altitude": 0.4}}
SUN = {"geometry": {"sza": 30.0, "saa": 120.0}}
SKY = {"clouds": {"cloud_cover": 0.5, "length": 200.0, "base": 100.0, "top": 150.0, "thickness": 3.0}}
OLI = {"sensor": {"instrument": "OLI", "bands": ["OLI4", "OLI5"], "noise": ["thermal"]}}

STAND = {
    "distribution": ("unburned-ungrazed", {}),
    "arp": (0.2, {}),
    "leaf_angles": ("planophile", {}),
    "model": ("discrete-ordinates", {}),
    "hotspot": (0.2, {}),
    "brown": (0.3, {}),
    "dissociation": (0.5, {"brown": 0.3}),
    "crown_cover": (0.6, {}),
    "crown_shape": (0.2, {"crown_cover": 0.6}),
    "soil": (0.05, {}),
    "moisture": (0.5, {}),
    "leaf_reflectance": ({"TM3": 0.1, "TM4": 0.45}, BY_BAND),
    "leaf_transmittance": ({"TM3": 0.01, "TM4": 0.2}, BY_BAND),
    "background": ({"TM3": 0.3, "TM4": 0.35}, {}),
    "leaf": ({"chlorophyll": 20.0}, {}),
    "brown_leaf": ({"brown": 0.2}, {"brown": 0.3}),
    "background_spectra": ({"soil_dry": 1.0}, {}),
}

# A value of each key that changes the image, the truth or the place, and the other keys that it needs.
CHANGES = {f"ground.{key}": (value, {"ground": others}) for key, (value, others) in STAND.items()}
CHANGES |= {
    f"classes.a.{key}": (value, CLASSES | {"classes": {"a": others, "b": {"soil": 0.1}}})
    for key, (value, others) in STAND.items()
}
CHANGES |= {
    "grid.crs": ("EPSG:32615", PLACE),
    "grid.west": (708010.0, {}),
    "grid.north": (4331010.0, {}),
    "grid.width": (180.0, {}),
    "grid.height": (180.0, {}),
    "grid.cell": (5.0, {}),
    "ground.seed": (8, {}),
    "ground.method": ("periodic", {}),
    "ground.lai_file": ("lai.tif", {}),
    "ground.fpar_inf": (0.9, {}),
    "landscape.learned": ("konza", {}),
    "landscape.cover": ("pastures", {}),
    "landscape.size": (60.0, PATCHES),
    "landscape.deviations": ({"soil": 0.1}, {}),
    "classes.a.share": (0.8, SHARES, {"classes": {"b": {"share": 0.2}}}),
    "classes.a.code": (2, CODES, {"classes": {"b": {"code": 1}}}),
    "terrain.dem": ("flint-hills", {"terrain": {"horizon_reach": 100.0}}),
    "terrain.seed": (8, HILLS),
    "terrain.fill": (100.0, {"terrain": {"dem": "hole.tif", "horizon_reach": 100.0}}),
    "terrain.vertical_units": ("ft", FILE),
    "terrain.horizon_reach": (30.0, DARK),
    "terrain.upwelling": (False, HILLS | {"geometry": {"vza": 30.0}}),
    "terrain.slopes": ("upright", HILLS),
    "geometry.time": ("1987-07-08T17:35Z", {}),
    "geometry.latitude": (30.0, {}),
    "geometry.longitude": (-90.0, {}),
    "geometry.sza": (50.0, SUN),
    "geometry.saa": (20.0, {"geometry": SUN["geometry"] | {"vza": 30.0}}),
    "geometry.vza": (30.0, {}),
    "geometry.vaa": (90.0, {"geometry": {"vza": 30.0}}),
    "atmosphere.profile": ("tropical", {}),
    "atmosphere.aerosol": ("urban", {}),
    "atmosphere.visibility": (10.0, {}),
    "atmosphere.aot": (0.6, {}),
    "atmosphere.altitude": (2.0, {}),
    "atmosphere.h2o": (6.0, {}),
    "atmosphere.o3": (0.6, {}),
    "atmosphere.engine": ("successive-orders", {"atmosphere": {"aerosol": "none"}, "sensor": {"bands": ["TM4"]}}),
    "atmosphere.coupling": ("four-stream", {}),
    "atmosphere.adjacency": (True, {}),
    "clouds.cloud_cover": (0.9, SKY),
    "clouds.thickness": (9.0, SKY),
    "clouds.deviation": (1.0, SKY),
    "clouds.length": (1000.0, SKY),
    "clouds.base": (20.0, SKY),
    "clouds.top": (900.0, SKY),
    "clouds.seed": (9, SKY),
    "clouds.mask": (0.1, SKY),
    "sensor.instrument": ("OLI", {"sensor": {"bands": ["red", "nir"]}}),
    "sensor.bands": (["TM4"], {}),
    "sensor.pixel": (40.0, {}),
    "sensor.interval": ("native", {}),
    "sensor.offset": ([0.4, -0.3], {}),
    "sensor.response": ("paper", {}),
    "sensor.noise": ([], OLI),
    "sensor.noise_model": ({"thermal": 5.0}, OLI),
    "sensor.seed": (4, OLI),
    "sensor.min_valid": (0.3, {}),
}

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


# ---------------------------------------------------------------------------------- drawn over all keys

DRAWN = 40  # and as many more as it takes to change every key
STREAMS = {"lambert": False, "four-stream": True, "directional": "directional"}


def drawn_scenarios():
    """Scenarios that each change four keys, drawn from all; combinations that a scenario refuses are drawn again."""
    draw, names = np.random.default_rng(54), sorted(set(CHANGES) - {NECESSARY, "grid.crs"})
    found, used = [], set()
    while len(found) < DRAWN or used < set(names):
        rest = sorted(set(names) - used) if len(found) >= DRAWN else names
        # The last draws take keys that no scenario has yet.
        chosen = [*draw.choice(rest, 1), *draw.choice(names, 3 if len(found) < DRAWN else 0)]
        tables = {"grid": SMALL | {"width": 240.0, "cell": 10.0}, "terrain": FLAT, "landscape": NOT_LEARNED}
        for name in map(str, chosen):
            value, others, *along = CHANGES[name]
            changed = {name.split(".")[-1]: value}
            for part in name.split(".")[-2::-1]:
                changed = {part: changed}
            tables = merged(merged(tables, merged(others, changed)), *along or [{}])
        try:
            one = Scenario(**tables)
            one.complete()
        except ValueError:
            continue
        used |= set(map(str, chosen))
        found.append(one)
    return found


def by_verbs(one):
    """Image of a scenario by public functions."""
    setup, grid = setup_of(one), one.geobox()
    dem, horizon, _ = elevation(one, grid)
    land, air = ground_scene(one, grid, dem=dem), {"atmosphere": setup.atmosphere, "geometry": setup.geometry}
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


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_simulate_verbs_chips_and_sweeps_are_equal_for_scenarios_drawn_over_all_keys(files, monkeypatch):
    monkeypatch.chdir(files)
    for one in drawn_scenarios():
        run, text = simulate(one, None), repr(one)
        image, truth = realise_arrays(one)
        for each, values in (image | truth).items():
            node = run["image"] if each in run["image"].variables else run["truth"]
            np.testing.assert_array_equal(values, node[each], err_msg=f"{each}\n{text}")
        np.testing.assert_array_equal(by_verbs(one), run["image"]["dn"], err_msg=text)
        if "ndvi" not in image or one.sensor.interval != "product":
            continue
        found = fifesim.scenario.sweep(one, {"ground.seed": [one.ground.seed]}).compute(scheduler="synchronous")
        for name in ("lai", "fpar"):
            fit = fifesim.regress(run["truth"][name], run["image"]["ndvi"])
            assert found["slope"].sel(variable=name).item() == fit.slope, text
