"""Single values of small functions whose other tests are indirect."""

import numpy as np
import pytest

from fifesim.analysis.regression import totals
from fifesim.atmosphere.aerosols import covers
from fifesim.atmosphere.coupling import nodes_of
from fifesim.atmosphere.mixtures import sphere
from fifesim.base.bands import Band
from fifesim.base.lattice import centres, whole_cells
from fifesim.ground.terrain.slope import rise
from fifesim.scenario.toml import full_path
from fifesim.sensor.description.fields import key
from fifesim.sensor.products.sentinel2_labels import band_name
from fifesim.sensor.response.calibration import mask_bits


def test_totals_are_exact():
    assert totals([[1e16, 1.0], [1.0, 2.0], [-1e16, 3.0]]) == [1.0, 6.0]


def test_aerosol_tables_have_a_range():
    assert covers("continental", 0.4, 2.5) and not covers("continental", 0.4, 10.0)


def test_weights_of_the_sphere_sum_to_one():
    assert sphere([0.0, 90.0, 180.0])[1].sum() == pytest.approx(1, abs=1e-6)


def test_nodes_reach_beyond_a_band():
    assert nodes_of([Band("red", (0.6, 0.65), (1, 1))]).tolist() == [0.55, 0.59, 0.633, 0.67, 0.694]


def test_lattice_counts_from_the_origin():
    assert whole_cells(100.5, 10.0) == (10, 0.5) and whole_cells(100.5, -10.0) == (-11, -9.5)
    assert centres(100.5, 10.0, np.array([0, 3])).tolist() == [105.5, 135.5]


def test_rise_continues_past_a_missing_end():
    assert (rise(0.0, 1.0, 5.0), rise(np.nan, 1.0, 5.0), rise(np.nan, 1.0, np.nan)) == (5.0, 8.0, 0.0)


def test_paths_of_a_scenario():
    assert full_path("../lai.tif", "/data/runs") == "/data/lai.tif"
    assert full_path("/vsizip//data/maps.zip/lai.tif", "/data/runs") == "/vsizip//data/maps.zip/lai.tif"


def test_spellings_of_names():
    assert key("Landsat-8 OLI") == key("landsat 8 oli")
    assert [band_name(name) for name in ("B04", "B8A", "MSI12")] == ["MSI4", "MSI8A", "MSI12"]


def test_masks_become_bits():
    assert mask_bits([0, 1, 0], [0, 1, 0], [0, 0, 1]).tolist() == [0, 3, 4]
