"""
Realisations of an ensemble are identical to the bit to scenes simulated alone, for drawn scenarios.

The suite draws 12 scenes. To draw more:

    FIFESIM_DRAWS=1000 pytest tests/properties/test_drawn_ensembles.py
"""

import os

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fifesim.scenario.ensemble import realise
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import simulate

DRAWS = int(os.environ.get("FIFESIM_DRAWS", 12))
CELL = 30 / 9


def between(low, high):
    return st.floats(low, high).map(lambda value: round(value, 3))


def table(**keys):
    return st.fixed_dictionaries({}, optional=keys)


OPTICS = {band: between(0.03, 0.45) for band in ("TM3", "TM4")}
GROUND = table(
    distribution=st.sampled_from(["burned-grazed", "unburned-ungrazed"]),
    arp=between(0.0, 0.249),
    seed=st.integers(0, 3),
    method=st.sampled_from(["streaming", "periodic"]),
    leaf_reflectance=st.fixed_dictionaries(OPTICS),
    leaf_transmittance=st.fixed_dictionaries(OPTICS),
    background=st.fixed_dictionaries({band: between(0.0, 0.6) for band in ("TM3", "TM4")}),
    leaf_angles=st.sampled_from(["spherical", "planophile", "campbell(57)"]),
    hotspot=between(0.0, 0.3),
    brown=between(0.0, 0.6),
    dissociation=between(0.0, 1.0),
    crown_cover=between(0.3, 1.0),
    fpar_inf=between(0.5, 1.0),
)
SUN = {"sza": between(0.0, 60.0), "saa": between(0.0, 360.0), "vza": between(0.0, 40.0), "vaa": between(0.0, 360.0)}
AIR = table(visibility=between(8.0, 90.0), profile=st.sampled_from(["us-1962", "tropical"]), adjacency=st.booleans())
SENSOR = table(
    interval=st.sampled_from(["product", "native", 25.0, 33.0]),
    offset=st.tuples(between(-0.5, 0.5), between(-0.5, 0.5)).map(list),
    min_valid=between(0.1, 0.98),
    pixel=st.sampled_from([30.0, 20.0]),
    seed=st.integers(0, 3),
)
NOISE = st.sampled_from([[], ["thermal"], ["shot", "thermal"]]).map(
    lambda kinds: {"noise": kinds, "noise_model": {"thermal": 0.4, "shot": 0.02}} if kinds else {}
)
PLACE = st.tuples(st.integers(-40, 900), st.integers(-40, 900))


@settings(max_examples=DRAWS, suppress_health_check=list(HealthCheck))
@given(GROUND, st.none() | st.fixed_dictionaries(SUN), AIR, SENSOR, NOISE, PLACE)
def test_realisation_is_identical_to_the_scene_alone(ground, sun, air, sensor, noise, place):
    if ("leaf_reflectance" in ground) != ("leaf_transmittance" in ground):
        ground = {key: value for key, value in ground.items() if not key.startswith("leaf_")}
    for band in ground.get("leaf_reflectance", ()):
        # Reflectance and transmittance of a leaf must not exceed 1 together.
        ground["leaf_transmittance"][band] = min(ground["leaf_transmittance"][band], 0.5)
    down, across = place
    sensor = sensor | noise
    grid = {"west": 708000.0 + across * CELL, "north": 4331000.0 - down * CELL, "width": 150.0, "height": 120.0}
    one = Scenario(grid=grid, ground=ground, geometry=sun or {}, atmosphere=air, sensor=sensor, terrain={"dem": "flat"})
    alone, found = simulate(one), realise(one)
    for name, node in found.items():
        expected = alone[name].to_dataset().compute()
        assert set(node.variables) == set(expected.variables)
        for key, variable in expected.variables.items():
            np.testing.assert_array_equal(node.variables[key], variable)
