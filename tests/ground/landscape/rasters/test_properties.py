"""What standard normal fields become."""

import numpy as np
import pytest
from lazy import check_raster_function
from scipy import stats

import fifesim
from fifesim.ground.landscape.rasters.properties import with_deviation, with_distribution


@pytest.fixture(scope="module")
def fields(site):
    return fifesim.correlated_fields(site, {"lai": 0.15, "soil": 0.24}, {("lai", "soil"): -0.4}, seed=7)


def test_leaf_area_alone_is_that_of_the_scene(site, fields):
    """Whatever else there is, the field of the name lai has the seed's own noise."""
    scene = fifesim.lai_scene(site, "burned-grazed", arp=0.15, seed=7)
    lai = with_distribution(fields["lai"], "lai", fifesim.lai_distribution("burned-grazed"))
    np.testing.assert_array_equal(lai, scene)
    assert lai.attrs["standard_name"] == "leaf_area_index" and lai.attrs["site"] == "FIFE"


def test_deviation_scales(fields):
    soil = with_deviation(fields["soil"], "soil", 0.04)
    np.testing.assert_array_equal(soil, fields["soil"] * 0.04)
    assert soil.name == "soil" and soil.attrs["units"] == "1" and soil.attrs["arp"] == 0.24
    with pytest.raises(ValueError, match="deviation of soil must not be negative"):
        with_deviation(fields["soil"], "soil", -0.1)
    with pytest.raises(ValueError, match="moisture cannot be negative"):
        with_distribution(fields["soil"], "moisture", stats.norm(0.3, 0.1))


def test_properties_keep_the_promises_of_rasters(fields):
    moisture = stats.beta(2, 6)
    check_raster_function(lambda z: with_distribution(z, "moisture", moisture), fields["soil"], quantity="moisture")
    check_raster_function(lambda z: with_deviation(z, "soil", 0.04), fields["soil"], quantity="soil")
