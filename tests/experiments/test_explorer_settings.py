"""Settings of the sliders of a page; the results of each setting equal the public functions."""

from dataclasses import replace

import numpy as np
import pytest

import fifesim
from fifesim.experiments.explorer_settings import Setting, outcomes_of, sweep_of
from fifesim.experiments.scatter.stages import STAGES, VARIABLES
from fifesim.scenario.scenario import parse_scenario

FLAT = {"terrain": {"dem": "flat"}}
SITE = {"west": 704970.0, "north": 4334220.0, "width": 3000.0, "height": 3000.0}


def test_default_is_the_default_scenario():
    sweep = sweep_of()
    assert sweep.arps == (None,) and sweep.scenario.learned == "konza" and sweep.scenario.terrain.dem == "flint-hills"
    box, whole = sweep.scenario.geobox(), fifesim.Scenario().geobox()
    assert box.shape == (270, 270)
    assert (box.affine.c - whole.affine.c) % 30 == pytest.approx(0, abs=1e-6)


def test_sliders_have_the_values_of_the_scenario():
    own = FLAT | {"grid": SITE, "ground": {"arp": 0.2}, "geometry": {"sza": 33.0, "saa": 90.0}}
    own |= {"atmosphere": {"visibility": 30.0}}
    sweep = sweep_of(parse_scenario(own | {"sensor": {"instrument": "OLI", "offset": [0.3, 0.4]}}))
    assert sweep.arps == (0.15, 0.2, 0.249) and sweep.hazes == (10.0, 30.0, 45.0) and sweep.szas == (20.0, 33.0, 60.0)
    assert "OLI" in sweep.instruments and (0.3, 0.4) in sweep.offsets and len(sweep.offsets) == 4


def test_setting_changes_only_its_values_of_the_scenario(small):
    sensor = {"sensor": {"instrument": "L4TM", "noise": ["thermal"], "min_valid": 0.9}}
    sweep = sweep_of(parse_scenario(small.model_dump(exclude_unset=True) | sensor))
    own = sweep.at(Setting(0.249, 10.0, 60.0, "L4TM"), (0.0, 0.5))
    assert (own.ground.arp, own.atmosphere.visibility, own.sensor.offset) == (0.249, 10.0, [0.0, 0.5])
    assert own.sun_and_view().sza == 60.0 and own.sun_and_view().saa == sweep.scenario.sun_and_view().saa
    assert own.ground.seed == 3 and own.geobox() == sweep.scenario.geobox()
    assert sweep.at(Setting(0.24, 10.0, 60.0, "MSS")).sensor.noise == []
    other = sweep.at(Setting(0.24, 10.0, 60.0, "MSI"))
    assert other.sensor.bands == ["MSI4", "MSI8"] and other.sensor.noise == ["all"] and other.sensor.min_valid == 0.9


def test_instruments_fit_the_ground_and_its_cells(small):
    """MSS has 6 pixels in 360 m; a cell of 20 m is larger than a pixel of MSI."""
    assert sweep_of(small).instruments == ("MSI", "HRV", "TM")
    coarse = parse_scenario(FLAT | {"grid": SITE | {"cell": 25.0}, "sensor": {"instrument": "MODIS"}})
    found = sweep_of(coarse)
    assert found.instruments == ("TM", "MSS", "MODIS") and found.scenario.geobox().shape == (120, 120)


def test_maps_have_no_arp_slider_and_clear_air_no_haze_slider(tmp_path):
    grid, path = fifesim.grid_at("EPSG:26914", 707970.0, 4331220.0, 400.0, 400.0, 10.0), tmp_path / "lai.tif"
    fifesim.lai_scene(grid, "burned-grazed", arp=0.24, seed=1).fifesim.to_geotiff(path)
    ground = {"ground": {"lai_file": str(path)}, "grid": {"cell": 10.0}}
    own = parse_scenario(FLAT | ground | {"atmosphere": {"aerosol": "none"}})
    sweep = sweep_of(own)
    assert sweep.arps == (None,) and sweep.hazes == (None,)
    np.testing.assert_array_equal(sweep.at(sweep.settings[0]).ground.arp, own.ground.arp)


def test_landscape_with_many_stages_has_fewer_settings():
    sweep = sweep_of(fifesim.scenario.default_scenario())
    assert sweep.shape == (1, 2, 2, 2, 4) and sweep_of(fifesim.Scenario(base="paper")).shape == (3, 3, 3, 4, 4)
    assert sweep.hazes == (10.0, 45.0) and sweep.szas[1] == 60.0 and sweep.instruments == ("MSI", "TM")


def test_ground_and_atmosphere_limit_the_sliders(small):
    """Optics by band exclude other instruments, and haze given as optical thickness stays optical thickness."""
    values = small.model_dump(exclude_unset=True)
    sweep = sweep_of(parse_scenario(values | {"atmosphere": {"aot": 0.15}}))
    assert sweep.haze == "aot" and sweep.hazes == (0.05, 0.15, 0.5)
    assert sweep.at(replace(sweep.settings[0], haze=0.5)).atmosphere.aot == 0.5
    values["ground"] |= {"leaf_reflectance": {"TM3": 0.1, "TM4": 0.5}, "leaf_transmittance": {"TM3": 0.05, "TM4": 0.4}}
    assert sweep_of(parse_scenario(values)).instruments == ("TM",)
    with pytest.raises(ValueError, match="fewer than 12 x 12 pixels of 30 m"):
        sweep_of(parse_scenario(FLAT | {"grid": SITE | {"width": 300.0}}))


PLACES = [(0, 0, 0, 1, 0), (1, 0, 1, 0, 1)]


def scenario_at(sweep, place):
    setting = sweep.settings[np.ravel_multi_index(place[:4], sweep.shape[:4])]
    return sweep.at(setting, sweep.offsets[place[4]])


def test_shares_and_curvature_add_up_to_the_unexplained_variance(outcomes):
    left = outcomes.shares.sum(axis=-1) + outcomes.curvature
    np.testing.assert_allclose(1 - outcomes.lines[..., 2], left, atol=1e-12)
    registration = outcomes.shares[..., list(STAGES).index("registration")]
    assert (registration[..., 0, :] == 0).all() and (registration[..., 1, :] > 0).all()


def test_reflectance_of_the_digital_numbers_equals_the_image(sweep, outcomes):
    """NDVI on the page equals `fifesim.ndvi` for every sun angle."""
    place = (1, 0, 1, 0, 0)
    run = fifesim.simulate(scenario_at(sweep, place))
    counts = outcomes.images[0][1, 0, 1, 0]
    red, nir = (outcomes.cameras[0].reflectance[k][counts[k]] for k in (0, 1))
    np.testing.assert_allclose((nir - red) / (nir + red), run["image"]["ndvi"].values, rtol=1e-12)
    expected = run["image"]["dn"].fifesim.to_reflectance().values[0] * np.cos(np.radians(sweep.szas[1]))
    np.testing.assert_allclose(red, expected, rtol=1e-12)


@pytest.mark.parametrize("place", PLACES)
def test_outcomes_equal_the_public_functions(place, sweep, outcomes, with_data):
    arp, haze, sza, instrument, offset = place
    scenario = scenario_at(sweep, place)
    run = fifesim.simulate(scenario)
    np.testing.assert_array_equal(outcomes.scenes[arp], run["scene"]["lai"].values)
    rows, columns = outcomes.images[instrument].shape[-2:]
    np.testing.assert_array_equal(outcomes.images[instrument][arp, haze, sza, offset], run["image"]["dn"].values)
    truth, ndvi = with_data(scenario)
    for k, name in enumerate(VARIABLES):
        found = outcomes.truths[instrument][arp, sza, k]
        np.testing.assert_array_equal(found, run["truth"][name].values[:rows, :columns])
        line = fifesim.regress(truth[name], ndvi, pair="index")
        np.testing.assert_allclose(outcomes.lines[place][k], [line.slope, line.intercept, line.r2, line.n], rtol=1e-9)
    budget = fifesim.budget(scenario, realisations=1, cells=400).isel(realisation=0)
    np.testing.assert_allclose(outcomes.shares[place], budget["share"].sel(variable=list(VARIABLES)), atol=1e-12)
    np.testing.assert_allclose(outcomes.curvature[place], budget["curvature"], atol=1e-12)


def test_constant_ndvi_gives_no_line(small):
    """MSS has 6 bits, and the scene is hazy with patches of 4 m."""
    values = small.model_dump(exclude_unset=True) | {"sensor": {"instrument": "MSS"}}
    values["grid"] |= {"width": 720.0, "height": 720.0}
    one = {"arps": (0.0,), "hazes": (5.0,), "szas": (60.0,), "instruments": ("MSS",), "offsets": ((0.0, 0.0),)}
    found = outcomes_of(replace(sweep_of(parse_scenario(values)), **one))
    flat = np.isnan(found.lines[..., 0])
    assert flat.any() and (found.lines[..., 2][flat] == 0).all()
    np.testing.assert_allclose(found.shares.sum(axis=-1) + found.curvature, 1 - found.lines[..., 2], atol=1e-12)
