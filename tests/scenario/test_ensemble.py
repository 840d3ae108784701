import numpy as np
import pytest

from fifesim.scenario.ensemble import LIGHT, realise, realise_arrays
from fifesim.scenario.scenario import Scenario
from fifesim.scenario.simulation import simulate

SMALL = {"width": 300.0, "height": 240.0, "west": 708000.0, "north": 4331000.0}
FLAT = {"dem": "flat"}
NOISE = {"noise": ["thermal"], "seed": 3}

# Each case changes settings that the others leave at their defaults.
CASES = {
    "flat": {},
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
    return Scenario(**{"grid": SMALL, "terrain": FLAT} | tables)


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
