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

VALUES = [
    (totals, ([[1e16, 1.0], [1.0, 2.0], [-1e16, 3.0]],), [1.0, 6.0]),
    (covers, ("continental", 0.4, 2.5), True),
    (covers, ("continental", 0.4, 10.0), False),
    (nodes_of, ([Band("red", (0.6, 0.65), (1, 1))],), [0.55, 0.59, 0.633, 0.67, 0.694]),
    (whole_cells, (100.5, 10.0), (10, 0.5)),
    (whole_cells, (100.5, -10.0), (-11, -9.5)),
    (centres, (100.5, 10.0, np.array([0, 3])), [105.5, 135.5]),
    (rise, (0.0, 1.0, 5.0), 5.0),
    (rise, (np.nan, 1.0, 5.0), 8.0),
    (rise, (np.nan, 1.0, np.nan), 0.0),
    (full_path, ("../lai.tif", "/data/runs"), "/data/lai.tif"),
    (full_path, ("/vsizip//data/maps.zip/lai.tif", "/data/runs"), "/vsizip//data/maps.zip/lai.tif"),
    (key, ("Landsat-8 OLI",), key("landsat 8 oli")),
    (band_name, ("B04",), "MSI4"),
    (band_name, ("B8A",), "MSI8A"),
    (mask_bits, ([0, 1, 0], [0, 1, 0], [0, 0, 1]), [0, 3, 4]),
    (lambda angles: round(sphere(angles)[1].sum(), 6), ([0.0, 90.0, 180.0],), 1.0),
]


@pytest.mark.parametrize(("function", "arguments", "expected"), VALUES)
def test_small_function_has_its_value(function, arguments, expected):
    assert np.array_equal(function(*arguments), expected)
