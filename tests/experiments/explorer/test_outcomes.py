"""What comes of every setting: the numbers of the public functions."""

from dataclasses import replace

import numpy as np
import pytest

import fifesim
from fifesim.experiments.explorer.outcomes import outcomes_of
from fifesim.experiments.explorer.settings import sweep_of
from fifesim.experiments.scatter.stages import STAGES, VARIABLES
from fifesim.scenario.scenario import parse_scenario

PLACES = [(0, 0, 0, 1, 0), (1, 0, 1, 0, 1)]


def scenario_at(sweep, place):
    setting = sweep.settings[np.ravel_multi_index(place[:4], sweep.shape[:4])]
    return sweep.at(setting, sweep.offsets[place[4]])


def test_shares_and_curvature_are_what_the_line_leaves(outcomes):
    left = outcomes.shares.sum(axis=-1) + outcomes.curvature
    np.testing.assert_allclose(1 - outcomes.lines[..., 2], left, atol=1e-12)
    registration = outcomes.shares[..., list(STAGES).index("registration")]
    assert (registration[..., 0, :] == 0).all() and (registration[..., 1, :] > 0).all()


def test_reflectance_of_the_numbers_is_that_of_the_image(sweep, outcomes):
    """NDVI of the page is that of `fifesim.ndvi`, whatever the sun."""
    place = (1, 0, 1, 0, 0)
    run = fifesim.simulate(scenario_at(sweep, place))
    counts = outcomes.images[0][1, 0, 1, 0]
    red, nir = (outcomes.cameras[0].reflectance[k][counts[k]] for k in (0, 1))
    np.testing.assert_allclose((nir - red) / (nir + red), run["image"]["ndvi"].values, rtol=1e-12)
    expected = run["image"]["dn"].fifesim.to_reflectance().values[0] * np.cos(np.radians(sweep.szas[1]))
    np.testing.assert_allclose(red, expected, rtol=1e-12)


@pytest.mark.parametrize("place", PLACES)
def test_outcomes_are_those_of_the_public_functions(place, sweep, outcomes, with_data):
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


def test_where_all_pixels_have_one_ndvi_there_is_no_line(small):
    """Six bits of MSS over patches of 4 m in haze."""
    values = small.model_dump(exclude_unset=True) | {"sensor": {"instrument": "MSS"}}
    values["grid"] |= {"width": 720.0, "height": 720.0}
    one = {"arps": (0.0,), "hazes": (5.0,), "szas": (60.0,), "instruments": ("MSS",), "offsets": ((0.0, 0.0),)}
    found = outcomes_of(replace(sweep_of(parse_scenario(values)), **one))
    flat = np.isnan(found.lines[..., 0])
    assert flat.any() and (found.lines[..., 2][flat] == 0).all()
    np.testing.assert_allclose(found.shares.sum(axis=-1) + found.curvature, 1 - found.lines[..., 2], atol=1e-12)
