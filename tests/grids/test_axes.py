"""Dimensions of a raster as people have them."""

import numpy as np
import pytest
import xarray as xr

import fifesim
from fifesim.grids.grid import check_axes, north_up


def test_rows_from_the_south_are_turned(lai):
    turned = lai.isel(y=slice(None, None, -1))
    xr.testing.assert_identical(north_up(turned), lai)
    assert north_up(lai) is lai
    np.testing.assert_array_equal(turned.fifesim.surface_reflectance(), lai.fifesim.surface_reflectance())


@pytest.mark.parametrize(
    ("dims", "said"),
    [
        (("latitude", "longitude"), r"rename\(latitude='y', longitude='x'\)\.rio\.write_crs\(4326\)\.rio\.reproject"),
        (("lat", "lon"), r"rename\(lat='y', lon='x'\)\.rio\.write_crs"),
        (("northing", "easting"), r"type \.rename\(northing='y', easting='x'\)$"),
        (("row", "sample"), r"got \('row', 'sample'\): rename or select"),
    ],
)
def test_other_names_of_dimensions_say_what_to_type(dims, said):
    with pytest.raises(ValueError, match=said):
        check_axes(xr.DataArray(np.ones((2, 3)), dims=dims))
    with pytest.raises(ValueError, match=said):
        fifesim.to_toa(xr.DataArray(np.ones((2, 3)), dims=dims))


def test_what_is_no_raster_is_refused():
    with pytest.raises(TypeError, match=r"a raster is an xarray\.DataArray, got ndarray"):
        check_axes(np.ones((2, 3)))
